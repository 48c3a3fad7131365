"""What an axis with positions has beyond a speed axis."""

from __future__ import annotations

from dataclasses import dataclass

from motion.kernel.monitoring import Monitoring
from motion.s7.axis.hardware_limits import HardwareLimits
from motion.s7.axis.software_limits import SoftwareLimits


@dataclass(frozen=True)
class PositionParts:
    """Monitoring and limits of the travel of a positioning axis."""

    monitoring: Monitoring
    hardware: HardwareLimits
    software: SoftwareLimits
