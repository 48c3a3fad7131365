"""Shifts of the leading and of the following value of a synchronous function (SYN sections 7.4, 7.5)."""

from __future__ import annotations

from math import ceil, copysign, floor
from typing import Protocol

from motion.setpoint import SetpointGenerator


class Shifting(Protocol):
    """One motion of a shift."""

    begun: bool
    """It shifts; before that it waits for the leading value."""
    done: bool
    """The shift has reached its target."""
    reversed: bool
    """The leading value has turned round on the way; the shift stays where it is."""
    value: float
    velocity: float
    acceleration: float

    def step(self, x: float, increment: float, velocity: float, acceleration: float) -> None:
        """Go on by one cycle.

        Args:
            x: Effective leading position.
            increment: Its way in this cycle.
            velocity: Effective leading velocity, position unit per second.
            acceleration: Effective leading acceleration, position unit per second squared.

        """


class ShiftOverDistance:
    """A shift over a way of the leading value: `10 z^3 - 15 z^4 + 6 z^5` (SYN-132).

    Args:
        begin: Shift at the beginning.
        target: Shift at the end.
        distance: Way of the leading value, above 0.
        direction: 1 and 2: the leading value has to move in positive or negative direction, 3: in any.
        start: Leading position at which it begins; None: the present one.
        modulo: Modulo length of the leading object, in whose range `start` comes again; 0 without one.

    """

    def __init__(
        self,
        begin: float,
        target: float,
        *,
        distance: float,
        direction: int,
        start: float | None,
        modulo: float,
    ) -> None:
        self.begun = start is None and direction == 3
        self.done = False
        self.reversed = False
        self.value = self._begin = begin
        self.velocity = 0.0
        self.acceleration = 0.0
        self._way = target - begin
        self._target = target
        self._distance = distance
        self._direction = direction
        self._start = start
        self._modulo = modulo
        self._x0 = 0.0
        self._sign = 0.0

    def step(self, x: float, increment: float, velocity: float, acceleration: float) -> None:
        """Follow the leading value; see `Shifting`."""
        if self.done or self.reversed:
            return
        sign = self._sign
        if sign == 0.0:
            if increment == 0.0 or not self._permits(increment) or not self._reaches(x, increment):
                return
            sign = self._sign = copysign(1.0, increment)
            self.begun = True
        if sign * increment < 0.0:
            self.reversed = True
            self.velocity = self.acceleration = 0.0
            return
        z = sign * (x - self._x0) / self._distance
        if z >= 1.0:
            self.value, self.velocity, self.acceleration, self.done = self._target, 0.0, 0.0, True
            return
        way = self._way
        dz, ddz = sign * velocity / self._distance, sign * acceleration / self._distance
        slope = 30.0 * z * z * (1.0 + z * (z - 2.0))
        self.value = self._begin + way * z * z * z * (10.0 + z * (6.0 * z - 15.0))
        self.velocity = way * slope * dz
        self.acceleration = way * (60.0 * z * (1.0 + z * (2.0 * z - 3.0)) * dz * dz + slope * ddz)

    def _permits(self, increment: float) -> bool:
        return self._direction == 3 or (increment > 0.0) is (self._direction == 1)

    def _reaches(self, x: float, increment: float) -> bool:
        """Return whether the way of this cycle leads over the start position; notes where it began."""
        before = x - increment
        start = self._start
        if start is None:
            self._x0 = before
            return True
        length = self._modulo
        if length > 0.0:
            turns = (x - start) / length
            start += length * (floor(turns) if increment > 0.0 else ceil(turns))
        self._x0 = start
        return before <= start <= x if increment > 0.0 else x <= start <= before


class ShiftWithDynamics:
    """A shift with velocity, acceleration and jerk of the following axis, whatever the leading value does
    (SYN-183, SYN-424).

    Args:
        begin: Shift at the beginning.
        target: Shift at the end.
        ratio: Way of the following axis for one unit of the shift, not 0.
        present: Velocity and acceleration of the shift at the beginning.
        velocity: Highest velocity of the following axis that is added, position unit per second, above 0.
        acceleration: Its highest acceleration, above 0.
        deceleration: Its highest deceleration, above 0.
        jerk: Its highest jerk, 0 for none.
        cycle_s: Cycle, s.

    """

    def __init__(
        self,
        begin: float,
        target: float,
        *,
        ratio: float,
        present: tuple[float, float],
        velocity: float,
        acceleration: float,
        deceleration: float,
        jerk: float,
        cycle_s: float,
    ) -> None:
        self.begun = True
        self.done = False
        self.reversed = False
        self.value = self._begin = begin
        self.velocity, self.acceleration = present
        self._target = target
        self._ratio = ratio
        self._cycle = cycle_s
        self._way = SetpointGenerator()
        self._way.set_state(0.0, ratio * present[0], ratio * present[1])
        self._way.start_position(ratio * (target - begin), velocity, acceleration, deceleration, jerk)

    def step(self, x: float, increment: float, velocity: float, acceleration: float) -> None:
        """Go on by one cycle; see `Shifting`."""
        del x, increment, velocity, acceleration
        if self.done:
            return
        way = self._way
        way.advance(self._cycle)
        self.done = way.done
        self.value = self._target if self.done else self._begin + way.s / self._ratio
        self.velocity, self.acceleration = way.v / self._ratio, way.a / self._ratio


class Shift:
    """The shift of one synchronous job, of its leading or of its following value.

    Args:
        value: Shift at the beginning, position unit.

    """

    def __init__(self, value: float = 0.0) -> None:
        self.value = value
        """Present shift, position unit."""
        self.velocity = 0.0
        """Its velocity, position unit per second."""
        self.acceleration = 0.0
        """Its acceleration, position unit per second squared."""
        self.motion: Shifting | None = None
        """What changes it; None: it stands."""

    def step(self, x: float, increment: float, velocity: float, acceleration: float) -> None:
        """Go on by one cycle; the arguments as in `Shifting.step`."""
        motion = self.motion
        if motion is None:
            return
        motion.step(x, increment, velocity, acceleration)
        self.value, self.velocity, self.acceleration = motion.value, motion.velocity, motion.acceleration

    def end(self) -> None:
        """Stand where it is."""
        self.motion = None
        self.velocity = self.acceleration = 0.0
