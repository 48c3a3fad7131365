"""What a rule is: one definition with its name, what it says, where that stands, and what excuses it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from hil.expect._wording import rule_sentence
from reports.model import Check, Verdict

Flags = NDArray[np.bool_]
Numbers = NDArray[np.float64]
Words = NDArray[np.int64]
Describe = Callable[[int], str]
"""Makes the sentence about what is wrong at an index."""
View = TypeVar("View")


class Judged(NamedTuple):
    """What a rule has found on one component, before faults excuse anything."""

    time_s: Numbers
    """Time of everything that was looked at."""
    judged: Flags
    """Where the rule could say something."""
    broken: Flags
    """Where it does not hold; a part of `judged`."""
    describe: Describe
    """What is wrong at an index."""

    @classmethod
    def of_list(cls, found: list[tuple[float, str]]) -> Judged:
        """Return findings one by one: time, and what is wrong or an empty text."""
        times = np.array([when for when, _ in found], dtype=np.float64)
        texts = [text for _, text in found]
        broken = np.fromiter(map(bool, texts), dtype=bool, count=len(texts))
        return cls(times, np.ones(len(found), dtype=bool), broken, texts.__getitem__)

    @classmethod
    def of_times(cls, right: Sequence[Numbers], wrong: Sequence[tuple[float, str]]) -> Judged:
        """Return findings of which most are right.

        Args:
            right: Times at which nothing is wrong, in one or several pieces.
            wrong: Time, and what is wrong, by time.

        """
        texts = [text for _, text in wrong]
        times = np.concatenate([np.array([when for when, _ in wrong], dtype=np.float64), *right])
        broken = np.zeros(len(times), dtype=bool)
        broken[: len(texts)] = True
        return cls(times, np.ones(len(times), dtype=bool), broken, texts.__getitem__)


@dataclass(frozen=True, kw_only=True)
class Rule(Generic[View]):
    """A rule that judges every trace.

    A rule never guesses: where the trace lacks a signal, or the bench a number, it says nothing.
    """

    name: str
    """What a check is called, with the component behind it."""
    says: str
    """What has to hold."""
    requirements: tuple[str, ...]
    """Where the specification says so."""
    tolerance: str
    """How far it may be off, and why."""
    judge: Callable[[View], Judged | None]
    """Looks at one component; None: nothing there to judge."""
    excused_by: tuple[str, ...] = ()
    """Kinds of faults, or families with a trailing dot, that may break the rule on the part that they hit."""
    recovery_s: float = 0.0
    """For so long after such a fault, s."""
    recovery_cycles: int = 0
    """And for so many cycles of the bench."""
    live: bool = False
    """It compares what one recorder has noted of one instant, and counts no cycles: it judges live benches
    too, where controller and drives are processes with clocks of their own."""


class Excuses:
    """When the faults of a trace excuse what happens on a component: while they act and a moment afterwards.

    Args:
        spans: Begin, end (infinite: it acts to the end) and kind of every fault that hits the component.

    """

    def __init__(self, spans: list[tuple[float, float, str]]) -> None:
        self._spans = spans
        self._of_kinds: dict[tuple[str, ...], list[tuple[float, float]]] = {}

    def __bool__(self) -> bool:
        return bool(self._spans)

    def flags(self, times: Numbers, kinds: tuple[str, ...], recovery_s: float) -> Flags | None:
        """Return the times at which faults of some kinds are an excuse; None: there was no such fault."""
        spans = self._of_kinds.get(kinds)
        if spans is None:
            spans = self._of_kinds[kinds] = [
                (begin_s, end_s)
                for begin_s, end_s, kind in self._spans
                if any(kind == one or (one.endswith(".") and kind.startswith(one)) for one in kinds)
            ]
        excused = None
        for begin_s, end_s in spans:
            here = (times >= begin_s - 1e-9) & (times <= end_s + recovery_s + 1e-9)
            excused = here if excused is None else excused | here
        return excused


@dataclass
class _Tally:
    """What a rule has found on one component so far."""

    seen: int = 0
    """How often it could say something."""
    broken: int = 0
    time_s: float = 0.0
    """When it did not hold for the first time."""
    text: str = ""
    """And what was wrong then."""

    def add(self, found: Judged, judged: Flags, broken: Flags) -> None:
        """Count what was found, as far as it counts."""
        self.seen += int(np.count_nonzero(judged))
        count = int(np.count_nonzero(broken))
        if count and not self.broken:
            first = int(np.argmax(broken))
            self.time_s, self.text = float(found.time_s[first]), found.describe(first)
        self.broken += count


class Findings(Generic[View]):
    """What rules find on components, in one or several pieces of a trace.

    Args:
        rules: The rules.

    """

    def __init__(self, rules: Sequence[Rule[View]]) -> None:
        self._rules = rules
        self._found: dict[str, list[_Tally]] = {}

    def look(
        self,
        component: str,
        view: View,
        excuses: Excuses,
        *,
        cycle_s: float,
        span_s: tuple[float, float] | None,
    ) -> None:
        """Judge a component by all rules.

        Args:
            component: Its name.
            view: What the rules look at.
            excuses: The faults that hit it.
            cycle_s: Cycle of the bench, s.
            span_s: Times from which on and before which findings count, s; None: all do.

        """
        tallies = self._found.setdefault(component, [_Tally() for _ in self._rules])
        for rule, tally in zip(self._rules, tallies, strict=True):
            found = rule.judge(view)
            if found is None:
                continue
            judged, broken = found.judged, found.broken
            if excuses and rule.excused_by and len(judged):
                recovery_s = rule.recovery_s + rule.recovery_cycles * cycle_s
                excused = excuses.flags(found.time_s, rule.excused_by, recovery_s)
                if excused is not None:
                    judged, broken = judged & ~excused, broken & ~excused
            if span_s is not None:
                inside = (found.time_s >= span_s[0]) & (found.time_s < span_s[1])
                judged, broken = judged & inside, broken & inside
            tally.add(found, judged, broken)

    def checks(self) -> list[Check]:
        """Return a check for every rule and component where there was something to judge."""
        return [
            _check(rule, component, tally)
            for component, tallies in self._found.items()
            for rule, tally in zip(self._rules, tallies, strict=True)
            if tally.seen
        ]


def _check(rule: Rule[View], component: str, tally: _Tally) -> Check:
    observed, time_s = f"{tally.seen} times", None
    if tally.broken:
        more = f"; {tally.broken} times in all" if tally.broken > 1 else ""
        observed, time_s = tally.text + more, tally.time_s
    check = Check(
        name=f"{rule.name} of {component}",
        verdict=Verdict.FAILED if tally.broken else Verdict.PASSED,
        expected=rule.says,
        observed=observed,
        time_s=time_s,
        requirements=list(rule.requirements),
        rule=True,
    )
    check.sentence = rule_sentence(check)
    return check


def runs(flags: Flags) -> Iterator[tuple[int, int]]:
    """Return first index and index behind the last one of every run of true flags."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    for start, end in zip(edges[::2], edges[1::2], strict=True):
        yield int(start), int(end)


def differences(values: Numbers) -> Numbers:
    """Return by how much every value differs from the one before; the first one by nothing."""
    result = np.zeros(len(values))
    np.subtract(values[1:], values[:-1], out=result[1:])
    return result


_FEW: Final = 6
"""Up to so many shifts of an array take less time than to count from the last true or false sample."""


def spread(flags: Flags, before: int, after: int) -> Flags:
    """Return the flags with so many neighbours on either side of every true one."""
    if not flags.any():
        return flags
    if before > _FEW:
        return spread(spread(flags[::-1], 0, before)[::-1], 0, after)
    if after > _FEW:
        index = np.arange(len(flags))
        late: Flags = index - np.maximum.accumulate(np.where(flags, index, -after - 1)) <= after
        return late | spread(flags, before, 0)
    result = flags.copy()
    for step in range(1, after + 1):
        result[step:] |= flags[:-step]
    for step in range(1, before + 1):
        result[:-step] |= flags[step:]
    return result


def last_true(flags: Flags, count: int) -> Flags:
    """Return where a flag and so many before it are true."""
    if count > _FEW:
        index = np.arange(len(flags))
        long: Flags = index - np.maximum.accumulate(np.where(flags, -1, index)) > count
        return long
    result = flags.copy()
    for step in range(1, count + 1):
        result[step:] &= flags[:-step]
        result[:step] = False
    return result
