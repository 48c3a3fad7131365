"""CiA 402, facts only: states, words, modes, option codes, error codes, object names.

Used by both sides of the wire and by decoders; nothing here has state.
"""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import Final

from fieldbus.cia402_texts import EMCY_TEXTS, OBJECT_NAMES

__all__ = [
    "EMCY_TEXTS",
    "MODE_NAMES",
    "OBJECT_NAMES",
    "STATE_BITS",
    "STATE_MASKS",
    "AbortConnectionOption",
    "Command",
    "Controlword",
    "DigitalInput",
    "DisableOperationOption",
    "DriveState",
    "FaultReactionOption",
    "HaltOption",
    "Mode",
    "QuickStopOption",
    "ShutdownOption",
    "Statusword",
    "decode_command",
    "decode_state",
    "describe_controlword",
    "describe_statusword",
    "emcy_text",
]


class DriveState(IntEnum):
    """State of the power drive system (C402-001 to C402-017)."""

    NOT_READY_TO_SWITCH_ON = 0
    SWITCH_ON_DISABLED = 1
    READY_TO_SWITCH_ON = 2
    SWITCHED_ON = 3
    OPERATION_ENABLED = 4
    QUICK_STOP_ACTIVE = 5
    FAULT_REACTION_ACTIVE = 6
    FAULT = 7

    @classmethod
    def decode(cls, statusword: int) -> DriveState:
        """Return the state that a statusword shows; see `decode_state`."""
        return _STATE_OF_BITS[statusword & 0x6F]

    @property
    def bits(self) -> int:
        """Statusword bits 6, 5, 3, 2, 1, 0 of the state."""
        return STATE_BITS[self]

    @property
    def text(self) -> str:
        """Name as the profile writes it."""
        return self.name.replace("_", " ").capitalize()


STATE_MASKS: Final[dict[DriveState, tuple[int, int]]] = {
    DriveState.NOT_READY_TO_SWITCH_ON: (0x4F, 0x00),
    DriveState.SWITCH_ON_DISABLED: (0x4F, 0x40),
    DriveState.READY_TO_SWITCH_ON: (0x6F, 0x21),
    DriveState.SWITCHED_ON: (0x6F, 0x23),
    DriveState.OPERATION_ENABLED: (0x6F, 0x27),
    DriveState.QUICK_STOP_ACTIVE: (0x6F, 0x07),
    DriveState.FAULT_REACTION_ACTIVE: (0x4F, 0x0F),
    DriveState.FAULT: (0x4F, 0x08),
}
"""State -> (mask, value): the statusword shows the state when `statusword & mask == value`."""

STATE_BITS: Final[dict[DriveState, int]] = {
    DriveState.NOT_READY_TO_SWITCH_ON: 0x00,
    DriveState.SWITCH_ON_DISABLED: 0x40,
    DriveState.READY_TO_SWITCH_ON: 0x21,
    DriveState.SWITCHED_ON: 0x23,
    DriveState.OPERATION_ENABLED: 0x27,
    DriveState.QUICK_STOP_ACTIVE: 0x07,
    DriveState.FAULT_REACTION_ACTIVE: 0x0F,
    DriveState.FAULT: 0x08,
}
"""What a drive puts into statusword bits 6, 5, 3, 2, 1 and 0 (bit 5 as 0 where the profile leaves it open).
"""


def _state_of(bits: int) -> DriveState:
    for state, (mask, value) in STATE_MASKS.items():
        if bits & mask == value:
            return state
    # Patterns that the profile does not define: a fault bit counts, the rest shows no state.
    return DriveState.FAULT if bits & 0x08 else DriveState.NOT_READY_TO_SWITCH_ON


_STATE_OF_BITS: Final = tuple(_state_of(bits) for bits in range(0x70))


def decode_state(statusword: int) -> DriveState:
    """Return the state that a statusword shows.

    Undefined bit patterns are `FAULT` with bit 3 and `NOT_READY_TO_SWITCH_ON` without; no word raises.
    """
    return _STATE_OF_BITS[statusword & 0x6F]


class Statusword(IntFlag):
    """Bits of 6041h (C402-039 to C402-048); names of bits 10, 12, 13 that depend on the mode are aliases."""

    READY_TO_SWITCH_ON = 1 << 0
    SWITCHED_ON = 1 << 1
    OPERATION_ENABLED = 1 << 2
    FAULT = 1 << 3
    VOLTAGE_ENABLED = 1 << 4
    QUICK_STOP = 1 << 5
    """0 = quick stop is active."""
    SWITCH_ON_DISABLED = 1 << 6
    WARNING = 1 << 7
    MANUFACTURER_8 = 1 << 8
    REMOTE = 1 << 9
    TARGET_REACHED = 1 << 10
    INTERNAL_LIMIT = 1 << 11
    MODE_12 = 1 << 12
    MODE_13 = 1 << 13
    MANUFACTURER_14 = 1 << 14
    MANUFACTURER_15 = 1 << 15

    SETPOINT_ACKNOWLEDGE = 1 << 12
    """Profile position."""
    SPEED_ZERO = 1 << 12
    """Profile velocity."""
    HOMING_ATTAINED = 1 << 12
    """Homing."""
    FOLLOWS_COMMAND = 1 << 12
    """Cyclic synchronous modes."""
    FOLLOWING_ERROR = 1 << 13
    """Profile position, cyclic synchronous position."""
    MAX_SLIPPAGE = 1 << 13
    """Profile velocity."""
    HOMING_ERROR = 1 << 13
    """Homing."""


class Controlword(IntFlag):
    """Bits of 6040h (C402-032 to C402-038); names of bits 4, 5, 6 that depend on the mode are aliases."""

    SWITCH_ON = 1 << 0
    ENABLE_VOLTAGE = 1 << 1
    QUICK_STOP = 1 << 2
    """0 = quick stop demanded."""
    ENABLE_OPERATION = 1 << 3
    MODE_4 = 1 << 4
    MODE_5 = 1 << 5
    MODE_6 = 1 << 6
    FAULT_RESET = 1 << 7
    HALT = 1 << 8
    CHANGE_ON_SETPOINT = 1 << 9

    NEW_SETPOINT = 1 << 4
    """Profile position."""
    ENABLE_RAMP = 1 << 4
    """Velocity mode."""
    HOMING_START = 1 << 4
    """Homing."""
    ENABLE_INTERPOLATION = 1 << 4
    """Interpolated position."""
    CHANGE_IMMEDIATELY = 1 << 5
    """Profile position."""
    UNLOCK_RAMP = 1 << 5
    """Velocity mode."""
    RELATIVE = 1 << 6
    """Profile position."""
    REFERENCE_RAMP = 1 << 6
    """Velocity mode."""


class Command(IntEnum):
    """Controlwords of the state machine's commands (C402-018 to C402-025)."""

    DISABLE_VOLTAGE = 0x0000
    QUICK_STOP = 0x0002
    SHUTDOWN = 0x0006
    SWITCH_ON = 0x0007
    """Also "disable operation" in Operation enabled."""
    ENABLE_OPERATION = 0x000F
    FAULT_RESET = 0x0080


def decode_command(controlword: int) -> Command:
    """Return the command in bits 3..0 and 7 of a controlword (C402-018 to C402-025)."""
    if controlword & 0x80:
        return Command.FAULT_RESET
    if not controlword & 0x02:
        return Command.DISABLE_VOLTAGE
    if not controlword & 0x04:
        return Command.QUICK_STOP
    if not controlword & 0x01:
        return Command.SHUTDOWN
    return Command.ENABLE_OPERATION if controlword & 0x08 else Command.SWITCH_ON


class Mode(IntEnum):
    """Values of 6060h and 6061h (C402-078 to C402-088)."""

    NONE = 0
    PROFILE_POSITION = 1
    VELOCITY = 2
    PROFILE_VELOCITY = 3
    PROFILE_TORQUE = 4
    HOMING = 6
    INTERPOLATED_POSITION = 7
    CYCLIC_SYNC_POSITION = 8
    CYCLIC_SYNC_VELOCITY = 9
    CYCLIC_SYNC_TORQUE = 10
    CYCLIC_SYNC_TORQUE_ANGLE = 11

    @property
    def supported_bit(self) -> int:
        """Mask of the mode in 6502h; 0 for `NONE`."""
        return 1 << (self - 1) if self else 0

    @property
    def short(self) -> str:
        """Abbreviation of the profile: pp, vl, pv, tq, hm, ip, csp, csv, cst, cstca; "none" for 0."""
        return MODE_NAMES[self]


MODE_NAMES: Final[dict[int, str]] = {
    0: "none",
    1: "pp",
    2: "vl",
    3: "pv",
    4: "tq",
    6: "hm",
    7: "ip",
    8: "csp",
    9: "csv",
    10: "cst",
    11: "cstca",
}


class AbortConnectionOption(IntEnum):
    """6007h: reaction to lost communication (C402-049 to C402-052)."""

    NO_ACTION = 0
    FAULT = 1
    DISABLE_VOLTAGE = 2
    QUICK_STOP = 3


class QuickStopOption(IntEnum):
    """605Ah (C402-053 to C402-058); 5 to 8 stay in Quick stop active."""

    DISABLE = 0
    SLOW_DOWN_RAMP = 1
    QUICK_STOP_RAMP = 2
    CURRENT_LIMIT = 3
    VOLTAGE_LIMIT = 4
    SLOW_DOWN_RAMP_STAY = 5
    QUICK_STOP_RAMP_STAY = 6
    CURRENT_LIMIT_STAY = 7
    VOLTAGE_LIMIT_STAY = 8


class ShutdownOption(IntEnum):
    """605Bh (C402-059, C402-060)."""

    DISABLE = 0
    SLOW_DOWN_RAMP = 1


class DisableOperationOption(IntEnum):
    """605Ch (C402-061, C402-062)."""

    DISABLE = 0
    SLOW_DOWN_RAMP = 1


class HaltOption(IntEnum):
    """605Dh (C402-063 to C402-066)."""

    SLOW_DOWN_RAMP = 1
    QUICK_STOP_RAMP = 2
    CURRENT_LIMIT = 3
    VOLTAGE_LIMIT = 4


class FaultReactionOption(IntEnum):
    """605Eh (C402-067 to C402-071)."""

    DISABLE = 0
    SLOW_DOWN_RAMP = 1
    QUICK_STOP_RAMP = 2
    CURRENT_LIMIT = 3
    VOLTAGE_LIMIT = 4


class DigitalInput(IntFlag):
    """Bits of 60FDh (C402-168); 1 = active."""

    NEGATIVE_LIMIT = 1 << 0
    POSITIVE_LIMIT = 1 << 1
    HOME = 1 << 2
    INTERLOCK = 1 << 3


def describe_statusword(word: int) -> str:
    """Return state and remarkable bits of a statusword in words."""
    parts = [decode_state(word).text]
    if word & Statusword.WARNING:
        parts.append("warning")
    if word & Statusword.INTERNAL_LIMIT:
        parts.append("internal limit")
    if not word & Statusword.VOLTAGE_ENABLED:
        parts.append("no voltage")
    return ", ".join(parts)


def describe_controlword(word: int) -> str:
    """Return the command of a controlword in words."""
    text = decode_command(word).name.replace("_", " ").lower()
    return f"{text}, halt" if word & Controlword.HALT else text


def emcy_text(code: int) -> str:
    """Return the meaning of an EMCY error code, of its group when the code itself is not known."""
    text = EMCY_TEXTS.get(code)
    if text is not None:
        return text
    for mask in (0xFFF0, 0xFF00, 0xF000):
        text = EMCY_TEXTS.get(code & mask)
        if text is not None:
            return text
    return "manufacturer-specific" if code >= 0xFF00 else "unknown error"
