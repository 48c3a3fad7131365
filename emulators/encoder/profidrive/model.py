"""The encoder model behind a format."""

from __future__ import annotations

from typing import TYPE_CHECKING

from emulators.encoder._encoder import AbsoluteEncoder, IncrementalEncoder, RotaryEncoder
from emulators.encoder.profidrive.format import EncoderFormat

if TYPE_CHECKING:
    import numpy as np


def encoder_model(
    form: EncoderFormat,
    *,
    zero_mark: int = 0,
    reversed_direction: bool = False,
    mounting_offset: int = 0,
    rng: np.random.Generator | None = None,
) -> RotaryEncoder:
    """Return a new model that counts as a format says; the whole of a linear scale is a revolution of it.

    Args:
        form: The format.
        zero_mark: Place of the zero mark, increments of the model.
        reversed_direction: Counts the other way round.
        mounting_offset: Value at angle zero, increments; only for absolute encoders.
        rng: Source of the noise.

    Raises:
        ConfigurationError: A value is out of its range.

    """
    if form.absolute:
        return AbsoluteEncoder(
            turns=form.revolutions,
            mounting_offset=mounting_offset,
            counts_per_revolution=form.counts,
            reversed_direction=reversed_direction,
            zero_mark_counts=zero_mark,
            rng=rng,
        )
    return IncrementalEncoder(
        counts_per_revolution=form.counts,
        reversed_direction=reversed_direction,
        zero_mark_counts=zero_mark,
        rng=rng,
    )
