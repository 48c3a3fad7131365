"""Status words of the axis (PD-060 to PD-085)."""

from __future__ import annotations

from typing import Final

from emulators.drive.core import RPM, ServoCore
from emulators.drive.profidrive.config import DriveSettings
from emulators.drive.profidrive.data_sets import DataSets
from emulators.drive.profidrive.faults.catalogue import DriveWarning, alarm_class
from emulators.drive.profidrive.faults.state import FaultState
from emulators.drive.profidrive.modes import OperatingMode
from emulators.drive.profidrive.modes.speed import SpeedDeviation
from emulators.drive.profidrive.operation import Operation
from emulators.drive.profidrive.process_data import ProcessData
from emulators.drive.profidrive.safety.state import SafetyState
from emulators.drive.profidrive.statemachine import AxisState, Off
from emulators.drive.profidrive.torque import TorqueLimits
from fieldbus.profidrive.sign_of_life import SignOfLife
from fieldbus.profidrive.words import MELDW, SIGN_OF_LIFE_SHIFT, ZSW1, ZSW2

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


class StatusWords:
    """Forms ZSW1, ZSW2 and MELDW.

    Args:
        core: Servo core.
        settings: Parameters in effect.
        data: Control words in effect.
        operation: State machine.
        mode: Operating mode; some bits of ZSW1 are its own.
        faults: Faults and warnings.
        safety: Safety functions in effect.
        torque: Torque limits.
        deviation: Deviation of the speed.
        signs: Sign of life of the drive.
        data_sets: Data set in effect.
        operation_while_braking: ZSW1 bit 2 stays 1 during a stop ramp.

    """

    def __init__(
        self,
        core: ServoCore,
        settings: DriveSettings,
        data: ProcessData,
        *,
        operation: Operation,
        mode: OperatingMode,
        faults: FaultState,
        safety: SafetyState,
        torque: TorqueLimits,
        deviation: SpeedDeviation,
        signs: SignOfLife,
        data_sets: DataSets,
        operation_while_braking: bool,
    ) -> None:
        self._core = core
        self._settings = settings
        self._data = data
        self._operation = operation
        self._machine = operation.machine
        self._mode = mode
        self._faults = faults
        self._safety = safety
        self._torque = torque
        self._deviation = deviation
        self._signs = signs
        self._data_sets = data_sets
        self._while_braking = operation_while_braking
        self._frozen: int | None = None
        self._set = 0
        self._cleared = 0
        self._sign: int | None = None

    # -- overridden bits -------------------------------------------------------------------------------

    def freeze(self, frozen: bool) -> None:
        """Let ZSW1 show what it shows now, whatever happens."""
        self._frozen = self._true_zsw1() if frozen else None

    def freeze_sign_of_life(self, frozen: bool) -> None:
        """Let the drive's sign of life stand still, or count again."""
        self._sign = self._signs.value if frozen else None

    def override_bits(self, *, set_bits: int = 0, clear_bits: int = 0) -> None:
        """Show bits of ZSW1 as 1, or as 0, whatever they should be."""
        self._set = set_bits & 0xFFFF
        self._cleared = clear_bits & 0xFFFF

    # -- words -----------------------------------------------------------------------------------------

    def zsw1(self) -> int:
        """Return ZSW1, or what a test makes of it."""
        word = self._true_zsw1() if self._frozen is None else self._frozen
        return (word | self._set) & ~self._cleared & 0xFFFF

    def _true_zsw1(self) -> int:
        if not self._data.controlled_cyclically:
            return 0
        machine = self._machine
        state = machine.state
        word = machine.bits | _REQUESTED
        faults = self._faults
        off = faults.off | self._safety.off
        stw1 = self._data.stw1
        if stw1 & 0x0002 and not off & _OFF2:
            word |= _NO_OFF2
        if stw1 & 0x0004 and not (off & _OFF3 or self._safety.holding) and state is not _S5B:
            word |= _NO_OFF3
        if faults.buffer.current:
            word |= _FAULT
        if faults.warnings:
            word |= _WARNING
        word |= self._mode.zsw1()
        if self._while_braking and state in (AxisState.S5A, AxisState.S5B):
            word |= _OPERATION
        return word

    def zsw2(self) -> int:
        """Return ZSW2 with the drive's sign of life."""
        sign = self._signs.value if self._sign is None else self._sign
        sets = self._data_sets
        word = sign << SIGN_OF_LIFE_SHIFT | sets.active
        if sets.changing:
            word |= _CHANGEOVER
        if self._faults.warnings:
            word |= alarm_class(self._faults.warnings) << _ALARM_CLASS_SHIFT
        if self._core.enabled:
            word |= _PULSES
        if self._operation.parked:
            word |= _PARKING
        if self._torque.at_fixed_stop:
            word |= _FIXED_STOP
        return word

    def _variable(self) -> float:
        """Return the amount of the signal that MELDW bit 5 watches: Nm, or rpm."""
        core = self._core
        return abs(core.torque if self._settings.variable_signal == "torque" else core.velocity / RPM)

    def meldw(self) -> int:
        """Return the message word (PD-085)."""
        core = self._core
        settings = self._settings
        speed = abs(core.velocity) / RPM
        warnings = self._faults.warnings
        word = 0
        if not core.enabled or abs(core.precontrol_velocity - self._mode.channel.target) < 1e-9:
            word |= _RAMP_COMPLETED
        if not self._torque.utilised:
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
        if self._deviation.in_tolerance:
            word |= _DEVIATION
        if core.enabled:
            word |= _CONTROLS
        if self._operation.ready and not self._faults.buffer.current:
            word |= _READY
        return word
