"""CiA 406 (encoders), facts only: device types, bits of the parameters, alarms and warnings, object names.

Used by both sides of the wire and by decoders; nothing here has state.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import Final

PROFILE: Final = 406
"""Low word of 1000h, 0196h."""
PROFILE_VERSION: Final = 0x0301
"""Low word of 6507h: the version of the profile that is followed."""
UNSUPPORTED: Final = 0xFFFFFFFF
"""6508h and 650Bh: the device has no such number."""


class EncoderType(IntEnum):
    """High word of 1000h (C406-001)."""

    SINGLE_TURN = 1
    MULTI_TURN = 2
    SINGLE_TURN_COUNTING = 3
    INCREMENTAL_ROTARY = 4
    INCREMENTAL_ROTARY_COUNTING = 5
    INCREMENTAL_LINEAR = 6
    INCREMENTAL_LINEAR_COUNTING = 7
    ABSOLUTE_LINEAR = 8
    CYCLIC_LINEAR = 9
    MULTI_SENSOR = 10

    @property
    def linear(self) -> bool:
        """Whether it measures a length; the emulated multi-sensor device does."""
        return self >= EncoderType.INCREMENTAL_LINEAR

    @property
    def incremental(self) -> bool:
        """Whether the position starts at zero with the supply (C406-008)."""
        return EncoderType.INCREMENTAL_ROTARY <= self <= EncoderType.INCREMENTAL_LINEAR_COUNTING

    @property
    def device_type(self) -> int:
        """1000h."""
        return self << 16 | PROFILE


class OperatingParameter(IntFlag):
    """Bits of 6000h, mirrored in 6500h (C406-013, C406-035)."""

    CODE_SEQUENCE = 1 << 0
    """The position falls while the shaft turns clockwise."""
    COMMISSIONING_DIAGNOSTICS = 1 << 1
    SCALING = 1 << 2
    MEASURING_DIRECTION = 1 << 3
    """Linear: the position falls in the direction in which it rose."""


class EncoderAlarm(IntFlag):
    """Bits of 6503h: the position cannot be relied on (C406-038)."""

    POSITION_ERROR = 1 << 0
    COMMISSIONING_DIAGNOSTICS = 1 << 1


class EncoderWarning(IntFlag):
    """Bits of 6505h: the position is valid (C406-040)."""

    FREQUENCY_EXCEEDED = 1 << 0
    LIGHT_CONTROL_RESERVE = 1 << 1
    CPU_WATCHDOG = 1 << 2
    OPERATING_TIME_LIMIT = 1 << 3
    BATTERY_CHARGE = 1 << 4
    REFERENCE_POINT_NOT_REACHED = 1 << 5


class AreaState(IntFlag):
    """Bits of 6400h (C406-033)."""

    OUT_OF_RANGE = 1 << 0
    OVERFLOW = 1 << 1
    UNDERFLOW = 1 << 2


OBJECT_NAMES: Final[dict[int, str]] = {
    0x6000: "Operating parameters",
    0x6001: "Measuring units per revolution",
    0x6002: "Total measuring range",
    0x6003: "Preset value",
    0x6004: "Position value",
    0x6005: "Linear measuring step settings",
    0x6008: "High precision position value",
    0x6009: "High precision preset value",
    0x600C: "Position raw value",
    0x6010: "Preset values of multi-sensor device",
    0x6020: "Position values of multi-sensor device",
    0x6030: "Speed value",
    0x6031: "Speed parameters",
    0x6040: "Acceleration value",
    0x6050: "Jerk value",
    0x6200: "Cyclic timer",
    0x6300: "CAM state register",
    0x6301: "CAM enable register",
    0x6302: "CAM polarity register",
    **{0x6310 + number: f"CAM {number + 1} low limit" for number in range(8)},
    **{0x6320 + number: f"CAM {number + 1} high limit" for number in range(8)},
    **{0x6330 + number: f"CAM {number + 1} hysteresis" for number in range(8)},
    0x6400: "Area state register",
    0x6401: "Work area low limit",
    0x6402: "Work area high limit",
    0x6500: "Operating status",
    0x6501: "Single-turn resolution",
    0x6502: "Number of distinguishable revolutions",
    0x6503: "Alarms",
    0x6504: "Supported alarms",
    0x6505: "Warnings",
    0x6506: "Supported warnings",
    0x6507: "Profile and software version",
    0x6508: "Operating time",
    0x6509: "Offset value",
    0x650A: "Module identification",
    0x650B: "Serial number",
    0x650C: "Offset values of multi-sensor device",
    0x650D: "Absolute accuracy",
    0x650E: "Device capability",
}
"""Names of the profile's objects. The numbers 6040h and others mean something else in a drive of CiA 402."""

HEXADECIMAL: Final = frozenset(
    (0x6000, 0x6300, 0x6301, 0x6302, 0x6400, 0x6500, 0x6503, 0x6504, 0x6505, 0x6506, 0x6507, 0x650E)
)
"""Objects that are words of bits."""

_FLAGS: Final[dict[int, type[IntFlag]]] = {
    0x6000: OperatingParameter,
    0x6400: AreaState,
    0x6500: OperatingParameter,
    0x6503: EncoderAlarm,
    0x6505: EncoderWarning,
}


def describe_flags(index: int, word: int) -> str:
    """Return the set bits of an object in words, comma-separated; empty when there is nothing to say."""
    flags = _FLAGS.get(index)
    if flags is not None:
        return ", ".join(flag.name.replace("_", " ").lower() for flag in flags if word & flag and flag.name)
    if 0x6300 <= index <= 0x6302:
        return ", ".join(f"cam {number + 1}" for number in range(8) if word >> number & 1)
    return ""
