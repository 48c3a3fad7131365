"""Reactions to technology alarms: which one takes effect, and against what (sections 8.7 to 8.12 and 10).

Nothing but this module and `MC_Power` / `MC_Stop` / `MC_Halt` stops an axis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from motion.s7.axis.jobs import JobClass
from motion.s7.axis.state import AxisState

if TYPE_CHECKING:
    from motion.kernel.cell import Cell
    from motion.s7.axis.alarms import AxisAlarms
    from motion.s7.axis.enabling import EnableControl
    from motion.s7.axis.motion import MotionControl
    from motion.s7.axis.state import AxisStates, DriveCommand


class Reactions:
    """What a new alarm does to an axis.

    Args:
        states: State of the axis.
        alarms: Its alarms.
        motion: Its jobs and ramps.
        enabling: Its handshake with the drive.
        command: Its control word.
        remove_enable: `Actor.RemoveEnableReaction`.

    """

    def __init__(
        self,
        *,
        states: AxisStates,
        alarms: AxisAlarms,
        motion: MotionControl,
        enabling: EnableControl,
        command: DriveCommand,
        remove_enable: Cell[int],
    ) -> None:
        self._states = states
        self._alarms = alarms
        self._motion = motion
        self._enabling = enabling
        self._command = command
        self._reaction = remove_enable

    def react(self, reaction: int) -> None:
        """Apply the reaction of a new alarm to the present state (matrix of section 10)."""
        states = self._states
        state = states.state
        motion = self._motion
        if state in (AxisState.DISABLED, AxisState.ALARM_DISABLED, AxisState.RESTARTING):
            motion.fail_all()
            if state is AxisState.DISABLED:
                states.enter(AxisState.ALARM_DISABLED)
            return
        if reaction == 4:
            self._remove_enable(state)
        elif reaction == 5:
            self._track(state)
        elif reaction in (1, 2, 3):
            self._stop(state, reaction)

    def _abort_stop_job(self) -> None:
        motion = self._motion
        job = motion.job
        if job is not None and job.job_class is JobClass.STOP:
            motion.job = None
            job.abort()  # CommandAborted, not Error 16#8001 (STP-437)

    def _remove_enable(self, state: AxisState) -> None:
        self._motion.fail_all()
        self._abort_stop_job()
        if state is AxisState.DISABLING_COAST or state is AxisState.ALARM_DRIVE_STOP:
            return
        if state is AxisState.DISABLING_QUICK and self._reaction.value != 3:
            self._enabling.withdraw_further()  # a running OFF3 is not weakened (STP-526)
            return
        self._enabling.remove_enable()

    def _track(self, state: AxisState) -> None:
        self._motion.fail_all()
        self._abort_stop_job()
        if state is AxisState.ALARM_DRIVE_STOP or self._enabling.disabling:
            return
        if self._command.enable:
            self._states.enter(AxisState.TRACKING)
        else:
            # The ramp of a disabling was in progress: its end is not given up (STP-396).
            self._enabling.quick_stop()

    def _stop(self, state: AxisState, reaction: int) -> None:
        states = self._states
        motion = self._motion
        if state in (AxisState.STOPPING, AxisState.STOP_HOLD):
            motion.fail_all()
            if state is AxisState.STOP_HOLD:
                if self._alarms.disabling:
                    self._abort_stop_job()
                    motion.severity = reaction
                states.enter(AxisState.ALARM_RAMP)
                motion.alarm_ramp_ended()
            elif reaction > motion.severity:
                self._abort_stop_job()
                motion.begin_reaction(reaction)
                states.enter(AxisState.ALARM_RAMP)
            return
        if state is AxisState.ALARM_RAMP:
            if reaction > motion.severity and not self._command.switching_off:
                self._abort_stop_job()
                motion.begin_reaction(reaction)
            return
        if state is AxisState.ALARM_STANDSTILL:
            if self._alarms.disabling:
                states.enter(AxisState.ALARM_RAMP)
                motion.alarm_ramp_ended()
            return
        if state is AxisState.DISABLING_RAMP:
            if reaction > motion.severity and not self._command.switching_off:
                motion.begin_reaction(reaction)
                states.enter(AxisState.ALARM_RAMP)
            return
        if state is AxisState.ENABLING:
            self._enabling.remove_enable()
            return
        if state in (AxisState.STANDSTILL, AxisState.MOTION, AxisState.HALTING, AxisState.ENABLE_RAMP):
            # The ramp takes the dynamics of the running job before that job ends with its error.
            motion.begin_reaction(reaction)
            motion.fail_all()
            states.enter(AxisState.ALARM_RAMP)
