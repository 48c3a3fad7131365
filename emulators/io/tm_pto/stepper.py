"""Stepper motor behind a pulse channel: follows pulse by pulse, and loses steps
when it is overloaded (PTO-293).

No dynamics of the rotor: while it follows, it stands where the pulses say. It falls out of step when the
torque that it needs is more than the pull-out torque at its frequency, and stands still until the pulses come
slowly enough to catch it again.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from emulators.io.tm_pto.pulses import PulseGenerator
from fieldbus.errors import ConfigurationError

_TAU: Final = 2.0 * math.pi
STEPS_PER_PERIOD: Final = 4
"""Full steps in an electrical period: the rotor catches again a whole number of periods away."""


@dataclass(frozen=True, kw_only=True)
class StepperConfig:
    """Motor and load.

    Args:
        increments: Pulses per revolution, as the power stage is set, > 0; a multiple of `full_steps`.
        full_steps: Full steps per revolution, > 0, a multiple of 4.
        holding_torque: Pull-out torque at low frequencies, Nm, > 0.
        corner_hz: Full-step frequency above which the pull-out torque falls inversely with it, > 0.
        start_stop_hz: Full-step frequency at and below which a rotor that stands can be caught, > 0.
        inertia: Rotor and load, kg m2, > 0.
        friction: Torque against the motion, Nm, >= 0.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    increments: int = 200
    full_steps: int = 200
    holding_torque: float = 1.0
    corner_hz: float = 2000.0
    start_stop_hz: float = 500.0
    inertia: float = 3e-5
    friction: float = 0.05

    def __post_init__(self) -> None:
        for name in ("holding_torque", "corner_hz", "start_stop_hz", "inertia"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ConfigurationError(f"stepper {name}", value, "a finite number > 0")
        if not (math.isfinite(self.friction) and self.friction >= 0.0):
            raise ConfigurationError("stepper friction", self.friction, "a finite number >= 0")
        if self.full_steps <= 0 or self.full_steps % STEPS_PER_PERIOD:
            raise ConfigurationError("stepper full_steps", self.full_steps, "a multiple of 4, > 0")
        if self.increments <= 0 or self.increments % self.full_steps:
            raise ConfigurationError(
                "stepper increments", self.increments, f"a multiple of {self.full_steps}, > 0"
            )


class StepperMotor:
    """The true shaft. Call `follow` after the generator has advanced.

    Args:
        generator: Source of the pulses.
        config: Motor and load.

    """

    def __init__(self, generator: PulseGenerator, config: StepperConfig) -> None:
        self._generator = generator
        self.config: Final = config
        self._per_step = config.increments // config.full_steps
        self._stood_at = 0
        self.load_torque = 0.0
        """Torque on the shaft in addition to friction, Nm; positive turns it backwards."""
        self.energised = True
        """Whether the windings have current; without, the pulses are lost."""
        self.lost = 0
        """Pulses that the shaft has not followed, with their sign."""
        self.stalled = False
        """Whether it is out of step."""

    @property
    def angle(self) -> float:
        """True angle of the shaft, rad."""
        pulses = self._stood_at if self.stalled else self._generator.count - self.lost
        return pulses * _TAU / self.config.increments

    def pull_out_torque(self, frequency_hz: float) -> float:
        """Return the torque that the motor can bring at a frequency of the pulses, Hz."""
        full = abs(frequency_hz) / self._per_step
        torque = self.config.holding_torque
        return torque if full <= self.config.corner_hz else torque * self.config.corner_hz / full

    def needed_torque(self) -> float:
        """Return the torque that following the pulses needs now, Nm, with its sign."""
        generator = self._generator
        angular = generator.acceleration * _TAU / self.config.increments
        friction = math.copysign(self.config.friction, generator.frequency) if generator.frequency else 0.0
        return self.config.inertia * angular + friction + self.load_torque

    def slip(self, periods: int) -> None:
        """Let a shaft that is in step lag behind by whole electrical periods more."""
        if not self.stalled:
            self.lost += STEPS_PER_PERIOD * self._per_step * periods

    def stand(self, angle: float) -> None:
        """Fall out of step at an angle, rad: something blocks the shaft there."""
        self._stood_at = round(angle / _TAU * self.config.increments)
        self.stalled = True

    def follow(self) -> None:
        """Fall out of step, or be caught again."""
        generator = self._generator
        able = self.energised and abs(self.needed_torque()) <= self.pull_out_torque(generator.frequency)
        if not self.stalled:
            if not able:
                self._stood_at = generator.count - self.lost
                self.stalled = True
            return
        if able and abs(generator.frequency) <= self.config.start_stop_hz * self._per_step:
            period = STEPS_PER_PERIOD * self._per_step
            missed = generator.count - self.lost - self._stood_at
            self.lost += period * round(missed / period)
            self.stalled = False
