"""Configuration of an emulated motor with two speeds, and of its machine."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Final, Literal

from annotated_types import Ge, Le

from emulators.checked_fields import BENCH_FILE_TABLE, NotNegative, check_fields
from emulators.drive.keys import SpeedKeys, TorqueKeys
from emulators.drive.machine import EncoderConfig, LinearAxisConfig, RotaryAxisConfig, SwitchesConfig
from emulators.drive.tuning import ServoTuning
from fieldbus.clock import US
from fieldbus.errors import ConfigurationError

CONTACTORS: Final = ("minus_high", "minus_low", "plus_low", "plus_high", "brake")
"""Terminals of a motor at contactors: one for each direction and speed, and the brake (byte 8)."""
INVERTER: Final = ("direction_minus", "direction_plus", "velo_low", "velo_high", "brake")
"""Terminals of an inverter: direction, speed, and the brake (byte 9)."""
TERMINALS: Final = {"contactors": CONTACTORS, "inverter": INVERTER}


@dataclass(frozen=True, kw_only=True)
class TwoSpeedSettings:
    """`[drive.NAME.two_speed]`: a motor with two speeds.

    Raises:
        ConfigurationError: A value is out of its range, or the slow speed is not below the fast one.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    control: Literal["contactors", "inverter"] = "contactors"
    """`contactors`: terminals `minus_high`, `minus_low`, `plus_low`, `plus_high`; `inverter`:
    `direction_minus`, `direction_plus`, `velo_low`, `velo_high`; both: `brake`.
    """
    fast_rpm: Annotated[float, Ge(0.1), Le(200_000.0)] = 1500.0
    """Fast speed."""
    slow_rpm: Annotated[float, Ge(0.1), Le(200_000.0)] = 300.0
    """Slow speed."""
    time_constant_s: NotNegative = 0.05
    """The speed approaches a new one with this time constant."""
    coasting_s: NotNegative = 0.5
    """Without a speed and with the brake released it falls with this time constant."""
    braking_s: NotNegative = 0.02
    """With the brake applied it falls with this time constant."""
    brake_delay_ms: Annotated[float, Ge(0.0), Le(5000.0)] = 20.0
    """From the terminal to the applied or released brake."""

    def __post_init__(self) -> None:
        check_fields(self, "two-speed drive")
        if self.slow_rpm >= self.fast_rpm:
            raise ConfigurationError(
                "two-speed drive, slow_rpm", self.slow_rpm, f"below fast_rpm = {self.fast_rpm:g}"
            )


@dataclass(frozen=True, kw_only=True)
class TwoSpeedConfig(SpeedKeys, TorqueKeys):
    """A motor with two speeds and its machine.

    Args:
        two_speed: Terminals, speeds, brake.
        mechanics: Machine.
        switches: Switches on the travel of a linear axis.
        encoder: Motor encoder; it goes to the controller.
        servo_period_ns: Cycle of the model, ns.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    two_speed: TwoSpeedSettings = field(default_factory=TwoSpeedSettings)
    mechanics: LinearAxisConfig | RotaryAxisConfig = field(default_factory=LinearAxisConfig)
    switches: SwitchesConfig = field(default_factory=SwitchesConfig)
    encoder: EncoderConfig = field(default_factory=EncoderConfig)
    tuning: ServoTuning = field(default_factory=ServoTuning)
    servo_period_ns: int = 250 * US

    def __post_init__(self) -> None:
        check_fields(self, "two-speed drive")
        if self.servo_period_ns <= 0:
            raise ConfigurationError("two-speed drive servo_period_ns", self.servo_period_ns, "> 0")
