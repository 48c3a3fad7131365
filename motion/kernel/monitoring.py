"""Monitoring of a positioning axis: following error, positioning, standstill (MON-016 to MON-052)."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Final

from motion.s7.units import farthest_position

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

ALARM_RANGE_REACHED: Final = 307
ALARM_RANGE_EXCEEDED: Final = 308
ALARM_ACTUAL_VALUE: Final = 412
ALARM_FOLLOWING_ERROR: Final = 521
ALARM_FOLLOWING_ERROR_WARNING: Final = 522
ALARM_POSITIONING: Final = 541

_OVERSHOOT: Final = 1.01
"""What the control of an axis at its highest velocity may make of the actual one."""

_RELEASE_FACTOR: Final = 1.1
"""Hysteresis of the standstill signal (MON-048)."""
_RANGE_END: Final = 2**53 / 9.0e15
"""Where the numbers end, as a multiple of the largest position: 2^53 steps of the resolution (CFG-093)."""


class Monitoring:
    """See the module. One object per axis; `step` runs once per interpolator cycle."""

    __slots__ = (
        "_axis",
        "_cycle",
        "_dwell",
        "_enable_fe",
        "_entered",
        "_farthest",
        "_fastest",
        "_fe_level",
        "_fe_max",
        "_fe_min",
        "_fe_min_velocity",
        "_max_velocity",
        "_min_dwell",
        "_positioned",
        "_standstill_dwell",
        "_standstill_time",
        "_threshold",
        "_tolerance",
        "_waited",
        "_watching",
        "_window",
        "standstill",
    )

    def __init__(self, axis: TechnologyAxis, cycle_s: float) -> None:
        self._axis = axis
        self._cycle = cycle_s
        modulo = axis.modulo
        self._fastest = modulo.length / axis.cycle_s * _OVERSHOOT if modulo.enabled else inf
        """Velocity at which an axis passes its modulo range once per cycle."""
        self._farthest = farthest_position(axis.variables.read("Units.LengthUnit"))
        """Largest position whose steps can all be told apart."""
        bind = axis.variables.bind
        self._enable_fe = bind("FollowingError.EnableMonitoring")
        self._fe_min = bind("FollowingError.MinValue")
        self._fe_max = bind("FollowingError.MaxValue")
        self._fe_min_velocity = bind("FollowingError.MinVelocity")
        self._fe_level = bind("FollowingError.WarningLevel")
        self._max_velocity = bind("DynamicLimits.MaxVelocity")
        self._tolerance = bind("PositioningMonitoring.ToleranceTime")
        self._min_dwell = bind("PositioningMonitoring.MinDwellTime")
        self._window = bind("PositioningMonitoring.Window")
        self._threshold = bind("StandstillSignal.VelocityThreshold")
        self._standstill_dwell = bind("StandstillSignal.MinDwellTime")
        self.standstill = False
        """StatusWord.X7."""
        self._standstill_time = 0.0
        self._watching = False
        self._positioned = False
        self._entered = False
        self._waited = 0.0
        self._dwell = 0.0

    # -- positioning
    # ------------------------------------------------------------------------------------------

    def start_positioning(self) -> None:
        """The setpoint has reached its end: tolerance time starts (MON-016)."""
        self._watching = True
        self._positioned = False
        self._entered = False
        self._waited = 0.0
        self._dwell = 0.0
        self._watch(first=True)

    def positioned(self) -> bool:
        """Return whether the actual position has stayed in the window for the dwell time."""
        return self._positioned

    def cancel(self) -> None:
        """End the supervision without a result (MON-027)."""
        self._watching = False

    def _watch(self, *, first: bool = False) -> None:
        axis = self._axis
        if axis.torque.relaxes_monitoring:
            # The setpoint may be far away for good: the motion has ended when the axis stands (STP-148,
            # MC-560).
            if self.standstill:
                self._watching = False
                self._positioned = True
            return
        inside = abs(axis.feedback.position - axis.motion.total.s) <= self._window.value
        if inside:
            if self._entered:
                self._dwell += self._cycle
            self._entered = True
            if self._dwell >= self._min_dwell.value - 1e-9:
                self._watching = False
                self._positioned = True
        elif self._entered:
            self._watching = False
            axis.alarms.raise_alarm(ALARM_POSITIONING, info=2)
        else:
            if not first:
                self._waited += self._cycle
            if self._waited >= self._tolerance.value - 1e-9:
                self._watching = False
                axis.alarms.raise_alarm(ALARM_POSITIONING, info=1)

    def _leave_range(self, *, controlled: bool) -> None:
        """Stop a motion that goes on outwards; a value beyond the rounding of the last step switches the axis
        off (LIM-103).

        Motion back is possible after the acknowledgement.
        """
        axis = self._axis
        position = axis.feedback.position
        info = 2 if position > 0.0 else 1
        if abs(position) > self._farthest * _RANGE_END:
            axis.alarms.raise_alarm(ALARM_RANGE_EXCEEDED, info=info)
        elif controlled and axis.motion.total.v * position > 0.0:
            axis.alarms.raise_alarm(ALARM_RANGE_REACHED, info=info)

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    def permitted_following_error(self, velocity: float) -> float:
        """Return the permitted following error at velocity setpoint `velocity` (MON-038)."""
        low = self._fe_min_velocity.value
        speed = abs(velocity)
        if speed <= low:
            return float(self._fe_min.value)
        top = self._max_velocity.value
        if speed >= top:
            return float(self._fe_max.value)
        return float(
            self._fe_min.value + (self._fe_max.value - self._fe_min.value) * (speed - low) / (top - low)
        )

    def step(self, *, controlled: bool) -> None:
        """Run the monitoring of one cycle; `controlled`: position control is closed."""
        axis = self._axis
        feedback = axis.feedback
        farthest = self._farthest
        if not -farthest <= feedback.position <= farthest:
            self._leave_range(controlled=controlled)
        speed = abs(feedback.velocity)
        if speed > self._fastest:
            axis.alarms.raise_alarm(ALARM_ACTUAL_VALUE, info=3)
        threshold = self._threshold.value
        if self.standstill:
            if speed > threshold * _RELEASE_FACTOR:
                self.standstill = False
                self._standstill_time = 0.0
        elif (
            speed < threshold or speed == 0.0
        ):  # with a threshold of 0 an axis that does not move stands, too
            self._standstill_time += self._cycle
            if self._standstill_time >= self._standstill_dwell.value - 1e-9:
                self.standstill = True
        else:
            self._standstill_time = 0.0
        if not controlled:
            self._watching = False
            return
        if self._enable_fe.value and not axis.torque.relaxes_monitoring:
            self._watch_following_error()
        if self._watching and axis.facts.controlled:
            self._watch()

    def _watch_following_error(self) -> None:
        """Compare the following error with what is permitted at this velocity setpoint (MON-040 to
        MON-042).
        """
        axis = self._axis
        error = abs(axis.controller.following_error)
        low, high = self._fe_min.value, self._fe_max.value
        level = self._fe_level.value * 0.01
        if not error or error < min(low, high) * level:
            return
        permitted = self.permitted_following_error(axis.motion.total.v)
        if error > permitted:
            axis.alarms.raise_alarm(ALARM_FOLLOWING_ERROR)
        elif error >= permitted * level:
            axis.alarms.warn(ALARM_FOLLOWING_ERROR_WARNING)
