"""Units of technology objects: what the codes in `Units.*` are worth (CFG section 5).

Within the runtime velocities are position units per second (of a speed axis rpm), accelerations the same per
second, torques Nm, forces N, masses kg, moments of inertia kg m². `UnitFactors` converts what a user program
gives and sees.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi
from typing import Final, NamedTuple

LENGTHS: Final = {
    1010: 1.0,
    1011: 1e3,
    1013: 1e-3,
    1014: 1e-6,
    1015: 1e-9,
    1018: 0.3048,
    1019: 0.0254,
    1021: 1609.344,
    1536: 1e-3,
}
"""Codes of `Units.LengthUnit` that are lengths, with their size in metres (CFG-076)."""
NANOMETRE: Final = 1015
"""Code of `Units.LengthUnit`."""

ANGLES: Final = {1004: 1.0, 1005: pi / 180.0}
"""Codes of `Units.LengthUnit` that are angles, with their size in radians (CFG-077)."""

DEGREE: Final = 1005

VELOCITIES: Final = {
    1062: (1013, 1), 1538: (1013, 1), 1524: (1013, 60), 1526: (1013, 3600),
    1061: (1010, 1), 1525: (1010, 60), 1063: (1010, 3600), 1527: (1011, 60), 1064: (1011, 3600),
    1066: (1019, 1), 1069: (1019, 60), 1067: (1018, 1), 1070: (1018, 60), 1075: (1021, 3600),
    1521: (1005, 1), 1539: (1005, 1), 1522: (1005, 60), 1086: (1004, 1), 1523: (1004, 60),
}  # fmt: skip
"""Codes of `Units.VelocityUnit` of an object with position: a length or an angle, in how many seconds
(CFG-078 to CFG-080).
"""

SPEEDS: Final = {1082: 60.0, 1083: 1.0, 1528: 1.0 / 60.0}
"""Codes of `Units.VelocityUnit` of a speed axis, with their size in rpm (CFG-075)."""

_POUND: Final = 0.45359237
_POUND_FORCE: Final = _POUND * 9.80665
_POUNDAL: Final = _POUND * 0.3048
_FOOT: Final = 0.3048
_INCH: Final = 0.0254

FORCES: Final = {1120: 1.0, 1122: 1e3, 1094: _POUND_FORCE, 1093: _POUND_FORCE / 16.0, 1535: _POUNDAL}
"""Codes of `Units.ForceUnit`, with their size in N (CFG-082)."""

TORQUES: Final = {
    1126: 1.0,
    1128: 1e3,
    1529: _POUND_FORCE * _INCH,
    1530: _POUND_FORCE * _FOOT,
    1531: _POUND_FORCE / 16.0 * _INCH,
    1532: _POUND_FORCE / 16.0 * _FOOT,
    1533: _POUNDAL * _INCH,
    1534: _POUNDAL * _FOOT,
}
"""Codes of `Units.TorqueUnit`, with their size in Nm (CFG-083)."""

MASSES: Final = {1088: 1.0, 1089: 1e-3, 1090: 1e-6, 1092: 1e3, 1540: _POUND}
"""Codes of `Units.MassUnit`, with their size in kg (CFG-084)."""

INERTIAS: Final = {1118: 1.0, 1541: _POUND * _FOOT * _FOOT}
"""Codes of `Units.InertiaUnit`, with their size in kg m² (CFG-085)."""

HIGH_RESOLUTION: Final = frozenset((1536, 1538, 1539))
"""Codes with six decimals in place of three (CFG-089)."""

_REVOLUTION_PER_SECOND: Final = 60.0
"""In rpm: accelerations of a speed axis count revolutions in seconds, whatever
its velocity unit is (CFG-081).
"""


class UnitFactors(NamedTuple):
    """What one unit of the user program is within the runtime; 1.0 where they are the same."""

    velocity: float = 1.0
    acceleration: float = 1.0
    """Of a jerk as well."""
    torque: float = 1.0
    force: float = 1.0
    mass: float = 1.0
    inertia: float = 1.0
    load: float = 1.0
    """Of `Actor.LoadInertia`: a moment of inertia, or a mass of a linear object."""

    def of(self, token: str) -> float:
        """Return the factor for a kind of unit as the definitions of the variables name it."""
        return {
            "velocity": self.velocity,
            "acceleration": self.acceleration,
            "jerk": self.acceleration,
            "torque": self.torque,
            "force": self.force,
            "mass": self.mass,
            "inertia": self.inertia,
            "inertia_or_mass": self.load,
        }.get(token, 1.0)


def unit_factors(read: Callable[[str], int], *, speed_axis: bool, encoder: bool = False) -> UnitFactors:
    """Return the factors for the codes in `Units.*`.

    Args:
        read: Reads a variable of the object.
        speed_axis: It has no position.
        encoder: It is an external encoder: no torques, no masses.

    """
    velocity = read("Units.VelocityUnit")
    if speed_axis:
        rate, change = SPEEDS[velocity], _REVOLUTION_PER_SECOND
    else:
        rate, change = velocity_factor(velocity, read("Units.LengthUnit")), 1.0
    if encoder:
        return UnitFactors(rate, change)
    mass, inertia = MASSES[read("Units.MassUnit")], INERTIAS[read("Units.InertiaUnit")]
    linear = not speed_axis and read("Properties.MotionType") == 0
    return UnitFactors(
        rate,
        change,
        TORQUES[read("Units.TorqueUnit")],
        FORCES[read("Units.ForceUnit")],
        mass,
        inertia,
        mass if linear else inertia,
    )


def velocity_factor(velocity_unit: int, length_unit: int) -> float:
    """Return how many position units per second one velocity unit is; 1.0 where one is a length and the other
    an angle.
    """
    distance, seconds = VELOCITIES[velocity_unit]
    sizes = ANGLES if length_unit in ANGLES else LENGTHS
    if distance not in sizes:
        return 1.0  # the configuration is refused
    return sizes[distance] / sizes[length_unit] / seconds


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
    """Return with how many decimals positions are shown: 3, or 6 with higher
    resolution (CFG-088, CFG-089).
    """
    return 6 if length_unit in HIGH_RESOLUTION or velocity_unit in HIGH_RESOLUTION else 3


def farthest_position(length_unit: int) -> float:
    """Return the largest position that every step of the resolution tells apart,
    position unit (CFG-092, CFG-093).
    """
    return 9.0e9 if length_unit in HIGH_RESOLUTION else 9.0e12


def travel_time_s(velocity: float, length_unit: int) -> float:
    """Return how long an axis may travel with `velocity`, position unit per
    second, before positions lose steps.
    """
    return farthest_position(length_unit) / abs(velocity) if velocity else float("inf")
