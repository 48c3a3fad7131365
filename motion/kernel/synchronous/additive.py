"""The additive leading value of an axis (SYN section 7.7)."""

from __future__ import annotations


class AdditiveValue:
    """What is added to every leading value that an axis follows; it belongs to the axis, not to a job
    (SYN-223, SYN-439).
    """

    def __init__(self) -> None:
        self.owner: object | None = None
        """Who gives it; None: it is 0."""
        self.position = 0.0
        """Position unit of the leading object."""
        self.velocity = 0.0
        """Position unit per second."""
        self.acceleration = 0.0
        """Position unit per second squared."""

    def give(self, owner: object, position: float, velocity: float, acceleration: float) -> None:
        """Let `owner`, and nobody else any more, give the value."""
        self.owner = owner
        self.position, self.velocity, self.acceleration = position, velocity, acceleration

    def end(self, owner: object) -> None:
        """Set it to 0 at once, where `owner` still gives it."""
        if self.owner is owner:
            self.give(None, 0.0, 0.0, 0.0)
