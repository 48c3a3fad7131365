"""The axis under test in numbers: what its bench file permits, and the inputs of a case, drawn from its seed.

Velocities, ways and times of a case are shares of what the axis can do, so that the same case runs on every
machine. All of them are in the position unit of the axis, and s; `Own.given` turns a velocity into the unit
of instructions and variables.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

from hil.campaign import CaseContext
from hil.expect import golden

STOP_SHARE: Final = 0.6
"""Velocity at which stops begin, as a share of the maximum velocity."""
FAST_SHARE: Final = 0.9
"""Velocity from which it brakes, or to which it accelerates, when it is to be stopped on the way."""


@dataclass(frozen=True)
class Dynamics:
    """Acceleration, deceleration and jerk of a job, per position unit; 0 as jerk: not limited."""

    acceleration: float
    deceleration: float
    jerk: float

    @property
    def inputs(self) -> dict[str, float]:
        """Inputs of an instruction."""
        return {"Acceleration": self.acceleration, **self.braking}

    @property
    def braking(self) -> dict[str, float]:
        """Inputs of an instruction that only brakes."""
        return {"Deceleration": self.deceleration, "Jerk": self.jerk}

    def without_jerk(self) -> Dynamics:
        """Return the same without a limit of the jerk."""
        return replace(self, jerk=0.0)

    def with_jerk(self, limits: golden.ReferenceAxis) -> Dynamics:
        """Return the same with a limit of the jerk, whatever the defaults have."""
        return self if self.jerk else replace(self, jerk=0.41 * limits.maximum_jerk)

    def stop(self, velocity: float, acceleration: float = 0.0) -> golden.StopRamp:
        """Return the ramp from a velocity to rest."""
        return golden.stop_ramp(
            abs(velocity), self.deceleration, self.jerk or None, acceleration=acceleration
        )


class Own:
    """The axis under test.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self._ctx = ctx
        self._axis = ctx.axis

    @cached_property
    def golden(self) -> golden.ReferenceAxis:
        """Limits and ramp times, from the bench file."""
        return self._ctx.bench.golden(self._axis.name)

    @property
    def unit(self) -> str:
        """Unit of its position."""
        return str(self._axis.variables.unit("Position"))

    # -- velocities and ways ------------------------------------------------------------------------------

    @property
    def velocity(self) -> float:
        """Velocity at which stops begin."""
        return self.speed(STOP_SHARE)

    @property
    def fast(self) -> float:
        """A higher velocity."""
        return self.speed(FAST_SHARE)

    def speed(self, share: float) -> float:
        """Return a share of the maximum velocity."""
        return share * self.golden.maximum_velocity

    def way(self, share: float) -> float:
        """Return a distance: a share of what the axis travels in 1 s at its maximum velocity.

        Every axis can go at least as far, in either direction, from where it is switched on.
        """
        return share * self.golden.maximum_velocity

    def given(self, velocity: float) -> float:
        """Return a velocity as instructions and variables want it, in the unit of velocity of the axis."""
        return velocity / self.golden.velocity_unit

    def metres(self, way: float) -> float:
        """Return how far the machine goes when the axis goes so far, m."""
        return way * self.golden.machine_m

    def rpm(self, velocity: float) -> float:
        """Return the speed of the motor, rpm."""
        return velocity * 60.0 / self.golden.lead_mm

    def of_rpm(self, speed: float) -> float:
        """Return the velocity at a speed of the motor, rpm."""
        return speed * self.golden.lead_mm / 60.0

    def words(self, velocity: float) -> str:
        """Return a velocity in words, as it is given to an instruction."""
        unit = self._axis.variables.unit("DynamicLimits.MaxVelocity")
        return f"{self.given(velocity):.6g} {unit}"

    # -- what counts as rest ------------------------------------------------------------------------------

    @property
    def increment(self) -> float:
        """Way per increment of the encoder that controls, raw increments of its value."""
        return self.increments[0]

    @property
    def increments(self) -> tuple[float, ...]:
        """Way per increment of each encoder."""
        return tuple(abs(one.increment) for one in self._axis.object.mechanics.sensors)

    @property
    def slow(self) -> float:
        """Actual velocity that counts as rest: 0.2 % of the maximum, or two increments per cycle."""
        return max(0.002 * self.golden.maximum_velocity, 2.0 * self.increment / self.golden.cycle_s)

    @property
    def still(self) -> float:
        """Displacement that counts as rest."""
        return max(1e-4 * self.golden.maximum_velocity, 2.0 * self.increment)

    # -- inputs ---------------------------------------------------------------------------------------------

    def dynamics(self, name: str = "job", *, braking: tuple[float, float] = (0.34, 0.42)) -> Dynamics:
        """Return the dynamic values of a job, drawn from the seed of the case: none equals another one, a
        default or a limit. Where the defaults have no limit of the jerk, the job has none.

        Args:
            name: Another name gives other values.
            braking: Between which shares of the maximum deceleration; below the defaults, so that a stop with
                these brakes harder.

        """
        rng, limits = self._ctx.rng(f"dynamics {name}"), self.golden
        acceleration = limits.maximum_acceleration * float(rng.uniform(0.42, 0.49))
        deceleration = limits.maximum_deceleration * float(rng.uniform(*braking))
        jerk = limits.maximum_jerk * float(rng.uniform(0.35, 0.45))
        return Dynamics(acceleration, deceleration, jerk if limits.default_jerk else 0.0)

    def defaults(self) -> Dynamics:
        """Return the dynamic defaults, within the limits: what instructions without inputs do."""
        limits = self.golden
        return Dynamics(
            min(limits.default_acceleration, limits.maximum_acceleration),
            min(limits.default_deceleration, limits.maximum_deceleration),
            min(limits.default_jerk, limits.maximum_jerk),
        )

    def draw(self, name: str, low: float, high: float) -> float:
        """Return a number between two, drawn from the seed of the case."""
        return float(self._ctx.rng(f"input {name}").uniform(low, high))

    # -- times ----------------------------------------------------------------------------------------------

    @property
    def kv(self) -> float:
        """Gain of position control, 1/s."""
        return float(self._axis.variables.read("PositionControl.Kv"))

    @property
    def kpc(self) -> float:
        """Velocity precontrol, %."""
        return float(self._axis.variables.read("PositionControl.Kpc"))

    @property
    def settling_s(self) -> float:
        """Time in which position control brings the axis to rest at its setpoint, s."""
        return 6.0 / self.kv

    @property
    def call_s(self) -> float:
        """Time from one call of the user program to the next, s."""
        bench = self._ctx.bench
        return float(bench.interpolator_ns * 1e-9 * bench.config.bench.program_cycles)


def own(ctx: CaseContext) -> Own:
    """Return the axis under test in numbers."""
    return Own(ctx)
