"""Modes of operation (C402-078 to C402-104)."""

from __future__ import annotations

from emulators.drive.cia402.modes._base import ModeOfOperation, NoMode
from emulators.drive.cia402.modes._cyclic import CyclicPosition, CyclicTorque, CyclicVelocity
from emulators.drive.cia402.modes._homing import Homing
from emulators.drive.cia402.modes._interpolated import InterpolatedPosition
from emulators.drive.cia402.modes._interpolation_buffer import InterpolationBuffer
from emulators.drive.cia402.modes._profile_position import ProfilePosition
from emulators.drive.cia402.modes._profile_torque import ProfileTorque
from emulators.drive.cia402.modes._profile_velocity import ProfileVelocity
from emulators.drive.cia402.modes._velocity import FULL as VL_FULL
from emulators.drive.cia402.modes._velocity import Velocity
from emulators.drive.cia402.modes._velocity import in_units as vl_units
from emulators.drive.cia402.modes._velocity import percentage as vl_percentage
from emulators.drive.cia402.modes._velocity import scale as vl_scale

__all__ = [
    "VL_FULL",
    "CyclicPosition",
    "CyclicTorque",
    "CyclicVelocity",
    "Homing",
    "InterpolatedPosition",
    "InterpolationBuffer",
    "ModeOfOperation",
    "NoMode",
    "ProfilePosition",
    "ProfileTorque",
    "ProfileVelocity",
    "Velocity",
    "vl_percentage",
    "vl_scale",
    "vl_units",
]
