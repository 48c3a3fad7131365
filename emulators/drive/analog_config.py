"""Configuration of an emulated drive with an analog setpoint, and of its machine."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Final, Literal

from emulators.drive.machine import (
    BrakeConfig,
    EncoderConfig,
    LinearAxisConfig,
    RotaryAxisConfig,
    check_number,
)
from emulators.drive.tuning import ServoTuning
from fieldbus.clock import MS, US
from fieldbus.errors import ConfigurationError

FULL_SCALE_V: Final = 10.0
"""Voltage of 100 % (CFG-395)."""
OVERRANGE: Final = 1.17
"""Share of the full scale up to which a setpoint counts (CFG-396)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnalogConfig:
    """A drive that takes its speed from a voltage.

    Args:
        mechanics: Machine.
        encoder: Motor encoder; it goes to the controller, the drive uses it for its own speed loop.
        brake: Holding brake of the motor.
        tuning: Gains of the speed loop; such a drive does not know the acceleration, it has no torque
            pre-control.
        servo_period_ns: Control cycle, ns.
        reference_speed_rpm: Speed at 10 V, rpm, > 0 (CFG-394).
        max_speed_rpm: Limit of the speed, and where the stop ramp begins, rpm, > 0.
        rated_torque_Nm: Nm, > 0.
        peak_torque: Torque limit as a multiple of the rated one, > 0.
        offset_V: Voltage that the input sees too much, V (drift, NC-757).
        dead_zone_V: Voltages up to this magnitude count as none, V, >= 0.
        inverted: A positive voltage turns in negative direction.
        enable_input: There is an enable input; without one the drive follows the voltage as long as it is
            on (STP-062).
        ready_delay_s: From the enable to the ready output, s, >= 0.
        stop: What the drive does when the enable is taken away: its own ramp, or coast (STP-540).
        stop_ramp_s: From the maximum speed to standstill, s, > 0.
        ready_falls: When the ready output falls: with the enable, at standstill, or never (STP-539).
        input_filter_s: Filter of limit and home switches, s, >= 0.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    mechanics: LinearAxisConfig | RotaryAxisConfig = field(default_factory=LinearAxisConfig)
    encoder: EncoderConfig = field(default_factory=EncoderConfig)
    brake: BrakeConfig = field(default_factory=BrakeConfig)
    tuning: ServoTuning = field(default_factory=ServoTuning)
    servo_period_ns: int = 250 * US
    reference_speed_rpm: float = 3000.0
    max_speed_rpm: float = 3000.0
    rated_torque_Nm: float = 2.0
    peak_torque: float = 3.0
    offset_V: float = 0.0
    dead_zone_V: float = 0.0
    inverted: bool = False
    enable_input: bool = True
    ready_delay_s: float = 0.0
    stop: Literal["ramp", "coast"] = "ramp"
    stop_ramp_s: float = 0.5
    ready_falls: Literal["enable", "standstill", "never"] = "enable"
    input_filter_s: float = 0.0

    def __post_init__(self) -> None:
        for name in ("reference_speed_rpm", "max_speed_rpm", "rated_torque_Nm", "peak_torque", "stop_ramp_s"):
            check_number(f"analog drive {name}", getattr(self, name), positive=True)
        for name in ("dead_zone_V", "ready_delay_s", "input_filter_s"):
            check_number(f"analog drive {name}", getattr(self, name))
        if not math.isfinite(self.offset_V):
            raise ConfigurationError("analog drive offset_V", self.offset_V, "a finite number")
        if self.servo_period_ns <= 0:
            raise ConfigurationError("analog drive servo_period_ns", self.servo_period_ns, "> 0")
        for name, allowed in (
            ("stop", ("ramp", "coast")),
            ("ready_falls", ("enable", "standstill", "never")),
        ):
            if getattr(self, name) not in allowed:
                raise ConfigurationError(f"analog drive {name}", getattr(self, name), ", ".join(allowed))

    @property
    def speed_tuning(self) -> ServoTuning:
        """Gains without the pre-control of the torque."""
        return replace(self.tuning, torque_feedforward=False)

    @property
    def control_period_ns(self) -> int:
        """Period of what is slower than the control loop, ns."""
        return max(1 * MS, self.servo_period_ns)

    def speed_rpm(self, volts: float) -> float:
        """Return the speed that a voltage at the input means: offset, dead zone, over-range and limit,
        rpm.
        """
        seen = volts + self.offset_V
        if abs(seen) <= self.dead_zone_V:
            return 0.0
        highest = FULL_SCALE_V * OVERRANGE
        speed = min(max(seen, -highest), highest) / FULL_SCALE_V * self.reference_speed_rpm
        limit = self.max_speed_rpm
        speed = min(max(speed, -limit), limit)
        return -speed if self.inverted else speed
