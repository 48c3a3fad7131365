"""First-order filters of the NC: `x = I * new + (1 - I) * x` with `I = T / (T + filter time)` (NC-283)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motion.kernel.cell import Cell


class Pt1:
    """A PT1 filter whose time may change while it runs.

    Args:
        time: Filter time, s; 0 for none.
        cycle_s: Cycle, s.

    """

    __slots__ = ("_cycle_s", "_time", "value")

    def __init__(self, time: Cell[float], cycle_s: float) -> None:
        self._time = time
        self._cycle_s = cycle_s
        self.value = 0.0
        """Filtered value."""

    def step(self, new: float) -> float:
        """Take the value of this cycle; returns the filtered one."""
        time = self._time.value
        if time <= 0.0:
            self.value = new
            return new
        share = self._cycle_s / (self._cycle_s + time)
        value = self.value = share * new + (1.0 - share) * self.value
        return value
