"""Way and time to standstill against the numbers of the reference axis and against the planned stop."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from motion.setpoint import plan_velocity, stop_distance, stop_time

pytestmark = pytest.mark.exhaustive


@pytest.mark.parametrize(
    ("deceleration", "jerk", "time", "way"),
    [
        pytest.param(4000, 0, 0.075, 11.25, id="STP-008"),
        pytest.param(2000, 20_000, 0.250, 37.5, id="STP-009"),
        pytest.param(1000, 10_000, 0.400, 60.0, id="STP-012"),
        pytest.param(2000, 10_000, 0.34641, 51.9615, id="STP-013"),
    ],
)
@pytest.mark.parametrize("sign", [1, -1])
def test_reference_numbers(deceleration, jerk, time, way, sign):
    """The stops from 300 mm/s take the times and ways of the table of reference numbers."""
    assert stop_time(sign * 300, 0, deceleration, jerk) == pytest.approx(time, rel=1e-5)
    assert stop_distance(sign * 300, 0, deceleration, jerk) == pytest.approx(sign * way, rel=1e-5)


@pytest.mark.parametrize(
    ("velocity", "present", "deceleration", "jerk"),
    [
        pytest.param(100, -500, 200, 5000, id="braking beyond the limit"),
        pytest.param(100, -150, 200, 5000, id="braking"),
        pytest.param(100, 700, 200, 5000, id="accelerating"),
        pytest.param(10, -800, 200, 5000, id="through zero"),
        pytest.param(-10, 800, 2000, 5000, id="through zero, backwards"),
        pytest.param(0, -300, 2000, 5000, id="from rest"),
        pytest.param(-100, -300, 2000, 5000, id="accelerating backwards"),
    ],
)
def test_special_states(velocity, present, deceleration, jerk):
    """Every kind of start state has the way and the time of its planned stop."""
    profile = plan_velocity(velocity, present, 0, acceleration=1, deceleration=deceleration, jerk=jerk)

    assert stop_time(velocity, present, deceleration, jerk) == pytest.approx(profile.duration)
    assert stop_distance(velocity, present, deceleration, jerk) == pytest.approx(profile.distance)


@given(
    velocity=st.floats(-1e3, 1e3).map(lambda value: round(value, 9)),
    present=st.floats(-1e4, 1e4).map(lambda value: round(value, 9)),
    acceleration=st.floats(1e-1, 1e5),
    deceleration=st.floats(1e-1, 1e5),
    jerk=st.one_of(st.just(0.0), st.floats(1.0, 1e7)),
)
def test_same_as_the_planned_stop(velocity, present, acceleration, deceleration, jerk):
    """Way and time equal those of the planned change to velocity zero, for every start state."""
    profile = plan_velocity(
        velocity, present, 0.0, acceleration=acceleration, deceleration=deceleration, jerk=jerk
    )
    size = sum(phase.duration * abs(phase.velocity) for phase in profile.phases)
    size += sum(phase.duration**2 * abs(phase.acceleration) for phase in profile.phases)

    assert stop_time(velocity, present, deceleration, jerk) == pytest.approx(
        profile.duration, rel=1e-9, abs=1e-300
    )
    way = stop_distance(velocity, present, deceleration, jerk)
    assert way == pytest.approx(profile.distance, abs=1e-9 * size + 1e-300)
