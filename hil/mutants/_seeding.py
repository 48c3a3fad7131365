"""The whole of it: baseline first, then every defect against the cases that can notice it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Final

from hil.errors import CannotRunError
from hil.mutants._mutant import Mutant
from hil.mutants._plan import Judge, hinted, in_order
from hil.mutants._pool import Finished, Pool
from hil.mutants._worker import Outcome, Task

BASELINE_LIMIT_S: Final = 300.0
"""Limit of wall time of a case without defect, s."""
LIMIT_FACTOR: Final = 20.0
LEAST_LIMIT_S: Final = 20.0
"""A case with a defect may take so many times the time it takes without one, and at least this long, s."""
_CHUNK: Final = 12
"""Cases of the baseline that one process runs."""

OnResult = Callable[["MutantResult", int, int], None]
OnBaseline = Callable[[Outcome, int, int], None]


@dataclass(frozen=True, slots=True)
class SeedingOptions:
    """How defects are judged."""

    jobs: int = 1
    seed: int = 0
    every_case: bool = False
    """Run every case that can notice a defect, not only until the first that does."""
    limit_s: float = 0.0
    """Limit of wall time of a case, s; 0: from the time that it takes without a defect."""


@dataclass(slots=True)
class MutantResult:
    """What became of one defect."""

    mutant: Mutant
    outcomes: list[Outcome] = field(default_factory=list)
    """Of the cases run, in order."""
    able: int = 0
    """Cases that come to the changed statement."""
    trouble: str = ""
    """Why it could not be judged."""

    @property
    def caught_by(self) -> list[Outcome]:
        """Outcomes of the cases that were red."""
        return [outcome for outcome in self.outcomes if outcome.catches]

    @property
    def seconds(self) -> float:
        """Wall time of the cases up to the first that caught it, or of all, s."""
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
        """`caught`, `explained` (nobody can notice it, with a reason), `survived`, `never ran`, or `trouble`."""
        if self.trouble:
            return "trouble"
        if self.caught:
            return "caught"
        if not self.able:
            return "never ran"
        return "explained" if self.mutant.explained else "survived"

    def as_dict(self) -> dict[str, object]:
        """Return the result as plain data, as `hil mutants --json` prints it."""
        caught_by = self.caught_by
        first = caught_by[0] if caught_by else None
        return {
            "name": self.mutant.name,
            "area": self.mutant.area,
            "title": self.mutant.title,
            "requirements": list(self.mutant.requirements),
            "targets": [edit.target for edit in self.mutant.edits],
            "changes": [
                {"target": edit.target, "old": edit.old, "new": edit.new} for edit in self.mutant.edits
            ],
            "status": self.status,
            "caught_by": [outcome.judge.name for outcome in caught_by],
            "how": "" if first is None else first.verdict,
            "message": self.trouble if first is None else first.message,
            "seconds": round(self.seconds, 3),
            "cases_run": len(self.outcomes),
            "cases_reaching_it": self.able,
            "explained": self.mutant.explained,
        }


@dataclass(slots=True)
class Seeding:
    """A finished run."""

    results: list[MutantResult] = field(default_factory=list)
    baseline: dict[Judge, Outcome] = field(default_factory=dict)
    red: list[Outcome] = field(default_factory=list)
    """Cases that fail without any defect; with one of them no defect is judged."""
    seconds: float = 0.0
    baseline_seconds: float = 0.0
    interrupted: bool = False

    def count(self, status: str) -> int:
        """Return how many defects ended so."""
        return sum(result.status == status for result in self.results)

    @property
    def exit_code(self) -> int:
        """0: every defect caught or explained; 1: one survived; 2: it could not run."""
        if self.red or self.interrupted or self.count("trouble") or not self.results:
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
            "baseline_seconds": round(self.baseline_seconds, 1),
            "seconds": round(self.seconds, 1),
            "interrupted": self.interrupted,
        }


class Seeder:
    """Judges defects by cases.

    Args:
        mutants: The defects.
        judges: The cases, on their benches.
        options: How.
        on_baseline: Called after every case of the baseline with its outcome, the number done and the number of all.
        on_result: The same for every defect.

    """

    def __init__(
        self,
        mutants: Sequence[Mutant],
        judges: Sequence[Judge],
        options: SeedingOptions,
        *,
        on_baseline: OnBaseline | None = None,
        on_result: OnResult | None = None,
    ) -> None:
        if not mutants or not judges:
            raise CannotRunError("nothing to do: there are no defects, or no cases to judge them")
        self._mutants = list(mutants)
        self._judges = list(judges)
        self._options = options
        self._on_baseline = on_baseline
        self._on_result = on_result
        self._pool = Pool(options.jobs)
        self._seeding = Seeding()
        self._done: dict[str, MutantResult] = {}
        self._told = 0

    def run(self, *, whole_baseline: bool = True) -> Seeding:
        """Run; Ctrl-C ends early, with the results so far and `interrupted` set.

        Args:
            whole_baseline: Begin with every case of every campaign. Without, only the cases that a defect is likely to be caught
                by are run first, and the others when one was not: enough for a few defects.

        """
        started = time.perf_counter()
        seeding = self._seeding
        try:
            self._all_stages(whole_baseline=whole_baseline or self._options.every_case)
        except KeyboardInterrupt:
            seeding.interrupted = True
        seeding.results = [self._done[one.name] for one in self._mutants if one.name in self._done]
        seeding.seconds = time.perf_counter() - started
        return seeding

    def _all_stages(self, *, whole_baseline: bool) -> None:
        left = self._mutants
        if not whole_baseline:
            likely = list(dict.fromkeys(one for mutant in left for one in hinted(mutant, self._judges)))
            if not self._measure(likely):
                return
            self._judge(likely, left, last=False)
            left = [
                one for one in left if not self._done[one.name].caught and not self._done[one.name].trouble
            ]
        if left and self._measure(self._judges):
            self._judge(self._judges, left, last=True)

    # -- baseline -----------------------------------------------------------------------------------------------

    def _measure(self, judges: Sequence[Judge]) -> bool:
        """Run cases without a defect, those that have not been yet; returns whether all are green."""
        started = time.perf_counter()
        seeding = self._seeding
        new = [judge for judge in judges if judge not in seeding.baseline]
        limit_s = self._options.limit_s or BASELINE_LIMIT_S
        tasks = [
            Task(
                tuple(new[index : index + _CHUNK]), self._options.seed, None, tuple(self._mutants), False,
                (limit_s,) * len(new[index : index + _CHUNK]),
            )
            for index in range(0, len(new), _CHUNK)
        ]  # fmt: skip
        total = len(seeding.baseline) + len(new)
        for finished in self._pool.run(tasks):
            if finished.trouble:
                raise CannotRunError(finished.trouble)
            for outcome in finished.outcomes:
                seeding.baseline[outcome.judge] = outcome
                if outcome.red:
                    seeding.red.append(outcome)
                if self._on_baseline is not None:
                    self._on_baseline(outcome, len(seeding.baseline), total)
        seeding.baseline_seconds += time.perf_counter() - started
        return not seeding.red

    # -- defects ------------------------------------------------------------------------------------------------

    def _judge(self, judges: Sequence[Judge], mutants: Sequence[Mutant], *, last: bool) -> None:
        baseline = self._seeding.baseline
        green = [judge for judge in judges if baseline[judge].verdict == "passed"]
        reached = {judge: baseline[judge].reached for judge in green}
        seconds = {judge: baseline[judge].seconds for judge in green}
        tasks = []
        for mutant in mutants:
            order = in_order(mutant, green, reached, seconds)
            result = self._done.setdefault(mutant.name, MutantResult(mutant))
            result.able = len(order)
            tried = {outcome.judge for outcome in result.outcomes}
            order = [judge for judge in order if judge not in tried]
            if order:
                limits = tuple(self._limit(seconds[judge]) for judge in order)
                tasks.append(
                    Task(tuple(order), self._options.seed, mutant, (), not self._options.every_case, limits)
                )
            elif last:
                self._tell(result)
        for finished in self._pool.run(tasks):
            result = self._take(finished)
            if last or result.caught or result.trouble:
                self._tell(result)

    def _limit(self, seconds: float) -> float:
        return self._options.limit_s or max(LEAST_LIMIT_S, LIMIT_FACTOR * seconds)

    def _take(self, finished: Finished) -> MutantResult:
        """Keep what became of a defect."""
        mutant = finished.task.mutant
        assert mutant is not None  # a task of `_judge`
        result = self._done[mutant.name]
        result.outcomes += finished.outcomes
        result.trouble = finished.trouble
        for outcome in finished.outcomes:
            if outcome.catches and mutant.name not in outcome.reached:
                result.trouble = (
                    f"{outcome.judge.name} was {outcome.verdict} though it never came to the changed statement: it is not "
                    "the same twice"
                )
        return result

    def _tell(self, result: MutantResult) -> None:
        self._told += 1
        if self._on_result is not None:
            self._on_result(result, self._told, len(self._mutants))
