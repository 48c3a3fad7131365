"""Heartbeat producer and consumer, node guarding and life guarding of a slave
(CiA 301; C301-022 to C301-030).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.dictionary import ObjectValue
from fieldbus.canopen.nmt import COB_ERROR_CONTROL, NmtState
from fieldbus.canopen.store import ObjectStore
from fieldbus.clock import MS, Scheduler, Timer

_PRODUCER_TIME: Final = 0x101700
_CONSUMER: Final = 0x1016
_GUARD_TIME: Final = 0x100C00
_LIFE_FACTOR: Final = 0x100D00


class ErrorControl:
    """The node's own sign of life, and its watch over others.

    Args:
        scheduler: Time.
        store: Holds 100Ch, 100Dh, 1016h, 1017h.
        send: Puts a frame on the bus.
        node_id: Own node-ID.
        on_lost: Called with "heartbeat" or "life_guarding" when the peer is missing.
        on_found: Called when no peer is missing any more.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        store: ObjectStore,
        send: Callable[[CanFrame], None],
        *,
        node_id: int,
        on_lost: Callable[[str], None],
        on_found: Callable[[], None],
    ) -> None:
        self._scheduler = scheduler
        self._store = store
        self._send = send
        self._can_id = COB_ERROR_CONTROL + node_id
        self._on_lost = on_lost
        self._on_found = on_found
        self._state = NmtState.INITIALISING
        self._toggle = 0
        self._producer_timer: Timer | None = None
        self._life_timer: Timer | None = None
        self._guarded = 0
        self._life_lost = False
        self._watches: dict[int, _Watch] = {}
        self._lost: set[int] = set()
        self.silent = False
        """Suppresses heartbeats and guarding answers while true: a fault to inject."""
        self.lateness_ns = 0
        """Added to the period of the heartbeat, ns: a fault to inject."""
        self.on_remote_state: list[Callable[[int, int], None]] = []
        """Called with node-ID and state when a watched node changes state; 0 = boot-up (C301-027)."""
        self._consumer_subs = [key & 0xFF for key in store.entries if key >> 8 == _CONSUMER and key & 0xFF]
        for sub in self._consumer_subs:
            key = _CONSUMER << 8 | sub
            store.guards[key] = self._consumer_guard(sub)
        for key in (_GUARD_TIME, _LIFE_FACTOR):
            store.applied[key] = self._restart_life
        store.applied[_PRODUCER_TIME] = self._restart_producer

    def set_node_id(self, node_id: int) -> None:
        """Speak as another node from now on."""
        self._can_id = COB_ERROR_CONTROL + node_id

    @property
    def anyone_lost(self) -> bool:
        """Whether a watched node or the guarding master is missing."""
        return bool(self._lost) or self._life_lost

    def watched_ids(self) -> list[int]:
        """Return the identifiers whose frames `heartbeat` wants to see."""
        return [COB_ERROR_CONTROL + node for node in self._watches]

    def configure(self) -> None:
        """Read the consumer entries again; a watch whose entry has not changed continues."""
        watches: dict[int, _Watch] = {}
        for sub in self._consumer_subs:
            value = self._store.values[_CONSUMER << 8 | sub]
            node, time_ms = value >> 16 & 0xFF, value & 0xFFFF
            if 1 <= node <= 127 and time_ms and not value >> 24:
                old = self._watches.pop(node, None)
                if old is not None and old.timeout_ns == time_ms * MS:
                    watches[node] = old
                else:
                    if old is not None:
                        old.stop()
                    watches[node] = _Watch(self._scheduler, node, time_ms * MS, self._heartbeat_lost)
        for node, watch in self._watches.items():
            watch.stop()
            self._forget(node)
        self._watches = watches

    def reset(self) -> None:
        """Restart after reset communication: no watch has begun, toggle bit 0 (C301-028)."""
        self.stop()
        self.configure()

    def stop(self) -> None:
        """Stop all timers, as at power-off."""
        for watch in self._watches.values():
            watch.stop()
        self._watches = {}
        self._lost.clear()
        self._life_lost = False
        self._guarded = 0
        self._toggle = 0
        self._state = NmtState.INITIALISING
        self._cancel_life()
        if self._producer_timer is not None:
            self._producer_timer.cancel()
            self._producer_timer = None

    def enter_state(self, state: NmtState) -> None:
        """Send the boot-up when initialisation ends (C301-022), and heartbeats from then on."""
        booted = self._state == NmtState.INITIALISING and state != NmtState.INITIALISING
        self._state = state
        if booted:
            self._send(CanFrame(self._can_id, b"\0"))
            self._restart_producer()

    # -- producer
    # ---------------------------------------------------------------------------------------------

    def _restart_producer(self) -> None:
        if self._producer_timer is not None:
            self._producer_timer.cancel()
            self._producer_timer = None
        period_ms = self._store.values.get(_PRODUCER_TIME, 0)
        if period_ms:
            # Requests are not answered any more, so that none can be missed (C301-024).
            self._end_life_guarding()
        if period_ms and self._state != NmtState.INITIALISING:
            self._producer_timer = self._scheduler.after(period_ms * MS, self._produce)

    def _produce(self) -> None:
        period_ns = self._store.values[_PRODUCER_TIME] * MS + self.lateness_ns
        self._producer_timer = self._scheduler.after(period_ns, self._produce)
        if not self.silent:
            self._send(CanFrame(self._can_id, bytes((self._state,))))

    # -- consumer
    # ---------------------------------------------------------------------------------------------

    def heartbeat(self, frame: CanFrame, time_ns: int) -> None:
        """Take a frame with the identifier of a watched node's error control."""
        watch = self._watches.get(frame.can_id - COB_ERROR_CONTROL)
        if watch is None or not frame.data:
            return
        state = frame.data[0] & 0x7F
        if state == 0:
            watch.stop()  # a booting node is watched again from its first heartbeat on
        else:
            watch.feed(time_ns)
        if state != watch.state:
            watch.state = state
            for callback in self.on_remote_state:
                callback(watch.node, state)
        if self._lost:
            self._forget(watch.node)

    def _heartbeat_lost(self, node: int) -> None:
        self._lost.add(node)
        self._on_lost("heartbeat")

    def _forget(self, node: int) -> None:
        if node in self._lost:
            self._lost.discard(node)
            self._found()

    def _found(self) -> None:
        if not self.anyone_lost:
            self._on_found()

    def _consumer_guard(self, sub: int) -> Callable[[ObjectValue], None]:
        def check(value: ObjectValue) -> None:
            node = value >> 16 & 0xFF
            if not value & 0xFFFF or not 1 <= node <= 127:
                return
            for other in self._consumer_subs:
                entry = self._store.values[_CONSUMER << 8 | other]
                if other != sub and entry >> 16 & 0xFF == node and entry & 0xFFFF:
                    raise SdoAbort(AbortCode.PARAMETER)

        return check

    # -- guarding
    # ---------------------------------------------------------------------------------------------

    def guard(self, _frame: CanFrame, time_ns: int) -> None:
        """Take a remote frame with the own error control identifier (C301-024, C301-028)."""
        if self._store.values.get(_PRODUCER_TIME, 0) or self._state == NmtState.INITIALISING or self.silent:
            return
        self._send(CanFrame(self._can_id, bytes((self._state | self._toggle,))))
        self._toggle ^= 0x80
        self._guarded = time_ns
        if self._life_lost:
            self._life_lost = False
            self._found()
        if self._life_timer is None:
            self._arm_life(time_ns)

    def _life_time_ns(self) -> int:
        values = self._store.values
        return int(values.get(_GUARD_TIME, 0) * values.get(_LIFE_FACTOR, 0) * MS)

    def _arm_life(self, since_ns: int) -> None:
        life_ns = self._life_time_ns()
        if life_ns:
            self._life_timer = self._scheduler.at(
                max(since_ns + life_ns, self._scheduler.now), self._life_due
            )

    def _life_due(self) -> None:
        self._life_timer = None
        life_ns = self._life_time_ns()
        if not life_ns:
            return
        if self._scheduler.now - self._guarded < life_ns:
            self._arm_life(self._guarded)
        elif not self._life_lost:
            self._life_lost = True
            self._on_lost("life_guarding")

    def _restart_life(self) -> None:
        armed = self._life_timer is not None
        self._cancel_life()
        if not self._life_time_ns():
            self._end_life_guarding()
        elif armed:
            self._arm_life(self._guarded)

    def _end_life_guarding(self) -> None:
        """Watch the master no longer; it cannot be missing then."""
        self._cancel_life()
        if self._life_lost:
            self._life_lost = False
            self._found()

    def _cancel_life(self) -> None:
        if self._life_timer is not None:
            self._life_timer.cancel()
            self._life_timer = None


class _Watch:
    """One watched node; its timer is entered once per timeout, not once per heartbeat."""

    def __init__(
        self, scheduler: Scheduler, node: int, timeout_ns: int, on_lost: Callable[[int], None]
    ) -> None:
        self._scheduler = scheduler
        self._on_lost = on_lost
        self._timer: Timer | None = None
        self._last_ns = 0
        self.node = node
        self.timeout_ns = timeout_ns
        self.state = -1

    def feed(self, time_ns: int) -> None:
        self._last_ns = time_ns
        if self._timer is None:
            self._timer = self._scheduler.at(max(time_ns + self.timeout_ns, self._scheduler.now), self._due)

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _due(self) -> None:
        due = self._last_ns + self.timeout_ns
        if due > self._scheduler.now:
            self._timer = self._scheduler.at(due, self._due)
            return
        self._timer = None
        self.state = -1
        self._on_lost(self.node)
