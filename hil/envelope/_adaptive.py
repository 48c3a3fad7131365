"""At which cycles a motion is branched off: at every one, at every n-th, or coarse first and then where
something changes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from hil.envelope._result import Branch

_COARSE: Final = 24
"""Cycles of the first pass of an adaptive grid."""
_BEND: Final = 0.05
"""Share of the range of a measure by which the middle of two neighbours may be off a straight line."""


@dataclass(frozen=True)
class Grid:
    """Cycles of a motion at which copies are made.

    Args:
        step: Every so many cycles; 0: coarse first, then between neighbours whose reaction differs or
            whose measures do not lie on a line.

    Raises:
        ConfigurationError: The step is negative.

    """

    step: int = 1

    def __post_init__(self) -> None:
        if isinstance(self.step, bool) or not isinstance(self.step, int) or self.step < 0:
            raise ConfigurationError("every", self.step, "a number of cycles from 1 on, or 0 for adaptive")

    def first(self, cycles: int) -> list[int]:
        """Return the cycles of the first pass; the last one is always among them."""
        step = self.step or max(1, cycles // _COARSE)
        return sorted({*range(0, cycles, step), cycles - 1}) if cycles else []

    def next(self, rows: Mapping[int, Sequence[Branch]]) -> list[tuple[int, int]]:
        """Return cycle and stimulus of further branches, from those that are known, by stimulus; empty:
        nothing is left to refine.
        """
        if self.step:
            return []
        wanted: list[tuple[int, int]] = []
        for number, branches in rows.items():
            ordered = sorted(branches, key=lambda one: one.cycle)
            spans = _spans(ordered)
            bent = {
                place for place in range(1, len(ordered) - 1) if _bends(ordered[place - 1 : place + 2], spans)
            }
            for place in range(len(ordered) - 1):
                left, right = ordered[place], ordered[place + 1]
                if right.cycle - left.cycle < 2:
                    continue
                if left.reaction != right.reaction or place in bent or place + 1 in bent:
                    wanted.append(((left.cycle + right.cycle) // 2, number))
        return wanted


def _spans(branches: Sequence[Branch]) -> dict[tuple[str, str], float]:
    """Return the range of every measure of every axis over the branches."""
    spans: dict[tuple[str, str], float] = {}
    values: dict[tuple[str, str], list[float]] = {}
    for branch in branches:
        for axis, measures in branch.measures.items():
            for name, value in measures.items():
                values.setdefault((axis, name), []).append(value)
    for key, found in values.items():
        spans[key] = max(found) - min(found)
    return spans


def _bends(three: Sequence[Branch], spans: Mapping[tuple[str, str], float]) -> bool:
    left, middle, right = three
    share = (middle.cycle - left.cycle) / (right.cycle - left.cycle)
    for axis, measures in middle.measures.items():
        before, after = left.measures.get(axis), right.measures.get(axis)
        if before is None or after is None:
            continue
        for name, value in measures.items():
            line = before[name] + share * (after[name] - before[name])
            if abs(value - line) > _BEND * spans[axis, name]:
                return True
    return False
