"""A setpoint of an axis: what every stage of the chain between a job and the drive gives to the next one."""

from __future__ import annotations

from abc import abstractmethod


class Setpoint:
    """Position, velocity and acceleration of the present cycle, and a look ahead."""

    __slots__ = ("a", "s", "v")

    s: float
    """Position setpoint, position unit."""
    v: float
    """Velocity setpoint, position unit/s."""
    a: float
    """Acceleration setpoint, position unit/s2."""

    @property
    @abstractmethod
    def done(self) -> bool:
        """Whether it has arrived: at its position, or at its constant velocity."""

    @abstractmethod
    def peek(self, dt: float) -> tuple[float, float, float]:
        """Return (s, v, a) as they will be after `dt` s, without advancing."""

    @abstractmethod
    def before(self, dt: float) -> tuple[float, float] | None:
        """Return (s, v) of `dt` s ago, at most the last step; None where that is not known."""
