"""The whole of it: baseline first, then every defect against the cases that can notice it."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import reduce
from operator import or_
from typing import Any, Final

from fieldbus import core_build
from hil._digests import product_digest
from hil._workers import CopyStarter, Pool, number_of_processes
from hil.errors import CannotRunError
from hil.mutants._coverage import Coverage, Covered, MarkNumbers, modules_in, scope_of
from hil.mutants._difference import differences_of
from hil.mutants._marks import Marks, Place, marks_of, places_of
from hil.mutants._mutant import Mutant
from hil.mutants._patch import TargetChangedError, defect_patch
from hil.mutants._plan import Judge, hinted, in_order, in_turn, modules_of, most_different, most_special
from hil.mutants._tests import is_test_file
from hil.mutants._worker import Finished, Outcome, Task, run_tasks

BASELINE_LIMIT_S: Final = 300.0
"""Limit of processor time of a case without defect, s."""
LIMIT_FACTOR: Final = 20.0
LEAST_LIMIT_S: Final = 20.0
"""A case with a defect may take so many times the time it takes without one, and at least this long, s."""
STANDSTILL_S: Final = 60.0
"""A process that uses no processor time for so much wall time hangs, s."""
_CHUNK: Final = 24
"""Cases of the baseline that one process runs."""
_BEST: Final = 3
"""Cases that are tried for every defect before any others."""
_NEAREST: Final = 3
"""Cases that are named for a survivor."""
_LOOKED_AT: Final = 10
"""So many times as many cases are looked at for a difference as are tried."""
_SPECIAL: Final = 4
"""One of so many cases that are tried looks at little else than the modules of the defect."""

OnResult = Callable[["MutantResult", int, int], None]
OnBaseline = Callable[[Outcome, int, int], None]
OnLook = Callable[[int, int], None]


@dataclass(frozen=True)
class SeedingOptions:
    """How defects are judged."""

    jobs: int = 1
    seed: int = 0
    """Seed of the run, as it is shown."""
    case_seed: int = 0
    """Seed of the cases."""
    every_case: bool = False
    """Run every case that can notice a defect, not only until the first that does."""
    limit_s: float = 0.0
    """Limit of processor time of a case, s; 0: from the time that it takes without a defect."""
    budget_s: float = 0.0
    """Wall time after which nothing further begins, s; at most half of it goes into cases without a defect.
    0: no limit."""
    most_cases: int = 0
    """So many of the cases that come to the changed statement are tried, as different as can be; 0: all."""
    drops_red: bool = False
    """A case that is red without a defect is left out, not the end of the run."""


def changes_of(mutant: Mutant) -> list[dict[str, str]]:
    """Return the changes of a mutant as plain data."""
    return [{"target": edit.target, "old": edit.old, "new": edit.new} for edit in mutant.edits]


@dataclass
class MutantResult:
    """What became of one defect."""

    mutant: Mutant
    outcomes: list[Outcome] = field(default_factory=list)
    """Of the cases run, in order."""
    able: int = 0
    """Cases known to come to the changed statement."""
    error: str = ""
    """Why it could not be judged."""
    changed: list[str] = field(default_factory=list)
    """Names of the cases that did not notice it although it changed their trace."""
    looked_at: int = 0
    """Cases in which it was looked whether it makes a difference where it is."""
    different: int = 0
    """Those of them in which it does."""
    nearest: list[str] = field(default_factory=list)
    """Names of a few cases in which it makes a difference, or else of some that come to it."""
    over: bool = False
    """Whether it is judged for good: no more cases are tried."""
    earlier: Mapping[str, Any] | None = None
    """What an earlier run found, as `as_dict` gave it; None: it is judged in this run."""

    @property
    def caught_by(self) -> list[Outcome]:
        """Outcomes of the cases that were red."""
        if self.earlier is not None:
            plain = self.earlier
            return [
                Outcome(
                    judge=Judge(name, "", ""),
                    verdict=plain["how"],
                    message=plain["message"],
                    seconds=0.0,
                    reached=frozenset(),
                    requirements=tuple(plain["broken"]),
                    check=plain["check"],
                    rule=plain["rule"],
                )
                for name in plain["caught_by"]
            ]
        return [outcome for outcome in self.outcomes if outcome.catches]

    @property
    def seconds(self) -> float:
        """Processor time of the cases up to the first that caught it, or of all, s."""
        if self.earlier is not None:
            return float(self.earlier["seconds"])
        total = 0.0
        for outcome in self.outcomes:
            total += outcome.seconds
            if outcome.catches:
                break
        return total

    @property
    def caught(self) -> bool:
        """Whether at least one case was red."""
        return bool(self.caught_by)

    @property
    def status(self) -> str:
        """`caught`, `explained` (no case can notice it, with a reason),
        `survived`, `never ran`, or `error`.
        """
        if self.earlier is not None:
            return str(self.earlier["status"])
        if self.error:
            return "error"
        if self.caught:
            return "caught"
        if not self.able:
            return "never ran"
        return "explained" if self.mutant.explained else "survived"

    def as_dict(self) -> dict[str, object]:
        """Return the result as plain data, as `hil mutants --json` prints it."""
        if self.earlier is not None:
            return dict(self.earlier)
        caught_by = self.caught_by
        first = caught_by[0] if caught_by else None
        return {
            "name": self.mutant.name,
            "area": self.mutant.area,
            "title": self.mutant.title,
            "requirements": list(self.mutant.requirements),
            "targets": [edit.target for edit in self.mutant.edits],
            "changes": changes_of(self.mutant),
            "status": self.status,
            "caught_by": [outcome.judge.name for outcome in caught_by],
            "how": "" if first is None else first.verdict,
            "message": self.error if first is None else first.message,
            "seconds": round(self.seconds, 3),
            "cases_run": len(self.outcomes),
            "cases_reaching_it": self.able,
            "changed_trace_of": list(self.changed),
            "cases_looked_at": self.looked_at,
            "cases_with_a_difference": self.different,
            "nearest": list(self.nearest) if self.status == "survived" else [],
            "explained": self.mutant.explained,
            "operator": self.mutant.operator,
            "check": "" if first is None else first.check,
            "rule": first is not None and first.rule,
            "broken": [] if first is None else list(first.requirements),
        }


@dataclass
class Seeding:
    """A finished run."""

    results: list[MutantResult] = field(default_factory=list)
    baseline: dict[Judge, Outcome] = field(default_factory=dict)
    red: list[Outcome] = field(default_factory=list)
    """Cases that fail without any defect; with one of them no defect is judged."""
    seconds: float = 0.0
    baseline_seconds: float = 0.0
    unknown: int = 0
    """Cases that there was no time to run without a defect."""
    measured: int = 0
    """Cases that ran without any defect; of the others it was known what they come to."""
    interrupted: bool = False
    """Whether it ended before every defect was judged, or has not ended yet."""
    seed: int = 0
    product: str = ""
    """Digest of the product that is changed."""
    judged_by: str = ""
    """Digest of the cases that judge and of their benches' names: with others the
    results would not be comparable.
    """

    def count(self, status: str) -> int:
        """Return how many defects ended so."""
        return sum(result.status == status for result in self.results)

    @property
    def exit_code(self) -> int:
        """0: every defect caught or explained; 1: one survived; 2: it could not run."""
        if self.red or self.interrupted or self.count("error") or not self.results:
            return 2
        return 1 if self.count("survived") + self.count("never ran") else 0

    def as_dict(self) -> dict[str, object]:
        """Return the run as plain data: `mutants.json` of the report folder."""
        return {
            "mutants": [result.as_dict() for result in self.results],
            "caught": self.count("caught"),
            "explained": self.count("explained"),
            "survived": self.count("survived"),
            "never_ran": self.count("never ran"),
            "baseline_cases": len(self.baseline),
            "baseline_red": [outcome.judge.name for outcome in self.red],
            "baseline_measured": self.measured,
            "baseline_left_out": self.unknown,
            "baseline_seconds": round(self.baseline_seconds, 1),
            "seconds": round(self.seconds, 1),
            "interrupted": self.interrupted,
            "seed": self.seed,
            "product": self.product,
            "judged_by": self.judged_by,
        }


def digest_of(judges: Iterable[Judge]) -> str:
    """Return a digest of the names of cases, with campaign and bench."""
    text = "\n".join(sorted(f"{judge.campaign} {judge.name}" for judge in judges))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class Seeder:
    """Judges defects by cases.

    Args:
        mutants: The defects.
        judges: The cases, on their benches.
        options: How.
        on_baseline: Called after every case of the baseline with its outcome, the number done and the
            number of all.
        on_result: The same for every defect.
        on_look: Called after every case in which it was looked whether defects make a difference, with the
            number done and the number of all.
        earlier: Results of an earlier run that are kept.
        earlier_seconds: Wall time that went into them, s.
        coverage: What is known of the cases without a defect; None: nothing.

    """

    def __init__(
        self,
        mutants: Sequence[Mutant],
        judges: Sequence[Judge],
        options: SeedingOptions,
        *,
        on_baseline: OnBaseline | None = None,
        on_result: OnResult | None = None,
        on_look: OnLook | None = None,
        earlier: Iterable[MutantResult] = (),
        earlier_seconds: float = 0.0,
        coverage: Coverage | None = None,
    ) -> None:
        if not judges:
            raise CannotRunError("nothing to do: there are no cases")
        if core_build.kind() == core_build.COMPILED:
            raise CannotRunError(f"defects are seeded into ordinary Python: set {core_build.VARIABLE}=pure")
        self._mutants = list(mutants)
        self._judges = list(judges)
        self._options = options
        self._on_baseline = on_baseline
        self._on_result = on_result
        self._on_look = on_look
        start = CopyStarter(["hil.mutants._preload", *modules_of(judges)])
        self._pool = Pool[Task, Outcome | None](
            number_of_processes(options.jobs), start, reuse=False, standstill_s=STANDSTILL_S
        )
        self._seeding = Seeding(seed=options.seed, product=product_digest(), judged_by=digest_of(judges))
        self._done: dict[str, MutantResult] = {result.mutant.name: result for result in earlier}
        self._reported = len(self._done)
        self._started_s = time.perf_counter() - earlier_seconds
        self._coverage = coverage or Coverage()
        self._marks: Marks | None = None
        self._places: dict[str, Sequence[Place]] = {}
        self._scope: frozenset[str] = frozenset()
        self._measured: set[Judge] = set()
        self._numbers = MarkNumbers()
        self._passed: dict[Judge, int] = {}

    def run(self) -> Seeding:
        """Run; Ctrl-C ends early, with the results so far and `interrupted` set.

        Raises:
            CannotRunError: There are no defects, or a change cannot be made: the product is not what the
                catalogue says.

        """
        if not self._mutants:
            raise CannotRunError("nothing to do: there are no defects")
        seeding = self._seeding
        try:
            self._places = {mutant.name: places_of(mutant) for mutant in self._mutants}
            self._scope = scope_of(place.module for places in self._places.values() for place in places)
            for mutant in self._mutants:
                defect_patch(mutant)  # a change that cannot be made is reported before anything runs
            self._all_stages()
        except TargetChangedError as error:
            raise CannotRunError(str(error)) from error
        except KeyboardInterrupt:
            seeding.interrupted = True
        return self._sum_up()

    def come_to(self, modules: Sequence[str]) -> dict[str, int]:
        """Run the cases of which nothing is known, without a defect; return for each module the marks that
        any of the cases passes, as bits of a number. The budget, if there is one, is for this.
        """
        self._scope = scope_of(modules)
        self._measure(self._judges, 1.0)
        self._seeding.unknown = len(self._judges) - len(self._passed)
        passed = reduce(or_, self._passed.values(), 0)
        return {name: self._numbers.part(name, passed) for name in modules}

    def so_far(self) -> Seeding:
        """Return what is known by now, marked as interrupted."""
        return replace(self._sum_up(), interrupted=True)

    def _sum_up(self) -> Seeding:
        seeding = self._seeding
        found = (self._done.get(one.name) for one in self._mutants)
        seeding.results = [result for result in found if result is not None and result.over]
        seeding.seconds = time.perf_counter() - self._started_s
        return seeding

    def _all_stages(self) -> None:
        """Try the best of the likely cases, then all likely ones, then all
        others: few defects come that far.
        """
        left = [one for one in self._mutants if one.name not in self._done]
        if not left:
            return
        hints = {mutant.name: hinted(mutant, self._judges) for mutant in left}
        for share in () if self._options.every_case else (_BEST, None):
            likely = list(dict.fromkeys(judge for one in left for judge in hints[one.name][:share]))
            if not self._measure(likely):
                return
            self._judge(likely, left, {one.name: set(hints[one.name][:share]) for one in left})
            if share is None:
                for mutant in left:
                    result = self._done[mutant.name]
                    if result.status == "explained":
                        self._tell(result)
            left = [one for one in left if not self._done[one.name].over]
            if not left:
                return
        if self._measure(self._judges):
            self._judge(self._judges, left)

    # -- baseline
    # -----------------------------------------------------------------------------------------------

    def _measure(self, judges: Sequence[Judge], share: float = 0.5) -> bool:
        """Run cases without a defect, those of which nothing is known; returns whether all are green."""
        started = time.perf_counter()
        seeding, seed = self._seeding, self._options.case_seed
        new = []
        for judge in in_turn(judges):
            if judge in seeding.baseline:
                continue
            known = self._coverage.get(judge, seed, self._scope)
            if known is None:
                new.append(judge)
            else:
                self._passed[judge] = self._numbers.of(known)
                reached = self._reached_by(known)
                seeding.baseline[judge] = Outcome(
                    judge, known.verdict, "", known.seconds, reached, trace=known.trace
                )
        self._run_without_defect(new, share)
        seeding.baseline_seconds += time.perf_counter() - started
        return self._options.drops_red or not seeding.red

    def _run_without_defect(self, judges: Sequence[Judge], share: float = 0.0) -> None:
        """Run cases without a defect, and keep what they come to; `share`: of the budget, 0: all of them."""
        if not judges:
            return
        seeding, seed = self._seeding, self._options.case_seed
        if self._marks is None:
            self._marks = marks_of(modules_in(self._scope))
        limit_s = self._options.limit_s or BASELINE_LIMIT_S
        tasks = [
            Task(tuple(some), seed, None, self._marks, False, (limit_s,) * len(some))
            for some in (judges[at : at + _CHUNK] for at in range(0, len(judges), _CHUNK))
        ]
        total = len({*seeding.baseline, *judges})
        for finished in self._in_time(tasks, share):
            if finished.error:
                raise CannotRunError(finished.error)
            for outcome in finished.outcomes:
                found = Covered(outcome.verdict, outcome.seconds, outcome.marks, outcome.trace)
                self._passed[outcome.judge] = self._numbers.of(found)
                self._measured.add(outcome.judge)
                seeding.measured = len(self._measured)
                seeding.baseline[outcome.judge] = replace(outcome, reached=self._reached_by(found), marks={})
                if outcome.red:
                    seeding.red.append(outcome)
                else:
                    self._coverage.keep(outcome.judge, seed, self._scope, found)
                if share and self._on_baseline is not None:
                    self._on_baseline(outcome, len(seeding.baseline), total)

    def _in_time(self, tasks: Sequence[Task], share: float) -> Iterator[Finished]:
        """Run tasks until a share of the budget is used up, if there is one and the share is not 0."""
        until_s = share * self._options.budget_s
        with closing(run_tasks(self._pool, tasks)) as results:
            for finished in results:
                yield finished
                if until_s and time.perf_counter() - self._started_s > until_s:
                    return

    def _reached_by(self, covered: Covered) -> frozenset[str]:
        return frozenset(name for name, places in self._places.items() if covered.comes_to(places))

    # -- defects
    # ------------------------------------------------------------------------------------------------

    def _judge(
        self, judges: Sequence[Judge], mutants: Sequence[Mutant], only: Mapping[str, set[Judge]] | None = None
    ) -> None:
        """Try cases on mutants; `only`: the cases for each, None = all that can
        notice it, and then it is over.
        """
        baseline = self._seeding.baseline
        seeding = self._seeding
        seeding.unknown = sum(judge not in baseline for judge in judges)
        green = [judge for judge in judges if judge in baseline and baseline[judge].verdict == "passed"]
        reached = {judge: baseline[judge].reached for judge in green}
        seconds = {judge: baseline[judge].seconds for judge in green}
        tasks = []
        able: dict[str, list[Judge]] = {}
        for mutant in mutants:
            able[mutant.name] = in_order(mutant, green, reached, seconds)
            result = self._done.setdefault(mutant.name, MutantResult(mutant))
            result.able = len(able[mutant.name])
            order = self._chosen(mutant, able[mutant.name], self._options.most_cases)
            result.nearest = [judge.name for judge in order[:_NEAREST]]
            tried = {outcome.judge for outcome in result.outcomes}
            order = [
                judge
                for judge in order
                if judge not in tried and (only is None or judge in only[mutant.name])
            ]
            if order:
                tasks.append(self._task(mutant, order))
            elif only is None:
                self._tell(result)
        left = []
        for finished in self._in_time(tasks, 1.0):
            result = self._take(finished)
            if only is None and self._has_more(result):
                left.append(result)
            elif only is None or result.caught or result.error:
                self._tell(result)
        self._judge_where_different(left, able)
        if only is None and not all(self._done[mutant.name].over for mutant in mutants):
            seeding.interrupted = True
        # A case that is only known to have been green may be red by now for another reason.
        self._run_without_defect(
            [
                judge
                for judge in judges
                if judge not in self._measured
                and any(one.judge == judge for mutant in mutants for one in self._done[mutant.name].caught_by)
            ]
        )

    def _has_more(self, result: MutantResult) -> bool:
        """Return whether a defect that has left no trace may do so in a case that was not tried."""
        if result.error or result.caught or result.changed or result.mutant.explained:
            return False
        # Files of tests are too slow to be looked at.
        return result.able > len(result.outcomes) and not is_test_file(self._judges[0])

    def _chosen(self, mutant: Mutant, judges: Sequence[Judge], most: int) -> list[Judge]:
        """Return at most so many cases for a defect: some that look at little else than its modules, the
        others as different as can be.
        """
        near = self._numbers.modules(place.module for place in self._places[mutant.name])
        if not most or len(judges) <= most:
            return list(judges)
        special = most_special(judges, most // _SPECIAL, self._passed, near)
        taken = set(special)
        others = [judge for judge in judges if judge not in taken]
        return [*special, *most_different(others, most - len(special), self._passed, near)]

    def _judge_where_different(
        self, results: Sequence[MutantResult], able: Mapping[str, Sequence[Judge]]
    ) -> None:
        """Look in which cases defects make a difference where they are, and try more of those.

        Args:
            results: Of the defects.
            able: For the name of each the cases that come to the changed statement.

        """
        most = self._options.most_cases
        looked_at = {
            result.mutant.name: self._chosen(result.mutant, able[result.mutant.name], _LOOKED_AT * most)
            for result in results
        }
        different = self._differing(results, looked_at)
        tasks = []
        for result in results:
            mutant = result.mutant
            result.different = len(different[mutant.name])
            tried = {outcome.judge for outcome in result.outcomes}
            where = [judge for judge in looked_at[mutant.name] if judge in different[mutant.name]]
            if where:
                result.nearest = [judge.name for judge in where[:_NEAREST]]
            new = [judge for judge in where if judge not in tried]
            if new:
                tasks.append(self._task(mutant, self._chosen(mutant, new, most)))
            else:
                self._tell(result)
        for finished in self._in_time(tasks, 1.0):
            self._tell(self._take(finished))

    def _differing(
        self, results: Sequence[MutantResult], looked_at: Mapping[str, Sequence[Judge]]
    ) -> dict[str, set[Judge]]:
        """Return for each defect the cases in which it makes a difference where it is."""
        judges = list(dict.fromkeys(judge for one in looked_at.values() for judge in one))
        different: dict[str, set[Judge]] = {name: set() for name in looked_at}
        if not judges:
            return different
        wanted = {name: set(cases) for name, cases in looked_at.items()}
        code = differences_of(result.mutant for result in results)
        parts = [tuple(judges[at : at + _CHUNK]) for at in range(0, len(judges), _CHUNK)]
        seed, done = self._options.case_seed, 0
        for finished in self._in_time(
            [Task(part, seed, None, code, False, self._limits(part)) for part in parts], 1.0
        ):
            if finished.error:
                raise CannotRunError(finished.error)
            for outcome in finished.outcomes:
                done += 1
                if self._on_look is not None:
                    self._on_look(done, len(judges))
                for result in results:
                    name = result.mutant.name
                    if outcome.judge in wanted[name]:
                        result.looked_at += 1
                        if name in outcome.reached:
                            different[name].add(outcome.judge)
        return different

    def _task(self, mutant: Mutant, judges: Sequence[Judge]) -> Task:
        """Return the task to try cases on a defect."""
        seed, first = self._options.case_seed, not self._options.every_case
        return Task(tuple(judges), seed, mutant, defect_patch(mutant), first, self._limits(judges))

    def _limits(self, judges: Sequence[Judge]) -> tuple[float, ...]:
        return tuple(self._limit(self._seeding.baseline[judge].seconds) for judge in judges)

    def _limit(self, seconds: float) -> float:
        return self._options.limit_s or max(LEAST_LIMIT_S, LIMIT_FACTOR * seconds)

    def _take(self, finished: Finished) -> MutantResult:
        """Keep what became of a defect."""
        mutant = finished.task.mutant
        assert mutant is not None  # a task of `_judge`
        result = self._done[mutant.name]
        result.outcomes += finished.outcomes
        result.error = finished.error
        baseline = self._seeding.baseline
        result.changed += [
            one.judge.name
            for one in finished.outcomes
            if not one.catches and one.trace != baseline[one.judge].trace != ""
        ]
        for outcome in finished.outcomes:
            if outcome.catches and mutant.name not in outcome.reached:
                result.error = (
                    f"{outcome.judge.name} was {outcome.verdict} though it never came to the changed "
                    f"statement: it is not "
                    "the same twice"
                )
        return result

    def _tell(self, result: MutantResult) -> None:
        result.over = True
        self._reported += 1
        if self._on_result is not None:
            self._on_result(result, self._reported, len(self._mutants))
