"""Absolute synchronous operation: positions keep a function of the leading value, a gear or a cam."""

from __future__ import annotations

from enum import IntEnum
from math import ceil, copysign, floor, inf
from typing import TYPE_CHECKING, Final, Protocol

from motion.kernel.cams import ScaledCurve
from motion.kernel.synchronous.ways import DistanceWay, TimeWay, Values
from motion.setpoint import Profile, plan_meeting

if TYPE_CHECKING:
    from motion.kernel.modulo import Modulo
    from motion.kernel.synchronous.leading import LeadingMotion

_PLACE: Final = 1e-6
"""Position units and their derivatives up to which an axis counts as being at its synchronous position."""
_ROUNDING: Final = 1e-9
"""Position units by which a leading value may lie before a place and counts as having reached it."""
_REFINEMENTS: Final = 4
"""Recalculations of the profile from where the axis will be when it starts."""
_EITHER: Final = 3


class Function(Protocol):
    """Following value of a leading value."""

    def evaluate(self, x: float) -> Values:
        """Return the following value and its first two derivatives."""

    def follow(self, x: float) -> tuple[float, float, float, int]:
        """Return what `evaluate` and `cycle` do; called in every cycle of a following axis."""

    def cycle(self, x: float) -> int:
        """Return the number of the run in which `x` lies, 0 for the first and for what is no cycle."""


class Line:
    """Function of a gear: `y + numerator * (x' - x) / denominator`, evaluated from its anchor (SYN-118)."""

    def __init__(self, numerator: int, denominator: int, x: float, y: float) -> None:
        self._numerator = numerator
        self._denominator = denominator
        self._ratio = numerator / denominator
        self._x = x
        self._y = y

    def evaluate(self, x: float) -> Values:
        """Return the following value and its first two derivatives."""
        return self._y + self._numerator * (x - self._x) / self._denominator, self._ratio, 0.0

    def follow(self, x: float) -> tuple[float, float, float, int]:
        """Return what `evaluate` and `cycle` do."""
        return self._y + self._numerator * (x - self._x) / self._denominator, self._ratio, 0.0, 0

    def cycle(self, x: float) -> int:  # noqa: ARG002 - a line has no runs
        """Return 0."""
        return 0


class Entry(IntEnum):
    """How the axis comes to its function."""

    DYNAMIC = 0
    """In advance, with the dynamic values of the job (SYN-123)."""
    ADVANCE = 1
    """In advance, over a distance of the leading value that ends at the synchronous position (SYN-156)."""
    SUBSEQUENT = 2
    """Over a distance that begins at the synchronous position (SYN-158)."""
    FROM_HERE = 3
    """Over a distance that begins at the present leading value (CAM-128)."""
    AHEAD = 4
    """Over a distance from the present leading value on to the synchronous position (CAM-130)."""
    DIRECT = 5
    """At once: the synchronous position is where both axes are (CAM-126)."""
    AT_END = 6
    """At once, at the end of the active cam or its present run (CAM-129)."""
    IN_PLACE = 7
    """At once, as soon as the axis is on its function; nothing moves it there (CAM-131)."""


class FunctionCoupling:
    """A following axis that comes to a function of the leading value and keeps it.

    Args:
        leading: Leading value; `due` and `step` call its `step`, once in a cycle.
        function: The function, in the coordinates of the axes.
        entry: How the axis comes to it.
        x: Synchronous position, leading position unit.
        distance: Length of synchronising in the leading value, above 0; where `entry` has one.
        ends: Lowest and highest leading value of a function that ends there; None for one without end.
        leading_modulo: Modulo range of the leading object.
        modulo: Modulo range of the following axis.
        direction: In which the following axis may synchronise, with a modulo range: 1 positive, 2 negative,
            3 either (SYN-154).
        former: The coupling whose end `AT_END` waits for.

    """

    def __init__(
        self,
        leading: LeadingMotion,
        function: Function,
        entry: Entry,
        *,
        x: float,
        leading_modulo: Modulo,
        modulo: Modulo,
        distance: float = 0.0,
        ends: tuple[float, float] | None = None,
        direction: int = _EITHER,
        former: FunctionCoupling | None = None,
    ) -> None:
        self.leading = leading
        self.by_velocity = False
        self.function = function
        self._entry = entry
        self._x_sync = x
        self._distance = distance
        self._low, self._high = ends or (-inf, inf)
        self._leading_modulo = leading_modulo
        self._modulo = modulo
        self._direction = direction if modulo.enabled else _EITHER
        self._former = former
        self._start = leading.position
        self._stepped = False
        self._known = False
        self._velocity = 0.0
        # -- from the start of synchronising on
        self._gate = 0.0
        self._fraction = 0.0
        self._cycle_s = 0.0
        self._limits = (0.0, 0.0, 0.0, 0.0, 0.0)
        self._margin: float | None = None
        self._end = 0.0
        self._way: DistanceWay | None = None
        self._profile: TimeWay | None = None
        self._time = 0.0
        self._tangent = (0.0, 0.0)
        self._sense = 0.0
        self._first = 0.0
        self._shift = 0.0
        self._begun = False
        self._run = 0
        self.base_x = 0.0
        """Leading position at which the function has its zero: modulo ranges, or the shift of a direct
        entry.
        """
        self.base_y = 0.0
        """The same of the following position."""
        self.passes = 0
        """How often the end of a cyclic function has been passed, or its start in negative direction."""
        self.synchronous = False
        self.reversed = False
        self.ended = False
        self.s = 0.0
        self.v = 0.0
        self.a = 0.0
        self.slope = 0.0
        self.curvature = 0.0

    @property
    def shown_offsets(self) -> tuple[float, float]:
        """Shifts of leading and following values, with what a direct entry has added, without whole modulo
        ranges (SYN-038, CAM-238).
        """
        function = self.function
        x, y = (
            (function.master_offset, function.slave_offset)
            if isinstance(function, ScaledCurve)
            else (0.0, 0.0)
        )
        following = self._modulo
        added = self.base_y - self._shift
        turns = round(added / following.length) * following.length if following.enabled else 0.0
        return x + self.base_x - self._turns(self.base_x), y + added - turns

    # -- waiting

    def due(
        self,
        cycle_s: float,
        state: tuple[float, float, float],
        limits: tuple[float, float, float, float, float],
    ) -> bool:
        """Take the leading value of this cycle over, and return whether the axis starts in it; see
        `Waiting.due`.
        """
        leading = self.leading
        before = self._velocity
        leading.step()
        self._stepped = True
        self._velocity = leading.velocity
        if not self._known:
            self._known = True
            before = leading.velocity
        self._cycle_s, self._limits = cycle_s, limits
        entry = self._entry
        if entry is Entry.AT_END:
            return self._former_ends()
        now, increment = leading.position, leading.increment
        last = now - increment
        if entry is Entry.DIRECT:
            self.base_x = last - self._x_sync
            return self._arrive()
        if self._in_place(last, state, before):
            return self._arrive()
        if increment == 0.0 or entry is Entry.IN_PLACE:
            return False
        sense = copysign(1.0, increment)
        if entry is Entry.DYNAMIC:
            return self._profile_fits(last, increment, sense, state)
        gate = self._x_sync
        if entry is Entry.ADVANCE:
            gate -= sense * self._distance
        elif entry is not Entry.SUBSEQUENT:
            gate = self._start
        turns = 0.0 if entry in (Entry.FROM_HERE, Entry.AHEAD) else self._passed(gate, last, now, sense)
        if turns is None:
            return False
        self._sense = sense
        self._gate = gate + turns
        self._fraction = min(max((self._gate - last) / increment, 0.0), 1.0)
        self._end = self._gate + sense * self._distance
        if entry is Entry.AHEAD:
            self.base_x = self._end - self._x_sync
        elif entry is Entry.FROM_HERE:
            self.base_x = self._turns(gate - self._leading_modulo.wrap(gate))
        else:
            self.base_x = turns
        return True

    def _arrive(self) -> bool:
        self.synchronous = True
        return True

    def _turns(self, distance: float) -> float:
        """Return the whole modulo ranges of the leading value that are nearest to `distance`."""
        modulo = self._leading_modulo
        return round(distance / modulo.length) * modulo.length if modulo.enabled else 0.0

    def _in_place(self, x: float, state: tuple[float, float, float], velocity: float) -> bool:
        """Return whether both axes are at their synchronous positions already (SYN-159, SYN-416, CAM-242)."""
        entry = self._entry
        if entry is Entry.AHEAD:
            return False
        if entry in (Entry.FROM_HERE, Entry.IN_PLACE):
            base = self._turns(x - self._leading_modulo.wrap(x))
            wanted = x - base
            if not self._low <= wanted <= self._high:
                return False
        else:
            base = self._turns(x - self._x_sync)
            wanted = self._x_sync
            if abs(x - base - wanted) > _PLACE:
                return False
        y, slope, _ = self.function.evaluate(wanted)
        s, v, _ = state
        modulo = self._modulo
        turns = round((s - y) / modulo.length) * modulo.length if modulo.enabled else 0.0
        if abs(s - y - turns) > _PLACE or abs(v - slope * velocity) > _PLACE:
            return False
        self.base_x, self.base_y = base, turns
        return True

    def _passed(self, gate: float, last: float, now: float, sense: float) -> float | None:
        """Return the modulo ranges with which `gate` is reached within this cycle; None: it is not."""
        modulo = self._leading_modulo
        if not modulo.enabled:
            reached = sense * (gate - last) >= -_ROUNDING and sense * (now - gate) >= -_ROUNDING
            return 0.0 if reached else None
        length = modulo.length
        count = sense * (last - gate) / length
        turns = sense * ceil(count - _ROUNDING) * length
        return turns if sense * (now - gate - turns) >= -_ROUNDING else None

    def _former_ends(self) -> bool:
        """Return whether the former cam comes to the end of its run in this cycle (CAM-136)."""
        former = self._former
        if former is None:
            return False
        # What shifts the leading value of the former cam ends with it; its own leading value has not been
        # stepped yet.
        before, increment = former.leading.position, self.leading.increment
        edge = former.edge(before + increment, increment)
        if edge is None:
            return False
        x, y = edge
        self.base_x = x - (before - self.leading.position + increment) - self._x_sync
        self.base_y = y - self.function.evaluate(self._x_sync)[0]
        return self._arrive()

    def edge(self, x: float, increment: float) -> tuple[float, float] | None:
        """Return leading and following position of the end of the present run that the leading value passes
        with the way `increment` to `x`; None: it passes none.
        """
        if increment == 0.0 or not self.synchronous:
            return None
        function, low, high = self.function, self._low, self._high
        local, last = x - self.base_x, x - increment - self.base_x
        if low > -inf:
            if increment > 0.0:
                place = high
                passed = last < high and local >= high - _ROUNDING
            else:
                place = low
                passed = last > low and local <= low + _ROUNDING
            return (place + self.base_x, function.evaluate(place)[0] + self.base_y) if passed else None
        if function.cycle(local) == function.cycle(last):
            return None
        inside, beyond = last, local
        for _ in range(60):  # the place within this cycle, by halves
            middle = 0.5 * (inside + beyond)
            if function.cycle(middle) == function.cycle(last):
                inside = middle
            else:
                beyond = middle
        return beyond + self.base_x, function.evaluate(inside)[0] + self.base_y

    def _profile_fits(
        self, last: float, increment: float, sense: float, state: tuple[float, float, float]
    ) -> bool:
        """Return whether the time-optimal profile has to begin within this cycle, so that both axes reach
        their synchronous positions together.
        """
        speed = abs(self.leading.velocity)
        target = self.function.evaluate(self._x_sync)
        end_velocity = target[1] * self.leading.velocity
        if speed == 0.0 or abs(end_velocity) > self._limits[4]:
            self._margin = None
            return False
        cycle_s, (s, v, a) = self._cycle_s, state
        start = 0.0
        for _ in range(_REFINEMENTS):
            s0 = s + start * (v + 0.5 * a * start)
            duration = self._plan(s0, v + a * start, a, target[0], end_velocity).duration
            turns, margin = self._ahead(last, sense, speed * duration)
            before = start
            start = min(max(margin / speed, 0.0), cycle_s)
            if abs(start - before) <= _ROUNDING * cycle_s:
                break
        previous, self._margin = self._margin, margin
        late = margin < 0.0 and previous is not None and previous >= 0.0
        if not -_ROUNDING <= margin <= abs(increment) + _ROUNDING and not late:
            return False
        self._sense = sense
        self._fraction = start / cycle_s
        self._gate = last + increment * self._fraction
        self.base_x = turns
        self._end = self._x_sync + turns
        return True

    def _ahead(self, last: float, sense: float, length: float) -> tuple[float, float]:
        """Return the modulo ranges of the next synchronous position that is at least `length` away, and what
        is left until synchronising has to begin.
        """
        margin = sense * (self._x_sync - last) - length
        modulo = self._leading_modulo
        if not modulo.enabled:
            return 0.0, margin
        count = -floor((margin + _ROUNDING) / modulo.length)
        return sense * count * modulo.length, margin + count * modulo.length

    def _plan(self, s: float, v: float, a: float, y: float, end_velocity: float) -> Profile:
        velocity, acceleration, deceleration, jerk, _ = self._limits
        target = self._modulo.target(y, s, self._direction)
        return plan_meeting(
            target - s, v, a, end_velocity,
            max_velocity=velocity, acceleration=acceleration, deceleration=deceleration, jerk=jerk,
        )  # fmt: skip

    # -- in control

    def begin(self, s: float, v: float, a: float) -> None:
        """Start from the setpoints of the following axis one cycle ago."""
        self._begun = True
        self.s, self.v, self.a = s, v, a
        if self.synchronous:
            if self._entry is Entry.DIRECT:
                self.base_y = s - self.function.evaluate(self._x_sync)[0]
            elif self._entry is Entry.AT_END and self._former is not None:
                self.base_y += s - self._former.s  # an offset ends with the former cam, without a step
            self._run = self.function.cycle(self.leading.position - self.leading.increment - self.base_x)
            return
        self.leading.sense = self._sense
        ahead = self._fraction * self._cycle_s
        s += ahead * (v + 0.5 * a * ahead)
        v += ahead * a
        self._first = s
        leading = self.leading
        y, slope, curvature = self.function.evaluate(self._end - self.base_x)
        target = self._modulo.target(y, s, self._direction)
        self.base_y = target - y
        if self._entry is Entry.DYNAMIC:
            profile = self._plan(s, v, a, y, slope * leading.velocity)
            missing = s - target - slope * (self._gate - self._end)
            self._profile = TimeWay(
                profile, missing + profile.distance - profile.end_velocity * profile.duration
            )
            self._time = -ahead
            self._tangent = (target, slope)
            return
        # The leading velocity at the gate: that of this cycle, less what it has gained since.
        velocity = leading.velocity - leading.acceleration * (self._cycle_s - ahead)
        if abs(velocity) > _PLACE:
            first = v / velocity
            second = (a - first * leading.acceleration) / (velocity * velocity)
        else:
            first = second = 0.0
        self._way = DistanceWay(self._gate, self._end, (s, first, second), (target, slope, curvature))

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system of the following axis, position unit."""
        if self._begun:
            self.s += offset
            self.base_y += offset
            self._shift += offset

    def step(self, cycle_s: float, maximum: float, limits: tuple[float, float, float]) -> None:  # noqa: ARG002 - those of the start
        """Go on by one cycle; the limits are those of the start but for `maximum`, the highest velocity at
        which a profile of time may end (SYN-104).
        """
        leading = self.leading
        if self._stepped:
            self._stepped = False
        else:
            leading.step()
        if self.ended:
            return
        x = leading.position
        if not self.synchronous:
            if leading.increment * self._sense < 0.0:
                self.reversed = True
                return
            if not self._approach(cycle_s, x, maximum):
                return
            self.synchronous = True
            leading.sense = 0.0
            self._run = self.function.cycle(x - self.base_x)
        local = x - self.base_x
        if not self._low < local < self._high and self._at_end(local, leading.increment):
            return
        y, slope, curvature, run = self.function.follow(local)
        if run != self._run:
            self._run = run
            self.passes += 1
        velocity = leading.velocity
        self.s = y + self.base_y
        self.v = slope * velocity
        self.a = curvature * velocity * velocity + slope * leading.acceleration
        self.slope, self.curvature = slope, curvature

    def _approach(self, cycle_s: float, x: float, maximum: float) -> bool:
        """Go on towards the function; returns whether it has been reached."""
        leading, way, profile = self.leading, self._way, self._profile
        velocity, acceleration = leading.velocity, leading.acceleration
        if way is not None:
            if way.passed(x):
                return True
            y, slope, curvature = way.evaluate(x)
            self.s = y + self._shift
            self.v = slope * velocity
            self.a = curvature * velocity * velocity + slope * acceleration
        elif profile is not None:
            self._time += cycle_s
            beyond = self._sense * (x - self._end) >= -_ROUNDING
            if beyond:
                y, slope, curvature = self.function.evaluate(x - self.base_x)
                y += self.base_y
            else:
                y, slope = self._tangent
                y, curvature = y + slope * (x - self._end) + self._shift, 0.0
            ended = profile.passed(self._time)
            if ended and beyond and abs(slope * velocity) <= maximum * (1.0 + _ROUNDING):
                return True
            s, v, a = profile.added(max(self._time, 0.0))
            self.s = y + s
            self.v = slope * velocity + v
            self.a = curvature * velocity * velocity + slope * acceleration + a
        if self._direction != _EITHER:
            wrong = (
                self._first + self._shift - self.s
                if self._direction == 1
                else self.s - self._first - self._shift
            )
            self.reversed = wrong > _PLACE
        return False

    def _at_end(self, local: float, increment: float) -> bool:
        """End the function where it ends in the direction of the leading value (CAM-106, CAM-111)."""
        if increment > 0.0 and local >= self._high:
            place = self._high
        elif increment < 0.0 and local <= self._low:
            place = self._low
        else:
            return False
        self.ended = True
        self.passes += 1
        self.s, self.v, self.a = self.function.evaluate(place)[0] + self.base_y, 0.0, 0.0
        return True
