"""A PROFIdrive axis on Modbus, as configuration."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Ge, Le

from emulators.checked_fields import check_fields
from emulators.drive.keys import BootKeys, ModbusKeys
from emulators.drive.profidrive.config import ProfidriveConfig
from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class ProfidriveModbusConfig(ModbusKeys, BootKeys):
    """A PROFIdrive axis on Modbus. Its unit is one of a serial line, 1..247; over TCP every unit is answered
    (MODB-040).

    Args:
        drive: The drive. It is isochronous only if `drive.isochronous` is True: the client then writes
            one telegram with a sign of life in every cycle of the drive.
        setpoint_monitoring_ms: p2040: without access to process data for so long F01910, ms; 0 = off; None
            = the register map's time.
        parameter_latency_ns: From a request of data record 47 to its answer, ns.

    Raises:
        ConfigurationError: A value is out of range.

    """

    drive: ProfidriveConfig = field(default_factory=lambda: ProfidriveConfig(telegram=1))
    setpoint_monitoring_ms: Annotated[float, Ge(0.0), Le(2_000_000.0)] | None = None
    parameter_latency_ns: Annotated[int, Ge(0)] = 20 * MS

    def __post_init__(self) -> None:
        if not 1 <= self.unit <= 247:
            raise ConfigurationError("unit", self.unit, "1..247")
        check_fields(self, "drive on Modbus")

    @property
    def processing_ns(self) -> int:
        """From a request to its response, ns."""
        return round(self.processing_ms * MS)
