"""Pieces of a cam: a polynomial of up to the sixth degree with a sine term, and a Bezier curve.

A piece gives the following value and its derivatives at a leading value. All values are numbers
without a unit: a cam has none (CAM section 12).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import copysign, cos, sin, sqrt

Values = tuple[float, float, float]
"""Following value, first and second derivative."""

_ITERATIONS = 64
_SMALLEST = 1e-7
"""Share of a piece that is not looked at more closely: there the first derivative touches 0."""
_MOST_LOOKS = 100_000
"""Intervals that are looked at in one piece: beyond them a sine has more turning points than a machine
follows.
"""


@dataclass(frozen=True, slots=True)
class Point:
    """One point of a cam (CAM-004)."""

    x: float
    """Leading value."""
    y: float
    """Following value."""


@dataclass(frozen=True, slots=True)
class Segment:
    """One segment of a cam: `y = a0 + a1 s + .. + a6 s^6 + amplitude sin(rate s + phase)`, `s = x - xmin`
    (CAM-006 to CAM-008, CAM section 12.1).
    """

    xmin: float
    xmax: float
    a: tuple[float, float, float, float, float, float, float]
    """Coefficients of s^0 to s^6."""
    amplitude: float = 0.0
    """`sineAmplitude`."""
    rate: float = 0.0
    """`sinePeriod`, the factor of s, rad."""
    phase: float = 0.0
    """`sinePhase`, rad."""

    def piece(self, start: float, end: float) -> Polynomial:
        """Return what the segment is between two leading values; its argument stays `x - xmin`."""
        return Polynomial(
            start, end, self.xmin, self.a, amplitude=self.amplitude, rate=self.rate, phase=self.phase
        )


class Piece:
    """A part of a cam between two leading values.

    Args:
        start: First leading value.
        end: Last leading value, above `start`.

    """

    def __init__(self, start: float, end: float) -> None:
        self.start: float = start
        self.end: float = end

    def evaluate(self, x: float) -> Values:
        """Return the following value and its first two derivatives."""
        raise NotImplementedError

    def third(self, x: float) -> float:
        """Return the third derivative."""
        raise NotImplementedError

    def turning(self) -> list[float]:
        """Return the leading values inside at which the first derivative can change its sign, ascending."""
        raise NotImplementedError


class Polynomial(Piece):
    """A polynomial of up to the sixth degree and a sine.

    Args:
        start: First leading value.
        end: Last leading value.
        origin: Leading value at which the argument of the polynomial is 0.
        coefficients: Those of s^0 to s^6.
        amplitude: Factor of the sine.
        rate: Factor of its argument, rad.
        phase: Offset of its argument, rad.

    """

    def __init__(
        self,
        start: float,
        end: float,
        origin: float,
        coefficients: tuple[float, float, float, float, float, float, float],
        *,
        amplitude: float = 0.0,
        rate: float = 0.0,
        phase: float = 0.0,
    ) -> None:
        super().__init__(start, end)
        self.origin: float = origin
        self.a0, self.a1, self.a2, self.a3, self.a4, self.a5, self.a6 = coefficients
        self.amplitude: float = amplitude
        self.rate: float = rate
        self.phase: float = phase

    def evaluate(self, x: float) -> Values:
        """Return the following value and its first two derivatives."""
        s = x - self.origin
        a2, a3, a4, a5, a6 = self.a2, self.a3, self.a4, self.a5, self.a6
        y = self.a0 + s * (self.a1 + s * (a2 + s * (a3 + s * (a4 + s * (a5 + s * a6)))))
        d = self.a1 + s * (2.0 * a2 + s * (3.0 * a3 + s * (4.0 * a4 + s * (5.0 * a5 + s * 6.0 * a6))))
        dd = 2.0 * a2 + s * (6.0 * a3 + s * (12.0 * a4 + s * (20.0 * a5 + s * 30.0 * a6)))
        if self.amplitude != 0.0:
            rate = self.rate
            angle = rate * s + self.phase
            wave = self.amplitude * sin(angle)
            return y + wave, d + self.amplitude * rate * cos(angle), dd - rate * rate * wave
        return y, d, dd

    def third(self, x: float) -> float:
        """Return the third derivative."""
        s = x - self.origin
        rate = self.rate
        polynomial = 6.0 * self.a3 + s * (24.0 * self.a4 + s * (60.0 * self.a5 + s * 120.0 * self.a6))
        return polynomial - self.amplitude * rate * rate * rate * cos(rate * s + self.phase)

    def turning(self) -> list[float]:
        """Return the leading values inside at which the first derivative can change its sign, ascending."""
        found: list[float] = []
        if not any((self.a1, self.a2, self.a3, self.a4, self.a5, self.a6, self.amplitude * self.rate)):
            return found
        smallest = _SMALLEST * (self.end - self.start)
        pending = [(self.start, self.end)]
        looks = 0
        while pending and looks < _MOST_LOOKS:
            looks += 1
            low, high = pending.pop()
            middle, half = 0.5 * (low + high), 0.5 * (high - low)
            _, slope, bend = self.evaluate(middle)
            most = self._most_jerk(max(abs(low - self.origin), abs(high - self.origin)))
            if abs(slope) > abs(bend) * half + 0.5 * most * half * half or half < smallest:
                continue
            if abs(bend) > most * half:
                # The first derivative is monotonous here: it has one root or none.
                first, last = self.evaluate(low)[1], self.evaluate(high)[1]
                if first * last < 0.0:
                    found.append(self._level(low, high))
                elif first == 0.0 and low > self.start:
                    found.append(low)
                continue
            pending += [(low, middle), (middle, high)]
        return sorted(found)

    def _level(self, low: float, high: float) -> float:
        """Return the one leading value between two at which the first derivative is 0."""
        rising = self.evaluate(low)[1] < 0.0
        while True:
            middle = 0.5 * (low + high)
            if not low < middle < high:
                return middle
            if (self.evaluate(middle)[1] < 0.0) is rising:
                low = middle
            else:
                high = middle

    def _most_jerk(self, s: float) -> float:
        """Return a bound of the third derivative for arguments of at most `s`."""
        rate = abs(self.rate)
        wave = abs(self.amplitude) * rate * rate * rate
        return (
            6.0 * abs(self.a3)
            + s * (24.0 * abs(self.a4) + s * (60.0 * abs(self.a5) + s * 120.0 * abs(self.a6)))
            + wave
        )


class BezierPiece(Piece):
    """A cubic Bezier curve whose leading values grow from the first control point to the last.

    Args:
        points: The four control points.

    """

    def __init__(self, points: tuple[Point, Point, Point, Point]) -> None:
        first, second, third, fourth = points
        super().__init__(first.x, fourth.x)
        self.x1: float = 3.0 * (second.x - first.x)
        self.x2: float = 3.0 * (third.x - 2.0 * second.x + first.x)
        self.x3: float = fourth.x - first.x - 3.0 * (third.x - second.x)
        self.y0: float = first.y
        self.y1: float = 3.0 * (second.y - first.y)
        self.y2: float = 3.0 * (third.y - 2.0 * second.y + first.y)
        self.y3: float = fourth.y - first.y - 3.0 * (third.y - second.y)

    def _parameter(self, x: float) -> float:
        """Return the parameter of the curve at a leading value, 0 to 1."""
        wanted = x - self.start
        if wanted <= 0.0:
            return 0.0
        if x >= self.end:
            return 1.0
        low, high = 0.0, 1.0
        u = wanted / (self.end - self.start)
        for _ in range(_ITERATIONS):
            excess = u * (self.x1 + u * (self.x2 + u * self.x3)) - wanted
            if excess > 0.0:
                high = u
            else:
                low = u
            slope = self.x1 + u * (2.0 * self.x2 + u * 3.0 * self.x3)
            following = u - excess / slope if slope > 0.0 else 0.5 * (low + high)
            if not low < following < high:
                following = 0.5 * (low + high)
            if abs(following - u) <= 1e-16:
                break
            u = following
        return u

    def evaluate(self, x: float) -> Values:
        """Return the following value and its first two derivatives."""
        u = self._parameter(x)
        y = self.y0 + u * (self.y1 + u * (self.y2 + u * self.y3))
        dx = self.x1 + u * (2.0 * self.x2 + u * 3.0 * self.x3)
        dy = self.y1 + u * (2.0 * self.y2 + u * 3.0 * self.y3)
        if dx <= 0.0:
            return y, 0.0, 0.0
        slope = dy / dx
        ddx = 2.0 * self.x2 + 6.0 * u * self.x3
        ddy = 2.0 * self.y2 + 6.0 * u * self.y3
        return y, slope, (ddy - slope * ddx) / (dx * dx)

    def third(self, x: float) -> float:
        """Return the third derivative."""
        u = self._parameter(x)
        dx = self.x1 + u * (2.0 * self.x2 + u * 3.0 * self.x3)
        if dx <= 0.0:
            return 0.0
        _, slope, bend = self.evaluate(x)
        ddx = 2.0 * self.x2 + 6.0 * u * self.x3
        return (6.0 * self.y3 - slope * 6.0 * self.x3 - 3.0 * bend * dx * ddx) / (dx * dx * dx)

    def turning(self) -> list[float]:
        """Return the leading values inside at which the first derivative can change its sign, ascending."""
        a, b, c = 3.0 * self.y3, self.y2, self.y1  # of a u^2 + 2 b u + c
        inside = b * b - a * c
        if inside <= 0.0:
            return []
        larger = -(b + copysign(sqrt(inside), b))
        roots = [c / larger] + ([larger / a] if a != 0.0 else [])
        return [
            self.start + u * (self.x1 + u * (self.x2 + u * self.x3)) for u in sorted(roots) if 0.0 < u < 1.0
        ]
