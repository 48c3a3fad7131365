"""Which cases judge the defects, on which benches, and in which order."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from heapq import heapify, heappop, heappush
from itertools import zip_longest
from typing import Final

from hil.bench.makes import NC_BENCH
from hil.campaign import SHIPPED, Case, Found, find_campaigns, load_bench_file
from hil.configurations import name_of, plan
from hil.configurations.factors import CONFIGURATION
from hil.errors import CannotRunError
from hil.mutants._mutant import Mutant
from hil.protocols import kind_of

PAIRWISE: Final = "pairwise"
"""In place of a bench: each case on one of the configurations that serve it."""
NC_PAIRWISE: Final = "nc-pairwise"
"""In place of a bench: each case on NC axes on one of the configurations that serve it."""
NC: Final = "nc"
"""In place of a bench: each case on its bench with NC axes, as far as it has a meaning there."""
_CONFIGURATIONS: Final = 2
"""Seed of these configurations."""


@dataclass(frozen=True)
class Judge:
    """One case on one bench."""

    identifier: str
    campaign: str
    """Reference of the campaign."""
    bench: str
    """Reference of the bench; empty: the embedded default."""

    @property
    def name(self) -> str:
        """Identifier and bench: `stop-modes/halt/constant@reference`."""
        return f"{self.identifier}@{self.bench}" if self.bench else self.identifier

    def fits(self, pattern: str) -> bool:
        """Return whether a pattern of identifiers, perhaps with a bench, or with `nc` for the case on NC
        axes, names this case.
        """
        identifier, _, bench = pattern.partition("@")
        own, _, make = self.identifier.partition("@")
        return fnmatchcase(own, identifier) and bench in ((make,) if make else ("", self.bench))


def find_judges(references: Sequence[str] = ()) -> list[Judge]:
    """Return the cases of campaigns, each on the bench given with `@bench` or else on its own, in order.

    Args:
        references: Files, directories or modules, each perhaps with `@` and a bench; none: those that
            ship with the product.

    Raises:
        CampaignNotFoundError: A reference leads to no campaign.
        CannotRunError: A bench is live: what a defect does there is never twice the same.

    """
    judges: dict[Judge, None] = {}
    for where, bench in map(_split, references) if references else _shipped():
        for found in find_campaigns([where]):
            judges.update(dict.fromkeys(_cases(found, bench)))
    for bench in dict.fromkeys(judge.bench for judge in judges):
        kind = kind_of(load_bench_file(bench or None))
        if kind != "virtual":
            raise CannotRunError(f"defects are judged on virtual benches; {bench!r} runs in real time")
    return list(judges)


def _split(reference: str) -> tuple[str, str]:
    where, _, bench = reference.partition("@")
    return where, bench


def _shipped() -> Iterable[tuple[str, str]]:
    """Return the shipped campaigns and the benches they judge defects on; no bench: that of each case."""
    return ((one.reference, "" if bench == "own" else bench) for one in SHIPPED for bench in one.seeding)


def _cases(found: Found, bench: str) -> Iterable[Judge]:
    if bench == PAIRWISE:
        return _on_configurations(found, found.campaign.cases)
    if bench == NC_PAIRWISE:
        made = (found.campaign.on_controller(case, NC) for case in found.campaign.cases)
        return _on_configurations(found, [case for case in made if not (case.refusal or case.own_numbers)])
    if bench == NC:
        made = (found.campaign.on_controller(case, NC) for case in found.campaign.cases)
        return (
            Judge(case.identifier, found.reference, f"{NC_BENCH}{case.bench}")
            for case in made
            if not case.refusal
        )
    return (Judge(case.identifier, found.reference, bench or case.bench) for case in found.campaign.cases)


def _on_configurations(found: Found, cases: Sequence[Case]) -> Iterator[Judge]:
    """Yield each case of a campaign on a configuration that serves it, as different ones as possible."""
    planned = plan([case.needs for case in cases], seed=_CONFIGURATIONS, each=1)
    names = [name_of(row, _CONFIGURATIONS) for row in planned.rows]
    for case, numbers in zip(cases, planned.drawn, strict=True):
        make = NC_BENCH if case.controller == NC else ""
        for number in numbers:
            yield Judge(case.identifier, found.reference, f"{make}{CONFIGURATION}{names[number]}")


def modules_of(judges: Iterable[Judge]) -> list[str]:
    """Return the modules of campaigns and benches of cases, as far as they can be imported by name."""
    references = dict.fromkeys(name for judge in judges for name in (judge.campaign, judge.bench))
    return list(
        dict.fromkeys(module for one in references if (module := one.partition(":")[0]) in sys.modules)
    )


def hinted(mutant: Mutant, judges: Sequence[Judge]) -> list[Judge]:
    """Return the cases that the catalogue holds likely to catch a mutant, best first."""
    return list(dict.fromkeys(judge for pattern in mutant.likely for judge in judges if judge.fits(pattern)))


def in_order(
    mutant: Mutant,
    judges: Sequence[Judge],
    reached: Mapping[Judge, frozenset[str]],
    seconds: Mapping[Judge, float],
) -> list[Judge]:
    """Return the cases for a mutant: the likely ones, then the others from the quickest on.

    A case is left out when the unmutated product did not come to the changed statement in it: up to there
    both are the same.

    Args:
        mutant: The defect.
        judges: All cases.
        reached: Names of the mutants whose place each of the cases reaches.
        seconds: Time that each of them took, s.

    """
    able = [judge for judge in judges if mutant.name in reached.get(judge, ())]
    first = hinted(mutant, able)
    taken = set(first)
    return first + sorted(
        (judge for judge in able if judge not in taken), key=lambda one: seconds.get(one, 0.0)
    )


_NEAR: Final = 16
"""A mark of the module that has the defect counts as much as so many others."""


def most_different(judges: Sequence[Judge], most: int, marks: Mapping[Judge, int], near: int) -> list[Judge]:
    """Return at most so many cases, those that together come to as much of the product as they can: what a
    defect does shows far from where it is, and many cases are alike.

    Args:
        judges: The cases, the best first.
        most: How many; 0: all, as they are.
        marks: Marks of the product that each of them passes, as bits of a number.
        near: Marks of the modules that have the defect.

    """
    if not most or len(judges) <= most:
        return list(judges)
    chosen: list[Judge] = []
    covered = 0
    waiting: list[tuple[int, int]] = []
    while len(chosen) < most:
        if not waiting:  # all that is left adds nothing: once more from the beginning
            covered = 0
            taken = set(chosen)
            waiting = [
                (-_gain(marks.get(judge, 0), near), at)
                for at, judge in enumerate(judges)
                if judge not in taken
            ]
            heapify(waiting)
        at = heappop(waiting)[1]
        now = _gain(marks.get(judges[at], 0) & ~covered, near)
        if waiting and -now > waiting[0][0]:
            heappush(waiting, (-now, at))  # those chosen meanwhile have taken some of it
        elif now == 0 and covered:
            waiting.clear()
        else:
            chosen.append(judges[at])
            covered |= marks.get(judges[at], 0)
    return chosen


def most_special(judges: Sequence[Judge], most: int, marks: Mapping[Judge, int], near: int) -> list[Judge]:
    """Return at most so many cases, those with the greatest share of what they come to in the modules that
    have the defect: they look at little else.

    Args:
        judges: The cases, the best first.
        most: How many.
        marks: Marks of the product that each of them passes, as bits of a number.
        near: Marks of the modules that have the defect.

    """

    def share(judge: Judge) -> float:
        passed = marks.get(judge, 0)
        return (passed & near).bit_count() / max(1, passed.bit_count())

    return sorted(judges, key=share, reverse=True)[:most]


def _gain(marks: int, near: int) -> int:
    return marks.bit_count() + (_NEAR - 1) * (marks & near).bit_count()


def in_turn(judges: Sequence[Judge]) -> list[Judge]:
    """Return cases with the first of every family and bench before the second of any."""
    groups: dict[tuple[str, str], list[Judge]] = {}
    for judge in judges:
        groups.setdefault((judge.identifier.rpartition("/")[0], judge.bench), []).append(judge)
    turns = zip_longest(*groups.values())
    return [judge for turn in turns for judge in turn if judge is not None]


def closest(name: str, known: Iterable[str]) -> str:
    """Return what to say about a name that is not known."""
    import difflib

    near = difflib.get_close_matches(name, list(known), n=1)
    return f"; did you mean {near[0]!r}?" if near else ""
