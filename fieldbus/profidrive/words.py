"""Bits of the control and status words, by name, and their words for a trace
(PD-045 to PD-095, PD-141 to PD-149).

The masks are plain integers to the cycle: an `IntFlag` would make an object of every `&`.
"""

from __future__ import annotations

from enum import IntEnum
from types import MappingProxyType
from typing import Final


class STW1(IntEnum):
    """Control word 1 in speed mode (PD-045 to PD-059)."""

    ON = 0x0001
    NO_OFF2 = 0x0002
    NO_OFF3 = 0x0004
    ENABLE_OPERATION = 0x0008
    RAMP_ENABLE = 0x0010
    RAMP_RELEASE = 0x0020
    SETPOINT_ENABLE = 0x0040
    ACKNOWLEDGE = 0x0080
    JOG_1 = 0x0100
    JOG_2 = 0x0200
    CONTROL_BY_PLC = 0x0400
    BIT_11 = 0x0800
    OPEN_BRAKE = 0x1000
    BIT_13 = 0x2000
    BIT_14 = 0x4000
    BIT_15 = 0x8000
    # Positioning mode has other meanings for some of them (PD-049 to PD-057).
    NO_REJECT_TASK = 0x0010
    NO_INTERMEDIATE_STOP = 0x0020
    ACTIVATE_TASK = 0x0040
    START_HOMING = 0x0800
    EXTERNAL_BLOCK_CHANGE = 0x2000


class ZSW1(IntEnum):
    """Status word 1 in speed mode (PD-060 to PD-075)."""

    READY_TO_SWITCH_ON = 0x0001
    READY = 0x0002
    OPERATION_ENABLED = 0x0004
    FAULT = 0x0008
    NO_OFF2 = 0x0010
    NO_OFF3 = 0x0020
    SWITCHING_ON_INHIBITED = 0x0040
    WARNING = 0x0080
    DEVIATION_IN_TOLERANCE = 0x0100
    CONTROL_REQUESTED = 0x0200
    SPEED_REACHED = 0x0400
    TORQUE_LIMIT_NOT_REACHED = 0x0800
    BRAKE_OPEN = 0x1000
    NO_MOTOR_OVERTEMPERATURE = 0x2000
    POSITIVE_DIRECTION = 0x4000
    NO_POWER_UNIT_OVERLOAD = 0x8000
    # Positioning mode (PD-068 to PD-075).
    TARGET_REACHED = 0x0400
    HOME_POSITION_SET = 0x0800
    TASK_ACKNOWLEDGED = 0x1000
    STANDSTILL = 0x2000
    ACCELERATING = 0x4000
    DECELERATING = 0x8000


class STW2(IntEnum):
    """Control word 2 (PD-082); bits 0..4 are the data set, 12..15 the sign of life."""

    PARKING = 0x0080
    TRAVEL_TO_FIXED_STOP = 0x0100
    MOTOR_CHANGEOVER = 0x0800


class ZSW2(IntEnum):
    """Status word 2 (PD-083); bits 0..4 are the data set, 5..6 the alarm class, 12..15 the sign of life."""

    PARKING = 0x0080
    TRAVEL_TO_FIXED_STOP = 0x0100
    PULSES_ENABLED = 0x0400
    DATA_SET_CHANGEOVER = 0x0800


class MELDW(IntEnum):
    """Message word (PD-085)."""

    RAMP_COMPLETED = 0x0001
    TORQUE_BELOW_THRESHOLD = 0x0002
    SPEED_BELOW_THRESHOLD_3 = 0x0004
    SPEED_BELOW_THRESHOLD_2 = 0x0008
    VARIABLE_SIGNAL = 0x0020
    NO_MOTOR_OVERTEMPERATURE = 0x0040
    NO_POWER_UNIT_OVERLOAD = 0x0080
    DEVIATION_IN_TOLERANCE = 0x0100
    CONTROLLER_ENABLED = 0x0800
    READY = 0x1000
    PULSES_ENABLED = 0x2000


class POS_STW1(IntEnum):  # noqa: N801 - spelled as in the profile
    """Positioning control word 1 (PD-088); bits 0..6 select the block."""

    ABSOLUTE = 0x0100
    POSITIVE = 0x0200
    NEGATIVE = 0x0400
    CONTINUOUS = 0x1000
    SETUP = 0x4000
    MDI = 0x8000


class POS_STW2(IntEnum):  # noqa: N801
    """Positioning control word 2 (PD-089)."""

    TRACKING = 0x0001
    SET_REFERENCE_POINT = 0x0002
    REFERENCE_CAM = 0x0004
    INCREMENTAL_JOG = 0x0020
    PASSIVE_HOMING = 0x0100
    SEARCH_NEGATIVE = 0x0200
    PROBE_2 = 0x0400
    PROBE_FALLING = 0x0800
    SOFTWARE_LIMITS = 0x4000
    LIMIT_CAMS = 0x8000


class POS_ZSW1(IntEnum):  # noqa: N801
    """Positioning status word 1 (PD-090); bits 0..6 show the block."""

    MINUS_CAM = 0x0100
    PLUS_CAM = 0x0200
    JOG = 0x0400
    HOMING = 0x0800
    FLYING_HOMING = 0x1000
    BLOCKS = 0x2000
    SETUP = 0x4000
    MDI = 0x8000


class POS_ZSW2(IntEnum):  # noqa: N801
    """Positioning status word 2 (PD-091)."""

    TRACKING = 0x0001
    VELOCITY_LIMITED = 0x0002
    SETPOINT_STANDS = 0x0004
    FORWARD = 0x0010
    BACKWARD = 0x0020
    SOFTWARE_LIMIT_MINUS = 0x0040
    SOFTWARE_LIMIT_PLUS = 0x0080
    CAM_1 = 0x0100
    CAM_2 = 0x0200
    OUTPUT_1 = 0x0400
    OUTPUT_2 = 0x0800
    FIXED_STOP_REACHED = 0x1000
    CLAMPING_TORQUE_REACHED = 0x2000
    TRAVEL_TO_FIXED_STOP = 0x4000
    COMMAND_ACTIVE = 0x8000


class STW2_ENC(IntEnum):  # noqa: N801
    """Control word of an encoder of its own (PD-084); bits 12..15 are the sign of life."""

    ACKNOWLEDGE = 0x0080
    CONTROL_BY_PLC = 0x0400


class ZSW2_ENC(IntEnum):  # noqa: N801
    """Status word of an encoder of its own (PD-084); bits 12..15 are the sign of life."""

    FAULT = 0x0008
    WARNING = 0x0080
    CONTROL_REQUESTED = 0x0200


class G_STW(IntEnum):  # noqa: N801
    """Encoder control word (PD-141 to PD-149); bits 4..6 are the command."""

    FUNCTION_1 = 0x0001
    FUNCTION_2 = 0x0002
    FUNCTION_3 = 0x0004
    FUNCTION_4 = 0x0008
    MEASURE = 0x0080
    SHIFT_HOME = 0x0800
    SET_HOME = 0x1000
    ABSOLUTE_CYCLICALLY = 0x2000
    PARK = 0x4000
    ACKNOWLEDGE = 0x8000


class G_ZSW(IntEnum):  # noqa: N801
    """Encoder status word (PD-141 to PD-149)."""

    FUNCTION_1 = 0x0001
    FUNCTION_2 = 0x0002
    FUNCTION_3 = 0x0004
    FUNCTION_4 = 0x0008
    VALUE_1 = 0x0010
    VALUE_2 = 0x0020
    VALUE_3 = 0x0040
    VALUE_4 = 0x0080
    PROBE_1 = 0x0100
    PROBE_2 = 0x0200
    ACKNOWLEDGING = 0x0800
    HOME_SET = 0x1000
    ABSOLUTE_CYCLICALLY = 0x2000
    PARKING = 0x4000
    ERROR = 0x8000


class CU_STW1(IntEnum):  # noqa: N801
    """Control word of a control unit (PD-093); bits 12..15 are the sign of life."""

    CLOCK_PING = 0x0001
    ACKNOWLEDGE = 0x0080
    CONTROL_BY_PLC = 0x0400


class CU_ZSW1(IntEnum):  # noqa: N801
    """Status word of a control unit (PD-093); bits 12..15 are the sign of life."""

    FAULT = 0x0008
    ALARM = 0x0080
    TIME_SYNCHRONISED = 0x0100


class S_ZSW1B(IntEnum):  # noqa: N801
    """Status word 1 of the safety information channel (CFG-471 to CFG-493); bits
    9 and 10 are the level of SLS.
    """

    STO_ACTIVE = 0x0001
    SS1_ACTIVE = 0x0002
    SS2_ACTIVE = 0x0004
    SOS_ACTIVE = 0x0008
    SLS_ACTIVE = 0x0010
    SOS_SELECTED = 0x0020
    SLS_SELECTED = 0x0040
    INTERNAL_EVENT = 0x0080
    SLA_SELECTED = 0x0100
    SDI_POSITIVE_SELECTED = 0x1000
    SDI_NEGATIVE_SELECTED = 0x2000
    MESSAGE = 0x8000


class S_ZSW2B(IntEnum):  # noqa: N801
    """Status word 2 of the safety information channel (CFG-494 to CFG-496)."""

    SLP_RANGE_2 = 0x0010
    SLP_SELECTED = 0x0080
    SDI_POSITIVE_SELECTED = 0x0100
    SDI_NEGATIVE_SELECTED = 0x0200


class S_ZSW3B(IntEnum):  # noqa: N801
    """Status word 3 of the safety information channel (CFG-479)."""

    SS2E_ACTIVE = 0x0800


COMMAND_MASK: Final = 0x0070
"""Command in Gx_STW: 0 none, 1 activate, 2 read, 3 cancel."""
COMMAND_SHIFT: Final = 4
FUNCTION_MASK: Final = 0x000F
SIGN_OF_LIFE_MASK: Final = 0xF000
"""Bits 12..15 of STW2, ZSW2, STW2_ENC, ZSW2_ENC, CU_STW1, CU_ZSW1."""
SIGN_OF_LIFE_SHIFT: Final = 12

ENCODER_ERRORS: Final = MappingProxyType(
    {
        0x0001: "encoder group error, G1_XIST1 is not valid",
        0x0002: "zero mark monitoring",
        0x0003: "parking failed",
        0x0004: "reference mark search aborted",
        0x0005: "retrieval of the reference value aborted",
        0x0006: "measurement on the fly aborted",
        0x0007: "retrieval of the measured value aborted",
        0x0008: "transmission of the absolute value aborted or not supported",
        0x000A: "the track of the absolute value cannot be read",
        0x0F01: "command is not supported",
        0x0F02: "sign of life of the controller failed",
        0x0F04: "synchronisation failed",
        0x1001: "memory error",
    }
)
"""Codes in Gx_XIST2 while Gx_ZSW.15 is set (PD-175 to PD-187, PTO-262)."""

_FLAGS: Final[dict[str, type[IntEnum]]] = {
    "STW1": STW1,
    "ZSW1": ZSW1,
    "STW2": STW2,
    "ZSW2": ZSW2,
    "MELDW": MELDW,
    "STW2_ENC": STW2_ENC,
    "ZSW2_ENC": ZSW2_ENC,
    "POS_STW1": POS_STW1,
    "POS_STW2": POS_STW2,
    "POS_ZSW1": POS_ZSW1,
    "POS_ZSW2": POS_ZSW2,
    "G1_STW": G_STW,
    "G2_STW": G_STW,
    "G1_ZSW": G_ZSW,
    "G2_ZSW": G_ZSW,
    "CU_STW1": CU_STW1,
    "CU_ZSW1": CU_ZSW1,
    "S_ZSW1B": S_ZSW1B,
    "S_ZSW2B": S_ZSW2B,
    "S_ZSW3B": S_ZSW3B,
}
_WITH_SIGN_OF_LIFE: Final = frozenset({"STW2", "ZSW2", "STW2_ENC", "ZSW2_ENC", "CU_STW1", "CU_ZSW1"})


def describe_word(name: str, value: int) -> str:
    """Return a word of a telegram in hexadecimal and by the names of its bits; names of speed mode."""
    parts = [f"{value & 0xFFFF:04X}h"]
    flags = _FLAGS.get(name)
    if flags is not None:
        parts += [str(flag.name) for flag in flags if value & flag]
    if name in {"G1_STW", "G2_STW"} and value & COMMAND_MASK:
        parts.append(f"command {(value & COMMAND_MASK) >> COMMAND_SHIFT}")
    if name in _WITH_SIGN_OF_LIFE:
        parts.append(f"sign of life {(value & SIGN_OF_LIFE_MASK) >> SIGN_OF_LIFE_SHIFT}")
    return " ".join(parts)
