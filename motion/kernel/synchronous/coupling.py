"""What every synchronous function offers to the axis that it moves."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from motion.kernel.synchronous.leading import LeadingMotion


class Coupling(Protocol):
    """A following axis and its leading value."""

    leading: LeadingMotion
    by_velocity: bool
    """The velocities alone keep the relation."""
    synchronous: bool
    """The axis has reached its leading value."""
    reversed: bool
    """The leading value has turned round before its time, or the axis would move the wrong way (SYN-127,
    SYN-128).
    """
    ended: bool
    """The function has come to its end; the axis stands at `s`."""
    s: float
    """Position of the following axis, its position unit."""
    v: float
    """Its velocity, position unit per second."""
    a: float
    """Its acceleration, position unit per second squared."""
    slope: float
    """Derivative of the position by the leading position; of a synchronous axis."""
    curvature: float
    """Its second derivative."""
    base_x: float
    """Leading position at which the function of positions has its zero; of a synchronous axis."""
    base_y: float
    """The same of the following position."""

    def begin(self, s: float, v: float, a: float) -> None:
        """Start from the present setpoints of the following axis."""

    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system of the following axis, position unit."""

    def step(self, cycle_s: float, maximum: float, limits: tuple[float, float, float]) -> None:
        """Go on by one cycle, s, within the highest velocity and the acceleration, deceleration and jerk of
        the job, where they matter.
        """


class Waiting(Coupling, Protocol):
    """A coupling whose start waits for the leading value."""

    def due(
        self,
        cycle_s: float,
        state: tuple[float, float, float],
        limits: tuple[float, float, float, float, float],
    ) -> bool:
        """Take the leading value of this cycle over, and return whether the axis starts to synchronise in it.

        Args:
            cycle_s: Cycle, s.
            state: Position, velocity and acceleration of the following axis, one cycle ago.
            limits: Velocity, acceleration, deceleration and jerk of the job, and the velocity that the
                axis may have at the end.

        """


class Leaving(Coupling, Protocol):
    """A coupling that ends a synchronous motion, from a place on its way on."""

    def due(
        self,
        cycle_s: float,
        coupling: Coupling,
        before: tuple[float, float, float],
        slopes: tuple[float, float],
        added: tuple[float, float, float],
    ) -> bool:
        """Return whether the axis has to leave its leading value within this cycle, for which `coupling` has
        been stepped already.

        Args:
            cycle_s: Cycle, s.
            coupling: The synchronous function in control.
            before: Its position, velocity and acceleration one cycle ago.
            slopes: Its `slope` and `curvature` one cycle ago.
            added: What superimposed motions add to position, velocity and acceleration.

        """
