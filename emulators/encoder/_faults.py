"""What a test can do to the value of one encoder, whatever device reads it (C402-312)."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from emulators.encoder._encoder import RotaryEncoder


class EncoderFaults:
    """Fault methods of an encoder's value. The owner has the attribute named here."""

    __slots__ = ()

    if TYPE_CHECKING:
        encoder: RotaryEncoder

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
        """Count the other way round from the present position on; a control loop on it runs away."""
        self.encoder.reverse(reversed_direction)

    def lose_encoder_steps(self, every: int) -> None:
        """Miss one of `every` increments of the motion; 0 = none from now on."""
        self.encoder.lose_steps(every)
