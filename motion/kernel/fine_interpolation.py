"""Setpoints of the interpolator for a servo cycle that is shorter (`T_ipo = n * T_servo`).

`MC_Interpolator` calculates where the setpoint is to be one interpolator cycle later; `MC_Servo` goes
there in n steps: on the profile, so that its limits hold in every servo cycle, or on the cubic between
both states where there is no profile. `<TO>.Position` shows the end of the interval, the position
controller gets the points on the way, so that the setpoint which is controlled lies up to `T_ipo -
T_servo` behind (CFG-166 to CFG-170).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motion.setpoint import Setpoint


class FineInterpolation:
    """The points of one axis between two calls of `MC_Interpolator`.

    Args:
        ratio: Servo cycles in an interpolator cycle, 2 or more.
        servo_s: Servo cycle, s.

    """

    def __init__(self, ratio: int, servo_s: float) -> None:
        self._ratio = ratio
        self._servo = servo_s
        self._duration = ratio * servo_s
        self._step = ratio
        self._controlled = False
        self._from = self._to = (0.0, 0.0)
        self._points: list[tuple[float, float]] = []
        """Position and velocity at the ends of the servo cycles, as the profile
        has them; empty = on the cubic.
        """
        self.s = 0.0
        """Position setpoint of the present servo cycle, axis unit."""
        self.v = 0.0
        """Velocity setpoint of the present servo cycle, axis unit per second."""
        self.a = 0.0
        """Acceleration setpoint of the interpolator, axis unit per second squared."""

    def begin(self, start: tuple[float, float], end: Setpoint, *, controlled: bool) -> FineInterpolation:
        """Begin an interval; returns its first point.

        Args:
            start: Position and velocity where it begins.
            end: The state that the interpolator has calculated.
            controlled: Whether the position is controlled; otherwise only the velocity counts, and both
                go in a straight line.

        """
        self._controlled = controlled
        self._from = start
        self._to = (end.s, end.v)
        self.a = end.a
        self._step = 0
        self._points = self._profile(end) if controlled else []
        return self.advance()

    def _profile(self, end: Setpoint) -> list[tuple[float, float]]:
        points = []
        for rest in range(self._ratio - 1, 0, -1):
            point = end.before(rest * self._servo)
            if point is None:
                return []
            points.append(point)
        return points

    def advance(self) -> FineInterpolation:
        """Go on by one servo cycle; at the end of the interval, because the
        interpolator is late, stay there.
        """
        ratio = self._ratio
        if self._step < ratio:
            self._step += 1
        (start, v_start), (end, v_end) = self._from, self._to
        if self._step == ratio:
            self.s, self.v = end, v_end
            return self
        if self._points:
            self.s, self.v = self._points[self._step - 1]
            return self
        share = self._step / ratio
        if not self._controlled:
            self.s, self.v = start + (end - start) * share, v_start + (v_end - v_start) * share
            return self
        duration = self._duration
        way = end - start
        # Hermite: exact where the jerk is constant over the interval.
        linear = v_start * duration
        square = 3.0 * way - (2.0 * v_start + v_end) * duration
        cube = (v_start + v_end) * duration - 2.0 * way
        self.s = start + ((cube * share + square) * share + linear) * share
        self.v = ((3.0 * cube * share + 2.0 * square) * share + linear) / duration
        return self

    def restart(self, position: float, velocity: float) -> float:
        """Go from `position` with `velocity` for the rest of the interval;
        returns how far that is, axis unit.
        """
        done = self._step * self._servo
        rest = self._duration - done if self._step < self._ratio else 0.0
        self._points = []
        self._from = (position - velocity * done, velocity)
        self._to = (position + velocity * rest, velocity)
        self._controlled = (
            True  # from now on the position counts, also where it did not when the interval began
        )
        return velocity * rest

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system."""
        self._from = (self._from[0] + offset, self._from[1])
        self._to = (self._to[0] + offset, self._to[1])
        self._points = [(s + offset, v) for s, v in self._points]
        self.s += offset
