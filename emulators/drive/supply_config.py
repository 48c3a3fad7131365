"""DC link of a drive, as configuration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar

from annotated_types import Ge, Gt, Le

from emulators.checked_fields import BENCH_FILE_TABLE, check_fields
from fieldbus.errors import ConfigurationError

Voltage = Annotated[float, Ge(1.0), Le(5000.0)]


@dataclass(frozen=True, kw_only=True)
class SupplyConfig:
    """`[drive.NAME.supply]`: DC link of the drive.

    Raises:
        ConfigurationError: A value is out of its range, or the voltages are not in order.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    nominal_v: Voltage = 560.0
    """Rectified mains voltage."""
    undervoltage_v: Voltage = 400.0
    """Below this fault 3220h in operation, and bit 4 is 0; below `nominal_v`."""
    overvoltage_v: Voltage = 780.0
    """Above this fault 3210h; above `nominal_v`."""
    capacitance_uf: Annotated[float, Ge(1.0), Le(1_000_000.0)] = 500.0
    """Capacitance of the DC link."""
    charging_time_ms: Annotated[float, Gt(0.0), Le(60_000.0)] = 5.0
    """Time constant with which the rectifier charges the capacitor."""
    standby_w: Annotated[float, Ge(0.0), Le(100_000.0)] = 15.0
    """What the drive itself takes out of the DC link."""
    chopper_on_v: Voltage = 720.0
    """The brake chopper begins to conduct; up to `overvoltage_v`."""
    chopper_off_v: Voltage = 700.0
    """The brake chopper ceases to conduct; `nominal_v` to `chopper_on_v`."""
    chopper_ohm: Annotated[float, Ge(0.1), Le(100_000.0)] = 30.0
    """Brake resistor."""
    chopper_rated_w: Annotated[float, Ge(1.0), Le(1_000_000.0)] = 200.0
    """Continuous power of the brake resistor; more for long is fault 7112h."""
    chopper_time_constant_s: Annotated[float, Ge(0.01), Le(100_000.0)] = 20.0
    """Thermal time constant of the brake resistor."""
    phase_loss_time_ms: Annotated[float, Ge(0.0), Le(60_000.0)] = 500.0
    """A missing phase becomes fault 3130h after this time in operation."""

    def __post_init__(self) -> None:
        check_fields(self, "supply")
        if not self.undervoltage_v < self.nominal_v < self.overvoltage_v:
            raise ConfigurationError(
                "DC link",
                (self.undervoltage_v, self.nominal_v, self.overvoltage_v),
                "undervoltage < nominal < overvoltage",
            )
        if not self.nominal_v <= self.chopper_off_v < self.chopper_on_v <= self.overvoltage_v:
            raise ConfigurationError(
                "chopper",
                (self.chopper_off_v, self.chopper_on_v),
                "nominal <= chopper off < chopper on <= overvoltage",
            )

    @property
    def phase_loss_time_s(self) -> float:
        """Time after which a missing phase becomes a fault, s."""
        return self.phase_loss_time_ms / 1000.0
