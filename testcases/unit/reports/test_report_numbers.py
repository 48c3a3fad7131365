"""Samples in the page: how few characters, how exact, which ones stay."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from reports.html.numbers import decode, encode, thin

pytestmark = pytest.mark.exhaustive


@given(hnp.arrays(np.float64, st.integers(0, 60), elements=st.floats(-1e9, 1e9)))
def test_samples_come_back_to_a_millionth_of_their_range(values):
    """Whatever the curve, no sample is off by more than a millionth of the range, or by what a float can
    resolve.
    """
    back = decode(json.loads(json.dumps(encode(values), allow_nan=False)))
    assert len(back) == len(values)
    if len(values):
        span = float(np.ptp(values))
        assert np.abs(back - values).max() <= max(1.001e-6 * span, 1e-14 * np.abs(values).max(), 1e-38)


@given(
    hnp.arrays(
        np.float64, st.integers(1, 40), elements=st.floats(allow_nan=True, allow_infinity=True, width=32)
    )
)
def test_gaps_stay_gaps(values):
    """NaN and infinities survive, in their places."""
    back = decode(encode(values))
    special = ~np.isfinite(values)
    if special.any():
        np.testing.assert_array_equal(back[special], values[special])
        finite = values[~special]
        if len(finite):
            tolerance = 1e-7 * float(np.ptp(finite)) + 1e-38
            np.testing.assert_allclose(back[~special], finite, rtol=1e-7, atol=tolerance)


@given(st.lists(st.integers(-(2**39), 2**39), min_size=1, max_size=40))
def test_counts_are_exact(numbers):
    """Encoder increments and words come back to the last digit, also beyond 32 bits of difference."""
    values = np.array(numbers, dtype=np.float64)
    np.testing.assert_array_equal(decode(encode(values)), values)


def test_a_time_axis_is_exact_to_the_microsecond_and_nearly_free():
    """A regular grid costs one character per sample."""
    time = np.arange(1500) * 0.004 + 0.00005
    plain = encode(time, 1e-6)
    assert plain["q"] == -6
    assert len(plain["d"]) == 1498
    assert np.abs(decode(plain) - time).max() < 1e-9


def test_constant_and_empty_signals_cost_nothing():
    """No digits where there is no change."""
    assert encode(np.full(1000, 3.5)) == {"n": 1000, "c": 3.5}
    assert encode(np.array([])) == {"n": 0, "c": 0}
    assert len(decode(encode(np.array([])))) == 0


@pytest.mark.parametrize("values", [[0.0, 1e300], [1e15, 1e15 + 1e-3], [0.0, 5e-324]])
def test_extreme_ranges_do_not_overflow(values):
    """Numbers too large or too close for the quantised form still encode."""
    array = np.array(values)
    plain = json.loads(json.dumps(encode(array)))
    with np.errstate(over="ignore"):
        np.testing.assert_allclose(
            decode(plain), array.astype(np.float32) if "f" in plain else array, rtol=1e-5, atol=1e-300
        )


def test_smooth_curve_costs_a_fraction_of_float32():
    """The reason of the whole exercise: 5.3 characters per sample become less than 2.5."""
    curve = 300 * np.sin(np.linspace(0, 12, 1500)) + np.linspace(0, 50, 1500)
    assert len(json.dumps(encode(curve))) < 2.5 * 1500


@given(
    hnp.arrays(np.float64, st.integers(500, 3000), elements=st.floats(-100, 100, width=16)),
    st.lists(st.floats(0, 3), max_size=6),
    st.integers(100, 400),
)
def test_thinning_keeps_extremes_ends_and_focus(values, focus, points):
    """The kept samples hold minimum, maximum, both ends and the neighbours of every moment of interest."""
    time = np.arange(len(values)) * 1e-3
    index = thin(time, values, points, focus)
    assert (np.diff(index) > 0).all()
    assert len(index) <= points + 4
    kept = values[index]
    assert (kept.min(), kept.max()) == (values.min(), values.max())
    assert (index[0], index[-1]) == (0, len(values) - 1)
    for moment in focus:
        nearest = int(np.searchsorted(time, moment))
        if nearest < len(values):
            assert nearest in index


def test_single_sample_peak_survives():
    """One sample out of a hundred thousand is what the reader looks for."""
    values = np.zeros(100_000)
    values[54_321] = 1.0
    values[77_777] = -2.0
    index = thin(np.arange(100_000) * 1e-3, values, 2000, [])
    assert {54_321, 77_777} <= set(index.tolist())
    assert len(index) <= 2004


def test_short_signal_is_kept_whole():
    """Nothing is dropped without need."""
    assert thin(np.arange(2000.0), np.zeros(2000), 2000, []).tolist() == list(range(2000))


def test_gap_keeps_its_edges():
    """A curve does not run across a gap after thinning."""
    values = np.sin(np.arange(10_000) / 50)
    values[4000:4003] = np.nan
    index = thin(np.arange(10_000) * 1e-3, values, 500, [])
    assert {3999, 4000, 4002, 4003} <= set(index.tolist())
