"""Pairs of fault kinds: every pair in each order, at rest and moving; what breaks is told."""

from __future__ import annotations

import json
from collections import Counter
from itertools import combinations_with_replacement

import pytest

from hil.bench import load_bench
from hil.campaign import load_bench_file
from hil.cli import main
from hil.errors import CannotRunError
from hil.fuzz import Break, Do, fault_pairs, run_program
from hil.fuzz._pairs import VARIANTS

pytestmark = pytest.mark.exhaustive

KINDS = ("frame.drop", "drive.sto", "encoder.freeze", "mechanics.friction")


@pytest.fixture(scope="module")
def programs():
    return fault_pairs(load_bench("reference"), kinds=KINDS)


def _faults(program):
    return [step.fault for step in program.steps if isinstance(step, Break)]


def test_every_pair_comes_in_each_order_at_rest_and_moving(programs):
    """No pair of kinds is left out, of different kinds neither order, no combination of order and motion."""
    met = Counter()
    for program in programs:
        moving = any(isinstance(step, Do) and step.job == "move_velocity" for step in program.steps)
        met[tuple(fault.kind for fault in _faults(program)), moving] += 1
    for one, other in combinations_with_replacement(KINDS, 2):
        for pair in {(one, other), (other, one)}:
            assert met[pair, True], pair
            assert met[pair, False], pair


def test_the_second_comes_while_the_first_acts(programs):
    """Faults that last overlap: 0.3 s each; each kind has up to two sets of parameters."""
    variants = {}
    for program in programs:
        first, second = _faults(program)
        assert {first.duration_s, second.duration_s} == {0.3}
        variants.setdefault(first.kind, set()).add(str(first.parameters))
    assert {kind: len(found) for kind, found in variants.items()} == {
        "frame.drop": VARIANTS,
        "drive.sto": 1,
        "encoder.freeze": 1,
        "mechanics.friction": VARIANTS,
    }


def test_the_bench_takes_every_fault():
    """What a bench refuses is no part of a pair: on `profidrive` another transition than 4, and a limited
    position without a range; kinds that it does not take from a search at all are refused by name.
    """
    kinds = ("drive.refuse_transition", "safety.slp")
    found = fault_pairs(load_bench("profidrive"), kinds=kinds)
    faults = [fault for program in found for fault in _faults(program)]
    assert {(fault.kind, fault.parameters["transition"]) for fault in faults} == {(kinds[0], 4)}
    with pytest.raises(CannotRunError, match=r"safety\.slp"):
        fault_pairs(load_bench("reference"), kinds=["safety.slp"])


def test_the_programs_are_the_same_each_time(programs):
    """The draw depends on bench, kinds and seed alone."""
    again = fault_pairs(load_bench("reference"), kinds=KINDS)
    assert [one.name for one in again] == [one.name for one in programs]


def test_an_alarm_behind_a_removed_enable_changes_nothing(programs):
    """A limit switch that is met while the drive stops by itself gets no stop, and no time, of its own."""
    frozen = [one for one in programs if any(fault.kind == "encoder.freeze" for fault in _faults(one))]
    moving = [one for one in frozen if "move_velocity" in str(one)]
    alarms = set()
    for program in moving:
        outcome = run_program(program, load_bench("reference"))
        assert outcome.violation is None
        alarms |= {entry.data["number"] for entry in outcome.trace.select(kind="alarm.raised")}
    assert {521, 531} <= alarms


def test_the_command_runs_a_part(capsys):
    """`hil fuzz --pairs --shard I/N` runs every N-th program and says how many there were."""
    chosen = [word for kind in KINDS for word in ("--kind", kind)]
    assert main(["fuzz", "--pairs", "--shard", "5/20", "--json", *chosen]) == 0
    captured = capsys.readouterr()
    found = json.loads(captured.out)
    assert (found["failures"], found["skipped"]) == ([], 0)
    assert found["programs"] in (1, 2, 3)
    assert f"{found['programs']} programs, 0 of them break an invariant" in captured.err
    assert main(["fuzz", "--pairs", "--shard", "3"]) == 2
    assert "--shard" in capsys.readouterr().err


def test_pairs_of_an_nc_axis():
    """Programs for an NC axis enable, move and reset it by its own blocks, and meet the same pairs."""
    bench = load_bench_file("nc-axes:reference")
    programs = fault_pairs(bench, kinds=("drive.fault", "mechanics.friction"))
    assert {"MC_Power", "MC_Reset"} <= {step.job for step in programs[0].steps if isinstance(step, Do)}
    moving = next(
        one
        for one in programs
        if "MC_MoveVelocity" in str(one) and {fault.kind for fault in _faults(one)} == {"mechanics.friction"}
    )
    outcome = run_program(moving, bench)
    assert (outcome.violation, outcome.skipped) == (None, [])
    (drive,) = outcome.trace.components_with("position", "torque")
    way = outcome.trace[f"{drive}.position"].values
    assert way.max() - way.min() > 0.02
