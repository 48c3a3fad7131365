"""Desynchronising: how a following axis leaves its leading value and comes to rest (SYN section 7.6)."""

from __future__ import annotations

from math import copysign
from typing import TYPE_CHECKING, Final

from motion.kernel.synchronous.ways import DistanceWay
from motion.setpoint import SetpointGenerator, stop_distance

if TYPE_CHECKING:
    from motion.kernel.modulo import Modulo
    from motion.kernel.synchronous.coupling import Coupling
    from motion.kernel.synchronous.leading import LeadingMotion

_PLACE: Final = 1e-6
"""Position units up to which the axis counts as being at its stop position."""
_ROUNDING: Final = 1e-9
_EITHER: Final = 3


class _StopPlace:
    """The stop position and the direction in which the axis may come to it.

    Args:
        position: Stop position, position unit of the axis.
        direction: 1 positive, 2 negative, 3 that of the present motion (SYN-202).
        modulo: Modulo range of the axis.

    """

    def __init__(self, position: float, direction: int, modulo: Modulo) -> None:
        self._position = position
        self._direction = direction
        self._modulo = modulo

    def permits(self, velocity: float) -> bool:
        """Return whether the axis moves as it has to."""
        if self._direction == _EITHER:
            return velocity != 0.0
        return velocity > 0.0 if self._direction == 1 else velocity < 0.0

    def forbids(self, way: float) -> bool:
        """Return whether a way of one cycle leads in the other direction (SYN-438)."""
        if self._direction == _EITHER:
            return False
        return way < -_PLACE if self._direction == 1 else way > _PLACE

    def at(self, s: float) -> bool:
        """Return whether the axis is there."""
        return abs(self._modulo.shortest(self._position - s)) <= _PLACE

    def passed(self, s: float, now: float, needed: float, needed_now: float) -> tuple[float, float] | None:
        """Return the place, counted on over the modulo range, and the part of the cycle at which the way left
        to it becomes shorter than what is needed; None: it does not in this cycle.
        """
        sense = copysign(1.0, now - s)
        left = sense * (self._position - s) - needed
        modulo = self._modulo
        if modulo.enabled:
            left = (left + _ROUNDING) % modulo.length - _ROUNDING
        place = s + sense * (left + needed)
        left_now = sense * (place - now) - needed_now
        if left < -_ROUNDING or left_now >= 0.0:
            return None
        return place, min(max(left / (left - left_now), 0.0), 1.0)


class DistanceLeaving:
    """The axis comes to rest over a distance of the leading value (SYN-129, SYN-205).

    Args:
        leading: Leading value of the coupling that it leaves, which is stepped here from the start on.
        position: Stop position of the axis, position unit.
        distance: Leading value distance, above 0.
        direction: 1 positive, 2 negative, 3 that of the present motion.
        modulo: Modulo range of the axis.

    """

    def __init__(
        self, leading: LeadingMotion, position: float, distance: float, direction: int, modulo: Modulo
    ) -> None:
        self.leading = leading
        self.by_velocity = False
        self._stop = _StopPlace(position, direction, modulo)
        self._distance = distance
        self._way: DistanceWay | None = None
        self._target = 0.0
        self._shift = 0.0
        self._sense = 0.0
        self._fraction = 0.0
        self._first = (0.0, 0.0, 0.0)
        self._stepped = False
        self._under_way = False
        self.synchronous = False
        self.reversed = False
        self.ended = False
        self.s = self.v = self.a = 0.0
        self.slope = self.curvature = 0.0
        self.base_x = self.base_y = 0.0

    def due(
        self,
        cycle_s: float,
        coupling: Coupling,
        before: tuple[float, float, float],
        slopes: tuple[float, float],
        added: tuple[float, float, float],
    ) -> bool:
        """Return whether the axis has to leave its leading value within this cycle; see `Leaving.due`."""
        leading = self.leading
        increment = leading.increment
        s = before[0] + added[0]
        now = coupling.s + added[0] + added[1] * cycle_s
        if coupling.v + added[1] == 0.0 and self._stop.at(now):
            self._target, self.ended = now, True
            return True
        if increment == 0.0 or not self._stop.permits(coupling.v + added[1]):
            return False
        half = 0.5 * self._distance
        found = self._stop.passed(s, now, abs(slopes[0]) * half, abs(coupling.slope) * half)
        if found is None:
            return False
        self._target, part = found
        self._fraction = part
        self._sense = copysign(1.0, increment)
        # What is superimposed goes on into the way, where the leading value moves fast enough to carry it.
        own = added[1] / leading.velocity if abs(leading.velocity) > _PLACE else 0.0
        # Where the function was at that place: the cubic through both ends of the cycle.
        rest = 1.0 - part
        first = slopes[0] * increment
        second = coupling.slope * increment
        rise = now - s
        y = s + part * (part * (3.0 - 2.0 * part) * rise + rest * (rest * first - part * second))
        self._first = (
            y,
            slopes[0] + part * (coupling.slope - slopes[0]) + own,
            slopes[1] + part * (coupling.curvature - slopes[1]),
        )
        return True

    def begin(self, s: float, v: float, a: float) -> None:
        """Start from the present setpoints of the axis."""
        self.s, self.v, self.a = s, v, a
        self._stepped = True
        if self.ended:
            return
        leading = self.leading
        leading.sense = self._sense
        gate = leading.position - (1.0 - self._fraction) * leading.increment
        self._way = DistanceWay(
            gate, gate + self._sense * self._distance, self._first, (self._target, 0.0, 0.0)
        )

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system of the axis, position unit."""
        self.s += offset
        self._target += offset
        self._shift += offset

    def step(
        self,
        cycle_s: float,  # noqa: ARG002 - the way counts, not the time
        maximum: float,  # noqa: ARG002 - no limits (SYN-110)
        limits: tuple[float, float, float],  # noqa: ARG002
    ) -> None:
        """Go on by one cycle."""
        leading = self.leading
        if self._stepped:
            self._stepped = False
        else:
            leading.step()
        way = self._way
        if leading.increment * self._sense < 0.0 and not self.ended:
            self.reversed = True
            return
        if self.ended or way is None or way.passed(leading.position):
            self.ended = True
            self.s, self.v, self.a = self._target, 0.0, 0.0
            return
        y, slope, curvature = way.evaluate(leading.position)
        velocity = leading.velocity
        before, self.s = self.s, y + self._shift
        if self._under_way and self._stop.forbids(self.s - before):
            self.reversed = True
            return
        self._under_way = True
        self.v = slope * velocity
        self.a = curvature * velocity * velocity + slope * leading.acceleration
        self.slope, self.curvature = slope, curvature


class TimeLeaving:
    """The axis brakes to its stop position with the dynamic values of the job, whatever the leading value
    does meanwhile (SYN-212, SYN-434).

    Args:
        leading: Leading value of the coupling that it leaves.
        position: Stop position of the axis, position unit.
        deceleration: Deceleration, position unit per second squared, above 0.
        jerk: Jerk, position unit per second cubed; 0 for none.
        direction: 1 positive, 2 negative, 3 that of the present motion.
        modulo: Modulo range of the axis.

    """

    def __init__(  # noqa: PLR0917 - one value per input of the instruction
        self,
        leading: LeadingMotion,
        position: float,
        deceleration: float,
        jerk: float,
        direction: int,
        modulo: Modulo,
    ) -> None:
        self.leading = leading
        self.by_velocity = False
        self._stop = _StopPlace(position, direction, modulo)
        self._deceleration = deceleration
        self._jerk = jerk
        self._target = 0.0
        self._generator = SetpointGenerator()
        self._stepped = False
        self.synchronous = False
        self.reversed = False
        self.ended = False
        self.s = self.v = self.a = 0.0
        self.slope = self.curvature = 0.0
        self.base_x = self.base_y = 0.0
        self._from = (0.0, 0.0, 0.0)

    def due(
        self,
        cycle_s: float,
        coupling: Coupling,
        before: tuple[float, float, float],
        slopes: tuple[float, float],  # noqa: ARG002 - the dynamics of the axis count
        added: tuple[float, float, float],
    ) -> bool:
        """Return whether the axis has to leave its leading value within this cycle; see `Leaving.due`."""
        extra, faster, growth = added
        s, v, a = self._from = (before[0] + extra, before[1] + faster, before[2] + growth)
        place, now = coupling.s + extra + faster * cycle_s, coupling.v + faster
        if now == 0.0 and v == 0.0 and self._stop.at(place):
            self._target = place
            return True
        if not self._stop.permits(now) or v * now < 0.0:
            return False
        deceleration, jerk = self._deceleration, self._jerk
        needed = abs(stop_distance(v, a, deceleration, jerk))
        needed_now = abs(stop_distance(now, coupling.a + growth, deceleration, jerk))
        found = self._stop.passed(s, place, needed, needed_now)
        if found is None:
            return False
        self._target = found[0]
        return True

    def begin(self, s: float, v: float, a: float) -> None:
        """Start from the setpoints of the axis one cycle ago."""
        self.s, self.v, self.a = s, v, a
        self._stepped = True
        s, v, a = self._from
        self._generator.set_state(s, v, a)
        deceleration = self._deceleration
        self._generator.start_position(
            self._target, max(abs(v), _PLACE), deceleration, deceleration, self._jerk
        )

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system of the axis, position unit."""
        self.s += offset
        self._target += offset
        self._generator.shift(offset)

    def step(
        self,
        cycle_s: float,
        maximum: float,  # noqa: ARG002 - limits are those of the start
        limits: tuple[float, float, float],  # noqa: ARG002
    ) -> None:
        """Go on by one cycle."""
        if self._stepped:
            self._stepped = False
        else:
            self.leading.step()
        generator = self._generator
        before = generator.s
        generator.advance(cycle_s)
        if self._stop.forbids(generator.s - before):
            self.reversed = True
            return
        self.s, self.v, self.a = generator.s, generator.v, generator.a
        self.ended = generator.done
