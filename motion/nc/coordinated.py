"""Dynamic values of coordinated motion and collision avoidance (`Tc3_Mc...` libraries; NC-096 to NC-099):
unlike those of single axes they honour the maxima.
"""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Final

from motion.nc.errors import BLOCK_PARAMETER, VELOCITY_NOT_ALLOWED

if TYPE_CHECKING:
    from motion.nc.parameters import ParameterSet

MC_Default: Final = -1.0
"""Stands for the default value of the axis, limited to its maximum."""
MC_Maximum: Final = -2.0
"""Stands for the maximum of the axis."""


def coordinated_dynamics(
    parameters: ParameterSet, *, velocity: float, acceleration: float, deceleration: float, jerk: float
) -> tuple[float, float, float, float] | int:
    """Return velocity, acceleration, deceleration and jerk of a coordinated motion, or an error code.

    Args:
        parameters: Parameters of the axis.
        velocity: Position unit/s, or `MC_Maximum`.
        acceleration: Position unit/s2, `MC_Default` or `MC_Maximum`; likewise the deceleration.
        deceleration: Position unit/s2.
        jerk: Position unit/s3, or `MC_Default`; it has no maximum, infinite gives a rectangular acceleration,
            which is a jerk of 0.0 in the result.

    """

    def number(key: str) -> float:
        return parameters.cell(f"axis.{key}").value

    highest = number("maximum_velocity")
    if velocity == MC_Maximum:
        velocity = highest
    if not 0.0 < velocity <= highest:
        return VELOCITY_NOT_ALLOWED
    found: list[float] = []
    for name, given in (("acceleration", acceleration), ("deceleration", deceleration)):
        value, most = given, number(f"maximum_{name}")
        if value == MC_Default:
            value = min(number(f"default_{name}"), most)
        elif value == MC_Maximum:
            value = most
        if not 0.0 < value <= most:
            return BLOCK_PARAMETER
        found.append(value)
    if jerk == MC_Default:
        jerk = number("default_jerk")
    if not jerk > 0.0:
        return BLOCK_PARAMETER
    return velocity, found[0], found[1], 0.0 if jerk == inf else jerk
