"""Profile generator of the drive: trapezoid and jerk limit."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from emulators.drive import PositionProfile, ProfileForm
from fieldbus.errors import ConfigurationError

DT = 0.00025


def play(profile: PositionProfile, *, limit: int = 400_000) -> list[tuple[float, float]]:
    points = [(profile.position, profile.velocity)]
    for _ in range(limit):
        profile.advance()
        points.append((profile.position, profile.velocity))
        if profile.done:
            return points
    raise AssertionError("the profile does not end")


def test_trapezoid_takes_the_time_of_the_formula():
    """Rest to rest with a cruise: t = v/2a + v/2d + s/v, ends exactly at the target."""
    profile = PositionProfile(step_s=DT)
    profile.move(10.0, velocity=4.0, acceleration=8.0, deceleration=16.0)
    points = play(profile)
    assert points[-1] == (10.0, 0.0)
    assert (len(points) - 1) * DT == pytest.approx(10.0 / 4.0 + 4.0 / 16.0 + 4.0 / 32.0, abs=2 * DT)
    assert max(v for _, v in points) == pytest.approx(4.0)


def test_short_way_is_a_triangle():
    """A way too short for the speed: peak v = sqrt(2 s a d / (a + d))."""
    profile = PositionProfile(step_s=DT)
    profile.move(-0.1, velocity=100.0, acceleration=5.0, deceleration=20.0)
    points = play(profile)
    assert points[-1] == (-0.1, 0.0)
    assert min(v for _, v in points) == pytest.approx(-math.sqrt(2 * 0.1 * 5 * 20 / 25), rel=1e-2)


@pytest.mark.exhaustive
@settings(deadline=None)
@given(
    start=st.floats(-20, 20),
    speed=st.floats(-10, 10),
    target=st.floats(-20, 20),
    limit=st.floats(4, 30),
    acceleration=st.floats(5, 200),
    deceleration=st.floats(5, 200),
    jerk=st.sampled_from([0.0, 500.0, 5000.0]),
)
def test_any_state_leads_to_the_target_within_the_limits(
    start: float,
    speed: float,
    target: float,
    limit: float,
    acceleration: float,
    deceleration: float,
    jerk: float,
):
    """From any position and speed the profile is continuous, keeps speed and acceleration limits and ends
    exactly.
    """
    profile = PositionProfile(step_s=0.001)
    profile.reset(start, speed)
    profile.move(
        target,
        velocity=limit,
        acceleration=acceleration,
        deceleration=deceleration,
        form=ProfileForm(jerk=jerk),
    )
    points = play(profile)
    assert points[-1][0] == target
    steepest = max(acceleration, deceleration)
    for (p0, v0), (p1, v1) in pairwise(points):
        assert abs(v1 - v0) <= steepest * 0.001 * 1.001 + 1e-6
        assert abs(v1) <= max(limit, abs(speed)) + 1e-6
        assert abs((p1 - p0) - 0.5 * (v0 + v1) * 0.001) <= steepest * 1e-6 + 1e-9


@pytest.mark.requirement("C402-095")
def test_jerk_limit():
    """With a jerk the acceleration changes by at most jerk * dt, and the target is still met exactly."""
    profile = PositionProfile(step_s=DT)
    profile.move(5.0, velocity=4.0, acceleration=10.0, deceleration=10.0, form=ProfileForm(jerk=100.0))
    points = play(profile)
    assert points[-1] == (5.0, 0.0)
    velocities = [v for _, v in points]
    accelerations = [(b - a) / DT for a, b in pairwise(velocities)]
    jerks = [(b - a) / DT for a, b in pairwise(accelerations)]
    assert max(abs(j) for j in jerks) <= 100.0 * 1.01
    assert max(accelerations) == pytest.approx(10.0, rel=1e-6)
    assert (len(points) - 1) * DT == pytest.approx(5.0 / 4.0 + 4.0 / 10.0 + 10.0 / 100.0, abs=3 * DT)


@pytest.mark.exhaustive
@settings(deadline=None)
@given(
    st.lists(st.tuples(st.integers(1, 400), st.floats(-5, 5)), min_size=1, max_size=6),
    st.sampled_from([0.0, 300.0]),
)
def test_new_targets_at_any_moment(changes: list[tuple[int, float]], jerk: float):
    """A new target in the middle of a motion makes no step in velocity, and the last target is met."""
    profile = PositionProfile(step_s=0.001)
    last = 0.0
    steepest = 0.0
    for steps, target in changes:
        profile.move(target, velocity=3.0, acceleration=20.0, deceleration=30.0, form=ProfileForm(jerk=jerk))
        for _ in range(steps):
            profile.advance()
            steepest = max(steepest, abs(profile.velocity - last))
            last = profile.velocity
    points = play(profile)
    assert points[-1] == (changes[-1][1], 0.0)
    assert steepest <= 30.0 * 0.001 * 1.001 + 1e-9


def test_end_velocity_is_kept():
    """With an end velocity the target is passed with that speed."""
    profile = PositionProfile(step_s=DT)
    profile.move(2.0, velocity=4.0, acceleration=10.0, deceleration=10.0, end_velocity=1.5)
    while not profile.raw_done:
        profile.advance()
    assert profile.velocity == pytest.approx(1.5)
    assert profile.position == pytest.approx(2.0, abs=1.5 * DT)
    before = profile.position
    profile.advance()
    assert profile.position - before == pytest.approx(1.5 * DT)


def test_impossible_profiles_are_refused():
    """Speed and accelerations must be positive."""
    profile = PositionProfile(step_s=DT)
    with pytest.raises(ConfigurationError):
        profile.move(1.0, velocity=0.0, acceleration=1.0, deceleration=1.0)
    with pytest.raises(ConfigurationError):
        PositionProfile(step_s=0.0)
