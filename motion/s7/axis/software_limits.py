"""Software limit switches: approached so that the axis ends on them, passed,
left (LIM sections 1.9 to 1.11).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.s7.axis.state import AxisState
from motion.setpoint import stop_distance

if TYPE_CHECKING:
    from motion.kernel.servo_axis import ServoAxis
    from motion.s7.axis.alarms import AxisAlarms
    from motion.s7.axis.dynamic_limits import DynamicLimits
    from motion.s7.axis.motion import MotionControl
    from motion.s7.axis.state import AxisStates
    from motion.s7.variables import VariableStore

ALARM_SOFTWARE_SPECIFICATION: Final = 104
ALARM_SOFTWARE_REACHED: Final = 533
ALARM_SOFTWARE_EXCEEDED: Final = 534

_PASSED_TOLERANCE: Final = 1e-6
"""Axis units by which a setpoint may lie beyond its limit without having passed it (rounding)."""

_CREEP: Final = 1.0
"""Velocity with which an axis at rest goes the last rounding error to its limit, axis unit per second."""

_ON_TARGET: Final = 1e-3
"""Axis units by which the predicted stop of a positioning may miss its target (a profile in its last phase).
"""


_WATCHED: Final = (AxisState.MOTION, AxisState.HALTING, AxisState.STOPPING)
"""States in which a software limit can stop the axis."""
_RAMPS: Final = (AxisState.ALARM_RAMP, AxisState.DISABLING_RAMP)
"""States in which the axis stops already, and may pass a limit with that."""


class SoftwareLimits:
    """The software limit switches of one axis.

    Args:
        store: Variables of the axis.
        servo: The axis in the kernel.
        states: State of the axis.
        alarms: Its alarms.
        motion: Its jobs.
        dynamics: Its dynamic limits.

    """

    def __init__(
        self,
        store: VariableStore,
        *,
        servo: ServoAxis,
        states: AxisStates,
        alarms: AxisAlarms,
        motion: MotionControl,
        dynamics: DynamicLimits,
    ) -> None:
        self._store = store
        self._servo = servo
        self._states = states
        self._alarms = alarms
        self._motion = motion
        self._dynamics = dynamics
        bind = store.bind
        self._sw_active = bind("PositionLimits_SW.Active")
        self._sw_min = bind("PositionLimits_SW.MinPosition")
        self._sw_max = bind("PositionLimits_SW.MaxPosition")
        self._sw_reached = bind("PositionLimits_SW.LimitReachedBehavior")
        self._sw_exceeded = bind("PositionLimits_SW.LimitExceededBehavior")
        self.begin()

    def begin(self) -> None:
        """Begin as at the start of the axis."""
        self.software_min = False
        """StatusWord.X15."""
        self.software_max = False
        """StatusWord.X16."""
        self._was_active = False
        self._passed = False
        """Alarm 534 has been raised and not been acknowledged."""
        self._given = (0.0, 0.0)
        self._range = (0.0, 0.0)
        """Limits of a modulo axis in the range where it is."""
        self._range_min = 0.0
        self._range_max = 0.0

    def check_software(self) -> None:
        """Look ahead with the setpoint of this cycle; runs before the setpoint is advanced."""
        gen = self._servo.total
        position = gen.s
        if not self._follow_range(position):
            return
        if self._alarms.blocking or self._states.state not in _WATCHED:
            if self._states.state in _RAMPS and not self._passed:
                self._check_passed(position, gen.v)
            return
        # The state after this cycle decides: as long as it can still stop in time, braking may wait one cycle
        # more.
        following = gen.peek(self._servo.interpolator_s)
        if self._motion.given:
            # A stop begins with the acceleration that the user program has given, whatever its setpoints make
            # of it.
            following = (*following[:2], gen.a)
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
        """Look at the actual position, where there is no position setpoint to look
        ahead with (LIM-089, LIM-090).

        Args:
            controlled: The axis moves on its own account, so that a limit it passes is an alarm.

        """
        position = self._servo.feedback.position
        if not self._follow_range(position):
            return
        if not controlled:
            self._was_active = False  # what it is pushed to will be its limit (LIM-095)
        elif self._states.state in _WATCHED and not self._alarms.blocking:
            self._check_passed(position, self._servo.total.v)

    def _check_passed(self, position: float, velocity: float) -> None:
        """Raise 534 if the axis is behind a limit and continues outwards, which no
        look-ahead could prevent (LIM-084).
        """
        if (velocity > 0.0 and position > self._range_max + _PASSED_TOLERANCE) or (
            velocity < 0.0 and position < self._range_min - _PASSED_TOLERANCE
        ):
            self._exceed(velocity)

    def _follow_range(self, position: float) -> bool:
        """Take limits and position of this cycle over; returns whether the limits act."""
        active = self._sw_active.value
        low, high = given = self._sw_min.value, self._sw_max.value
        modulo = self._servo.modulo.enabled
        contradiction = active and (low == high or (low > high and not modulo))
        if contradiction:
            self._alarms.raise_alarm(ALARM_SOFTWARE_SPECIFICATION)
        if contradiction or not active or not self._servo.homed:
            self._was_active = False
            self.software_min = self.software_max = False
            return False
        if modulo:
            low, high = self._modulo_range(given, position)
        if self._passed and not self._alarms.blocking:
            # Acknowledged: it may go inwards step by step, and where it is now it has not passed anything
            # again (LIM-094).
            self._passed = self._was_active = False
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
            # Outside for another reason, the present position is the limit and follows the axis inwards
            # (LIM-095, -096).
            self._range_min = min(low, max(self._range_min, position))
            self._range_max = max(high, min(self._range_max, position))
        self.software_min = position <= low + _PASSED_TOLERANCE
        self.software_max = position >= high - _PASSED_TOLERANCE
        return True

    def _modulo_range(self, given: tuple[float, float], position: float) -> tuple[float, float]:
        """Return the limits around `position` in the coordinates of the axis.

        The axis that rests on the end of the modulo range is on its limit there, and
        not in front of the next range.
        """
        low, high = self._range
        if not (
            self._was_active
            and given == self._given
            and low - _PASSED_TOLERANCE <= position <= high + _PASSED_TOLERANCE
        ):
            low, high = self._range = self._servo.modulo.limits(*given, position)
        return low, high

    def _look_ahead(
        self, position: float, following: tuple[float, float, float], direction: float, limit: float
    ) -> None:
        """Compare the remaining travel with the way to stop after this cycle; `following`:
        position, velocity, acceleration then.
        """
        motion = self._motion
        job = motion.job
        if (position - limit) * direction > _PASSED_TOLERANCE:
            self._exceed(direction)
            return
        next_position, velocity, acceleration = following
        speed = velocity * direction
        growth = acceleration * direction
        at_once = self._ends_at_once()
        if at_once and growth > 0.0:
            growth = 0.0
        target = motion.destination
        if target is not None:
            inside = self._range_min - _PASSED_TOLERANCE <= target <= self._range_max + _PASSED_TOLERANCE
            to_target = (target - next_position) * direction
            if job is None:
                job = motion.superimposed_job if self._servo.superimposed is not None else None
            if (
                inside
                and job is not None
                and stop_distance(speed, growth, *self._dynamics.limit_braking(job.deceleration, job.jerk))
                <= to_target + _ON_TARGET
            ):
                return
        deceleration, jerk = self._braking()
        if (
            stop_distance(speed, growth, deceleration, jerk)
            > (limit - next_position) * direction + _PASSED_TOLERANCE
        ):
            self._reach(limit, direction, at_once=at_once)

    def _ends_at_once(self) -> bool:
        """Return whether the motion has no jerk limit, so that its acceleration
        needs no way to end before a limit.
        """
        motion = self._motion
        if motion.given:
            return False
        moving = motion.superimposed_job if self._servo.superimposed is not None else None
        jobs = [one for one in (motion.job, moving) if one is not None]
        return bool(jobs) and not any(one.jerk for one in jobs)

    def _exceed(self, side: float) -> None:
        """Alarm 534 of the positive limit, with `side` below 0 of the negative one."""
        self._passed = True
        self._alarms.raise_alarm(
            ALARM_SOFTWARE_EXCEEDED,
            reaction=3 if self._sw_exceeded.value == 1 else 4,
            info=2 if side > 0.0 else 1,
        )

    @property
    def _stops_as_the_job(self) -> bool:
        """Whether an axis brakes for a limit with the dynamic values of its job (`LimitReachedBehavior`); one
        that follows a leading value never does (LIM-078, SYN-114).
        """
        return self._sw_reached.value == 1 and self._motion.synchronous_job is None

    def _braking(self) -> tuple[float, float]:
        """Return deceleration and jerk of the stop at a limit."""
        read = self._store.read
        if not self._stops_as_the_job:
            return read("DynamicLimits.MaxDeceleration"), read("DynamicLimits.MaxJerk")
        motion = self._motion
        job = motion.job
        if job is not None:
            return self._dynamics.limit_braking(job.deceleration, job.jerk)
        return self._dynamics.limit_braking(
            read("DynamicDefaults.Deceleration"), read("DynamicDefaults.Jerk")
        )

    def _reach(self, limit: float, direction: float, *, at_once: bool) -> None:
        """Alarm 533: the motion is aborted and ends exactly at the limit (LIM-075).

        Args:
            limit: The limit, axis unit.
            direction: Its side, 1.0 or -1.0.
            at_once: An acceleration towards the limit ends now, even one that the next cycle would end.

        """
        motion = self._motion
        deceleration, jerk = self._braking()
        stopping = self._states.state in (AxisState.HALTING, AxisState.STOPPING)
        reaction = 1 if self._stops_as_the_job else 2
        self._alarms.raise_alarm(ALARM_SOFTWARE_REACHED, reaction=reaction, info=2 if direction > 0.0 else 1)
        if self._states.state is AxisState.ALARM_RAMP and not stopping:
            gen = motion.gen
            growth = gen.a * direction
            # A job with a jerk limit that has superseded one without may leave more acceleration than there
            # is way for: it ends as it began, at once.
            too_much = growth > 0.0 and stop_distance(gen.v * direction, growth, deceleration, jerk) > (
                (limit - gen.s) * direction + _PASSED_TOLERANCE
            )
            if too_much or (at_once and growth > 0.0):
                gen.a = 0.0
            motion.gen.start_position(limit, abs(motion.gen.v) or _CREEP, deceleration, deceleration, jerk)

    def shift(self) -> None:
        """Follow a shift of the coordinate system."""
        self._was_active = False
