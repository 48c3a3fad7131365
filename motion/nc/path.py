"""Geometry of an interpolated path: lines, arcs, smooth joints; velocities of transitions (section 9.2)."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import acos, atan2, cos, hypot, inf, pi, sin, sqrt
from typing import Final, Protocol

Vector = tuple[float, ...]

_SAME: Final = 1e-9
_SAMPLES: Final = 64


def _add(a: Vector, b: Vector, factor: float = 1.0) -> Vector:
    return tuple(x + factor * y for x, y in zip(a, b, strict=True))


def _length(a: Vector) -> float:
    return sqrt(sum(x * x for x in a))


class Element(Protocol):
    """A piece of a path by its arc length."""

    length: float

    def at(self, s: float) -> tuple[Vector, Vector, Vector]:
        """Return position, tangent (length 1) and curvature at the arc length s."""


class Line:
    """A straight line.

    Args:
        start: Where it begins.
        end: Where it ends.

    """

    def __init__(self, start: Vector, end: Vector) -> None:
        way = _add(end, start, -1.0)
        self.start, self.end = start, end
        self.length = _length(way)
        self._tangent = tuple(x / self.length if self.length else 0.0 for x in way)
        self._none = tuple(0.0 for _ in start)

    def at(self, s: float) -> tuple[Vector, Vector, Vector]:
        """Return position, tangent and curvature at the arc length s."""
        return _add(self.start, self._tangent, s), self._tangent, self._none


class Arc:
    """An arc of a circle in the first two coordinates; the others stay.

    Args:
        start: Where it begins.
        end: Where it ends; the start: a whole circle.
        center: Centre, two coordinates.
        clockwise: G2; FALSE: G3.

    """

    def __init__(self, start: Vector, end: Vector, center: Vector, *, clockwise: bool) -> None:
        self._start, self._center = start, center
        dx, dy = start[0] - center[0], start[1] - center[1]
        self.radius = hypot(dx, dy)
        self._angle = atan2(dy, dx)
        turn = atan2(end[1] - center[1], end[0] - center[0]) - self._angle
        self._sign = -1.0 if clockwise else 1.0
        turn = self._sign * turn % (2.0 * pi)
        self.length = self.radius * (turn if turn > _SAME else 2.0 * pi)

    def at(self, s: float) -> tuple[Vector, Vector, Vector]:
        """Return position, tangent and curvature at the arc length s."""
        angle = self._angle + self._sign * s / self.radius
        x, y = cos(angle), sin(angle)
        rest, none = self._start[2:], tuple(0.0 for _ in self._start[2:])
        position = (self._center[0] + self.radius * x, self._center[1] + self.radius * y, *rest)
        tangent = (-self._sign * y, self._sign * x, *none)
        return position, tangent, (-x / self.radius, -y / self.radius, *none)


class Joint:
    """A smooth way through the tolerance ball of a knot: a Bezier curve of the fifth degree whose first and
    last three points lie on the tangents, so that position, direction and curvature fit (NC-188).

    Args:
        start: Entry, at the distance of the radius in front of the knot.
        first: Tangent there.
        end: Exit.
        last: Tangent there.

    """

    def __init__(self, start: Vector, first: Vector, end: Vector, last: Vector) -> None:
        third = _length(_add(end, start, -1.0)) / 4.0
        self._points = (
            start,
            _add(start, first, third),
            _add(start, first, 2.0 * third),
            _add(end, last, -2.0 * third),
            _add(end, last, -third),
            end,
        )
        self._places = [0.0]
        before = start
        for step in range(1, _SAMPLES + 1):
            here = self._point(step / _SAMPLES)
            self._places.append(self._places[-1] + _length(_add(here, before, -1.0)))
            before = here
        self.length = self._places[-1]

    def _level(self, points: Sequence[Vector], u: float) -> Vector:
        rest = list(points)
        while len(rest) > 1:
            rest = [_add(tuple((1.0 - u) * x for x in a), b, u) for a, b in pairwise(rest)]
        return rest[0]

    def _point(self, u: float) -> Vector:
        return self._level(self._points, u)

    def at(self, s: float) -> tuple[Vector, Vector, Vector]:
        """Return position, tangent and curvature at the arc length s."""
        number = min(max(bisect_right(self._places, s) - 1, 0), _SAMPLES - 1)
        low, high = self._places[number], self._places[number + 1]
        u = (number + (min(max((s - low) / (high - low), 0.0), 1.0) if high > low else 0.0)) / _SAMPLES
        points = self._points
        first = [tuple(5.0 * x for x in _add(b, a, -1.0)) for a, b in pairwise(points)]
        second = [tuple(4.0 * x for x in _add(b, a, -1.0)) for a, b in pairwise(first)]
        d, dd = self._level(first, u), self._level(second, u)
        speed = _length(d) or 1.0
        tangent = tuple(x / speed for x in d)
        along = sum(x * y for x, y in zip(dd, tangent, strict=True))
        return self._point(u), tangent, tuple(x / speed / speed for x in _add(dd, tangent, -along))

    @property
    def most_curved(self) -> float:
        """Largest curvature, 1 / position unit."""
        return max(_length(self.at(self.length * n / _SAMPLES)[2]) for n in range(_SAMPLES + 1))


class AuxiliaryTrack:
    """What an auxiliary axis does along a path: straight between knots, smooth within its tolerance ball
    around them (NC-176).

    Within a ball the slope changes like 3 u^2 - 2 u^3, so that velocity and acceleration are continuous.

    Args:
        knots: Arc length of the path and position of the axis, the first rising.
        radius: Radius of the balls, position unit; 0.0: the slope changes in a step.

    """

    def __init__(self, knots: Sequence[tuple[float, float]], radius: float) -> None:
        self._knots = knots
        self._places = [place for place, _ in knots]
        self._slopes = [(b - a) / (t - s) for (s, a), (t, b) in pairwise(knots)]
        self._widths = [0.0] * len(knots)
        for number in range(1, len(knots) - 1):
            before, after = self._slopes[number - 1 : number + 1]
            if abs(after - before) <= _SAME:
                continue
            # Balls of short segments are made smaller, so that they do not overlap (NC-190).
            shorter = min(b - a for a, b in pairwise(self._places[number - 1 : number + 2]))
            self._widths[number] = min(radius / max(abs(before), abs(after)), shorter / 2.0)

    def step_at(self, s: float) -> float:
        """Return by how much the slope changes in a step at a place of the path; 0.0: it does not."""
        number = bisect_right(self._places, s + _SAME) - 1
        if (
            not 0 < number < len(self._slopes)
            or abs(self._places[number] - s) > _SAME
            or self._widths[number]
        ):
            return 0.0
        return self._slopes[number] - self._slopes[number - 1]

    def at(self, s: float) -> tuple[float, float, float]:
        """Return position, slope and change of the slope at the arc length s."""
        number = min(max(bisect_right(self._places, s) - 1, 0), len(self._slopes) - 1)
        for knot in (number, number + 1):
            width, place = self._widths[knot], self._places[knot]
            if width and abs(s - place) < width:
                return self._in_ball(knot, s - place)
        place, position = self._knots[number]
        slope = self._slopes[number]
        return position + slope * (s - place), slope, 0.0

    def _in_ball(self, knot: int, way: float) -> tuple[float, float, float]:
        """Return the same within a ball, `way` behind its knot."""
        width = self._widths[knot]
        slope = self._slopes[knot - 1]
        change = self._slopes[knot] - slope
        u = (way + width) / (2.0 * width)
        position = self._knots[knot][1] + slope * way + change * 2.0 * width * (u**3 - 0.5 * u**4)
        return (
            position,
            slope + change * (3.0 * u * u - 2.0 * u**3),
            change * 6.0 * u * (1.0 - u) / (2.0 * width),
        )


def transition_class(before: Element, after: Element) -> int:
    """Return k of a transition of class Ck: 0 a corner, 1 the acceleration jumps, 2 the jerk alone, 3 none of
    these (NC-181 to NC-184).
    """
    _, first, curve_in = before.at(before.length)
    _, last, curve_out = after.at(0.0)
    if _length(_add(first, last, -1.0)) > _SAME:
        return 0
    if _length(_add(curve_in, curve_out, -1.0)) > _SAME:
        return 1
    return 3 if isinstance(before, Line) and isinstance(after, Line) else 2


@dataclass(frozen=True)
class AxisLimits:
    """What an axis of a group may do.

    Args:
        rapid: Rapid Traverse Velocity (G0), position unit/s.
        reference: Reference Velocity, position unit/s.
        maximum: Maximum Velocity, position unit/s.
        acceleration: A+, position unit/s2.
        deceleration: Magnitude of A-, position unit/s2.
        jump_factor: Velo Jump Factor (C0).
        tolerance_ball: Radius of its tolerance ball as an auxiliary axis, position unit; 0.0: none.

    """

    rapid: float
    reference: float
    maximum: float
    acceleration: float
    deceleration: float
    jump_factor: float = 0.0
    tolerance_ball: float = 0.0

    @property
    def g0(self) -> float:
        """Velocity of G0, position unit/s (NC-174, NC-178)."""
        return min(self.rapid, self.reference, self.maximum)

    def velocity_jump(self, cycle_s: float) -> float:
        """Return the permitted step of the set velocity at a corner, position unit/s (NC-186)."""
        return self.jump_factor * min(self.acceleration, self.deceleration) * cycle_s


def rapid_velocity(way: Vector, limits: Sequence[AxisLimits]) -> float:
    """Return the path velocity of G0: the axis that needs most time determines it (NC-179)."""
    length = _length(way)
    if not length:
        return min(one.g0 for one in limits)
    return min((one.g0 * length / abs(x) for x, one in zip(way, limits, strict=True) if x), default=inf)


def link_velocity(
    before: Element,
    after: Element,
    v_in: float,
    v_out: float,
    limits: Sequence[AxisLimits],
    *,
    cycle_s: float,
    least: float = 0.0,
) -> float:
    """Return the velocity at a corner by the reduction VELOJUMP (NC-185, NC-186).

    Args:
        before: Element that ends there.
        after: Element that begins there.
        v_in: Path velocity of the first, position unit/s.
        v_out: Path velocity of the second.
        limits: Limits of the axes.
        cycle_s: Cycle, s.
        least: Velocity that is not gone below, position unit/s.

    """
    velocity = min(v_in, v_out)
    _, first, _ = before.at(before.length)
    _, last, _ = after.at(0.0)
    for change, one in zip(_add(last, first, -1.0), limits, strict=True):
        if abs(change) > _SAME:
            velocity = min(velocity, one.velocity_jump(cycle_s) / abs(change))
    return max(velocity, min(least, v_in, v_out))


def corner_angle(before: Element, after: Element) -> float:
    """Return by how much the direction changes at a joint, rad."""
    _, first, _ = before.at(before.length)
    _, last, _ = after.at(0.0)
    cosine = sum(x * y for x, y in zip(first, last, strict=True))
    return acos(min(max(cosine, -1.0), 1.0))
