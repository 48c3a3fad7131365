"""Encoders: resolution, kinds, zero mark, faults."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.encoder import AbsoluteEncoder, IncrementalEncoder
from fieldbus.errors import ConfigurationError

TAU = 2 * math.pi


def test_increments_are_the_nearest_whole_number():
    """Position is the angle in increments, rounded to nearest."""
    encoder = IncrementalEncoder(counts_per_revolution=1000)
    for angle, expected in (
        (0.0, 0),
        (TAU, 1000),
        (-TAU / 4, -250),
        (1.4 * TAU / 1000, 1),
        (1.6 * TAU / 1000, 2),
    ):
        encoder.sample(angle)
        assert encoder.increments == expected


@pytest.mark.requirement("C406-008")
def test_incremental_encoder_starts_at_zero_and_absolute_keeps_its_position():
    """Power-on: incremental types start at 0, absolute types are valid at once."""
    incremental = IncrementalEncoder(counts_per_revolution=4096)
    absolute = AbsoluteEncoder(counts_per_revolution=4096, turns=16, mounting_offset=100)
    for encoder in (incremental, absolute):
        encoder.power_on(2.5 * TAU)
    assert incremental.increments == 0
    assert absolute.increments == 2.5 * 4096 + 100
    incremental.sample(3.5 * TAU)
    assert incremental.increments == 4096


def test_single_turn_encoder_knows_the_place_within_a_turn_only():
    """After power-on a single-turn encoder shows the angle within half a turn around zero."""
    encoder = AbsoluteEncoder(counts_per_revolution=4096, turns=1)
    encoder.power_on(5.25 * TAU)
    assert encoder.increments == 1024
    assert encoder.absolute_value == 1024
    encoder.sample(5.75 * TAU)
    assert encoder.increments == 3072  # counts on while powered
    encoder.power_on(5.75 * TAU)
    assert encoder.increments == -1024
    assert encoder.absolute_value == 3072


def test_coarse_encoder_shows_steps_to_the_control_loop():
    """Without interpolation the sampled angle is a multiple of the increment."""
    encoder = IncrementalEncoder(counts_per_revolution=8, interpolated=False)
    encoder.power_on(0.0)
    assert encoder.sample(0.3 * TAU) == pytest.approx(2 * TAU / 8)
    fine = IncrementalEncoder(counts_per_revolution=8)
    assert fine.sample(0.3 * TAU) == pytest.approx(0.3 * TAU)


@pytest.mark.requirement("C402-312")
def test_freeze_jump_and_reversal():
    """Frozen value, jump offset and direction are as injected, and the integer stays exact."""
    encoder = IncrementalEncoder(counts_per_revolution=1000)
    encoder.power_on(0.0)
    encoder.sample(TAU)
    encoder.freeze(True)
    assert encoder.sample(5 * TAU) == pytest.approx(TAU)
    assert encoder.increments == 1000
    encoder.freeze(False)
    assert encoder.sample(5 * TAU) == pytest.approx(5 * TAU)
    encoder.jump(-7)
    assert encoder.increments == 4993
    encoder.reverse(True)
    assert encoder.increments == 4993
    encoder.sample(6 * TAU)
    assert encoder.increments == 3993


def test_jump_of_an_absolute_encoder_survives_power_off():
    """A slipped absolute encoder is still slipped after power-on."""
    encoder = AbsoluteEncoder(counts_per_revolution=1000)
    encoder.power_on(0.0)
    encoder.jump(50)
    encoder.power_on(0.0)
    assert encoder.increments == 50


@pytest.mark.requirement("C402-312")
def test_noise_is_bounded_seeded_and_can_be_switched_off():
    """Noise of n steps stays within +-n, repeats with the seed and leaves no trace."""

    def samples(seed: int) -> list[int]:
        encoder = IncrementalEncoder(counts_per_revolution=1000, rng=np.random.default_rng(seed))
        encoder.set_noise(3)
        values = []
        for _ in range(200):
            encoder.sample(TAU)
            values.append(encoder.increments - 1000)
        encoder.set_noise(0)
        encoder.sample(TAU)
        assert encoder.increments == 1000
        return values

    first = samples(7)
    assert set(first) == set(range(-3, 4))
    assert first == samples(7)
    assert first != samples(8)


@pytest.mark.exhaustive
@settings(deadline=None)
@given(
    start=st.integers(-5000, 5000),
    step=st.floats(0.01, 0.9),
    mark=st.integers(0, 999),
    direction=st.sampled_from([-1, 1]),
    offset=st.integers(-3000, 3000),
)
def test_zero_mark_is_latched_exactly(start: int, step: float, mark: int, direction: int, offset: int):
    """The latch holds the exact position of the first zero mark passed, whatever speed and direction."""
    encoder = IncrementalEncoder(counts_per_revolution=1000, zero_mark_counts=mark)
    angle = (start + 0.3) * TAU / 1000
    encoder.sample(angle)
    encoder.jump(offset)
    encoder.arm_zero_mark()
    while encoder.latched_increments is None:
        angle += direction * step * TAU
        encoder.sample(angle)
    latched = encoder.latched_increments - offset
    assert latched % 1000 == mark
    travelled = (latched - (start + 0.3)) * direction
    assert 0.0 < travelled <= 1000.0


def test_missing_zero_mark():
    """Without zero mark the latch stays empty."""
    encoder = IncrementalEncoder(counts_per_revolution=1000)
    encoder.zero_mark_present = False
    encoder.arm_zero_mark()
    for turn in range(50):
        encoder.sample(turn * 0.37 * TAU)
    assert encoder.latched_increments is None


def test_impossible_encoders_are_refused():
    """Resolution, zero mark, turns and noise are checked."""
    for options in ({"counts_per_revolution": 2}, {"zero_mark_counts": 131072}):
        with pytest.raises(ConfigurationError):
            IncrementalEncoder(**options)
    with pytest.raises(ConfigurationError, match="turns"):
        AbsoluteEncoder(turns=0)
    with pytest.raises(ConfigurationError, match="rng"):
        IncrementalEncoder().set_noise(1)
    with pytest.raises(ConfigurationError):
        IncrementalEncoder(rng=np.random.default_rng(1)).set_noise(-1)


@pytest.mark.requirement("C402-312")
def test_a_wrong_scale_ends_where_it_has_led():
    """What is counted wrongly stays, also when the direction is turned meanwhile."""
    encoder = IncrementalEncoder(counts_per_revolution=1000)
    encoder.power_on(0.0)
    encoder.scale(0.5)
    encoder.sample(2.0 * math.pi)
    assert encoder.increments == 500
    encoder.reverse(True)
    assert encoder.increments == 500
    encoder.sample(4.0 * math.pi)
    assert encoder.increments == 0
    encoder.scale(1.0)
    encoder.sample(5.0 * math.pi)
    assert encoder.increments == -500
    with pytest.raises(ConfigurationError, match="factor"):
        encoder.scale(0.0)
