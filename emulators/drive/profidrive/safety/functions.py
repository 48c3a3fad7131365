"""Safety functions of a PROFIdrive axis: safe stopping, safe brake control, safe motion and position
monitoring (CFG-443 to CFG-498).

Stops that are selected, and those with which a violated function reacts, lead to the same three
demands: torque off (STO, OFF2), ramp and then torque off (SS1, OFF3), ramp and then monitored
standstill under control (SS2).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emulators.drive.core import RPM, ServoCore
from emulators.drive.profidrive.config import DriveSettings
from emulators.drive.profidrive.faults import catalogue as numbers
from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.profidrive.faults.state import FaultState, RaiseFault
from emulators.drive.profidrive.modes import OperatingMode
from emulators.drive.profidrive.process_data import ProcessData
from emulators.drive.profidrive.safety.brake_test import BrakeTest
from emulators.drive.profidrive.safety.monitors import SafeMonitors
from emulators.drive.profidrive.safety.state import SafetyState
from emulators.drive.profidrive.statemachine import AxisState, GeneralStateMachine, Off
from emulators.drive.safety_config import SafeMotionConfig
from emulators.events import Emit
from emulators.mechanics import AxisMechanics
from fieldbus.clock import S, Scheduler, seconds_to_ns

_ALLOWANCE: Final = 0.1
"""The monitored ramp may be exceeded by this share of the speed at its beginning."""
_STO, _SS1, _SS2, _NOTHING = 3, 2, 1, 0
_BY_NAME: Final = {"sto": _STO, "ss1": _SS1, "ss2": _SS2}


class _Stop:
    """A safe stop that runs.

    Args:
        scheduler: Clock of the drive.
        core: Servo core.
        time_s: Its time, s.
        ramp: The drive brakes by itself.
        monitored: Its ramp is watched.

    """

    def __init__(
        self, scheduler: Scheduler, core: ServoCore, time_s: float, *, ramp: bool, monitored: bool
    ) -> None:
        self._scheduler = scheduler
        self._core = core
        self._start_ns = scheduler.now
        self._time_s = time_s
        self._limit = abs(core.velocity)
        self.monitored = ramp and monitored
        self.ramp = ramp
        self.done = False
        """Its time has passed, or the axis has come to rest."""

    @property
    def over(self) -> bool:
        """Whether its time has passed."""
        return self._scheduler.now - self._start_ns >= seconds_to_ns(self._time_s)

    @property
    def violated(self) -> bool:
        """Whether the speed is above the line that falls to zero within its time."""
        if not self.monitored:
            return False
        core = self._core
        elapsed_s = (self._scheduler.now - self._start_ns) / S
        share = max(1.0 - elapsed_s / self._time_s + _ALLOWANCE, 0.0)
        return abs(core.velocity) > self._limit * share + core.standstill_speed


class SafetyFunctions:
    """Safe torque off acts as OFF2 without a fault, safe stop 1 as OFF3 and then as
    safe torque off; see the module.

    Args:
        scheduler: Clock of the drive.
        config: Safety functions.
        settings: Parameters in effect.
        core: Servo core.
        mechanics: Machine.
        machine: General state machine.
        mode: Operating mode; it makes the ramp of safe stop 2.
        data: Setpoints of the telegram, for the brake test.
        faults: Faults and warnings.
        state: What is in effect; written here.
        raise_fault: Raises a fault of the drive.
        act: Lets the state machine react at once.
        emit: Writes events into the log.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        config: SafeMotionConfig,
        *,
        settings: DriveSettings,
        core: ServoCore,
        mechanics: AxisMechanics,
        machine: GeneralStateMachine,
        mode: OperatingMode,
        data: ProcessData,
        faults: FaultState,
        state: SafetyState,
        raise_fault: RaiseFault,
        act: Callable[[], None],
        emit: Emit,
    ) -> None:
        self._scheduler = scheduler
        self._ss1_external = config.ss1_external
        self._ss1_time_s = config.ss1_time_s
        self._ss1_monitored = config.ss1_monitored
        self._ss2_external = config.ss2_external
        self._ss2_time_s = config.ss2_time_ms / 1000.0
        self._ss2_monitored = config.ss2_monitored
        self._sls_factor = config.sls_factor_percent / 100.0
        self._faulty_sto = config.sto == "fault"
        self._sbc = config.sbc
        self._settings = settings
        self._core = core
        self._mechanics = mechanics
        self._machine = machine
        self._mode = mode
        self._faults = faults
        self._state = state
        self._raise_fault = raise_fault
        self._act = act
        self._emit = emit
        self.monitors = SafeMonitors(scheduler, config, core, mechanics)
        self.brake_test = BrakeTest(
            scheduler,
            config,
            core=core,
            mechanics=mechanics,
            machine=machine,
            data=data,
            state=state,
            settle_brake=self.settle_brake,
            emit=emit,
        )
        self._ss1: _Stop | None = None
        self._ss2: _Stop | None = None
        self._reaction = _NOTHING
        self._halted = False
        self._reported = 0
        self.sto_input = False
        self.sbc_input = False
        self.ss1_input = False
        self.ss2_input = False
        self.messages: dict[int, None] = {}
        """Numbers of the safety messages that wait for a safe acknowledgement, oldest first."""
        self.watching = False
        """`watch` has something to do."""

    # -- what it shows ---------------------------------------------------------------------------------

    @property
    def braking(self) -> bool:
        """Whether safe stop 1 brakes."""
        stop = self._ss1
        return stop is not None and stop.ramp and not stop.done

    @property
    def ss1_active(self) -> bool:
        """Whether safe stop 1 is under way, or has ended in safe torque off."""
        return self._ss1 is not None

    @property
    def ss2_active(self) -> bool:
        """Whether safe stop 2 is in effect."""
        return self._ss2 is not None

    @property
    def ss2_external(self) -> bool:
        """Whether the safe stop 2 in effect leaves the braking to the controller (SS2E)."""
        return self._ss2 is not None and not self._ss2.ramp

    @property
    def stopping(self) -> bool:
        """Whether a safe stopping function is selected or reacts: no setpoint is allowed (CFG-442)."""
        return bool(
            self.sto_input
            or self.sbc_input
            or self.ss1_input
            or self.ss2_input
            or self._reaction
            or self.monitors.sos_selected
        )

    @property
    def torque_off(self) -> bool:
        """Whether safe torque off is in effect."""
        return self._state.torque_off

    @property
    def holding(self) -> bool:
        """Whether safe stop 2 has taken the setpoints away: the axis brakes, or stands under control."""
        return self._state.holding

    @property
    def event(self) -> bool:
        """Whether a function has reacted by itself (internal event)."""
        return self._reaction != _NOTHING

    # -- selection -------------------------------------------------------------------------------------

    def set_sto(self, active: bool) -> None:
        """Demand safe torque off, or release it; the release acknowledges safety messages."""
        released = self.sto_input and not active
        self.sto_input = active
        if released:
            self._forget_messages()
        self._settle()

    def set_sbc(self, active: bool) -> None:
        """Demand safe brake control, or release it: torque off, and the brake closes whatever the control
        word says.
        """
        self.sbc_input = active
        self._settle()

    def set_ss1(self, active: bool) -> None:
        """Demand safe stop 1, or release it."""
        self.ss1_input = active
        self._settle()

    def set_ss2(self, active: bool) -> None:
        """Demand safe stop 2, or release it."""
        self.ss2_input = active
        self._settle()

    def set_sos(self, active: bool) -> None:
        """Select safe operating stop, or deselect it: the standstill is monitored after a delay."""
        self.monitors.select_sos(active)
        self._settle()

    def set_sls(self, level: int | None) -> None:
        """Select a level of safely limited speed, or deselect it (None).

        Raises:
            ConfigurationError: There is no such level.

        """
        self.monitors.select_sls(level)
        self._settle()

    def set_sdi(self, direction: int | None) -> None:
        """Select safe direction with the permitted one, 1 or -1, or deselect it (None).

        Raises:
            ConfigurationError: It is neither of them.

        """
        self.monitors.select_sdi(direction)
        self._settle()

    def set_slp(self, number: int | None) -> None:
        """Select a range of safely limited position, or deselect it (None).

        Raises:
            ConfigurationError: There is no such range.

        """
        self.monitors.select_slp(number)
        self._settle()

    def acknowledge(self) -> None:
        """Acknowledge the safety messages safely; what is still violated reacts again."""
        self._forget_messages()
        self._settle()

    def restart(self) -> None:
        """Begin as after power-on: inputs stay, reactions and messages are gone."""
        self._reaction = _NOTHING
        self.messages.clear()
        self._ss1 = self._ss2 = None
        self._state.torque_off = False
        self.monitors.restart()
        self.brake_test.restart()
        self._settle()

    def _forget_messages(self) -> None:
        for number in self.messages:
            self._faults.warn(number, False)
        self.messages.clear()
        self._reaction = _NOTHING
        self.monitors.restart()

    # -- control cycle ---------------------------------------------------------------------------------

    def watch(self) -> None:
        """Watch what is in effect; call in every control cycle while `watching`."""
        if self._ss1 is not None and not self._ss1.done:
            self._watch_ss1(self._ss1)
        if self._ss2 is not None:
            self._watch_ss2(self._ss2)
        if not self._state.torque_off:
            violation = self.monitors.watch()
            if violation is not None:
                self._react(*violation)
        self._tell()

    def _watch_ss1(self, stop: _Stop) -> None:
        if stop.over:
            stop.done = True
            moves = not self._core.standing
            self._settle()
            if stop.monitored and moves:
                self._raise_fault(numbers.SAFE_STOP)
        elif stop.monitored:
            if not self._core.enabled:
                stop.done = True
                self._settle()
            elif stop.violated:
                stop.done = True
                self._settle()
                self._raise_fault(numbers.SAFE_STOP)

    def _watch_ss2(self, stop: _Stop) -> None:
        core = self._core
        if self._state.holding:
            if self._machine.state is not AxisState.S4:
                self._halted = False
            elif not self._halted:
                self._halted = True
                self._mode.stop(quick=True)
        if stop.done:
            return
        if stop.over or (stop.ramp and core.standing and core.precontrol_velocity == 0.0):
            stop.done = True
            self.monitors.hold_position()
        elif core.enabled and stop.violated:
            stop.done = True
            self._react(DriveWarning.SAFE_RAMP, "sto")

    def _react(self, message: int, reaction: str) -> None:
        """Report a violation and stop; a stronger stop is not weakened."""
        if message in self.messages and self._reaction >= _BY_NAME[reaction]:
            return
        if message not in self.messages:
            self.messages[int(message)] = None
            self._faults.warn(message, True)
            self._emit("drive.safety_message", number=int(message), reaction=reaction)
        self._reaction = max(self._reaction, _BY_NAME[reaction])
        self._settle()

    # -- stops -----------------------------------------------------------------------------------------

    def _settle(self) -> None:
        """Bring into force what is selected and what reacts."""
        reaction = self._reaction
        if not (self.ss1_input or reaction == _SS1):
            self._ss1 = None
        elif self._ss1 is None:
            ramp = reaction == _SS1 or not self._ss1_external
            self._ss1 = _Stop(
                self._scheduler, self._core, self._ss1_time_s, ramp=ramp, monitored=self._ss1_monitored
            )
            self._ss1.done = not self._core.enabled
        if not (self.ss2_input or reaction == _SS2):
            if self._ss2 is not None:
                self._ss2 = None
                self.monitors.release_position()
        elif self._ss2 is None or (reaction == _SS2 and not self._ss2.ramp):
            ramp = reaction == _SS2 or not self._ss2_external
            self._ss2 = _Stop(
                self._scheduler, self._core, self._ss2_time_s, ramp=ramp, monitored=self._ss2_monitored
            )
        torque_off = (
            self.sto_input or self.sbc_input or reaction == _STO or (self._ss1 is not None and self._ss1.done)
        )
        self._state.holding = self._ss2 is not None and self._ss2.ramp and not torque_off
        if not self._state.holding:
            self._halted = False
        elif self._machine.state is AxisState.S4 and not self._halted:
            self._halted = True
            self._mode.stop(quick=True)
        self.watching = self._ss1 is not None or self._ss2 is not None or self.monitors.selected
        self._state.off = int(Off.OFF2) if torque_off else int(Off.OFF3) if self.braking else 0
        changed = torque_off is not self._state.torque_off
        self._state.torque_off = torque_off
        self.settle_brake()
        if changed:
            self._faults.warn(DriveWarning.SAFE_TORQUE_OFF, torque_off)
            if torque_off and self._faulty_sto and self._core.enabled and self._ss1 is None:
                self._raise_fault(numbers.SAFE_TORQUE_OFF)
                self._faults.keep(numbers.SAFE_TORQUE_OFF, lambda: self._state.torque_off)
        self._tell()
        self._act()

    def settle_brake(self) -> None:
        """Hold the brake closed as long as a function demands it."""
        with_sto = self._state.torque_off and self._sbc
        self._core.brake.forced_closed = self.sbc_input or with_sto or self._state.testing_brake

    # -- words -----------------------------------------------------------------------------------------

    def _tell(self) -> None:
        word = self.s_zsw1b()
        if word != self._reported:
            self._reported = word
            self._emit("drive.safety", word=word)

    def s_zsw1b(self) -> int:
        """Return S_ZSW1B (CFG-471 to CFG-493)."""
        monitors = self.monitors
        if (
            self._ss1 is None
            and self._ss2 is None
            and self._reaction == _NOTHING
            and not (self._state.torque_off or self.messages or monitors.selected)
        ):
            return 0  # no safety function: the usual case, in every cycle
        return (
            self._state.torque_off
            | self.ss1_active << 1
            | (self.ss2_active and not self.ss2_external) << 2
            | monitors.sos_active << 3
            | monitors.sls_active << 4
            | monitors.sos_selected << 5
            | (monitors.sls_level > 0) << 6
            | self.event << 7
            | max(0, monitors.sls_level - 1) << 9
            | (monitors.sdi > 0) << 12
            | (monitors.sdi < 0) << 13
            | bool(self.messages) << 15
        )

    def s_zsw2b(self) -> int:
        """Return S_ZSW2B: range and selection of safely limited position,
        permitted direction (CFG-494, CFG-495).
        """
        monitors = self.monitors
        number = monitors.slp_range
        return (number == 2) << 4 | (number > 0) << 7 | (monitors.sdi > 0) << 8 | (monitors.sdi < 0) << 9

    def s_zsw3b(self) -> int:
        """Return S_ZSW3B: safe brake test, bit 11 safe stop 2 with braking by the
        controller (CFG-479, CFG-484).
        """
        return self.ss2_external << 11 | self.brake_test.word

    def speed_limit(self) -> float:
        """Return the limit of the speed setpoint at the motor, rad/s: 0 with a safe
        stop or safe direction (CFG-442).
        """
        monitors = self.monitors
        if self.stopping or monitors.sdi:
            return 0.0
        if monitors.sls_level:
            return monitors.sls_limit * self._sls_factor / abs(self._mechanics.ratio)
        return self._settings.max_speed_rpm * RPM
