"""Enabling and disabling: the handshake with the drive and the drive's own stops
(STP-037 to STP-046, section 8).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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
from motion.kernel.cell import Cell
from motion.s7.axis.state import DISABLING, DRIVE_EXPECTED_ON, AxisState

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.kernel.servo_axis import ServoAxis
    from motion.s7.axis.alarms import AxisAlarms
    from motion.s7.axis.motion import MotionControl
    from motion.s7.axis.state import AxisStates, DriveCommand

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


@dataclass(frozen=True, kw_only=True)
class EnableSettings:
    """What is configured of enabling and disabling an axis.

    Args:
        remove_enable: `Actor.RemoveEnableReaction`.
        velocity_mode: `PositionControl.VelocityModePowerOn`; None without positions.
        max_deceleration: `DynamicLimits.MaxDeceleration`.

    """

    remove_enable: Cell[int]
    velocity_mode: Cell[int] | None
    max_deceleration: Cell[float]


class EnableControl:
    """Enabling and disabling of one axis: every transition that waits for the drive.

    Args:
        name: Name of the axis.
        history: Event log, or None.
        servo: The axis in the kernel.
        states: State of the axis.
        command: Its control word, which is led from here.
        alarms: Its alarms.
        motion: Its jobs and ramps.
        settings: What is configured of enabling and disabling.
        adapted: Returns whether the parameters of drive and encoders are taken over.

    """

    def __init__(
        self,
        name: str,
        history: History | None,
        *,
        servo: ServoAxis,
        states: AxisStates,
        command: DriveCommand,
        alarms: AxisAlarms,
        motion: MotionControl,
        settings: EnableSettings,
        adapted: Callable[[], bool],
    ) -> None:
        self._name = name
        self._history = history
        self._servo = servo
        self._states = states
        self._command = command
        self._alarms = alarms
        self._motion = motion
        self._adapted = adapted
        self.start_mode = 1
        """`MC_Power.StartMode` as last called; latched when the enable sequence starts."""
        self._start_mode = 1
        self._joined = False
        """Drive and encoder have been there since the start of the controller, or their
        absence has been reported.
        """
        self._phase = 0
        self.timeout_s: float | None = None
        """Longest time from the beginning of the enable sequence to operation, s, then alarm 421; None = no
        limit (STP-043).
        """
        self._waits_for = ""
        """What the enabling waits for, as the history knows it."""
        self._reaction = settings.remove_enable
        self._velocity_mode = settings.velocity_mode
        self._max_deceleration = settings.max_deceleration
        self._cause_431 = self._cause_421 = self._cause_411 = False
        self._fault_code = 0
        """Fault of the drive that the text of alarm 421 has; 0: none, or its number has not come yet."""

    def power_down(self) -> None:
        """Begin again, as after power-on."""
        command = self._command
        command.enable = command.switching_off = command.acknowledge = command.disable_pending = False
        self._joined = False
        self.start_mode = self._start_mode = 1
        command.stw1 = STW1_IDLE
        self._phase = 0
        self._cause_431 = self._cause_421 = self._cause_411 = False
        self._fault_code = 0

    def rest(self, *, outputs: bool) -> None:
        """Say whether a disabled axis sends its control word or, with process outputs off, zeros."""
        self._command.stw1 = STW1_IDLE if outputs else 0

    # -- what MC_Power sees
    # -----------------------------------------------------------------------------------

    @property
    def enable(self) -> bool:
        """Level of `MC_Power.Enable` as last called."""
        return self._command.enable

    def withdraw(self) -> None:
        """Take `MC_Power.Enable` as FALSE without any effect on the drive: the controller leaves RUN."""
        self._command.enable = False

    @property
    def busy(self) -> bool:
        """`MC_Power.Busy`: enabled, being enabled, or not yet switched off (STP-294, STP-295)."""
        return self._command.enable or self._states.state not in (
            AxisState.DISABLED,
            AxisState.ALARM_DISABLED,
            AxisState.RESTARTING,
        )

    @property
    def enabled(self) -> bool:
        """`MC_Power.Status`."""
        return self._states.facts.enabled

    @property
    def alarmed(self) -> bool:
        """Whether an alarm has disabled an axis, or is about to, that is to be enabled (MC-167)."""
        return self._alarms.blocking and self._command.enable and self._states.state in _ALARMED

    def call(self, *, enable: bool, start_mode: int, stop_mode: int) -> tuple[bool, bool, bool]:
        """Take the inputs of `MC_Power` over; returns `enabled`, `busy` and `alarmed`."""
        self.start_mode = start_mode
        command = self._command
        if enable is not command.enable:
            command.enable = enable
            if not enable:
                if self._history is not None:
                    self._history.emit(self._name, "power.disable", stop_mode=stop_mode)
                self._disable(stop_mode)
        enabled = self._states.facts.enabled
        return enabled, command.enable or self.busy, self._alarms.blocking and self.alarmed

    def _disable(self, stop_mode: int) -> None:
        state = self._states.state
        motion = self._motion
        if state is AxisState.ENABLING:
            self._rest(STW1_IDLE)
        elif state is AxisState.ALARM_RAMP and not self._alarms.blocking:
            motion.abort_all()
            self._start_disabling(stop_mode)
        elif state is AxisState.ALARM_RAMP:
            # Quick stop and coast act at once; a ramp only when it brakes harder (STP-396).
            motion.abort_all()
            self._command.disable_pending = True
            if stop_mode in (1, 3) or {0: 3, 2: 2}[stop_mode] > motion.severity:
                self._start_disabling(stop_mode)
        elif state is AxisState.ALARM_DRIVE_STOP:
            if self._reaction.value != 7 and self._command.stw1 != STW1_OFF3:
                self._command.stw1 = STW1_OFF2_OFF1  # STP-384
        elif state is AxisState.TRACKING:
            self._start_disabling(stop_mode if stop_mode in (1, 3) else 1)
        elif state in DRIVE_EXPECTED_ON and state is not AxisState.DISABLING_RAMP:
            motion.abort_all()
            self._start_disabling(stop_mode)

    def _start_disabling(self, stop_mode: int) -> None:
        self._phase = 0
        self._command.switching_off = False
        self._command.disable_pending = True
        if stop_mode == 1:
            self._command.stw1 = STW1_OFF3
            self._states.enter(AxisState.DISABLING_QUICK)
        elif stop_mode == 3:
            self._command.stw1 = STW1_OFF2_OFF1
            self._states.enter(AxisState.DISABLING_COAST)
        else:
            self._motion.begin_reaction(3 if stop_mode == 0 else 2)
            self._states.enter(AxisState.DISABLING_RAMP)

    # -- reactions of alarms and ends of ramps
    # ----------------------------------------------------------------

    def remove_enable(self) -> None:
        """Reaction 4: the drive stops as `Actor.RemoveEnableReaction` says (STP-348)."""
        self._command.stw1 = _REMOVE_ENABLE.get(int(self._reaction.value), STW1_OFF3)
        self._command.switching_off = False
        self._states.enter(AxisState.ALARM_DRIVE_STOP)

    def withdraw_further(self) -> None:
        """Reaction 4 during a quick stop: take away what its pattern takes away too,
        and give nothing back (STP-526).
        """
        if self._phase == 0:
            self._command.stw1 &= _REMOVE_ENABLE.get(int(self._reaction.value), STW1_OFF3)

    def quick_stop(self) -> None:
        """Let the drive stop on its own ramp and switch off (OFF3)."""
        self._start_disabling(1)

    def _rest(self, idle: int) -> None:
        """Arrive in the disabled states with control word `idle`."""
        self._command.switching_off = self._command.disable_pending = False
        self._command.stw1 = idle
        self._motion.severity = 0
        self._motion.abort_all()
        self._states.enter(AxisState.ALARM_DISABLED if self._alarms.blocking else AxisState.DISABLED)

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    def supervise(self) -> None:
        """Raise the alarms of the coupling: 431 link, 421 drive, 411 encoder, 550
        drive moves by itself (TA-020).
        """
        servo = self._servo
        port = servo.port
        state = self._states.state
        alarms = self._alarms
        zsw1 = port.zsw1
        expected = self._states.facts.drive_expected
        apart = servo.encoder_apart
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
        faulty = servo.has_position and (apart if apart is not None else port).sensor_fault
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
                text = "control request withdrawn" if refused else port.fault_text()
                self._fault_code = port.drive_fault_code
                alarms.set_cause(ALARM_DRIVE, fault, info=2 if refused else 1, text=text)
            elif fault and not refused and not self._fault_code and port.drive_fault_code:
                # Over some links the number comes later than the bit that shows the fault.
                self._fault_code = port.drive_fault_code
                alarms.add_detail(ALARM_DRIVE, port.fault_text())
        elif expected and port.link_ok and not zsw1 & _OPERATION and not self._command.switching_off:
            if zsw1 & _AUTONOMOUS_MASK == ZSW1.READY_TO_SWITCH_ON | ZSW1.READY:
                if state is not AxisState.TRACKING:
                    alarms.raise_alarm(ALARM_AUTONOMOUS)
            else:
                alarms.raise_alarm(ALARM_DRIVE, info=_SHUT_DOWN)
        elif (
            expected
            and zsw1 & _OPERATES_MASK == ZSW1.OPERATION_ENABLED
            and self._command.stw1 & STW1.NO_OFF3
            and port.link_ok
            and state is not AxisState.TRACKING
        ):
            # It brakes, or stands, under its own control: safe stop 2 (CFG-448).
            alarms.raise_alarm(ALARM_AUTONOMOUS)

    def _watch_start_up(self) -> None:
        """Raise 106 or 108, once, for an axis that is to be enabled before its devices have been there
        (STP-021, CFG-620).
        """
        servo = self._servo
        drive, encoder = servo.port.link_ok, servo.sensor_valid
        if drive and encoder:
            self._joined = True
        elif self._command.enable:
            self._joined = True
            if not drive:
                self._alarms.raise_alarm(ALARM_DRIVE_NOT_READY, info=NOT_INITIALISED)
            if not encoder:
                self._alarms.raise_alarm(ALARM_ENCODER_NOT_READY, info=NOT_INITIALISED)

    def _obstacle(self) -> str:
        """Return what the enable sequence waits for, empty if nothing
        (STP-018, STP-022, STP-023, STP-045).
        """
        servo = self._servo
        if not servo.communication_ok:
            port = servo.port
            if not port.link_ok:
                return "no cyclic communication with the drive"
            if port.zsw1 & _FAULT:
                return port.fault_text()
            return "the drive does not request control"
        if not servo.sensor_valid:
            return "the encoder has no valid value"
        return "" if self._adapted() else "the parameters of the drive are not taken over"

    def _tell(self, obstacle: str) -> None:
        """Write down, once, what the enabling waits for: there is no alarm that would (STP-020, MC-133)."""
        if obstacle != self._waits_for:
            self._waits_for = obstacle
            history = self._history
            if obstacle and history is not None:
                history.emit(self._name, "power.waits", reason=obstacle)

    def step(self) -> None:
        """Make the transitions that depend on the drive's answer."""
        servo = self._servo
        state = self._states.state
        if state is _MOTION or state is _STANDSTILL:
            return
        zsw1 = servo.port.zsw1
        off = not zsw1 & _DRIVE_OFF_MASK
        if state is AxisState.DISABLED or state is AxisState.ALARM_DISABLED:
            if not self._joined:
                self._watch_start_up()
            if self._alarms.blocking:
                self._states.enter(AxisState.ALARM_DISABLED)
                return
            obstacle = self._obstacle() if self._command.enable else ""
            if obstacle or self._waits_for:
                self._tell(obstacle)
            if self._command.enable and not obstacle:
                self._start_mode = self.start_mode
                if servo.port.simulated:
                    self._arrive()  # nothing to wait for (CFG-132, CFG-164)
                else:
                    self._command.stw1 = STW1_IDLE
                    self._phase = 0
                    self._states.enter(AxisState.ENABLING)
            else:
                self._states.enter(AxisState.DISABLED)
        elif state is AxisState.ENABLING:
            # ON is given only to a drive that is ready for it (STP-046, STP-510).
            if zsw1 & ZSW1.SWITCHING_ON_INHIBITED or not zsw1 & ZSW1.READY_TO_SWITCH_ON:
                self._command.stw1 = STW1_IDLE
            else:
                self._command.stw1 = STW1_OPERATE
                if servo.in_operation:
                    self._arrive()
                    return
            self._phase += 1
            if self.timeout_s is not None and self._phase * servo.cycle_s > self.timeout_s:
                self._alarms.raise_alarm(ALARM_DRIVE, info=_NOT_ENABLED)
        elif state is AxisState.DISABLING_RAMP or state is AxisState.ALARM_RAMP:
            if self._command.switching_off and off:
                self._rest(STW1_IDLE)
        elif state is AxisState.DISABLING_QUICK:
            if self._phase == 0:
                if off and (servo.port.reports_stop or servo.at_rest):
                    self._command.stw1 = STW1_ALL_OFF
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
            if not self._alarms.blocking:
                self._motion.come_to_rest()
        elif state is AxisState.TRACKING:
            if not self._command.enable:
                self.quick_stop()
            elif not self._alarms.blocking and servo.in_operation:
                self._arrive()

    def _step_drive_stop(self, off: bool) -> None:
        servo = self._servo
        if (
            self._command.stw1 == STW1_IDLE
            and self._command.enable
            and not self._alarms.blocking
            and servo.communication_ok
        ):
            # OFF1 can be interrupted: acknowledged while it brakes, the drive is switched on again (STP-382).
            self._start_mode = self.start_mode
            self._phase = 0
            self._states.enter(AxisState.ENABLING)
        elif off and (servo.at_rest or (self._command.stw1 != STW1_OFF2_OFF1 and servo.port.reports_stop)):
            # Without a link nobody knows whether the drive still brakes: OFF2 would let it coast (STP-367).
            self._rest(
                STW1_ALL_OFF if self._command.stw1 == STW1_OFF3 and servo.port.link_ok else self._command.stw1
            )

    @property
    def catching(self) -> bool:
        """Whether a moving axis is being enabled that will brake by a ramp: until then the drive has to keep
        its speed (STP-048).
        """
        servo = self._servo
        return (
            self._states.state is AxisState.ENABLING
            and not servo.at_rest
            and servo.has_position
            and self._start_mode == 1
            and not self._at_once
        )

    @property
    def _at_once(self) -> bool:
        """Whether the velocity setpoint of a moving axis is 0 as soon as it
        is enabled (`VelocityModePowerOn`).
        """
        return self._velocity_mode is not None and self._velocity_mode.value == 1

    def _arrive(self) -> None:
        """The drive executes setpoints: close the loops without a step (STP-047 to STP-057)."""
        servo = self._servo
        motion = self._motion
        self._command.stw1 = STW1_OPERATE
        self._command.switching_off = self._command.disable_pending = False
        motion.severity = 0
        motion.abort_all()
        servo.position_controlled = servo.has_position and self._start_mode == 1
        velocity_mode = self._at_once
        if servo.at_rest or not servo.position_controlled or velocity_mode:
            position = servo.feedback.position + (
                servo.actual_velocity * servo.delay_s
                if servo.position_controlled and not velocity_mode
                else 0.0
            )
            servo.basic.set_state(position, 0.0)
            if servo.has_position:
                servo.controller.reset(position)
            self._states.enter(AxisState.STANDSTILL)
        else:
            motion.take_actual_values()
            motion.begin_stop(2, self._max_deceleration.value, 0.0)
            self._states.enter(AxisState.ENABLE_RAMP)

    @property
    def disabling(self) -> bool:
        """Whether a disabling is in progress."""
        return self._states.state in DISABLING
