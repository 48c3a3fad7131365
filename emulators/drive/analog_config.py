"""Configuration of an emulated drive with an analog setpoint, and of its machine."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Annotated, ClassVar, Final, Literal

from annotated_types import Ge, Le

from emulators.checked_fields import BENCH_FILE_TABLE, NotNegative, check_fields
from emulators.drive.keys import Off3Keys, SpeedKeys, TorqueKeys
from emulators.drive.machine import (
    BrakeConfig,
    EncoderConfig,
    LinearAxisConfig,
    RotaryAxisConfig,
    SwitchesConfig,
    check_number,
)
from emulators.drive.tuning import ServoTuning
from fieldbus.clock import MS, US
from fieldbus.errors import ConfigurationError

FULL_SCALE_V: Final = 10.0
"""Voltage of 100 % (CFG-395)."""
OVERRANGE: Final = 1.17
"""Share of the full scale up to which a setpoint counts (CFG-396)."""


@dataclass(frozen=True, kw_only=True)
class AnalogSettings:
    """`[drive.NAME.analog]`: what a drive with an analog setpoint has.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    reference_speed_rpm: Annotated[float, Ge(1.0), Le(200_000.0)] = 3000.0
    """Speed at 10 V; up to 11.7 V count."""
    enable_input: bool = True
    """There is an enable input; without one the drive follows the voltage as long as it is on."""
    ready_delay_ms: Annotated[float, Ge(0.0), Le(5000.0)] = 0.0
    """From the enable to the ready output."""
    stop: Literal["ramp", "coast"] = "ramp"
    """What the drive does when the enable is taken away."""
    ready_falls: Literal["enable", "standstill", "never"] = "enable"
    """When the ready output falls after that."""
    offset_v: float = 0.0
    """Voltage that its input sees too much."""
    dead_zone_v: NotNegative = 0.0
    """Voltages up to this count as none."""
    inverted: bool = False
    """A positive voltage turns in negative direction."""
    characteristic: tuple[tuple[float, float], ...] = ()
    """Share of 10 V and share of the reference speed, one after the other, the first rising, with straight
    lines in between, as a hydraulic valve has it; empty: proportional.
    """

    def __post_init__(self) -> None:
        check_fields(self, "analog drive")
        points = self.characteristic
        if points and (len(points) < 2 or any(a[0] >= b[0] for a, b in pairwise(points))):
            raise ConfigurationError(
                "analog drive, characteristic", points, "two points or more, the first number rising"
            )

    def share(self, share: float) -> float:
        """Return the share of the reference speed that a share of 10 V means."""
        points = self.characteristic
        if not points:
            return share
        if share <= points[0][0]:
            return points[0][1]
        for (x0, y0), (x1, y1) in pairwise(points):
            if share <= x1:
                return y0 + (y1 - y0) * (share - x0) / (x1 - x0)
        return points[-1][1]


@dataclass(frozen=True, kw_only=True)
class AnalogConfig(SpeedKeys, TorqueKeys, Off3Keys):
    """A drive that takes its speed from a voltage.

    Args:
        analog: Setpoint, enable and ready (CFG-394, STP-062, STP-539, STP-540).
        mechanics: Machine.
        switches: Switches on the travel of a linear axis.
        encoder: Motor encoder; it goes to the controller, the drive uses it for its own speed loop.
        brake: Holding brake of the motor.
        tuning: Gains of the speed loop; such a drive does not know the
            acceleration, it has no torque pre-control.
        servo_period_ns: Control cycle, ns.
        peak_torque: Torque limit as a multiple of the rated one, > 0.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    analog: AnalogSettings = field(default_factory=AnalogSettings)
    mechanics: LinearAxisConfig | RotaryAxisConfig = field(default_factory=LinearAxisConfig)
    switches: SwitchesConfig = field(default_factory=SwitchesConfig)
    encoder: EncoderConfig = field(default_factory=EncoderConfig)
    brake: BrakeConfig = field(default_factory=BrakeConfig)
    tuning: ServoTuning = field(default_factory=ServoTuning)
    servo_period_ns: int = 250 * US
    peak_torque: float = 3.0

    def __post_init__(self) -> None:
        check_number("analog drive peak_torque", self.peak_torque, positive=True)
        check_fields(self, "analog drive")
        if self.servo_period_ns <= 0:
            raise ConfigurationError("analog drive servo_period_ns", self.servo_period_ns, "> 0")

    @property
    def speed_tuning(self) -> ServoTuning:
        """Gains without the pre-control of the torque."""
        return replace(self.tuning, torque_precontrol=False)

    @property
    def control_period_ns(self) -> int:
        """Period of what is slower than the control loop, ns."""
        return max(1 * MS, self.servo_period_ns)

    def speed_rpm(self, volts: float) -> float:
        """Return the speed that a voltage at the input means: offset, dead
        zone, over-range and limit, rpm.
        """
        analog = self.analog
        seen = volts + analog.offset_v
        if abs(seen) <= analog.dead_zone_v:
            return 0.0
        highest = FULL_SCALE_V * OVERRANGE
        share = analog.share(min(max(seen, -highest), highest) / FULL_SCALE_V)
        speed = share * analog.reference_speed_rpm
        limit = self.max_speed_rpm
        speed = min(max(speed, -limit), limit)
        return -speed if analog.inverted else speed
