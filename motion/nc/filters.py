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


class MovingAverage:
    """Mean of the last set positions (NC-373).

    Args:
        time: Averaging interval, s.
        cycle_s: Cycle, s.

    """

    def __init__(self, time: Cell[float], cycle_s: float) -> None:
        self._time = time
        self._cycle_s = cycle_s
        self._kept: list[float] = []
        self._at = 0

    def reset(self) -> None:
        """Begin with the next value."""
        self._kept = []

    def step(self, new: float) -> float:
        """Take the value of this cycle; returns the mean."""
        count = max(1, round(self._time.value / self._cycle_s))
        kept = self._kept
        if len(kept) != count:
            kept = self._kept = [new] * count
            self._at = 0
            return new
        at = self._at
        kept[at] = new
        self._at = at + 1 if at + 1 < count else 0
        # Summed from the first value on: a running sum would keep its rounding errors.
        first = kept[0]
        return first + sum(value - first for value in kept) / count


class PTn:
    """PT1 stages in series, each with the filter time (NC-374).

    Args:
        time: Filter time of a stage, s.
        order: Number of stages.
        cycle_s: Cycle, s.

    """

    def __init__(self, time: Cell[float], order: Cell[float], cycle_s: float) -> None:
        self._time = time
        self._order = order
        self._cycle_s = cycle_s
        self._stages: list[float] = []

    def reset(self) -> None:
        """Begin with the next value."""
        self._stages = []

    def step(self, new: float) -> float:
        """Take the value of this cycle; returns that of the last stage."""
        order = int(self._order.value)
        stages = self._stages
        if len(stages) != order:
            stages = self._stages = [new] * order
            return new
        share = self._cycle_s / (self._cycle_s + self._time.value)
        for number in range(order):
            new = stages[number] = stages[number] + share * (new - stages[number])
        return new
