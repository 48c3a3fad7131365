"""Planned durations against an independent planner (ruckig), which knows no separate deceleration."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from ruckig import ControlInterface, InputParameter, Result, Ruckig, RuckigError, Trajectory

from motion.setpoint import plan_position, plan_velocity, stop_distance

DECADES = st.floats(-1, 3).map(lambda exponent: 10.0**exponent)
# On a grid: below about 1e-6 of the other values either planner takes a motion for none at its own point.
PART = st.integers(-1000, 1000).map(lambda value: value / 1000)
WAY = st.integers(-100_000, 100_000).map(lambda value: value / 1000)


def optimum(*, velocity=0.0, present=0.0, top, rise, fall, jerk, way=None, target=None) -> float:
    """Return the shortest time to a position (`way`) or to a velocity (`target`), s.

    `rise` and `fall` limit positive and negative acceleration.
    """
    problem = InputParameter(1)
    problem.current_position = [0.0]
    problem.current_velocity = [velocity]
    problem.current_acceleration = [present]
    problem.target_acceleration = [0.0]
    problem.max_velocity = [top]
    problem.max_acceleration = [rise]
    problem.min_acceleration = [-fall]
    problem.max_jerk = [jerk]
    if target is not None:
        problem.control_interface = ControlInterface.Velocity
        problem.target_velocity = [target]
    else:
        problem.target_position = [way]
    trajectory = Trajectory(1)
    try:
        result = Ruckig(1).calculate(problem, trajectory)
    except RuckigError:  # it gives up on some extreme problems
        result = Result.Error
    assume(result == Result.Working)
    return trajectory.duration


def assert_shortest(profile, shortest: float) -> None:
    """Check that a duration equals the shortest; for motions of some milliseconds, that it is not longer.

    The other planner's tolerances are absolute and make very short motions longer than they must be.
    """
    assert profile.duration <= shortest * (1 + 1e-6) + 1e-6
    if shortest > 0.01:
        assert profile.duration == pytest.approx(shortest, rel=1e-6)


@given(velocity=WAY, target=WAY, limit=DECADES, jerk=DECADES, part=PART)
def test_change_of_velocity(velocity, target, limit, jerk, part):
    """With equal limits a change of velocity takes the shortest time there is, reversals included."""
    shortest = optimum(
        velocity=velocity, present=part * limit, target=target, top=1e6, rise=limit, fall=limit, jerk=jerk
    )

    profile = plan_velocity(velocity, part * limit, target, acceleration=limit, deceleration=limit, jerk=jerk)

    assert_shortest(profile, shortest)


@given(way=WAY, top=DECADES, limit=DECADES, jerk=DECADES, part=PART, of_limit=PART)
def test_to_a_position_with_equal_limits(way, top, limit, jerk, part, of_limit):
    """With equal limits a motion takes the shortest time there is, from any state inside the limits."""
    velocity, present = part * top, of_limit * limit
    # The velocity stays inside its limit while the acceleration is taken away.
    assume(abs(velocity + present * abs(present) / (2 * jerk)) <= top)
    shortest = optimum(
        velocity=velocity, present=present, way=way, top=top, rise=limit, fall=limit, jerk=jerk
    )

    profile = plan_position(
        0.0, velocity, present, way, max_velocity=top, acceleration=limit, deceleration=limit, jerk=jerk
    )

    assert_shortest(profile, shortest)


@given(beyond=st.floats(1e-2, 1e2), top=DECADES, rise=DECADES, fall=DECADES, jerk=DECADES, part=PART.map(abs))
def test_to_a_position_with_separate_limits(beyond, top, rise, fall, jerk, part):
    """Without a reversal, growth is positive and reduction negative acceleration: again the shortest time."""
    velocity = part * top
    way = stop_distance(velocity, 0.0, fall, jerk) + beyond
    shortest = optimum(velocity=velocity, way=way, top=top, rise=rise, fall=fall, jerk=jerk)

    profile = plan_position(
        0.0, velocity, 0.0, way, max_velocity=top, acceleration=rise, deceleration=fall, jerk=jerk
    )

    assert_shortest(profile, shortest)


@given(
    way=WAY,
    top=DECADES,
    limit=DECADES,
    jerk=DECADES,
    part=st.integers(-3000, 3000).map(lambda value: value / 1000),
    of_limit=PART,
)
def test_never_slower_from_too_high_a_velocity(way, top, limit, jerk, part, of_limit):
    """From above the velocity limit the motion is never slower than the other planner's, and no miracle either."""
    velocity, present = part * top, of_limit * limit
    shortest = optimum(
        velocity=velocity, present=present, way=way, top=top, rise=limit, fall=limit, jerk=jerk
    )
    unlimited = optimum(
        velocity=velocity, present=present, way=way, top=1e7, rise=limit, fall=limit, jerk=jerk
    )

    profile = plan_position(
        0.0, velocity, present, way, max_velocity=top, acceleration=limit, deceleration=limit, jerk=jerk
    )

    assert profile.duration <= shortest * (1 + 1e-6) + 1e-6
    if shortest > 0.01:
        assert profile.duration >= unlimited * (1 - 1e-6)
