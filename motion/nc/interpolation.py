"""An interpolation group: axes that follow a path of G0, G1, G2, G3 together (NCI; section 9.2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from math import sqrt
from typing import TYPE_CHECKING, Final, Protocol

from fieldbus.errors import ConfigurationError, UnknownNameError
from motion.nc.errors import BLOCK_PARAMETER, CONSEQUENTIAL
from motion.nc.path import (
    Arc,
    AuxiliaryTrack,
    AxisLimits,
    Element,
    Joint,
    Line,
    Vector,
    corner_angle,
    link_velocity,
    rapid_velocity,
)
from motion.setpoint import SetpointGenerator, plan_velocity

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

REDUCED: Final = "Reduced (iterated)"
ORIGINAL: Final = "Original (iterated)"
REDUCED_BEYOND: Final = "Reduced [0 ... >100%]"
OVERRIDE_TYPES: Final = (REDUCED, ORIGINAL, REDUCED_BEYOND)
"""Types of the path override; the first is the default (NC-171)."""
_STRAIGHT: Final = 1e-6
"""Angle, rad, up to which a joint is no corner."""
_ROUNDS: Final = 40
_STANDS: Final = 1e-9
_NEAR: Final = 1e-6
"""Way, position unit, up to which an axis stands where the path begins."""


class AxisGroup(Protocol):
    """A group as its axes see it."""

    @property
    def stopping(self) -> bool:
        """Whether it brakes on its path already."""

    def stop(self) -> None:
        """Brake on the path."""

    def fail(self, name: str) -> None:
        """Take note that an axis of it has an error."""


class GroupAxis(Protocol):
    """An axis as its group sees it."""

    name: str

    @property
    def place(self) -> float:
        """Set position, position unit."""

    @property
    def path_limits(self) -> AxisLimits:
        """What it may do."""

    def enter_group(self, group: AxisGroup) -> int:
        """Follow a path from now on; returns an error code, 0 for none."""

    def leave_group(self, *, stopped: bool) -> None:
        """Be a PTP axis again; `stopped`: the group stands at the end of its path, or of a stop."""

    def follow_path(self, s: float, v: float, a: float) -> None:
        """Take over the set values of this cycle."""

    def raise_error(self, error_id: int) -> None:
        """Put it into error."""


@dataclass
class _Piece:
    """An element of the path with its velocities, position unit/s."""

    element: Element
    feed: float
    auxiliary: tuple[Vector, ...]
    """Positions of the auxiliary axes at its beginning and its end; of a joint at the knot as well."""
    stops: bool = False
    """It ends with an exact stop (G60)."""
    joint: bool = False
    """It is the way through a tolerance ball."""
    link: float = 0.0
    """Velocity at its end, at 100 %."""
    peak: float = 0.0
    """Velocity that it reaches, at 100 %."""


class InterpolationGroup:
    """Axes on one path. Moves are added, then `start` lets the group go; `step` runs one cycle of it, in
    front of the axes.

    Args:
        axes: The axes; coordinates stand in this order.
        cycle_s: Cycle of the SAF task, s.
        acceleration: Path acceleration, position unit/s2.
        deceleration: Path deceleration, position unit/s2.
        jerk: Path jerk, position unit/s3.
        auxiliary: Axes that move along with the path and are no part of its geometry: they arrive with the
            others, and the feed is not theirs.
        least_velocity: Velocity at corners that is not gone below, position unit/s.
        c2: System parameter C2: share of the transition velocity in a tolerance ball; it may change while the
            group moves.

    Raises:
        ConfigurationError: There is no axis, or a dynamic value is not above 0.

    """

    def __init__(
        self,
        axes: Sequence[GroupAxis],
        *,
        cycle_s: float,
        acceleration: float,
        deceleration: float,
        jerk: float,
        auxiliary: Sequence[GroupAxis] = (),
        least_velocity: float = 0.0,
        c2: float = 1.0,
    ) -> None:
        if not axes:
            raise ConfigurationError("interpolation group", "no axis", "one axis or more")
        for name, value in (("acceleration", acceleration), ("deceleration", deceleration), ("jerk", jerk)):
            if not value > 0.0:
                raise ConfigurationError(f"interpolation group, {name}", value, "above 0")
        self.axes = list(axes)
        self.auxiliary = list(auxiliary)
        self._tracks: list[AuxiliaryTrack] = []
        self._cycle_s = cycle_s
        self._acceleration, self._deceleration, self._jerk = acceleration, deceleration, jerk
        self._least = least_velocity
        self.c2 = c2
        self.override = 1.0
        """Path override; above 1.0 with `Reduced [0 ... >100%]` alone."""
        self.override_type = REDUCED
        self._exact_stop = False
        self._ball = 0.0
        self._rapid = False
        self._pieces: list[_Piece] = []
        self._number = 0
        self._base = 0.0
        self._path = SetpointGenerator()
        self._planned: tuple[float, float] | None = None
        self._stopping = False
        self.running = False
        """The group moves, or waits for its override."""

    # -- the program

    @property
    def place(self) -> tuple[float, ...]:
        """Where the path so far ends."""
        if not self._pieces:
            return tuple(axis.place for axis in self.axes)
        last = self._pieces[-1].element
        return last.at(last.length)[0]

    @property
    def auxiliary_place(self) -> Vector:
        """Where the auxiliary axes are at the end of the path so far."""
        if not self._pieces:
            return tuple(axis.place for axis in self.auxiliary)
        return self._pieces[-1].auxiliary[-1]

    def exact_stop(self) -> None:
        """Stop at the end of every move from the next one on (G60); G0 ends it (NC-180)."""
        self._exact_stop = True

    def tolerance_ball(self, radius: float) -> None:
        """Smooth the joints from the next one on within balls of a radius, position unit; modal, 0.0 for none
        (NC-189).

        Raises:
            ConfigurationError: It is negative.

        """
        if not radius >= 0.0:
            raise ConfigurationError("tolerance ball", radius, "0 or more")
        self._ball = radius

    def g0(self, **targets: float) -> None:
        """Move on a straight line as fast as the axes can (NC-178)."""
        self._exact_stop = False
        start = self.place
        target, auxiliary = self._targets(targets)
        line = Line(start, target)
        way = tuple(b - a for a, b in zip(start, line.end, strict=True))
        self._rapid = True
        feed = rapid_velocity(way, [axis.path_limits for axis in self.axes])
        for axis, before, after in zip(self.auxiliary, self.auxiliary_place, auxiliary, strict=True):
            if before != after:
                feed = min(feed, axis.path_limits.g0 * line.length / abs(after - before))
        self._add(line, feed, auxiliary)

    def g1(self, feed: float, **targets: float) -> None:
        """Move on a straight line with a feed, position unit/s."""
        start = self.place
        self._rapid = False
        target, auxiliary = self._targets(targets)
        self._add(Line(start, target), feed, auxiliary)

    def arc(self, feed: float, center: tuple[float, float], *, clockwise: bool, **targets: float) -> None:
        """Move on an arc in the first two axes (G2, G3) with a feed, position unit/s."""
        start = self.place
        self._rapid = False
        target, auxiliary = self._targets(targets)
        self._add(Arc(start, target, center, clockwise=clockwise), feed, auxiliary)

    @property
    def rapid(self) -> bool:
        """G0 is active: moves without another command are rapid ones."""
        return self._rapid

    def _targets(self, targets: Mapping[str, float]) -> tuple[Vector, Vector]:
        """Return where a move ends: the axes of the path, and the auxiliary ones."""
        known = [axis.name for axis in self._all]
        for name in targets:
            if name not in known:
                raise UnknownNameError("interpolation group", name, "an axis of it", known)
        ends = tuple(
            targets.get(name, place)
            for name, place in zip(known, (*self.place, *self.auxiliary_place), strict=True)
        )
        return ends[: len(self.axes)], ends[len(self.axes) :]

    @property
    def _all(self) -> list[GroupAxis]:
        return [*self.axes, *self.auxiliary]

    def _add(self, element: Element, feed: float, auxiliary: Vector) -> None:
        if not feed > 0.0:
            raise ConfigurationError("interpolation group, feed", feed, "above 0")
        begins = self.auxiliary_place
        if element.length <= _STANDS:
            if auxiliary != begins:
                raise ConfigurationError(
                    "interpolation group", "a move of auxiliary axes alone", "a move of the path as well"
                )
            return
        before = self._pieces[-1] if self._pieces else None
        if (
            before is not None
            and self._ball > 0.0
            and not before.stops
            and isinstance(before.element, Line)
            and isinstance(element, Line)
            and corner_angle(before.element, element) > _STRAIGHT
        ):
            length = element.length
            element = self._join(before, element, feed, auxiliary)
            left = element.length / length
            begins = tuple(b + (a - b) * left for a, b in zip(begins, auxiliary, strict=True))
        self._pieces.append(_Piece(element, feed, (begins, auxiliary), stops=self._exact_stop))

    def _join(self, before: _Piece, line: Line, feed: float, auxiliary: Vector) -> Line:
        """Put a joint through the tolerance ball in front of a line; returns what is left of the line."""
        first = before.element
        assert isinstance(first, Line)  # see _add
        # Balls of short segments are made smaller, so that they do not overlap (NC-190).
        radius = min(self._ball, first.length / 2.0, line.length / 2.0)
        place, tangent, _ = first.at(first.length - radius)
        end, last, _ = line.at(radius)
        start, knot = before.auxiliary
        share = radius / first.length
        entry = tuple(b + (a - b) * share for a, b in zip(start, knot, strict=True))
        share = radius / line.length
        leave = tuple(a + (b - a) * share for a, b in zip(knot, auxiliary, strict=True))
        before.element, before.auxiliary = Line(first.start, place), (start, entry)
        joint = Joint(place, tangent, end, last)
        velocity = min(before.feed, feed)
        if joint.most_curved > 0.0:
            velocity = min(velocity, sqrt(self._acceleration / joint.most_curved))
        self._pieces.append(_Piece(joint, velocity, (entry, knot, leave), joint=True))
        return Line(end, line.end)

    # -- planning

    def _way(self, v0: float, v1: float) -> float:
        """Return the way of a change of velocity that begins and ends without acceleration."""
        return plan_velocity(
            v0,
            0.0,
            v1,
            acceleration=self._acceleration,
            deceleration=self._deceleration,
            jerk=self._jerk,
        ).distance

    def _fits(self, end: float, length: float, velocity: float) -> bool:
        return self._way(velocity, end) <= length

    def _fits_after(self, entry: float, length: float, velocity: float) -> bool:
        return self._way(entry, velocity) <= length

    def _fits_between(self, entry: float, end: float, length: float, velocity: float) -> bool:
        return self._way(entry, velocity) + self._way(velocity, end) <= length

    @staticmethod
    def _highest(least: float, most: float, fits: Callable[[float], bool]) -> float:
        """Return the highest velocity from `least` to `most` that fits, by halving."""
        if fits(most):
            return most
        low, high = least, most
        for _ in range(_ROUNDS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if fits(middle) else (low, middle)
        return low

    def _plan(self) -> None:
        """Find the velocities at the joints and between them, at 100 % (NC-172, NC-185)."""
        pieces = self._pieces
        limits = [axis.path_limits for axis in self.axes]
        for before, after in pairwise(pieces):
            if before.stops:
                before.link = 0.0
            elif before.joint or after.joint:
                before.link = min(before.feed, after.feed)
            else:
                before.link = link_velocity(
                    before.element,
                    after.element,
                    before.feed,
                    after.feed,
                    limits,
                    cycle_s=self._cycle_s,
                    least=self._least,
                )
        self._plan_auxiliary()
        pieces[-1].link = 0.0
        for number in range(len(pieces) - 1, 0, -1):
            piece = pieces[number]
            entry = pieces[number - 1].link
            if piece.joint:
                pieces[number - 1].link = piece.link = min(entry, piece.link)
                continue
            if entry > piece.link:
                end, length = piece.link, piece.element.length
                pieces[number - 1].link = self._highest(end, entry, partial(self._fits, end, length))
        entry = 0.0
        for number, piece in enumerate(pieces):
            length = piece.element.length
            if piece.joint:
                piece.link = piece.peak = entry
                continue
            if piece.link > entry:
                piece.link = self._highest(
                    entry,
                    piece.link,
                    partial(self._fits_after, entry, length),
                )
            end = piece.link
            piece.peak = self._highest(
                max(entry, end),
                piece.feed,
                partial(self._fits_between, entry, end, length),
            )
            entry = end
            if number + 1 < len(pieces) and pieces[number + 1].joint:
                pieces[number + 1].feed = end

    def _plan_auxiliary(self) -> None:
        """Lay the tracks of the auxiliary axes, and lower the velocity where one of them has a corner."""
        self._tracks = []
        for number, axis in enumerate(self.auxiliary):
            limits = axis.path_limits
            base, knots = 0.0, [(0.0, self._pieces[0].auxiliary[0][number])]
            for piece in self._pieces:
                parts = len(piece.auxiliary) - 1
                for part in range(1, parts + 1):
                    place = base + piece.element.length * part / parts
                    knots.append((place, piece.auxiliary[part][number]))
                base += piece.element.length
            track = AuxiliaryTrack(knots, limits.tolerance_ball)
            self._tracks.append(track)
            base = 0.0
            for piece in self._pieces:
                step = track.step_at(base + 0.5 * piece.element.length) if piece.joint else 0.0
                base += piece.element.length
                step = max(abs(step), abs(track.step_at(base)))
                if step:
                    piece.link = min(piece.link, limits.velocity_jump(self._cycle_s) / step)

    def _velocity(self, piece: _Piece) -> float:
        """Return what the override leaves of the velocity of a piece (NC-170 to NC-172)."""
        if self.override_type == ORIGINAL:
            return min(piece.feed * min(self.override, 1.0), piece.peak)
        if self.override_type == REDUCED_BEYOND:
            highest = rapid_velocity(piece.element.at(0.0)[1], [axis.path_limits for axis in self.axes])
            return min(piece.peak * self.override, highest)
        return piece.peak * min(self.override, 1.0)

    def _link(self, number: int) -> float:
        """Return the velocity at the end of a piece with the present override and C2 (NC-193)."""
        pieces = self._pieces
        piece = pieces[number]
        link = piece.link
        if number + 1 < len(pieces):
            link = min(link, self._velocity(pieces[number + 1])) if not pieces[number + 1].joint else link
            if pieces[number + 1].joint or piece.joint:
                link *= self.c2
        return min(link, self._velocity(piece)) if not piece.joint else link

    # -- a cycle

    def start(self) -> int:
        """Let the axes follow the path; returns an error code, 0 for none.

        Raises:
            ConfigurationError: There is no move.

        """
        if not self._pieces:
            raise ConfigurationError("interpolation group", "no move", "moves, added before the start")
        places = self._pieces[0].element.at(0.0)[0]
        places = (*places, *self._pieces[0].auxiliary[0])
        if any(abs(axis.place - place) > _NEAR for axis, place in zip(self._all, places, strict=True)):
            return BLOCK_PARAMETER
        self._plan()
        taken: list[GroupAxis] = []
        for axis in self._all:
            refused = axis.enter_group(self)
            if refused:
                for one in taken:
                    one.leave_group(stopped=False)
                return refused
            taken.append(axis)
        self._number, self._base = 0, 0.0
        self._path.set_state(0.0, 0.0)
        self._planned, self._stopping = None, False
        self.running = True
        return 0

    def stop(self) -> None:
        """Brake on the path (NC-038); the moves that are left are dropped when the group stands."""
        if self.running and not self._stopping:
            self._stopping = True
            self._path.start_stop(self._deceleration, self._jerk)

    @property
    def stopping(self) -> bool:
        """Whether it brakes on the path for a stop."""
        return self._stopping

    def abort(self, *, stopped: bool = False) -> None:
        """Let go of the axes at once.

        Args:
            stopped: The group stands at the end of its path, or of a stop.

        """
        if self.running:
            self.running = False
            self._pieces.clear()
            for axis in self._all:
                axis.leave_group(stopped=stopped)

    def fail(self, name: str) -> None:
        """Stop all axes, because one has an error (NC-739)."""
        if not self.running:
            return
        self.abort()
        for axis in self._all:
            if axis.name != name:
                axis.raise_error(CONSEQUENTIAL)

    def step(self) -> None:
        """Form the set values of a cycle and give them to the axes."""
        if not self.running:
            return
        path = self._path
        if not self._stopping:
            self._lead()
        path.advance(self._cycle_s)
        self._go_on()
        piece = self._pieces[self._number]
        along = min(path.s - self._base, piece.element.length)
        position, tangent, curvature = piece.element.at(along)
        v, a = path.v, path.a
        for axis, s, t, k in zip(self.axes, position, tangent, curvature, strict=True):
            axis.follow_path(s, t * v, t * a + k * v * v)
        for axis, track in zip(self.auxiliary, self._tracks, strict=True):
            s, t, k = track.at(self._base + along)
            axis.follow_path(s, t * v, t * a + k * v * v)
        done = self._number == len(self._pieces) - 1 and piece.element.length - along <= _STANDS
        if (self._stopping or done) and path.done and abs(path.v) <= _STANDS:
            self.abort(stopped=True)

    def _lead(self) -> None:
        """Choose the velocity of this cycle: that of the piece, or that of its end where the way is due."""
        path, number = self._path, self._number
        piece = self._pieces[number]
        if piece.joint:
            return  # velocity and acceleration stay as they are within the ball (NC-191, NC-192)
        velocity, link = self._velocity(piece), self._link(number)
        left = self._base + piece.element.length - path.s
        if velocity <= 0.0:
            wanted = (0.0, 0.0)
            if self._planned != wanted:
                self._planned = wanted
                path.start_stop(self._deceleration, self._jerk)
            return
        if link <= 0.0:
            wanted = (1.0, velocity)
            if self._planned != wanted:
                self._planned = wanted
                path.start_position(
                    self._base + piece.element.length,
                    velocity,
                    self._acceleration,
                    self._deceleration,
                    self._jerk,
                )
            return
        braking = plan_velocity(
            path.v,
            path.a,
            link,
            acceleration=self._acceleration,
            deceleration=self._deceleration,
            jerk=self._jerk,
        ).distance
        due = left <= braking + max(path.v, velocity) * self._cycle_s
        wanted = (2.0, link if due else velocity)
        if self._planned != wanted:
            self._planned = wanted
            path.start_velocity(wanted[1], self._acceleration, self._deceleration, self._jerk)

    def _go_on(self) -> None:
        """Go to the next piece when the present one is behind."""
        while self._number < len(self._pieces) - 1:
            length = self._pieces[self._number].element.length
            stands = self._pieces[self._number].stops and self._path.done and abs(self._path.v) <= _STANDS
            reached = self._path.s - self._base
            if reached < length - (_STANDS if stands else 0.0) and not (stands and length - reached < 1e-6):
                return
            self._base += length
            self._number += 1
            self._planned = None
