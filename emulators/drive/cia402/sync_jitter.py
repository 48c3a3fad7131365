"""The clock of the drive is locked to SYNC: how irregular SYNC may come (CANP-071)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from emulators.drive.cia402.drive import CiA402Drive

_LOSS: Final = 1.5
"""From here on a period is no jitter but a SYNC that is missing (C301-037)."""


class SyncJitter:
    """Watches the distance of SYNCs in the cyclic modes.

    Args:
        drive: The drive; 60C2h is the period that it expects.
        tolerance: Deviation from the period that is tolerated, as a part of it, > 0.

    """

    __slots__ = ("_before_ns", "_drive", "_tolerance", "worst_ns")

    def __init__(self, drive: CiA402Drive, tolerance: float) -> None:
        self._drive = drive
        self._tolerance = tolerance
        self._before_ns: int | None = None
        self.worst_ns = 0
        """Largest deviation since construction, ns."""

    def on_sync(self, time_ns: int) -> None:
        """Take the arrival of a SYNC."""
        before, self._before_ns = self._before_ns, time_ns
        if before is None:
            return
        drive = self._drive
        period_ns = drive.axis.period_s * 1e9
        distance = time_ns - before
        if distance >= _LOSS * period_ns:
            return
        deviation = abs(distance - period_ns)
        if deviation > self.worst_ns:
            self.worst_ns = round(deviation)
        if deviation > self._tolerance * period_ns and drive.function.following:
            drive.emit("drive.sync_jitter", deviation_us=deviation / 1000.0, period_us=period_ns / 1000.0)
            drive.reactions.sync_lost()
