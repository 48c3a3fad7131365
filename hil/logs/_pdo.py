"""What process data show over time: whether they come with every SYNC, and the motion that positions make."""

from __future__ import annotations

import math
from typing import Final

from hil.logs._table import Table

_WRAP: Final = 1 << 32
_REGULAR: Final = 10
_MISSED: Final = 10
"""Process data that came with so many SYNCs in a row, and then with none for so many, have stayed away."""


class Pdo:
    """Process data that come with every SYNC, or do not."""

    def __init__(self) -> None:
        self.time_ns = 0
        self._sync_ns = self._period_ns = self._regular = 0

    def stayed_away(self, now_ns: int) -> bool:
        """Return whether they came with every SYNC, and then with none of many."""
        return self._regular >= _REGULAR and now_ns - self._sync_ns > _MISSED * self._period_ns

    def take(self, time_ns: int, sync_ns: int) -> None:
        """Take a frame that belongs to a SYNC."""
        step_ns = sync_ns - self._sync_ns if self.time_ns else 0
        self.time_ns, self._sync_ns = time_ns, sync_ns
        if step_ns <= 0:
            return
        regular = not self._period_ns or 2 * step_ns < 3 * self._period_ns
        self._regular = self._regular + 1 if regular else 0
        self._period_ns = min(self._period_ns or step_ns, step_ns)


class Motion:
    """Position and velocity of an axis from the raw counts of its drive."""

    def __init__(self, table: Table, increment: float, unit: str) -> None:
        self._table = table
        self._increment = increment
        self._unit = unit
        self._raw: int | None = None
        self._total = 0
        self._time_ns = 0
        self._period_ns = 0

    def take(self, raw: int, time_ns: int, sync_ns: int | None) -> None:
        """Take a count; times are those of SYNC, which is when the drive has sampled, where there is one."""
        if not self._increment:
            return
        at_ns = time_ns if sync_ns is None else sync_ns
        velocity = 0.0
        if self._raw is None:
            self._total = raw
        else:
            step = (raw - self._raw + _WRAP // 2) % _WRAP - _WRAP // 2
            self._total += step
            passed_ns = at_ns - self._time_ns
            if passed_ns <= 0:
                return
            self._period_ns = min(self._period_ns or passed_ns, passed_ns)
            # Over a gap there is a mean only, which is the velocity of no moment.
            whole = passed_ns <= _MISSED * self._period_ns
            velocity = step * self._increment / (passed_ns * 1e-9) if whole else math.nan
        self._raw, self._time_ns = raw, at_ns
        self._table.set("actual_position", self._total * self._increment, self._unit)
        self._table.set("actual_velocity", velocity, f"{self._unit}/s")
