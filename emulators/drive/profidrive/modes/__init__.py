"""Operating modes of a PROFIdrive axis: speed and position.

One telegram has the one or the other (PD-032).
"""

from __future__ import annotations

from emulators.drive.profidrive.modes.position import PositionMode
from emulators.drive.profidrive.modes.speed import SpeedMode

OperatingMode = SpeedMode | PositionMode
"""What the setpoints mean."""
