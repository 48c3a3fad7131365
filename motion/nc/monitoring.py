"""Monitoring of an axis: position lag, position range, target window, in-target alarm, motion (section 8)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.nc.errors import NO_ERROR, NO_MOVEMENT, POSITION_LAG, TARGET_NOT_REACHED

if TYPE_CHECKING:
    from motion.nc.parameters import ParameterSet

_SLACK: Final = 1e-9
"""Share of a time, and position units, that rounding may make."""


class Monitoring:
    """What is watched while an axis is controlled. Times count executed cycles (NC-002).

    Args:
        parameters: Parameters of the axis.
        cycle_s: Cycle of the axis, s.

    """

    def __init__(self, parameters: ParameterSet, *, cycle_s: float) -> None:
        cell = parameters.cell
        self._cycle_s = cycle_s
        self._lag_on = cell("axis.position_lag_monitoring")
        self._lag = cell("axis.position_lag_max")
        self._lag_time = cell("axis.position_lag_filter_time")
        self._area_on = cell("axis.position_range_monitoring")
        self._area = cell("axis.position_range_window")
        self._target_on = cell("axis.target_position_monitoring")
        self._target = cell("axis.target_position_window")
        self._target_time = cell("axis.target_position_monitoring_time")
        self._alarm_on = cell("axis.in_target_alarm")
        self._timeout = cell("axis.in_target_timeout")
        self._motion_on = cell("axis.motion_monitoring")
        self._motion = cell("axis.motion_monitoring_window")
        self._motion_time = cell("axis.motion_monitoring_time")
        self._lagging = 0
        self._inside = 0
        self._waiting = 0
        self._still = 0
        self._last: float | None = None
        self._idle = True
        """No window is entered, and no time runs."""
        self.lag_min = 0.0
        """Lowest following error since `reset_extremes`, position unit."""
        self.lag_max = 0.0
        """Highest following error since `reset_extremes`, position unit."""
        self.in_area = False
        """`InPositionArea`."""
        self.in_target = False
        """`InTargetPosition`."""
        self.reached = False
        """The target window counts as reached: with target position monitoring its dwell, else the window."""

    @property
    def target_on(self) -> bool:
        """Whether target position monitoring is on: a command ends in its window then."""
        return bool(self._target_on.value)

    def reset(self) -> None:
        """Begin again, for example after an error."""
        self._lagging = self._inside = self._waiting = self._still = 0
        self._last = None

    def reset_extremes(self) -> None:
        """Begin again with the extreme values of the following error."""
        self.lag_min = self.lag_max = 0.0

    def new_target(self) -> None:
        """Begin again with windows and timeout, for a new command (NC-156)."""
        self.no_target()

    def watch_lag(self, error: float) -> int:
        """Compare the following error with its maximum; returns an error code, 0 for none."""
        if error < self.lag_min:
            self.lag_min = error
        elif error > self.lag_max:
            self.lag_max = error
        limit = self._lag.value
        if not self._lag_on.value or -limit <= error <= limit:
            self._lagging = 0
            return NO_ERROR
        self._lagging += 1
        over = self._lagging * self._cycle_s > self._lag_time.value * (1.0 + _SLACK)
        return POSITION_LAG if over else NO_ERROR

    def watch_target(self, deviation: float, *, arrived: bool, alarm: bool) -> int:
        """Compare the actual position with the target; returns an error code, 0 for none.

        Args:
            deviation: Actual position minus target, position unit.
            arrived: The set position has reached the target.
            alarm: A command to a position is active, or was the last one.

        """
        if deviation < 0.0:
            deviation = -deviation
        if not arrived and deviation > self._area.value + _SLACK and deviation > self._target.value + _SLACK:
            if not self._idle:
                self.no_target()
            return NO_ERROR
        self._idle = False
        self.in_area = bool(self._area_on.value) and deviation <= self._area.value + _SLACK
        window = deviation <= self._target.value + _SLACK
        self._inside = self._inside + 1 if window else 0
        if self._target_on.value:
            dwell = self._inside * self._cycle_s >= self._target_time.value * (1.0 - _SLACK)
            self.in_target = self.reached = window and dwell
        else:
            self.in_target, self.reached = False, window
        if not (self._alarm_on.value and alarm and arrived) or self.reached:
            self._waiting = 0 if self.reached or not arrived else self._waiting
            return NO_ERROR
        if self._waiting * self._cycle_s >= self._timeout.value * (1.0 - _SLACK):
            return TARGET_NOT_REACHED
        self._waiting += 1
        return NO_ERROR

    def no_target(self) -> None:
        """Note that there is no target: endless motion (NC-156)."""
        self.in_area = self.in_target = self.reached = False
        self._inside = self._waiting = 0
        self._idle = True

    def watch_motion(self, position: float, *, moving: bool, held: bool) -> int:
        """Look whether the axis moves; returns an error code, 0 for none.

        Args:
            position: Actual position, position unit.
            moving: The axis is logically not at standstill.
            held: The set velocity is 0 because of the override: the time stands still (NC-164).

        """
        last, self._last = self._last, position
        if not self._motion_on.value or not moving or last is None:
            self._still = 0
            return NO_ERROR
        if abs(position - last) > self._motion.value:
            self._still = 0
        elif not held:
            self._still += 1
            if self._still * self._cycle_s >= self._motion_time.value * (1.0 - _SLACK):
                return NO_MOVEMENT
        return NO_ERROR
