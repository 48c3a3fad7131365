"""Travel limits of a positioning axis: hardware and software limit switches (LIM sections 1.4 to 1.6, 1.9, 1.11)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.axis.state import AxisState
from motion.drives.port import INPUT_NEGATIVE_LIMIT, INPUT_POSITIVE_LIMIT
from motion.setpoint import stop_distance

if TYPE_CHECKING:
    from motion.axis.axis import TechnologyAxis

ALARM_SOFTWARE_SPECIFICATION: Final = 104
ALARM_HARDWARE: Final = 531
ALARM_SOFTWARE_REACHED: Final = 533
ALARM_SOFTWARE_EXCEEDED: Final = 534

_PASSED_TOLERANCE: Final = 1e-6
"""Axis units by which a setpoint may lie beyond its limit without having passed it (rounding)."""

_CREEP: Final = 1.0
"""Velocity with which an axis at rest goes the last rounding error to its limit, axis unit per second."""

_ON_TARGET: Final = 1e-3
"""Axis units by which the predicted stop of a positioning may miss its target (a profile in its last phase)."""


class _HardwareSwitch:
    """One hardware limit switch; `direction` is +1 for the positive one."""

    __slots__ = ("active", "direction", "mask", "trip")

    def __init__(self, direction: int, mask: int) -> None:
        self.direction = direction
        self.mask = mask
        self.active = False
        """StatusWord.X17 or X18."""
        self.trip: float | None = None
        """Position at which a traversable switch was met."""


class TravelLimits:
    """See the module. The switches are wired to the digital inputs of the drive (60FDh)."""

    __slots__ = ("_axis", "_hw_active", "_hw_mode", "_hw_reaction", "_range_max", "_range_min",
                 "_sw_active", "_sw_exceeded", "_sw_max", "_sw_min", "_sw_reached", "_switches", "_was_active", "negative",
                 "positive", "software_max", "software_min")  # fmt: skip

    def __init__(self, axis: TechnologyAxis) -> None:
        self._axis = axis
        bind = axis.variables.bind
        self._hw_active = bind("PositionLimits_HW.Active")
        self._hw_mode = bind("PositionLimits_HW.Mode")
        self._hw_reaction = bind("PositionLimits_HW.ApproachBehavior")
        self._sw_active = bind("PositionLimits_SW.Active")
        self._sw_min = bind("PositionLimits_SW.MinPosition")
        self._sw_max = bind("PositionLimits_SW.MaxPosition")
        self._sw_reached = bind("PositionLimits_SW.LimitReachedBehavior")
        self._sw_exceeded = bind("PositionLimits_SW.LimitExceededBehavior")
        self.negative = _HardwareSwitch(-1, INPUT_NEGATIVE_LIMIT)
        self.positive = _HardwareSwitch(+1, INPUT_POSITIVE_LIMIT)
        self._switches = (
            (self.negative, bind("PositionLimits_HW.MinSwitchLevel")),
            (self.positive, bind("PositionLimits_HW.MaxSwitchLevel")),
        )
        self.software_min = False
        """StatusWord.X15."""
        self.software_max = False
        """StatusWord.X16."""
        self._was_active = False
        self._range_min = 0.0
        self._range_max = 0.0

    # -- hardware ---------------------------------------------------------------------------------------------

    def check_hardware(self) -> None:
        """Evaluate both switches; runs before the setpoint of the cycle."""
        if not self._hw_active.value or self._axis.simulated:
            if self.negative.active or self.positive.active:
                for switch in (self.negative, self.positive):
                    switch.active = False
                    switch.trip = None
            return
        port = self._axis.port
        if not port.link_ok:
            return
        inputs = port.inputs
        for switch, level in self._switches:
            on = (inputs & switch.mask != 0) is (level.value != 0)
            if on or switch.active:
                self._evaluate(switch, on)

    def _evaluate(self, switch: _HardwareSwitch, on: bool) -> None:
        axis = self._axis
        if not switch.active:
            switch.active = True
            if self._hw_mode.value == 1:
                switch.trip = axis.feedback.position
            self._alarm()
            return
        if not on:
            beyond = (
                switch.trip is not None and (axis.feedback.position - switch.trip) * switch.direction >= 0.0
            )
            if not beyond:
                switch.active = False
                switch.trip = None
                return
        # Acknowledged, still active, and commanded further outwards: the alarm comes again (LIM-049, LIM-059).
        if (
            axis.state is AxisState.MOTION
            and axis.motion.total.v * switch.direction > 0.0
            and not axis.alarms.blocking
        ):
            self._alarm()

    def _alarm(self) -> None:
        keeps_enabled = self._hw_mode.value == 0 and self._hw_reaction.value == 1
        self._axis.alarms.raise_alarm(ALARM_HARDWARE, reaction=3 if keeps_enabled else 4)

    # -- software ---------------------------------------------------------------------------------------------

    def check_software(self) -> None:
        """Look ahead with the setpoint of this cycle; runs before the setpoint is advanced."""
        axis = self._axis
        if not self._sw_active.value or not axis.homed:
            self._was_active = False
            self.software_min = self.software_max = False
            return
        gen = axis.motion.total
        position = gen.s
        low, high = self._sw_min.value, self._sw_max.value
        if low >= high:
            axis.alarms.raise_alarm(ALARM_SOFTWARE_SPECIFICATION)
            return
        if axis.modulo.enabled:
            low, high = axis.modulo.limits(low, high, position)
        if not self._was_active:
            self._was_active = True
            self._range_min = min(low, position)
            self._range_max = max(high, position)
        # Outside for another reason, the present position is the limit and follows the axis inwards (LIM-095, -096).
        self._range_min = min(low, max(self._range_min, position))
        self._range_max = max(high, min(self._range_max, position))
        self.software_min = position <= low + _PASSED_TOLERANCE
        self.software_max = position >= high - _PASSED_TOLERANCE
        if axis.alarms.blocking or axis.state not in (
            AxisState.MOTION,
            AxisState.HALTING,
            AxisState.STOPPING,
        ):
            return
        # The state after this cycle decides: as long as it can still stop in time, braking may wait one cycle more.
        following = gen.peek(axis.cycle_s)
        _, velocity, acceleration = following
        if velocity > 0.0 or (velocity == 0.0 and acceleration > 0.0):
            self._look_ahead(position, following, 1.0, self._range_max)
        elif velocity < 0.0 or acceleration < 0.0:
            self._look_ahead(position, following, -1.0, self._range_min)

    def _look_ahead(
        self, position: float, following: tuple[float, float, float], direction: float, limit: float
    ) -> None:
        """Compare room and way to stop after this cycle; `following`: position, velocity, acceleration then."""
        axis = self._axis
        motion = axis.motion
        job = motion.job
        if (position - limit) * direction > _PASSED_TOLERANCE:
            axis.alarms.raise_alarm(
                ALARM_SOFTWARE_EXCEEDED, reaction=3 if self._sw_exceeded.value == 1 else 4
            )
            return
        next_position, velocity, acceleration = following
        speed = velocity * direction
        growth = acceleration * direction
        target = motion.destination
        if target is not None:
            inside = self._range_min - _PASSED_TOLERANCE <= target <= self._range_max + _PASSED_TOLERANCE
            to_target = (target - next_position) * direction
            if job is None:
                job = motion.superimposed.job if motion.superimposed is not None else None
            if (
                inside
                and job is not None
                and stop_distance(speed, growth, job.deceleration, job.jerk) <= to_target + _ON_TARGET
            ):
                return
        deceleration, jerk = self._dynamics()
        if (
            stop_distance(speed, growth, deceleration, jerk)
            > (limit - next_position) * direction + _PASSED_TOLERANCE
        ):
            self._reach(limit)

    def _dynamics(self) -> tuple[float, float]:
        read = self._axis.variables.read
        job = self._axis.motion.job
        if self._sw_reached.value == 1:
            if job is not None:
                return job.deceleration, job.jerk
            return read("DynamicDefaults.Deceleration"), read("DynamicDefaults.Jerk")
        return read("DynamicLimits.MaxDeceleration"), read("DynamicLimits.MaxJerk")

    def _reach(self, limit: float) -> None:
        """Alarm 533: the motion is aborted and ends exactly at the limit (LIM-075)."""
        axis = self._axis
        motion = axis.motion
        deceleration, jerk = self._dynamics()
        stopping = axis.state in (AxisState.HALTING, AxisState.STOPPING)
        axis.alarms.raise_alarm(ALARM_SOFTWARE_REACHED, reaction=1 if self._sw_reached.value == 1 else 2)
        if axis.state is AxisState.ALARM_RAMP and not stopping:
            motion.gen.start_position(limit, abs(motion.gen.v) or _CREEP, deceleration, deceleration, jerk)

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system (LIM-051)."""
        for switch in (self.negative, self.positive):
            if switch.trip is not None:
                switch.trip += offset
        self._was_active = False
