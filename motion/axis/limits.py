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

_APPROACHED: Final = {1: 1, -1: 2}
"""Cause of alarm 531 by the direction of the switch."""
_BLOCKED_DIRECTION: Final = 3
_REVERSED: Final = 4
_BOTH: Final = 5
_ENCODER: Final = 6
"""Causes 4 to 6 allow no retraction (LIM-053, LIM-061, LIM-062)."""
_TRAVERSABLE: Final = 1

_PASSED_TOLERANCE: Final = 1e-6
"""Axis units by which a setpoint may lie beyond its limit without having passed it (rounding)."""

_CREEP: Final = 1.0
"""Velocity with which an axis at rest goes the last rounding error to its limit, axis unit per second."""

_ON_TARGET: Final = 1e-3
"""Axis units by which the predicted stop of a positioning may miss its target (a profile in its last phase)."""


_WATCHED: Final = (AxisState.MOTION, AxisState.HALTING, AxisState.STOPPING)
"""States in which a software limit can stop the axis."""


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

    __slots__ = ("_axis", "_barred", "_given", "_hw_active", "_hw_mode", "_hw_reaction", "_range_max", "_range_min",
                 "_sw_active", "_sw_exceeded", "_sw_max", "_sw_min", "_sw_reached", "_switches", "_was_active", "negative",
                 "positive", "reversing", "software_max", "software_min")  # fmt: skip

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
        self.reversing = False
        """Active homing turns round at the switches: they are shown, and there is no alarm (HOM-109)."""
        self._barred = 0
        """Cause of alarm 531 that allows no retraction, 0 without one."""
        self._was_active = False
        self._given = (0.0, 0.0)
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
                self._barred = 0
            return
        port = self._axis.port
        if not port.link_ok:
            return
        inputs = port.inputs
        for switch, level in self._switches:
            on = (inputs & switch.mask != 0) is (level.value != 0)
            if self.reversing:
                switch.active = on
            elif on or switch.active:
                self._evaluate(switch, on)

    def end_reversal(self) -> None:
        """Watch the switches again from the next cycle on; one that is still active then raises its alarm (HOM-115)."""
        if self.reversing:
            self.reversing = False
            self.negative.active = self.positive.active = False

    def _evaluate(self, switch: _HardwareSwitch, on: bool) -> None:
        axis = self._axis
        if not switch.active:
            switch.active = True
            if self._hw_mode.value == _TRAVERSABLE:
                switch.trip = axis.feedback.position
            if (self.negative.active and self.positive.active) or self._both_on():
                self._barred = _BOTH
            elif axis.state is AxisState.MOTION and axis.motion.total.v * switch.direction < 0.0:
                self._barred = _REVERSED  # met on the way to the other one
            self._alarm(self._barred or _APPROACHED[switch.direction])
            return
        if not on:
            beyond = (
                switch.trip is not None and (axis.feedback.position - switch.trip) * switch.direction >= 0.0
            )
            if not beyond:
                switch.active = False
                switch.trip = None
                self._barred = 0
                return
        if switch.trip is not None and self._barred != _ENCODER and not axis.sensor_valid:
            self._barred = _ENCODER  # nobody knows when it is back inside
            self._alarm(_ENCODER)
            return
        # Acknowledged, still active, and commanded further outwards: the alarm comes again (LIM-049, LIM-059). Where nobody can
        # say which way is outwards it comes again in both directions.
        if axis.state is AxisState.MOTION and not axis.alarms.blocking:
            outwards = axis.motion.total.v * switch.direction
            if outwards > 0.0 or (self._barred and outwards != 0.0):
                self._alarm(self._barred or _BLOCKED_DIRECTION)

    def _both_on(self) -> bool:
        inputs = self._axis.port.inputs
        return all((inputs & switch.mask != 0) is (level.value != 0) for switch, level in self._switches)

    def _alarm(self, cause: int) -> None:
        traversable = self._hw_mode.value == _TRAVERSABLE
        keeps_enabled = not traversable and self._hw_reaction.value == 1
        self._axis.alarms.raise_alarm(
            ALARM_HARDWARE,
            reaction=3 if keeps_enabled else 4,
            info=cause,
            restart=cause == _ENCODER or (traversable and cause in (_REVERSED, _BOTH)),
        )

    # -- software ---------------------------------------------------------------------------------------------

    def check_software(self) -> None:
        """Look ahead with the setpoint of this cycle; runs before the setpoint is advanced."""
        axis = self._axis
        gen = axis.motion.total
        position = gen.s
        if not self._follow_range(position) or axis.alarms.blocking or axis.state not in _WATCHED:
            return
        # The state after this cycle decides: as long as it can still stop in time, braking may wait one cycle more.
        following = gen.peek(axis.interpolator_s)
        _, velocity, acceleration = following
        if velocity > 0.0 or (velocity == 0.0 and acceleration > 0.0):
            self._look_ahead(position, following, 1.0, self._range_max)
        elif velocity < 0.0 or acceleration < 0.0:
            self._look_ahead(position, following, -1.0, self._range_min)
        elif not self._range_min - _PASSED_TOLERANCE <= position <= self._range_max + _PASSED_TOLERANCE:
            self._exceed(
                position - self._range_max
            )  # jumped there, as only setpoints from outside can (LIM-084)

    def check_actual(self, *, controlled: bool) -> None:
        """Look at the actual position, where there is no position setpoint to look ahead with (LIM-089, LIM-090).

        Args:
            controlled: The axis moves on its own account, so that a limit it passes is an alarm.

        """
        axis = self._axis
        position = axis.feedback.position
        if not self._follow_range(position):
            return
        if not controlled:
            self._was_active = False  # what it is pushed to will be its limit (LIM-095)
        elif axis.state in _WATCHED and not axis.alarms.blocking:
            velocity = axis.motion.total.v
            if (velocity > 0.0 and position > self._range_max + _PASSED_TOLERANCE) or (
                velocity < 0.0 and position < self._range_min - _PASSED_TOLERANCE
            ):
                self._exceed(velocity)

    def _follow_range(self, position: float) -> bool:
        """Take limits and position of this cycle over; returns whether the limits act."""
        axis = self._axis
        if not self._sw_active.value or not axis.homed:
            self._was_active = False
            self.software_min = self.software_max = False
            return False
        low, high = given = self._sw_min.value, self._sw_max.value
        if low >= high:
            axis.alarms.raise_alarm(ALARM_SOFTWARE_SPECIFICATION)
            return False
        if axis.modulo.enabled:
            low, high = axis.modulo.limits(low, high, position)
        if not self._was_active:
            self._was_active = True
            self._given = given
            self._range_min = min(low, position)
            self._range_max = max(high, position)
        elif given != self._given:
            # Moved at run time: where the axis is beyond a limit now it has passed it (LIM-084, LIM-087).
            self._given = given
            self._range_min, self._range_max = low, high
        if low <= position <= high or self._range_min < low or self._range_max > high:
            # Outside for another reason, the present position is the limit and follows the axis inwards (LIM-095, -096).
            self._range_min = min(low, max(self._range_min, position))
            self._range_max = max(high, min(self._range_max, position))
        self.software_min = position <= low + _PASSED_TOLERANCE
        self.software_max = position >= high - _PASSED_TOLERANCE
        return True

    def _look_ahead(
        self, position: float, following: tuple[float, float, float], direction: float, limit: float
    ) -> None:
        """Compare room and way to stop after this cycle; `following`: position, velocity, acceleration then."""
        axis = self._axis
        motion = axis.motion
        job = motion.job
        if (position - limit) * direction > _PASSED_TOLERANCE:
            self._exceed(direction)
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
                and stop_distance(speed, growth, *motion.limit_braking(job.deceleration, job.jerk))
                <= to_target + _ON_TARGET
            ):
                return
        deceleration, jerk = self._dynamics()
        if (
            stop_distance(speed, growth, deceleration, jerk)
            > (limit - next_position) * direction + _PASSED_TOLERANCE
        ):
            self._reach(limit, direction)

    def _exceed(self, side: float) -> None:
        """Alarm 534 of the positive limit, with `side` below 0 of the negative one."""
        self._axis.alarms.raise_alarm(
            ALARM_SOFTWARE_EXCEEDED,
            reaction=3 if self._sw_exceeded.value == 1 else 4,
            info=2 if side > 0.0 else 1,
        )

    def _dynamics(self) -> tuple[float, float]:
        """Return deceleration and jerk of the stop at a limit (`LimitReachedBehavior`)."""
        read = self._axis.variables.read
        if self._sw_reached.value != 1:
            return read("DynamicLimits.MaxDeceleration"), read("DynamicLimits.MaxJerk")
        motion = self._axis.motion
        job = motion.job
        if job is not None:
            return motion.limit_braking(job.deceleration, job.jerk)
        return motion.limit_braking(read("DynamicDefaults.Deceleration"), read("DynamicDefaults.Jerk"))

    def _reach(self, limit: float, direction: float) -> None:
        """Alarm 533: the motion is aborted and ends exactly at the limit (LIM-075)."""
        axis = self._axis
        motion = axis.motion
        deceleration, jerk = self._dynamics()
        stopping = axis.state in (AxisState.HALTING, AxisState.STOPPING)
        reaction = 1 if self._sw_reached.value == 1 else 2
        axis.alarms.raise_alarm(ALARM_SOFTWARE_REACHED, reaction=reaction, info=2 if direction > 0.0 else 1)
        if axis.state is AxisState.ALARM_RAMP and not stopping:
            motion.gen.start_position(limit, abs(motion.gen.v) or _CREEP, deceleration, deceleration, jerk)

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system (LIM-051)."""
        for switch in (self.negative, self.positive):
            if switch.trip is not None:
                switch.trip += offset
        self._was_active = False
