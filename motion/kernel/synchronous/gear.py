"""Relative and velocity gearing: the velocities are brought together; from then on the positions keep their
relation, or the velocities alone.
"""

from __future__ import annotations

from math import copysign
from typing import TYPE_CHECKING, Final

from motion.setpoint import SetpointGenerator

if TYPE_CHECKING:
    from motion.kernel.synchronous.leading import LeadingMotion

_LEAST_SHARE: Final = 1e-6
"""Part of the permitted acceleration that is left where the leading axis needs all of it."""


class GearCoupling:
    """A following axis with a gear ratio to its leading value.

    The following axis takes over velocity and acceleration of the leading value, times the ratio, with the
    dynamic values of its job (SYN-145). From that cycle on its position is `y_a + N * (x - x_a) / D`. It is
    evaluated from the point where both came together and never summed up (SYN-118, SYN-119).

    Args:
        leading: Leading value; `step` calls its `step`.
        numerator: N, not 0; below 0 the axis moves the other way.
        denominator: D, above 0.
        by_velocity: The velocities alone keep the relation: positions are not compared, and the leading value
            may turn round at any time (SYN-169, SYN-410, SYN-421).

    """

    def __init__(
        self, leading: LeadingMotion, numerator: int, denominator: int, *, by_velocity: bool = False
    ) -> None:
        self.leading = leading
        self.by_velocity = by_velocity
        self._numerator = numerator
        self._denominator = denominator
        self._ratio = numerator / denominator
        self._approach = SetpointGenerator()
        self._direction = 0.0
        self.synchronous = False
        """Whether the axis has reached its leading value."""
        self.ended = False
        """Whether the function has come to its end: never."""
        self.slope = self._ratio
        """Derivative of the position by the leading position, once synchronous."""
        self.curvature = 0.0
        """Its second derivative."""
        self.base_x = 0.0
        """Leading position at which the axis reached its leading value, where positions keep the relation."""
        self.base_y = 0.0
        """The same of the following position."""
        self.reversed = False
        """Whether the leading value has turned round before the axis had reached it (SYN-127)."""
        self.s = 0.0
        """Position of the following axis, its position unit."""
        self.v = 0.0
        """Its velocity, position unit per second."""
        self.a = 0.0
        """Its acceleration, position unit per second squared."""

    def begin(self, s: float, v: float, a: float) -> None:
        """Start from the present setpoints of the following axis."""
        self.s, self.v, self.a = s, v, a

    def change_ratio(self, numerator: int, denominator: int) -> None:
        """Use another ratio from the next cycle on; for a coupling of velocities (SYN-170)."""
        self._ratio = self.slope = numerator / denominator

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system of the following axis, position unit."""
        self.s += offset
        self.base_y += offset

    def step(self, cycle_s: float, maximum: float, limits: tuple[float, float, float]) -> None:
        """Go on by one cycle.

        Args:
            cycle_s: Cycle, s.
            maximum: Highest velocity while synchronising, position unit per second; infinite for none.
            limits: Highest acceleration and deceleration while synchronising, position unit per second
                squared, above 0, and highest jerk, position unit per second cubed; 0 for none.

        """
        leading = self.leading
        leading.step()
        if not self.synchronous:
            increment = leading.increment
            if increment * self._direction < 0.0 and not self.by_velocity:
                self.reversed = True
                return
            if increment:
                self._direction = copysign(1.0, increment)
                if not self.by_velocity:
                    leading.sense = self._direction
            self._synchronise(cycle_s, maximum, limits)
            return
        before = self.v
        self.v = self._ratio * leading.velocity
        if self.by_velocity:
            self.s += 0.5 * (before + self.v) * cycle_s
        else:
            self.s = self.base_y + self._numerator * (leading.position - self.base_x) / self._denominator
        self.a = self._ratio * leading.acceleration

    def _synchronise(self, cycle_s: float, maximum: float, limits: tuple[float, float, float]) -> None:
        acceleration, deceleration, jerk = limits
        leading, approach = self.leading, self._approach
        velocity = self._ratio * leading.velocity
        growth = self._ratio * leading.acceleration
        if abs(velocity) > maximum:
            # The axis waits at its own limit until the leading value is slow enough (SYN-146).
            velocity, growth, reachable = copysign(maximum, velocity), 0.0, False
        else:
            reachable = True
        # Relative to the leading value, which is a straight line in this cycle, the axis comes to rest.
        before = velocity - growth * cycle_s
        missing = before - self.v
        if growth == 0.0:
            # The whole change at once: it may lead through zero, from one limit to the other.
            approach.set_state(0.0, self.v, self.a)
            approach.start_velocity(velocity, acceleration, deceleration, jerk)
            approach.advance(cycle_s)
            self.s += approach.s
            self.v, self.a = approach.v, approach.a
        else:
            limit = acceleration if missing * self.v >= 0.0 else deceleration
            own = max(limit - copysign(1.0, missing) * growth, _LEAST_SHARE * limit)
            approach.set_state(0.0, -missing, self.a - growth)
            approach.start_velocity(0.0, own, own, jerk)
            approach.advance(cycle_s)
            self.s += approach.s + cycle_s * (before + 0.5 * growth * cycle_s)
            self.v, self.a = approach.v + velocity, approach.a + growth
        if approach.done and reachable:
            self.synchronous = True
            leading.sense = 0.0
            self.base_x, self.base_y = leading.position, self.s
