"""What has changed between runs: failures that are new, gone or come and go, cases that got slower, numbers
that drifted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Final

from reports.history import History, HistoryError, PastCase, PastRun
from reports.json_types import JsonObject
from reports.model import Earlier, RunResult, Verdict

TREND: Final = 50
"""Runs in the trend."""
FLAKY_DEPTH: Final = 10
"""Results of a case among which turns of its verdict are looked for."""
_FLAKY_TURNS: Final = 2
_SLOWER: Final = 1.5
_SLOWER_S: Final = 0.25
_ENOUGH: Final = 5
"""Cases in common from which on a run as a whole can be called slower."""


@dataclass(frozen=True)
class Slower:
    """A case that takes more wall-clock time."""

    identifier: str
    before_s: float
    """As long as it took, times the factor by which the run as a whole is slower."""
    now_s: float


@dataclass(frozen=True)
class Drift:
    """A number of a case that differs by more than its tolerance."""

    identifier: str
    name: str
    unit: str
    before: float
    now: float


@dataclass
class Comparison:
    """A run compared with what was before. Cases are named by identifier, in the order of their names."""

    now: PastRun
    base: PastRun | None
    """The run that it is compared with; None where every case is compared with its own last result."""
    new_failures: list[str] = field(default_factory=list)
    """Failed or broke, and did not before; cases never seen before count."""
    fixed: list[str] = field(default_factory=list)
    edited: list[str] = field(default_factory=list)
    """Passed, and failed or broke before, but from another source: nobody knows which change helped."""
    still_failing: list[str] = field(default_factory=list)
    newly_blocked: list[str] = field(default_factory=list)
    """Blocked, and passed or failed before."""
    flaky: list[str] = field(default_factory=list)
    """Turned between good and bad at least twice within their last ten results on the same bench with the
    same seed.
    """
    appeared: list[str] = field(default_factory=list)
    vanished: list[str] = field(default_factory=list)
    """Only where there is a `base`."""
    slower: list[Slower] = field(default_factory=list)
    """Longest first."""
    drift: list[Drift] = field(default_factory=list)
    same_traces: int = 0
    """Cases whose traces are equal bit for bit."""
    common: int = 0
    """Cases that there were before."""
    reasons: dict[str, str] = field(default_factory=dict)
    """Headlines of the bad cases of now."""
    tokens: dict[str, str] = field(default_factory=dict)

    def changes(self) -> dict[str, list[str]]:
        """Return the cases by what happened to them."""
        return {
            "new failure": self.new_failures,
            "fixed": self.fixed,
            "edited": self.edited,
            "still failing": self.still_failing,
            "newly blocked": self.newly_blocked,
            "flaky": self.flaky,
        }

    def as_dict(self) -> JsonObject:
        """Return the comparison as plain data, as `hil history compare --json` prints it."""
        return {
            "run": self.now.number,
            "base": None if self.base is None else self.base.number,
            **{name.replace(" ", "_"): list(cases) for name, cases in self.changes().items()},
            "appeared": list(self.appeared),
            "vanished": list(self.vanished),
            "slower": [asdict(one) for one in self.slower],
            "drift": [asdict(one) for one in self.drift],
            "common": self.common,
            "same_traces": self.same_traces,
        }

    def by_case(self) -> dict[str, str]:
        """Return what happened to a case, the first of `changes` that holds."""
        found: dict[str, str] = {}
        for name, cases in self.changes().items():
            for identifier in cases:
                found.setdefault(identifier, name)
        return found


@dataclass(frozen=True)
class Background:
    """What a report tells of earlier runs."""

    trend: list[PastRun]
    """The last runs with this one, oldest first."""
    comparison: Comparison
    passes: Mapping[str, Earlier] = field(default_factory=dict)
    """An earlier run of a case by its identifier: the page can lay its curves under those of now."""


def compare_runs(history: History, now: PastRun, base: PastRun | None = None) -> Comparison:
    """Compare a recorded run with another one, or each of its cases with the last result before it.

    Numbers are compared where bench and seed are the same: another machine has other numbers.

    Raises:
        HistoryError: A run is compared with itself.

    """
    if base is not None and base.number == now.number:
        raise HistoryError(f"run {now.number} would be compared with itself; name two different runs")
    cases = history.cases(now.number)
    past = history.before(now.number)
    runs = {run.number: run for run in history.runs()}
    old = _last_results(history, past) if base is None else history.cases(base.number)
    result = Comparison(now, base)
    for name, case in cases.items():
        _judge(result, case, old.get(name))
        same = [one for one in _alike(past.get(name, []), now, runs) if not _edited(case, one)]
        if _turns([case, *same]) >= _FLAKY_TURNS:
            result.flaky.append(name)
    if base is not None:
        result.vanished = [name for name in old if name not in cases]
    comparable = {
        name: case for name, case in old.items() if name in cases and _same_machine(runs[case.run], now)
    }
    result.drift = [drift for name, case in comparable.items() for drift in _drift(case, cases[name])]
    result.slower = _slower(cases, past if base is None else {name: [case] for name, case in old.items()})
    return result


def remember(run: RunResult, path: str | Path) -> Background:
    """Record a run in a history, which is made where it is missing, and return what came before.

    A run that is there already, equal in start, seed, bench and traces, is not recorded again.

    Raises:
        HistoryError: The file is no history, or cannot be written.

    """
    with History(path, create=True) as history:
        number = history.number_of(run)
        return _background(history, history.record(run) if number is None else number)


def _background(history: History, number: int) -> Background:
    runs = [one for one in history.runs() if one.number <= number]
    return Background(runs[:TREND][::-1], compare_runs(history, runs[0]))


def _last_results(history: History, past: Mapping[str, Sequence[PastCase]]) -> dict[str, PastCase]:
    """Return the last earlier result of every case, with its numbers."""
    wanted = {name: results[0].run for name, results in past.items()}
    found: dict[str, PastCase] = {}
    for number in sorted(set(wanted.values())):
        of_run = history.cases(number)
        found.update({name: of_run[name] for name, run in wanted.items() if run == number})
    return found


def _judge(result: Comparison, case: PastCase, before: PastCase | None) -> None:
    name = case.identifier
    if before is None:
        result.appeared.append(name)
    else:
        result.common += 1
        result.same_traces += bool(case.trace_digest) and case.trace_digest == before.trace_digest
    if case.bad:
        (result.still_failing if before is not None and before.bad else result.new_failures).append(name)
        result.reasons[name] = case.headline
        result.tokens[name] = case.token
    elif before is not None and before.bad and case.verdict is Verdict.PASSED:
        (result.edited if _edited(case, before) else result.fixed).append(name)
    elif case.verdict is Verdict.BLOCKED and before is not None and before.verdict is not Verdict.BLOCKED:
        result.newly_blocked.append(name)


def _edited(case: PastCase, before: PastCase) -> bool:
    """Whether the two results are of another source, as far as it is known."""
    return bool(case.source and before.source) and case.source != before.source


def _same_machine(one: PastRun, other: PastRun) -> bool:
    return (one.bench_digest, one.seed) == (other.bench_digest, other.seed)


def _alike(results: Sequence[PastCase], now: PastRun, runs: Mapping[int, PastRun]) -> list[PastCase]:
    return [case for case in results if _same_machine(runs[case.run], now)][: FLAKY_DEPTH - 1]


def _turns(results: Sequence[PastCase]) -> int:
    """Return how often good and bad alternate; blocked ones say nothing."""
    bad = [case.bad for case in results if case.verdict is not Verdict.BLOCKED]
    return sum(one is not other for one, other in pairwise(bad))


def _drift(before: PastCase, now: PastCase) -> list[Drift]:
    if Verdict.BLOCKED in {before.verdict, now.verdict}:
        return []
    found = []
    for name, measure in now.measures.items():
        old = before.measures.get(name)
        if old is not None and abs(measure.value - old.value) > max(old.tolerance, measure.tolerance):
            found.append(Drift(now.identifier, name, measure.unit, old.value, measure.value))
    return sorted(found, key=lambda drift: drift.name)


def _slower(now: Mapping[str, PastCase], past: Mapping[str, Sequence[PastCase]]) -> list[Slower]:
    """Return the cases that got slower than the run as a whole did: a busy machine slows all of them."""
    before = {
        name: median(case.wall_s for case in results[:_ENOUGH])
        for name, results in past.items()
        if name in now
    }
    ratios = [now[name].wall_s / wall for name, wall in before.items() if wall > 0]
    factor = max(1.0, median(ratios)) if len(ratios) >= _ENOUGH else 1.0
    found = [
        Slower(name, wall * factor, now[name].wall_s)
        for name, wall in before.items()
        if now[name].wall_s > _SLOWER * wall * factor and now[name].wall_s > wall * factor + _SLOWER_S
    ]
    return sorted(found, key=lambda one: one.before_s - one.now_s)
