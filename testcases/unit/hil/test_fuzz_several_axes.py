"""Fuzz programs that give instructions to several axes, which may follow each other."""

from __future__ import annotations

import hypothesis
import pytest

from hil.bench import load_bench
from hil.errors import CannotRunError
from hil.faults import Fault
from hil.fuzz import Break, Do, Program, Step, Wait, fault_kinds, programs, run_program, search, situations_of
from hil.fuzz._program import SYNCHRONOUS, participants
from hil.fuzz._strategies import preamble_of

pytestmark = pytest.mark.exhaustive

BENCH = load_bench("synchronous")
FOLLOWING = [
    Do("gear_in", {"leader": "leader", "numerator": -1, "denominator": 2}, "follower_a"),
    Wait(0.1),
    Do("phasing", {"shift": 10.0}, "follower_a"),
    Do("leading_value_additive", {"position": 1.0}, "follower_a"),
    Do("cam_in", {"leader": "follower_a", "cam": "swing", "profile": 2}, "follower_b"),
    Wait(0.4),
    Do("offset", {"offset": 5.0, "distance": 10.0}, "follower_b"),
    Do("cam_out", {"position": 10.0, "profile": 0}, "follower_b"),
    Do("additive_release", {}, "follower_a"),
    Do("gear_out", {"position": -200.0, "profile": 0}, "follower_a"),
    Do("gear_in_velocity", {"leader": "material", "numerator": 1}, "follower_a"),
    Do("gear_in_pos", {"leader": "leader", "master": 150.0, "slave": 20.0}, "follower_b"),
]


def test_a_program_says_which_axis_does_what():
    """Every instruction of followers reaches its axis, holds all rules, and comes back from its JSON."""
    with BENCH.build(seed=1) as bench:
        axes = participants(bench, 3)
    assert [(one.axis, one.drive) for one in axes] == [
        ("leader", "leader_drive"),
        ("follower_a", "a_drive"),
        ("follower_b", "b_drive"),
    ]
    assert axes[2].leaders == ("leader", "follower_a", "material")
    program = Program(
        (*preamble_of(axes, axes[0].jobs), Do("move_velocity", {"velocity": 100.0}, "leader"), *FOLLOWING)
    )
    assert Program.from_json(program.to_json()) == program
    assert "follower_b: cam_in leader = follower_a, cam = swing, profile = 2" in str(program)
    outcome = run_program(program, BENCH, seed=1)
    assert outcome.violation is None
    assert not outcome.skipped
    given = {
        (event.source, event.data["instruction"])
        for event in outcome.trace.events
        if event.kind == "job.active"
    }
    assert {
        ("follower_a", "MC_GearIn"),
        ("follower_b", "MC_CamIn"),
        ("follower_a", "MC_GearInVelocity"),
    } <= given
    assert ("job", "MC_GearIn", "STANDSTILL") in situations_of(outcome.trace)
    assert {
        step.job for step in (*FOLLOWING, *preamble_of(axes, axes[0].jobs)) if isinstance(step, Do)
    } >= set(SYNCHRONOUS)


def test_programs_give_and_break_on_all_axes():
    """Programs give instructions to each of the axes, of their own and of followers, and hit each drive."""
    with BENCH.build(seed=1) as bench:
        axes, kinds, ids = participants(bench, 3), fault_kinds(bench), bench.cob_ids("leader_drive")
    steps: list[Step] = []

    @hypothesis.seed(1)
    @hypothesis.settings(max_examples=30, database=None, deadline=None)
    @hypothesis.given(programs(kinds, ids, axes=axes))
    def draw(program: Program) -> None:
        steps.extend(program.steps[len(preamble_of(axes, axes[0].jobs)) :])

    draw()
    given = {(step.axis, step.job in SYNCHRONOUS) for step in steps if isinstance(step, Do)}
    followers = ("follower_a", "follower_b")
    assert given == {("leader", False), *((name, follows) for name in followers for follows in (False, True))}
    hit = {step.fault.target for step in steps if isinstance(step, Break)}
    assert {"leader_drive", "a_drive", "b_drive"} <= hit
    assert any(isinstance(step, Wait) for step in steps)


def test_a_search_runs_programs_of_several_axes():
    """Each program of a search begins with all axes."""
    seen: list[Program] = []
    found = search(BENCH, cases=1, seed=3, axes=3, longest=4, on_new=seen.append)
    assert (found.failure, found.cases) == (None, 1)
    assert [step.axis for step in seen[0].steps[:3]] == ["leader", "follower_a", "follower_b"]


def test_a_fault_without_target_still_means_the_first_axis():
    """Programs that were kept before there were several axes mean what they did."""
    program = Program((Do("power_on"), Wait(0.2), Break(Fault("drive.sto"))))
    trace = run_program(program, BENCH, seed=1).trace
    assert [e.source for e in trace.events if e.kind == "fault.applied"] == ["leader_drive"]


def test_more_axes_than_the_bench_has():
    """The message says how many there are and which."""
    with pytest.raises(CannotRunError, match=r"2 axes are not possible: the bench has 1: axis1"):
        search(load_bench("reference"), cases=1, axes=2)
