"""A pulse module on CANopen, as configuration."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Ge, Le

from emulators.checked_fields import check_fields
from emulators.drive.keys import BootKeys
from emulators.drive.stepper import StepperDriveConfig
from fieldbus.clock import MS
from fieldbus.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class StepperNodeConfig(BootKeys):
    """A pulse module on CANopen.

    Args:
        node_id: 1..127.
        drive: Module, motor and machine.
        cycle_ns: Bus cycle, ns.

    """

    node_id: Annotated[int, Ge(1), Le(127)] = 1
    drive: StepperDriveConfig = field(default_factory=StepperDriveConfig)
    cycle_ns: int = 4 * MS

    def __post_init__(self) -> None:
        check_fields(self, "drive")
        if self.cycle_ns <= 0:
            raise ConfigurationError("cycle_ns", self.cycle_ns, "> 0")
