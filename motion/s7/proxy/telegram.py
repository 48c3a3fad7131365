"""The telegram with a leading value, 48 bytes like `DX_TEL_SyncOp` (SYN-072).

The vendor does not publish what is in it; the layout is a choice of this product.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from struct import Struct
from typing import Final

_LAYOUT: Final = Struct("<BBHIddddd")
LENGTH: Final = _LAYOUT.size
VERSION: Final = 1
_VALID, _MODULO, _CONTROL = 1, 2, 4
LARGEST: Final = 1e12
"""Greatest magnitude of a position, velocity or acceleration."""

BAD_VERSION, BAD_START, BAD_LENGTH, BAD_SIGN, BAD_POSITION, BAD_VELOCITY, BAD_ACCELERATION = range(1, 8)
"""Causes of alarm 901 (SYN-466)."""


@dataclass(slots=True)
class LeadingTelegram:
    """A leading value on its way to another controller.

    Args:
        position: Position unit of the leading object.
        velocity: Position unit per second.
        acceleration: Position unit per second squared.
        sign_of_life: Counts from telegram to telegram, 0 to 65535.
        delay_us: Delay that the local followers of the leading object have, us.
        modulo_start: Start of its modulo range.
        modulo_length: Length of it; 0 without one.
        valid: The value can be followed.
        control: The leading object forms setpoints.
        version: Version of the layout.

    """

    position: float
    velocity: float
    acceleration: float
    sign_of_life: int = 0
    delay_us: int = 0
    modulo_start: float = 0.0
    modulo_length: float = 0.0
    valid: bool = True
    control: bool = True
    version: int = VERSION

    def encode(self) -> bytes:
        """Return the bytes of the telegram."""
        flags = _VALID * self.valid | _MODULO * (self.modulo_length > 0.0) | _CONTROL * self.control
        return _LAYOUT.pack(
            self.version, flags, self.sign_of_life, self.delay_us, self.position, self.velocity,
            self.acceleration, self.modulo_start, self.modulo_length,
        )  # fmt: skip

    @classmethod
    def decode(cls, data: bytes) -> LeadingTelegram:
        """Return the content of a telegram of `LENGTH` bytes; `fault` says whether it makes sense."""
        version, flags, sign, delay, position, velocity, acceleration, start, length = _LAYOUT.unpack(data)
        return cls(
            position, velocity, acceleration, sign, delay, start, length,
            valid=bool(flags & _VALID), control=bool(flags & _CONTROL), version=version,
        )  # fmt: skip

    def fault(self) -> int:
        """Return what is wrong with the content, as alarm 901 numbers it; 0 for nothing."""
        if self.version != VERSION:
            return BAD_VERSION
        for cause, value in (
            (BAD_START, self.modulo_start),
            (BAD_LENGTH, self.modulo_length),
            (BAD_POSITION, self.position),
            (BAD_VELOCITY, self.velocity),
            (BAD_ACCELERATION, self.acceleration),
        ):
            if not isfinite(value) or abs(value) > LARGEST or (cause == BAD_LENGTH and value < 0.0):
                return cause
        return 0
