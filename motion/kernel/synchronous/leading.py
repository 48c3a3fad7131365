"""The leading value of one coupling: what a leading object gives, counted on over its modulo range, with what
the following axis adds to it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from motion.kernel.synchronous.additive import AdditiveValue

if TYPE_CHECKING:
    from motion.kernel.leading_value import Value
    from motion.kernel.synchronous.shift import Shift


class LeadingMotion:
    """The value of a leading object as a following axis takes it (SYN-020).

    ```
    value of the object -> + additive value = effective value -> + phase shift = what the function gets
    ```

    The value is given over the modulo range of its object, so that nothing steps at its edge (SYN-024).

    Args:
        value: Returns the setpoint, the delayed setpoint or the extrapolated actual value of this cycle.
        valid: Returns whether that is a value to follow.
        positions: Returns whether the object has positions that can be followed; None: it always has.
        additive: What the following axis adds to every leading value; None: nothing.
        tolerance: Way back that counts as none while the axis comes to its function or leaves it, position
            unit of the leading object (SYN-074).

    """

    def __init__(
        self,
        value: Callable[[], Value],
        valid: Callable[[], bool],
        *,
        positions: Callable[[], bool] | None = None,
        additive: AdditiveValue | None = None,
        tolerance: float = 0.0,
    ) -> None:
        self._value = value
        self._valid = valid
        self.positions = positions
        """Returns whether the leading object has positions that can be followed; None: it always has."""
        self._additive = additive or AdditiveValue()
        self._tolerance = tolerance
        self.sense = 0.0
        """Direction in which the axis comes to its function or leaves it; 0: it does neither, and every way
        back counts.
        """
        self.phase: Shift | None = None
        """Phase shift, position unit of the leading object; None: there has been none."""
        self.valid = valid()
        """Whether the leading object gives a value; False ends the coupling with alarm 601."""
        self.given = value()[0]
        """What the leading object gave in this cycle, its position unit."""
        self.effective_position = self.given + self._additive.position
        """Effective leading position, position unit of the leading object."""
        self.effective_velocity = 0.0
        """Its velocity, position unit per second."""
        self.effective_acceleration = 0.0
        """Its acceleration, position unit per second squared."""
        self.effective_increment = 0.0
        """Its way of the last cycle, position unit."""
        self.position = self.effective_position
        """Leading position that the function gets: the effective one and the phase shift."""
        self.velocity = 0.0
        """Its velocity, position unit per second."""
        self.acceleration = 0.0
        """Its acceleration, position unit per second squared."""
        self.increment = 0.0
        """Its way of the last cycle, position unit."""

    def step(self) -> None:
        """Take the value of this cycle over; the leading object has been calculated before.

        A value that is not valid is not taken: position and velocity stay as they were.
        """
        self.valid = self._valid()
        if not self.valid:
            self.increment = self.effective_increment = 0.0
            return
        position, velocity, acceleration = self._value()
        self.given = position
        additive = self._additive
        if additive.owner is not None:
            position += additive.position
            velocity += additive.velocity
            acceleration += additive.acceleration
        self.effective_increment = increment = position - self.effective_position
        self.effective_position = position
        self.effective_velocity, self.effective_acceleration = velocity, acceleration
        phase = self.phase
        if phase is not None:
            phase.step(position, increment, velocity, acceleration)
            position += phase.value
            velocity += phase.velocity
            acceleration += phase.acceleration
        if self._tolerance > 0.0 and 0.0 < self.sense * (self.position - position) <= self._tolerance:
            self.increment = self.velocity = self.acceleration = 0.0
            return  # held at its extreme value
        self.increment = position - self.position
        self.position, self.velocity, self.acceleration = position, velocity, acceleration
