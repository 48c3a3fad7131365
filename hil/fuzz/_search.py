"""The search: Hypothesis generates programs, a failing one is shrunk, replayed and handed back."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from hil.fuzz._invariants import default_invariants
from hil.fuzz._program import Program
from hil.fuzz._run import FuzzOutcome, InvariantFactory, program_token, run_program
from hil.fuzz._strategies import fault_kinds, programs


@dataclass(slots=True)
class FuzzReport:
    """What a search has found."""

    cases: int
    """Programs that were generated and run (without those of shrinking)."""
    seed: int
    failure: FuzzOutcome | None = None
    """The smallest program that breaks an invariant; None when none was found."""
    token: str = ""
    repeatable: bool = True
    """Whether the failing program gave the same trace when it was run again."""
    shrink_runs: int = 0
    others: list[str] = field(default_factory=list)
    """Further broken invariants met on the way, as text."""


class _FoundError(Exception):
    """Tells Hypothesis that a program fails."""


def search(
    bench_file: Any,
    *,
    cases: int,
    seed: int = 0,
    longest: int = 12,
    bench: str = "",
    invariants: InvariantFactory = default_invariants,
    on_run: Callable[[int, FuzzOutcome], None] | None = None,
) -> FuzzReport:
    """Look for a program that breaks an invariant.

    The same arguments give the same programs. Bench and product must be deterministic, which a failing program is
    tested for by running it once more.

    Args:
        bench_file: Builds the benches.
        cases: Programs to try.
        seed: Seed of the search and of the benches.
        longest: Greatest number of steps after the preamble.
        bench: Reference of the bench, for the token.
        invariants: Makes the invariants for a bench.
        on_run: Called after every program with the number of runs so far.

    """
    import hypothesis
    from hypothesis.errors import FlakyFailure

    with bench_file.build(seed=seed) as sample:
        strategy = programs(fault_kinds(sample), _identifiers(sample), longest=longest)
    report = FuzzReport(0, seed)
    runs = 0

    def attempt(program: Program) -> None:
        nonlocal runs
        outcome = run_program(program, bench_file, seed=seed, invariants=invariants)
        runs += 1
        if report.failure is None:
            report.cases += 1
        else:
            report.shrink_runs += 1
        if on_run is not None:
            on_run(runs, outcome)
        if outcome.violation is None:
            return
        if report.failure is not None and report.failure.violation is not None:
            if outcome.violation.invariant != report.failure.violation.invariant:
                # Shrinking must not slip from one finding to another.
                text = str(outcome.violation)
                if text not in report.others:
                    report.others.append(text)
                return
            if _weight(outcome.program) <= _weight(report.failure.program):
                report.failure = outcome
        else:
            report.failure = outcome
        raise _FoundError

    settings = hypothesis.settings(
        max_examples=cases, deadline=None, database=None, derandomize=False, print_blob=False,
        report_multiple_bugs=False, verbosity=hypothesis.Verbosity.quiet,
        suppress_health_check=list(hypothesis.HealthCheck),
        phases=(hypothesis.Phase.generate, hypothesis.Phase.shrink),
    )  # fmt: skip
    test = hypothesis.seed(seed)(settings(hypothesis.given(strategy)(attempt)))
    with contextlib.suppress(_FoundError, FlakyFailure):
        test()
    if report.failure is not None:
        failure = report.failure
        again = run_program(failure.program, bench_file, seed=seed, invariants=invariants)
        report.repeatable = again.trace.digest() == failure.trace.digest()
        report.token = program_token(failure.program, seed=seed, bench=bench, bench_digest=bench_file.digest)
        failure.result.token = report.token
    return report


def _identifiers(bench: Any) -> dict[str, int]:
    """Return the identifiers of the drive's frames; none where it is not on CAN."""
    name = bench.drive().name
    on_modbus = str(getattr(bench.segment(), "kind", "")).startswith("modbus")
    return {} if on_modbus else bench.cob_ids(name)


def _weight(program: Program) -> tuple[int, int]:
    return len(program.steps), len(str(program))
