"""SYNC of a slave: consumer, counter, monitoring, producer (CiA 301; C301-031 to C301-037)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.dictionary import ObjectValue
from fieldbus.canopen.nmt import COB_SYNC, NmtState, is_restricted
from fieldbus.canopen.pdo_engine import PdoEngine
from fieldbus.canopen.store import ObjectStore
from fieldbus.clock import Scheduler, Timer

_COB_ID: Final = 0x100500
_PERIOD: Final = 0x100600
_WINDOW: Final = 0x100700
_OVERFLOW: Final = 0x101900

EMCY_SYNC_LENGTH: Final = 0x8240

SHORTEST_PERIOD_US: Final = 100
"""A SYNC frame alone takes 47 us at 1 Mbit/s: shorter periods than this would fill the bus."""

_PRODUCER_PRIORITY: Final = -10
_OPERATIONAL: Final = NmtState.OPERATIONAL


class SyncService:
    """Drives the synchronous PDOs.

    Args:
        scheduler: Time.
        store: Holds 1005h, 1006h, 1007h, 1019h.
        send: Puts a frame on the bus.
        pdos: The engine whose PDOs SYNC drives.
        emcy: Raises an error by code.
        emcy_clear: Ends an error by code.
        on_change: Called when the identifier to listen to has changed.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        store: ObjectStore,
        send: Callable[[CanFrame], None],
        pdos: PdoEngine,
        *,
        emcy: Callable[[int], object],
        emcy_clear: Callable[[int], object],
        on_change: Callable[[], None],
    ) -> None:
        self._scheduler = scheduler
        self._store = store
        self._send = send
        self._pdos = pdos
        self._emcy = emcy
        self._emcy_clear = emcy_clear
        self._on_change = on_change
        self._state = NmtState.INITIALISING
        self._length = 0
        self._length_wrong = False
        self._next = 1
        self._monitor: Timer | None = None
        self._producer: Timer | None = None
        self._timeout_ns = 0
        self.can_id = COB_SYNC
        self.extended = False
        self.time_ns = 0
        """Time of the last SYNC, ns."""
        self.lost = 0
        """SYNCs that did not come within `timeout_factor` periods of 1006h (C301-037)."""
        self.timeout_factor = 1.5
        self.on_sync: list[Callable[[int], None]] = []
        self.on_lost: list[Callable[[], None]] = []
        """Called in Operational when a SYNC is overdue; monitoring starts with the first SYNC."""
        store.guards[_COB_ID] = self._check_cob_id
        store.guards[_PERIOD] = _check_period
        store.guards[_OVERFLOW] = self._check_overflow
        for key in (_COB_ID, _PERIOD, _OVERFLOW):
            store.applied[key] = self.configure
        store.applied[_WINDOW] = pdos.refresh

    def configure(self) -> None:
        """Read the objects again."""
        values = self._store.values
        cob_id = values.get(_COB_ID, COB_SYNC)
        self.extended = bool(cob_id >> 29 & 1)
        self.can_id = cob_id & (0x1FFFFFFF if self.extended else 0x7FF)
        self._length = 1 if values.get(_OVERFLOW, 0) else 0
        period_us = values.get(_PERIOD, 0)
        self._timeout_ns = int(period_us * 1000 * self.timeout_factor)
        if self._producer is not None:
            self._producer.cancel()
            self._producer = None
        if cob_id >> 30 & 1 and period_us and self._state in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            period_ns = period_us * 1000
            self._producer = self._scheduler.every(
                period_ns,
                self._produce,
                phase_ns=self._scheduler.now % period_ns,
                priority=_PRODUCER_PRIORITY,
            )
        self._on_change()

    def stop(self) -> None:
        """Stop all timers, as at power-off and reset."""
        self._state = NmtState.INITIALISING
        self._next = 1
        self._length_wrong = False
        for timer in (self._monitor, self._producer):
            if timer is not None:
                timer.cancel()
        self._monitor = self._producer = None

    def enter_state(self, state: NmtState) -> None:
        """Follow the NMT state: no SYNC in Stopped, the counter restarts after it (C301-033)."""
        if self._state == NmtState.STOPPED:
            self._next = 1
        self._state = state
        if state != NmtState.OPERATIONAL and self._monitor is not None:
            self._monitor.cancel()
            self._monitor = None
        self.configure()

    # -- consumer
    # ---------------------------------------------------------------------------------------------

    def receive(self, frame: CanFrame, time_ns: int) -> None:
        """Take a SYNC: latch RPDOs, call the device, send TPDOs."""
        data = frame.data
        if len(data) != self._length:
            self._wrong_length()
        elif self._length_wrong:
            self._length_wrong = False
            self._emcy_clear(EMCY_SYNC_LENGTH)
        self.time_ns = time_ns
        if self._timeout_ns and self._monitor is None and self._state is _OPERATIONAL:
            self._arm(time_ns + self._timeout_ns)
        pdos = self._pdos
        pdos.latch(time_ns)
        for callback in self.on_sync:
            callback(time_ns)
        pdos.on_sync(data[0] if data else 0)

    def _wrong_length(self) -> None:
        """Report once, and use the SYNC all the same (C301-034)."""
        if not self._length_wrong:
            self._length_wrong = True
            self._emcy(EMCY_SYNC_LENGTH)

    def _arm(self, due_ns: int) -> None:
        self._monitor = monitor = self._scheduler.at(max(due_ns, self._scheduler.now), self._overdue)
        monitor.apart = True

    def _overdue(self) -> None:
        monitor = self._monitor
        self._monitor = None
        if not self._timeout_ns:
            return
        now = self._scheduler.now
        due = self.time_ns + self._timeout_ns
        if due > now:
            if monitor is None:
                self._arm(due)
            else:
                self._monitor = monitor
                self._scheduler.again(monitor, due)
            return
        # Monitoring continues with the next SYNC: one report for each gap.
        self._scheduler.catch_up()
        self.lost += 1
        for callback in self.on_lost:
            callback()

    # -- producer
    # ---------------------------------------------------------------------------------------------

    def _produce(self) -> None:
        overflow = self._store.values.get(_OVERFLOW, 0)
        data = b""
        if overflow:
            data = bytes((self._next,))
            self._next = self._next % overflow + 1
        frame = CanFrame(self.can_id, data, extended=self.extended)
        self._send(frame)
        self.receive(frame, self._scheduler.now)

    # -- rules
    # ------------------------------------------------------------------------------------------------

    def _check_cob_id(self, value: ObjectValue) -> None:
        old = self._store.values[_COB_ID]
        if not value >> 29 & 1 and is_restricted(value & 0x7FF):
            raise SdoAbort(AbortCode.VALUE)
        if old >> 30 & 1 and value >> 30 & 1 and (old ^ value) & 0x3FFFFFFF:
            raise SdoAbort(AbortCode.DEVICE_STATE)

    def _check_overflow(self, value: ObjectValue) -> None:
        if value == 1 or value > 240:
            raise SdoAbort(AbortCode.VALUE)
        if self._store.values.get(_PERIOD, 0):
            raise SdoAbort(AbortCode.DEVICE_STATE)


def _check_period(value: ObjectValue) -> None:
    if 0 < value < SHORTEST_PERIOD_US:
        raise SdoAbort(AbortCode.VALUE_LOW)
