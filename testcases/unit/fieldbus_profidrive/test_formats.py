"""Normalised values: the numbers of the specification, and what must never happen."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.profidrive import from_n2, from_n4, to_kpc, to_n2, to_n4, torque_factor


@pytest.mark.requirement("PD-033", "PTO-040", "PTO-042", "PTO-043", "CFG-245")
@pytest.mark.parametrize(
    ("fraction", "word"),
    [(1.0, 0x4000), (-1.0, -0x4000), (0.0, 0), (0.5, 0x2000), (-2.0, -0x8000), (0x7FFF / 0x4000, 0x7FFF)],
)
def test_n2(fraction, word):
    """4000h is 100 %; the ends are -200 % and just below +200 %."""
    assert to_n2(fraction) == word
    assert from_n2(word) == fraction


@pytest.mark.requirement("PD-034", "PD-035", "CFG-245")
@pytest.mark.parametrize(
    ("rpm", "word"), [(1500.0, 0x2000_0000), (-1500.0, 0xE000_0000 - (1 << 32)), (3000.0, 0x4000_0000)]
)
def test_n4(rpm, word):
    """The worked numbers at a reference speed of 3000 rpm; the high word of N4 is N2."""
    assert to_n4(rpm / 3000.0) == word
    assert from_n4(word) * 3000.0 == rpm
    assert word >> 16 == to_n2(rpm / 3000.0)


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-036", "CFG-246")
@given(st.floats(allow_nan=True, allow_infinity=True))
def test_values_beyond_the_range_are_held(fraction):
    """Whatever is calculated, the word keeps its sign and never wraps; what is no number is zero."""
    for convert, one, low, high in (
        (to_n2, 0x4000, -0x8000, 0x7FFF),
        (to_n4, 1 << 30, -(1 << 31), (1 << 31) - 1),
    ):
        word = convert(fraction)
        assert low <= word <= high
        if math.isnan(fraction):
            assert word == 0
        elif abs(fraction) < 1.9:
            assert abs(word - fraction * one) <= 0.5
        else:
            assert (word > 0) is (fraction > 0)


@pytest.mark.requirement("PD-037")
@pytest.mark.parametrize(
    ("momred", "evaluation", "left"),
    [
        (0, 100.0, 1.0),
        (0x4000, 100.0, 0.0),
        (0x2000, 100.0, 0.5),
        (0x4000, 50.0, 0.5),
        (0x7FFF, 100.0, 0.0),
        (-5, 100.0, 1.0),
    ],
)
def test_torque_reduction(momred, evaluation, left):
    """MOMRED takes its share of the torque limits away, never more than all of them."""
    assert torque_factor(momred, evaluation) == pytest.approx(left)


@pytest.mark.requirement("PD-042")
def test_position_gain():
    """KPC is in thousandths of 1/s, from 0 to 4000 1/s."""
    assert [to_kpc(gain) for gain in (10.0, 0.0005, 0.0, -1.0, 4000.0, 1e9, math.nan)] == [
        10_000,
        0,
        0,
        0,
        4_000_000,
        4_000_000,
        0,
    ]
