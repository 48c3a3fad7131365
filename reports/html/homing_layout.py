"""Layout of the picture of a homing: its broken scale, round numbers, words that keep apart."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from itertools import pairwise

from reports.homing import HomingDrawing, HomingStep

MINUS = "\N{MINUS SIGN}"


def named(step: HomingStep) -> str:
    """Return the name of a step with the direction of a travel."""
    return step.name + {1: " +", -1: f" {MINUS}", 0: ""}[step.direction if step.travel else 0]


def short(value: float, digits: int = 1) -> str:
    """Return a number for people: with a true minus sign, and, beyond one digit, without zeros that say
    nothing.
    """
    text = f"{value:.{digits}f}"
    if digits > 1:
        text = text.rstrip("0").rstrip(".")
    return "0" if text in {"-0", "-0.0", "0.0"} else text.replace("-", MINUS)


def round_numbers(low: float, high: float, about: int) -> list[float]:
    """Return round numbers between two values."""
    span = max(high - low, 1e-9)
    rough = span / about
    size = 10.0 ** math.floor(math.log10(rough))
    size *= next(factor for factor in (1.0, 2.0, 5.0, 10.0) if factor * size >= rough)
    first = math.ceil(low / size - 1e-9)
    return [number * size for number in range(first, math.floor(high / size + 1e-9) + 1)]


def interesting(drawing: HomingDrawing) -> list[float]:
    """Return the places that a picture must show to scale: moments, edges, turns, and where the velocity
    changes.
    """
    places = [place for step in drawing.steps for place in (step.begin, step.end)]
    places += [edge.position for lane in drawing.lanes for edge in lane.edges]
    places += [place for place in (drawing.mark, drawing.home) if place is not None]
    top = max((abs(point[2]) for point in drawing.path), default=0.0)
    for before, after in pairwise(drawing.path):
        if abs(after[2] - before[2]) > 0.004 * top:
            places += [before[1], after[1]]
    return sorted(places)


class Scale:
    """Position to part of the width: to scale, but that long stretches without any event are shortened.

    Args:
        low: Left end, position unit.
        high: Right end.
        places: Ascending places that matter.

    """

    def __init__(self, low: float, high: float, places: Sequence[float]) -> None:
        gaps = [(a, b) for a, b in pairwise(places) if b - a > 0.25 * (high - low)]
        rest = (high - low) - sum(b - a for a, b in gaps)
        length = 0.3 * rest / max(len(gaps), 1)
        margin = 0.25 * length
        self.short = [(a + margin, b - margin) for a, b in gaps if b - a > 2.0 * length]
        """What is shortened: from, to, position unit."""
        self._knots = [low]
        self._parts = [0.0]
        for a, b in self.short:
            self._add(a, a - self._knots[-1])
            self._add(b, length - 2.0 * margin)
        self._add(high, high - self._knots[-1])

    def _add(self, place: float, length: float) -> None:
        self._knots.append(place)
        self._parts.append(self._parts[-1] + length)

    def part(self, place: float) -> float:
        """Return where a place lies, 0 to 1."""
        knots, parts = self._knots, self._parts
        index = min(max(bisect_right(knots, place) - 1, 0), len(knots) - 2)
        share = (place - knots[index]) / (knots[index + 1] - knots[index])
        return (parts[index] + share * (parts[index + 1] - parts[index])) / parts[-1]

    def left_out(self, place: float) -> bool:
        """Return whether a place lies in what is shortened."""
        return any(low <= place <= high for low, high in self.short)

    def ticks(self, about: int) -> int:
        """Return about how many round numbers the scale takes to have `about` of them outside of what is
        shortened.
        """
        return min(round(about * (self._knots[-1] - self._knots[0]) / self._parts[-1]), 200)


class Free:
    """Keeps what is written apart."""

    def __init__(self) -> None:
        self._taken: list[tuple[float, float, float, float]] = []

    def take(self, x: float, y: float, width: float, height: float) -> None:
        """Occupy a box around a point."""
        self._taken.append((x - width / 2, y - height / 2, x + width / 2, y + height / 2))

    def place(
        self, candidates: Iterable[tuple[float, float]], width: float, height: float
    ) -> tuple[float, float]:
        """Occupy the first place that is free, or the last one."""
        x = y = 0.0
        for x, y in candidates:
            box = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
            if not any(
                box[0] < b[2] and b[0] < box[2] and box[1] < b[3] and b[1] < box[3] for b in self._taken
            ):
                break
        self.take(x, y, width, height)
        return x, y
