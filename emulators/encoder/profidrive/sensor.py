"""An encoder with the PROFIdrive interface, and what a test can do to it (PD-349, C402-312)."""

from __future__ import annotations

from typing import Final

from emulators.encoder._encoder import RotaryEncoder
from emulators.encoder.profidrive.interface import EncoderInterface
from fieldbus.errors import UnsupportedFaultError

NOT_VALID: Final = 0x0001


class ProfidriveSensor:
    """One encoder behind its interface Gx.

    Args:
        name: Name in messages.
        encoder: Encoder model.
        interface: Encoder interface.

    """

    def __init__(self, name: str, encoder: RotaryEncoder, interface: EncoderInterface) -> None:
        self.name = name
        self.encoder = encoder
        self.interface = interface

    def freeze_encoder(self, frozen: bool) -> None:
        """Let the value stand still, or follow the shaft again."""
        self.encoder.freeze(frozen)

    def jump_encoder(self, increments: int) -> None:
        """Shift the value by increments, as a slipped coupling does."""
        self.encoder.jump(increments)

    def set_encoder_noise(self, increments: int) -> None:
        """Disturb the value by -increments..+increments; 0 = off."""
        self.encoder.set_noise(increments)

    def reverse_encoder(self, reversed_direction: bool) -> None:
        """Count in the opposite direction from the present position on."""
        self.encoder.reverse(reversed_direction)

    def lose_encoder_steps(self, every: int) -> None:
        """Miss one of `every` increments of the motion; 0 = none from now on."""
        self.encoder.lose_steps(every)

    def suppress_index(self, missing: bool) -> None:
        """Suppress the zero mark, or show it again.

        Raises:
            UnsupportedFaultError: An absolute encoder has none.

        """
        if self.interface.form.absolute:
            raise UnsupportedFaultError(f"{self.name}: an absolute encoder has no index")
        self.encoder.zero_mark_present = not missing

    def set_encoder_error(self, code: int, active: bool) -> None:
        """Bring about the cause of an error of Gx_XIST2, or end it; see `EncoderInterface.set_error`.

        Raises:
            ConfigurationError: There is no such code.

        """
        if active:
            self.interface.set_error(code)
        else:
            self.interface.clear_error(code)

    def break_encoder_wire(self, broken: bool) -> None:
        """Cut the wire: the value stands, Gx_ZSW says so (0001h); or repair it."""
        self.encoder.freeze(broken)
        self.set_encoder_error(NOT_VALID, broken)
