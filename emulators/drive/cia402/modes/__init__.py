"""Modes of operation (C402-078 to C402-104)."""

from __future__ import annotations

from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.modes._base import ModeOfOperation, NoMode
from emulators.drive.cia402.modes._cyclic import CyclicPosition, CyclicTorque, CyclicVelocity
from emulators.drive.cia402.modes._homing import Homing
from emulators.drive.cia402.modes._profile_position import ProfilePosition
from emulators.drive.cia402.modes._profile_velocity import ProfileVelocity

__all__ = [
    "CyclicPosition",
    "CyclicTorque",
    "CyclicVelocity",
    "Homing",
    "ModeOfOperation",
    "NoMode",
    "ProfilePosition",
    "ProfileVelocity",
    "all_modes",
]


def all_modes(axis: ProfileAxis) -> dict[int, ModeOfOperation]:
    """Return one instance of every mode by its number in 6060h."""
    modes: tuple[ModeOfOperation, ...] = (
        NoMode(axis),
        ProfilePosition(axis),
        ProfileVelocity(axis),
        Homing(axis),
        CyclicPosition(axis),
        CyclicVelocity(axis),
        CyclicTorque(axis),
    )
    return {mode.number: mode for mode in modes}
