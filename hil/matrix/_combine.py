"""Combinations of factors: all of them, or so few that every N values of different factors still meet."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from allpairspy import AllPairs

Values = dict[str, str]
Objection = Callable[[Mapping[str, str]], str]
"""Returns why a combination, or what is known of it so far, is left out; empty: it is not."""


@dataclass(frozen=True)
class Combined:
    """What came of the factors."""

    rows: list[Values]
    possible: int
    """Number of combinations that nothing speaks against."""
    left_out: dict[str, int] = field(default_factory=dict)
    """Number of combinations by the reason for which they were left out."""


def combine(
    factors: Mapping[str, Sequence[str]],
    objection: Objection,
    strength: int | None,
    *,
    most: int | None = None,
) -> Combined:
    """Combine the values of factors.

    Args:
        factors: Values by name of the factor.
        objection: What speaks against a combination.
        strength: Every so many values of different factors, where nothing speaks against them, are
            together in at least one combination; None: all combinations.
        most: Stop with the first combination beyond so many; None: continue to the end.

    """
    names = list(factors)
    rows: list[Values] = []
    possible = 0
    reasons: Counter[str] = Counter()
    full = strength is None or strength >= len(names)
    for values in itertools.product(*factors.values()):
        row = dict(zip(names, values, strict=True))
        reason = objection(row)
        if reason:
            reasons[reason] += 1
            continue
        possible += 1
        if full:
            rows.append(row)
            if most is not None and len(rows) > most:
                break
    if not full and possible:
        assert strength is not None
        rows = _covering(factors, objection, strength)
    return Combined(rows, possible, dict(reasons))


def _covering(factors: Mapping[str, Sequence[str]], objection: Objection, strength: int) -> list[Values]:
    names = list(factors)
    if strength == 1:
        rows: list[Values] = []
    else:
        found = AllPairs(
            list(factors.values()),
            filter_func=lambda row: not objection(dict(zip(names, row, strict=False))),
            n=strength,
        )
        rows = [dict(zip(names, row, strict=True)) for row in found]
    rows = [row for row in rows if not objection(row)]
    # With exclusions the generator may give up on a group of values that a longer search finds a place for.
    covered = {group for row in rows for group in _groups(row, strength)}
    for group in _all_groups(factors, strength):
        if group in covered:
            continue
        row = _completed(factors, objection, dict(group))
        if row is not None:
            rows.append(row)
            covered.update(_groups(row, strength))
    return rows


Group = tuple[tuple[str, str], ...]


def _groups(row: Mapping[str, str], strength: int) -> Iterator[Group]:
    return itertools.combinations(row.items(), strength)


def _all_groups(factors: Mapping[str, Sequence[str]], strength: int) -> Iterable[Group]:
    for names in itertools.combinations(factors, strength):
        for values in itertools.product(*(factors[name] for name in names)):
            yield tuple(zip(names, values, strict=True))


def _completed(factors: Mapping[str, Sequence[str]], objection: Objection, known: Values) -> Values | None:
    """Return a combination with the known values that nothing speaks against, or None."""
    if objection(known):
        return None
    missing = next((name for name in factors if name not in known), None)
    if missing is None:
        return {name: known[name] for name in factors}
    for value in factors[missing]:
        found = _completed(factors, objection, {**known, missing: value})
        if found is not None:
            return found
    return None
