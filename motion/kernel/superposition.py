"""Superimposed motion: a second, relative setpoint on top of the basic one (section 2.9 and 2.10 of the
instruction specification).

The axis follows the sum. The basic motion continues as if it were alone; what the superimposed motion has
covered belongs to it once that has ended, so that target and setpoint of the basic motion are then moved by
this distance.
"""

from __future__ import annotations

from math import copysign, sqrt
from typing import TYPE_CHECKING, Final, Protocol

from typing_extensions import override

from motion.setpoint import MotionPhase, Setpoint, SetpointGenerator

if TYPE_CHECKING:
    from collections.abc import Callable

_CHANGE: Final = 1e-3
"""Share of the velocity limit by which the velocity left for the superimposed motion has to
change before it is planned again.
"""


class RelativeMotion(Protocol):
    """What is superimposed: read when it begins and, where it is given from outside, in every cycle."""

    distance: float
    """Position unit, signed."""
    velocity: float
    """Highest velocity, or the one that is given, position unit/s."""
    acceleration: float
    """Acceleration that is given, position unit/s2."""
    abort_acceleration: bool
    """A halt sets a present acceleration to zero first."""


class Superposition(Setpoint):
    """One superimposed motion and its sum with the basic one.

    Args:
        basic: Setpoint of the basic motion.
        velocity_limit: Returns the highest velocity of the sum, axis unit per second.
        basic_velocity: Returns the velocity to which the basic motion
            accelerates, axis unit per second, signed.

    """

    __slots__ = (
        "_basic",
        "_basic_velocity",
        "_braking",
        "_dynamics",
        "_left",
        "_limit",
        "_motion",
        "_target",
        "_zero",
        "given",
        "part",
    )

    def __init__(
        self,
        basic: SetpointGenerator,
        *,
        velocity_limit: Callable[[], float],
        basic_velocity: Callable[[], float],
    ) -> None:
        self._basic = basic
        self._limit = velocity_limit
        self._basic_velocity = basic_velocity
        self.part = SetpointGenerator()
        """The superimposed motion alone; its position is the distance that it has covered."""
        self._motion: RelativeMotion | None = None
        self.given = False
        """Whether the user program gives the setpoints (`MC_MotionInSuperimposed`)."""
        self._zero = 0.0
        self._target = 0.0
        self._left = 0.0
        self._braking = False
        self._dynamics = (0.0, 0.0, 0.0)
        self.refresh()

    @property
    def ended(self) -> bool:
        """Whether the superimposed motion has arrived and stands; not while
        it waits until velocity is left.
        """
        return self.part.done and not self.given and (self._braking or self.part.positioning)

    def move(self, motion: RelativeMotion, acceleration: float, deceleration: float, jerk: float) -> None:
        """Begin to move by `motion.distance`, from whatever the superimposed motion does now."""
        self._motion = motion
        self._braking = self.given = False
        self._target = self.part.s + motion.distance
        self._dynamics = (acceleration, deceleration, jerk)
        self._left = self._velocity_left()
        self._plan()

    def halt(self, motion: RelativeMotion, deceleration: float, jerk: float) -> None:
        """Begin to brake the superimposed motion to zero."""
        self._motion = motion
        self._braking = True
        self.given = False
        self._dynamics = (0.0, deceleration, jerk)
        self._bound_acceleration(jerk)
        self.part.start_stop(deceleration, jerk, abort_acceleration=motion.abort_acceleration)

    def give(self, motion: RelativeMotion) -> None:
        """Take distance, velocity and acceleration from `job` with every cycle; the
        distance counts from here (MIN-033).
        """
        self._motion = motion
        self._braking = False
        self.given = True
        self._zero = self.part.s

    def freeze(self) -> None:
        """Stay at the distance covered, without velocity and acceleration (MIN-040)."""
        self.given = False
        self._braking = True
        self.part.set_state(self.part.s, 0.0)
        self.refresh()

    def change(self, acceleration: float, deceleration: float, jerk: float) -> None:
        """Go on with other dynamic values; a job that runs keeps its velocity and its target."""
        dynamics = (0.0, deceleration, jerk) if self._braking else (acceleration, deceleration, jerk)
        if dynamics == self._dynamics or self.given or self.ended:
            return
        self._dynamics = dynamics
        if self._braking:
            self.part.start_stop(deceleration, jerk)
        else:
            self._plan()

    def advance(self, dt: float) -> None:
        """Go on by `dt` s, after the basic motion has."""
        motion = self._motion
        if self.given and motion is not None:
            self.part.set_state(self._zero + motion.distance, motion.velocity, motion.acceleration)
            self.refresh()
            return
        if not self._braking and not self.ended:
            left = self._velocity_left()
            if abs(left - self._left) > _CHANGE * self._limit():
                self._left = left
                self._plan()
        self.part.advance(dt)
        self.refresh()

    def refresh(self) -> None:
        """Form the sum."""
        basic, part = self._basic, self.part
        self.s = basic.s + part.s
        """Position setpoint of the axis, axis unit."""
        self.v = basic.v + part.v
        """Velocity setpoint of the axis, axis unit per second."""
        self.a = basic.a + part.a
        """Acceleration setpoint of the axis, axis unit per second squared."""

    @override
    def peek(self, dt: float) -> tuple[float, float, float]:
        s, v, a = self._basic.peek(dt)
        t, w, b = self.part.peek(dt)
        return s + t, v + w, a + b

    @override
    def before(self, dt: float) -> tuple[float, float] | None:
        basic, part = self._basic.before(dt), self.part.before(dt)
        return None if basic is None or part is None else (basic[0] + part[0], basic[1] + part[1])

    @property
    @override
    def done(self) -> bool:
        return self._basic.done and self.part.done

    @property
    def remaining(self) -> float:
        """Distance that the superimposed motion still has to cover, axis unit."""
        return 0.0 if self._braking or self.given else self._target - self.part.s

    def _velocity_left(self) -> float:
        """Return what the basic motion leaves of the velocity limit in the direction of
        the superimposed one (MC-352).
        """
        direction = copysign(1.0, self._target - self.part.s)
        basic = self._basic
        present = direction * basic.v
        planned = self._basic_velocity()
        if basic.phase is MotionPhase.ACCELERATING or basic.v * planned < 0.0:
            # What it accelerates to, if need be after a reversal, counts at once: the sum would else have to
            # be taken back with every cycle, and may be too high in the end.
            present = max(present, direction * planned)
        return max(0.0, self._limit() - present)

    def _plan(self) -> None:
        motion = self._motion
        if motion is None:
            return
        acceleration, deceleration, jerk = self._dynamics
        self._bound_acceleration(jerk)
        velocity = min(motion.velocity, self._left)
        if velocity > _CHANGE * self._limit():
            self.part.start_position(self._target, velocity, acceleration, deceleration, jerk)
        else:
            self.part.start_velocity(0.0, acceleration, deceleration, jerk)  # waits until velocity is left

    def _bound_acceleration(self, jerk: float) -> None:
        """Let a present acceleration end at once as far as `jerk` would end it only beyond the velocity limit
        (STP-119, STP-200).
        """
        part = self.part
        a = part.a
        if a == 0.0 or jerk <= 0.0:
            return
        v = self._basic.v + part.v
        left = self._limit() - abs(v) if v * a >= 0.0 else self._limit() + abs(v)
        bound = sqrt(2.0 * jerk * max(0.0, left))
        if abs(a) > bound:
            part.a = copysign(bound, a)
