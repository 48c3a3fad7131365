"""A cam that has been interpolated: one following value for every leading value of its range."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence

from motion.kernel.cams.pieces import Piece, Polynomial, Values


class Curve:
    """The function y = f(x) that following axes follow, and that read instructions read.

    It does not change; a new interpolation makes a new one. Several readers may use it.

    Args:
        pieces: The pieces by ascending leading value, at least one; each begins where the one before ends.

    """

    def __init__(self, pieces: Sequence[Piece]) -> None:
        self.pieces: list[Piece] = list(pieces)
        self.starts: list[float] = [piece.start for piece in self.pieces]
        self.start: float = self.starts[0]
        """First leading value of the definition range (`StatusCam.StartLeadingValue`)."""
        self.end: float = self.pieces[-1].end
        """Last leading value (`StatusCam.EndLeadingValue`)."""
        self.period: float = self.end - self.start
        """Length of the definition range."""
        self.lift: float = self.pieces[-1].evaluate(self.end)[0] - self.pieces[0].evaluate(self.start)[0]
        """Following value at the end less that at the start."""
        self._piece: Piece = self.pieces[0]

    def evaluate(self, x: float) -> Values:
        """Return the following value and its first two derivatives with respect to the leading value.

        Outside of the definition range the value at the next end of it, with derivatives of 0. Where a
        derivative has a step it is that on the right, at the end of the range that on the left (CAM-036).
        """
        piece = self._piece
        if not piece.start <= x < piece.end:
            if not self.start <= x <= self.end:
                edge = self.start if x < self.start else self.end
                return self._at(edge).evaluate(edge)[0], 0.0, 0.0
            piece = self._piece = self._at(x)
        return piece.evaluate(x)

    def coefficients(self) -> list[tuple[float, ...]] | None:
        """Return the pieces as numbers: start, end, origin of the argument, coefficients of s^0 to s^6,
        factor of a sine, rate and phase of its argument; None where a piece is no such polynomial.
        """
        found: list[tuple[float, ...]] = []
        for piece in self.pieces:
            if not isinstance(piece, Polynomial):
                return None
            found.append(
                (
                    piece.start, piece.end, piece.origin,
                    piece.a0, piece.a1, piece.a2, piece.a3, piece.a4, piece.a5, piece.a6,
                    piece.amplitude, piece.rate, piece.phase,
                )
            )  # fmt: skip
        return found

    def third(self, x: float) -> float:
        """Return the third derivative; 0 outside of the definition range."""
        return self._at(x).third(x) if self.contains(x) else 0.0

    def contains(self, x: float) -> bool:
        """Return whether a leading value is in the definition range, ends included."""
        return self.start <= x <= self.end

    def _at(self, x: float) -> Piece:
        number = bisect_right(self.starts, x) - 1
        return self.pieces[max(number, 0)]
