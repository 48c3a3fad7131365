"""The dynamic filter behind the interpolator: low-pass or moving average, and dead time
(§5.13.6, CTL-060 to CTL-083).
"""

from __future__ import annotations

from collections import deque
from math import exp
from typing import TYPE_CHECKING, Final, Protocol

if TYPE_CHECKING:
    from motion.kernel.cell import Cell

LONGEST: Final = 16
"""Greatest window and dead time, servo cycles (CTL-078, CTL-079)."""
MOVING_AVERAGE: Final = 2
"""`SetpointFilter.DynamicFilter.Mode` with moving averages; 1 has low-passes."""
_WHOLE: Final = 1e-9
_DEPTH: Final = LONGEST + 2


class _Stage(Protocol):
    """One element of the filter, for one quantity."""

    delay_s: float

    def set_time(self, seconds: float) -> None: ...
    def reset(self, value: float, slope: float) -> float: ...
    def shift(self, offset: float) -> None: ...
    def step(self, value: float) -> float: ...


class _Lag:
    """Low-pass of first order, exact for an input that changes linearly within a cycle (CTL-073, CTL-074)."""

    def __init__(self, cycle_s: float) -> None:
        self._cycle = cycle_s
        self._input = self._output = self._decay = self.delay_s = 0.0

    def set_time(self, seconds: float) -> None:
        self.delay_s = seconds
        self._decay = exp(-self._cycle / seconds) if seconds > 0.0 else 0.0

    def reset(self, value: float, slope: float) -> float:
        self._input = value
        self._output = value - slope * self.delay_s
        return self._output

    def shift(self, offset: float) -> None:
        self._input += offset
        self._output += offset

    def step(self, value: float) -> float:
        step = value - self._input
        self._input = value
        target = value - step / self._cycle * self.delay_s
        self._output = target + (self._output + step - target) * self._decay
        return self._output


class _History:
    """Base of the elements that look at past values."""

    def __init__(self, cycle_s: float) -> None:
        self._cycle = cycle_s
        self._past: deque[float] = deque([0.0] * _DEPTH, maxlen=_DEPTH)
        self._whole = 0
        self._rest = self.delay_s = 0.0

    def set_time(self, seconds: float) -> None:
        cycles = min(seconds / self._cycle, float(LONGEST))
        self._whole = int(cycles + _WHOLE)
        self._rest = max(0.0, cycles - self._whole)
        self.delay_s = self._delay_cycles() * self._cycle

    def _delay_cycles(self) -> float:
        raise NotImplementedError

    def reset(self, value: float, slope: float) -> float:
        step = slope * self._cycle
        self._past.extend(value - step * (_DEPTH - 1 - at) for at in range(_DEPTH))
        return value - slope * self.delay_s

    def shift(self, offset: float) -> None:
        past = self._past
        for at in range(_DEPTH):
            past[at] += offset


class _Average(_History):
    """Moving average over a time, both ends included; the last value counts by
    the rest of a cycle (CTL-075).
    """

    def _delay_cycles(self) -> float:
        # The centre of the weights; with whole cycles half the window.
        whole, rest = self._whole, self._rest
        return (0.5 * whole * (whole + 1) + rest * (whole + 1)) / (whole + 1 + rest)

    def step(self, value: float) -> float:
        past = self._past
        past.append(value)
        whole, rest = self._whole, self._rest
        total = 0.0
        for at in range(_DEPTH - 1 - whole, _DEPTH):
            total += past[at]
        if rest:
            total += rest * past[_DEPTH - 2 - whole]
        return total / (whole + 1 + rest)


class _DeadTime(_History):
    """Delay by a time; between two cycles the value is interpolated (MON-032)."""

    def _delay_cycles(self) -> float:
        return self._whole + self._rest

    def step(self, value: float) -> float:
        past = self._past
        past.append(value)
        newest = past[_DEPTH - 1 - self._whole]
        return newest + (past[_DEPTH - 2 - self._whole] - newest) * self._rest if self._rest else newest


class DynamicFilter:
    """Delays and smooths the position and velocity setpoint of an axis.

    Args:
        mode: `SetpointFilter.DynamicFilter.Mode`: 0 none, 1 low-passes, 2 moving averages (CTL-020).
        times: Cells of T1, T2, Tt, s.
        lead: Cell of a further dead time, s, by which torque precontrol is ahead of position and velocity
            (`DynamicAxisModel.CurrentTimeConstant`, CTL-055); None = there is none.
        cycle_s: Servo cycle, s.

    """

    def __init__(
        self,
        mode: int,
        times: tuple[Cell[float], Cell[float], Cell[float]],
        *,
        cycle_s: float,
        lead: Cell[float] | None = None,
    ) -> None:
        self._cycle = cycle_s
        self._cells = (*(times if mode else ()), *(() if lead is None else (lead,)))
        self._lead = lead is not None
        self.smooths = mode != 0
        """Whether there is more than the further dead time."""
        self._position = self._make(mode)
        self._velocity = self._make(mode)
        self._set: tuple[float, ...] = ()
        self.position = 0.0
        """Position setpoint behind the filter, axis unit (`StatusServo.PositionAfterDynamicFilter`)."""
        self.velocity = 0.0
        """Velocity setpoint behind the filter, axis unit per second."""
        self.acceleration = 0.0
        """Change of this velocity in the last cycle, axis unit per second squared."""
        self.delay_s = 0.0
        """Time by which setpoints come later, s."""
        self._take_times()

    def _make(self, mode: int) -> list[_Stage]:
        cycle = self._cycle
        stages: list[_Stage] = []
        if mode:
            smooth: type[_Average | _Lag] = _Average if mode == MOVING_AVERAGE else _Lag
            stages = [smooth(cycle), smooth(cycle), _DeadTime(cycle)]
        if self._lead:
            stages.append(_DeadTime(cycle))
        return stages

    def _take_times(self) -> None:
        self._set = tuple(cell.value for cell in self._cells)
        for stages in (self._position, self._velocity):
            for stage, seconds in zip(stages, self._set, strict=True):
                stage.set_time(seconds)
        self.delay_s = sum(stage.delay_s for stage in self._position)

    def reset(self, position: float, velocity: float = 0.0) -> None:
        """Start from setpoints that have been moving with `velocity` up to `position`."""
        self.velocity = velocity
        self.acceleration = 0.0
        for at, stage in enumerate(self._position):
            self._velocity[at].reset(velocity, 0.0)
            if self._lead and at == len(self._position) - 1:
                break
            position = stage.reset(position, velocity)
        self.position = position
        if self._lead:
            self._position[-1].reset(position, velocity)

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system."""
        for stage in self._position:
            stage.shift(offset)
        self.position += offset

    def step(self, position: float, velocity: float) -> tuple[float, float]:
        """Return the setpoints of this cycle for the position controller."""
        for cell, known in zip(self._cells, self._set, strict=True):
            if cell.value != known:
                self._take_times()
                break
        before = self.velocity
        stages = len(self._position) - self._lead
        for at in range(stages):
            position = self._position[at].step(position)
            velocity = self._velocity[at].step(velocity)
        self.position = position
        self.velocity = velocity
        self.acceleration = (velocity - before) / self._cycle
        if self._lead:
            return self._position[-1].step(position), self._velocity[-1].step(velocity)
        return position, velocity
