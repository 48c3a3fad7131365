"""Fuzzing: programs as values, invariants that notice planted defects, shrinking, replay."""

import json

import pytest
from hypothesis import given, seed, settings

from fieldbus.errors import ConfigurationError
from hil.bench import load_bench
from hil.campaign import Token
from hil.faults import Fault, Injector, at
from hil.fuzz import (
    Break,
    Do,
    Program,
    Wait,
    default_invariants,
    fault_kinds,
    job_names,
    program_token,
    programs,
    run_program,
    search,
    step_from_json,
)
from hil.fuzz._provider import BACKEND
from hil.fuzz._strategies import OWN_JOBS
from reports.model import Verdict
from testcases.unit.hil.toybench import (
    BENCH,
    CREEPING,
    DEAF,
    DOUBLE,
    NOISY,
    ToyBench,
    ToyBenchFile,
    found_defect,
)

pytestmark = pytest.mark.exhaustive

SAMPLE = ToyBench()
JOB_NAMES = job_names(SAMPLE.axis())
PROGRAMS = programs(fault_kinds(SAMPLE), SAMPLE.cob_ids("drive1"), jobs=JOB_NAMES)
TRIP = Program(
    (
        Do("power_on"), Wait(0.3), Do("move_velocity", {"velocity": 100.0}), Wait(0.2),
        Break(Fault("drive.fault", parameters={"code": 0x2310})), Wait(0.4), Do("reset"), Wait(0.2),
    )
)  # fmt: skip


# -- programs
# -------------------------------------------------------------------------------------------------------


@given(program=PROGRAMS)
def test_every_generated_program_comes_back_from_json(program):
    """Whatever the search generates can be written down and read again."""
    again = Program.from_json(json.loads(json.dumps(program.to_json())))
    assert again == program
    assert again.name == program.name
    assert len(str(program).splitlines()) == len(program.steps)


def test_all_jobs_and_all_faults_of_the_catalogue_are_in_reach():
    """Over some programs every instruction and every fault kind that the bench can do turns up."""
    reached = set()

    @seed(1)
    @settings(max_examples=500, database=None, backend=BACKEND)
    @given(program=PROGRAMS)
    def gather(program):
        reached.update(
            step.job if isinstance(step, Do) else step.fault.kind
            for step in program.steps
            if not isinstance(step, Wait)
        )

    gather()
    assert set(JOB_NAMES) | set(fault_kinds(SAMPLE)) == reached
    with load_bench("reference").build(seed=1) as bench:
        assert set(OWN_JOBS) < set(job_names(bench.axis()))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (3, "an object with do, wait or fault"),
        ({}, "an object with do"),
        ({"wait": "long"}, "number of seconds"),
        ({"wait": -1}, "0..60"),
        ({"wait": 1e9}, "0..60"),
        ({"do": "dance"}, "power_on"),
        ({"do": "stop", "mode": 9}, "0..3"),
        ({"do": "stop", "hard": 1}, "allowed: mode"),
        ({"do": "move_absolute"}, "position: None"),
        ({"fault": {"kind": "nonsense"}}, "fault.kind"),
    ],
)
def test_wrong_steps_are_refused(content, words):
    """A step that is wrong names the key and what is allowed."""
    with pytest.raises(ConfigurationError, match=words):
        step_from_json(content)
    with pytest.raises(ConfigurationError):
        Program.from_json({"do": "halt"})


def test_a_script_reads_like_one():
    """A program prints as a numbered list with units."""
    lines = str(TRIP).splitlines()
    assert lines[2] == "3. move_velocity velocity = 100 mm/s"
    assert lines[4] == "5. fault drive.fault (code=8976) immediately"


# -- running
# ----------------------------------------------------------------------------------------------------------


def test_a_program_leaves_evidence_like_a_case():
    """A program that breaks nothing passes, with story, faults, alarms and a digest that repeats."""
    outcome = run_program(TRIP, BENCH, seed=2)
    assert outcome.violation is None
    result = outcome.as_case()
    assert result.verdict is Verdict.PASSED
    assert result.identifier == TRIP.name
    assert [fault.kind for fault in result.faults] == ["drive.fault"]
    assert [alarm.number for alarm in result.alarms] == [421]
    assert "move_velocity velocity = 100 mm/s" in [step.text for step in result.story]
    assert result.trace_digest == run_program(TRIP, BENCH, seed=2).result.trace_digest


def test_a_step_that_the_bench_cannot_do_is_skipped_and_reported():
    """An unsupported fault is skipped with its reason, and the program goes on."""

    class Live(ToyBenchFile):
        def build(self, *, seed):
            bench = ToyBench(seed)
            bench.kind = "live"
            return bench

    program = Program((Break(Fault("frame.corrupt", parameters={"can_id": 1})), Do("power_on"), Wait(0.1)))
    outcome = run_program(program, Live())
    assert outcome.violation is None
    assert len(outcome.skipped) == 1
    assert "bits of the wire" in outcome.skipped[0]


def test_a_crash_is_a_finding():
    """An exception out of the product breaks the invariant that nothing crashes it."""

    class Fragile(ToyBenchFile):
        def build(self, *, seed):
            bench = ToyBench(seed)
            bench.scheduler.at(400_000_000, lambda: 1 // 0)
            return bench

    violation = run_program(TRIP, Fragile()).violation
    assert violation.invariant == "no crash"
    assert "ZeroDivisionError" in violation.text


@pytest.mark.parametrize(
    ("bench", "program", "invariant"),
    [
        (DOUBLE, TRIP, "one job output"),
        (
            DEAF,
            Program((*TRIP.steps[:4], Break(Fault("axis.alarm", parameters={"number": 521, "reaction": 4})))),
            "after an alarm",
        ),
        (
            CREEPING,
            Program((Do("power_on"), Wait(0.3), Do("power_off", {"stop_mode": 1}), Wait(1.0))),
            "without torque",
        ),
        (
            BENCH,
            Program((Do("power_on"), Wait(0.3), Do("move_velocity", {"velocity": 50.0}), Wait(0.5))),
            None,
        ),
    ],
)
def test_planted_defects_break_their_invariant(bench, program, invariant):
    """Each planted defect is noticed by the invariant about it; the sound bench breaks none."""
    violation = run_program(program, bench).violation
    if invariant is None:
        assert violation is None
    else:
        assert invariant in violation.invariant


def test_a_feedback_that_leaves_the_mechanics_is_noticed():
    """A position that drifts away from the mechanics without a declared fault breaks the invariant."""

    class Slipping(ToyBenchFile):
        def build(self, *, seed):
            bench = ToyBench(seed)
            bench.scheduler.at(500_000_000, lambda: bench.toy_drive.jump_encoder(400))
            return bench

    program = Program((Do("power_on"), Wait(1.0)))
    violation = run_program(program, Slipping()).violation
    assert violation.invariant == "position feedback of axis1"
    assert violation.time_s == pytest.approx(0.5, abs=0.01)
    declared = Program(
        (
            Do("power_on"),
            Break(Fault("encoder.jump", trigger=at(0.5), parameters={"increments": 400})),
            Wait(1.0),
        )
    )
    assert run_program(declared, BENCH).violation is None


def test_a_push_or_an_end_stop_is_no_violation():
    """Motion that something else than the drive makes breaks nothing."""
    pushed = Program(
        (Break(Fault("mechanics.load_step", duration_s=0.1, parameters={"force_N": 100.0})), Wait(1.0))
    )
    assert run_program(pushed, BENCH).violation is None


def test_invariants_of_ones_own():
    """The invariants are a list that the caller may extend."""
    from hil.fuzz import Invariant

    class NeverMoves(Invariant):
        name = "never moves"

        def __init__(self, bench):
            self._read = bench.recorder.reader("axis1.actual_velocity")

        def cycle(self):
            return "it moves" if abs(self._read() or 0.0) > 1.0 else ""

    outcome = run_program(
        TRIP, BENCH, invariants=lambda bench: [*default_invariants(bench), NeverMoves(bench)]
    )
    assert outcome.violation.invariant == "never moves"


# -- searching
# ------------------------------------------------------------------------------------------------------


def test_the_search_finds_nothing_on_a_sound_bench():
    """A sound bench survives, and as many programs were run as asked for."""
    report = search(BENCH, cases=40, seed=5)
    assert report.failure is None
    assert report.cases == 40


def test_the_search_finds_shrinks_and_replays_a_defect():
    """A planted defect is found, its program shrunk to the steps that matter, the token leads back to it, and
    the same seed finds the same.
    """
    report = found_defect()
    failure = report.failure
    assert failure.violation.invariant == "one job output"
    assert report.repeatable
    assert len(failure.program.steps) <= 5, str(failure.program)

    token = Token.decode(report.token)
    again = run_program(Program.from_json(token.program), DOUBLE, seed=token.seed)
    assert str(again.violation) == str(failure.violation)
    assert again.trace.digest() == failure.trace.digest()

    repeated = search(DOUBLE, cases=100, longest=8, seed=2)
    assert repeated.failure.program == failure.program
    assert repeated.cases == report.cases


def test_another_seed_searches_elsewhere():
    """The same seed tries the same programs, another one others."""

    def tried(seed):
        seen = []
        search(BENCH, cases=5, seed=seed, on_run=lambda count, outcome: seen.append(outcome.program))
        return seen

    assert tried(1) == tried(1)
    assert tried(1) != tried(2)


def test_a_bench_that_does_not_repeat_is_reported():
    """A failing program that leaves another trace when it is run again is reported as not repeatable."""

    class NoisyDouble(ToyBenchFile):
        def build(self, *, seed):
            bench = ToyBench(seed, "not_repeatable")
            bench.toy_axis.defect = "done_and_error"
            return bench

    assert NOISY.defect == "not_repeatable"
    report = search(NoisyDouble(), cases=100, longest=8, seed=2)
    assert report.failure is not None
    assert not report.repeatable


def test_tokens_of_programs_are_short_enough_to_paste():
    """The token of a shrunk program fits into a few lines."""
    assert len(program_token(TRIP, seed=1, bench="reference", bench_digest="0" * 64)) < 500


def test_injected_faults_of_a_program_do_not_survive_it():
    """Each program gets a fresh bench: what one has broken does not meet the next."""
    run_program(Program((Break(Fault("mechanics.jam")),)), BENCH)
    assert run_program(TRIP, BENCH, seed=2).violation is None
    assert Injector(ToyBench()).armed == []
