"""A PROFIdrive axis on CANopen, as configuration."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Le

from emulators.checked_fields import check_fields
from emulators.drive.keys import BootKeys
from emulators.drive.profidrive.config import ProfidriveConfig


@dataclass(frozen=True, kw_only=True)
class ProfidriveNodeConfig(BootKeys):
    """A PROFIdrive axis on CANopen.

    Args:
        node_id: 1..127.
        drive: The drive.
        storage: File in which stored parameters outlive the process; None = they do not.

    """

    node_id: Annotated[int, Ge(1), Le(127)] = 1
    drive: ProfidriveConfig = field(default_factory=ProfidriveConfig)
    storage: Path | None = None

    def __post_init__(self) -> None:
        check_fields(self, "drive")
