"""The motion of an axis: which job is in control, what it makes of the setpoint, and when it ends."""

from __future__ import annotations

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
from motion.axis.planning import SetpointPlanning
from motion.axis.state import ACCEPTS_MOTION, AxisState
from motion.axis.superposition import Superposition

if TYPE_CHECKING:
    from motion.axis.axis import TechnologyAxis

QUEUE_DEPTH: Final = 8
"""Waiting jobs per object (MC-265)."""

_MOTION: Final = AxisState.MOTION
_VELOCITY: Final = JobClass.VELOCITY
_STOP_SEVERITY: Final = {0: 3, 2: 2, 3: 1}
"""Severity of `MC_Stop` by its mode (STP-433 to STP-435)."""


def stop_severity(mode: int) -> int:
    """Return the severity 1..3 of an `MC_Stop` mode."""
    return _STOP_SEVERITY[mode]


class MotionControl(SetpointPlanning):
    """Job in control, waiting jobs and superimposed job of one axis, and the setpoint that they make."""

    __slots__ = ("queue",)

    def __init__(self, axis: TechnologyAxis) -> None:
        super().__init__(axis)
        self.queue: list[Job] = []

    # -- acceptance -----------------------------------------------------------------------------------------

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
        if self.stopping:
            return ERROR_LOCKED  # acknowledged before its end, the ramp still belongs to the stop (STP-415)
        refusal = axis.torque.refuses(job)
        if refusal:
            return refusal
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
        if self.superimposed is None or aborts(job.job_class, JobClass.SUPERIMPOSED, append=job.append):
            self.abort_all()
        else:
            self._abort_basic()
        self._activate(job)
        return NO_ERROR

    def submit_superimposed(self, job: Job) -> int:
        """Let `job` move the axis by its distance, or halt that, on top of what it does; or return an ErrorID (OVR-016)."""
        axis = self._axis
        state = axis.state
        if state is AxisState.RESTARTING:
            return ERROR_STATE
        if axis.alarms.blocking:
            return ERROR_ALARM
        if state not in ACCEPTS_MOTION or self.stopping:
            return ERROR_LOCKED
        job.start(axis.name, axis.history)
        moving = self.superimposed
        halt = job.instruction == "MC_HaltSuperimposed"
        if moving is None and halt:
            job.activate()
            job.finish()  # nothing to halt (MC-369)
            return NO_ERROR
        if moving is None:
            self.set_position_control(True)
            moving = self.superimposed = self.total = Superposition(
                self.gen,
                velocity_limit=lambda: min(self._max_velocity.value, self._limit_velocity.value),
                basic_velocity=self._basic_velocity,
            )
        elif moving.job is not None:
            moving.job.abort()
        job.activate()
        if self._limits_are_zero():
            return NO_ERROR
        acceleration, deceleration, jerk = self._limits(job)
        if halt:
            moving.halt(job, deceleration, jerk)
        else:
            moving.move(job, acceleration, deceleration, jerk)
        if state is AxisState.STANDSTILL:
            self._settling = False
            axis.set_state(AxisState.MOTION)
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
        """End the job in control, the waiting ones and the superimposed one with `CommandAborted`."""
        if self.superimposed is not None:
            moved = self._merge()
            if moved is not None:
                moved.abort()
        self._abort_basic()

    def _abort_basic(self) -> None:
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
        if self.superimposed is not None:
            moved = self._merge()
            if moved is not None:
                moved.fail(error_id)
        job = self.job
        if job is not None and job.job_class is not JobClass.STOP:
            self.job = None
            job.fail(error_id)
        if self.queue:
            waiting, self.queue = self.queue, []
            for one in waiting:
                one.fail(error_id)

    # -- cycle ----------------------------------------------------------------------------------------------

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
            elif job.direction:
                job.target = axis.modulo.target(job.target, gen.s, job.direction)
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

    def step(self, cycle_s: float) -> None:
        """Advance the setpoint by one cycle."""
        job = self.job
        if (
            job is not None
            and self._axis.state is _MOTION
            and not (
                self._max_deceleration.value * self._max_acceleration.value <= 0.0 and self._limits_are_zero()
            )
        ):
            cls = job.job_class
            if cls is _VELOCITY:
                if not job.released and self._effective_velocity(job) != self._planned_velocity:
                    job.set_in_velocity(False)
                    self._plan_velocity(job)
            elif not self._settling and self._effective_velocity(job) != self._planned_velocity:
                self._plan_position(job)
        gen = self.gen
        gen.advance(cycle_s)
        if self.total is not gen and self.superimposed is not None:
            self.superimposed.advance(cycle_s)
        elif not self.position_controlled and self._axis.has_position:
            gen.s = self._axis.feedback.position

    def finish_step(self) -> None:
        """End jobs and ramps whose setpoint has arrived; called after the monitoring of the cycle."""
        gen = self.gen
        moving = self.superimposed
        if moving is not None:
            if moving.ended:
                self._end_superimposed(moving)
            elif self.job is None:
                return
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
        if not self.position_controlled or self.superimposed is not None:
            return True  # while something is superimposed the axis has not arrived anywhere yet
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
        elif self.superimposed is not None:
            self._axis.set_state(AxisState.MOTION)
        else:
            self._superimposed_before = 0.0
            self._axis.set_state(AxisState.STANDSTILL)

    def _merge(self) -> Job | None:
        """End the superimposed motion by making it part of the basic one; returns its job."""
        self._sum_up()
        moving, self.superimposed = self.superimposed, None
        self._superimposed_before = 0.0
        return None if moving is None else moving.job

    def _end_superimposed(self, moving: Superposition) -> None:
        """Move setpoint and target of the basic motion by what has been superimposed, which has ended by itself."""
        distance = moving.part.s
        self.total = self.gen
        self.superimposed = None
        self.shift(distance)
        self._superimposed_before += distance
        if moving.job is not None:
            moving.job.finish()
        if self.job is None and self._axis.state is AxisState.MOTION:
            self._next()

    @property
    def moving_job(self) -> JobClass | None:
        """Class of the job in control, None without one."""
        job = self.job
        return job.job_class if job is not None and job.state is JobState.ACTIVE else None
