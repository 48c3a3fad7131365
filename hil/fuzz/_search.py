"""The search: programs are generated, those that reach something new are built
upon, a failing one is shrunk.
"""

from __future__ import annotations

import contextlib
import functools
import multiprocessing
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import ConfigurationError
from hil._interrupt import end_with_parent
from hil.campaign import load_bench_file
from hil.campaign._worker import bench_of
from hil.errors import CannotRunError
from hil.fuzz._choices import whole
from hil.fuzz._configuration import MACHINE, bench_file_of
from hil.fuzz._configuration_strategies import configurations
from hil.fuzz._invariants import Violation, default_invariants
from hil.fuzz._machines import Machine, on_machines
from hil.fuzz._program import Program
from hil.fuzz._run import FuzzOutcome, InvariantFactory, program_token, run_program
from hil.fuzz._situations import Situation, configured, situations_of
from hil.fuzz._strategies import UNCHANGED, descendants
from reports.model import Verdict

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.protocols import BenchFile

ROUND: Final = 10
"""Programs of a round, which is what a process does at a time."""
ROUNDS: Final = 4
"""Rounds of a generation: they know the same parents, so that the number of processes does not matter."""
PARENTS: Final = 200
"""Of so many programs, the latest that reached something new, further ones are made."""


@dataclass
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
    refused: int = 0
    """Programs, counted among `cases`, whose configuration the bench file has refused."""


@dataclass(frozen=True)
class _Round:
    """What a process is asked to do; plain data."""

    seed: int
    bench_seed: int
    cases: int
    longest: int
    configurations: bool
    machine: Machine
    parents: tuple[Program, ...]
    machines: tuple[str, ...] = ()


@dataclass
class _Found:
    """What came out of a round; plain data."""

    tried: list[tuple[Program, frozenset[Situation], bool]] = field(default_factory=list)
    """Programs, what they reached, and whether they broke nothing."""
    refused: int = 0
    failing: tuple[Program, Violation] | None = None
    shrink_runs: int = 0
    others: list[str] = field(default_factory=list)


class _FoundError(Exception):
    """Tells Hypothesis that a program fails."""


OnRun = Callable[[int, FuzzOutcome | None], None]
"""Called with the number of runs so far and the last outcome; None where that stayed in another process."""


def search(
    bench_file: BenchFile[Bench],
    *,
    cases: int,
    seed: int = 0,
    longest: int = 12,
    configurations: bool = False,
    axes: int = 1,
    machines: Sequence[str] = (),
    bench: str = "",
    invariants: InvariantFactory = default_invariants,
    jobs: int = 1,
    parents: Sequence[Program] = (),
    on_new: Callable[[Program], None] | None = None,
    on_run: OnRun | None = None,
) -> FuzzReport:
    """Look for a program that breaks an invariant.

    The search works in generations. Half of the programs of a generation are new, the others continue
    from programs which reached situations (`situations_of`) that none before them had reached. The same
    arguments, `jobs` aside, give the same programs. Bench and product must be deterministic, which a failing
    program is tested for by running it once more.

    Args:
        bench_file: Builds the benches.
        cases: Programs to try, those of `parents` included.
        seed: Seed of the search and of the benches.
        longest: Greatest number of steps after the preamble.
        configurations: Whether the programs change the bench file as well.
        axes: Number of axes that the programs give instructions to, the first ones of the bench; more than
            one of them may follow each other.
        machines: Names of configurations of the bench; half of the programs run on one of them instead, with
            up to three axes.
        bench: Reference of the bench, for the token and for other processes.
        invariants: Makes the invariants for a bench; with `jobs` > 1 a function
            that other processes can import.
        jobs: Processes.
        parents: Programs to begin with; they are run first.
        on_new: Called with each program that has reached something new.
        on_run: Called after every program, or with `jobs` > 1 after every round.

    Raises:
        CannotRunError: `jobs` < 1, or `jobs` > 1 and no reference of the bench, or configurations of a
            bench without a file, or more axes than the bench has.

    """
    if jobs < 1:
        raise CannotRunError(f"{jobs} processes are not possible; give 1 or more")
    if jobs > 1 and load_bench_file(bench or None).digest != bench_file.digest:
        raise CannotRunError("a search on several processes needs the reference of its bench")
    if configurations:
        bench_file_of(bench_file)  # raises where there is none
    running = _Search(bench_file, cases, seed, invariants=invariants, on_new=on_new, on_run=on_run)
    with bench_file.build(seed=seed) as sample:
        plan = _Round(
            0,
            seed,
            0,
            longest,
            configurations,
            Machine.of(sample, axes),
            (),
            tuple(machines),
        )
    running.begin_with(parents)
    with _pool(jobs) as pool:
        running.go_on(plan, pool, bench)
    return running.finish(plan.machine.kinds, bench)


class _Search:
    """What a search has met so far."""

    def __init__(
        self,
        bench_file: BenchFile[Bench],
        cases: int,
        seed: int,
        *,
        invariants: InvariantFactory,
        on_new: Callable[[Program], None] | None,
        on_run: OnRun | None,
    ) -> None:
        self.report = FuzzReport(0, seed)
        self._bench_file = bench_file
        self._cases = cases
        self._invariants = invariants
        self._on_new = on_new
        self._on_run = on_run
        self._failing: tuple[Program, Violation] | None = None
        self._lineage: list[Program] = []
        self._reached: set[Situation] = set()
        self._acted: set[str] = set()
        self._runs = 0

    def begin_with(self, parents: Sequence[Program]) -> None:
        """Run the programs that are there already."""
        for program in parents[: self._cases]:
            attempt = _Attempt(self._bench_file, self.report.seed, self._invariants, self._count)
            with contextlib.suppress(_FoundError):
                attempt.one(program)
            if self._take(attempt.finish()):
                break
        self.report.known = len(self._reached)

    def go_on(self, plan: _Round, pool: ProcessPoolExecutor | None, bench: str) -> None:
        """Do rounds until a program fails or there are enough of them."""
        generation = 0
        while self._failing is None and self.report.cases < self._cases:
            orders = self._generation(plan, generation)
            generation += 1
            if pool is None:
                results: Iterator[_Found] = (
                    _do(order, self._bench_file, self._invariants, self._count) for order in orders
                )
            else:
                results = pool.map(_do_there, [(order, bench, self._invariants) for order in orders])
            for found in results:
                failing = self._take(found)
                if pool is not None and self._on_run is not None:
                    self._on_run(self.report.cases, None)
                if failing:
                    break

    def _generation(self, plan: _Round, generation: int) -> list[_Round]:
        """Return the next rounds: whatever comes out of one of them, the others know the same parents."""
        left = self._cases - self.report.cases
        sizes = [max(min(ROUND, left - number * ROUND), 0) for number in range(ROUNDS)]
        first = self.report.seed * 1_000_003 + generation * ROUNDS
        parents = tuple(self._lineage[-PARENTS:])
        return [
            replace(plan, seed=first + number, cases=size, parents=parents)
            for number, size in enumerate(sizes)
            if size
        ]

    def _count(self, outcome: FuzzOutcome | None) -> None:
        self._runs += 1
        if self._on_run is not None:
            self._on_run(self._runs, outcome)

    def _take(self, found: _Found) -> bool:
        """Take note of a round; returns whether it has found a program that fails."""
        report = self.report
        report.cases += len(found.tried) + found.refused
        report.refused += found.refused
        report.shrink_runs += found.shrink_runs
        report.others += [text for text in found.others if text not in report.others]
        for program, situations, sound in found.tried:
            self._acted.update(situation[1] for situation in situations if situation[0] == "fault")
            if not situations <= self._reached:
                self._reached.update(situations)
                if sound:
                    self._lineage.append(program)
                    if self._on_new is not None:
                        self._on_new(program)
        self._failing = found.failing
        return self._failing is not None

    def finish(self, kinds: Sequence[str], bench: str) -> FuzzReport:
        """Return the report, with the evidence of the failing program."""
        report = self.report
        report.reached = frozenset(self._reached)
        report.never = tuple(kind for kind in kinds if kind not in self._acted)
        if self._failing is not None:
            _tell(
                report, *self._failing, bench_file=self._bench_file, bench=bench, invariants=self._invariants
            )
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
    end_with_parent()


def _do_there(task: tuple[_Round, str, InvariantFactory]) -> _Found:
    """Do a round in another process."""
    order, bench, invariants = task
    return _do(order, bench_of(bench), invariants, lambda _outcome: None)


def _do(
    order: _Round,
    bench_file: BenchFile[Bench],
    invariants: InvariantFactory,
    count: Callable[[FuzzOutcome | None], None],
) -> _Found:
    """Try the programs of a round; the first that breaks an invariant is shrunk, and ends it."""
    import hypothesis
    from hypothesis import strategies as st
    from hypothesis.errors import FlakyFailure, HypothesisWarning

    from hil.fuzz._provider import BACKEND

    attempt = _Attempt(bench_file, order.bench_seed, invariants, count)
    changes = configurations(bench_file_of(bench_file).config) if order.configurations else UNCHANGED
    strategy = order.machine.programs(order.longest, changes)
    if order.machines:
        strategy = st.one_of(whole(strategy), whole(on_machines(order.machines, order.longest)))
    if order.parents:
        step = order.machine.steps()
        longest = order.longest + len(order.machine.preamble())
        others = changes if order.configurations else None
        strategy = st.one_of(
            strategy, descendants(order.parents, step, longest=longest, configurations=others)
        )
    settings = hypothesis.settings(
        max_examples=order.cases,
        deadline=None,
        database=None,
        derandomize=False,
        print_blob=False,
        report_multiple_bugs=False,
        verbosity=hypothesis.Verbosity.quiet,
        suppress_health_check=list(hypothesis.HealthCheck),
        phases=(hypothesis.Phase.generate, hypothesis.Phase.shrink),
        backend=BACKEND,
    )

    run: Any = settings(hypothesis.given(strategy)(attempt.one))
    with warnings.catch_warnings(), contextlib.suppress(_FoundError, FlakyFailure):
        # It finds the text of a strategy for many machines long, which nobody reads.
        warnings.simplefilter("ignore", HypothesisWarning)
        hypothesis.seed(order.seed)(run)()
    return attempt.finish()


class _Attempt:
    """Runs one program after the other, and keeps the smallest of those that break the same invariant as the
    first did.
    """

    def __init__(
        self,
        bench_file: BenchFile[Bench],
        seed: int,
        invariants: InvariantFactory,
        count: Callable[[FuzzOutcome | None], None],
    ) -> None:
        self._run = functools.partial(
            run_program, bench_file=bench_file, seed=seed, invariants=invariants, evidence=False
        )
        self._count = count
        self._found = _Found()

    def one(self, program: Program) -> None:
        """Run a program; raises `_FoundError` when it fails as it should."""
        found = self._found
        smallest = found.failing
        try:
            outcome = self._run(program)
        except ConfigurationError:
            # The bench file does not hold together with this configuration, and has said so.
            found.refused += smallest is None
            self._count(None)
            return
        self._count(outcome)
        violation = outcome.violation
        if smallest is None:
            reached = situations_of(outcome.trace) | configured(program.configuration)
            found.tried.append((program, reached, violation is None))
        else:
            found.shrink_runs += 1
        if violation is None:
            return
        if smallest is not None and violation.invariant != smallest[1].invariant:
            # Shrinking must not slip from one finding to another.
            text = str(violation)
            if text not in found.others:
                found.others.append(text)
            return
        if smallest is None or _weight(program) <= _weight(smallest[0]):
            found.failing = program, violation
        raise _FoundError

    def finish(self) -> _Found:
        """Return what was found, a failing program without whatever does not matter: that of a parent is not
        drawn part by part.
        """
        found = self._found
        if found.failing is None:
            return found
        program = found.failing[0]
        for name in program.configuration.parts:
            if name == MACHINE:
                continue  # its steps name the axes of this machine
            program = self._shorter(program, Program(program.steps, program.configuration.without(name)))
        for place in reversed(range(len(program.steps))):
            steps = (*program.steps[:place], *program.steps[place + 1 :])
            if not steps:
                break
            program = self._shorter(program, Program(steps, program.configuration))
        return found

    def _shorter(self, program: Program, shorter: Program) -> Program:
        """Return the shorter one if it fails as well."""
        try:
            self.one(shorter)
        except _FoundError:
            return shorter
        return program


def _tell(
    report: FuzzReport,
    program: Program,
    violation: Violation,
    *,
    bench_file: BenchFile[Bench],
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


def _weight(program: Program) -> tuple[int, int]:
    return len(program.steps) + len(program.configuration.parts), len(str(program))
