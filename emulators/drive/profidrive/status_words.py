"""Status words of the axis, and the frame that it sends (PD-060 to PD-085)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emulators.drive.core import RPM
from emulators.drive.profidrive.faults.catalogue import DriveWarning, alarm_class
from emulators.drive.profidrive.signals import Getter, getters
from emulators.drive.profidrive.statemachine import AxisState, Off
from emulators.drive.protection import WindowTimer
from fieldbus.profidrive.words import MELDW, SIGN_OF_LIFE_SHIFT, ZSW1, ZSW2

if TYPE_CHECKING:
    from emulators.drive.profidrive.drive import ProfidriveDrive

_NO_OFF2: Final = int(ZSW1.NO_OFF2)
_NO_OFF3: Final = int(ZSW1.NO_OFF3)
_FAULT: Final = int(ZSW1.FAULT)
_WARNING: Final = int(ZSW1.WARNING)
_REQUESTED: Final = int(ZSW1.CONTROL_REQUESTED)
_OPERATION: Final = int(ZSW1.OPERATION_ENABLED)
_OFF2: Final = int(Off.OFF2)
_OFF3: Final = int(Off.OFF3)
_PULSES: Final = int(ZSW2.PULSES_ENABLED)
_CHANGEOVER: Final = int(ZSW2.DATA_SET_CHANGEOVER)
_ALARM_CLASS_SHIFT: Final = 5
_PARKING: Final = int(ZSW2.PARKING)
_FIXED_STOP: Final = int(ZSW2.TRAVEL_TO_FIXED_STOP)
_VARIABLE: Final = int(MELDW.VARIABLE_SIGNAL)
_S5B: Final = AxisState.S5B
_MOTOR_TEMPERATURE: Final = int(DriveWarning.MOTOR_TEMPERATURE)
_STAGE_TEMPERATURE: Final = int(DriveWarning.STAGE_TEMPERATURE)
_RAMP_COMPLETED: Final = int(MELDW.RAMP_COMPLETED)
_BELOW_TORQUE: Final = int(MELDW.TORQUE_BELOW_THRESHOLD)
_BELOW_3: Final = int(MELDW.SPEED_BELOW_THRESHOLD_3)
_BELOW_2: Final = int(MELDW.SPEED_BELOW_THRESHOLD_2)
_COOL_MOTOR: Final = int(MELDW.NO_MOTOR_OVERTEMPERATURE)
_NO_OVERLOAD: Final = int(MELDW.NO_POWER_UNIT_OVERLOAD)
_DEVIATION: Final = int(MELDW.DEVIATION_IN_TOLERANCE)
_CONTROLS: Final = int(MELDW.CONTROLLER_ENABLED | MELDW.PULSES_ENABLED)
_READY: Final = int(MELDW.READY)
_G1: Final = ("G1_ZSW", "G1_XIST1", "G1_XIST2")


class StatusWords:
    """Forms the words of the telegram to the controller.

    Args:
        drive: The drive.

    """

    __slots__ = (
        "_cleared",
        "_cycle_s",
        "_deviation",
        "_drive",
        "_ends_with_g1",
        "_frozen",
        "_getters",
        "_pack",
        "_set",
        "_sign",
        "in_tolerance",
    )

    def __init__(self, drive: ProfidriveDrive) -> None:
        self._drive = drive
        self._cycle_s = drive.config.cycle_ns / 1e9
        self._deviation = WindowTimer()
        self.in_tolerance = True
        """Whether the speed is, or was a moment ago, near its setpoint (PD-079)."""
        self._frozen: int | None = None
        self._set = 0
        self._sign: int | None = None
        self._cleared = 0
        self._pack = drive.telegram.actual.pack
        self._getters: tuple[Getter, ...] = ()
        self._ends_with_g1 = False

    def connect(self) -> None:
        """Find the source of every signal; when the drive is complete."""
        names = self._drive.telegram.actual.names
        self._ends_with_g1 = names[-3:] == _G1
        self._getters = getters(self._drive, names[:-3] if self._ends_with_g1 else names)

    def frame(self) -> bytes:
        """Return the telegram to the controller with the values of now."""
        if self._ends_with_g1:
            return self._pack(*[get() for get in self._getters], *self._drive.g1_words)
        return self._pack(*[get() for get in self._getters])

    def restart(self) -> None:
        """Begin as after power-on."""
        self._deviation.reset()
        self.in_tolerance = True

    # -- overridden bits -------------------------------------------------------------------------------

    def freeze(self, frozen: bool) -> None:
        """Let ZSW1 show what it shows now, whatever happens."""
        self._frozen = self._true_zsw1() if frozen else None

    def freeze_sign_of_life(self, frozen: bool) -> None:
        """Let the drive's sign of life stand still, or count again."""
        self._sign = self._drive.sign_of_life.value if frozen else None

    def override_bits(self, *, set_bits: int = 0, clear_bits: int = 0) -> None:
        """Show bits of ZSW1 as 1, or as 0, whatever they should be."""
        self._set = set_bits & 0xFFFF
        self._cleared = clear_bits & 0xFFFF

    # -- words -----------------------------------------------------------------------------------------

    def watch_deviation(self) -> None:
        """Look at the speed deviation; once per bus cycle (PD-079)."""
        drive = self._drive
        core = drive.core
        if not core.enabled:
            self._deviation.reset()
            self.in_tolerance = True
            return
        settings = drive.settings
        self._deviation.time_s = settings.deviation_time_s
        difference = abs(core.precontrol_velocity - core.velocity)
        self.in_tolerance = not self._deviation.update(
            difference > settings.deviation_rpm * RPM, self._cycle_s
        )

    def zsw1(self) -> int:
        """Return ZSW1, or what a test makes of it."""
        word = self._true_zsw1() if self._frozen is None else self._frozen
        return (word | self._set) & ~self._cleared & 0xFFFF

    def _true_zsw1(self) -> int:
        drive = self._drive
        if not drive.controlled_cyclically:
            return 0
        state = drive.operation.machine.state
        word = state.bits | _REQUESTED
        faults = drive.faults
        off = faults.off | drive.safety.off
        stw1 = drive.stw1
        if stw1 & 0x0002 and not off & _OFF2:
            word |= _NO_OFF2
        if stw1 & 0x0004 and not (off & _OFF3 or drive.safety.holding) and state is not _S5B:
            word |= _NO_OFF3
        if faults.buffer.current:
            word |= _FAULT
        if faults.warnings:
            word |= _WARNING
        word |= drive.mode.zsw1()
        if drive.config.operation_while_braking and state in (AxisState.S5A, AxisState.S5B):
            word |= _OPERATION
        return word

    def zsw2(self) -> int:
        """Return ZSW2 with the drive's sign of life."""
        drive = self._drive
        sign = drive.sign_of_life.value if self._sign is None else self._sign
        sets = drive.data_sets
        word = sign << SIGN_OF_LIFE_SHIFT | sets.active
        if sets.changing:
            word |= _CHANGEOVER
        if drive.faults.warnings:
            word |= alarm_class(drive.faults.warnings) << _ALARM_CLASS_SHIFT
        if drive.core.enabled:
            word |= _PULSES
        if drive.parked:
            word |= _PARKING
        if drive.torque.at_fixed_stop:
            word |= _FIXED_STOP
        return word

    def _variable(self) -> float:
        """Return the amount of the signal that MELDW bit 5 watches: Nm, or rpm."""
        core = self._drive.core
        return abs(core.torque if self._drive.settings.variable_signal == "torque" else core.velocity / RPM)

    def meldw(self) -> int:
        """Return the message word (PD-085)."""
        drive = self._drive
        core = drive.core
        settings = drive.settings
        speed = abs(core.velocity) / RPM
        warnings = drive.faults.warnings
        word = 0
        if not core.enabled or abs(core.precontrol_velocity - drive.channel.target) < 1e-9:
            word |= _RAMP_COMPLETED
        if not drive.torque.utilised:
            word |= _BELOW_TORQUE
        if speed < settings.speed_threshold_3_rpm:
            word |= _BELOW_3
        if speed <= settings.speed_threshold_2_rpm:
            word |= _BELOW_2
        if settings.variable_signal != "none" and self._variable() > settings.variable_threshold:
            word |= _VARIABLE
        if _MOTOR_TEMPERATURE not in warnings:
            word |= _COOL_MOTOR
        if _STAGE_TEMPERATURE not in warnings:
            word |= _NO_OVERLOAD
        if self.in_tolerance:
            word |= _DEVIATION
        if core.enabled:
            word |= _CONTROLS
        if drive.ready and not drive.faults.buffer.current:
            word |= _READY
        return word
