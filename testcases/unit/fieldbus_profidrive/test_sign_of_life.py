"""Sign of life: synchronisation, tolerated failures, and the fault after too many."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive.sign_of_life import SignOfLife, SignState, SignWatch, next_sign


def counter(factor=1, start=1):
    """Yield what a faultless controller sends, cycle by cycle."""
    value = start
    while True:
        for _ in range(factor):
            yield value
        value = next_sign(value)


def synchronised(tolerance=1, factor=1):
    """Return a drive that is synchronised, and the controller that goes on."""
    life, controller = SignOfLife(tolerance=tolerance, factor=factor), counter(factor)
    for _ in range(1000):
        if life.state is SignState.SYNCHRONISED:
            return life, controller
        life.step(next(controller))
    raise AssertionError(life.state)


@pytest.mark.requirement("PD-123")
def test_counter():
    """1 to 15, then 1 again; 0 is left for ever once it runs."""
    course = [0]
    for _ in range(31):
        course.append(next_sign(course[-1]))
    assert course == [0, *range(1, 16), *range(1, 16), 1]


@pytest.mark.requirement("PD-124", "PD-125", "PD-126")
@pytest.mark.parametrize("factor", [1, 2, 4])
def test_synchronisation(factor):
    """Sixteen right values, then the drive answers for sixteen more; until then its own counter is 0."""
    life, controller = SignOfLife(factor=factor), counter(factor)
    states, values = [], []
    for _ in range(40 * factor):
        life.step(next(controller))
        states.append(life.state)
        values.append(life.value)
    changes = [state for state, before in zip(states, [None, *states], strict=False) if state is not before]
    assert changes == [SignState.IDLE, SignState.COUNTING, SignState.ANSWERING, SignState.SYNCHRONISED]
    assert states.count(SignState.COUNTING) == 16 * factor
    assert states.count(SignState.ANSWERING) == 16 * factor
    assert {value for state, value in zip(states, values, strict=True) if state is SignState.COUNTING} == {0}
    running = values[states.index(SignState.ANSWERING) + 1 :]
    assert all(after == next_sign(before) for before, after in pairwise(running))


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-125")
@given(cycle=st.integers(2, 34), wrong=st.integers(0, 15))
def test_a_deviation_while_synchronising_starts_again(cycle, wrong):
    """Any wrong value before the end of the synchronisation takes the drive back to the beginning."""
    life, controller = SignOfLife(), counter()
    right = 0
    for _ in range(cycle):
        right = next(controller)
        life.step(right)
    if life.state is SignState.SYNCHRONISED or wrong == next_sign(right):
        return
    life.step(wrong)
    assert life.state is SignState.IDLE or wrong in (0, next_sign(right))
    assert life.value == 0


@pytest.mark.requirement("PD-127", "PD-128", "PD-350")
@pytest.mark.parametrize(("tolerance", "faults_at"), [(1, 2), (5, 6), (0, 1)])
def test_number_of_wrong_cycles(tolerance, faults_at):
    """PNU 925 = n: n failures in a row are tolerated, the next one is the fault."""
    life, _ = synchronised(tolerance)
    results = [life.step(0) for _ in range(faults_at)]
    assert results == [False] * (faults_at - 1) + [True]
    assert life.state is SignState.IDLE


@pytest.mark.requirement("PD-127", "PD-128")
@pytest.mark.parametrize(("between", "fault"), [(0, True), (9, True), (10, False), (30, False)])
def test_forgiveness(between, fault):
    """With PNU 925 = 1 a second wrong cycle faults if fewer than ten right ones lie between."""
    life, controller = synchronised(1)
    next(controller)
    assert not life.step(0)
    for _ in range(between):
        assert not life.step(next(controller))
    next(controller)
    assert life.step(0) is fault


@pytest.mark.requirement("PD-128")
def test_not_monitored():
    """PNU 925 = 65535: nothing ever faults, and the axis counts as synchronous from the start."""
    assert SignOfLife(tolerance=65_535).synchronised
    life, _ = synchronised(65_535)
    assert not any(life.step(0) for _ in range(1000))


@pytest.mark.requirement("PD-132")
def test_the_controller_watches_the_drive():
    """A counter that does not run yet is not judged; one that stands still is tolerated for three cycles."""
    watch = SignWatch(tolerance=3)
    course = [0, 0, 0, 1, 2, 3, 3, 3, 3, 3, 4, 5]
    assert [watch.step(value) for value in course] == [True] * 9 + [False] + [True] * 2


def test_ranges():
    """Impossible settings are refused."""
    for arguments in ({"tolerance": -1}, {"tolerance": 65_536}, {"factor": 0}):
        with pytest.raises(ConfigurationError):
            SignOfLife(**arguments)
