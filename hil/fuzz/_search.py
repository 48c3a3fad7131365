"""The search: programs are generated, those that reach something new are built upon, a failing one is shrunk."""

from __future__ import annotations

import contextlib
import functools
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Final

from hil.campaign import load_bench_file
from hil.errors import CannotRunError
from hil.fuzz._invariants import Violation, default_invariants
from hil.fuzz._program import Program, job_names
from hil.fuzz._run import FuzzOutcome, InvariantFactory, program_token, run_program
from hil.fuzz._situations import Situation, situations_of
from hil.fuzz._strategies import PREAMBLE, descendants, fault_kinds, programs, steps
from reports.model import Verdict

ROUND: Final = 10
"""Programs of a round, which is what a process does at a time."""
ROUNDS: Final = 4
"""Rounds of a generation: they know the same parents, so that the number of processes does not matter."""
PARENTS: Final = 200
"""Of so many programs, the latest that reached something new, further ones are made."""


@dataclass(slots=True)
class FuzzReport:
    """What a search has found."""

    cases: int
    """Programs that were run (without those of shrinking)."""
    seed: int
    failure: FuzzOutcome | None = None
    """The smallest program that breaks an invariant; None when none was found."""
    token: str = ""
    repeatable: bool = True
    """Whether the failing program gave the same trace when it was run again."""
    shrink_runs: int = 0
    others: list[str] = field(default_factory=list)
    """Further broken invariants met on the way, as text."""
    reached: frozenset[Situation] = frozenset()
    """All situations that the programs went through."""
    known: int = 0
    """How many of them the programs that were given at the begin had reached."""
    never: tuple[str, ...] = ()
    """Fault kinds that this bench can inject and that never acted."""


@dataclass(frozen=True, slots=True)
class _Round:
    """What a process is asked to do; plain data."""

    seed: int
    bench_seed: int
    cases: int
    longest: int
    kinds: tuple[str, ...]
    jobs: tuple[str, ...]
    identifiers: dict[str, int]
    parents: tuple[Program, ...]


@dataclass(slots=True)
class _Found:
    """What came out of a round; plain data."""

    tried: list[tuple[Program, frozenset[Situation], bool]] = field(default_factory=list)
    """Programs, what they reached, and whether they broke nothing."""
    failing: tuple[Program, Violation] | None = None
    shrink_runs: int = 0
    others: list[str] = field(default_factory=list)


class _FoundError(Exception):
    """Tells Hypothesis that a program fails."""


OnRun = Callable[[int, FuzzOutcome | None], None]
"""Called with the number of runs so far and the last outcome; None where that stayed in another process."""


def search(
    bench_file: Any,
    *,
    cases: int,
    seed: int = 0,
    longest: int = 12,
    bench: str = "",
    invariants: InvariantFactory = default_invariants,
    jobs: int = 1,
    parents: Sequence[Program] = (),
    on_new: Callable[[Program], None] | None = None,
    on_run: OnRun | None = None,
) -> FuzzReport:
    """Look for a program that breaks an invariant.

    The search works in generations. Half of the programs of a generation are drawn anew, the others go on from programs which reached
    situations (`situations_of`) that none before them had reached. The same arguments, `jobs` aside, give the same
    programs. Bench and product must be deterministic, which a failing program is tested for by running it once more.

    Args:
        bench_file: Builds the benches.
        cases: Programs to try, those of `parents` included.
        seed: Seed of the search and of the benches.
        longest: Greatest number of steps after the preamble.
        bench: Reference of the bench, for the token and for other processes.
        invariants: Makes the invariants for a bench; with `jobs` > 1 a function that other processes can import.
        jobs: Processes.
        parents: Programs to begin with; they are run first.
        on_new: Called with each program that has reached something new.
        on_run: Called after every program, or with `jobs` > 1 after every round.

    Raises:
        CannotRunError: `jobs` < 1, or `jobs` > 1 and no reference of the bench.

    """
    if jobs < 1:
        raise CannotRunError(f"{jobs} processes are not possible; give 1 or more")
    if jobs > 1 and load_bench_file(bench or None).digest != bench_file.digest:
        raise CannotRunError("a search on several processes needs the reference of its bench")
    with bench_file.build(seed=seed) as sample:
        kinds, identifiers = tuple(fault_kinds(sample)), _identifiers(sample)
        names = job_names(sample.axis())
    report = FuzzReport(0, seed)
    lineage: list[Program] = []
    reached: set[Situation] = set()
    acted: set[str] = set()
    runs = 0

    def count(outcome: FuzzOutcome) -> None:
        nonlocal runs
        runs += 1
        if on_run is not None:
            on_run(runs, outcome)

    def take(found: _Found) -> None:
        report.cases += len(found.tried)
        report.shrink_runs += found.shrink_runs
        report.others += [text for text in found.others if text not in report.others]
        for program, situations, sound in found.tried:
            acted.update(situation[1] for situation in situations if situation[0] == "fault")
            if not situations <= reached:
                reached.update(situations)
                if sound:
                    lineage.append(program)
                    if on_new is not None:
                        on_new(program)

    failing = None
    for program in parents[:cases]:
        found = _Found()
        attempt = _Attempt(bench_file, seed, invariants, count, found)
        with contextlib.suppress(_FoundError):
            attempt(program)
        attempt.finish()
        take(found)
        failing = found.failing
        if failing is not None:
            break
    report.known = len(reached)
    with _pool(jobs) as pool:
        generation = 0
        while failing is None and report.cases < cases:
            orders = []
            left = cases - report.cases
            for number in range(ROUNDS):
                size = min(ROUND, left)
                left -= size
                if size:
                    orders.append(
                        _Round(
                            seed * 1_000_003 + generation * ROUNDS + number, seed, size,
                            longest, kinds, names, identifiers, tuple(lineage[-PARENTS:]),
                        )
                    )  # fmt: skip
            generation += 1
            if pool is None:
                results: Iterator[_Found] = (_do(order, bench_file, invariants, count) for order in orders)
            else:
                results = pool.map(_do_there, [(order, bench, invariants) for order in orders])
            for found in results:
                take(found)
                if pool is not None and on_run is not None:
                    on_run(report.cases, None)
                if found.failing is not None:
                    failing = found.failing
                    break
    report.reached = frozenset(reached)
    report.never = tuple(kind for kind in kinds if kind not in acted)
    if failing is not None:
        _tell(report, *failing, bench_file=bench_file, bench=bench, invariants=invariants)
    return report


@contextlib.contextmanager
def _pool(jobs: int) -> Iterator[ProcessPoolExecutor | None]:
    if jobs == 1:
        yield None
        return
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_prepare, initargs=(list(sys.path),))
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _prepare(path: list[str]) -> None:
    """Set up a process: it leaves Ctrl-C to the command, ends with it, and finds modules where it does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    sys.path[:] = path

    def end_with_parent() -> None:
        # The pool's own queues do not tell: every process holds both of their ends.
        parent = multiprocessing.parent_process()
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


def _do_there(task: tuple[_Round, str, InvariantFactory]) -> _Found:
    """Do a round in another process."""
    order, bench, invariants = task
    return _do(order, load_bench_file(bench or None), invariants, lambda _outcome: None)


def _do(
    order: _Round, bench_file: Any, invariants: InvariantFactory, count: Callable[[FuzzOutcome], None]
) -> _Found:
    """Try the programs of a round; the first that breaks an invariant is shrunk, and ends it."""
    import hypothesis
    from hypothesis import strategies as st
    from hypothesis.errors import FlakyFailure

    from hil.fuzz._provider import BACKEND

    found = _Found()
    attempt = _Attempt(bench_file, order.bench_seed, invariants, count, found)
    strategy = programs(order.kinds, order.identifiers, jobs=order.jobs, longest=order.longest)
    if order.parents:
        step = steps(order.kinds, order.identifiers, order.jobs)
        longest = order.longest + len(PREAMBLE)
        strategy = st.one_of(strategy, descendants(order.parents, step, longest=longest))
    settings = hypothesis.settings(
        max_examples=order.cases, deadline=None, database=None, derandomize=False, print_blob=False,
        report_multiple_bugs=False, verbosity=hypothesis.Verbosity.quiet,
        suppress_health_check=list(hypothesis.HealthCheck),
        phases=(hypothesis.Phase.generate, hypothesis.Phase.shrink), backend=BACKEND,
    )  # fmt: skip

    def test(program: Program) -> None:
        attempt(program)

    run: Any = settings(hypothesis.given(strategy)(test))
    with contextlib.suppress(_FoundError, FlakyFailure):
        hypothesis.seed(order.seed)(run)()
    attempt.finish()
    return found


class _Attempt:
    """Runs one program after the other, and keeps the smallest of those that break the same invariant as the first did."""

    def __init__(
        self,
        bench_file: Any,
        seed: int,
        invariants: InvariantFactory,
        count: Callable[[FuzzOutcome], None],
        found: _Found,
    ) -> None:
        self._run = functools.partial(run_program, bench_file=bench_file, seed=seed, invariants=invariants)
        self._count = count
        self._found = found
        self._smallest: tuple[Program, Violation] | None = None

    def __call__(self, program: Program) -> None:
        """Run a program; raises `_FoundError` when it fails as it should."""
        outcome = self._run(program)
        self._count(outcome)
        violation = outcome.violation
        if self._smallest is None:
            self._found.tried.append((program, situations_of(outcome.trace), violation is None))
        else:
            self._found.shrink_runs += 1
        if violation is None:
            return
        if self._smallest is None:
            self._smallest = program, violation
        elif violation.invariant != self._smallest[1].invariant:
            # Shrinking must not slip from one finding to another.
            text = str(violation)
            if text not in self._found.others:
                self._found.others.append(text)
            return
        elif _weight(program) <= _weight(self._smallest[0]):
            self._smallest = program, violation
        raise _FoundError

    def finish(self) -> None:
        """Leave out one step after the other as long as the program still fails: those of a parent are not drawn one by one."""
        if self._smallest is None:
            return
        program = self._smallest[0]
        for place in reversed(range(len(program.steps))):
            shorter = Program((*program.steps[:place], *program.steps[place + 1 :]))
            if not shorter.steps:
                break
            try:
                self(shorter)
            except _FoundError:
                program = shorter
        self._found.failing = self._smallest


def _tell(
    report: FuzzReport,
    program: Program,
    violation: Violation,
    *,
    bench_file: Any,
    bench: str,
    invariants: InvariantFactory,
) -> None:
    """Run the failing program here, twice: for its evidence, and to see whether it repeats."""
    failure = run_program(program, bench_file, seed=report.seed, invariants=invariants)
    again = run_program(program, bench_file, seed=report.seed, invariants=invariants)
    report.failure = failure
    report.repeatable = failure.violation is not None and again.trace.digest() == failure.trace.digest()
    if failure.violation is None:
        failure.violation = violation
        failure.result.verdict = Verdict.FAILED
        failure.result.message = f"{violation}; not so when it was run again"
    report.token = program_token(program, seed=report.seed, bench=bench, bench_digest=bench_file.digest)
    failure.result.token = report.token


def _identifiers(bench: Any) -> dict[str, int]:
    """Return the identifiers of the drive's frames; none where it is not on CAN."""
    name = bench.drive().name
    on_modbus = str(getattr(bench.segment(), "kind", "")).startswith("modbus")
    return {} if on_modbus else bench.cob_ids(name)


def _weight(program: Program) -> tuple[int, int]:
    return len(program.steps), len(str(program))
