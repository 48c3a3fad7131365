"""The clock of the drive is locked to SYNC: how irregular SYNC may come (CANP-071)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emulators.drive.cia402.function import DriveFunction
from emulators.events import Emit

_LOSS: Final = 1.5
"""From here on a period is no jitter but a SYNC that is missing (C301-037)."""


class SyncJitter:
    """Watches the distance of SYNCs in the cyclic modes.

    Args:
        function: Modes; 60C2h is the period that they expect.
        tolerance: Deviation from the period that is tolerated, as a part of it, > 0.
        on_jitter: Called when a SYNC is too early or too late.
        emit: Writes the deviation into the log.

    """

    def __init__(
        self, function: DriveFunction, tolerance: float, *, on_jitter: Callable[[], None], emit: Emit
    ) -> None:
        self._function = function
        self._on_jitter = on_jitter
        self._emit = emit
        self._tolerance = tolerance
        self._before_ns: int | None = None
        self.worst_ns = 0
        """Largest deviation since construction, ns."""

    def on_sync(self, time_ns: int) -> None:
        """Take the arrival of a SYNC."""
        before, self._before_ns = self._before_ns, time_ns
        if before is None:
            return
        period_ns = self._function.axis.period_s * 1e9
        distance = time_ns - before
        if distance >= _LOSS * period_ns:
            return
        deviation = abs(distance - period_ns)
        if deviation > self.worst_ns:
            self.worst_ns = round(deviation)
        if deviation > self._tolerance * period_ns and self._function.following:
            self._emit("drive.sync_jitter", deviation_us=deviation / 1000.0, period_us=period_ns / 1000.0)
            self._on_jitter()
