"""Gains and thresholds of the servo core."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from emulators.checked_fields import check_fields
from emulators.drive.keys import SpeedLoopKeys
from fieldbus.errors import ConfigurationError

RPM: Final = 2.0 * math.pi / 60.0
"""rad/s of one revolution per minute."""


@dataclass(frozen=True, kw_only=True)
class ServoTuning(SpeedLoopKeys):
    """Gains of the cascade. T_vtc = inertia / proportional gain is `velocity_time_constant_ms`.

    Args:
        velocity_integral_time_s: Integral time of the velocity controller, s; 0 = no integral part.
        position_gain: Kv, 1/s; stable up to about 1 / (4 * T_vtc).
        velocity_feedforward: Share of the demanded velocity that bypasses the position controller, 0..1.
        inertia_kgm2: Inertia that the drive assumes, kg m^2; None = the true one.
        current_time_constant_s: First-order lag of the current loop, s; 0 = ideal.
        standstill_speed_rpm: Speed below which the axis counts as standing, rpm.
        standstill_time_s: How long it has to stay below, s.
        standstill_timeout_s: After a ramp to zero has ended for this long, the stop counts as finished
            anyway, s.

    """

    velocity_integral_time_s: float = 0.020
    position_gain: float = 100.0
    velocity_feedforward: float = 1.0
    inertia_kgm2: float | None = None
    current_time_constant_s: float = 0.0
    standstill_speed_rpm: float = 5.0
    standstill_time_s: float = 0.001
    standstill_timeout_s: float = 4.0

    def __post_init__(self) -> None:
        check_fields(self, "speed loop")
        for name, value, positive in (
            ("velocity_integral_time_s", self.velocity_integral_time_s, False),
            ("position_gain", self.position_gain, False),
            ("current_time_constant_s", self.current_time_constant_s, False),
            ("standstill_speed_rpm", self.standstill_speed_rpm, True),
            ("standstill_time_s", self.standstill_time_s, False),
            ("standstill_timeout_s", self.standstill_timeout_s, True),
        ):
            if not math.isfinite(value) or value < 0.0 or (positive and value == 0.0):
                raise ConfigurationError(name, value, "a finite number " + ("> 0" if positive else ">= 0"))
        if not 0.0 <= self.velocity_feedforward <= 1.0:
            raise ConfigurationError("velocity_feedforward", self.velocity_feedforward, "0..1")
        if self.inertia_kgm2 is not None and not self.inertia_kgm2 > 0.0:
            raise ConfigurationError("inertia_kgm2", self.inertia_kgm2, "> 0, or None")

    @property
    def velocity_time_constant_s(self) -> float:
        """T_vtc, s."""
        return self.velocity_time_constant_ms / 1000.0
