"""Emulated drives: the profile-neutral servo core and the profile faces on top of it."""

from __future__ import annotations

from emulators.drive.brake import HoldingBrake
from emulators.drive.core import ServoCore, ServoTuning
from emulators.drive.protection import WindowTimer
from emulators.drive.ramp import PositionProfile, ProfileForm, RampShape
from emulators.drive.supply import DcLink
from emulators.drive.supply_config import SupplyConfig
from emulators.drive.thermal import ThermalModel, ThermalNode
from emulators.drive.thermal_config import ThermalConfig

__all__ = [
    "DcLink",
    "HoldingBrake",
    "PositionProfile",
    "ProfileForm",
    "RampShape",
    "ServoCore",
    "ServoTuning",
    "SupplyConfig",
    "ThermalConfig",
    "ThermalModel",
    "ThermalNode",
    "WindowTimer",
]
