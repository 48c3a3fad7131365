"""Which case runs on which configurations: so few that every two values of different factors meet."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

from hil.configurations._covering import Pair, covering, pairs_of
from hil.configurations.factors import FACTORS, Row, objection
from hil.configurations.needs import Needs


@dataclass(frozen=True)
class Plan:
    """Configurations of the cases of a campaign."""

    rows: tuple[Row, ...]
    """Configurations, in which every two values meet that some case can meet."""
    drawn: tuple[tuple[int, ...], ...]
    """For every case in turn the numbers of its configurations."""

    @property
    def pairs(self) -> frozenset[Pair]:
        """Every two values of different factors that some case can meet."""
        return frozenset(pair for row in self.rows for pair in pairs_of(row))

    @property
    def covered(self) -> frozenset[Pair]:
        """Those that are met by the cases as drawn."""
        used = {number for numbers in self.drawn for number in numbers}
        return frozenset(pair for number in used for pair in pairs_of(self.rows[number]))


def plan(cases: Sequence[Needs], *, seed: int, each: int | None = None) -> Plan:
    """Draw configurations for cases.

    Args:
        cases: What each case needs.
        seed: Another one gives other configurations.
        each: Configurations of every case, as far as so many can serve it; None: as few as let every pair of
            values meet, at least one.

    """
    dice = random.Random(f"configurations {seed}")  # noqa: S311 - repeatable, not secret
    kinds = tuple(dict.fromkeys(cases))
    factors = {name: dice.sample(list(factor.values), len(factor.values)) for name, factor in FACTORS.items()}

    def against(row: Row) -> str:
        return objection(row) or ("" if any(not needs.refusal(row) for needs in kinds) else "no case")

    rows = covering(factors, against)
    fitting = {needs: [at for at, row in enumerate(rows) if not needs.refusal(row)] for needs in kinds}
    return Plan(tuple(rows), _drawn(cases, rows, fitting, each))


def _drawn(
    cases: Sequence[Needs], rows: Sequence[Row], fitting: dict[Needs, list[int]], each: int | None
) -> tuple[tuple[int, ...], ...]:
    drawn: list[list[int]] = [[] for _ in cases]
    used = [0] * len(rows)
    uncovered = {pair for row in rows for pair in pairs_of(row)}
    new = [len(set(pairs_of(row))) for row in rows]

    def take(case: int, row: int) -> None:
        drawn[case].append(row)
        if not used[row]:
            uncovered.difference_update(pairs_of(rows[row]))
            for at, other in enumerate(rows):
                new[at] = 0 if used[at] else sum(pair in uncovered for pair in pairs_of(other))
        used[row] += 1

    # Who has the least choice chooses first.
    order = sorted(range(len(cases)), key=lambda case: (len(fitting[cases[case]]), case))
    for _ in range(each or 1):
        for case in order:
            left = [row for row in fitting[cases[case]] if row not in drawn[case]]
            if left:
                take(case, min(left, key=lambda row: (-new[row], used[row], row)))
    if each is None:
        for row in range(len(rows)):
            if not new[row] or used[row]:
                continue
            case = min(
                (case for case in order if row in fitting[cases[case]]), key=lambda case: len(drawn[case])
            )
            take(case, row)
    return tuple(map(tuple, drawn))
