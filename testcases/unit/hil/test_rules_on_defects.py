"""Rules and invariants notice a product that is broken as a mechanical mutant is."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

import pytest

from hil.bench import load_bench
from hil.expect.rules import judge
from hil.faults import Fault
from hil.fuzz import Do, Program, Wait, run_program
from hil.fuzz._machines import Machine
from hil.fuzz._program import Break
from hil.fuzz._strategies import UNCHANGED
from hil.fuzz.judging import _examples
from hil.mutants import Edit, Mutant, seeded
from reports.model import Verdict

if TYPE_CHECKING:
    from hil.bench.bench import Bench

pytestmark = pytest.mark.exhaustive


def _move(bench: Bench) -> None:
    """Move with one velocity and then to a place."""
    axis = bench.axis()
    bench.wait_until(axis.power().status, timeout=2.0)
    axis.home(0.0)
    axis.move_velocity(120.0, Acceleration=600.0, Jerk=0.0)
    bench.run_for(0.5)
    axis.halt()
    bench.run_for(0.5)
    axis.move_relative(-80.0, Velocity=90.0, Acceleration=500.0, Deceleration=900.0, Jerk=0.0)
    bench.run_for(1.5)


def _push(bench: Bench) -> None:
    """Accelerate at a torque limit."""
    axis = bench.axis()
    bench.wait_until(axis.power().status, timeout=2.0)
    axis.torque_limiting(0.2)
    bench.run_for(0.1)
    axis.move_velocity(300.0, Acceleration=10_000.0)
    bench.run_for(0.3)


def _defect(name: str, target: str, old: str, new: str) -> Mutant:
    return Mutant(name, "axis", name, (Edit(target, old, new),))


PLAY: Final = {"drive": {"drive1": {"mechanics": {"backlash_mm": 0.05}}}}
"""With it the servo takes no short cut."""
DEFECTS: Final[tuple[tuple[str, str, dict[str, Any], Callable[[Bench], None], Mutant], ...]] = (
    (
        "force and acceleration",
        "reference",
        {},
        _move,
        _defect(
            "half-the-mass",
            "emulators.drive.machine:LinearAxisConfig.build",
            "load_mass_kg=self.load_mass_kg",
            "load_mass_kg=0.5 * self.load_mass_kg",
        ),
    ),
    (
        "torque at its limit",
        "reference",
        PLAY,
        _push,
        _defect(
            "limit-of-the-other-side",
            "emulators.drive.core:ServoCore.step",
            "self._limit_high if torque > 0.0",
            "self._limit_high if torque < 0.0",
        ),
    ),
    (
        "cause of alarm 521",
        "analog",
        {},
        _move,
        _defect(
            "pulses-stay-inhibited",
            "emulators.drive.analog:AnalogDrive._start",
            "self.core.enable_pulses()",
            "pass",
        ),
    ),
)


def _broken(name: str, changes: dict[str, Any], do: Callable[[Bench], None]) -> set[str]:
    """Return the names of the rules that a motion on a bench breaks."""
    with load_bench(name).configured(changes).build(seed=1) as bench:
        do(bench)
        checks = judge(bench.trace())
    return {one.name.rpartition(" of ")[0] for one in checks if one.verdict is not Verdict.PASSED}


def test_a_rule_notices_its_defect(subtests: pytest.Subtests) -> None:
    """The rule fails with the defect, and the same motion without it breaks none."""
    for rule, name, changes, do, defect in DEFECTS:
        with subtests.test(rule):
            assert not _broken(name, changes, do)
            with seeded(defect, set()):
                assert rule in _broken(name, changes, do)


def _buffer(bench: Bench) -> None:
    """Go to a place, and on from there by a job that waits."""
    axis = bench.axis()
    bench.wait_until(axis.power().status, timeout=2.0)
    axis.home(0.0)
    bench.run_for(0.1)
    axis.move_relative(-20.0, Velocity=90.0)
    bench.run_for(0.02)
    axis.move_relative(12.0, Velocity=25.0, BufferMode=1)
    bench.run_for(1.5)


def test_a_buffered_job_on_a_slow_interpolator_breaks_no_rule() -> None:
    """In the cycle in which the first job is done, the setpoint is that of the next one already."""
    assert _broken("reference", {"bench": {"interpolator_ms": 12}}, _buffer) == set()


_SHOWN: Final = "motion.s7.instructions.base:ExecuteInstruction._show"
OUTPUTS: Final[tuple[tuple[str, str, Mutant], ...]] = (
    ("one job output", "MC-071", _defect("busy-for-ever", _SHOWN, "self.Busy = False", "self.Busy = True")),
    (
        "outputs of an instance",
        "MC-073",
        _defect("no-error-id", _SHOWN, "self.ErrorID = job.error_id", "pass"),
    ),
    (
        "outputs held",
        "MC-066",
        _defect(
            "cleared-at-once",
            "motion.s7.instructions.base:ExecuteInstruction._call",
            "if not execute:",
            "if execute:",
        ),
    ),
)
MOTION: Final = Program(
    (
        Do("power_on"),
        Wait(0.3),
        Do("home"),
        Do("move_relative", {"distance": 2.0}),
        Wait(0.5),
        Do("move_velocity", {"velocity": 50.0}),
        Wait(0.2),
        Break(Fault("axis.alarm", parameters={"number": 521, "reaction": 4})),
        Wait(0.2),
    )
)


def test_outputs_of_instances_are_judged_in_every_cycle(subtests: pytest.Subtests) -> None:
    """An output that contradicts another one, or does not stay, is noticed, with its requirement."""
    bench = load_bench("reference")
    assert run_program(MOTION, bench).violation is None
    for invariant, requirement, defect in OUTPUTS:
        with subtests.test(invariant), seeded(defect, set()):
            violation = run_program(MOTION, bench).violation
            assert violation is not None
            assert violation.invariant == invariant
            assert requirement in violation.requirements


def test_half_of_the_programs_have_no_fault_and_move() -> None:
    """Programs of phrases alone begin homed; their jobs come into control and go on from one another."""
    bench = load_bench("reference")
    with bench.build(seed=1) as sample:
        drawn = _examples(Machine.of(sample, 1).programs(12, UNCHANGED), 40, 3)
    calm = [one for one in drawn if not any(isinstance(step, Break) for step in one.steps)]
    assert 10 <= len(calm) < len(drawn)
    assert sum(Do("home") in one.steps for one in calm) >= len(calm) // 2
    outcome = run_program(calm[0], bench)
    assert outcome.violation is None
    assert [entry for entry in outcome.trace.events if entry.kind == "job.active"]
