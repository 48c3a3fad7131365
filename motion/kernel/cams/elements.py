"""Elements of a profile and the points and segments that they occupy (CAM section 12.3)."""

from __future__ import annotations

from collections.abc import Sequence
from math import asin

from motion.kernel.cams.interpolation import Interpolation, interpolate
from motion.kernel.cams.laws import Law, Part
from motion.kernel.cams.pieces import Point, Segment
from motion.kernel.cams.transitions import APPROXIMATION, Elements, law_elements


def line(start: Point, end: Point) -> Elements:
    """Return a straight line: one segment."""
    slope = (end.y - start.y) / (end.x - start.x)
    return Elements([], [Segment(start.x, end.x, (start.y, slope, 0.0, 0.0, 0.0, 0.0, 0.0))])


def sine(start: float, end: float, *, offset: float, amplitude: float, rate: float, phase: float) -> Elements:
    """Return `offset + amplitude sin(rate s + phase)`: one segment; rate and phase in rad."""
    return Elements([], [Segment(start, end, (offset, 0, 0, 0, 0, 0, 0), amplitude, rate, phase)])


def polynomial(start: float, end: float, coefficients: Sequence[float]) -> Elements:
    """Return a polynomial of `x - start`, of up to the seventh order: one segment, from the seventh on two
    (CAM-029).

    Raises:
        ValueError: It has more than eight coefficients.

    """
    given = [float(one) for one in coefficients]
    if len(given) > 8:
        raise ValueError(f"a polynomial of order {len(given) - 1}; allowed: up to 7")
    if len(given) < 8 or given[7] == 0.0:
        a = [*given, *[0.0] * 7]
        return Elements([], [Segment(start, end, (a[0], a[1], a[2], a[3], a[4], a[5], a[6]))])
    span = end - start
    part = Part(0.0, 1.0, tuple(value * span**power for power, value in enumerate(given)))
    return law_elements(Law("polynomial", [part]), Point(start, 0.0), Point(end, 1.0))


def inverse_sine(
    start: Point, end: Point, *, first: float = -1.0, last: float = 1.0, approximation: int = APPROXIMATION,
    after_transition: bool = False,
) -> Elements:  # fmt: skip
    """Return a part of the inverse sine between two points, as points (CAM-030).

    Args:
        start: Where it begins.
        end: Where it ends.
        first: Argument of the inverse sine at the start, -1 to 1.
        last: At the end.
        approximation: Number of points.
        after_transition: The first point is that of a transition before: one less.

    """
    low, high = asin(first), asin(last)
    found = []
    for number in range(1 if after_transition else 0, approximation):
        share = number / (approximation - 1)
        value = (asin(min(max(first + share * (last - first), -1.0), 1.0)) - low) / (high - low)
        found.append(Point(start.x + share * (end.x - start.x), start.y + value * (end.y - start.y)))
    return Elements(found, [])


def point_group(
    points: Sequence[Point], *, segments: bool = False, approximation: int = APPROXIMATION
) -> Elements:
    """Return a group of points at equal distances of the leading value, or the segments between them
    (CAM-027).

    Args:
        points: What the group is to follow: at least two.
        segments: Give the segments between the points in place of the points.
        approximation: Number of points.

    """
    curve = interpolate(points, [], Interpolation.CUBIC)
    step = curve.period / (approximation - 1)
    places = [curve.start + number * step for number in range(approximation - 1)] + [curve.end]
    sampled = [Point(x, curve.evaluate(x)[0]) for x in places]
    if not segments:
        return Elements(sampled, [])
    group = interpolate(sampled, [], Interpolation.CUBIC)
    found = []
    for piece in group.pieces:
        y, slope, bend = piece.evaluate(piece.start)
        a = (y, slope, 0.5 * bend, piece.third(piece.start) / 6.0, 0.0, 0.0, 0.0)
        found.append(Segment(piece.start, piece.end, a))
    return Elements([], found)
