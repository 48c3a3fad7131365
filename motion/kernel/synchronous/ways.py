"""Ways to a synchronous motion and away from it: over a distance of the leading value, or in a time."""

from __future__ import annotations

from typing import Final

from motion.setpoint import Profile

Values = tuple[float, float, float]
"""A following value with its first two derivatives by the leading value."""
_ROUNDING: Final = 1e-9


class DistanceWay:
    """A polynomial of the fifth degree in the leading value, with continuous first and second derivatives at
    both ends (SYN-120).

    Args:
        begin: Leading value at the start.
        end: Leading value at the end, another one.
        first: Following value and derivatives at the start.
        last: Those at the end.

    """

    def __init__(self, begin: float, end: float, first: Values, last: Values) -> None:
        self.begin = begin
        self.end = end
        length = self._length = end - begin
        square = length * length
        y0, slope0, curvature0 = first[0], first[1] * length, first[2] * square
        slope1, curvature1 = last[1] * length, last[2] * square
        rise = last[0] - y0
        self.y = y0
        """Following value at the start."""
        self._c1 = slope0
        self._c2 = 0.5 * curvature0
        self._c3 = 10.0 * rise - 6.0 * slope0 - 4.0 * slope1 - 0.5 * (3.0 * curvature0 - curvature1)
        self._c4 = -15.0 * rise + 8.0 * slope0 + 7.0 * slope1 + 0.5 * (3.0 * curvature0 - 2.0 * curvature1)
        self._c5 = 6.0 * rise - 3.0 * (slope0 + slope1) - 0.5 * (curvature0 - curvature1)

    def passed(self, x: float) -> bool:
        """Return whether a leading value lies at the end or beyond it."""
        return (x - self.begin) / self._length >= 1.0 - _ROUNDING

    def evaluate(self, x: float) -> Values:
        """Return the following value and its first two derivatives by the leading value."""
        z = (x - self.begin) / self._length
        c3, c4, c5 = self._c3, self._c4, self._c5
        return (
            self.y + z * (self._c1 + z * (self._c2 + z * (c3 + z * (c4 + z * c5)))),
            (self._c1 + z * (2.0 * self._c2 + z * (3.0 * c3 + z * (4.0 * c4 + z * 5.0 * c5)))) / self._length,
            (2.0 * self._c2 + z * (6.0 * c3 + z * (12.0 * c4 + z * 20.0 * c5))) / self._length**2,
        )


class TimeWay:
    """A profile of time that is kept once it has begun: what it adds to the synchronous function fades
    to zero, and changes of the leading value act through the function (SYN-123).

    Args:
        profile: Way of the following axis to its synchronous position.
        miss: What the position at the start lies beside that of profile and leading value; it fades, too.

    """

    def __init__(self, profile: Profile, miss: float) -> None:
        self._profile = profile
        self._miss = miss
        self.duration = profile.duration

    def passed(self, time: float) -> bool:
        """Return whether the profile has ended at `time`, s from its start."""
        return time >= self.duration - _ROUNDING

    def added(self, time: float) -> Values:
        """Return what the axis is beside the function at `time`: position, velocity, acceleration."""
        if self.passed(time):
            return 0.0, 0.0, 0.0
        profile, duration = self._profile, self.duration
        way, v, a = profile.sample(time)
        end = profile.end_velocity
        s, v = way - profile.distance - end * (time - duration), v - end
        if self._miss:
            z = time / duration
            miss = self._miss
            rest = 1.0 - z
            s += miss * (1.0 - z * z * z * (10.0 - z * (15.0 - 6.0 * z)))
            v -= miss * 30.0 * z * z * rest * rest / duration
            a -= miss * 60.0 * z * rest * (1.0 - 2.0 * z) / (duration * duration)
        return s, v, a
