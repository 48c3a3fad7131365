"""The setpoint of an axis: what the job in control, stops and superimposed motion make of it."""

from __future__ import annotations

from math import copysign, sqrt
from typing import TYPE_CHECKING, Final

from motion.axis.jobs import Job, JobClass
from motion.axis.state import AxisState
from motion.axis.superposition import Superposition
from motion.setpoint import SetpointGenerator, resolve

if TYPE_CHECKING:
    from motion.axis.axis import TechnologyAxis

ALARM_VELOCITY_LIMITED: Final = 501
ALARM_ACCELERATION_LIMITED: Final = 502
ALARM_JERK_LIMITED: Final = 503
ALARM_ZERO_VELOCITY: Final = 304
ALARM_ZERO_ACCELERATION: Final = 305
ALARM_ZERO_JERK: Final = 306

_LAST_RESORT: Final = 1.0e6
"""Deceleration of a stop for which every configured value is zero."""


class SetpointPlanning:
    """Setpoint generators and dynamic limits of one axis, and the ramps that they make.

    Args:
        axis: The axis.

    """

    __slots__ = ("_axis", "_emergency", "_limit_velocity", "_max_acceleration", "_max_deceleration", "_max_jerk",
                 "_max_velocity", "_override", "_planned_velocity", "_settling", "_superimposed_before", "gen", "job",
                 "position_controlled", "severity", "superimposed", "total")  # fmt: skip

    def __init__(self, axis: TechnologyAxis) -> None:
        self._axis = axis
        bind = axis.variables.bind
        self._max_velocity = bind("DynamicLimits.MaxVelocity")
        self._limit_velocity = bind("DynamicLimits.Velocity")
        self._max_acceleration = bind("DynamicLimits.MaxAcceleration")
        self._max_deceleration = bind("DynamicLimits.MaxDeceleration")
        self._max_jerk = bind("DynamicLimits.MaxJerk")
        self._emergency = bind("DynamicDefaults.EmergencyDeceleration")
        self._override = bind("Override.Velocity")
        self.gen = SetpointGenerator()
        """Setpoint of the basic motion."""
        self.total: SetpointGenerator | Superposition = self.gen
        """Setpoint of the axis: that of the basic motion, or its sum with the superimposed one."""
        self.superimposed: Superposition | None = None
        self._superimposed_before = 0.0
        self.job: Job | None = None
        """Job in control, `MC_Stop` included."""
        self.position_controlled = False
        self.severity = 0
        """Severity of the stop ramp in progress: 0 none, 1 current, 2 maximum, 3 emergency (STP-432 to STP-435)."""
        self._planned_velocity = 0.0
        self._settling = False

    @property
    def stopping(self) -> bool:
        """Whether `MC_Stop` is in control."""
        job = self.job
        return job is not None and job.job_class is JobClass.STOP

    # -- profiles -------------------------------------------------------------------------------------------

    def _limits(self, job: Job) -> tuple[float, float, float]:
        """Return acceleration, deceleration and jerk of `job` after the dynamic limits, with their warnings."""
        acceleration, limited = resolve(job.acceleration, 0.0, self._max_acceleration.value)
        deceleration, also_limited = resolve(job.deceleration, 0.0, self._max_deceleration.value)
        jerk, jerk_limited = resolve(job.jerk, 0.0, self._max_jerk.value)
        if limited or also_limited:
            self._axis.alarms.warn(ALARM_ACCELERATION_LIMITED)
        if jerk_limited:
            self._axis.alarms.warn(ALARM_JERK_LIMITED)
        return acceleration, deceleration, jerk

    def _bound_acceleration(self, jerk: float) -> None:
        """Let a present acceleration that `jerk` cannot end in time end at once, as far as needed (STP-119).

        What is carried over neither accelerates beyond the maximum velocity nor brakes through zero. This matters only
        after a ramp with a higher jerk or without jerk limit, an emergency ramp for example.
        """
        gen = self.gen
        a = gen.a
        if a == 0.0 or jerk <= 0.0:
            return
        v = gen.v
        room = abs(v) if v * a < 0.0 else max(0.0, self._max_velocity.value - abs(v))
        bound = sqrt(2.0 * jerk * room)
        if abs(a) > bound:
            gen.a = copysign(bound, a)

    def _effective_velocity(self, job: Job) -> float:
        """Return the job's velocity after override, then limits (MC-094)."""
        velocity: float = job.velocity * self._override.value * 0.01
        limit: float = min(self._max_velocity.value, self._limit_velocity.value)
        if velocity > limit:
            self._axis.alarms.warn(ALARM_VELOCITY_LIMITED)
            return limit
        if velocity < -limit:
            self._axis.alarms.warn(ALARM_VELOCITY_LIMITED)
            return -limit
        return velocity

    def _limits_are_zero(self) -> bool:
        """Raise alarm 304, 305 or 306 when a dynamic limit is zero, so that no motion can be planned (STP-607)."""
        if self._max_velocity.value <= 0.0:
            number = ALARM_ZERO_VELOCITY
        elif self._max_acceleration.value <= 0.0 or self._max_deceleration.value <= 0.0:
            number = ALARM_ZERO_ACCELERATION
        elif self._max_jerk.value <= 0.0:
            number = ALARM_ZERO_JERK
        else:
            return False
        self._axis.alarms.raise_alarm(number)
        return True

    def _plan_position(self, job: Job) -> None:
        velocity = self._planned_velocity = self._effective_velocity(job)
        acceleration, deceleration, jerk = self._limits(job)
        self._bound_acceleration(jerk)
        if velocity > 0.0:
            self.gen.start_position(job.target, velocity, acceleration, deceleration, jerk)
        else:
            # Override 0 %: the axis waits on its way and goes on when the override does.
            self.gen.start_velocity(0.0, acceleration, deceleration, jerk)

    def _plan_velocity(self, job: Job) -> None:
        velocity = self._planned_velocity = 0.0 if job.released else self._effective_velocity(job)
        acceleration, deceleration, jerk = self._limits(job)
        self._bound_acceleration(jerk)
        self.gen.start_velocity(velocity, acceleration, deceleration, jerk)

    def set_position_control(self, on: bool) -> None:
        """Close or open position control without a step of the speed setpoint."""
        if on and not self.position_controlled:
            self._start_from_actual_position(self.gen.v, self.gen.a)
        self.position_controlled = on

    # -- stops ----------------------------------------------------------------------------------------------

    def begin_stop(
        self, severity: int, deceleration: float, jerk: float, *, abort_acceleration: bool = False
    ) -> None:
        """Start a braking ramp from the setpoints with values that are limited by the dynamic limits."""
        self._sum_up()
        self.severity = severity
        self._settling = False
        maximum = self._max_jerk.value
        jerk = min(jerk, maximum) if maximum > 0.0 else jerk
        self._bound_acceleration(jerk)
        self.gen.start_stop(
            min(deceleration, self._max_deceleration.value) or self._emergency.value or _LAST_RESORT,
            jerk,
            abort_acceleration=abort_acceleration,
        )

    def begin_reaction(self, severity: int, *, abort_acceleration: bool = False) -> None:
        """Start the ramp of severity 1 (current), 2 (maximum) or 3 (emergency) dynamics (STP-386 to STP-388)."""
        if severity == 3:
            self.take_actual_values()
            self.severity = 3
            self._settling = False
            self.gen.start_stop(self._emergency.value or self._max_deceleration.value or _LAST_RESORT, 0.0)
        elif severity == 2:
            self.begin_stop(
                2, self._max_deceleration.value, self._max_jerk.value, abort_acceleration=abort_acceleration
            )
        else:
            job = self.job
            if job is not None and job.deceleration > 0.0:
                self.begin_stop(1, job.deceleration, job.jerk)
            else:
                read = self._axis.variables.read
                self.begin_stop(1, read("DynamicDefaults.Deceleration"), read("DynamicDefaults.Jerk"))

    def take_actual_values(self) -> None:
        """Let the setpoint start from the actual values, moved on by the transport delay (STP-123, STP-054)."""
        self._sum_up()
        self._start_from_actual_position(self._axis.actual_velocity)

    def _start_from_actual_position(self, velocity: float, acceleration: float = 0.0) -> None:
        """Put the setpoint as far ahead of the actual position as `velocity` carries it during the delay."""
        axis = self._axis
        position = axis.feedback.position + velocity * axis.setpoint_delay_s
        self.gen.set_state(position, velocity, acceleration)
        if axis.has_position:
            axis.controller.reset(position, velocity)

    # -- superimposed motion --------------------------------------------------------------------------------

    def _basic_velocity(self) -> float:
        """Return the velocity to which the basic motion accelerates, with its sign."""
        job = self.job
        if job is None or self._axis.state is not AxisState.MOTION:
            return 0.0
        velocity = self._planned_velocity
        positioning = job.job_class is JobClass.POSITIONING
        return copysign(velocity, job.target - self.gen.s) if positioning else velocity

    def _sum_up(self) -> None:
        """Make the basic setpoint the sum, from where one ramp can brake all of it."""
        total, gen = self.total, self.gen
        if total is not gen:
            gen.set_state(total.s, total.v, total.a)
            self.total = gen

    def shift(self, offset: float) -> None:
        """Move the setpoint of the basic motion, and the target of its job, by `offset`, axis unit."""
        self.gen.shift(offset)
        if self.job is not None:
            self.job.target += offset

    @property
    def superimposed_distance(self) -> float:
        """What superimposed motions have covered since the axis was last without motion, axis unit (MC-353)."""
        moving = self.superimposed
        return self._superimposed_before + (moving.part.s if moving is not None else 0.0)

    @property
    def destination(self) -> float | None:
        """Where the motion ends by its own plan, axis unit; None if it has no target."""
        job, moving = self.job, self.superimposed
        if job is None:
            return None if moving is None else self.gen.s + moving.part.s + moving.remaining
        if job.job_class is not JobClass.POSITIONING:
            return None
        return job.target + (0.0 if moving is None else moving.part.s + moving.remaining)
