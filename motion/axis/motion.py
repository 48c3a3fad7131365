"""The motion of an axis: which job is in control, what it makes of the setpoint, and when it ends."""

from __future__ import annotations

from math import copysign, sqrt
from typing import TYPE_CHECKING, Final

from motion.axis.jobs import (
    ERROR_ALARM,
    ERROR_JOB_MEMORY,
    ERROR_LOCKED,
    ERROR_STATE,
    NO_ERROR,
    Job,
    JobClass,
    JobState,
)
from motion.axis.override import aborts
from motion.axis.state import ACCEPTS_MOTION, AxisState
from motion.setpoint import SetpointGenerator, resolve

if TYPE_CHECKING:
    from motion.axis.axis import TechnologyAxis

QUEUE_DEPTH: Final = 8
"""Waiting jobs per object (MC-265)."""

_STOP_SEVERITY: Final = {0: 3, 2: 2, 3: 1}
"""Severity of `MC_Stop` by its mode (STP-433 to STP-435)."""

ALARM_VELOCITY_LIMITED: Final = 501
ALARM_ACCELERATION_LIMITED: Final = 502
ALARM_JERK_LIMITED: Final = 503
ALARM_ZERO_VELOCITY: Final = 304
ALARM_ZERO_ACCELERATION: Final = 305
ALARM_ZERO_JERK: Final = 306

_LAST_RESORT: Final = 1.0e6
"""Deceleration of a stop for which every configured value is zero."""


def stop_severity(mode: int) -> int:
    """Return the severity 1..3 of an `MC_Stop` mode."""
    return _STOP_SEVERITY[mode]


class MotionControl:
    """Setpoint generator, job in control and waiting jobs of one axis."""

    __slots__ = ("_axis", "_cells", "_emergency", "_limit_velocity", "_max_acceleration", "_max_deceleration",
                 "_max_jerk", "_max_velocity", "_override", "_planned_velocity", "_settling", "gen", "job",
                 "position_controlled", "queue", "severity")  # fmt: skip

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
        self.job: Job | None = None
        """Job in control, `MC_Stop` included."""
        self.queue: list[Job] = []
        self.position_controlled = False
        self.severity = 0
        """Severity of the stop ramp in progress: 0 none, 1 current, 2 maximum, 3 emergency (STP-432 to STP-435)."""
        self._planned_velocity = 0.0
        self._settling = False

    # -- acceptance -------------------------------------------------------------------------------------------

    def submit(self, job: Job) -> int:
        """Take `job` over, or return the ErrorID of its rejection (running jobs are then untouched)."""
        axis = self._axis
        state = axis.state
        if state is AxisState.RESTARTING:
            return ERROR_STATE
        if axis.alarms.blocking:
            return ERROR_ALARM
        if state not in ACCEPTS_MOTION and state is not AxisState.ALARM_RAMP:
            return ERROR_LOCKED
        if state is AxisState.ALARM_RAMP and axis.enabling.will_disable:
            return ERROR_LOCKED  # the ramp ends with the drive switched off (STP-396)
        active = self.job
        if active is not None and active.job_class is JobClass.STOP:
            return ERROR_LOCKED  # acknowledged before its end, the ramp still belongs to the stop (STP-415)
        if job.append and active is not None:
            if len(self.queue) >= QUEUE_DEPTH:
                return ERROR_JOB_MEMORY
            job.start(axis.name, axis.history)
            self.queue.append(job)
            return NO_ERROR
        job.start(axis.name, axis.history)
        if active is not None and not aborts(job.job_class, active.job_class):
            # MC_Halt Mode 1 on top of MC_Halt Mode 0: without superimposed motion both end at the same zero (OVR-089).
            self.queue.append(job)
            return NO_ERROR
        self.abort_all()
        self._activate(job)
        return NO_ERROR

    def submit_stop(self, job: Job) -> int:
        """Take an `MC_Stop` job over, end it with `CommandAborted`, or return the ErrorID of its rejection."""
        axis = self._axis
        state = axis.state
        severity = _STOP_SEVERITY[job.mode]
        if state is AxisState.RESTARTING:
            return ERROR_STATE
        if state in (AxisState.ALARM_DRIVE_STOP, AxisState.ALARM_DISABLED, AxisState.TRACKING):
            # A stronger alarm reaction turns the stop away without an error (STP-437, STP-444).
            job.start(axis.name, axis.history)
            job.abort()
            return NO_ERROR
        if not axis.facts.enabled or state in (
            AxisState.DISABLING_RAMP, AxisState.DISABLING_QUICK, AxisState.DISABLING_COAST,
        ):  # fmt: skip
            return ERROR_LOCKED
        job.start(axis.name, axis.history)
        if state in (AxisState.ALARM_RAMP, AxisState.ALARM_STANDSTILL):
            if severity <= max(self.severity, axis.alarms.stop_severity) or axis.enabling.switching_off:
                job.abort()
                return NO_ERROR
            self._take_stop(job, severity)
            if state is AxisState.ALARM_STANDSTILL:
                axis.set_state(AxisState.ALARM_RAMP)
            return NO_ERROR
        if state in (AxisState.STOPPING, AxisState.STOP_HOLD) and severity < self.severity:
            job.abort()  # only the same or a higher stop takes over (STP-423)
            return NO_ERROR
        self.abort_all()
        self._take_stop(job, severity)
        axis.set_state(AxisState.STOPPING)
        return NO_ERROR

    def _take_stop(self, job: Job, severity: int) -> None:
        self.abort_all()
        self.job = job
        job.activate()
        if severity == 1:
            self.begin_stop(1, job.deceleration, job.jerk, abort_acceleration=job.abort_acceleration)
        else:
            self.begin_reaction(severity, abort_acceleration=job.abort_acceleration)

    def abort_all(self) -> None:
        """End the job in control and the waiting ones with `CommandAborted`."""
        job = self.job
        if job is not None:
            self.job = None
            job.abort()
        if self.queue:
            waiting, self.queue = self.queue, []
            for one in waiting:
                one.abort()

    def fail_all(self, error_id: int = ERROR_ALARM) -> None:
        """End motion jobs with an error because of an alarm; a stop job is left to the caller (STP-252)."""
        job = self.job
        if job is not None and job.job_class is not JobClass.STOP:
            self.job = None
            job.fail(error_id)
        if self.queue:
            waiting, self.queue = self.queue, []
            for one in waiting:
                one.fail(error_id)

    # -- planning ---------------------------------------------------------------------------------------------

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

    def _activate(self, job: Job) -> None:
        axis = self._axis
        gen = self.gen
        self.job = job
        self.severity = 0
        self._settling = False
        if job.position_controlled is not None and axis.has_position:
            self.set_position_control(job.position_controlled)
        job.activate()
        if self._limits_are_zero():
            return
        cls = job.job_class
        if cls is JobClass.POSITIONING:
            if job.relative:
                job.target = gen.s + job.distance
            self._plan_position(job)
            axis.set_state(AxisState.MOTION)
        elif cls is JobClass.VELOCITY:
            if job.current:
                override = self._override.value
                job.velocity = gen.v / (override * 0.01) if override > 0.0 else 0.0
            self._plan_velocity(job)
            axis.set_state(AxisState.MOTION)
        else:
            _, deceleration, jerk = self._limits(job)
            self._bound_acceleration(jerk)
            gen.start_stop(deceleration, jerk, abort_acceleration=job.abort_acceleration)
            axis.set_state(AxisState.HALTING)

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

    def replan(self) -> None:
        """Take changed values of the job in control over (jog inputs, shifted coordinates)."""
        job = self.job
        if job is None or self._axis.state is not AxisState.MOTION:
            return
        self._settling = False
        if job.job_class is JobClass.VELOCITY:
            self._plan_velocity(job)
        elif job.job_class is JobClass.POSITIONING:
            self._plan_position(job)

    def set_position_control(self, on: bool) -> None:
        """Close or open position control without a step of the speed setpoint."""
        if on and not self.position_controlled:
            self._start_from_actual_position(self.gen.v, self.gen.a)
        self.position_controlled = on

    # -- stops ------------------------------------------------------------------------------------------------

    def begin_stop(
        self, severity: int, deceleration: float, jerk: float, *, abort_acceleration: bool = False
    ) -> None:
        """Start a braking ramp from the setpoints with values that are limited by the dynamic limits."""
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
        self._start_from_actual_position(self._axis.actual_velocity)

    def _start_from_actual_position(self, velocity: float, acceleration: float = 0.0) -> None:
        """Put the setpoint as far ahead of the actual position as `velocity` carries it during the delay."""
        axis = self._axis
        position = axis.feedback.position + velocity * axis.setpoint_delay_s
        self.gen.set_state(position, velocity, acceleration)
        if axis.has_position:
            axis.controller.reset(position, velocity)

    # -- cycle ------------------------------------------------------------------------------------------------

    def step(self, cycle_s: float) -> None:
        """Advance the setpoint by one cycle."""
        job = self.job
        if (
            job is not None
            and self._axis.state is AxisState.MOTION
            and not (
                self._max_deceleration.value * self._max_acceleration.value <= 0.0 and self._limits_are_zero()
            )
        ):
            cls = job.job_class
            if cls is JobClass.VELOCITY:
                if not job.released and self._effective_velocity(job) != self._planned_velocity:
                    job.set_in_velocity(False)
                    self._plan_velocity(job)
            elif not self._settling and self._effective_velocity(job) != self._planned_velocity:
                self._plan_position(job)
        gen = self.gen
        gen.advance(cycle_s)
        if not self.position_controlled and self._axis.has_position:
            gen.s = self._axis.feedback.position

    def finish_step(self) -> None:
        """End jobs and ramps whose setpoint has arrived; called after the monitoring of the cycle."""
        gen = self.gen
        if not gen.done:
            job = self.job
            if job is not None and job.in_velocity:
                job.set_in_velocity(False)
            return
        axis = self._axis
        state = axis.state
        job = self.job
        if state in (AxisState.STANDSTILL, AxisState.STOP_HOLD, AxisState.ALARM_STANDSTILL):
            if state is AxisState.STOP_HOLD and (job is None or job.released):
                self.job = None
                self.severity = 0
                axis.set_state(AxisState.STANDSTILL)
            return
        if state is AxisState.MOTION and job is not None and job.job_class is JobClass.VELOCITY:
            if job.released:
                self.job = None
                job.finish()
                self._next()
            else:
                job.set_in_velocity(True)
            return
        if gen.v != 0.0 or (state is AxisState.MOTION and self._planned_velocity == 0.0):
            return
        if state is AxisState.ALARM_RAMP:
            if job is not None and job.job_class is JobClass.STOP:
                job.finish()
            axis.enabling.alarm_ramp_ended()
            return
        if state is AxisState.DISABLING_RAMP:
            axis.enabling.switch_off()
            return
        if state is AxisState.ENABLE_RAMP:
            self.severity = 0
            axis.set_state(AxisState.STANDSTILL)
            return
        if not self._settled():
            return
        if job is not None:
            job.finish()
        if state is AxisState.STOPPING:
            if axis.alarms.disabling:
                axis.set_state(AxisState.ALARM_RAMP)
            axis.enabling.alarm_ramp_ended()
            return
        self.job = None
        for waiting in [one for one in self.queue if one.job_class is JobClass.HALT_BASIC]:
            self.queue.remove(waiting)
            waiting.finish()
        self._next()

    def _settled(self) -> bool:
        """Return whether the end of the motion counts as reached (positioning monitoring, MON-016 to MON-022)."""
        if not self.position_controlled:
            return True
        monitor = self._axis.monitoring
        if not self._settling:
            self._settling = True
            monitor.start_positioning()
        return monitor.positioned()

    def come_to_rest(self) -> None:
        """Go to standstill, held as long as `Execute` of the `MC_Stop` in control is TRUE (STP-415)."""
        job = self.job
        if job is not None and job.job_class is JobClass.STOP and not job.released:
            self._axis.set_state(AxisState.STOP_HOLD)
        else:
            self.job = None
            self.severity = 0
            self._axis.set_state(AxisState.STANDSTILL)

    def _next(self) -> None:
        self.severity = 0
        if self.queue:
            self._activate(self.queue.pop(0))
        else:
            self._axis.set_state(AxisState.STANDSTILL)

    @property
    def moving_job(self) -> JobClass | None:
        """Class of the job in control, None without one."""
        job = self.job
        return job.job_class if job is not None and job.state is JobState.ACTIVE else None
