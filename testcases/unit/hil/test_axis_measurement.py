"""What `hil benchmark` says of an axis is measured on axes that do what the name of the figure says."""

from itertools import pairwise

import pytest

from hil._commands._axis_measurement import AXES, STATES, RunningAxes, axis_cycles

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
