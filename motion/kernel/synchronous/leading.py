"""The leading value of one coupling: what a leading object gives, counted on over its modulo range."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motion.kernel.leading_value import Value


class LeadingMotion:
    """The value of a leading object as a following axis takes it (SYN-020).

    The value is given over the modulo range of its object, so that nothing steps at its edge (SYN-024).

    Args:
        value: Returns the setpoint, the delayed setpoint or the extrapolated actual value of this cycle.
        valid: Returns whether that is a value to follow.

    """

    def __init__(self, value: Callable[[], Value], valid: Callable[[], bool]) -> None:
        self._value = value
        self._valid = valid
        self.valid = valid()
        """Whether the leading object gives a value; False ends the coupling with alarm 601."""
        self.position = value()[0]
        """Leading position, position unit of the leading object."""
        self.velocity = 0.0
        """Its velocity, position unit per second."""
        self.acceleration = 0.0
        """Its acceleration, position unit per second squared."""
        self.increment = 0.0
        """Way of the last cycle, position unit."""

    def step(self) -> None:
        """Take the value of this cycle over; the leading object has been calculated before.

        A value that is not valid is not taken: position and velocity stay as they were.
        """
        self.valid = self._valid()
        if not self.valid:
            self.increment = 0.0
            return
        position, self.velocity, self.acceleration = self._value()
        self.increment = position - self.position
        self.position = position
