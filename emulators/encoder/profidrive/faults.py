"""What a test can do to an encoder with the PROFIdrive interface (PD-349, C402-312)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from fieldbus.errors import UnsupportedFaultError

if TYPE_CHECKING:
    from emulators.encoder._encoder import RotaryEncoder
    from emulators.encoder.profidrive.interface import EncoderInterface

NOT_VALID: Final = 0x0001


class SensorFaults:
    """Doors for faults of one encoder. The owner has the attributes named here."""

    __slots__ = ()

    if TYPE_CHECKING:
        name: str
        encoder: RotaryEncoder
        interface: EncoderInterface

    def freeze_encoder(self, frozen: bool) -> None:
        """Let the value stand still, or follow the machine again."""
        self.encoder.freeze(frozen)

    def jump_encoder(self, increments: int) -> None:
        """Shift the value by increments of Gx_XIST1, as a slipped coupling does."""
        self.encoder.jump(increments)

    def set_encoder_noise(self, increments: int) -> None:
        """Disturb the value by -increments..+increments; 0 = off."""
        self.encoder.set_noise(increments)

    def reverse_encoder(self, reversed_direction: bool) -> None:
        """Count the other way round from the present position on."""
        self.encoder.reverse(reversed_direction)

    def lose_encoder_steps(self, every: int) -> None:
        """Miss one of `every` increments of the motion; 0 = none from now on."""
        self.encoder.lose_steps(every)

    def miss_index(self, missing: bool) -> None:
        """Let the zero mark never come, or come again.

        Raises:
            UnsupportedFaultError: An absolute encoder has none.

        """
        if self.interface.form.absolute:
            raise UnsupportedFaultError(f"{self.name}: an absolute encoder has no index")
        self.encoder.zero_mark_present = not missing

    def set_encoder_error(self, code: int, active: bool) -> None:
        """Bring about the cause of an error of Gx_XIST2, or end it; see `EncoderInterface.fail`.

        Raises:
            ConfigurationError: There is no such code.

        """
        if active:
            self.interface.fail(code)
        else:
            self.interface.heal(code)

    def break_encoder(self, broken: bool) -> None:
        """Cut its wire: the value stands, Gx_ZSW says so (0001h); or mend it."""
        self.encoder.freeze(broken)
        self.set_encoder_error(NOT_VALID, broken)
