"""Receive and transmit PDOs of a slave (CiA 301; C301-035, C301-036, C301-038 to C301-056)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Final, Protocol

from fieldbus.can.frame import CanFrame
from fieldbus.can.timing import FrameMaker
from fieldbus.canopen.dictionary import ObjectValue
from fieldbus.canopen.pdo_mapping import EMPTY, Applier, Layout, Sampler
from fieldbus.clock import MS, Scheduler, Timer

EMCY_TOO_SHORT: Final = 0x8210
EMCY_TOO_LONG: Final = 0x8220
EMCY_RPDO_TIMEOUT: Final = 0x8250


def _no_payload() -> bytes:
    return b""


def _no_effect(_data: bytes) -> None:
    pass


class PdoCycle:
    """What the PDOs of a node share: whether they are in effect, and the last SYNC."""

    def __init__(self) -> None:
        self.operational = False
        self.sync_ns = -1
        """Time of the last SYNC in Operational, ns; -1 before the first."""
        self.window_ns = 0
        """Synchronous window 1007h, ns; 0 = whole cycle."""
        self.muted: frozenset[int] = frozenset()
        """Keys of objects that no TPDO may carry at present; a TPDO that maps one is not sent."""


class RpdoErrors:
    """Wrong lengths and overdue RPDOs: an EMCY is raised once, and ends with the last PDO that has the error.

    Args:
        emcy: Raises an error by code.
        emcy_clear: Ends an error by code.
        on_timeout: Called with the number of an RPDO that has not come in time.

    """

    def __init__(
        self,
        *,
        emcy: Callable[[int], object],
        emcy_clear: Callable[[int], object],
        on_timeout: Callable[[int], None],
    ) -> None:
        self.lengths: dict[int, int] = {}
        """RPDOs whose last frame had a wrong length, by number, with the EMCY code."""
        self.overdue: set[int] = set()
        """Numbers of the RPDOs that are overdue."""
        self._emcy = emcy
        self._emcy_clear = emcy_clear
        self._on_timeout = on_timeout

    def reset(self) -> None:
        """Forget everything; the errors themselves end with the reset."""
        self.lengths.clear()
        self.overdue.clear()

    def length_wrong(self, number: int, code: int) -> None:
        """Report a wrong length once until a correct frame has come (C301-054)."""
        if self.lengths.get(number) != code:
            self.length_correct(number)
            self.lengths[number] = code
            self._emcy(code)

    def length_correct(self, number: int) -> None:
        """Note a frame of the right length."""
        code = self.lengths.pop(number, None)
        if code is not None and code not in self.lengths.values():
            self._emcy_clear(code)

    def lost(self, number: int) -> None:
        """Report an overdue RPDO (C301-049)."""
        self.overdue.add(number)
        self._emcy(EMCY_RPDO_TIMEOUT)
        self._on_timeout(number)

    def back(self, number: int) -> None:
        """Note that an overdue RPDO has come."""
        self.overdue.discard(number)
        if not self.overdue:
            self._emcy_clear(EMCY_RPDO_TIMEOUT)


class Watcher(Protocol):
    """Something that is sent when its objects change."""

    dirty: bool
    """An object may have changed; looked at when the present instant ends."""


class Pdo:
    """What both directions have in common: the communication parameters as they are in effect."""

    receive = False

    def __init__(
        self,
        number: int,
        key: int,
        map_key: int,
        *,
        scheduler: Scheduler,
        values: Mapping[int, ObjectValue],
        cycle: PdoCycle,
    ) -> None:
        self._scheduler = scheduler
        self._values = values
        self._cycle = cycle
        self.number = number
        """1 for 1400h or 1800h, 2 for the next, and so on."""
        self.key = key
        """Key of the communication record, sub-index 0."""
        self.map_key = map_key
        """Key of the mapping record, sub-index 0."""
        self.can_id = 0
        self.extended = False
        self.rtr = False
        self.valid = False
        self.kind = 255
        self.layout: Layout = EMPTY
        self.multiplex = 0
        """FEh, FFh: a multiplex PDO in source or destination address mode; 0 = an ordinary one."""

    @property
    def synchronous(self) -> bool:
        """Whether SYNC drives it: types 0 to 240."""
        return self.kind <= 240

    def stop(self) -> None:
        """Forget what is under way, as on leaving Operational."""
        raise NotImplementedError

    def read_parameters(self) -> None:
        """Take identifier and transmission type from the values."""
        values = self._values
        cob_id = values.get(self.key | 1, 1 << 31)
        self.valid = not cob_id >> 31
        self.rtr = not cob_id >> 30 & 1
        self.extended = bool(cob_id >> 29 & 1)
        self.can_id = cob_id & (0x1FFFFFFF if self.extended else 0x7FF)
        self.kind = values.get(self.key | 2, 255)


class ReceivePdo(Pdo):
    """One RPDO: checks the length, waits for SYNC when synchronous, stores.

    Args:
        number: 1 for 1400h, 2 for the next, and so on.
        key: Key of the communication record, sub-index 0.
        map_key: Key of the mapping record, sub-index 0.
        scheduler: Time.
        values: Present values of the dictionary.
        cycle: What all PDOs of the node share.
        errors: Reports wrong lengths and timeouts.
        mark: Has event-driven PDOs looked at when the present instant ends.
        multiplexed: Takes the address mode and the bytes of a multiplex PDO.

    """

    receive = True

    def __init__(
        self,
        number: int,
        key: int,
        map_key: int,
        *,
        scheduler: Scheduler,
        values: Mapping[int, ObjectValue],
        cycle: PdoCycle,
        errors: RpdoErrors,
        mark: Callable[[Iterable[Watcher]], None],
        multiplexed: Callable[[int, bytes], None],
    ) -> None:
        super().__init__(number, key, map_key, scheduler=scheduler, values=values, cycle=cycle)
        self._errors = errors
        self._mark = mark
        self._multiplexed = multiplexed
        self.apply: Applier = _no_effect
        """Stores a payload of the right length."""
        self._deadline_ns = 0
        self._last_ns = 0
        self._timed_out = False
        self._timer: Timer | None = None
        self.effective = 0
        """Frames that have become effective; lets a device see that a cycle has brought new data."""
        self.pending: bytes | None = None
        """Payload that becomes effective with the next SYNC."""
        self.size = 0
        self.watchers: tuple[Watcher, ...] = ()
        """Event-driven TPDOs that map an object of this one."""

    def compile(self, apply: Applier) -> None:
        """Put a new mapping in effect."""
        self.apply = apply
        self.size = 8 if self.multiplex else self.layout.size
        self._deadline_ns = self._values.get(self.key | 5, 0) * MS
        if self._timed_out and not (self.valid and self._deadline_ns):
            self._timed_out = False
            self._errors.back(self.number)
        if not self.valid:
            self._errors.length_correct(self.number)

    def restart(self) -> None:
        """Forget everything, as on reset."""
        self.stop()
        self._timed_out = False

    def stop(self) -> None:
        """Forget what is under way, as on leaving Operational; an overdue PDO stays so until it comes."""
        self.pending = None
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def on_event_frame(self, frame: CanFrame, time_ns: int) -> None:
        """Take a frame of types 254 and 255: effective at once (length: C301-054)."""
        data = self._accepted(frame.data, time_ns)
        if data is None:
            return
        self.effective += 1
        self.apply(data)
        if self.watchers:
            self._mark(self.watchers)

    def on_sync_frame(self, frame: CanFrame, time_ns: int) -> None:
        """Take a frame of types 0 to 240: effective with the next SYNC, unless it comes after the window."""
        data = frame.data
        if len(data) != self.size or self._deadline_ns or self._errors.lengths:
            self._scheduler.catch_up()
            accepted = self._accepted(data, time_ns)
            if accepted is None:
                return
            data = accepted
        if self._cycle.window_ns and self._outside_window(time_ns):
            return
        self.pending = data

    def _outside_window(self, time_ns: int) -> bool:
        cycle = self._cycle
        return cycle.sync_ns >= 0 and time_ns - cycle.sync_ns > cycle.window_ns

    def _accepted(self, data: bytes, time_ns: int) -> bytes | None:
        """Return the mapped part of a frame that has come, None when it is too short (C301-054)."""
        if len(data) != self.size:
            if len(data) < self.size:
                self._errors.length_wrong(self.number, EMCY_TOO_SHORT)
                return None
            self._errors.length_wrong(self.number, EMCY_TOO_LONG)
            data = data[: self.size]
        elif self._errors.lengths:
            self._errors.length_correct(self.number)
        if self._deadline_ns:
            self._fed(time_ns)
        return data

    def on_multiplex_frame(self, frame: CanFrame, time_ns: int) -> None:
        """Take a frame of a multiplex PDO: effective at once."""
        data = self._accepted(frame.data, time_ns)
        if data is not None:
            self._multiplexed(self.multiplex, data)

    @property
    def handler(self) -> Callable[[CanFrame, int], None]:
        """What takes its frames."""
        if self.multiplex:
            return self.on_multiplex_frame
        return self.on_sync_frame if self.synchronous else self.on_event_frame

    def _fed(self, time_ns: int) -> None:
        self._last_ns = time_ns
        if self._timed_out:
            self._timed_out = False
            self._errors.back(self.number)
        if self._timer is None:
            scheduler = self._scheduler
            self._timer = scheduler.at(max(time_ns + self._deadline_ns, scheduler.now), self._due)

    def _due(self) -> None:
        self._timer = None
        if not self._deadline_ns:
            return
        due = self._last_ns + self._deadline_ns
        if due > self._scheduler.now:
            self._timer = self._scheduler.at(due, self._due)
            return
        self._timed_out = True
        self._errors.lost(self.number)


class TransmitPdo(Pdo):
    """One TPDO: decides when to send and samples its objects at that instant.

    Args:
        number: 1 for 1800h, 2 for the next, and so on.
        key: Key of the communication record, sub-index 0.
        map_key: Key of the mapping record, sub-index 0.
        scheduler: Time.
        values: Present values of the dictionary.
        cycle: What all PDOs of the node share.
        send: Puts a frame on the bus.

    """

    def __init__(
        self,
        number: int,
        key: int,
        map_key: int,
        *,
        scheduler: Scheduler,
        values: Mapping[int, ObjectValue],
        cycle: PdoCycle,
        send: Callable[[CanFrame], None],
    ) -> None:
        super().__init__(number, key, map_key, scheduler=scheduler, values=values, cycle=cycle)
        self._send = send
        self.sample: Sampler = _no_payload
        self.last: bytes | None = None
        """Payload sent last since Operational was entered."""
        self.maker = FrameMaker(0)
        """Makes the frames that every SYNC sends; for 11-bit identifiers."""
        self.dirty = False
        """An object may have changed; looked at when the present instant ends."""
        self._counter = 0
        self._event = False
        self._inhibit_ns = 0
        self._inhibit_timer: Timer | None = None
        self._not_before_ns = 0
        self._period_ns = 0
        self._period_timer: Timer | None = None
        self._sampled: bytes | None = None
        self._sent_ns = 0
        self._start = 0
        self._started = False

    @property
    def every_sync(self) -> bool:
        """Whether each SYNC sends it, without any further rule."""
        return self.kind == 1 and not self._start and not self.extended

    @property
    def event_driven(self) -> bool:
        """Whether a change of its objects matters: types 0, 254 and 255."""
        return self.kind in (0, 254, 255)

    def compile(self, sample: Sampler, *, restart: bool = True) -> None:
        """Put new parameters in effect; with `restart` counters, timers and events are reset."""
        values = self._values
        self.sample = sample
        if not self.extended:
            self.maker = FrameMaker(self.can_id)
        self._inhibit_ns = values.get(self.key | 3, 0) * 100_000 if self.kind >= 254 else 0
        self._period_ns = values.get(self.key | 5, 0) * MS if self.kind >= 254 else 0
        self._start = values.get(self.key | 6, 0) if 1 <= self.kind <= 240 else 0
        if restart:
            self.stop()
            return
        running = self._cycle.operational and self.valid
        if self._period_timer is not None:
            self._period_timer.cancel()
            self._period_timer = None
        if running and self._period_ns:
            scheduler = self._scheduler
            self._period_timer = scheduler.at(scheduler.now + self._period_ns, self._period_over)

    def start(self) -> None:
        """Begin on entering Operational: event-driven PDOs are sent once (C301-019)."""
        if not self.layout.fields:
            return
        if self.kind >= 254:
            self.transmit()
        elif self.kind == 0:
            self.last = self.sample()

    def stop(self) -> None:
        """Stop timers and forget events, as on leaving Operational."""
        self.last = None
        self.dirty = False
        self._counter = 0
        self._event = False
        self._not_before_ns = 0
        self._sampled = None
        self._started = False
        for timer in (self._inhibit_timer, self._period_timer):
            if timer is not None:
                timer.cancel()
        self._inhibit_timer = self._period_timer = None

    # -- SYNC
    # -------------------------------------------------------------------------------------------------

    def on_sync(self, counter: int) -> None:
        """Do what the type says on a SYNC; `counter` 0 = SYNC without counter."""
        kind = self.kind
        if kind == 252:
            self._sampled = self.sample()
        elif kind == 0:
            if self._event:
                self._event = False
                self._emit(self.sample())
        elif self._start and counter and not self._started:
            # The PDO begins at the SYNC whose counter has the start value (C301-050).
            if counter == self._start:
                self._started = True
                self._counter = 0
                self._emit(self.sample())
        else:
            self._counter += 1
            if self._counter >= kind:
                self._counter = 0
                self._emit(self.sample())

    # -- events
    # -----------------------------------------------------------------------------------------------

    def look(self) -> None:
        """Send if the payload differs from the one sent last."""
        self.dirty = False
        if self.sample() != self.last:
            self.trigger()

    def trigger(self) -> None:
        """Take an event: send now, after the inhibit time, or with the next SYNC (type 0)."""
        if self.kind == 0:
            self._event = True
            self.last = self.sample()
            return
        if self.kind < 254:
            return
        if self._inhibit_ns and self._scheduler.now < self._not_before_ns:
            if self._inhibit_timer is None:
                self._inhibit_timer = self._scheduler.at(self._not_before_ns, self._inhibit_over)
            return
        self.transmit()

    def transmit(self) -> None:
        """Sample and send an event-driven PDO; restart inhibit time and event timer (C301-047, C301-048)."""
        scheduler = self._scheduler
        self._sent_ns = now = scheduler.now
        if self._inhibit_ns:
            self._not_before_ns = now + self._inhibit_ns
        if self._period_ns:
            self._begin_period()
        self._emit(self.sample())

    def _inhibit_over(self) -> None:
        self._inhibit_timer = None
        self.transmit()

    def _period_over(self) -> None:
        self._period_timer = None
        scheduler = self._scheduler
        due = self._sent_ns + self._period_ns
        if due > scheduler.now:
            self._period_timer = scheduler.at(due, self._period_over)
            return
        if self.layout.fields:
            self.trigger()
        self._begin_period()

    def _begin_period(self) -> None:
        """Start the event timer unless it runs.

        A method of its own: after `_period_timer = None` the compiler takes it for None, whatever a call has
        made of it.
        """
        if self._period_timer is None:
            self._period_timer = self._scheduler.at(self._scheduler.now + self._period_ns, self._period_over)

    def on_remote_frame(self, _frame: CanFrame, _time_ns: int) -> None:
        """Answer a remote request (C301-041, C301-042, C301-055)."""
        if self.kind == 252:
            if self._sampled is not None:
                self._emit(self._sampled)
        elif self.synchronous:
            self._emit(self.sample() if self.last is None else self.last)
        elif self.kind == 253:
            self._emit(self.sample())
        else:
            self.transmit()

    def _emit(self, payload: bytes) -> None:
        muted = self._cycle.muted
        if muted and not muted.isdisjoint(self.layout.keys):
            return
        self.last = payload
        self._send(CanFrame(self.can_id, payload, extended=self.extended))
