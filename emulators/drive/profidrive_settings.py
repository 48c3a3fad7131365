"""Settings of a PROFIdrive axis: supplements of its telegram, references and monitoring."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le

from emulators.checked_fields import BENCH_FILE_TABLE, check_fields
from emulators.drive.keys import TelegramKeys


@dataclass(frozen=True, kw_only=True)
class ProfidriveSettings(TelegramKeys):
    """`[drive.NAME.profidrive]`: supplements, references and monitoring of a PROFIdrive axis.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    reference_speed_rpm: Annotated[float, Ge(6.0), Le(210_000.0)] = 3000.0
    """Speed that 4000h stands for (p2000)."""
    reference_torque_nm: Annotated[float, Ge(0.001), Le(1_000_000.0)] = 2.0
    """Torque that 4000h stands for (p2003)."""
    operating_mode: Literal[1, 3] = 3
    """PNU 930 of the emulated drive: 1 with ramp-function generator, 3 without."""
    ramp_up_s: Annotated[float, Ge(0.0), Le(1000.0)] = 10.0
    """p1120 of the emulated drive, which acts in operating mode 1; 0 = at once."""
    sign_of_life_tolerance: Annotated[int, Ge(0), Le(65_535)] = 1
    """Failures of the sign of life that the emulated drive tolerates (PNU 925); 65535 = not monitored."""
    sign_of_life: bool | None = None
    """Whether drive and controller watch each other's counter; none: where the telegram has one, but not on
    live Modbus.
    """
    setpoint_monitoring_ms: Annotated[float, Ge(0.0), Le(2_000_000.0)] = 100.0
    """The emulated drive trips with F01910 when no telegram comes for this long (p2040); 0 = never."""

    def __post_init__(self) -> None:
        check_fields(self, "profidrive")
