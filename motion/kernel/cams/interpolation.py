"""From points and segments to a curve: how gaps are closed (CAM sections 12.2 and 13.1)."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from enum import IntEnum
from itertools import pairwise
from math import inf, isfinite, nextafter
from typing import Final

from motion.kernel.cams.curve import Curve
from motion.kernel.cams.pieces import BezierPiece, Piece, Point, Polynomial, Segment

PULLED_TOGETHER: Final = 1e-4
"""Largest gap between two segments that gets no transition (CAM-021)."""
_ROUNDING: Final = 1e-9
"""Share of that by which a difference of two decimal numbers may be above it."""


class Interpolation(IntEnum):
    """How gaps are closed (`InterpolationSettings.InterpolationMode`, CAM-010)."""

    LINEAR = 0
    CUBIC = 1
    BEZIER = 2


class Boundary(IntEnum):
    """What holds at the ends of the cam (`InterpolationSettings.BoundaryConditions`, CAM-011)."""

    NONE = 0
    EQUAL_VELOCITY = 1


class CamError(ValueError):
    """A cam cannot be interpolated."""


class EmptyCamError(CamError):
    """There is neither point nor segment (16#80AA)."""


class InvalidCamError(CamError):
    """Points or segments make no function, for example a single point (16#80AC)."""


class _Used:
    """A part of a segment that counts."""

    __slots__ = ("end", "segment", "start")

    def __init__(self, segment: Segment, start: float, end: float) -> None:
        self.segment = segment
        self.start = start
        self.end = end

    def piece(self) -> Polynomial:
        return self.segment.piece(self.start, self.end)


class _Chain:
    """Points of one gap, those of the segments at its ends included.

    `left` and `right` are the slopes of these segments; None where the cam begins or ends with a point.
    """

    __slots__ = ("left", "points", "right")

    def __init__(self, points: list[Point], left: float | None, right: float | None) -> None:
        self.points = points
        self.left = left
        self.right = right


def interpolate(
    points: Sequence[Point],
    segments: Sequence[Segment],
    mode: Interpolation = Interpolation.CUBIC,
    boundary: Boundary = Boundary.NONE,
) -> Curve:
    """Return the curve through points and segments, which may be in any order (CAM-022).

    Of several points with one leading value the last counts (CAM-018); a point in the range of a segment
    does not count (CAM-019); of two segments the one that begins later is used completely (CAM-020); a gap
    of at most 1e-4 between two segments is none (CAM-021).

    Args:
        points: The points.
        segments: The segments.
        mode: How gaps are closed.
        boundary: `EQUAL_VELOCITY`: the first derivative at the end is that at the start (CAM-044). A segment
            at the start or end keeps its own, and straight lines theirs.

    Raises:
        EmptyCamError: There is neither point nor segment.
        InvalidCamError: A number is not finite, a segment has no length, there is a single point only, or
            points are so near to each other that the function has no finite slope.

    """
    try:
        return _interpolated(points, segments, mode, boundary)
    except (ArithmeticError, ValueError) as error:
        if isinstance(error, CamError):
            raise
        raise InvalidCamError("numbers are too large, or points too near to each other") from error


def _interpolated(
    points: Sequence[Point], segments: Sequence[Segment], mode: Interpolation, boundary: Boundary
) -> Curve:
    if not points and not segments:
        raise EmptyCamError("there is neither point nor segment")
    used = _visible(segments)
    free = _free(points, used)
    if not used and len(free) < 2:
        raise InvalidCamError("a single point makes no cam: at least two points or a segment")
    chains = _chains(free, used)
    pieces: list[Piece] = [part.piece() for part in used]
    if mode == Interpolation.LINEAR:
        for chain in chains:
            pieces += _lines(chain.points)
    elif chains:
        equal = boundary == Boundary.EQUAL_VELOCITY
        outer = _OuterSlopes(chains, used)
        if mode == Interpolation.BEZIER:
            slope = outer.bezier() if equal else None
            for chain in chains:
                opened = (chain.left is None, chain.right is None)
                pieces += _bezier(_tilted(chain.points, slope, opened))
        else:
            slope = outer.cubic() if equal else None
            for chain in chains:
                left = slope if chain.left is None else chain.left
                right = slope if chain.right is None else chain.right
                pieces += _cubic(chain.points, _slopes(chain.points, left, right))
    pieces.sort(key=_start)
    for piece in pieces:
        if not all(map(isfinite, (*piece.evaluate(piece.start), *piece.evaluate(piece.end)))):
            raise InvalidCamError(f"the values from {piece.start} to {piece.end} are too large")
    return Curve(pieces)


def _start(piece: Piece) -> float:
    return piece.start


# -- what counts


def _visible(segments: Sequence[Segment]) -> list[_Used]:
    """Return the parts of segments that count, by ascending leading value."""
    for segment in segments:
        numbers = (segment.xmin, segment.xmax, *segment.a, segment.amplitude, segment.rate, segment.phase)
        if not all(map(isfinite, numbers)):
            raise InvalidCamError(f"a number of the segment at {segment.xmin} is not finite")
        if segment.xmin >= segment.xmax:
            raise InvalidCamError(f"the segment from {segment.xmin} to {segment.xmax} has no length")
    parts: list[_Used] = []
    below: list[Segment] = []
    """Those that have begun, the one that counts at last."""
    position = -inf

    def advance(to: float) -> None:
        # One that ends above another goes on when that has ended, right behind its end.
        nonlocal position
        while below and position < to:
            top = below[-1]
            if top.xmax <= position:
                below.pop()
                continue
            end = min(top.xmax, to)
            parts.append(_Used(top, position, end))
            if top.xmax <= to:
                below.pop()
                position = nextafter(end, inf)
                if not any(one.xmax > end for one in below):
                    position = end
            else:
                position = end
        position = to

    for segment in sorted(segments, key=lambda one: one.xmin):
        advance(segment.xmin)
        below.append(segment)
    advance(inf)
    for part, following in pairwise(parts):
        gap = following.start - part.end
        if 0.0 < gap <= PULLED_TOGETHER * (1.0 + _ROUNDING):
            part.end = following.start
    return parts


def _free(points: Sequence[Point], used: Sequence[_Used]) -> list[Point]:
    """Return the points outside of segments by ascending leading value, one for each."""
    by_x: dict[float, Point] = {}
    for point in points:
        if not (isfinite(point.x) and isfinite(point.y)):
            raise InvalidCamError(f"the point ({point.x}, {point.y}) is not finite")
        by_x[point.x] = point
    ends = [part.end for part in used]
    free = []
    for x in sorted(by_x):
        number = bisect_left(ends, x)
        if number == len(used) or x < used[number].start:
            free.append(by_x[x])
    return free


def _chains(free: list[Point], used: list[_Used]) -> list[_Chain]:
    """Return the gaps by ascending leading value."""
    chains: list[_Chain] = []
    knots: list[Point] = []
    left: float | None = None
    number = 0
    for part in used:
        while number < len(free) and free[number].x < part.start:
            knots.append(free[number])
            number += 1
        piece = part.piece()
        y, slope, _ = piece.evaluate(part.start)
        if knots and part.start > knots[-1].x:
            chains.append(_Chain([*knots, Point(part.start, y)], left, slope))
        y, left, _ = piece.evaluate(part.end)
        knots = [Point(part.end, y)]
    knots += free[number:]
    if len(knots) > 1:
        chains.append(_Chain(knots, left, None))
    return chains


class _OuterSlopes:
    """The slope that start and end of a cam are to share (CAM-044)."""

    def __init__(self, chains: list[_Chain], used: list[_Used]) -> None:
        self._first = chains[0] if chains[0].left is None else None
        self._last = chains[-1] if chains[-1].right is None else None
        self._given: float | None = None
        """Slope of the segment at the one end that is no point."""
        if self._first is None and used:
            self._given = used[0].piece().evaluate(used[0].start)[1]
        elif self._last is None and used:
            self._given = used[-1].piece().evaluate(used[-1].end)[1]

    def cubic(self) -> float | None:
        """Return the slope with which the second derivatives agree too, where no segment gives one."""
        if self._given is not None:
            return self._given
        first, last = self._first, self._last
        assert first is not None  # otherwise a segment gives the slope
        assert last is not None
        steps = []
        for slope in (0.0, 1.0):
            right = slope if first.right is None else first.right
            begins = _cubic(first.points, _slopes(first.points, slope, right))[0]
            left = slope if last.left is None else last.left
            ends = _cubic(last.points, _slopes(last.points, left, slope))[-1]
            steps.append(begins.evaluate(begins.start)[2] - ends.evaluate(ends.end)[2])
        return steps[0] / (steps[0] - steps[1])

    def bezier(self) -> float | None:
        """Return the smaller of the slopes of the first and the last leg, 0 where they differ in sign: so the
        curve stays between its points.
        """
        if self._given is not None:
            return self._given
        first, last = self._first, self._last
        assert first is not None  # otherwise a segment gives the slope
        assert last is not None
        begins, ends = _leg(first.points[0], first.points[1]), _leg(last.points[-2], last.points[-1])
        if begins * ends <= 0.0:
            return 0.0
        return begins if abs(begins) <= abs(ends) else ends


def _leg(first: Point, second: Point) -> float:
    return (second.y - first.y) / (second.x - first.x)


# -- the ways to close a gap


def _lines(points: list[Point]) -> list[Polynomial]:
    return [
        Polynomial(one.x, two.x, one.x, (one.y, _leg(one, two), 0.0, 0.0, 0.0, 0.0, 0.0))
        for one, two in pairwise(points)
    ]


def _slopes(points: list[Point], left: float | None, right: float | None) -> list[float]:
    """Return the slopes of the cubic spline at its points.

    Args:
        points: At least two.
        left: Slope at the first point; None: the second derivative there is 0.
        right: Slope at the last point, likewise.

    """
    steps = [two.x - one.x for one, two in pairwise(points)]
    legs = [_leg(one, two) for one, two in pairwise(points)]
    # Second derivatives are equal on both sides of every point: a system with three diagonals.
    upper = [0.0 if left is not None else 0.5]
    values = [left if left is not None else 1.5 * legs[0]]
    for number in range(1, len(legs)):
        before, after = 1.0 / steps[number - 1], 1.0 / steps[number]
        pivot = 2.0 * (before + after) - before * upper[-1]
        value = 3.0 * (legs[number - 1] * before + legs[number] * after)
        upper.append(after / pivot)
        values.append((value - before * values[-1]) / pivot)
    slopes = [0.0] * len(points)
    slopes[-1] = right if right is not None else (3.0 * legs[-1] - values[-1]) / (2.0 - upper[-1])
    for number in range(len(legs) - 1, -1, -1):
        slopes[number] = values[number] - upper[number] * slopes[number + 1]
    return slopes


def _cubic(points: list[Point], slopes: list[float]) -> list[Polynomial]:
    pieces = []
    for number, (one, two) in enumerate(pairwise(points)):
        step, leg = two.x - one.x, _leg(one, two)
        first, second = slopes[number], slopes[number + 1]
        a2 = (3.0 * leg - 2.0 * first - second) / step
        a3 = (first + second - 2.0 * leg) / (step * step)
        pieces.append(Polynomial(one.x, two.x, one.x, (one.y, first, a2, a3, 0.0, 0.0, 0.0)))
    return pieces


def _tilted(points: list[Point], slope: float | None, opened: tuple[bool, bool]) -> list[Point]:
    """Return control points whose curve has a slope at the ends that are open."""
    if slope is None:
        return points
    if len(points) == 2 and opened[0] and opened[1]:
        return points
    found = list(points)
    if len(points) < 4:
        # There is no control point of its own for either end.
        if opened[0]:
            found.insert(1, _middle(points[0], points[1]))
        if opened[1]:
            found.insert(-1, _middle(points[-2], points[-1]))
    if opened[0]:
        x = found[1].x
        found[1] = Point(x, found[0].y + slope * (x - found[0].x))
    if opened[1]:
        x = found[-2].x
        found[-2] = Point(x, found[-1].y + slope * (x - found[-1].x))
    return found


def _middle(one: Point, two: Point) -> Point:
    return Point(0.5 * (one.x + two.x), 0.5 * (one.y + two.y))


def _bezier(points: list[Point]) -> list[Piece]:
    """Return the clamped cubic B-spline of the control points as Bezier curves; of three points the
    parabola, of two the line (CAM-042).
    """
    if len(points) == 2:
        return list(_lines(points))
    if len(points) == 3:
        first, second, third = points
        inner = _between(first, second, 2.0 / 3.0), _between(third, second, 2.0 / 3.0)
        return [BezierPiece((first, *inner, third))]
    spans = len(points) - 3
    knots = [0.0] * 3 + [float(number) for number in range(spans + 1)] + [float(spans)] * 3
    pieces: list[Piece] = []
    first = points[0]
    for span in range(spans):
        t, u = knots[span + 3], knots[span + 4]
        second, third = _blossom(points, knots, span, (t, t, u)), _blossom(points, knots, span, (t, u, u))
        last = points[-1] if span == spans - 1 else _blossom(points, knots, span, (u, u, u))
        pieces.append(BezierPiece((first, second, third, last)))
        first = last
    return pieces


def _blossom(points: list[Point], knots: list[float], span: int, at: tuple[float, float, float]) -> Point:
    """Return the control point of one span of the B-spline that belongs to three parameters."""
    found = points[span : span + 4]
    for level, parameter in enumerate(at):
        width = 3 - level
        found = [
            _between(
                found[number],
                found[number + 1],
                (parameter - knots[span + level + number + 1])
                / (knots[span + number + 4] - knots[span + level + number + 1]),
            )
            for number in range(width)
        ]
    return found[0]


def _between(one: Point, two: Point, share: float) -> Point:
    return Point(one.x + share * (two.x - one.x), one.y + share * (two.y - one.y))
