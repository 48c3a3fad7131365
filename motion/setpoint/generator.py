"""The setpoint generator of an axis: present state, active profile, one step per cycle."""

from __future__ import annotations

from enum import IntEnum
from math import inf
from typing import Final

from typing_extensions import override

from motion.setpoint.position import plan_position
from motion.setpoint.profile import Profile
from motion.setpoint.setpoint import Setpoint
from motion.setpoint.velocity import plan_velocity


class MotionPhase(IntEnum):
    """What the magnitude of the velocity setpoint does; the three exclude each other (VAR-055)."""

    CONSTANT = 0
    """Constant velocity, standstill included (`StatusWord.X12`)."""
    ACCELERATING = 1
    """`StatusWord.X13`."""
    DECELERATING = 2
    """`StatusWord.X14`."""


_ENDLESS: Final = [inf]
_ROUNDING: Final = 1e-10
"""Time before the end of a piece at which it counts as over, s: whether the last cycle ends with it or not is
no matter of rounding.
"""


_MOVING: Final = 0
_ARRIVED: Final = 1
"""The last step has come to rest."""
_AT_REST: Final = 2
"""The last step was one at rest."""


class SetpointGenerator(Setpoint):
    """Position, velocity and acceleration setpoint of one axis.

    A `start_...` method plans from the present state at once; the state itself changes with `advance` only.
    Without an active profile the axis moves on with its present velocity.
    """

    __slots__ = (
        "_astray_until",
        "_base",
        "_begun",
        "_dt",
        "_ends",
        "_index",
        "_piece",
        "_pieces",
        "_resting",
        "_steps",
        "_time",
        "_until",
        "done",
        "jerk",
        "positioning",
        "target",
    )

    jerk: float
    """Jerk with which the active profile was planned, position unit/s3; 0.0 for none, or without a profile.
    """
    done: bool
    """Whether the state has reached the end of the profile: the target position, or the constant velocity."""
    positioning: bool
    """Whether the profile is a motion to a position."""
    target: float
    """Target position, position unit, or target velocity, position unit/s; see `positioning`."""

    def __init__(self, position: float = 0.0) -> None:
        self._dt = 0.0
        self.set_state(position, 0.0)

    def set_state(self, s: float, v: float, a: float = 0.0) -> None:
        """Take over a state and drop the active profile, for example to follow actual values.

        The acceleration counts as present acceleration of the next `start_...`.
        """
        self.s = self._base = s
        self.v = self.target = v
        self.a = a
        self.jerk = 0.0
        self.done = True
        self.positioning = False
        self._time = self._begun = self._astray_until = 0.0
        self._steps = 0
        self._index = 0
        self._resting = _MOVING
        self._until = inf
        self._ends = _ENDLESS
        self._piece = (0.0, s, v, 0.0, 0.0, 0.0, 0.0, 0.0)
        self._pieces = [(0.0, 0.0, v, 0.0, 0.0, 0.0, 0.0, 0.0)]

    def start_velocity(
        self,
        v_target: float,
        acceleration: float,
        deceleration: float,
        jerk: float,
        abort_acceleration: bool = False,
    ) -> None:
        """Change to the constant velocity `v_target`; arguments and errors as `plan_velocity`."""
        profile = plan_velocity(
            self.v,
            self.a,
            v_target,
            acceleration=acceleration,
            deceleration=deceleration,
            jerk=jerk,
            abort_acceleration=abort_acceleration,
        )
        self._take(profile, v_target, jerk, positioning=False)

    def start_stop(self, deceleration: float, jerk: float, abort_acceleration: bool = False) -> None:
        """Brake to standstill; arguments and errors as `plan_velocity`."""
        self.start_velocity(0.0, deceleration, deceleration, jerk, abort_acceleration)

    def start_position(
        self, s_target: float, velocity: float, acceleration: float, deceleration: float, jerk: float
    ) -> None:
        """Move to the position `s_target`; `velocity` (above 0) limits the
        velocity, errors as `plan_position`.
        """
        profile = plan_position(
            self.s,
            self.v,
            self.a,
            s_target,
            max_velocity=velocity,
            acceleration=acceleration,
            deceleration=deceleration,
            jerk=jerk,
        )
        self._take(profile, s_target, jerk, positioning=True)
        way = profile.distance
        for phase in profile.phases:
            if phase.velocity * way < 0.0 or way == 0.0:
                self._astray_until = phase.start + phase.duration

    def shift(self, offset: float) -> None:
        """Move the scale of positions: position setpoint and target change by
        `offset`, the motion does not.
        """
        self._base += offset
        self.s += offset
        if self.positioning:
            self.target += offset
        self._seek(self._time)

    def advance(self, dt: float) -> None:
        """Go on by `dt` s."""
        if self._resting:
            self._resting = _AT_REST
            return
        if dt != self._dt:
            self._dt, self._begun, self._steps = dt, self._time, 0
        # The number of steps is exact: a sum of steps would drift away from the time within days (LIM-098).
        steps = self._steps = self._steps + 1
        time = self._time = self._begun + steps * dt
        if time >= self._until:
            self._seek(time)
        start, s, v, a, half, jerk, half_jerk, sixth = self._piece
        x = time - start
        self.s = s + x * (v + x * (half + x * sixth))
        self.v = v + x * (a + x * half_jerk)
        self.a = a + x * jerk
        if self.done and self.v == 0.0:
            self._resting = _ARRIVED

    @override
    def peek(self, dt: float) -> tuple[float, float, float]:
        time = self._begun + (self._steps + 1) * dt if dt == self._dt else self._time + dt
        index = self._index
        ends = self._ends
        reached = time + _ROUNDING
        if reached < ends[index]:
            start, s, v, a, half, jerk, half_jerk, sixth = self._piece
        else:
            while reached >= ends[index]:
                index += 1
            start, way, v, a, half, jerk, half_jerk, sixth = self._pieces[index]
            s = self.target if index == len(ends) - 1 and self.positioning else self._base + way
        x = time - start
        return s + x * (v + x * (half + x * sixth)), v + x * (a + x * half_jerk), a + x * jerk

    @override
    def before(self, dt: float) -> tuple[float, float] | None:
        """Return (s, v) of `dt` s ago, at most the last step; None if the profile has begun later, or there
        is none.
        """
        if self._resting == _AT_REST:
            return self.s, self.v
        time = self._time - dt
        if time < -_ROUNDING:
            return None
        index = self._index
        pieces = self._pieces
        while index and pieces[index][0] > time:
            index -= 1
        start, way, v, a, half, _, half_jerk, sixth = pieces[index]
        s = self.target if index == len(pieces) - 1 and self.positioning else self._base + way
        x = time - start
        return s + x * (v + x * (half + x * sixth)), v + x * (a + x * half_jerk)

    @property
    def phase(self) -> MotionPhase:
        """What the magnitude of the velocity does in the present cycle."""
        _, _, _, a, _, jerk, _, _ = self._piece
        if self._time > 0.0:
            a = self.a
        tendency = a or jerk  # an acceleration of zero between two phases counts as what follows
        if tendency == 0.0:
            return MotionPhase.CONSTANT
        return MotionPhase.DECELERATING if tendency * self.v < 0.0 else MotionPhase.ACCELERATING

    @property
    def overshoots(self) -> bool:
        """Whether the way to the target position still leaves the range between the start and the target."""
        return self._time < self._astray_until

    @property
    def remaining_time(self) -> float:
        """Time to the end of the profile, s; 0.0 when it has been reached."""
        return 0.0 if self.done else self._pieces[-1][0] - self._time

    def _take(self, profile: Profile, target: float, jerk: float, *, positioning: bool) -> None:
        """Make `profile`, which starts at the present position, the active one."""
        self._pieces = profile.pieces
        self._ends = profile.ends
        self._base = self.s
        self.jerk = jerk
        self._time = self._begun = self._astray_until = 0.0
        self._steps = 0
        self._index = 0
        self.positioning = positioning
        self.target = target
        self._seek(0.0)

    def _seek(self, time: float) -> None:
        """Make the piece of `time`, which never lies before the present one, the present one."""
        self._resting = _MOVING
        index = self._index
        ends = self._ends
        reached = time + _ROUNDING
        while reached >= ends[index]:
            index += 1
        self._index = index
        self._until = ends[index] - _ROUNDING
        start, way, v, a, half, jerk, half_jerk, sixth = self._pieces[index]
        self.done = done = index == len(ends) - 1
        s = self.target if done and self.positioning else self._base + way
        self._piece = (start, s, v, a, half, jerk, half_jerk, sixth)
