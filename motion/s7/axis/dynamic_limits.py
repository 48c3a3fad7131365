"""Dynamic limits of an axis: what they leave of the values of a job, with the warnings for it."""

from __future__ import annotations

from math import copysign, inf
from typing import TYPE_CHECKING, Final

from motion.setpoint import resolve

if TYPE_CHECKING:
    from motion.s7.axis.alarms import AxisAlarms
    from motion.s7.axis.jobs import Job
    from motion.s7.variables import VariableStore

ALARM_VELOCITY_LIMITED: Final = 501
ALARM_ACCELERATION_LIMITED: Final = 502
ALARM_JERK_LIMITED: Final = 503
ALARM_ZERO_VELOCITY: Final = 304
ALARM_ZERO_ACCELERATION: Final = 305
ALARM_ZERO_JERK: Final = 306


class DynamicLimits:
    """Limits the dynamic values of jobs and raises the warnings for it.

    Args:
        store: Variables of the axis.
        alarms: Its alarms.

    """

    def __init__(self, store: VariableStore, alarms: AxisAlarms) -> None:
        bind = store.bind
        self._alarms = alarms
        self.max_velocity = bind("DynamicLimits.MaxVelocity")
        self._limit_velocity = bind("DynamicLimits.Velocity")
        self.max_acceleration = bind("DynamicLimits.MaxAcceleration")
        self.max_deceleration = bind("DynamicLimits.MaxDeceleration")
        self.max_jerk = bind("DynamicLimits.MaxJerk")
        self.emergency = bind("DynamicDefaults.EmergencyDeceleration")
        self.override = bind("Override.Velocity")
        self.leading = inf
        """Velocity at which followers can still follow the leading value, axis unit per second; infinite
        without modulo range.
        """
        self.velocity_limited = False
        """The velocity of the job in control is limited: the warning is repeated
        when it has been acknowledged.
        """

    def of(self, job: Job) -> tuple[float, float, float]:
        """Return acceleration, deceleration and jerk of `job` after the
        dynamic limits, with their warnings.
        """
        acceleration, limited = resolve(job.acceleration, 0.0, self.max_acceleration.value)
        deceleration, also_limited = resolve(job.deceleration, 0.0, self.max_deceleration.value)
        jerk, jerk_limited = resolve(job.jerk, 0.0, self.max_jerk.value)
        if limited or also_limited:
            self._alarms.warn(ALARM_ACCELERATION_LIMITED, 1 if limited else 2)
        if jerk_limited:
            self._alarms.warn(ALARM_JERK_LIMITED)
        return acceleration, deceleration, jerk

    def without_warning(self, job: Job) -> tuple[float, float, float]:
        """Return what `of` does, for a motion that is only weighed up."""
        acceleration, _ = resolve(job.acceleration, 0.0, self.max_acceleration.value)
        deceleration, _ = resolve(job.deceleration, 0.0, self.max_deceleration.value)
        jerk, _ = resolve(job.jerk, 0.0, self.max_jerk.value)
        return acceleration, deceleration, jerk

    def limit_braking(self, deceleration: float, jerk: float) -> tuple[float, float]:
        """Return what the dynamic limits leave of a deceleration and a jerk (0 = none); no limit is zero."""
        return min(deceleration, self.max_deceleration.value), min(jerk, self.max_jerk.value)

    def velocity(self, job: Job) -> float:
        """Return the job's velocity after override, then limits (MC-094)."""
        velocity: float = job.velocity * self.override.value * 0.01
        limit = self.velocity_limit()
        self.velocity_limited = limited = not -limit <= velocity <= limit
        if limited:
            self._alarms.warn(ALARM_VELOCITY_LIMITED)
            return copysign(limit, velocity)
        return velocity

    def velocity_limit(self) -> float:
        """Return the highest velocity of the axis, axis unit per second (VAR-164, STP-113)."""
        limit: float = min(self.max_velocity.value, self._limit_velocity.value, self.leading)
        return limit

    def are_zero(self) -> bool:
        """Raise alarm 304, 305 or 306 when a dynamic limit is zero, so that no
        motion can be planned (STP-607).
        """
        info = 1
        if self.max_velocity.value <= 0.0:
            number = ALARM_ZERO_VELOCITY
        elif self.max_acceleration.value <= 0.0:
            number = ALARM_ZERO_ACCELERATION
        elif self.max_deceleration.value <= 0.0:
            number, info = ALARM_ZERO_ACCELERATION, 2
        elif self.max_jerk.value <= 0.0:
            number = ALARM_ZERO_JERK
        else:
            return False
        self._alarms.raise_alarm(number, info=info)
        return True

    def repeat_warning(self) -> None:
        """Warn of a velocity that is limited, once until it is acknowledged (VAR-165)."""
        self._alarms.warn(ALARM_VELOCITY_LIMITED)
