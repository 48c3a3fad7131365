"""Which jobs an axis takes, and which they end (override tables, MC-265, STP-433 to STP-444)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.kernel.superposition import Superposition
from motion.s7.axis.homing import abort_passive
from motion.s7.axis.jobs import (
    ERROR_ALARM,
    ERROR_JOB_MEMORY,
    ERROR_LOCKED,
    ERROR_NOT_CONTROLLED,
    ERROR_STATE,
    NO_ERROR,
    Job,
    JobClass,
    JobState,
)
from motion.s7.axis.override import aborts
from motion.s7.axis.planning import SetpointPlanning
from motion.s7.axis.state import ACCEPTS_MOTION, AxisState

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

QUEUE_DEPTH: Final = 8
"""Waiting jobs per object (MC-265)."""

_MOTION_IN: Final = JobClass.MOTION_IN
_STOP_SEVERITY: Final = {0: 3, 2: 2, 3: 1}
"""Severity of `MC_Stop` by its mode (STP-433 to STP-435)."""


class JobAcceptance(SetpointPlanning):
    """Job in control, waiting jobs and superimposed job of one axis."""

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
            # MC_Halt Mode 1 on top of MC_Halt Mode 0: without superimposed motion both end at the same zero
            # (OVR-089).
            self.queue.append(job)
            return NO_ERROR
        if axis.homings and aborts(job.job_class, JobClass.PASSIVE_HOMING):
            abort_passive(axis)
        if self.superimposed is None or aborts(job.job_class, JobClass.SUPERIMPOSED, append=job.append):
            self.abort_all()
        else:
            self._abort_basic()
        self._activate(job)
        return NO_ERROR

    def submit_superimposed(self, job: Job) -> int:
        """Let `job` move the axis by its distance, or halt that, on top of what it does; or return an ErrorID
        (OVR-016).
        """
        axis = self._axis
        state = axis.state
        if state is AxisState.RESTARTING:
            return ERROR_STATE
        if axis.alarms.blocking:
            return ERROR_ALARM
        if state not in ACCEPTS_MOTION or self.stopping:
            return ERROR_LOCKED
        given = job.instruction == "MC_MotionInSuperimposed"
        if given and not self.position_controlled:
            return ERROR_NOT_CONTROLLED
        if self.moving_job is JobClass.HOMING:
            return ERROR_STATE  # active homing is no basic motion for it (OVR-095)
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
                velocity_limit=self.velocity_limit,
                basic_velocity=self._basic_velocity,
            )
        elif moving.job is not None:
            moving.job.abort()
        job.activate()
        if given:
            moving.give(job)
        elif self._limits_are_zero():
            return NO_ERROR
        else:
            acceleration, deceleration, jerk = self._limits(job)
            if halt:
                moving.halt(job, deceleration, jerk)
            else:
                moving.move(job, acceleration, deceleration, jerk)
        if state is AxisState.STANDSTILL:
            self._leave_target()
            axis.set_state(AxisState.MOTION)
        return NO_ERROR

    def submit_stop(self, job: Job) -> int:
        """Take an `MC_Stop` job over, end it with `CommandAborted`, or return the ErrorID of its
        rejection.
        """
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
            AxisState.DISABLING_RAMP,
            AxisState.DISABLING_QUICK,
            AxisState.DISABLING_COAST,
        ):
            return ERROR_LOCKED
        job.start(axis.name, axis.history)
        acknowledged = state is AxisState.ALARM_RAMP and not (
            axis.alarms.blocking or axis.enabling.will_disable
        )
        if state in (AxisState.ALARM_RAMP, AxisState.ALARM_STANDSTILL) and not acknowledged:
            # Harder than the alarm; of two stops the later one may be equal (STP-423, STP-441).
            least = max(axis.alarms.stop_severity, self.severity - 1 if self.stopping else self.severity)
            if severity <= least or axis.enabling.switching_off:
                job.abort()
                return NO_ERROR
            self._take_stop(job, severity)
            if state is AxisState.ALARM_STANDSTILL:
                axis.set_state(AxisState.ALARM_RAMP)
            return NO_ERROR
        if self.stopping and severity < self.severity:
            job.abort()  # only the same or a higher stop takes over (STP-423)
            return NO_ERROR
        if axis.homings:
            abort_passive(axis)
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

    def _activate(self, job: Job) -> None:
        axis = self._axis
        gen = self.gen
        self.job = job
        self.severity = 0
        self._leave_target()
        self.control_position_of(job)
        job.activate()
        cls = job.job_class
        if cls is _MOTION_IN:
            job.distance = 0.0
            self._velocity_limited = False
            axis.set_state(AxisState.MOTION)
            return
        if self._limits_are_zero():
            return
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
        elif cls is JobClass.HOMING:
            axis.set_state(AxisState.MOTION)
            if job.begin is not None:
                job.begin()
        else:
            _, deceleration, jerk = self._plan_limits(job)
            gen.start_stop(deceleration, jerk, abort_acceleration=job.abort_acceleration)
            axis.set_state(AxisState.HALTING)

    def control_position_of(self, job: Job) -> None:
        """Switch position control as `job` wants it; what is superimposed ends where there is none (MC-098 to
        MC-103).
        """
        controlled = job.position_controlled
        if controlled is None or controlled is self.position_controlled or not self._axis.has_position:
            return
        if not controlled and self.superimposed is not None:
            moved = self._merge()
            if moved is not None:
                moved.abort()
        self.set_position_control(controlled)

    def _merge(self) -> Job | None:
        """End the superimposed motion by making it part of the basic one; returns its job."""
        self._sum_up()
        moving, self.superimposed = self.superimposed, None
        self._superimposed_before = 0.0
        return None if moving is None else moving.job

    @property
    def moving_job(self) -> JobClass | None:
        """Class of the job in control, None without one."""
        job = self.job
        return job.job_class if job is not None and job.state is JobState.ACTIVE else None
