"""Faults and warnings of the emulated PROFIdrive axis, with their numbers, reactions
and EMCY codes (PD-133, PD-139).

The numbers are those under which such drives report these events; FAULT_CODE and WARN_CODE show them.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import Enum, IntEnum, StrEnum
from typing import Final, NamedTuple

from emulators.drive.profidrive.statemachine import Off


class Acknowledgement(Enum):
    """When a fault can be acknowledged (PD-139)."""

    IMMEDIATELY = "immediately"
    PULSE_INHIBIT = "pulse inhibit"
    POWER_ON = "power on"


class Diagnosis(StrEnum):
    """Class of a fault in the diagnosis on the bus (PD-140)."""

    HARDWARE = "hardware or software"
    MAINS = "mains"
    SUPPLY_VOLTAGE = "supply voltage"
    DC_LINK_OVERVOLTAGE = "DC link overvoltage"
    POWER_ELECTRONICS = "power electronics"
    OVERTEMPERATURE = "overtemperature"
    EARTH_FAULT = "earth fault"
    MOTOR_OVERLOAD = "motor overload"
    BUS = "bus"
    SAFETY = "safety"
    ENCODER_VALUE = "encoder value"
    INTERNAL_COMMUNICATION = "internal communication"
    INFEED = "infeed"
    BRAKE = "brake"
    FILTER = "filter"
    EXTERNAL = "external"
    TECHNOLOGY = "technology"
    ENGINEERING = "engineering"
    OTHER = "other"
    AUXILIARY = "auxiliary"


class Fault(NamedTuple):
    """One fault.

    Args:
        number: 1..65535.
        reaction: How the drive stops; NONE: it only reports.
        emcy: Code of the EMCY on CANopen.
        text: A few words.
        diagnosis: Its class.
        acknowledgement: When it can be acknowledged.

    """

    number: int
    reaction: Off
    emcy: int
    text: str
    diagnosis: Diagnosis = Diagnosis.OTHER
    acknowledgement: Acknowledgement = Acknowledgement.IMMEDIATELY


SAFE_STOP: Final = 1600
SETPOINT_TIMEOUT: Final = 1910
CLOCK_FAILURE: Final = 1911
SIGN_OF_LIFE: Final = 1912
MOTOR_TEMPERATURE: Final = 7011
EXTERNAL: Final = 7860
CONTROL_LOST: Final = 7220
POSITIONER_STANDSTILL: Final = 7450
POSITIONER_WINDOW: Final = 7451
FOLLOWING_ERROR: Final = 7452
CAM_NOT_FOUND: Final = 7458
MARK_NOT_FOUND: Final = 7459
END_OF_CAM_NOT_FOUND: Final = 7460
MINUS_CAM: Final = 7491
PLUS_CAM: Final = 7492
BLOCKED: Final = 7900
OVERSPEED: Final = 7901
MOTOR_OVERLOAD: Final = 7936
CAN_ERROR: Final = 8700
OVERCURRENT: Final = 30001
OVERVOLTAGE: Final = 30002
UNDERVOLTAGE: Final = 30003
STAGE_TEMPERATURE: Final = 30004
STAGE_OVERLOAD: Final = 30005
PHASE_LOSS: Final = 30011
SAFE_TORQUE_OFF: Final = 30600
HARDWARE: Final = 30662
ENCODER_SERIAL: Final = 31110
ENCODER_SIGNAL: Final = 31115
OF_THE_ENCODER: Final = frozenset({ENCODER_SERIAL, ENCODER_SIGNAL})
"""Faults that G1_ZSW reports too."""

_ROWS: Final = (
    Fault(SAFE_STOP, Off.OFF2, 0xFF81, "safe stop violated"),
    Fault(SETPOINT_TIMEOUT, Off.OFF3, 0x8100, "setpoints timed out"),
    Fault(CLOCK_FAILURE, Off.OFF1, 0x8700, "clock of isochronous operation failed"),
    Fault(SIGN_OF_LIFE, Off.OFF1, 0x8700, "sign of life of the controller failed"),
    Fault(MOTOR_TEMPERATURE, Off.OFF2, 0x4310, "motor overtemperature"),
    Fault(CONTROL_LOST, Off.OFF1, 0x8A20, "control by the controller was taken away"),
    Fault(POSITIONER_STANDSTILL, Off.OFF1, 0x8611, "positioner: the axis does not stand where it should"),
    Fault(POSITIONER_WINDOW, Off.OFF1, 0x8611, "positioner: the axis does not get into its window"),
    Fault(CAM_NOT_FOUND, Off.OFF1, 0x8613, "positioner: reference cam not found"),
    Fault(MARK_NOT_FOUND, Off.OFF1, 0x8613, "positioner: zero mark not found"),
    Fault(END_OF_CAM_NOT_FOUND, Off.OFF1, 0x8613, "positioner: end of the reference cam not found"),
    Fault(FOLLOWING_ERROR, Off.OFF1, 0x8611, "positioner: following error too great"),
    Fault(MINUS_CAM, Off.OFF3, 0x8612, "positioner: minus limit cam reached"),
    Fault(PLUS_CAM, Off.OFF3, 0x8612, "positioner: plus limit cam reached"),
    Fault(EXTERNAL, Off.OFF2, 0x9000, "external fault"),
    Fault(BLOCKED, Off.OFF2, 0x7121, "motor blocked"),
    Fault(OVERSPEED, Off.OFF2, 0x8480, "motor overspeed"),
    Fault(MOTOR_OVERLOAD, Off.OFF2, 0x2310, "motor overloaded"),
    Fault(CAN_ERROR, Off.OFF3, 0x8130, "communication on the bus failed"),
    Fault(OVERCURRENT, Off.OFF2, 0x2320, "overcurrent"),
    Fault(OVERVOLTAGE, Off.OFF2, 0x3210, "DC link overvoltage"),
    Fault(UNDERVOLTAGE, Off.OFF2, 0x3220, "DC link undervoltage"),
    Fault(STAGE_TEMPERATURE, Off.OFF2, 0x4210, "heat sink overtemperature"),
    Fault(STAGE_OVERLOAD, Off.OFF2, 0x2350, "power stage overloaded"),
    Fault(PHASE_LOSS, Off.OFF2, 0x3130, "mains phase missing"),
    Fault(HARDWARE, Off.OFF2, 0x5000, "hardware of the control unit"),
    Fault(SAFE_TORQUE_OFF, Off.OFF2, 0xFF80, "safe torque off"),
    Fault(ENCODER_SERIAL, Off.OFF2, 0x7320, "encoder: serial communication"),
    Fault(ENCODER_SIGNAL, Off.OFF2, 0x7305, "encoder: signal level too low"),
)

_D = Diagnosis
_DIAGNOSES: Final = {
    SAFE_STOP: _D.SAFETY,
    SAFE_TORQUE_OFF: _D.SAFETY,
    SETPOINT_TIMEOUT: _D.BUS,
    CLOCK_FAILURE: _D.BUS,
    SIGN_OF_LIFE: _D.BUS,
    CAN_ERROR: _D.BUS,
    CONTROL_LOST: _D.BUS,
    MOTOR_TEMPERATURE: _D.OVERTEMPERATURE,
    STAGE_TEMPERATURE: _D.OVERTEMPERATURE,
    EXTERNAL: _D.EXTERNAL,
    BLOCKED: _D.TECHNOLOGY,
    OVERSPEED: _D.TECHNOLOGY,
    FOLLOWING_ERROR: _D.TECHNOLOGY,
    MINUS_CAM: _D.TECHNOLOGY,
    PLUS_CAM: _D.TECHNOLOGY,
    POSITIONER_STANDSTILL: _D.TECHNOLOGY,
    POSITIONER_WINDOW: _D.TECHNOLOGY,
    CAM_NOT_FOUND: _D.TECHNOLOGY,
    MARK_NOT_FOUND: _D.TECHNOLOGY,
    END_OF_CAM_NOT_FOUND: _D.TECHNOLOGY,
    MOTOR_OVERLOAD: _D.MOTOR_OVERLOAD,
    OVERCURRENT: _D.POWER_ELECTRONICS,
    STAGE_OVERLOAD: _D.POWER_ELECTRONICS,
    OVERVOLTAGE: _D.DC_LINK_OVERVOLTAGE,
    UNDERVOLTAGE: _D.INFEED,
    PHASE_LOSS: _D.MAINS,
    HARDWARE: _D.HARDWARE,
    ENCODER_SERIAL: _D.ENCODER_VALUE,
    ENCODER_SIGNAL: _D.ENCODER_VALUE,
}
_ACKNOWLEDGED: Final = {
    ENCODER_SERIAL: Acknowledgement.PULSE_INHIBIT,
    ENCODER_SIGNAL: Acknowledgement.PULSE_INHIBIT,
    HARDWARE: Acknowledgement.POWER_ON,
}
"""Faults that cannot be acknowledged at once."""

CATALOGUE: Final = {
    row.number: row._replace(
        diagnosis=_DIAGNOSES.get(row.number, Diagnosis.OTHER),
        acknowledgement=_ACKNOWLEDGED.get(row.number, Acknowledgement.IMMEDIATELY),
    )
    for row in _ROWS
}
"""By number."""
_BY_EMCY: Final = {row.emcy: row for row in reversed(CATALOGUE.values())}
_MANUFACTURER: Final = 0xFF00


def fault(code: int) -> Fault:
    """Return the fault of a number, or of the EMCY code of one; any other number is a manufacturer's fault
    with OFF2.
    """
    row = CATALOGUE.get(code) or _BY_EMCY.get(code)
    if row is not None:
        return row
    warning = _WARNING_TEXTS.get(code)
    return Fault(code, Off.OFF2, _MANUFACTURER, f"fault {code}" if warning is None else warning)


class DriveWarning(IntEnum):
    """Warnings (PD-138), by number."""

    SAFE_TORQUE_OFF = 1699
    DSC_WITHOUT_CLOCK = 1932
    CHOPPER = 6905
    MOTOR_TEMPERATURE = 7910
    JOG_CONTRADICTION = 7457
    NOT_HOMED = 7461
    NO_SUCH_BLOCK = 7462
    INCONSISTENT_BLOCK = 7464
    NO_SUCCESSOR = 7465
    NO_JUMP_TARGET = 7468
    TARGET_BELOW_LIMIT = 7469
    TARGET_ABOVE_LIMIT = 7470
    OUTSIDE_MODULO_RANGE = 7471
    MOTOR_OVERLOAD = 7805
    STAGE_TEMPERATURE = 30502
    INJECTED = 7850
    MAINS_MISSING = 7840
    # Messages of the safety functions: they wait for a safe acknowledgement.
    SAFE_RAMP = 1706
    SAFE_STANDSTILL = 1707
    SAFE_SPEED = 1714
    SAFE_POSITION = 1715
    SAFE_DIRECTION = 1716
    SECOND_ENCODER = 32410


_WARNING_TEXTS: Final = {int(one): one.name.lower().replace("_", " ") for one in DriveWarning}
_RESTRICTED_SOON: Final = frozenset(
    {
        DriveWarning.CHOPPER,
        DriveWarning.MOTOR_TEMPERATURE,
        DriveWarning.MOTOR_OVERLOAD,
        DriveWarning.STAGE_TEMPERATURE,
        DriveWarning.MAINS_MISSING,
    }
)
_NOT_RESTRICTED: Final = frozenset({DriveWarning.JOG_CONTRADICTION, DriveWarning.INJECTED})


def alarm_class(numbers: Iterable[int]) -> int:
    """Return the class of the gravest warning (ZSW2 bits 5 and 6, PD-083).

    0 none, 1 operation is not restricted, 2 it will be if nothing changes, 3
    something does not work at present.
    """
    gravest = 0
    for number in numbers:
        rank = 1 if number in _NOT_RESTRICTED else 2 if number in _RESTRICTED_SOON else 3
        gravest = max(gravest, rank)
    return gravest


_NAMUR_BITS: Final = {
    _D.HARDWARE: 0,
    _D.MAINS: 1,
    _D.SUPPLY_VOLTAGE: 2,
    _D.DC_LINK_OVERVOLTAGE: 2,
    _D.POWER_ELECTRONICS: 3,
    _D.OVERTEMPERATURE: 4,
    _D.EARTH_FAULT: 5,
    _D.MOTOR_OVERLOAD: 6,
    _D.BUS: 7,
    _D.SAFETY: 8,
    _D.ENCODER_VALUE: 9,
    _D.INTERNAL_COMMUNICATION: 10,
    _D.INFEED: 11,
}
_NAMUR_OTHER: Final = 15


def namur_word(numbers: Iterable[int]) -> int:
    """Return MELD_NAMUR of present faults: a bit per class of diagnosis, bit 15 for
    all other ones (PD-009, PD-140).
    """
    word = 0
    for number in numbers:
        word |= 1 << _NAMUR_BITS.get(fault(number).diagnosis, _NAMUR_OTHER)
    return word
