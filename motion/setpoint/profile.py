"""A motion of one axis as a row of phases of constant jerk, and the sampling of it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import inf
from typing import NamedTuple

RawPhase = tuple[float, float, float, float]
"""Duration in s, and velocity, acceleration and jerk at its start (position unit, s)."""

Piece = tuple[float, float, float, float, float, float, float, float]
"""Start time, then position, velocity, acceleration, acceleration / 2, jerk, jerk
/ 2 and jerk / 6 at that time.
"""


class Phase(NamedTuple):
    """One phase of constant jerk, with the state at its start; times in s,
    the rest in position units and s.
    """

    start: float
    """Time from the start of the profile."""
    duration: float
    position: float
    """Way from the start of the profile."""
    velocity: float
    acceleration: float
    jerk: float


def travel(phases: Iterable[RawPhase]) -> float:
    """Return the way (position unit, signed) that the axis covers in `phases`."""
    way = 0.0
    for duration, velocity, acceleration, jerk in phases:
        way += duration * (velocity + duration * (0.5 * acceleration + duration * jerk / 6.0))
    return way


class Profile:
    """A planned motion, relative to the position at its start.

    At and after `duration` the state is exact: the planned end velocity, no acceleration, and for a
    point-to-point motion exactly the planned way. The axis moves on with the end velocity.

    Args:
        phases: Duration and start state of each phase.
        end_velocity: Velocity after the last phase, position unit/s.
        distance: Way to the end; None takes the way that follows from the phases.

    """

    __slots__ = (
        "_index",
        "_piece",
        "_until",
        "distance",
        "duration",
        "end_velocity",
        "ends",
        "phases",
        "pieces",
    )

    def __init__(
        self, phases: Sequence[RawPhase], *, end_velocity: float, distance: float | None = None
    ) -> None:
        time = way = 0.0
        entries: list[Phase] = []
        pieces: list[Piece] = []
        ends: list[float] = []
        for duration, velocity, acceleration, jerk in phases:
            half, sixth = 0.5 * acceleration, jerk / 6.0
            entries.append(Phase(time, duration, way, velocity, acceleration, jerk))
            pieces.append((time, way, velocity, acceleration, half, jerk, 0.5 * jerk, sixth))
            way += duration * (velocity + duration * (half + duration * sixth))
            time += duration
            ends.append(time)
        if distance is None:
            distance = way
        pieces.append((time, distance, end_velocity, 0.0, 0.0, 0.0, 0.0, 0.0))
        ends.append(inf)
        self.phases: tuple[Phase, ...] = tuple(entries)
        """The phases in order; a motion without any has reached its end at once."""
        self.pieces = pieces
        """Coefficients of the phases for sampling, with the state after the end as last entry."""
        self.ends = ends
        """End times of the pieces, s; the last one is infinite."""
        self.duration = time
        """Time to the end, s."""
        self.distance = distance
        """Way to the end, position unit."""
        self.end_velocity = end_velocity
        """Velocity from the end on, position unit/s."""
        self._index = 0
        self._piece = pieces[0]
        self._until = ends[0]

    def sample(self, t: float) -> tuple[float, float, float]:
        """Return way, velocity and acceleration at `t` s from the start; cheapest with rising times.

        Times before the start give the state at the start.
        """
        if t >= self._until or t < self._piece[0]:
            t = self._seek(t)
        start, way, velocity, acceleration, half, jerk, half_jerk, sixth = self._piece
        x = t - start
        return (
            way + x * (velocity + x * (half + x * sixth)),
            velocity + x * (acceleration + x * half_jerk),
            acceleration + x * jerk,
        )

    def _seek(self, t: float) -> float:
        """Make the piece of time `t` the present one; return `t`, not before the start."""
        index = self._index
        if t < self._piece[0]:
            index = 0
            t = max(t, 0.0)
        ends = self.ends
        while t >= ends[index]:
            index += 1
        self._index = index
        self._until = ends[index]
        self._piece = self.pieces[index]
        return t
