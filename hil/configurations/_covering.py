"""Few rows in which every two values of different factors meet, although many do not go together.

`allpairspy` gives a row up when its last factors do not fit its first ones, and leaves pairs uncovered; here
a choice takes away at once what it excludes from the factors that are still open.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence

from hil.configurations.factors import Row

Value = tuple[str, str]
"""A factor and one of its values."""
Pair = tuple[Value, Value]

_MOST_TRIES = 200
"""Choices that are taken back before two values count as never together."""


def pairs_of(row: Row) -> Iterator[Pair]:
    """Yield every two values of a row, in the order of its factors."""
    return itertools.combinations(row.items(), 2)


def covering(factors: Mapping[str, Sequence[str]], objection: Callable[[Row], str]) -> list[Row]:
    """Return rows in which every two values meet against which nothing speaks.

    Args:
        factors: Values by name of the factor; their order decides between rows that are equally good.
        objection: What speaks against a row, or against what is known of it so far; empty: nothing.

    """
    return _Covering(factors, objection).rows()


class _Covering:
    def __init__(self, factors: Mapping[str, Sequence[str]], objection: Callable[[Row], str]) -> None:
        self._factors = factors
        self._objection = objection
        possible = [
            (name, value)
            for name, values in factors.items()
            for value in values
            if not objection({name: value})
        ]
        self._fitting: dict[Value, set[Value]] = {value: set() for value in possible}
        self._open: dict[Pair, None] = {}
        for first, second in itertools.combinations(possible, 2):
            if first[0] != second[0] and not objection(dict((first, second))):
                self._fitting[first].add(second)
                self._fitting[second].add(first)
                self._open[first, second] = None
        self._tries = 0

    def rows(self) -> list[Row]:
        rows: list[Row] = []
        while self._open:
            first, second = next(iter(self._open))
            self._tries = 0
            row = self._grown(*first, *self._begun(second))
            if row is None:
                del self._open[first, second]
                continue
            rows.append({name: row[name] for name in self._factors})
            for pair in pairs_of(rows[-1]):
                self._open.pop(pair, None)
        return rows

    def _begun(self, chosen: Value) -> tuple[dict[str, str], dict[str, list[str]]]:
        """Return a row with one value, and what the other factors may have."""
        fits = self._fitting[chosen]
        left = {
            name: [value for value in values if (name, value) in fits]
            for name, values in self._factors.items()
            if name != chosen[0]
        }
        return dict([chosen]), left

    def _grown(
        self, name: str, value: str, known: dict[str, str], left: dict[str, list[str]]
    ) -> dict[str, str] | None:
        """Return a whole row with what is known and one more value; None: there is none."""
        fits = self._fitting[name, value]
        row = {**known, name: value}
        if self._objection(row):
            return None
        domains = {
            other: [one for one in values if (other, one) in fits]
            for other, values in left.items()
            if other != name
        }
        if not domains:
            return row
        if not all(domains.values()):
            return None
        for gain_name, gain_value in self._choices(row, domains):
            found = self._grown(gain_name, gain_value, row, domains)
            if found is not None:
                return found
            self._tries += 1
            if self._tries > _MOST_TRIES:
                return None
        return None

    def _choices(self, row: Row, domains: Mapping[str, Sequence[str]]) -> list[Value]:
        """Return the values of one factor that is open, the best first: a factor without a choice, else the
        one with the value that covers most.
        """
        best, best_name = -1, ""
        gains: dict[str, list[tuple[int, str]]] = {}
        for name, values in domains.items():
            if len(values) == 1:
                return [(name, values[0])]
            gains[name] = [(self._gain(row, (name, value)), value) for value in values]
            most = max(gain for gain, _ in gains[name])
            if most > best:
                best, best_name = most, name
        ranked = sorted(gains[best_name], key=lambda one: -one[0])
        return [(best_name, value) for _, value in ranked]

    def _gain(self, row: Row, value: Value) -> int:
        is_open = self._open
        return sum((one, value) in is_open or (value, one) in is_open for one in row.items())
