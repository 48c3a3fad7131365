"""Leading values of a following value (`MC_GetCamLeadingValue`)."""

from __future__ import annotations

from itertools import pairwise
from typing import Final

from motion.kernel.cams.curve import Curve
from motion.kernel.cams.pieces import Piece

POSITIVE: Final = 1
NEGATIVE: Final = 2
NEAREST: Final = 3

_ROUNDING: Final = 1e-12


class Inverse:
    """The leading values at which a curve has a following value.

    Args:
        curve: The curve; its turning points are looked for once.

    """

    def __init__(self, curve: Curve) -> None:
        self._pieces: list[Piece] = []
        self._ends: list[tuple[float, float, float, float]] = []
        """Of every part without a turning point: first and last leading value, following values there."""
        for piece in curve.pieces:
            borders = [piece.start, *piece.turning(), piece.end]
            for low, high in pairwise(borders):
                self._pieces.append(piece)
                self._ends.append((low, high, piece.evaluate(low)[0], piece.evaluate(high)[0]))
        self.lowest: float = min(min(ends[2:]) for ends in self._ends)
        """Lowest following value."""
        self.highest: float = max(max(ends[2:]) for ends in self._ends)
        """Highest following value."""
        self._rounding = _ROUNDING * max(abs(self.lowest), abs(self.highest))
        self._span = _ROUNDING * max(abs(curve.start), abs(curve.end))

    def reaches(self, y: float, margin: float = 0.0) -> bool:
        """Return whether the curve has the following value, or one that differs by `margin`, anywhere."""
        return bool(self.solutions(y, margin))

    def find(self, y: float, approach: float, direction: int = NEAREST, margin: float = 0.0) -> float | None:
        """Return one leading value that has a following value; None when there is none in that direction.

        Args:
            y: The following value.
            approach: Leading value from which it is looked for; it may be outside of the curve.
            direction: `POSITIVE` or `NEGATIVE`: the next one on that side, which is not `approach` itself
                (CAM-065); `NEAREST`: of two at the same distance the larger one (CAM-063).
            margin: By what `y` has been rounded at most.

        """
        found: float | None = None
        best = 0.0
        for low, high in self.solutions(y, margin):
            if direction == NEAREST:
                candidate = min(max(approach, low), high)
                distance = abs(candidate - approach)
                if found is None or distance <= best + self._span:
                    found, best = candidate, distance
            elif direction == POSITIVE:
                candidate = low if low > approach + self._span else high
                if candidate > approach + self._span:
                    return candidate
            else:
                candidate = high if high < approach - self._span else low
                if candidate < approach - self._span:
                    found = candidate
        return found

    def solutions(self, y: float, margin: float = 0.0) -> list[tuple[float, float]]:
        """Return the leading values that have a following value, ascending, as ranges: where the curve
        stands still they have a length.
        """
        found: list[tuple[float, float]] = []
        margin += self._rounding
        for number, (low, high, first, last) in enumerate(self._ends):
            if first < last:
                if not first - margin <= y <= last + margin:
                    continue
            elif not last - margin <= y <= first + margin:
                continue
            if first == last:
                solution = low, high
            else:
                x = self._solve(self._pieces[number], low, high, y, rising=first < last)
                solution = x, x
            if found and solution[0] <= found[-1][1] + self._span:
                found[-1] = found[-1][0], max(solution[1], found[-1][1])
            else:
                found.append(solution)
        return found

    @staticmethod
    def _solve(piece: Piece, low: float, high: float, y: float, *, rising: bool) -> float:
        """Return the leading value between two, between which the piece rises or falls throughout."""
        for edge in (low, high):
            if piece.evaluate(edge)[0] == y:
                return edge
        x = 0.5 * (low + high)
        while True:
            value, slope, _ = piece.evaluate(x)
            if value == y:
                return x
            if (value < y) is rising:
                low = x
            else:
                high = x
            following = x - (value - y) / slope if slope != 0.0 else x
            if not low < following < high:
                following = 0.5 * (low + high)
                if not low < following < high:
                    return following
            if following == x:
                return x
            x = following
