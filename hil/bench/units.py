"""An axis in other units: the same machine, with all its numbers given otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from fieldbus.errors import ConfigurationError
from motion.s7.units import ANGLES, DEGREE, LENGTHS, VELOCITIES, millimetres, velocity_factor
from motion.s7.variables import elements, variables_of

if TYPE_CHECKING:
    from hil.bench.axis_config import AxisTable

_LENGTH_UNITS: Final = frozenset(
    {"mm", "mm/s2", "mm/s3", "position", "acceleration", "jerk", "position/revolution"}
)
_VELOCITY_UNITS: Final = frozenset({"mm/s", "velocity"})
_TYPES: Final = {"positioning": "PositioningAxis", "synchronous": "SynchronousAxis"}
_LINES: Final = ".Parameter.Resolution"
_OTHERS: Final = ("Sensor[2]", "Sensor[3]", "Sensor[4]", "Sensor[1].Parameter.")
"""Encoders that need not exist, and what a bench takes over from an encoder: defaults mean nothing there."""


class UnitScale(NamedTuple):
    """What numbers in mm and s (of a rotary axis in deg and s) are multiplied with for an axis that counts
    otherwise.
    """

    length: float = 1.0
    velocity: float = 1.0

    def of(self, unit: str) -> float:
        """Return the factor for a unit of a program's parameters or a kind of unit of variables; 1.0 for one
        without length.
        """
        if unit in _VELOCITY_UNITS:
            return self.velocity
        return self.length if unit in _LENGTH_UNITS else 1.0

    @classmethod
    def of_codes(cls, length: int, velocity: int) -> UnitScale:
        """Return the scale for codes of `Units.LengthUnit` and `Units.VelocityUnit`.

        Raises:
            ConfigurationError: There is no such code.

        """
        if (length not in LENGTHS and length not in ANGLES) or velocity not in VELOCITIES:
            raise ConfigurationError("configuration.units", [length, velocity], "codes of two units")
        size = ANGLES[length] / ANGLES[DEGREE] if length in ANGLES else millimetres(length)
        return cls(1.0 / size, 1.0 / size / velocity_factor(velocity, length))

    @classmethod
    def of_axis(cls, axis: object) -> UnitScale:
        """Return the scale for an axis; 1 for one that has no unit of length,
        and for one that does not tell.
        """
        from motion.s7.handles import AxisHandle

        if not isinstance(axis, AxisHandle) or axis.variables.object_type == "SpeedAxis":
            return cls()
        length, velocity = axis.var("Units.LengthUnit"), axis.var("Units.VelocityUnit")
        return cls.of_codes(int(length), int(velocity))


MILLIMETRES: Final = UnitScale()
"""mm and s, or deg and s."""


def variables_in_units(axis: AxisTable, length: int, velocity: int) -> dict[str, Any]:
    """Return the variables of an axis that are given in mm and s (of a rotary one in deg and s) in other
    units, defaults included; none for an axis without position.

    Args:
        axis: Its table of the bench file.
        length: Code of `Units.LengthUnit`.
        velocity: Code of `Units.VelocityUnit`.

    """
    if axis.type not in _TYPES:
        return {}
    scale = UnitScale.of_codes(length, velocity)
    kind = "ROTARY" if length in ANGLES else "LINEAR"
    values: dict[str, Any] = {"Units.LengthUnit": length, "Units.VelocityUnit": velocity}
    for variable in variables_of(_TYPES[axis.type]):
        factor = scale.of(variable.unit)
        if variable.access == "RON" or factor == 1.0:
            continue
        low, high = variable.variants.get(kind, (variable.minimum, variable.maximum))
        for path in elements(variable):
            given = axis.variables.get(path, variable.initial)
            if given and (path in axis.variables or not path.startswith(_OTHERS)):
                values[path] = _within(float(given) * factor, low, high)
    return values


def taken_over_in_unit(values: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what an object takes over from an encoder in its own unit of length.

    Args:
        values: Variables that follow from the encoder; the distance of its lines in mm.
        given: Variables that the object has been given.

    """
    unit = given.get("Units.LengthUnit")
    size = millimetres(unit) if unit in LENGTHS else 1.0
    return {path: value / size if path.endswith(_LINES) else value for path, value in values.items()}


def _within(value: float, low: float | None, high: float | None) -> float:
    if low is not None:
        value = max(value, low)
    return value if high is None else min(value, high)
