"""Heat of a drive, as configuration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le

from emulators.checked_fields import BENCH_FILE_TABLE, check_fields
from fieldbus.errors import ConfigurationError

Seconds = Annotated[float, Ge(0.01), Le(100_000.0)]
Rise = Annotated[float, Ge(0.1), Le(1000.0)]
Temperature = Annotated[float, Ge(-60.0), Le(400.0)]


@dataclass(frozen=True, kw_only=True)
class ThermalConfig:
    """`[drive.NAME.thermal]`: heat of motor and power stage.

    Raises:
        ConfigurationError: A value is out of its range, or a fault threshold is not above its warning.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    overload: Literal["fault", "limit"] = "fault"
    """At the end of i²t: fault 2310h (motor) or 2350h (power stage), or the torque is limited to the
    continuous one (bit 11).
    """
    i2t_time_constant_s: Seconds = 40.0
    """i²t of the motor."""
    stage_overload: Annotated[float, Ge(0.1), Le(100.0)] = 2.0
    """Continuous torque of the power stage, as a multiple of `rated_torque_nm`."""
    stage_overload_time_s: Seconds = 20.0
    """i²t of the power stage."""
    ambient_c: Temperature = 25.0
    """Temperature around the drive."""
    motor_rise_k: Rise = 80.0
    """Steady rise of the motor at rated torque."""
    motor_time_constant_s: Seconds = 600.0
    """Time constant of the temperature of the motor."""
    motor_warning_c: Temperature = 120.0
    """The drive warns from here on; above `ambient_c`."""
    motor_fault_c: Temperature = 140.0
    """Fault 4310h; above `motor_warning_c`."""
    motor_loss_w: Annotated[float, Ge(0.0), Le(1_000_000.0)] = 60.0
    """Copper losses at rated torque, out of the DC link."""
    stage_rise_k: Rise = 35.0
    """Steady rise of the power stage at rated torque."""
    stage_time_constant_s: Seconds = 120.0
    """Time constant of the temperature of the power stage."""
    stage_warning_c: Temperature = 85.0
    """The drive warns from here on; above `ambient_c`."""
    stage_fault_c: Temperature = 95.0
    """Fault 4210h; above `stage_warning_c`."""

    def __post_init__(self) -> None:
        check_fields(self, "thermal")
        for part, warning, fault in (
            ("motor", self.motor_warning_c, self.motor_fault_c),
            ("stage", self.stage_warning_c, self.stage_fault_c),
        ):
            if not self.ambient_c < warning < fault:
                raise ConfigurationError(
                    f"{part} temperatures", (self.ambient_c, warning, fault), "ambient < warning < fault"
                )
