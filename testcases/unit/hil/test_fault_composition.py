"""Faults put together on a bench: chains, repetitions, occasions that never come, any order of ending.
Nothing of it is lost.
"""

from __future__ import annotations

import gc
import random
import weakref
from itertools import pairwise

import pytest

from hil.bench import load_bench
from hil.campaign import Campaign, CaseSettings, execute_case
from hil.faults import (
    CATALOGUE,
    Fault,
    Injector,
    after,
    any_of,
    chance,
    condition,
    every,
    on_event,
    position,
    sequence,
    state,
)
from testcases.unit.hil.fault_benches import Situation, Stage, situation_of


@pytest.fixture
def bench():
    with load_bench("reference").build(seed=9) as bench:
        assert bench.run_until(bench.axis().power().status, 2.0)
        yield bench


@pytest.fixture
def faults(bench):
    return Injector(bench)


def logged(bench, injection=None):
    """Return kind and time of the events of faults, ms."""
    return [
        (event.kind.removeprefix("fault."), round(event.time_ns / 1e6, 3))
        for event in bench.history.events
        if event.kind.startswith("fault.") and injection in (None, event.data["injection"])
    ]


def kinds(bench, injection=None):
    return [kind for kind, _ in logged(bench, injection)]


def test_the_first_ends_while_the_second_acts(bench, faults):
    """Two openings of the same safety input overlap: the torque stays off until the last one is closed."""
    begin = bench.now_s
    faults.inject("drive.sto", duration_s=0.1)
    faults.inject("drive.sto", trigger=after(0.05), duration_s=0.1)
    word = [bool(bench.drive().safety.sto_input) for _ in range(20) if bench.run_for(0.01) is None]
    assert word == [True] * 14 + [word[14]] + [False] * 5
    ends = [time for kind, time in logged(bench) if kind == "removed"]
    assert ends == pytest.approx([(begin + 0.1) * 1e3, (begin + 0.15) * 1e3])


def test_forces_add_up(bench, faults):
    """Of two loads each may go alone; what is left is the other."""
    one = faults.inject("mechanics.load_step", force_N=100.0)
    two = faults.inject("mechanics.load_step", force_N=-30.0)
    mechanics = bench.drive().mechanics
    assert mechanics.external_force == 70.0
    one.remove()
    assert mechanics.external_force == -30.0
    two.remove()
    assert mechanics.external_force == 0.0


@pytest.mark.exhaustive
def test_repetition_by_chance_is_that_of_the_seed(bench, faults):
    """Of the occasions those come that the seed draws; one that comes while the fault acts is logged and does
    not count.
    """

    def run():
        with load_bench("reference").build(seed=9) as own:
            armed = Injector(own).inject(
                "drive.warning", trigger=chance(every(0.01), 0.5), count=8, duration_s=0.015
            )
            own.run_for(0.5)
            assert armed.over
            assert armed.applications == 8
            return logged(own)

    first = run()
    assert first == run()
    assert [kind for kind, _ in first].count("applied") == [kind for kind, _ in first].count("removed") == 8
    assert "skipped" in [kind for kind, _ in first]
    assert not faults.armed


def test_the_end_that_never_comes(bench, faults):
    """What waits for the end of a fault that stays is logged as waiting, and as disarmed when it is
    removed.
    """
    faults.inject("drive.warning")
    chained = faults.inject(
        "drive.sto", trigger=sequence(on_event("fault.removed", fault="drive.warning"), after(0.1))
    )
    bench.run_for(0.5)
    faults.note_waiting()
    assert kinds(bench, 2) == ["armed", "waiting"]
    faults.remove_all()
    bench.run_for(0.5)
    assert kinds(bench, 2) == ["armed", "waiting", "disarmed"], "it is disarmed before the other one ends"
    assert (chained.over, chained.applied_ns) == (True, None)


def test_a_chain_goes_on_from_end_to_end(bench, faults):
    """Each of three faults begins with the end of the one before it, at that instant."""
    faults.inject("drive.warning", duration_s=0.02)
    for before, kind in (("drive.warning", "mechanics.friction"), ("mechanics.friction", "drive.slow_ramp")):
        values = {"force_N": 1.0} if kind == "mechanics.friction" else {"share": 0.5}
        faults.inject(kind, trigger=on_event("fault.removed", fault=before), duration_s=0.03, **values)
    bench.run_for(0.2)
    applied = [time for kind, time in logged(bench) if kind == "applied"]
    assert [late - early for early, late in pairwise(applied)] == pytest.approx([20.0, 30.0])
    assert kinds(bench).count("removed") == 3


@pytest.mark.exhaustive
def test_what_is_true_already(bench, faults):
    """States and conditions act at once, crossings and events wait for the next time."""
    axis = bench.axis()
    axis.move_velocity(100.0)
    bench.run_for(0.5)
    where = axis.var("ActualPosition")
    assert faults.inject("drive.warning", trigger=state("axis1", "MOTION")).active
    assert faults.inject("drive.warning", trigger=condition("axis1.actual_velocity", low=50.0)).active
    waiting = [
        faults.inject("drive.warning", trigger=position(where - 1.0, axis="axis1")),
        faults.inject("drive.warning", trigger=on_event("job.active")),
    ]
    bench.run_for(0.2)
    assert [armed.applied_ns for armed in waiting] == [None, None]
    faults.note_waiting()
    assert kinds(bench).count("waiting") == 2


def test_two_occasions_in_the_same_cycle(bench, faults):
    """One fault with two triggers that come together acts once and tells of the other; two faults act both,
    in the order of arming.
    """
    axis = bench.axis()
    both = any_of(on_event("job.active"), on_event("job.active"))
    faults.inject("drive.warning", trigger=both, count=2, duration_s=0.05)
    faults.inject("mechanics.friction", trigger=on_event("job.active"), force_N=1.0)
    faults.inject("drive.slow_ramp", trigger=on_event("job.active"), share=0.5)
    axis.move_velocity(50.0)
    bench.run_for(0.1)
    assert kinds(bench, 1) == ["armed", "skipped", "applied", "removed"]
    order = [event.data["injection"] for event in bench.history.events if event.kind == "fault.applied"]
    assert order == [1, 2, 3]
    assert len({time for kind, time in logged(bench) if kind == "applied"}) == 1


def test_a_fault_that_waits_is_in_trace_story_and_record():
    """A trigger on a job that is never started: the case says that the fault never fired."""
    campaign = Campaign("own", bench="reference")

    @campaign.case("waits", title="waits")
    def waits(ctx):
        ctx.inject("drive.sto", trigger=on_event("job.done", job="nobody"))
        ctx.inject("drive.warning", duration_s=0.01)
        ctx.run_for(0.1)

    (case,) = campaign.cases
    execution = execute_case(case, load_bench("reference"), CaseSettings(seed=1))
    result = execution.result
    waiting = [event.data["fault"] for event in execution.trace.events if event.kind == "fault.waiting"]
    assert waiting == ["drive.sto"]
    assert [record.applied_s is None for record in result.faults] == [True, False]
    assert any("drive.sto on drive1 never fired" in step.text for step in result.story)


MIXED = [
    entry
    for entry in CATALOGUE
    if entry.lasting
    and situation_of(entry).bench == "servo"
    and not entry.name.startswith(("controller.", "axis.", "can.", "frame."))
    and entry.name not in {"drive.fault", "encoder.reverse", "encoder.scale"}
]


@pytest.mark.exhaustive
@pytest.mark.parametrize("seed", range(4))
def test_any_order_of_beginning_and_end_leaves_nothing_behind(seed):
    """Ten faults of any kind, some of them twice, begin and end in any order while the axis moves; afterwards
    it moves as before.
    """
    draw = random.Random(seed)
    stage = Stage(Situation("servo"))
    try:
        acting = []
        for entry in draw.choices(MIXED, k=10):
            example = {key: value for key, value in entry.example.items() if key != "duration_s"}
            acting.append(stage.faults.arm(Fault.from_dict(example)))
            stage.bench.run_for(draw.choice([0.0, 0.003, 0.02]))
            if draw.random() < 0.3:
                acting.pop(draw.randrange(len(acting))).remove()
        draw.shuffle(acting)
        for armed in acting:
            armed.remove()
            stage.bench.run_for(draw.choice([0.0, 0.001]))
        events = [event.kind for event in stage.bench.history.events]
        assert events.count("fault.applied") == events.count("fault.removed") == 10
        assert stage.recover() == ""
    finally:
        stage.close()


@pytest.mark.exhaustive
def test_a_bench_with_a_fault_goes_when_nobody_needs_it_any_more():
    """What faults have broken keeps no bench alive: a run of thousands of cases would keep all of theirs."""
    bench = load_bench("reference").build()
    fault = Injector(bench).inject("mechanics.jam")
    assert fault.applied_ns is not None
    bench.close()
    gone = weakref.ref(bench)
    del bench, fault
    load_bench("reference").build().close()  # pytest shows the last bench of a test that fails
    gc.collect()

    assert gone() is None
