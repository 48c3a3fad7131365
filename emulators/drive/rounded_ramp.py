"""Speed ramp whose acceleration rises and falls in given times: the rounding of a ramp-function generator."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

_NEAR: Final = 1e-9


class Rounding(NamedTuple):
    """Shape of a ramp.

    Args:
        acceleration: Slope away from zero, rad/s^2, > 0, finite.
        deceleration: Slope towards zero, rad/s^2, > 0, finite.
        initial_s: Time in which the slope is built up, s, >= 0.
        final_s: Time in which it is taken back, s, >= 0.
        continuous: A change of the target in the middle of a ramp lets the slope fall before it turns;
            else it breaks off.

    """

    acceleration: float
    deceleration: float
    initial_s: float
    final_s: float
    continuous: bool = True


class RoundedRamp:
    """Goes from one velocity to another; a ramp from standstill to v takes v /
    slope + initial / 2 + final / 2.

    Where the velocity passes zero, one ramp ends and another one begins.
    """

    def __init__(self) -> None:
        self.velocity = 0.0
        """rad/s."""
        self.slope = 0.0
        """rad/s^2."""
        self._goal = 0.0
        self._shape: Rounding | None = None
        self._plan: list[tuple[float, float, float]] = []
        self._aim = self._elapsed = self._length = self._start = 0.0

    def aim(self, velocity: float, target: float, shape: Rounding) -> None:
        """Go to another target.

        Args:
            velocity: Present velocity, rad/s; when it is not that of the ramp, the ramp begins there.
            target: rad/s.
            shape: Slopes and times.

        """
        if abs(velocity - self.velocity) > _NEAR * (1.0 + abs(velocity)):
            self.velocity, self.slope = velocity, 0.0
            self._shape = None
        if shape == self._shape and target == self._goal:
            return
        if not shape.continuous and (target - self.velocity) * self.slope < 0.0:
            self.slope = 0.0
        self._shape = shape
        self._goal = target
        self._replan()

    def hold(self) -> None:
        """Break the ramp off where it is."""
        self.slope = 0.0
        self._plan = []
        self._shape = None

    def step(self, period_s: float) -> float:
        """Advance by a time, s, and return the velocity."""
        if not self._plan:
            return self.velocity
        self._elapsed += period_s
        left, velocity = self._elapsed, self._start
        slope = 0.0
        for duration, begin, jerk in self._plan:
            part = min(left, duration)
            slope = begin + jerk * part
            velocity += 0.5 * (begin + slope) * part
            left -= part
            if left <= 0.0:
                break
        self.velocity, self.slope = velocity, slope
        if left > -_NEAR and self._elapsed >= self._length - _NEAR:
            self.velocity, self.slope = self._aim, 0.0
            self._replan()
        return self.velocity

    def _replan(self) -> None:
        shape = self._shape
        assert shape is not None
        goal, velocity = self._goal, self.velocity
        self._aim = aim = 0.0 if goal * velocity < 0.0 else goal
        self._elapsed = 0.0
        self._start = velocity
        limit = shape.acceleration if abs(aim) > abs(velocity) else shape.deceleration
        self._plan = _segments(
            aim - velocity,
            self.slope,
            limit,
            limit / shape.initial_s if shape.initial_s else math.inf,
            limit / shape.final_s if shape.final_s else math.inf,
            abs(self.slope) / shape.final_s if shape.final_s else math.inf,
        )
        self._length = sum(duration for duration, _, _ in self._plan)


def _segments(  # noqa: PLR0917 - the kinematic quantities in their usual order
    change: float, slope: float, limit: float, rise: float, fall: float, release: float
) -> list[tuple[float, float, float]]:
    """Return (duration s, slope at its beginning, jerk) over a change of velocity.

    The jerks, rad/s^3: `rise` builds the slope up, `fall` takes it back, `release` takes back a slope that is
    there and not wanted.
    """
    release = max(release, fall)
    sign = math.copysign(1.0, change - slope * abs(slope) / (2.0 * release))
    way, now = sign * change, sign * slope
    segments: list[tuple[float, float, float]] = []

    def add(duration: float, begin: float, jerk: float) -> None:
        if duration > 0.0:
            segments.append((duration, sign * begin, sign * jerk))

    if now < 0.0:
        add(-now / release, now, release)
        way += now * now / (2.0 * release)
        now = 0.0
    if now > limit:
        add((now - limit) / release, now, -release)
        way -= (now * now - limit * limit) / (2.0 * release)
        now = limit
    inverse = 0.5 / rise + 0.5 / fall
    peak = limit
    if inverse:
        peak = min(limit, math.sqrt(max(0.0, (way + now * now / (2.0 * rise)) / inverse)))
    if peak < now:  # it has to fall sooner than it should
        add(2.0 * way / now, now, -now * now / (2.0 * way) if way > 0.0 else 0.0)
        return segments
    if peak <= 0.0:
        return segments
    used = (peak * peak - now * now) / (2.0 * rise) + peak * peak / (2.0 * fall)
    add((peak - now) / rise, now, rise)
    add((way - used) / peak, peak, 0.0)
    add(peak / fall, peak, -fall)
    return segments
