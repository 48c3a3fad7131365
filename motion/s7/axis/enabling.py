"""Enabling and disabling: the handshake with the drive and the drive's own stops (STP-037 to STP-046, section
8).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.drives.port import (
    STW1,
    STW1_ALL_OFF,
    STW1_IDLE,
    STW1_OFF2_OFF1,
    STW1_OFF3,
    STW1_OFF3_OFF1,
    STW1_OPERATE,
    ZSW1,
)
from motion.s7.axis.state import DISABLING, DRIVE_EXPECTED_ON, AxisState

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

ALARM_DRIVE: Final = 421
ALARM_ENCODER: Final = 411
ALARM_COMMUNICATION: Final = 431
ALARM_AUTONOMOUS: Final = 550
ALARM_DRIVE_NOT_READY: Final = 106
ALARM_ENCODER_NOT_READY: Final = 108
NOT_INITIALISED: Final = 2
"""Cause of both: the device was not there yet at start-up."""

_SHUT_DOWN: Final = 3
"""Cause of alarm 421: the drive has left operation by itself, without a fault (STP-608)."""
_NOT_ENABLED: Final = 4
"""Cause of alarm 421: the drive cannot be enabled (STP-043)."""
_ENCODER_CAUSES: Final = {0x0002: 5, 0x0003: 6, 0x0008: 4, 0x000A: 4}
"""Cause of alarm 411 by the code in G1_XIST2, as the catalogue numbers them (TA-013); any other is the first.
"""

_REMOVE_ENABLE: Final = {1: STW1_IDLE, 3: STW1_OFF2_OFF1, 5: STW1_OFF3_OFF1, 7: STW1_OFF3}
"""Control word at the alarm by `Actor.RemoveEnableReaction` (STP-363 to STP-366)."""

# Names of the module, because in every cycle an attribute of an enumeration would cost more than what is done
# with it.
_REQUESTED: Final = int(ZSW1.CONTROL_REQUESTED)
_FAULT: Final = int(ZSW1.FAULT)
_OPERATION: Final = int(ZSW1.OPERATION_ENABLED)
_MOTION: Final = AxisState.MOTION
_STANDSTILL: Final = AxisState.STANDSTILL
_ALARMED: Final = (AxisState.ALARM_DRIVE_STOP, AxisState.ALARM_DISABLED, AxisState.TRACKING)
_HEALTH_MASK: Final = _REQUESTED | _FAULT | _OPERATION | int(ZSW1.NO_OFF3)
_HEALTHY: Final = _HEALTH_MASK & ~_FAULT
_DRIVE_OFF_MASK: Final = ZSW1.READY | ZSW1.OPERATION_ENABLED
_AUTONOMOUS_MASK: Final = ZSW1.READY_TO_SWITCH_ON | ZSW1.READY | ZSW1.OPERATION_ENABLED | ZSW1.NO_OFF3
_OPERATES_MASK: Final = ZSW1.OPERATION_ENABLED | ZSW1.NO_OFF3


class EnableControl:
    """Owns control word 1 and every transition that waits for the drive."""

    __slots__ = (
        "_axis",
        "_cause_411",
        "_cause_421",
        "_cause_431",
        "_disable_pending",
        "_idle",
        "_joined",
        "_phase",
        "_reaction",
        "_start_mode",
        "_told",
        "_velocity_mode",
        "acknowledge_drive",
        "enable",
        "start_mode",
        "stw1",
        "switching_off",
        "timeout_s",
    )

    def __init__(self, axis: TechnologyAxis) -> None:
        self._axis = axis
        self.enable = False
        """Level of `MC_Power.Enable` as last called."""
        self.start_mode = 1
        """`MC_Power.StartMode` as last called; latched when the enable sequence starts."""
        self._start_mode = 1
        self.stw1 = STW1_IDLE
        self.switching_off = False
        """The ramp of the axis has ended and the drive is being switched off."""
        self.acknowledge_drive = False
        """Set STW1.7 in the next telegrams (`MC_Reset`)."""
        self._idle = STW1_IDLE
        self._joined = False
        """Drive and encoder have been there since the start of the controller, or it has been told that they
        were not.
        """
        self._phase = 0
        self.timeout_s: float | None = None
        """Longest time from the beginning of the enable sequence to operation, s, then alarm 421; None = no
        limit (STP-043).
        """
        self._disable_pending = False
        """`Enable` has fallen during the present ramp, which ends with the drive off even if it rises again.
        """
        self._told = ""
        """What the enabling waits for, as the history knows it."""
        self._reaction = axis.variables.bind("Actor.RemoveEnableReaction")
        self._velocity_mode = (
            axis.variables.bind("PositionControl.VelocityModePowerOn") if axis.has_position else None
        )
        self._cause_431 = self._cause_421 = self._cause_411 = False

    def power_down(self) -> None:
        """Begin anew, as after power-on."""
        self.enable = self.switching_off = self.acknowledge_drive = self._disable_pending = self._joined = (
            False
        )
        self.start_mode = self._start_mode = 1
        self.stw1 = self._idle = STW1_IDLE
        self._phase = 0
        self._cause_431 = self._cause_421 = self._cause_411 = False

    def rest(self, *, outputs: bool) -> None:
        """Say whether a disabled axis sends its control word or, with process outputs off, zeros."""
        self.stw1 = STW1_IDLE if outputs else 0

    # -- what MC_Power sees
    # -----------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        """`MC_Power.Busy`: enabled, being enabled, or not yet switched off (STP-294, STP-295)."""
        return self.enable or self._axis.state not in (
            AxisState.DISABLED,
            AxisState.ALARM_DISABLED,
            AxisState.RESTARTING,
        )

    @property
    def enabled(self) -> bool:
        """`MC_Power.Status`."""
        return self._axis.facts.enabled

    @property
    def alarmed(self) -> bool:
        """Whether an alarm has disabled an axis, or is about to, that is to be enabled (MC-167)."""
        axis = self._axis
        return axis.alarms.blocking and self.enable and axis.state in _ALARMED

    def call(self, *, enable: bool, start_mode: int, stop_mode: int) -> None:
        """Take the inputs of `MC_Power` over."""
        self.start_mode = start_mode
        if enable is self.enable:
            return
        self.enable = enable
        if not enable:
            self._disable(stop_mode)

    def _disable(self, stop_mode: int) -> None:
        axis = self._axis
        state = axis.state
        motion = axis.motion
        if state is AxisState.ENABLING:
            self._rest(STW1_IDLE)
        elif state is AxisState.ALARM_RAMP and not axis.alarms.blocking:
            motion.abort_all()
            self._start_disabling(stop_mode)
        elif state is AxisState.ALARM_RAMP:
            # Quick stop and coast act at once; a ramp only when it brakes harder (STP-396).
            motion.abort_all()
            self._disable_pending = True
            if stop_mode in (1, 3) or {0: 3, 2: 2}[stop_mode] > motion.severity:
                self._start_disabling(stop_mode)
        elif state is AxisState.ALARM_DRIVE_STOP:
            if self._reaction.value != 7 and self.stw1 != STW1_OFF3:
                self.stw1 = STW1_OFF2_OFF1  # STP-384
        elif state is AxisState.TRACKING:
            self._start_disabling(stop_mode if stop_mode in (1, 3) else 1)
        elif state in DRIVE_EXPECTED_ON and state is not AxisState.DISABLING_RAMP:
            motion.abort_all()
            self._start_disabling(stop_mode)

    def _start_disabling(self, stop_mode: int) -> None:
        axis = self._axis
        self._phase = 0
        self.switching_off = False
        self._disable_pending = True
        if stop_mode == 1:
            self.stw1 = STW1_OFF3
            axis.set_state(AxisState.DISABLING_QUICK)
        elif stop_mode == 3:
            self.stw1 = STW1_OFF2_OFF1
            axis.set_state(AxisState.DISABLING_COAST)
        else:
            axis.motion.begin_reaction(3 if stop_mode == 0 else 2)
            axis.set_state(AxisState.DISABLING_RAMP)

    # -- reactions of alarms and ends of ramps
    # ----------------------------------------------------------------

    def remove_enable(self) -> None:
        """Reaction 4: the drive stops as `Actor.RemoveEnableReaction` says (STP-348)."""
        self.stw1 = _REMOVE_ENABLE.get(int(self._reaction.value), STW1_OFF3)
        self.switching_off = False
        self._axis.set_state(AxisState.ALARM_DRIVE_STOP)

    def withdraw_further(self) -> None:
        """Reaction 4 during a quick stop: take away what its pattern takes away too, and give nothing back
        (STP-526).
        """
        if self._phase == 0:
            self.stw1 &= _REMOVE_ENABLE.get(int(self._reaction.value), STW1_OFF3)

    def alarm_ramp_ended(self) -> None:
        """The setpoint of an alarm ramp is zero: switch off, or stay enabled where the alarm allows it."""
        axis = self._axis
        if axis.alarms.disabling or self.will_disable:
            # An Enable that fell during the ramp disables whatever the alarm allows (STP-396).
            self.switch_off()
        elif axis.alarms.blocking:
            axis.set_state(AxisState.ALARM_STANDSTILL)
        else:
            axis.motion.come_to_rest()

    @property
    def will_disable(self) -> bool:
        """Whether the ramp in progress ends with the drive switched off: `Enable` is FALSE, or has been
        since.
        """
        return self.switching_off or self._disable_pending or not self.enable

    def quick_stop(self) -> None:
        """Let the drive stop on its own ramp and switch off (OFF3)."""
        self._start_disabling(1)

    def switch_off(self) -> None:
        """Withdraw ON after a ramp of the axis; the state is left when the drive is off (STP-289,
        STP-290).
        """
        self.switching_off = True
        self.stw1 = STW1_IDLE

    def _rest(self, idle: int) -> None:
        """Arrive in the disabled states with control word `idle`."""
        axis = self._axis
        self.switching_off = self._disable_pending = False
        self._idle = self.stw1 = idle
        axis.motion.severity = 0
        axis.motion.abort_all()
        axis.set_state(AxisState.ALARM_DISABLED if axis.alarms.blocking else AxisState.DISABLED)

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    def supervise(self) -> None:
        """Raise the alarms of the coupling: 431 link, 421 drive, 411 encoder, 550 drive moves by itself
        (TA-020).
        """
        axis = self._axis
        port = axis.port
        state = axis.state
        alarms = axis.alarms
        zsw1 = port.zsw1
        expected = axis.facts.drive_expected
        apart = axis.encoder_apart
        if (
            expected
            and zsw1 & _HEALTH_MASK == _HEALTHY
            and port.link_ok
            and apart is None
            and not (port.sensor_fault or self._cause_431 or self._cause_421 or self._cause_411)
        ):
            return  # the rule, cycle by cycle: nothing of what follows
        lost = not port.link_ok or (apart is not None and not apart.link_ok)
        if lost is not self._cause_431 and (self._cause_431 or expected or state is AxisState.ENABLING):
            self._cause_431 = lost
            source, station = (port, 1) if apart is None or not port.link_ok else (apart, 3)
            alarms.set_cause(ALARM_COMMUNICATION, lost, info=station + source.sign_lost)
        faulty = axis.has_position and (apart if apart is not None else port).sensor_fault
        if faulty is not self._cause_411 and (self._cause_411 or expected or state is AxisState.ENABLING):
            self._cause_411 = faulty
            code = port.sensor_code if apart is None else 0
            text = f"encoder error {code:04X}h" if code else ""
            alarms.set_cause(ALARM_ENCODER, faulty, info=_ENCODER_CAUSES.get(code, 1), text=text)
        refused = expected and port.link_ok and not zsw1 & _REQUESTED
        fault = refused or zsw1 & _FAULT != 0
        if self._cause_421 or (fault and (expected or state is AxisState.ENABLING)):
            if fault is not self._cause_421:
                self._cause_421 = fault
                text = "control request withdrawn" if refused else f"drive fault {port.drive_fault_code:04X}h"
                alarms.set_cause(ALARM_DRIVE, fault, info=2 if refused else 1, text=text)
        elif expected and port.link_ok and not zsw1 & _OPERATION and not self.switching_off:
            if zsw1 & _AUTONOMOUS_MASK == ZSW1.READY_TO_SWITCH_ON | ZSW1.READY:
                if state is not AxisState.TRACKING:
                    alarms.raise_alarm(ALARM_AUTONOMOUS)
            else:
                alarms.raise_alarm(ALARM_DRIVE, info=_SHUT_DOWN)
        elif (
            expected
            and zsw1 & _OPERATES_MASK == ZSW1.OPERATION_ENABLED
            and self.stw1 & STW1.NO_OFF3
            and port.link_ok
            and state is not AxisState.TRACKING
        ):
            # It brakes, or stands, under its own control: safe stop 2 (CFG-448).
            alarms.raise_alarm(ALARM_AUTONOMOUS)

    def _watch_start_up(self) -> None:
        """Raise 106 or 108, once, for an axis that is to be enabled before its devices have been there
        (STP-021, CFG-620).
        """
        axis = self._axis
        drive, encoder = axis.port.link_ok, axis.sensor_valid
        if drive and encoder:
            self._joined = True
        elif self.enable:
            self._joined = True
            if not drive:
                axis.alarms.raise_alarm(ALARM_DRIVE_NOT_READY, info=NOT_INITIALISED)
            if not encoder:
                axis.alarms.raise_alarm(ALARM_ENCODER_NOT_READY, info=NOT_INITIALISED)

    def _obstacle(self) -> str:
        """Return what the enable sequence waits for, empty if nothing (STP-018, STP-022, STP-023,
        STP-045).
        """
        axis = self._axis
        if not axis.communication_ok:
            port = axis.port
            if not port.link_ok:
                return "no cyclic communication with the drive"
            if port.zsw1 & _FAULT:
                return f"drive fault {port.drive_fault_code:04X}h"
            return "the drive does not request control"
        if not axis.sensor_valid:
            return "the encoder has no valid value"
        adaption = axis.adaption
        return "" if adaption is None or adaption.ready else "the parameters of the drive are not taken over"

    def _tell(self, obstacle: str) -> None:
        """Write down, once, what the enabling waits for: there is no alarm that would (STP-020, MC-133)."""
        if obstacle != self._told:
            self._told = obstacle
            history = self._axis.history
            if obstacle and history is not None:
                history.emit(self._axis.name, "power.waits", reason=obstacle)

    def step(self) -> None:
        """Make the transitions that depend on the drive's answer."""
        axis = self._axis
        state = axis.state
        if state is _MOTION or state is _STANDSTILL:
            return
        zsw1 = axis.port.zsw1
        off = not zsw1 & _DRIVE_OFF_MASK
        if state is AxisState.DISABLED or state is AxisState.ALARM_DISABLED:
            if not self._joined:
                self._watch_start_up()
            if axis.alarms.blocking:
                axis.set_state(AxisState.ALARM_DISABLED)
                return
            obstacle = self._obstacle() if self.enable else ""
            if obstacle or self._told:
                self._tell(obstacle)
            if self.enable and not obstacle:
                self._start_mode = self.start_mode
                if axis.port.simulated:
                    self._arrive()  # nothing to wait for (CFG-132, CFG-164)
                else:
                    self.stw1 = STW1_IDLE
                    self._phase = 0
                    axis.set_state(AxisState.ENABLING)
            else:
                axis.set_state(AxisState.DISABLED)
        elif state is AxisState.ENABLING:
            # ON is given only to a drive that is ready for it (STP-046, STP-510).
            if zsw1 & ZSW1.SWITCHING_ON_INHIBITED or not zsw1 & ZSW1.READY_TO_SWITCH_ON:
                self.stw1 = STW1_IDLE
            else:
                self.stw1 = STW1_OPERATE
                if axis.in_operation:
                    self._arrive()
                    return
            self._phase += 1
            if self.timeout_s is not None and self._phase * axis.cycle_s > self.timeout_s:
                axis.alarms.raise_alarm(ALARM_DRIVE, info=_NOT_ENABLED)
        elif state is AxisState.DISABLING_RAMP or state is AxisState.ALARM_RAMP:
            if self.switching_off and off:
                self._rest(STW1_IDLE)
        elif state is AxisState.DISABLING_QUICK:
            if self._phase == 0:
                if off and (axis.port.reports_stop or axis.at_rest):
                    self.stw1 = STW1_ALL_OFF
                    self._phase = 1
            else:
                self._phase += 1
                if self._phase > 2:
                    self._rest(STW1_IDLE)
        elif state is AxisState.DISABLING_COAST:
            if off:
                self._rest(STW1_OFF2_OFF1)
        elif state is AxisState.ALARM_DRIVE_STOP:
            self._step_drive_stop(off)
        elif state is AxisState.ALARM_STANDSTILL:
            if not axis.alarms.blocking:
                axis.motion.come_to_rest()
        elif state is AxisState.TRACKING:
            if not self.enable:
                self.quick_stop()
            elif not axis.alarms.blocking and axis.in_operation:
                self._arrive()

    def _step_drive_stop(self, off: bool) -> None:
        axis = self._axis
        if self.stw1 == STW1_IDLE and self.enable and not axis.alarms.blocking and axis.communication_ok:
            # OFF1 can be interrupted: acknowledged while it brakes, the drive is switched on again (STP-382).
            self._start_mode = self.start_mode
            self._phase = 0
            axis.set_state(AxisState.ENABLING)
        elif off and (axis.at_rest or (self.stw1 != STW1_OFF2_OFF1 and axis.port.reports_stop)):
            # Without a link nobody knows whether the drive still brakes: OFF2 would let it coast (STP-367).
            self._rest(STW1_ALL_OFF if self.stw1 == STW1_OFF3 and axis.port.link_ok else self.stw1)

    @property
    def catching(self) -> bool:
        """Whether a moving axis is being enabled that will brake by a ramp: until then the drive has to keep
        its speed (STP-048).
        """
        axis = self._axis
        return (
            axis.state is AxisState.ENABLING
            and not axis.at_rest
            and axis.has_position
            and self._start_mode == 1
            and not self._at_once
        )

    @property
    def _at_once(self) -> bool:
        """Whether the velocity setpoint of a moving axis is 0 as soon as it is enabled
        (`VelocityModePowerOn`).
        """
        return self._velocity_mode is not None and self._velocity_mode.value == 1

    def _arrive(self) -> None:
        """The drive executes setpoints: close the loops without a step (STP-047 to STP-057)."""
        axis = self._axis
        motion = axis.motion
        self.stw1 = STW1_OPERATE
        self.switching_off = self._disable_pending = False
        motion.severity = 0
        motion.abort_all()
        motion.position_controlled = axis.has_position and self._start_mode == 1
        velocity_mode = self._at_once
        if axis.at_rest or not motion.position_controlled or velocity_mode:
            position = axis.feedback.position + (
                axis.actual_velocity * axis.delay_s
                if motion.position_controlled and not velocity_mode
                else 0.0
            )
            motion.gen.set_state(position, 0.0)
            if axis.has_position:
                axis.controller.reset(position)
            axis.set_state(AxisState.STANDSTILL)
        else:
            motion.take_actual_values()
            motion.begin_stop(2, axis.variables.bind("DynamicLimits.MaxDeceleration").value, 0.0)
            axis.set_state(AxisState.ENABLE_RAMP)

    @property
    def disabling(self) -> bool:
        """Whether a disabling is in progress."""
        return self._axis.state in DISABLING
