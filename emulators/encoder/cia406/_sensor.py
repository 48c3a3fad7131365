"""What senses: the encoder model behind a position channel, in raw steps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from emulators.encoder._encoder import AbsoluteEncoder, IncrementalEncoder, RotaryEncoder
from emulators.encoder._mounting import Mounting
from emulators.encoder._turn_counting import TurnCountingEncoder
from emulators.encoder.cia406.config import NM_PER_M, EncoderDeviceConfig
from fieldbus.cia406 import EncoderType

if TYPE_CHECKING:
    import numpy as np

_TAU: Final = 2.0 * math.pi
_BOUNDED: Final = (EncoderType.ABSOLUTE_LINEAR, EncoderType.MULTI_SENSOR)
"""Encoders that have no code to read beyond the ends of their scale."""


class Sensor:
    """Samples one mounting and counts.

    A linear scale is treated as a shaft that turns once over the length of the scale.

    Args:
        config: The encoder.
        mounting: Where it sits.
        place_m: Place of a sensor of a multi-sensor device along the scale, m.
        rng: Source of the noise; None: it cannot be made noisy.

    """

    def __init__(
        self,
        config: EncoderDeviceConfig,
        mounting: Mounting,
        *,
        place_m: float = 0.0,
        rng: np.random.Generator | None = None,
    ) -> None:
        self._mounting = mounting
        self._place = place_m
        kind = config.kind
        if kind.linear:
            counts = config.scale_steps
            length_m = counts * config.measuring_step_nm / NM_PER_M
            self._per_coordinate = _TAU / length_m
        else:
            counts = config.steps_per_revolution
            length_m = math.inf
            self._per_coordinate = 1.0
        self._length = length_m if kind in _BOUNDED else math.inf
        self.bounded = kind in _BOUNDED
        """Whether it can leave its scale."""
        self.encoder: RotaryEncoder = _model(config, counts, rng)
        """The model; its increments are not folded into the range."""

    @property
    def coordinate(self) -> float:
        """True position of the encoder, rad or m."""
        return self._mounting.coordinate() + self._place

    @property
    def coordinate_per_step(self) -> float:
        """Size of a raw step, rad or m."""
        return self.encoder.radians_per_increment / self._per_coordinate

    def read(self) -> int:
        """Sample now; returns the count, raw steps, not folded."""
        encoder = self.encoder
        encoder.sample((self._mounting.coordinate() + self._place) * self._per_coordinate)
        return encoder.increments

    @property
    def off_the_scale(self) -> bool:
        """Whether there is no code to read where the sensor stands; a code is read
        from half a step before it on.
        """
        half = 0.5 * self.coordinate_per_step
        return self.bounded and not -half <= self.coordinate < self._length - half

    def power_on(self) -> None:
        """Start as the kind of encoder does; an incremental one waits for its reference mark."""
        self.encoder.power_on(self.coordinate * self._per_coordinate)
        if isinstance(self.encoder, IncrementalEncoder):
            self.encoder.arm_zero_mark()

    def power_off(self) -> None:
        """Keep what the kind of encoder can keep without supply."""
        if isinstance(self.encoder, TurnCountingEncoder):
            self.encoder.power_off()

    @property
    def reference_reached(self) -> bool:
        """Whether an incremental encoder has passed its reference mark; an absolute one needs none."""
        return not isinstance(self.encoder, IncrementalEncoder) or self.encoder.latched_increments is not None


def _model(config: EncoderDeviceConfig, counts: int, rng: np.random.Generator | None) -> RotaryEncoder:
    kind = config.kind
    if kind.incremental:
        return IncrementalEncoder(
            counts_per_revolution=counts, zero_mark_counts=int(config.zero_mark * counts), rng=rng
        )
    if kind is EncoderType.SINGLE_TURN_COUNTING:
        return TurnCountingEncoder(counts_per_revolution=counts, rng=rng)
    return AbsoluteEncoder(turns=config.turns, counts_per_revolution=counts, rng=rng)
