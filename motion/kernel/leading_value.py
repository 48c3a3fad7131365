"""What an object gives to others that follow it: the extrapolated actual value, and the delayed setpoint (SYN
sections 3.3, 3.4).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import copysign
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motion.kernel.cell import Cell
    from motion.kernel.feedback import Feedback

Value = tuple[float, float, float]
"""Position, velocity and acceleration, axis units and s."""


class _SecondOrder:
    """Two low-passes of first order in series, by backward differences; a time of 0 passes the input on."""

    def __init__(self, value: float) -> None:
        self._first = self.output = value

    def step(self, value: float, first_s: float, second_s: float, cycle_s: float) -> float:
        self._first += cycle_s / (first_s + cycle_s) * (value - self._first)
        self.output += cycle_s / (second_s + cycle_s) * (self._first - self.output)
        return self.output


def within_band(last: float, value: float, width: float) -> float:
    """Return `last` while `value` lies within a band of `width` around it, else the
    value less half the band (SYN-064).
    """
    difference = value - last
    half = 0.5 * width
    return last if abs(difference) <= half else value - copysign(half, difference)


class Hysteresis:
    """Lets a reversal pass when it is as large as the hysteresis (SYN-065)."""

    def __init__(self, value: float) -> None:
        self.output = value
        self._direction = 0.0

    def step(self, value: float, width: float) -> float:
        """Return the output for `value`."""
        change = value - self.output
        if change != 0.0 and (change * self._direction >= 0.0 or abs(change) >= width):
            self._direction = copysign(1.0, change)
            self.output = value
        return self.output


@dataclass(frozen=True, kw_only=True)
class Extrapolation:
    """How the actual value is extrapolated for followers; the cells in s, position
    unit per second, position unit.

    Args:
        system_defined: The time of the leading axis counts as well, and the position filter acts.
        differentiates: The velocity is the change of the extrapolated position, not the filtered velocity.
        delay_s: Delay of the setpoint that local followers get, s.
        following_s: Time that the followers add, s.
        position_t1: First time of the position filter.
        position_t2: Second time of the position filter.
        velocity_t1: First time of the velocity filter.
        velocity_t2: Second time of the velocity filter.
        tolerance: Band of velocities that count as one.
        hysteresis: Way back that counts as none.

    """

    system_defined: bool
    differentiates: bool
    delay_s: float
    following_s: Cell[float]
    position_t1: Cell[float]
    position_t2: Cell[float]
    velocity_t1: Cell[float]
    velocity_t2: Cell[float]
    tolerance: Cell[float]
    hysteresis: Cell[float]


class LeadingValue:
    """What following axes get from an object: its delayed setpoint or its extrapolated actual value.

    Without filters, band, hysteresis and delay everything follows from the present values and `step` need not
    be called.

    Args:
        settings: How the actual value is extrapolated.
        cycle_s: Application cycle, s.
        acquisition_s: T_i, the age of an actual value, s.
        feedback: Returns the encoder that measures the object.
        setpoint: Returns the value that is given to local followers without a delay.

    """

    def __init__(
        self,
        settings: Extrapolation,
        *,
        cycle_s: float,
        acquisition_s: float,
        feedback: Callable[[], Feedback],
        setpoint: Callable[[], Value],
    ) -> None:
        self._cycle = cycle_s
        self._acquisition = acquisition_s
        self._feedback = feedback
        self._setpoint = setpoint
        self._leading = settings.system_defined
        self._differentiates = settings.differentiates
        self._delay = settings.delay_s
        self._following = settings.following_s
        self._cells = (
            settings.position_t1,
            settings.position_t2,
            settings.velocity_t1,
            settings.velocity_t2,
            settings.tolerance,
            settings.hysteresis,
        )
        self._filter: _SecondOrder | None = None
        self._velocity_filter = _SecondOrder(0.0)
        self._hysteresis = Hysteresis(0.0)
        self._band = self._velocity = self._last = 0.0
        depth = int(self._delay / cycle_s) + 2
        self._past: deque[Value] = deque(maxlen=depth)

    def in_use(self) -> LeadingValue | None:
        """Return itself if `step` has to be called in every cycle, else None; to be
        asked when variables have changed.
        """
        if self._differentiates or self._delay > 0.0 or any(cell.value > 0.0 for cell in self._cells):
            return self
        self._filter = None
        return None

    def step(self) -> None:
        """Take over the actual value and the setpoint of this cycle."""
        if self._delay > 0.0:
            self._past.append(self._setpoint())
        feedback = self._feedback()
        first, second, velocity_first, velocity_second, band, hysteresis = (
            cell.value for cell in self._cells
        )
        position, velocity = feedback.position, feedback.velocity
        cycle = self._cycle
        if self._filter is None:
            self._filter = _SecondOrder(position)
            self._velocity_filter = _SecondOrder(velocity)
            self._band = velocity
            self._hysteresis = Hysteresis(position + velocity * self.time_s)
            self._last = self._hysteresis.output
        if not self._leading:
            first = second = 0.0
        filtered = self._filter.step(position, first, second, cycle)
        self._band = within_band(
            self._band, self._velocity_filter.step(velocity, velocity_first, velocity_second, cycle), band
        )
        extrapolated = self._hysteresis.step(filtered + self._band * self.time_s, hysteresis)
        self._velocity = (extrapolated - self._last) / cycle
        self._last = extrapolated

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system."""
        self._filter = None
        self._past = deque(((s + offset, v, a) for s, v, a in self._past), self._past.maxlen)

    # -- what the data block shows
    # ----------------------------------------------------------------------------

    @property
    def leading_time_s(self) -> float:
        """`Extrapolation.LeadingAxisDependentTime`: T_i + T_ipo + T1 + T2 of
        the position filter, s (SYN-052).
        """
        first, second = self._cells[0].value, self._cells[1].value
        return float(self._acquisition + self._cycle + first + second)

    @property
    def time_s(self) -> float:
        """Time by which the actual value is extrapolated, s (SYN-066, VAR-189)."""
        following: float = self._following.value
        return following + self.leading_time_s if self._leading else following

    @property
    def filtered_position(self) -> float:
        """`StatusExtrapolation.FilteredPosition`, axis unit."""
        return self._feedback().position if self._filter is None else self._filter.output

    @property
    def filtered_velocity(self) -> float:
        """`StatusExtrapolation.FilteredVelocity`, axis unit per second."""
        return self._feedback().velocity if self._filter is None else self._band

    @property
    def position(self) -> float:
        """`StatusExtrapolation.ExtrapolatedPosition`, axis unit."""
        if self._filter is not None:
            return self._last
        return self.filtered_position + self.filtered_velocity * self.time_s

    @property
    def velocity(self) -> float:
        """`StatusExtrapolation.ExtrapolatedVelocity`, axis unit per second (SYN-067)."""
        return self._velocity if self._differentiates and self._filter is not None else self.filtered_velocity

    def extrapolated(self) -> Value:
        """Return what followers of the actual value get: position, velocity, no acceleration.

        The second difference of an actual value is noise; the followers get its acceleration with the next
        velocity (SYN-020, SYN-067).
        """
        return self.position, self.velocity, 0.0

    def delayed(self) -> Value:
        """Return the setpoint of `LocalLeadingValueDelayTime` ago (SYN-070, VAR-121)."""
        past = self._past
        if not past or self._delay <= 0.0:
            return self._setpoint()
        cycles = self._delay / self._cycle
        whole = int(cycles + 1e-9)
        rest = max(0.0, cycles - whole)
        newest = len(past) - 1 - whole
        after = past[max(newest, 0)]
        before = past[max(newest - 1, 0)]
        position, velocity, acceleration = (b + (a - b) * rest for a, b in zip(before, after, strict=True))
        return position, velocity, acceleration
