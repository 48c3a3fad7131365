"""All PDOs of a slave: configuration through SDO, SYNC, events (CiA 301; C301-045 to C301-056)."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.dictionary import ObjectValue
from fieldbus.canopen.mpdo import DESTINATION, MULTIPLEXED, SOURCE, Multiplexer, ScannedObject
from fieldbus.canopen.nmt import is_restricted
from fieldbus.canopen.pdo import Pdo, PdoCycle, ReceivePdo, RpdoErrors, TransmitPdo, Watcher
from fieldbus.canopen.pdo_mapping import EMPTY, applier, check_mapping, check_mapping_entry, sampler
from fieldbus.canopen.store import ObjectStore
from fieldbus.clock import Scheduler, Timer

_RPDO: Final = (0x1400, 0x1600)
_TPDO: Final = (0x1800, 0x1A00)
_RECORDS: Final = 0x200

_EVENT_DRIVEN: Final = 254
_FLUSH_PRIORITY: Final = 100
"""Changes of one instant are looked at after everything else of that instant."""


class PdoEngine:
    """Owns the PDOs and keeps them as the dictionary says.

    Args:
        scheduler: Time.
        store: Values and access.
        send: Puts a frame on the bus.
        send_all: Puts several frames on the bus.
        withdraw: Takes frames back that the bus has not taken yet, by identifier and whether it has 29 bits.
        on_change: Called after any change that alters which frames the slave listens to.
        emcy: Raises an error by code.
        emcy_clear: Ends an error by code.
        on_timeout: Called when an RPDO has not come in time.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        store: ObjectStore,
        send: Callable[[CanFrame], None],
        *,
        send_all: Callable[[Iterable[CanFrame]], None],
        withdraw: Callable[[Container[tuple[int, bool]]], None],
        on_change: Callable[[], None],
        emcy: Callable[[int], object],
        emcy_clear: Callable[[int], object],
        on_timeout: Callable[[int], None],
    ) -> None:
        self._scheduler = scheduler
        self._store = store
        self._send_all = send_all
        self._withdraw = withdraw
        self._window: Timer | None = None
        self._on_change = on_change
        self.cycle: Final = PdoCycle()
        """What all PDOs share."""
        self.rpdo_errors: Final = RpdoErrors(emcy=emcy, emcy_clear=emcy_clear, on_timeout=on_timeout)
        """RPDOs with a wrong length, and overdue ones."""
        self.problems: list[str] = []
        """Default mappings that the dictionary itself forbids; such a PDO stays silent."""
        self._flush_pending = False
        self._sync_receive: tuple[ReceivePdo, ...] = ()
        self._each_sync: tuple[TransmitPdo, ...] = ()
        self._other_sync: tuple[TransmitPdo, ...] = ()
        self._watchers: dict[int, tuple[Watcher, ...]] = {}
        self._scanned: tuple[ScannedObject, ...] = ()
        self._stale = False
        self._at_rest = False  # no PDO was in effect at the last `refresh`
        self._listed: list[tuple[int, bool]] = []  # what `transmitted` was then
        self.multiplexer = Multiplexer(store, send, emcy=emcy, emcy_clear=emcy_clear)
        self.receive = [
            ReceivePdo(
                *place,
                scheduler=scheduler,
                values=store.values,
                cycle=self.cycle,
                errors=self.rpdo_errors,
                mark=self._mark,
                multiplexed=self.multiplexer.receive,
            )
            for place in self._places(*_RPDO)
        ]
        self.transmit = [
            TransmitPdo(*place, scheduler=scheduler, values=store.values, cycle=self.cycle, send=send)
            for place in self._places(*_TPDO)
        ]
        self._mapped = _mapping_entries(store)
        for pdo in (*self.receive, *self.transmit):
            self._install(pdo)

    def _places(self, communication: int, mapping: int) -> list[tuple[int, int, int]]:
        entries = self._store.entries
        return [
            (number + 1, (communication + number) << 8, (mapping + number) << 8)
            for number in range(_RECORDS)
            if (communication + number) << 8 | 1 in entries and (mapping + number) << 8 in entries
        ]

    # -- state
    # ------------------------------------------------------------------------------------------------

    def configure(self) -> None:
        """Read all PDOs from the values, as after reset communication."""
        self.problems.clear()
        self.rpdo_errors.reset()
        self.multiplexer.reset()
        for rpdo in self.receive:
            rpdo.restart()
        for pdo in (*self.receive, *self.transmit):
            self._read(pdo, restart=True)
        self._stale = False
        self.refresh()

    def enter_operational(self) -> None:
        """Start all valid PDOs."""
        self.cycle.operational = True
        if self._stale:
            self._recompile()
        self.refresh()
        for pdo in self.transmit:
            if pdo.valid:
                pdo.start()

    def leave_operational(self) -> None:
        """Stop all PDOs at once (C301-019)."""
        self.cycle.operational = False
        self.cycle.sync_ns = -1
        for pdo in (*self.receive, *self.transmit):
            pdo.stop()
        self.refresh()

    def mute(self, keys: frozenset[int]) -> None:
        """Keep back every TPDO that maps one of these objects; an empty set lets them go again."""
        self.cycle.muted = keys
        self.refresh()
        self.touch_all()

    def recompile(self) -> None:
        """Rebuild the code of all PDOs before its next use: the device has registered a hook."""
        self._stale = True
        if self.cycle.operational:
            self._recompile()

    def _recompile(self) -> None:
        self._stale = False
        for rpdo in self.receive:
            rpdo.compile(applier(rpdo.layout, self._store))
        for tpdo in self.transmit:
            tpdo.sample = sampler(tpdo.layout, self._store.values, self._store.read_hooks)

    def refresh(self) -> None:
        """Sort the PDOs in effect by what drives them, and listen to their identifiers."""
        transmitted = self.transmitted()
        if self._at_rest and not self.cycle.operational and transmitted == self._listed:
            return  # a mapping that is written step by step while no PDO is in effect
        self._at_rest = not self.cycle.operational
        self._listed = transmitted
        self.cycle.window_ns = self._store.values.get(0x100700, 0) * 1000
        valid = (
            [pdo for pdo in self.transmit if pdo.valid and pdo.layout.fields]
            if self.cycle.operational
            else []
        )
        if self.cycle.muted:
            valid = [pdo for pdo in valid if self.cycle.muted.isdisjoint(pdo.layout.keys)]
        self._each_sync = tuple(pdo for pdo in valid if pdo.every_sync)
        self._other_sync = tuple(
            pdo for pdo in valid if (pdo.synchronous and not pdo.every_sync) or pdo.kind == 252
        )
        watchers: dict[int, tuple[Watcher, ...]] = {}
        for pdo in valid:
            if pdo.event_driven:
                for key in pdo.layout.keys:
                    watchers[key] = (*watchers.get(key, ()), pdo)
        self._scanned = self._scan()
        for scanned in self._scanned:
            watchers[scanned.key] = (*watchers.get(scanned.key, ()), scanned)
        self._watchers = watchers
        for rpdo in self.receive:
            rpdo.watchers = tuple(
                dict.fromkeys(pdo for key in rpdo.layout.keys for pdo in watchers.get(key, ()))
            )
        active = (
            [pdo for pdo in self.receive if pdo.valid and pdo.layout.fields] if self.cycle.operational else []
        )
        self._sync_receive = tuple(pdo for pdo in active if pdo.synchronous)
        self._on_change()

    def receivers(self) -> Iterable[ReceivePdo]:
        """Return the RPDOs that listen now."""
        return (
            [pdo for pdo in self.receive if pdo.valid and (pdo.layout.fields or pdo.multiplex)]
            if self.cycle.operational
            else []
        )

    def transmitted(self) -> list[tuple[int, bool]]:
        """Return the identifiers that the TPDOs send with, and whether they have 29 bits."""
        return [(pdo.can_id, pdo.extended) for pdo in self.transmit if pdo.valid]

    def requestable(self) -> Iterable[TransmitPdo]:
        """Return the TPDOs that answer remote frames now."""
        return (
            [pdo for pdo in self.transmit if pdo.valid and pdo.rtr and pdo.layout.fields]
            if self.cycle.operational
            else []
        )

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    def latch(self, time_ns: int) -> None:
        """Make the synchronous RPDOs received since the last SYNC effective (C301-035)."""
        self.cycle.sync_ns = time_ns
        for pdo in self._sync_receive:
            data = pdo.pending
            if data is not None:
                pdo.pending = None
                pdo.effective += 1
                pdo.apply(data)
                if pdo.watchers:
                    self._mark(pdo.watchers)

    def on_sync(self, counter: int) -> None:
        """Sample and send the synchronous TPDOs."""
        frames = []
        for pdo in self._each_sync:
            pdo.last = payload = pdo.sample()
            frames.append(pdo.maker.make(payload))
        self._send_all(frames)
        for pdo in self._other_sync:
            pdo.on_sync(counter)
        if self.cycle.window_ns and (self._each_sync or self._other_sync):
            self._end_window()

    def _end_window(self) -> None:
        """Take TPDOs back that the bus has not taken when the window ends: not in this cycle (C301-036)."""
        if self._window is not None:
            self._window.cancel()
        ends_ns = max(self.cycle.sync_ns + self.cycle.window_ns, self._scheduler.now)
        self._window = self._scheduler.at(ends_ns, self._window_over)

    def _window_over(self) -> None:
        self._window = None
        self._withdraw(
            {(pdo.can_id, pdo.extended) for pdo in (*self._each_sync, *self._other_sync) if pdo.synchronous}
        )

    def touch(self, key: int) -> None:
        """Note that the object `key` may have changed."""
        watchers = self._watchers.get(key)
        if watchers is not None:
            self._mark(watchers)

    def touch_all(self) -> None:
        """Note that any object may have changed."""
        self._mark(
            [pdo for pdo in self.transmit if pdo.valid and pdo.event_driven] if self.cycle.operational else ()
        )

    def _mark(self, pdos: Iterable[Watcher]) -> None:
        """Have event-driven PDOs looked at when the present instant ends."""
        for pdo in pdos:
            pdo.dirty = True
            if not self._flush_pending:
                self._flush_pending = True
                self._scheduler.at(self._scheduler.now, self._flush, priority=_FLUSH_PRIORITY)

    def _flush(self) -> None:
        self._flush_pending = False
        for pdo in self.transmit:
            if pdo.dirty:
                pdo.look()
        for scanned in self._scanned:
            if scanned.dirty:
                scanned.look()

    def _scan(self) -> tuple[ScannedObject, ...]:
        """Return what the multiplex PDOs in source address mode send on a change."""
        if not self.cycle.operational:
            return ()
        return tuple(
            ScannedObject(self.multiplexer, self._store, pdo, entry)
            for pdo in self.transmit
            if pdo.valid and pdo.multiplex == SOURCE
            for entry in self.multiplexer.scanned()
        )

    def send_multiplexed(self, number: int, node: int, index: int, sub: int, content: bytes) -> bool:
        """Send to an object of other nodes with TPDO `number`, which has to be in destination address mode.

        Returns:
            Whether it was sent.

        """
        for pdo in self.transmit:
            if pdo.number == number and pdo.valid and pdo.multiplex == DESTINATION and self.cycle.operational:
                self.multiplexer.send_destination(pdo, node, index, sub, content)
                return True
        return False

    # -- configuration
    # ----------------------------------------------------------------------------------------

    def _read(self, pdo: Pdo, *, restart: bool) -> None:
        pdo.read_parameters()
        values = self._store.values
        self.problems = [text for text in self.problems if not text.startswith(_mapping_name(pdo))]
        count = values[pdo.map_key]
        pdo.multiplex = count if count in MULTIPLEXED and pdo.kind >= _EVENT_DRIVEN else 0
        if pdo.multiplex:
            count = 0
        try:
            raw = [values[pdo.map_key | sub] for sub in range(1, count + 1)]
            pdo.layout = check_mapping(self._store, raw, receive=pdo.receive)
        except (SdoAbort, KeyError) as reason:
            pdo.layout = EMPTY
            self.problems.append(f"{_mapping_name(pdo)}: {reason}")
        if isinstance(pdo, ReceivePdo):
            pdo.stop()
            pdo.compile(applier(pdo.layout, self._store))
        elif isinstance(pdo, TransmitPdo):
            pdo.compile(sampler(pdo.layout, values, self._store.read_hooks), restart=restart)

    def _install(self, pdo: Pdo) -> None:
        """Put the rules of the communication and mapping record into the store."""
        store = self._store

        def apply() -> None:
            self._read(pdo, restart=True)
            self.refresh()
            if self.cycle.operational and pdo.valid and isinstance(pdo, TransmitPdo):
                pdo.start()

        def apply_time() -> None:
            self._read(pdo, restart=False)
            self.refresh()

        store.guards[pdo.key | 1] = lambda value: self._check_cob_id(pdo, value)
        store.guards[pdo.key | 2] = lambda value: self._check_kind(pdo, value)
        if not pdo.receive:
            for sub in (3, 6):
                store.guards[pdo.key | sub] = self._only_while_invalid(pdo, pdo.key | sub)
        for sub in (1, 2):
            store.applied[pdo.key | sub] = apply
        for sub in (3, 5, 6):
            store.applied[pdo.key | sub] = apply_time
        store.guards[pdo.map_key] = lambda value: self._check_count(pdo, value)
        store.applied[pdo.map_key] = apply
        for key in self._mapped.get(pdo.map_key, ()):
            store.guards[key] = lambda value: self._check_map_entry(pdo, value)

    def _invalid(self, pdo: Pdo) -> bool:
        return bool(self._store.values[pdo.key | 1] >> 31)

    def _check_cob_id(self, pdo: Pdo, value: ObjectValue) -> None:
        extended = value >> 29 & 1
        can_id = value & 0x1FFFFFFF
        if not extended and (can_id > 0x7FF or (is_restricted(can_id) and (can_id or not value >> 31))):
            raise SdoAbort(AbortCode.VALUE)
        old = self._store.values[pdo.key | 1]
        if not old >> 31 and not value >> 31 and (old ^ value) & 0x3FFFFFFF:
            raise SdoAbort(AbortCode.DEVICE_STATE)
        if not value >> 31 and any(problem.startswith(_mapping_name(pdo)) for problem in self.problems):
            raise SdoAbort(AbortCode.INTERNAL)  # the mapping of the dictionary forbids itself

    def _check_kind(self, pdo: Pdo, kind: ObjectValue) -> None:
        """Refuse reserved transmission types (C301-040 to C301-042), and SYNC for multiplex PDOs."""
        if 0xF1 <= kind <= (0xFD if pdo.receive else 0xFB):
            raise SdoAbort(AbortCode.VALUE)
        if self._store.values[pdo.map_key] in MULTIPLEXED and kind < _EVENT_DRIVEN:
            raise SdoAbort(AbortCode.PARAMETER)

    def _only_while_invalid(self, pdo: Pdo, key: int) -> Callable[[ObjectValue], None]:
        def check(value: ObjectValue) -> None:
            if not self._invalid(pdo) and value != self._store.values[key]:
                raise SdoAbort(AbortCode.DEVICE_STATE)

        return check

    def _may_be_mapped(self, pdo: Pdo) -> bool:
        """Whether the mapping may change: the PDO is invalid, or nobody can make it so."""
        return self._invalid(pdo) or not self._store.entries[pdo.key | 1].writable

    def _check_count(self, pdo: Pdo, count: ObjectValue) -> None:
        if not self._may_be_mapped(pdo):
            raise SdoAbort(AbortCode.DEVICE_STATE)
        if count in MULTIPLEXED:
            if self._store.values.get(pdo.key | 2, _EVENT_DRIVEN) < _EVENT_DRIVEN:
                raise SdoAbort(AbortCode.PARAMETER)  # multiplex PDOs are event-driven
            return
        if count > 64:
            raise SdoAbort(AbortCode.PDO_LENGTH)
        values = self._store.values
        if count and pdo.map_key | count not in self._store.entries:
            raise SdoAbort(AbortCode.PDO_LENGTH)
        check_mapping(
            self._store, [values[pdo.map_key | sub] for sub in range(1, count + 1)], receive=pdo.receive
        )

    def _check_map_entry(self, pdo: Pdo, value: ObjectValue) -> None:
        if self._store.values[pdo.map_key] or not self._may_be_mapped(pdo):
            raise SdoAbort(AbortCode.DEVICE_STATE)
        if value:
            check_mapping_entry(self._store, value, receive=pdo.receive)


def _mapping_entries(store: ObjectStore) -> dict[int, list[int]]:
    """Return the keys of the mapping entries of every mapping record, by the key of its sub-index 0."""
    result: dict[int, list[int]] = {}
    receive, transmit = _RPDO[1], _TPDO[1]
    for key in store.entries:
        index = key >> 8
        if key & 0xFF and (receive <= index < receive + _RECORDS or transmit <= index < transmit + _RECORDS):
            result.setdefault(index << 8, []).append(key)
    return result


def _mapping_name(pdo: Pdo) -> str:
    return f"mapping {pdo.map_key >> 8:04X}h"
