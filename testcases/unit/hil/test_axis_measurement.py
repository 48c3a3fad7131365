"""What `hil benchmark` says of an axis is measured on axes that do what the name of the figure says."""

from itertools import pairwise

import pytest

from hil._commands._axis_measurement import (
    AXES,
    FOLLOWERS,
    STATES,
    RunningAxes,
    RunningFollowers,
    axis_cycles,
    follower_cycles,
)

pytestmark = pytest.mark.exhaustive


@pytest.mark.parametrize("state", STATES)
def test_axes_are_in_the_state(state):
    """Enabled, homed, and at a standstill, at constant velocity, or travelling to and fro between two
    positions.
    """
    running = RunningAxes(state, 2)
    places = []
    for _ in range(200):
        running.run(8)
        places.append(tuple(axis.feedback.position for axis in running.axes))
    assert all(axis.states.facts.enabled and not axis.alarms.engine.pending for axis in running.axes)
    assert all(a == pytest.approx(b) for a, b in places)
    steps = {round(after[0] - before[0], 3) for before, after in pairwise(places)}
    if state == "standstill":
        assert steps == {0.0}
    elif state == "velocity":
        assert steps == {2.4}
    else:
        assert max(place[0] for place in places) == pytest.approx(100.0, abs=0.1)
        assert min(place[0] for place in places) == pytest.approx(0.0, abs=0.1)


def test_figures():
    """One figure for each state and one for several axes, in microseconds."""
    figures = axis_cycles(cycles=40, rounds=1)
    assert [figure.name for figure in figures] == [
        "axis_cycle_standstill",
        "axis_cycle_velocity",
        "axis_cycle_positioning",
        f"axis_cycle_{AXES}axes_positioning",
    ]
    assert all(0.5 < figure.value < 5000.0 and figure.unit == "us/axis" for figure in figures)


@pytest.mark.parametrize("kind", FOLLOWERS)
def test_followers_follow(kind):
    """The leading axis has a constant velocity; a geared axis has the same, one on a cam goes to and fro."""
    running = RunningFollowers(kind, 2)
    places = []
    for _ in range(400):
        running.run(1)
        places.append([axis.var("Position") for axis in running.axes])
    for number in (1, 2):
        steps = [after[number] - before[number] for before, after in pairwise(places)]
        if kind == "gearing":
            assert steps == pytest.approx([0.3] * len(steps))
        else:
            assert max(place[number] for place in places) - min(place[number] for place in places) > 15.0
            assert min(steps) < -0.05 < 0.05 < max(steps)


def test_figures_of_followers():
    """What a follower costs, and how many times that of a positioning axis."""
    figures = follower_cycles(cycles=20, rounds=1)
    assert [(figure.name, figure.unit) for figure in figures] == [
        ("axis_cycle_gearing", "us/axis"),
        ("axis_cycle_gearing_to_positioning", "times"),
        ("axis_cycle_camming", "us/axis"),
        ("axis_cycle_camming_to_positioning", "times"),
    ]
