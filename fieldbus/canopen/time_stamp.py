"""TIME of a slave: consumer and producer of the time of day (CiA 301; C301-004, C301-142)."""

from __future__ import annotations

from collections.abc import Callable
from struct import Struct
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.dictionary import ObjectValue
from fieldbus.canopen.nmt import NmtState, is_restricted
from fieldbus.canopen.store import ObjectStore
from fieldbus.clock import MS, Scheduler
from fieldbus.errors import ConfigurationError

_COB_ID: Final = 0x101200
_TIME_OF_DAY: Final = Struct("<IH")
_DAY_MS: Final = 86_400_000
_MILLISECONDS: Final = 0x0FFF_FFFF


class TimeService:
    """The clock of the device: set by TIME frames, and sent to others where 1012h says so.

    Args:
        scheduler: Time of the bench, by which the clock continues between two frames.
        store: Holds 1012h; a dictionary without it has no TIME.
        send: Puts a frame on the bus.
        on_change: Called when the identifier to listen to has changed.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        store: ObjectStore,
        send: Callable[[CanFrame], None],
        *,
        on_change: Callable[[], None],
    ) -> None:
        self._scheduler = scheduler
        self._store = store
        self._send = send
        self._days = 0
        self._milliseconds = 0
        self._set_ns = -1
        self.state = NmtState.INITIALISING
        """NMT state of the node; TIME is sent in Pre-operational and Operational only."""
        self.malformed = 0
        """TIME frames of a wrong length, or beyond the end of a day; they are ignored."""
        self.on_time: list[Callable[[int, int], None]] = []
        """Called with milliseconds since midnight and days since 1984-01-01 of every frame taken."""
        store.guards[_COB_ID] = self._check_cob_id
        store.applied[_COB_ID] = on_change

    @property
    def _cob_id(self) -> int:
        return int(self._store.values.get(_COB_ID, 0))

    def listening(self) -> list[tuple[int, bool]]:
        """Return identifier and whether it has 29 bits, if 1012h makes the node a consumer."""
        cob_id = self._cob_id
        if not cob_id >> 31:
            return []
        extended = bool(cob_id >> 29 & 1)
        return [(cob_id & (0x1FFFFFFF if extended else 0x7FF), extended)]

    def stop(self) -> None:
        """Forget the time, as at power-off."""
        self._set_ns = -1
        self.state = NmtState.INITIALISING

    def time_of_day(self) -> tuple[int, int] | None:
        """Return present milliseconds since midnight and days since 1984-01-01; None before it was set."""
        if self._set_ns < 0:
            return None
        passed = self._milliseconds + (self._scheduler.now - self._set_ns) // MS
        return passed % _DAY_MS, self._days + passed // _DAY_MS

    def set_time(self, milliseconds: int, days: int) -> None:
        """Set the clock of the device.

        Args:
            milliseconds: Since midnight, 0..86399999.
            days: Since 1984-01-01, 0..65535.

        Raises:
            ConfigurationError: Out of range.

        """
        if not 0 <= milliseconds < _DAY_MS:
            raise ConfigurationError("milliseconds", milliseconds, "0..86399999")
        if not 0 <= days <= 0xFFFF:
            raise ConfigurationError("days", days, "0..65535")
        self._milliseconds = milliseconds
        self._days = days
        self._set_ns = self._scheduler.now

    def receive(self, frame: CanFrame, time_ns: int) -> None:
        """Take a TIME frame."""
        data = frame.data
        if len(data) != _TIME_OF_DAY.size:
            self.malformed += 1
            return
        milliseconds, days = _TIME_OF_DAY.unpack(data)
        milliseconds &= _MILLISECONDS  # the upper four bits are reserved
        if milliseconds >= _DAY_MS:
            self.malformed += 1
            return
        self._milliseconds = milliseconds
        self._days = days
        self._set_ns = time_ns
        for callback in self.on_time:
            callback(milliseconds, days)

    def produce(self) -> bool:
        """Send the device's time once.

        Returns:
            Whether it was sent: 1012h makes the node a producer, the NMT state allows it, and the clock is
            set.

        """
        now = self.time_of_day()
        cob_id = self._cob_id
        if now is None or not cob_id >> 30 & 1:
            return False
        if self.state not in (NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL):
            return False
        milliseconds, days = now
        data = _TIME_OF_DAY.pack(milliseconds, days & 0xFFFF)
        extended = bool(cob_id >> 29 & 1)
        self._send(CanFrame(cob_id & (0x1FFFFFFF if extended else 0x7FF), data, extended=extended))
        return True

    def _check_cob_id(self, value: ObjectValue) -> None:
        old = self._store.values[_COB_ID]
        can_id = value & 0x1FFFFFFF
        if not value >> 29 & 1 and (can_id > 0x7FF or is_restricted(can_id)):
            raise SdoAbort(AbortCode.VALUE)
        # The identifier may change only while the node neither sends nor takes TIME.
        if old >> 30 and value >> 30 and (old ^ value) & 0x3FFFFFFF:
            raise SdoAbort(AbortCode.DEVICE_STATE)
