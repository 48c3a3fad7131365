"""Encoder interface of an axis in its simple form: actual values, parking, error and its acknowledgement.

Reference marks, measuring on the fly and setting of the home position are answered with error 0F01h, "command not supported".
"""

from __future__ import annotations

from typing import Final

from emulators.encoder import AbsoluteEncoder, RotaryEncoder
from fieldbus.clock import MS
from fieldbus.profidrive.words import COMMAND_MASK, FUNCTION_MASK, G_STW, G_ZSW

NOT_VALID: Final = 0x0001
NOT_SUPPORTED: Final = 0x0F01
SIGN_OF_LIFE_FAILED: Final = 0x0F02
SHORTEST_PARKING_NS: Final = 100 * MS
"""Parking is shown for at least as long (PD-168)."""

_ABSOLUTE: Final = int(G_STW.ABSOLUTE_CYCLICALLY)
_PARK: Final = int(G_STW.PARK)
_ACKNOWLEDGE: Final = int(G_STW.ACKNOWLEDGE)
_REQUESTS: Final = COMMAND_MASK | FUNCTION_MASK | int(G_STW.SET_HOME)
_HALF: Final = 1 << 31
_FULL: Final = 1 << 32


class EncoderInterface:
    """G1_STW in, G1_ZSW, G1_XIST1 and G1_XIST2 out.

    Args:
        encoder: The encoder; its increments include the fine resolution of G1_XIST1.
        fine_xist1: p0418, bits of fine resolution in G1_XIST1.
        fine_xist2: p0419, bits of fine resolution in G1_XIST2.

    """

    __slots__ = ("_encoder", "_parked_ns", "_shift", "acknowledging", "error", "parking", "status", "valid", "xist1", "xist2")  # fmt: skip

    def __init__(self, encoder: RotaryEncoder, *, fine_xist1: int, fine_xist2: int) -> None:
        self._encoder = encoder
        self._shift = fine_xist1 - fine_xist2
        self.valid = True
        """False: the encoder gives no value (PD-175)."""
        self.reset()

    def reset(self) -> None:
        """Begin as after power-on (PD-150)."""
        self.error = 0
        """Code that is shown in G1_XIST2, 0 = none."""
        self.acknowledging = False
        self.parking = False
        self._parked_ns = 0
        self.status = 0
        """G1_ZSW."""
        self.xist1 = 0
        """G1_XIST1, signed 32 bit (PD-171)."""
        self.xist2 = 0
        """G1_XIST2, signed 32 bit."""

    def fail(self, code: int = NOT_VALID) -> None:
        """Report an error until it is acknowledged (PD-152)."""
        self.error = code

    def step(self, stw: int, now_ns: int) -> None:
        """Take G1_STW of this cycle and form the words of the answer (PD-347).

        Args:
            stw: Encoder control word in force.
            now_ns: Present time, ns.

        """
        if not (stw & ~_ABSOLUTE or self.error or self.parking or self.acknowledging) and self.valid:
            self._normal(stw)
        else:
            self._special(stw, now_ns)

    def _normal(self, stw: int) -> None:
        count = self._encoder.increments
        self.xist1 = (count + _HALF) % _FULL - _HALF
        encoder = self._encoder
        if stw & _ABSOLUTE and isinstance(encoder, AbsoluteEncoder):
            value = encoder.absolute_value
            value = value >> self._shift if self._shift >= 0 else value << -self._shift
            self.xist2 = (value + _HALF) % _FULL - _HALF
            self.status = G_ZSW.ABSOLUTE_CYCLICALLY.value
        else:
            self.xist2 = 0
            self.status = 0

    def _special(self, stw: int, now_ns: int) -> None:
        if stw & _PARK:
            if not self.parking:
                self.parking = True
                self._parked_ns = now_ns
                self.error = 0
                self.acknowledging = False
        elif self.parking and now_ns - self._parked_ns >= SHORTEST_PARKING_NS:
            self.parking = False
        if self.parking:
            self.status = G_ZSW.PARKING.value
            self.xist1 = self.xist2 = 0
            return
        if not self.valid and not self.error:
            self.error = NOT_VALID
        elif not self.error and not self.acknowledging:
            if stw & _REQUESTS:
                self.error = NOT_SUPPORTED
            elif stw & _ABSOLUTE and not isinstance(self._encoder, AbsoluteEncoder):
                self.error = 0x0008
        if stw & _ACKNOWLEDGE:
            if self.error:
                self.acknowledging = True
        elif self.acknowledging:
            self.acknowledging = False
            self.error = 0 if self.valid else NOT_VALID
        self._normal(0)
        if self.acknowledging:
            # What is still there goes on being shown (PD-164, PD-169).
            persists = not self.valid
            self.status = G_ZSW.ACKNOWLEDGING | (G_ZSW.ERROR if persists else 0)
            self.xist2 = NOT_VALID if persists else 0
        elif self.error:
            self.status = G_ZSW.ERROR.value
            self.xist2 = self.error
