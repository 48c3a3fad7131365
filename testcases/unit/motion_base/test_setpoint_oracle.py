"""Planned durations against an independent planner (ruckig), which knows no separate deceleration."""

from itertools import pairwise

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from ruckig import ControlInterface, InputParameter, Result, Ruckig, RuckigError, Trajectory

from motion.setpoint import SetpointGenerator, plan_position, plan_velocity, stop_distance

pytestmark = pytest.mark.exhaustive

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
    """From above the velocity limit the motion is never slower than the other planner's, and no miracle
    either.
    """
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


NO_JERK = float("inf")


@given(way=WAY, top=DECADES, limit=DECADES, part=PART)
def test_without_jerk_limit(way, top, limit, part):
    """A trapezoid takes the shortest time there is, from any velocity inside the limit."""
    shortest = optimum(velocity=part * top, way=way, top=top, rise=limit, fall=limit, jerk=NO_JERK)

    profile = plan_position(
        0.0, part * top, 0.0, way, max_velocity=top, acceleration=limit, deceleration=limit, jerk=0.0
    )

    assert_shortest(profile, shortest)


@given(beyond=st.floats(1e-2, 1e2), top=DECADES, rise=DECADES, fall=DECADES, part=PART.map(abs))
def test_without_jerk_limit_and_with_separate_limits(beyond, top, rise, fall, part):
    """So does one with separate limits that does not turn back."""
    velocity = part * top
    way = stop_distance(velocity, 0.0, fall, 0.0) + beyond
    shortest = optimum(velocity=velocity, way=way, top=top, rise=rise, fall=fall, jerk=NO_JERK)

    profile = plan_position(
        0.0, velocity, 0.0, way, max_velocity=top, acceleration=rise, deceleration=fall, jerk=0.0
    )

    assert_shortest(profile, shortest)


@given(
    way=WAY,
    top=DECADES,
    rise=DECADES,
    fall=DECADES,
    jerk=st.one_of(st.just(0.0), DECADES),
    part=PART,
    of_limit=PART,
)
def test_separate_limits_with_reversal(way, top, rise, fall, jerk, part, of_limit):
    """No motion, reversals included, is faster than with the higher limit on both sides, or slower than with
    the lower.
    """
    low, high = sorted((rise, fall))
    velocity, present = part * top, of_limit * low if jerk else 0.0
    assume(not jerk or abs(velocity + present * abs(present) / (2 * jerk)) <= top)
    facts = {"velocity": velocity, "present": present, "way": way, "top": top, "jerk": jerk or NO_JERK}

    profile = plan_position(
        0.0, velocity, present, way, max_velocity=top, acceleration=rise, deceleration=fall, jerk=jerk
    )

    shortest = optimum(**facts, rise=high, fall=high)
    if shortest > 0.01:  # see `assert_shortest`
        assert profile.duration >= shortest * (1 - 1e-6) - 1e-6
    assert profile.duration <= optimum(**facts, rise=low, fall=low) * (1 + 1e-6) + 1e-6


CHANGE = st.fixed_dictionaries(
    {
        "after": st.integers(1, 60),
        "way": WAY,
        "top": DECADES,
        "limit": st.floats(0, 3).map(lambda value: 10.0**value),
    }
)


@given(first=CHANGE, second=CHANGE, third=CHANGE, jerk=DECADES)
def test_changed_on_the_way(first, second, third, jerk):
    """New targets and limits in the middle of a motion: from the state that is then, again the shortest
    time.
    """
    generator = SetpointGenerator()
    for change in (first, second, third):
        limit, top = change["limit"], change["top"]
        velocity, present, way = generator.v, generator.a, change["way"] - generator.s
        generator.start_position(change["way"], top, limit, limit, jerk)
        inside = (
            abs(present) <= limit
            and abs(velocity) <= top
            and abs(velocity + present * abs(present) / (2 * jerk)) <= top
        )
        if inside:
            shortest = optimum(
                velocity=velocity, present=present, way=way, top=top, rise=limit, fall=limit, jerk=jerk
            )
            assert generator.remaining_time <= shortest * (1 + 1e-6) + 1e-6
        for _ in range(change["after"]):
            generator.advance(0.004)
    generator.advance(generator.remaining_time + 1e-9)
    assert (generator.s, generator.v, generator.a) == (third["way"], 0.0, 0.0)


@given(
    way=WAY,
    top=DECADES,
    rise=DECADES,
    fall=DECADES,
    jerk=st.one_of(st.just(0.0), DECADES),
    part=PART,
    of_limit=PART,
)
def test_target_is_never_overshot(way, top, rise, fall, jerk, part, of_limit):
    """Where the axis can stop before its target it approaches it from one side; else it passes it once."""
    velocity, present = part * top, of_limit * min(rise, fall) if jerk else 0.0
    settled = velocity + (present * abs(present) / (2 * jerk) if jerk else 0.0)
    assume(abs(settled) <= top)
    assume(settled * velocity >= 0.0)  # else its own acceleration turns it, wherever the target lies
    least = stop_distance(velocity, present, fall, jerk)

    profile = plan_position(
        0.0, velocity, present, way, max_velocity=top, acceleration=rise, deceleration=fall, jerk=jerk
    )

    sign = 1.0 if way >= least else -1.0
    places = [
        sign * (profile.sample(phase.start + phase.duration * part / 8)[0] - way)
        for phase in profile.phases
        for part in range(8)
    ]
    slack = 1e-9 * (abs(way) + max(map(abs, places), default=0.0)) + 1e-12
    if sign * way >= 0.0 and (least * way >= 0.0 or not least):
        assert max(places, default=0.0) <= slack
    crossings = [one > 0.0 for one in places if abs(one) > slack]
    assert sum(a is not b for a, b in pairwise(crossings)) <= 1


@given(velocity=WAY, target=WAY, rise=DECADES, fall=DECADES, jerk=st.one_of(st.just(0.0), DECADES), part=PART)
def test_velocity_is_never_overshot(velocity, target, rise, fall, jerk, part):
    """A change of velocity stays between start and target, but for what the present acceleration still
    adds.
    """
    present = part * min(rise, fall) if jerk else 0.0
    settled = velocity + (present * abs(present) / (2 * jerk) if jerk else 0.0)

    profile = plan_velocity(velocity, present, target, acceleration=rise, deceleration=fall, jerk=jerk)

    reached = [
        profile.sample(phase.start + phase.duration * part / 8)[1]
        for phase in profile.phases
        for part in range(8)
    ]
    slack = 1e-9 * (abs(velocity) + abs(target) + abs(settled)) + 1e-12
    assert max(reached, default=target) <= max(velocity, target, settled) + slack
    assert min(reached, default=target) >= min(velocity, target, settled) - slack
