"""The leading value of one coupling: position, velocity and acceleration of the leading axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from motion.kernel.servo_axis import ServoAxis


class LeadingMotion:
    """The setpoints of a leading axis as a following axis takes them (SYN-020, coupling type "setpoint").

    Setpoints are counted on over the modulo range of their axis, so that nothing steps at its edge (SYN-024).

    Args:
        leader: The leading axis in the kernel.

    """

    def __init__(self, leader: ServoAxis) -> None:
        self.leader = leader
        self.position = leader.total.s
        """Leading position, position unit of the leading axis."""
        self.velocity = 0.0
        """Its velocity, position unit per second."""
        self.acceleration = 0.0
        """Its acceleration, position unit per second squared."""
        self.increment = 0.0
        """Way of the last cycle, position unit."""

    def step(self) -> None:
        """Take the value of this cycle over; the leading axis has been calculated before."""
        leader = self.leader
        total = leader.total
        self.increment = total.s - self.position
        self.position = total.s
        if leader.controlled:
            self.velocity, self.acceleration = total.v, total.a
        else:  # the setpoint follows the actual value (SYN-294)
            self.velocity, self.acceleration = leader.actual_velocity, 0.0
