"""The motion of an axis: which job is in control, what it makes of the setpoint, and when it ends."""

from __future__ import annotations

from typing import Final

from motion.kernel.superposition import Superposition
from motion.s7.axis.acceptance import JobAcceptance
from motion.s7.axis.jobs import (
    NO_ERROR,
    Job,
    JobClass,
)
from motion.s7.axis.state import AxisState

# Names of the module, because in every cycle an attribute of an enumeration would cost more than what is done
# with it.
_MOTION: Final = AxisState.MOTION
_STANDSTILL: Final = AxisState.STANDSTILL
_STOP_HOLD: Final = AxisState.STOP_HOLD
_ALARM_STANDSTILL: Final = AxisState.ALARM_STANDSTILL
_MOTION_IN: Final = JobClass.MOTION_IN
_SWITCHES_OFF: Final = (AxisState.ALARM_RAMP, AxisState.DISABLING_RAMP)
"""States after which the drive is switched off."""


class MotionControl(JobAcceptance):
    """What the jobs of an axis make of its setpoint, cycle by cycle, and when they end."""

    __slots__ = ()

    def replan(self) -> None:
        """Take changed values of the job in control over (jog inputs, shifted coordinates)."""
        job = self.job
        if job is None or self._axis.state is not AxisState.MOTION or job.job_class is _MOTION_IN:
            return
        self._leave_target()
        if job.positions:
            self._plan_position(job)
        else:
            self._plan_velocity(job)

    def travel(self, job: Job, velocity: float) -> None:
        """Let homing keep `velocity` from now on, axis unit per second, signed."""
        job.positions = False
        job.velocity = velocity
        self.replan()

    def travel_to(self, job: Job, target: float, velocity: float) -> None:
        """Let homing go to `target`, axis unit, where its job ends."""
        job.positions = True
        job.target = target
        job.velocity = velocity
        self.replan()

    def step(self, cycle_s: float) -> None:
        """Advance the setpoint by one cycle."""
        if self.limits_assigned:
            self.follow_limits()
        elif self._velocity_limited and self._axis.state is _MOTION and self.job is not None:
            self._repeat_warning()
        job = self.job
        gen = self.gen
        if job is not None and job.job_class is _MOTION_IN and self._axis.state is _MOTION:
            self.take_vector(job, cycle_s)
        else:
            gen.advance(cycle_s)
        if self.total is not gen and self.superimposed is not None:
            self.superimposed.advance(cycle_s)
            if self.superimposed.given:
                self._axis.controller.given = True
        elif not self.position_controlled and self._axis.has_position:
            gen.s = self._axis.feedback.position

    def finish_step(self) -> None:
        """End jobs and ramps whose setpoint has arrived; called after the monitoring of the cycle."""
        if not self._axis.facts.controlled:
            return  # the monitoring of this cycle has taken the axis out of control
        gen = self.gen
        moving = self.superimposed
        if moving is not None:
            if moving.ended:
                self._end_superimposed(moving)
            elif self.job is None:
                return
        job = self.job
        if job is not None and job.job_class is _MOTION_IN:
            return
        if not gen.done:
            if job is not None and job.in_velocity:
                job.set_in_velocity(False)
            return
        axis = self._axis
        state = axis.state
        if state is _STANDSTILL or state is _ALARM_STANDSTILL:
            return
        if state is _STOP_HOLD:
            if job is None or job.released:
                self.job = None
                self.severity = 0
                axis.set_state(AxisState.STANDSTILL)
            return
        if state is _MOTION and job is not None and not job.positions:
            if job.job_class is not JobClass.VELOCITY:
                return
            if job.released:
                self.job = None
                job.finish()
                self._next()
            else:
                job.set_in_velocity(True)
            return
        if gen.v != 0.0 or (state is AxisState.MOTION and self._planned_velocity == 0.0):
            return
        if state in _SWITCHES_OFF and axis.has_position and not self._arrived_behind_filter():
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

    def _arrived_behind_filter(self) -> bool:
        """Return whether the velocity that the drive is given has come to zero too, so that nothing is cut
        off.
        """
        axis = self._axis
        dynamic_filter = axis.controller.filter
        return dynamic_filter is None or abs(dynamic_filter.velocity) <= axis.rest_velocity

    def _settled(self) -> bool:
        """Return whether the end of the motion counts as reached (positioning monitoring, MON-016 to
        MON-022).
        """
        if not self.position_controlled or self.superimposed is not None:
            return True  # while something is superimposed the axis has not arrived anywhere yet
        axis = self._axis
        monitor = axis.monitoring
        if not self._settling:
            self._settling = True
            monitor.start_positioning()
        if not monitor.positioned():
            return False
        # With a torque limit an axis that is stopped creeps on to its setpoint: it has stopped when it stands
        # (STP-408).
        return monitor.standstill or not axis.torque.limits or axis.state is AxisState.MOTION

    def come_to_rest(self) -> None:
        """Go to standstill, held as long as `Execute` of the `MC_Stop` in control is TRUE (STP-415)."""
        job = self.job
        if job is not None and job.job_class is JobClass.STOP and not job.released:
            self._axis.set_state(AxisState.STOP_HOLD)
        else:
            self.job = None
            self.severity = 0
            self._axis.set_state(AxisState.STANDSTILL)

    def release(self, stop: Job) -> None:
        """End the lock of an `MC_Stop` that has stopped the axis; jobs that are called next are accepted
        (MC-407, STP-431).
        """
        if self.job is stop and self._axis.state is _STOP_HOLD:
            self.come_to_rest()

    def _next(self) -> None:
        self.severity = 0
        if self.queue:
            self._activate(self.queue.pop(0))
        elif self.superimposed is not None:
            self._axis.set_state(AxisState.MOTION)
        else:
            self._superimposed_before = 0.0
            self._axis.set_state(AxisState.STANDSTILL)

    def end_motion_in(self, job: Job, error_id: int = NO_ERROR) -> None:
        """End a job whose setpoints came from outside: they are zero at once, the position stays (MIN-026,
        MIN-040).
        """
        moving = self.superimposed
        if moving is not None and moving.job is job:
            moving.freeze()
            self._end_superimposed(moving, error_id)
            return
        self.gen.set_state(self.gen.s, 0.0)
        if moving is not None:
            moving.refresh()
        self.job = None
        if error_id:
            job.fail(error_id)
        else:
            job.finish()
        self._next()

    def _end_superimposed(self, moving: Superposition, error_id: int = NO_ERROR) -> None:
        """Move setpoint and target of the basic motion by what has been superimposed, which has ended by
        itself.
        """
        distance = moving.part.s
        self.total = self.gen
        self.superimposed = None
        self.shift(distance)
        self._superimposed_before += distance
        if self.job is not None and self.job.job_class is _MOTION_IN:
            self.job.distance += distance  # positions from outside go on to be counted from where they were
        if moving.job is not None and error_id:
            moving.job.fail(error_id)
        elif moving.job is not None:
            moving.job.finish()
        if self.job is None and self._axis.state is AxisState.MOTION:
            self._next()
