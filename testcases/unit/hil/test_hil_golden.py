"""The golden formulas against the numbers of the specification and against numeric integration."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldbus.errors import ConfigurationError
from hil.expect import REFERENCE_AXIS, drive_ramp, stop_distance, stop_ramp, stop_time


@pytest.mark.parametrize(
    ("stop", "time_ms", "travel_mm"),
    [
        (REFERENCE_AXIS.emergency(), 75, 11.25),
        (REFERENCE_AXIS.maximum(), 250, 37.5),
        (REFERENCE_AXIS.off3(), 300, 45.0),
        (REFERENCE_AXIS.off1(), 600, 90.0),
        (REFERENCE_AXIS.job(), 400, 60.0),
        (REFERENCE_AXIS.job(deceleration=3000.0, jerk=10_000.0), 346, 51.96),
    ],
)
def test_the_worked_numbers_of_the_reference_axis(stop, time_ms, travel_mm):
    """Ramp time and travel from 300 mm/s are those of STP-008 to STP-013."""
    assert stop.time_s * 1000 == pytest.approx(time_ms, abs=0.5)
    assert stop.distance == pytest.approx(travel_mm, abs=0.005)


def test_a_stop_while_accelerating_first_takes_the_acceleration_away():
    """With +1000 mm/s2 and 20 000 mm/s3 the velocity still rises by 25 mm/s during 50 ms (STP-325)."""
    rising = stop_ramp(200.0, 2000.0, 20_000.0, acceleration=1000.0)
    from_the_top = stop_ramp(225.0, 2000.0, 20_000.0)
    assert rising.time_s - from_the_top.time_s == pytest.approx(0.05)


def test_a_superseded_ramp_adds_up():
    """Maximum dynamics for 100 ms and then the emergency ramp: 31.7 mm in 150 ms (STP-439)."""
    begun = 300.0 * 0.1 - 20_000.0 * 0.1**3 / 6
    rest = stop_ramp(200.0, 4000.0)
    assert begun + rest.distance == pytest.approx(31.7, abs=0.05)
    assert 0.1 + rest.time_s == pytest.approx(0.150)


def integrate(velocity, deceleration, jerk, acceleration, step=5e-5):
    """Brake numerically: jerk towards -deceleration as long as there is velocity left to take the
    deceleration away.
    """
    distance = time_s = 0.0
    while velocity > 0:
        if jerk is None:
            acceleration = -deceleration
        else:
            # What the velocity falls by while the present deceleration is taken back to zero.
            rest = acceleration * acceleration / (2 * jerk) if acceleration < 0 else 0.0
            if velocity <= rest:
                acceleration = min(acceleration + jerk * step, -1e-9)
            else:
                acceleration = max(acceleration - jerk * step, -deceleration)
        distance += velocity * step
        velocity += acceleration * step
        time_s += step
    return time_s, distance


@pytest.mark.exhaustive
@settings(max_examples=40)
@given(
    velocity=st.floats(20.0, 400.0),
    deceleration=st.floats(500.0, 4000.0),
    jerk=st.none() | st.floats(5_000.0, 50_000.0),
    acceleration=st.floats(0.0, 800.0),
)
def test_the_formulas_agree_with_integration(velocity, deceleration, jerk, acceleration):
    """Time and travel agree with a ramp that is integrated step by step, in all three regimes."""
    expected_time, expected_distance = integrate(velocity, deceleration, jerk, acceleration if jerk else 0.0)
    stop = stop_ramp(velocity, deceleration, jerk, acceleration=acceleration if jerk else 0.0)
    assert stop.time_s == pytest.approx(expected_time, rel=5e-3, abs=8e-3), (
        "the last bit of a jerk-limited ramp is flat"
    )
    assert stop.distance == pytest.approx(expected_distance, rel=5e-3, abs=0.2)
    assert stop.peak_deceleration <= deceleration * (1 + 1e-9)


@pytest.mark.exhaustive
@given(velocity=st.floats(1.0, 300.0), deceleration=st.floats(100.0, 5000.0), jerk=st.floats(1000.0, 1e5))
def test_a_jerk_limit_never_shortens_a_stop(velocity, deceleration, jerk):
    """With a jerk limit a stop takes longer and farther than without, and no jerk limit is the limit of a
    high one.
    """
    assert stop_time(velocity, deceleration, jerk) >= stop_time(velocity, deceleration)
    assert stop_distance(velocity, deceleration, jerk) >= stop_distance(velocity, deceleration)
    assert stop_time(velocity, deceleration, 1e12) == pytest.approx(
        stop_time(velocity, deceleration), rel=1e-3
    )


def test_a_ramp_of_the_drive_is_proportional_to_the_speed():
    """The ramp time counts from the maximum speed: half the speed takes half the time."""
    assert drive_ramp(150.0, 300.0, 0.8).time_s == pytest.approx(0.4)
    assert drive_ramp(150.0, 300.0, 0.8).distance == pytest.approx(30.0)


def test_tolerances_are_those_of_the_specification():
    """Two cycles on times; two cycles of travel plus the following error on distances."""
    assert REFERENCE_AXIS.time_tolerance_s == pytest.approx(0.008)
    assert REFERENCE_AXIS.distance_tolerance() == pytest.approx(2.4)
    assert REFERENCE_AXIS.distance_tolerance(100.0, following_error=-1.5) == pytest.approx(2.3)


@pytest.mark.parametrize(
    "arguments",
    [(-1.0, 1.0), (1.0, 0.0), (1.0, -1.0), (float("nan"), 1.0), (1.0, 1.0, -1.0), (1.0, float("inf"))],
)
def test_impossible_values_are_refused(arguments):
    """Negative magnitudes, zero deceleration and values that are no numbers are mistakes."""
    with pytest.raises(ConfigurationError):
        stop_ramp(*arguments)
