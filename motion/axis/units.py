"""Units of technology objects: what a position unit is worth, and which velocity unit belongs to it (CFG section 5)."""

from __future__ import annotations

from math import pi
from typing import Final

LENGTHS: Final = {
    1010: 1.0, 1011: 1e3, 1013: 1e-3, 1014: 1e-6, 1015: 1e-9, 1018: 0.3048, 1019: 0.0254, 1021: 1609.344, 1536: 1e-3,
}  # fmt: skip
"""Codes of `Units.LengthUnit` that are lengths, with their size in metres (CFG-076)."""

ANGLES: Final = {1004: 1.0, 1005: pi / 180.0}
"""Codes of `Units.LengthUnit` that are angles, with their size in radians (CFG-077)."""

DEGREE: Final = 1005
RADIAN: Final = 1004
MILLIMETRE: Final = 1013

VELOCITY_OF: Final = {
    1013: (1062, 1538), 1536: (1062, 1538), 1010: (1061,), 1019: (1066,), 1018: (1067,), 1005: (1521, 1539), 1004: (1086,),
}  # fmt: skip
"""Velocity units that are one position unit per second, by the position unit: those that an axis can be led in."""

SPEEDS: Final = {1082: 60.0, 1083: 1.0, 1528: 1.0 / 60.0}
"""Codes of `Units.VelocityUnit` of a speed axis, with their size in rpm (CFG-075)."""

HIGH_RESOLUTION: Final = frozenset((1536, 1538, 1539))
"""Codes with six decimals in place of three (CFG-089)."""


def per_revolution(length_unit: int) -> float:
    """Return one revolution in an angular position unit: 360 degrees, 2 pi rad.

    Raises:
        KeyError: The unit is a length.

    """
    return 360.0 if length_unit == DEGREE else 2.0 * pi / ANGLES[length_unit]


def millimetres(length_unit: int) -> float:
    """Return the size of a length unit in mm.

    Raises:
        KeyError: The unit is an angle.

    """
    return LENGTHS[length_unit] * 1e3


def decimals(length_unit: int, velocity_unit: int = 0) -> int:
    """Return with how many decimals positions are shown: 3, or 6 with higher resolution (CFG-088, CFG-089)."""
    return 6 if length_unit in HIGH_RESOLUTION or velocity_unit in HIGH_RESOLUTION else 3


def farthest_position(length_unit: int) -> float:
    """Return the largest position that every step of the resolution tells apart, position unit (CFG-092, CFG-093)."""
    return 9.0e9 if length_unit in HIGH_RESOLUTION else 9.0e12


def travel_time_s(velocity: float, length_unit: int) -> float:
    """Return how long an axis may travel with `velocity`, position unit per second, before positions lose steps."""
    return farthest_position(length_unit) / abs(velocity) if velocity else float("inf")
