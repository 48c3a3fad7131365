"""Modulo range of a technology object: positions within it, and how often it has been passed (CFG section 6).

Everything inside an axis is calculated with positions that grow without end; the range is what
the data block, targets and software limits are seen through. So following error and control
difference know no border (CFG-105).
"""

from __future__ import annotations

from fractions import Fraction
from math import floor, inf
from typing import Final

POSITIVE: Final = 1
NEGATIVE: Final = 2
SHORTEST: Final = 3

_ROUNDING: Final = 1e-9
"""Part of the range by which a calculated position may lie before its upper end
and counts as the next lower one.
"""
_EXACT_ROUNDING: Final = Fraction(1, 10**9)


class Modulo:
    """The modulo range of an object; without one positions are themselves and all counters 0 (CFG-106).

    Args:
        length: Length of the range, position unit, above 0; None = there is no range.
        start: Where it begins, position unit.

    """

    def __init__(self, length: float | None = None, start: float = 0.0) -> None:
        self.enabled = length is not None
        self.length: float = 1.0 if length is None else length
        self.start: float = start
        # What the user has written, and not the nearest binary number: a thousand million ranges of 0.1 are
        # one hundred million.
        self._exact_length, self._exact_start = Fraction(repr(self.length)), Fraction(repr(self.start))

    def cycle(self, position: float) -> int:
        """Return how often the range lies below `position` (CFG-097, CFG-098)."""
        if not self.enabled:
            return 0
        return floor((position - self.start) / self.length + _ROUNDING)

    def wrap(self, position: float) -> float:
        """Return the place of `position` in the range: start <= place < start + length."""
        if not self.enabled:
            return position
        place = position - self.cycle(position) * self.length
        return max(place, self.start)

    def exact_place(self, position: Fraction) -> tuple[int, float]:
        """Return `cycle` and `wrap` of a position that is known exactly."""
        length = self._exact_length
        inside = position - self._exact_start
        cycle = floor(inside / length + _EXACT_ROUNDING)
        return cycle, max(float(inside - cycle * length + self._exact_start), self.start)

    def shortest(self, distance: float) -> float:
        """Return the shortest way to the place that is `distance` away; half a range is gone in positive
        direction (CFG-122).
        """
        if not self.enabled:
            return distance
        length = self.length
        rest = distance - floor(distance / length + _ROUNDING) * length
        return rest - length if rest > 0.5 * length * (1.0 + _ROUNDING) else rest

    def target(self, position: float, present: float, direction: int) -> float:
        """Return the unwrapped target of an absolute positioning to the place
        `position`, from `present` (MC-255).
        """
        if not self.enabled:
            return position
        if direction == SHORTEST:
            return present + self.shortest(position - present)
        ahead = (position - present) % self.length
        if self.length - ahead <= _ROUNDING * self.length:
            ahead = 0.0
        return present + (ahead if direction == POSITIVE or ahead == 0.0 else ahead - self.length)

    def homed(self, position: float) -> float:
        """Return the unwrapped position at a home position found by active or
        passive homing (CFG-110, CFG-111).
        """
        if not self.enabled:
            return position
        place = self.wrap(position)
        upper_half = place > self.start + 0.5 * self.length * (1.0 + _ROUNDING)
        return place - self.length if upper_half else place

    def limits(self, low: float, high: float, present: float) -> tuple[float, float]:
        """Return software limits around the unwrapped position `present` (VAR-171).

        A limit outside the range does not act alone: the end of the range takes its place. Two of them do not
        act at all. A negative limit above the positive one permits what lies across the end of the range.
        """
        if not self.enabled:
            return low, high
        end = self.start + self.length
        low_inside, high_inside = self.start <= low <= end, self.start <= high <= end
        if not low_inside and not high_inside:
            return -inf, inf
        base = self.cycle(present) * self.length
        if low_inside and high_inside and low > high:
            # Between the two, where the axis must not be, it belongs to the nearer one.
            upper = present - base > 0.5 * (low + high)
            return (
                (base + low, base + high + self.length) if upper else (base + low - self.length, base + high)
            )
        return base + (low if low_inside else self.start), base + (high if high_inside else end)


NO_MODULO: Final = Modulo()
"""Of an object without positions or without a range."""
