"""Profile generator for positioning: trapezoidal velocity, optionally smoothed to a bounded jerk.

The trapezoid is planned in closed form from any position and velocity, with separate acceleration and
deceleration, and evaluated exactly at the servo instants. A sin² or a jerk-free profile has the same
segments, but in each of them the velocity follows an S instead of a line; its steepest point keeps the
acceleration. The jerk-limited profile is the moving average of the trapezoid over the longest time that an
acceleration needs to rise: it keeps all limits of the trapezoid, ends exactly at the target and takes a new
target at any moment without a step in acceleration.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from enum import IntEnum
from typing import Final, NamedTuple

from fieldbus.errors import ConfigurationError

_LONGEST_FILTER_STEPS: Final = 1 << 14


class RampShape(IntEnum):
    """How a quantity gets from one value to another within the time of a ramp."""

    LINEAR = 0
    SIN2 = 1
    """The square of a sine: the slope rises and falls as a sine."""
    JERK_FREE = 2
    """A polynomial of the fifth degree: slope and curvature begin and end at zero."""


def _sin2(x: float) -> tuple[float, float]:
    """Return height and area of the unit ramp at 0 <= x <= 1."""
    return 0.5 - 0.5 * math.cos(math.pi * x), 0.5 * x - math.sin(math.pi * x) / (2.0 * math.pi)


def _smooth(x: float) -> tuple[float, float]:
    cube = x * x * x
    return cube * (10.0 + x * (6.0 * x - 15.0)), cube * x * (2.5 + x * (x - 3.0))


_SHAPES: Final[dict[int, Callable[[float], tuple[float, float]]]] = {
    RampShape.SIN2: _sin2,
    RampShape.JERK_FREE: _smooth,
}
STEEPNESS: Final[dict[int, float]] = {
    RampShape.LINEAR: 1.0,
    RampShape.SIN2: 0.5 * math.pi,
    RampShape.JERK_FREE: 1.875,
}
"""Steepest slope of a shape in proportion to its mean slope."""


class ProfileForm(NamedTuple):
    """How a positioning gets from one speed to another."""

    shape: RampShape = RampShape.LINEAR
    """A new target in the middle of a ramp begins a ramp of its own."""
    jerk: float = 0.0
    """rad/s^3 while the speed grows; 0 = not limited. While the axis moves, the smoothing time of its profile
    is kept.
    """
    braking_jerk: float = 0.0
    """rad/s^3 while the speed falls; 0 = as `jerk`."""


TRAPEZOID: Final = ProfileForm()


def ramp_height(shape: RampShape, x: float) -> float:
    """Return how much of the way a ramp has covered after the share `x` (0..1) of its time."""
    form = _SHAPES.get(shape)
    return x if form is None else form(x)[0]


def _plan(  # noqa: PLR0917 - the kinematic quantities in their usual order
    distance: float,
    velocity: float,
    limit: float,
    acceleration: float,
    deceleration: float,
    end_velocity: float,
) -> list[tuple[float, float]]:
    """Return (duration s, acceleration) segments over `distance`; see
    `PositionProfile.move` for the units.
    """
    segments: list[tuple[float, float]] = []
    end = min(end_velocity, limit)
    brakes_first = velocity * distance < 0.0 or (distance == 0.0 and velocity != 0.0)
    if not brakes_first:
        excess = velocity * velocity - end * end - 2.0 * deceleration * abs(distance)
        brakes_first = excess > 1e-9 * velocity * velocity and abs(velocity) > end
    if brakes_first:
        duration = abs(velocity) / deceleration
        segments.append((duration, -math.copysign(deceleration, velocity)))
        distance -= 0.5 * velocity * duration
        velocity = 0.0
    sign = 1.0 if distance >= 0.0 else -1.0
    way = abs(distance)
    speed = abs(velocity)
    if speed > limit:
        duration = (speed - limit) / deceleration
        segments.append((duration, -sign * deceleration))
        way -= 0.5 * (speed + limit) * duration
        speed = limit
    peak = math.sqrt(
        max(
            0.0,
            2.0 * way * acceleration * deceleration + deceleration * speed * speed + acceleration * end * end,
        )
        / (acceleration + deceleration)
    )
    if peak > limit:
        peak = limit
        cruise = way - (limit * limit - speed * speed) / (2.0 * acceleration)
        cruise -= (limit * limit - end * end) / (2.0 * deceleration)
    else:
        cruise = 0.0
        if peak < end:  # the way is too short to reach the end velocity
            peak = end = math.sqrt(speed * speed + 2.0 * acceleration * max(0.0, way))
    peak = max(peak, speed)
    segments.append(((peak - speed) / acceleration, sign * acceleration))
    if cruise > 0.0:
        segments.append((cruise / peak, 0.0))
    segments.append((max(0.0, peak - end) / deceleration, -sign * deceleration))
    return segments


class PositionProfile:
    """Positions and velocities at the servo instants; rad and rad/s, or any other consistent unit.

    Args:
        step_s: Distance of two `advance` calls, s, > 0.

    """

    def __init__(self, *, step_s: float) -> None:
        if not step_s > 0.0:
            raise ConfigurationError("step_s", step_s, "> 0")
        self._step = step_s
        self._segments: list[tuple[float, float]] = []
        self._shape: Callable[[float], tuple[float, float]] | None = None
        self._index = 0
        self._elapsed = 0.0
        self._base_position = self._raw_position = 0.0
        self._base_velocity = self._raw_velocity = 0.0
        self._filter: deque[tuple[float, float]] = deque()
        self._sum_position = self._sum_velocity = 0.0
        self.position = 0.0
        """Present setpoint."""
        self.velocity = 0.0
        """Present velocity of the setpoint."""
        self.target = 0.0
        self.raw_done = True
        """Whether the trapezoid has reached its target (the smoothed profile may still be on its way)."""

    @property
    def done(self) -> bool:
        """Whether the setpoint has reached the target."""
        return self.raw_done and (not self._filter or (self.position == self.target and self.velocity == 0.0))

    def reset(self, position: float, velocity: float = 0.0) -> None:
        """Start again from a state; a velocity is kept until the next `move`."""
        self._filter.clear()
        self._segments = []
        self._index = 0
        self._elapsed = 0.0
        self._base_position = self._raw_position = self.position = self.target = position
        self._base_velocity = self._raw_velocity = self.velocity = velocity
        self.raw_done = True

    def move(
        self,
        target: float,
        *,
        velocity: float,
        acceleration: float,
        deceleration: float,
        end_velocity: float = 0.0,
        form: ProfileForm = TRAPEZOID,
    ) -> None:
        """Plan the way to `target` from the present state.

        Args:
            target: Where to go, rad.
            velocity: Highest speed, rad/s, > 0.
            acceleration: rad/s^2, > 0.
            deceleration: rad/s^2, > 0.
            end_velocity: Speed at the target in the direction of motion, rad/s, >= 0; kept afterwards.
            form: Shape and jerk of the ramps.

        """
        if not (velocity > 0.0 and acceleration > 0.0 and deceleration > 0.0):
            raise ConfigurationError("profile", (velocity, acceleration, deceleration), "all > 0")
        smoothing = 0.0
        if form.jerk > 0.0:
            smoothing = max(acceleration / form.jerk, deceleration / (form.braking_jerk or form.jerk))
        self._set_filter(smoothing)
        steepness = STEEPNESS[form.shape]
        self._shape = _SHAPES.get(form.shape)
        self._segments = _plan(
            target - self._raw_position,
            self._raw_velocity,
            velocity,
            acceleration / steepness,
            deceleration / steepness,
            end_velocity,
        )
        self._index = 0
        self._elapsed = 0.0
        self._base_position = self._raw_position
        self._base_velocity = self._raw_velocity
        self.target = target
        self.raw_done = False

    def advance(self) -> None:
        """Go on by one step."""
        elapsed = self._elapsed + self._step
        if self.raw_done:
            position = self._base_position + self._base_velocity * elapsed
            velocity = self._base_velocity
        else:
            segments = self._segments
            while self._index < len(segments):
                duration, acceleration = segments[self._index]
                if elapsed < duration:
                    break
                elapsed -= duration
                self._base_position += (self._base_velocity + 0.5 * acceleration * duration) * duration
                self._base_velocity += acceleration * duration
                self._index += 1
            if self._index == len(segments):
                self._base_position = self.target
                if abs(self._base_velocity) < 1e-9:
                    self._base_velocity = 0.0
                self.raw_done = True
                acceleration = 0.0
            if self._shape is None or not acceleration:
                position = (
                    self._base_position + (self._base_velocity + 0.5 * acceleration * elapsed) * elapsed
                )
                velocity = self._base_velocity + acceleration * elapsed
            else:
                height, area = self._shape(elapsed / duration)
                change = acceleration * duration
                position = self._base_position + self._base_velocity * elapsed + change * area * duration
                velocity = self._base_velocity + change * height
        self._elapsed = elapsed
        self._raw_position = position
        self._raw_velocity = velocity
        if self._filter:
            self._smooth(position, velocity)
        else:
            self.position = position
            self.velocity = velocity

    def _set_filter(self, duration_s: float) -> None:
        moving = self._raw_velocity != 0.0 or not self.done
        if self._filter and moving:
            return
        self._filter.clear()
        steps = min(round(duration_s / self._step), _LONGEST_FILTER_STEPS)
        if steps < 2:
            return
        velocity = self._raw_velocity
        position = self._raw_position
        travel = velocity * self._step
        # A profile that starts in motion is smoothed as if it had always moved like that.
        for age in range(steps - 1, -1, -1):
            self._filter.append((position + (0.5 * (steps - 1) - age) * travel, velocity))
        self._raw_position = self._filter[-1][0]
        self._sum_position = math.fsum(entry[0] for entry in self._filter)
        self._sum_velocity = math.fsum(entry[1] for entry in self._filter)

    def _smooth(self, position: float, velocity: float) -> None:
        buffer = self._filter
        old_position, old_velocity = buffer.popleft()
        buffer.append((position, velocity))
        self._sum_position += position - old_position
        self._sum_velocity += velocity - old_velocity
        count = len(buffer)
        if self.raw_done and velocity == 0.0 and buffer[0] == buffer[-1]:
            # At rest all entries are equal: leave the rounding of the running sums behind.
            self.position = position
            self.velocity = 0.0
            self._sum_position = position * count
            self._sum_velocity = 0.0
        else:
            self.position = self._sum_position / count
            self.velocity = self._sum_velocity / count
