"""Technology alarms of an axis: which reaction takes effect, and against what (sections 8.7 to 8.12 and 10).

Nothing but this module and `MC_Power` / `MC_Stop` / `MC_Halt` stops an axis.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.s7.alarms import AlarmEngine, PendingAlarm
from motion.s7.axis.jobs import JobClass
from motion.s7.axis.state import AxisState

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

ALARM_ADDRESS: Final = 401
INPUT_ADDRESS: Final = 2
"""Cause of 401, as the catalogue numbers them (TA-013)."""


class AxisAlarms:
    """The alarms of one axis and their effect on it.

    `blocking`, `disabling` and `stop_severity` are kept up to date, so that the cycle reads plain attributes.
    """

    __slots__ = ("_axis", "_warned", "blocking", "disabling", "engine", "stop_severity")

    def __init__(self, axis: TechnologyAxis) -> None:
        self._axis = axis
        self.engine = AlarmEngine(
            axis.name, object_type=axis.object_type, history=axis.history, on_alarm=self._on_alarm
        )
        self.blocking = False
        """An alarm with a reaction is pending: motion jobs are refused (MC-123)."""
        self.disabling = False
        """A pending alarm disables the axis at the end of its ramp."""
        self.stop_severity = 0
        """Highest reaction 1..4 that is pending, 0 for none."""
        self._warned: set[int] = set()

    def refresh(self) -> None:
        """Derive the summary flags from the pending alarms."""
        blocking = disabling = False
        severity = 0
        for entry in self.engine.pending:
            reaction = entry.reaction
            if reaction == 0:
                continue
            blocking = True
            severity = max(severity, min(reaction, 4))
            if not entry.stays_enabled:
                disabling = True
        self.blocking = blocking
        self.disabling = disabling
        self.stop_severity = severity

    def raise_alarm(
        self,
        number: int,
        *,
        reaction: int | None = None,
        info: int = 0,
        text: str = "",
        restart: bool | None = None,
    ) -> None:
        """Raise alarm `number`; `reaction` and `restart` for those of which they depend on configuration or
        cause.
        """
        self.engine.raise_alarm(number, reaction=reaction, info=info, text=text, restart=restart)

    def set_cause(
        self, number: int, active: bool, *, reaction: int | None = None, info: int = 0, text: str = ""
    ) -> None:
        """Say whether the cause of alarm `number` is present; while it is, acknowledging does not help."""
        self.engine.set_cause(number, active, reaction=reaction, info=info, text=text)

    def warn(self, number: int, info: int = 0) -> None:
        """Raise a warning once until it is acknowledged; cheap to call every cycle."""
        if number not in self._warned:
            self._warned.add(number)
            self.engine.raise_alarm(number, info=info)

    def watch_inputs(self, readable: bool) -> None:
        """Raise 401 while the switches of an axis in operation cannot be read; a lost drive has an alarm of
        its own (TA-020).
        """
        axis, engine = self._axis, self.engine
        held = engine.cause_active(ALARM_ADDRESS)
        if held or not readable:
            expected = axis.facts.drive_expected and axis.port.link_ok
            engine.set_cause(ALARM_ADDRESS, not readable and (held or expected), info=INPUT_ADDRESS)

    def acknowledge(self) -> None:
        """Clear what can be cleared (`MC_Reset`); causes still present raise their alarm again at once
        (STP-072).

        So there is no cycle in which the words of the object know nothing of a fault that lasts.
        """
        self._warned.clear()
        self.engine.acknowledge()
        self.engine.update()
        self.refresh()

    def restart(self) -> None:
        """Clear everything whose cause is gone, fatal alarms included."""
        self._warned.clear()
        self.engine.restart()
        self.refresh()

    def power_down(self) -> None:
        """Forget all alarms and their causes."""
        self._warned.clear()
        self.engine.power_down()
        self.refresh()

    def _on_alarm(self, entry: PendingAlarm) -> None:
        self.refresh()
        if entry.reaction:
            self.react(entry.number, entry.reaction)

    def react(self, number: int, reaction: int) -> None:  # noqa: ARG002 - the number is the hook of later exceptions
        """Apply the reaction of a new alarm to the present state (matrix of section 10)."""
        axis = self._axis
        state = axis.state
        motion = axis.motion
        if state in (AxisState.DISABLED, AxisState.ALARM_DISABLED, AxisState.RESTARTING):
            motion.fail_all()
            if state is AxisState.DISABLED:
                axis.set_state(AxisState.ALARM_DISABLED)
            return
        if reaction == 4:
            self._remove_enable(state)
        elif reaction == 5:
            self._track(state)
        elif reaction in (1, 2, 3):
            self._stop(state, reaction)

    def _abort_stop_job(self) -> None:
        motion = self._axis.motion
        job = motion.job
        if job is not None and job.job_class is JobClass.STOP:
            motion.job = None
            job.abort()  # CommandAborted, not Error 16#8001 (STP-437)

    def _remove_enable(self, state: AxisState) -> None:
        axis = self._axis
        axis.motion.fail_all()
        self._abort_stop_job()
        if state is AxisState.DISABLING_COAST or state is AxisState.ALARM_DRIVE_STOP:
            return
        if state is AxisState.DISABLING_QUICK and axis.variables.read("Actor.RemoveEnableReaction") != 3:
            axis.enabling.withdraw_further()  # a running OFF3 is not weakened (STP-526)
            return
        axis.enabling.remove_enable()

    def _track(self, state: AxisState) -> None:
        axis = self._axis
        axis.motion.fail_all()
        self._abort_stop_job()
        if state is AxisState.ALARM_DRIVE_STOP or axis.enabling.disabling:
            return
        if axis.enabling.enable:
            axis.set_state(AxisState.TRACKING)
        else:
            # The ramp of a disabling was in progress: its end is not given up (STP-396).
            axis.enabling.quick_stop()

    def _stop(self, state: AxisState, reaction: int) -> None:
        axis = self._axis
        motion = axis.motion
        if state in (AxisState.STOPPING, AxisState.STOP_HOLD):
            motion.fail_all()
            if state is AxisState.STOP_HOLD:
                if self.disabling:
                    self._abort_stop_job()
                    motion.severity = reaction
                axis.set_state(AxisState.ALARM_RAMP)
                axis.enabling.alarm_ramp_ended()
            elif reaction > motion.severity:
                self._abort_stop_job()
                motion.begin_reaction(reaction)
                axis.set_state(AxisState.ALARM_RAMP)
            return
        if state is AxisState.ALARM_RAMP:
            if reaction > motion.severity and not axis.enabling.switching_off:
                self._abort_stop_job()
                motion.begin_reaction(reaction)
            return
        if state is AxisState.ALARM_STANDSTILL:
            if self.disabling:
                axis.set_state(AxisState.ALARM_RAMP)
                axis.enabling.alarm_ramp_ended()
            return
        if state is AxisState.DISABLING_RAMP:
            if reaction > motion.severity and not axis.enabling.switching_off:
                motion.begin_reaction(reaction)
                axis.set_state(AxisState.ALARM_RAMP)
            return
        if state is AxisState.ENABLING:
            axis.enabling.remove_enable()
            return
        if state in (AxisState.STANDSTILL, AxisState.MOTION, AxisState.HALTING, AxisState.ENABLE_RAMP):
            # The ramp takes the dynamics of the running job before that job ends with its error.
            motion.begin_reaction(reaction)
            motion.fail_all()
            axis.set_state(AxisState.ALARM_RAMP)
