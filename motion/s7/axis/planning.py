"""The setpoint of an axis: what the job in control, stops and superimposed motion make of it."""

from __future__ import annotations

from math import copysign, inf, sqrt
from typing import TYPE_CHECKING, Final

from motion.kernel.superposition import Superposition
from motion.s7.axis.jobs import Job, JobClass
from motion.s7.axis.state import AxisState
from motion.setpoint import SetpointGenerator, resolve

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

ALARM_VELOCITY_LIMITED: Final = 501
ALARM_ACCELERATION_LIMITED: Final = 502
ALARM_JERK_LIMITED: Final = 503
ALARM_ZERO_VELOCITY: Final = 304
ALARM_ZERO_ACCELERATION: Final = 305
ALARM_ZERO_JERK: Final = 306

_LAST_RESORT: Final = 1.0e6
"""Deceleration of a stop for which every configured value is zero."""
_MOTION_IN: Final = JobClass.MOTION_IN


class SetpointPlanning:
    """Setpoint generators and dynamic limits of one axis, and the ramps that they make.

    Args:
        axis: The axis.

    """

    __slots__ = (
        "_axis",
        "_emergency",
        "_limit_velocity",
        "_max_acceleration",
        "_max_deceleration",
        "_max_jerk",
        "_max_velocity",
        "_override",
        "_planned_limits",
        "_planned_velocity",
        "_ramp",
        "_settling",
        "_superimposed_before",
        "_velocity_limited",
        "gen",
        "job",
        "leading_limit",
        "limits_assigned",
        "position_controlled",
        "severity",
        "superimposed",
        "total",
    )

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
        """Severity of the stop ramp in progress: 0 none, 1 current, 2 maximum, 3 emergency (STP-432 to
        STP-435).
        """
        self.limits_assigned = False
        """A program has assigned variables since the last cycle; dynamic limits may be among them."""
        self.leading_limit = inf
        """Velocity at which followers can still tell the leading value, axis unit per second; infinite
        without modulo range.
        """
        self._planned_velocity = 0.0
        self._planned_limits = (0.0, 0.0, 0.0)
        self._velocity_limited = False
        self._ramp = (0.0, 0.0)
        self._settling = False

    @property
    def stopping(self) -> bool:
        """Whether `MC_Stop` is in control."""
        job = self.job
        return job is not None and job.job_class is JobClass.STOP

    def power_down(self) -> None:
        """Stand at position 0 without motion and without position control; jobs have ended before."""
        self._sum_up()
        self.gen.set_state(0.0, 0.0)
        self._superimposed_before = 0.0
        self.position_controlled = False
        self._leave_target()
        self.severity = 0

    # -- profiles -------------------------------------------------------------------------------------------

    def _limits(self, job: Job) -> tuple[float, float, float]:
        """Return acceleration, deceleration and jerk of `job` after the dynamic limits, with their
        warnings.
        """
        acceleration, limited = resolve(job.acceleration, 0.0, self._max_acceleration.value)
        deceleration, also_limited = resolve(job.deceleration, 0.0, self._max_deceleration.value)
        jerk, jerk_limited = resolve(job.jerk, 0.0, self._max_jerk.value)
        if limited or also_limited:
            self._axis.alarms.warn(ALARM_ACCELERATION_LIMITED, 1 if limited else 2)
        if jerk_limited:
            self._axis.alarms.warn(ALARM_JERK_LIMITED)
        return acceleration, deceleration, jerk

    def limit_braking(self, deceleration: float, jerk: float) -> tuple[float, float]:
        """Return what the dynamic limits leave of a deceleration and a jerk (0 = none); no limit is zero."""
        return min(deceleration, self._max_deceleration.value), min(jerk, self._max_jerk.value)

    def _plan_limits(self, job: Job, towards: float = 0.0) -> tuple[float, float, float]:
        """Return what `_limits` does, and remember that the motion is planned with it; `towards`:
        `_bound_acceleration`.
        """
        self._planned_limits = limits = self._limits(job)
        self._bound_acceleration(limits[2], towards)
        return limits

    def _bound_acceleration(self, jerk: float, towards: float = 0.0) -> None:
        """Let a present acceleration that `jerk` cannot end in time end at once, as far as needed (STP-119).

        What is carried over neither accelerates beyond the maximum velocity nor brakes through zero, unless
        the new motion leads there: `towards` is its velocity or way, 0 for a stop. This matters only after a
        ramp with a higher jerk or without jerk limit, an emergency ramp for example. What a jerk no higher
        than the new one has built up, on the way to the other side, is carried through zero (STP-116).
        """
        gen = self.gen
        a = gen.a
        if a == 0.0 or jerk <= 0.0:
            return
        v = gen.v
        if v * a >= 0.0:
            room = max(0.0, self._max_velocity.value - abs(v))
        elif 0.0 < gen.jerk <= jerk:
            return
        else:
            room = abs(v) + (self._max_velocity.value if towards * a > 0.0 else 0.0)
        bound = sqrt(2.0 * jerk * room)
        if abs(a) > bound:
            gen.a = copysign(bound, a)

    def _effective_velocity(self, job: Job) -> float:
        """Return the job's velocity after override, then limits (MC-094)."""
        velocity: float = job.velocity * self._override.value * 0.01
        limit = self.velocity_limit()
        self._velocity_limited = limited = not -limit <= velocity <= limit
        if limited:
            self._axis.alarms.warn(ALARM_VELOCITY_LIMITED)
            return copysign(limit, velocity)
        return velocity

    def setpoint(self) -> tuple[float, float, float]:
        """Return position, velocity and acceleration setpoint of the axis, axis unit and s."""
        total = self.total
        return total.s, total.v, total.a

    def velocity_limit(self) -> float:
        """Return the highest velocity of the axis, axis unit per second (VAR-164, STP-113)."""
        limit: float = min(self._max_velocity.value, self._limit_velocity.value, self.leading_limit)
        return limit

    def _limits_are_zero(self) -> bool:
        """Raise alarm 304, 305 or 306 when a dynamic limit is zero, so that no motion can be planned
        (STP-607).
        """
        info = 1
        if self._max_velocity.value <= 0.0:
            number = ALARM_ZERO_VELOCITY
        elif self._max_acceleration.value <= 0.0:
            number = ALARM_ZERO_ACCELERATION
        elif self._max_deceleration.value <= 0.0:
            number, info = ALARM_ZERO_ACCELERATION, 2
        elif self._max_jerk.value <= 0.0:
            number = ALARM_ZERO_JERK
        else:
            return False
        self._axis.alarms.raise_alarm(number, info=info)
        return True

    def _plan_position(self, job: Job) -> None:
        velocity = self._planned_velocity = self._effective_velocity(job)
        towards = job.target - self.gen.s if velocity > 0.0 else 0.0
        acceleration, deceleration, jerk = self._plan_limits(job, towards)
        if velocity > 0.0:
            self.gen.start_position(job.target, velocity, acceleration, deceleration, jerk)
        else:
            # Override 0 %: the axis waits on its way and goes on when the override does.
            self.gen.start_velocity(0.0, acceleration, deceleration, jerk)

    def _plan_velocity(self, job: Job) -> None:
        if job.released:
            self._velocity_limited = False
        velocity = self._planned_velocity = 0.0 if job.released else self._effective_velocity(job)
        acceleration, deceleration, jerk = self._plan_limits(job, velocity)
        self.gen.start_velocity(velocity, acceleration, deceleration, jerk)

    def follow_limits(self) -> None:
        """Take velocity override and dynamic limits that have been assigned into the motion that runs
        (VAR-001, VAR-004).
        """
        self.limits_assigned = False
        state = self._axis.state
        if state is AxisState.MOTION or state is AxisState.HALTING:
            job, moving = self.job, self.superimposed
            if job is not None and job.job_class is JobClass.MOTION_IN:
                job = None  # its setpoints know no limits (VAR-167)
            if moving is not None and moving.given:
                moving = None
            if (job is not None or moving is not None) and self._limits_are_zero():
                return
            if job is not None and not self._settling:
                self._follow_in_motion(job)
            if moving is not None and moving.job is not None:
                moving.change(*self._limits(moving.job))
        elif (
            self.severity
            and not (self.gen.done or self.gen.positioning)
            and self._ramp_limits() != self._planned_limits
        ):
            self._brake()

    def _follow_in_motion(self, job: Job) -> None:
        gen = self.gen
        changed = not gen.done and self._limits(job) != self._planned_limits
        cls = job.job_class
        if cls is JobClass.VELOCITY or (cls is JobClass.HOMING and not job.positions):
            if not job.released and self._effective_velocity(job) != self._planned_velocity:
                job.set_in_velocity(False)
                changed = True
            if changed:
                self._plan_velocity(job)
        elif job.positions:
            if changed or self._effective_velocity(job) != self._planned_velocity:
                self._plan_position(job)
        elif changed:
            _, deceleration, jerk = self._plan_limits(job)
            gen.start_stop(deceleration, jerk)

    def _repeat_warning(self) -> None:
        """Warn of a velocity that is still limited, in case it has been acknowledged (VAR-165)."""
        if not self._settling:
            self._axis.alarms.warn(ALARM_VELOCITY_LIMITED)

    def set_position_control(self, on: bool) -> None:
        """Close or open position control without a step of the speed setpoint."""
        if on and not self.position_controlled:
            self._start_from_actual_position(self.gen.v, self.gen.a)
        self.position_controlled = on

    # -- stops ----------------------------------------------------------------------------------------------

    def begin_stop(
        self, severity: int, deceleration: float, jerk: float, *, abort_acceleration: bool = False
    ) -> None:
        """Start a braking ramp from the setpoints with values that are limited by the dynamic limits.

        Args:
            severity: 1 current, 2 maximum dynamics.
            deceleration: Deceleration, axis unit per second squared; infinite for the limit.
            jerk: Jerk, axis unit per second cubed; 0 for none, infinite for the limit.
            abort_acceleration: Set a present acceleration to zero first.

        """
        self._sum_up()
        self.severity = severity
        self._leave_target()
        self._ramp = (deceleration, jerk)
        self._brake(abort_acceleration=abort_acceleration)

    def _ramp_limits(self) -> tuple[float, float, float]:
        """Return acceleration (none), deceleration and jerk of the braking ramp in progress, by the present
        limits.
        """
        if self.severity == 3:
            return 0.0, self._emergency.value or self._max_deceleration.value or _LAST_RESORT, 0.0
        deceleration, jerk = self._ramp
        maximum = self._max_jerk.value
        if maximum > 0.0 or jerk == inf:
            jerk = min(jerk, maximum)
        deceleration = min(deceleration, self._max_deceleration.value)
        return 0.0, deceleration or self._emergency.value or _LAST_RESORT, jerk

    def _brake(self, *, abort_acceleration: bool = False) -> None:
        """Plan the braking ramp of `begin_stop` or `begin_reaction` from the present setpoints."""
        _, deceleration, jerk = self._planned_limits = self._ramp_limits()
        self._bound_acceleration(jerk)
        self.gen.start_stop(deceleration, jerk, abort_acceleration=abort_acceleration)

    def begin_reaction(self, severity: int, *, abort_acceleration: bool = False) -> None:
        """Start the ramp of severity 1 (current), 2 (maximum) or 3 (emergency) dynamics (STP-386 to
        STP-388).
        """
        if severity == 3:
            self._switch_to_actual_values()
            self.severity = 3
            self._leave_target()
            self._brake()
        elif severity == 2:
            self.begin_stop(2, inf, inf, abort_acceleration=abort_acceleration)
        else:
            job = self.job
            if job is not None and job.deceleration > 0.0:
                self.begin_stop(1, job.deceleration, job.jerk)
            else:
                bind = self._axis.variables.bind
                self.begin_stop(
                    1, bind("DynamicDefaults.Deceleration").value, bind("DynamicDefaults.Jerk").value
                )

    def take_actual_values(self) -> None:
        """Let the setpoint start from the actual values, moved on by the transport delay (STP-123,
        STP-054).
        """
        self._sum_up()
        self._start_from_actual_position(self._axis.actual_velocity)

    def _switch_to_actual_values(self) -> None:
        """Take the actual values; where a smoothing time is given, what the controller had to correct fades
        with it (STP-128).
        """
        axis = self._axis
        controlled = axis.has_position and self.position_controlled
        difference = axis.controller.control_difference if controlled else 0.0
        self.take_actual_values()
        if controlled:
            axis.controller.absorb(difference)

    def _start_from_actual_position(self, velocity: float, acceleration: float = 0.0) -> None:
        """Put the setpoint as far ahead of the actual position as `velocity` carries it during the delay."""
        axis = self._axis
        position = axis.feedback.position + velocity * axis.setpoint_delay_s
        # The interpolator is ahead by the rest of its cycle.
        ahead = 0.0 if axis.fine is None else axis.fine.begin_anew(position, velocity)
        self.gen.set_state(position + ahead, velocity, acceleration)
        if axis.has_position:
            axis.controller.reset(position, velocity)

    def _leave_target(self) -> None:
        """End the supervision of an end position that has not been reached for good yet: there is another
        motion (MON-027).
        """
        if self._settling:
            self._settling = False
            self._axis.monitoring.cancel()

    # -- setpoints from outside
    # -------------------------------------------------------------------------------

    def take_vector(self, job: Job, cycle_s: float) -> None:
        """Make what the user program has given the setpoint, without profile and limits (MC-473, MC-474)."""
        gen = self.gen
        velocity = job.velocity
        if job.mode == 1:
            controlled = bool(job.position_controlled)
            if controlled is not self.position_controlled and self._axis.has_position:
                self.set_position_control(controlled)
            gen.set_state(gen.s + velocity * cycle_s, velocity, job.acceleration)
        else:
            axis = self._axis
            position = job.target
            if axis.modulo.enabled:
                position = axis.modulo.target(position, gen.s - job.distance, 3)
            gen.set_state(position + job.distance, velocity, job.acceleration)
            axis.controller.given = True

    @property
    def motion_in_state(self) -> int:
        """`StatusMotionIn.FunctionState`: 0 none, 1 velocity, 2 position (MIN-011)."""
        job = self.job
        return job.mode if job is not None and job.job_class is _MOTION_IN else 0

    @property
    def given(self) -> bool:
        """Whether setpoints come from the user program, basic or superimposed ones."""
        job, moving = self.job, self.superimposed
        return (job is not None and job.job_class is _MOTION_IN) or (moving is not None and moving.given)

    @property
    def motion_in_exceeds(self) -> bool:
        """`StatusMotionIn.StatusWord.X0`: the given velocity is above the configured maximum (MIN-005)."""
        return self.motion_in_state != 0 and abs(self.gen.v) > self._max_velocity.value

    # -- superimposed motion --------------------------------------------------------------------------------

    def _basic_velocity(self) -> float:
        """Return the velocity to which the basic motion accelerates, with its sign."""
        job = self.job
        if job is None or self._axis.state is not AxisState.MOTION:
            return 0.0
        velocity = self._planned_velocity
        return copysign(velocity, job.target - self.gen.s) if job.positions else velocity

    def _sum_up(self) -> None:
        """Make the basic setpoint the sum, from where one ramp can brake all of it."""
        total, gen = self.total, self.gen
        if total is not gen:
            gen.set_state(total.s, total.v, total.a)
            self.total = gen

    def shift(self, offset: float) -> None:
        """Move the setpoint of the basic motion, and the target of its job, by `offset`, axis unit."""
        self.gen.shift(offset)
        job = self.job
        if job is not None and job.job_class is not _MOTION_IN:
            job.target += offset

    @property
    def superimposed_distance(self) -> float:
        """What superimposed motions have covered since the axis was last without motion, axis unit
        (MC-353).
        """
        moving = self.superimposed
        return self._superimposed_before + (moving.part.s if moving is not None else 0.0)

    @property
    def destination(self) -> float | None:
        """Where the motion ends by its own plan, axis unit; None if it has no target."""
        job, moving = self.job, self.superimposed
        if job is None:
            return None if moving is None else self.gen.s + moving.part.s + moving.remaining
        if not job.positions:
            return None
        return job.target + (0.0 if moving is None else moving.part.s + moving.remaining)
