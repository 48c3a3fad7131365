"""Error codes of axes and blocks: cause, reaction, remedy (NC-730 to NC-752)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final

from motion.nc.data import load

if TYPE_CHECKING:
    from collections.abc import Mapping

NO_ERROR: Final = 0
POSITION_LAG: Final = 0x4550
TARGET_NOT_REACHED: Final = 0x435C
NO_MOVEMENT: Final = 0x435D
NO_CONTROLLER_ENABLE: Final = 0x4356
NO_FEED_MINUS: Final = 0x4357
NO_FEED_PLUS: Final = 0x4358
VELOCITY_NOT_ALLOWED: Final = 0x4359
MOVEMENT_TOO_SMALL: Final = 0x435A
LOOPING_TOO_SMALL: Final = 0x435E
CONSEQUENTIAL: Final = 0x43A0
EXTERNAL_ACTIVE: Final = 0x42E2
EXTERNAL_NOT_ACTIVE: Final = 0x42E3
STOP_ACTIVE: Final = 0x42EF
ENCODER_UNDERFLOW: Final = 0x4450
ENCODER_OVERFLOW: Final = 0x4451
LIMIT_MIN_AT_START: Final = 0x4460
LIMIT_MAX_AT_START: Final = 0x4461
LIMIT_MIN: Final = 0x4462
LIMIT_MAX: Final = 0x4463
LIMIT_MIN_INVALID: Final = 0x4423
LIMIT_MAX_INVALID: Final = 0x4424
ENCODER_FAULT: Final = 0x4464
INITIALISATION: Final = 0x4465
ENCODER_DATA_INVALID: Final = 0x4466
DRIVE_DATA_INVALID: Final = 0x4655
DRIVE_NOT_READY: Final = 0x4650
DRIVE_LIFE_COUNTER: Final = 0x4651
TABLE_CHANGE: Final = 0x4652
VELOCITY_LAG: Final = 0x4551
BLOCK_STOPPED: Final = 0x4B00
BLOCK_MODE: Final = 0x4B04
BLOCK_NOT_PERMITTED: Final = 0x4B05
BLOCK_PARAMETER: Final = 0x4B06


@dataclass(frozen=True)
class ErrorCode:
    """One error code.

    Args:
        code: The code.
        name: What it is called.
        condition: What makes it.
        reaction: refused, stop, shutdown of the axis, or an error of the block alone.
        remedy: What the user does about it.
        requirement: Identifier of its row in the specification.

    """

    code: int
    name: str
    condition: str
    reaction: str
    remedy: str
    requirement: str


@cache
def error_codes() -> Mapping[int, ErrorCode]:
    """Return all error codes by number."""
    found = (ErrorCode(**{**row, "code": int(row["code"], 16)}) for row in load("error_codes"))
    return {one.code: one for one in found}


def error_text(code: int) -> str:
    """Return a code with its name: `0x4550 (Position lag)`."""
    known = error_codes().get(code)
    return f"0x{code:04X} ({known.name})" if known is not None else f"0x{code:04X}"
