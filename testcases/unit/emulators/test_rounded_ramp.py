"""Speed ramps with rounding: times of the ramp-function generator, limits of slope and jerk, from any state
to any target.
"""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive.rounded_ramp import RoundedRamp, Rounding

STEP_S = 0.001


def course(ramp, target, shape, seconds):
    """Return the velocities of every step to a target."""
    ramp.aim(ramp.velocity, target, shape)
    return [ramp.step(STEP_S) for _ in range(round(seconds / STEP_S))]


@pytest.mark.parametrize(
    ("initial_s", "final_s", "total_s"), [(0.0, 0.0, 1.0), (0.4, 0.0, 1.2), (0.0, 0.4, 1.2), (0.2, 0.6, 1.4)]
)
def test_a_ramp_takes_half_of_each_rounding_longer(initial_s, final_s, total_s):
    """From 0 to v: v / slope + initial / 2 + final / 2; in its middle the slope is the full one."""
    ramp = RoundedRamp()
    velocities = course(ramp, 100.0, Rounding(100.0, 100.0, initial_s, final_s), 2.0)
    arrived = next(at for at, velocity in enumerate(velocities, 1) if velocity >= 100.0 - 1e-9) * STEP_S
    assert arrived == pytest.approx(total_s, abs=2 * STEP_S)
    steepest = max(b - a for a, b in pairwise(velocities)) / STEP_S
    assert steepest == pytest.approx(100.0, rel=1e-6)
    assert velocities[-1] == 100.0


def test_a_short_ramp_does_not_reach_the_full_slope():
    """The slope rises and falls in proportion to its times."""
    ramp = RoundedRamp()
    velocities = course(ramp, 1.0, Rounding(100.0, 100.0, 0.5, 0.5), 1.0)
    steepest = max(b - a for a, b in pairwise(velocities)) / STEP_S
    assert steepest == pytest.approx((1.0 * 200.0) ** 0.5, rel=0.01)


def test_zero_is_passed_as_the_end_of_one_ramp_and_the_begin_of_another():
    """Down with the one slope, up with the other."""
    ramp = RoundedRamp()
    shape = Rounding(50.0, 200.0, 0.1, 0.1)
    course(ramp, 100.0, shape, 3.0)
    velocities = course(ramp, -100.0, shape, 4.0)
    to_zero = next(at for at, velocity in enumerate(velocities, 1) if velocity <= 0.0) * STEP_S
    assert to_zero == pytest.approx(100.0 / 200.0 + 0.1, abs=0.003)
    there = next(at for at, velocity in enumerate(velocities, 1) if velocity <= -100.0 + 1e-9) * STEP_S
    assert there - to_zero == pytest.approx(100.0 / 50.0 + 0.1, abs=0.003)


@pytest.mark.parametrize("continuous", [True, False])
def test_turning_round_in_the_middle(continuous):
    """Continuous: the slope falls first and the velocity overshoots what it was; else it breaks off at
    once.
    """
    ramp = RoundedRamp()
    shape = Rounding(100.0, 100.0, 0.2, 0.2, continuous)
    course(ramp, 100.0, shape, 0.5)
    turned = ramp.velocity
    velocities = course(ramp, 0.0, shape, 3.0)
    assert (max(velocities) > turned + 5.0) is continuous
    assert velocities[-1] == 0.0


SHAPES = st.builds(
    Rounding,
    st.sampled_from([1.0, 50.0, 900.0]),
    st.sampled_from([1.0, 80.0, 700.0]),
    st.sampled_from([0.0, 0.05, 0.5]),
    st.sampled_from([0.0, 0.05, 0.5]),
    st.booleans(),
)
TARGETS = st.sampled_from([0.0, 1e-3, 30.0, -30.0, 300.0, -300.0])


@pytest.mark.exhaustive
@settings(max_examples=100, derandomize=True, deadline=None)
@given(st.lists(st.tuples(TARGETS, SHAPES, st.sampled_from([1, 7, 90])), min_size=1, max_size=5))
def test_any_course_keeps_the_limits_and_arrives(orders):
    """Targets and shapes change at any time: the velocity is steady, never steeper than the steepest slope,
    and arrives.
    """
    ramp = RoundedRamp()
    velocity = 0.0
    limit = 0.0
    for target, shape, steps in orders:
        limit = max(limit, shape.acceleration, shape.deceleration)
        ramp.aim(velocity, target, shape)
        for _ in range(steps):
            new = ramp.step(STEP_S)
            assert abs(new - velocity) <= limit * STEP_S * (1.0 + 1e-6) + 1e-9
            velocity = new
    target, shape, _ = orders[-1]
    for _ in range(40):
        velocity = ramp.step(100.0)
    assert velocity == target


def test_a_ramp_begins_where_the_velocity_is():
    """When somebody else has moved the axis the ramp takes over there, without a slope of its own."""
    ramp = RoundedRamp()
    shape = Rounding(100.0, 100.0, 0.2, 0.2)
    course(ramp, 100.0, shape, 0.5)
    ramp.aim(10.0, 100.0, shape)
    assert ramp.step(STEP_S) == pytest.approx(10.0, abs=0.01)
