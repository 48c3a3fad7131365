"""The same bench with axes of another make: what is configured of a technology object, as parameters of an NC
axis.
"""

from __future__ import annotations

import tomllib
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import tomli_w

from hil.bench import BenchFile
from hil.bench.units import MILLIMETRES, UnitScale
from hil.errors import CannotRunError
from motion.s7.units import ANGLES
from motion.s7.variables import elements, variables_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hil.bench.bench import Bench
    from hil.protocols import BenchFile as AnyBenchFile

NC_BENCH: Final = "nc-axes:"
"""What the reference of a bench begins with whose axes are to be those of an NC."""

SAME: Final[Mapping[str, tuple[str, ...]]] = {
    "DynamicLimits.MaxVelocity": ("axis.maximum_velocity", "axis.manual_velocity_fast"),
    "DynamicDefaults.Velocity": ("axis.manual_velocity_slow",),
    "DynamicLimits.MaxAcceleration": ("axis.maximum_acceleration",),
    "DynamicLimits.MaxDeceleration": ("axis.maximum_deceleration", "axis.fast_deceleration"),
    "DynamicLimits.MaxJerk": ("axis.fast_jerk",),
    "DynamicDefaults.Acceleration": ("axis.default_acceleration",),
    "DynamicDefaults.Deceleration": ("axis.default_deceleration",),
    "DynamicDefaults.Jerk": ("axis.default_jerk",),
    "Actor.InverseDirection": ("drv.invert_motor_polarity",),
    "Sensor[1].InverseDirection": ("enc.invert_counting_direction",),
    "PositionControl.Kv": ("ctrl.pos_kv",),
    "PositioningMonitoring.Window": ("axis.target_position_window",),
    "PositioningMonitoring.MinDwellTime": ("axis.target_position_monitoring_time",),
    "PositioningMonitoring.ToleranceTime": ("axis.in_target_timeout",),
    "FollowingError.MaxValue": ("axis.position_lag_max",),
    "FollowingError.EnableMonitoring": ("axis.position_lag_monitoring",),
    "PositionLimits_SW.Active": ("axis.soft_limit_min_enable", "axis.soft_limit_max_enable"),
    "PositionLimits_SW.MinPosition": ("axis.soft_limit_min",),
    "PositionLimits_SW.MaxPosition": ("axis.soft_limit_max",),
}
"""Variable of a technology object -> parameters of an NC axis that mean the same."""
_FASTEST: Final = "axis.maximum_velocity"
_TURN: Final = 360.0
"""Way of a revolution of a rotary axis, deg."""
ALWAYS: Final[Mapping[str, Any]] = {"axis.in_target_alarm": True}
"""Parameters that stand for what a technology object always does: it watches that its target is reached."""


def with_nc_axes(file: AnyBenchFile[Bench], reference: str) -> BenchFile:
    """Return a bench with the same buses, drives and machines, and axes of an NC.

    Args:
        file: The bench.
        reference: What the user calls the result, for messages.

    Raises:
        CannotRunError: It has an axis without a counterpart, or was not read from a file.
        BenchFileError: An NC axis cannot have what is configured.

    """
    if not isinstance(file, BenchFile):
        raise CannotRunError(f"bench {reference!r}: only a bench file can be had with axes of an NC")
    content = tomllib.loads(file.text)
    for kind in ("external_encoder", "cam", "proxy"):
        if content.get(kind):
            raise CannotRunError(
                f"bench {file.name!r}: [{kind}.NAME] belongs to technology objects; an NC has none"
            )
    axes: dict[str, Any] = content.get("axis", {})
    content["axis"] = {name: _nc_axis(f"{file.name}: axis.{name}", table) for name, table in axes.items()}
    return BenchFile(file.source, tomli_w.dumps(content))


def make_of(file: AnyBenchFile[Bench]) -> str:
    """Return the make of the controller of the first axis of a bench, as the bench file calls it; empty
    where it has none.
    """
    if not isinstance(file, BenchFile):
        return ""
    return next((axis.controller for axis in file.config.axis.values()), "")


@cache
def _units() -> Mapping[str, str]:
    """Return the kinds of units of the variables of a positioning axis."""
    return {
        path: variable.unit for variable in variables_of("PositioningAxis") for path in elements(variable)
    }


def _nc_axis(where: str, table: dict[str, Any]) -> dict[str, Any]:
    if table.get("controller") == "nc":
        return table
    if table.get("type", "positioning") != "positioning":
        raise CannotRunError(
            f"{where}: only a positioning axis can be had as an axis of an NC, not {table['type']!r}"
        )
    variables: dict[str, Any] = table.get("variables", {})
    length, velocity = variables.get("Units.LengthUnit"), variables.get("Units.VelocityUnit")
    scale = MILLIMETRES
    if length is not None and velocity is not None:
        scale = UnitScale.of_codes(length, velocity)

    def own(path: str) -> Any:
        """Return a variable in mm and s, or deg and s."""
        factor = scale.of(_units()[path])
        return variables[path] if factor == 1.0 else variables[path] / factor

    parameters = {key: own(path) for path, keys in SAME.items() if path in variables for key in keys}
    rotary = length in ANGLES or variables.get("Properties.MotionType") == 1
    if rotary:
        parameters["axis.unit"] = "deg"
    if variables.get("Modulo.Enable"):
        parameters["enc.modulo_factor"] = own("Modulo.Length")
    parameters |= ALWAYS
    result = {"controller": "nc", "drive": table["drive"], "parameters": parameters}
    gear = variables.get("LoadGear.Denominator", 1) / variables.get("LoadGear.Numerator", 1)
    if rotary:
        result["feed"] = _TURN * gear
    elif "Mechanics.LeadScrew" in variables:
        result["feed"] = own("Mechanics.LeadScrew") * gear
    if "feed" in result and (scale is not MILLIMETRES or gear != 1) and _FASTEST in parameters:
        # Units and gears leave a rounding, and no axis may be faster than its drive.
        parameters[_FASTEST] *= 1.0 - 1e-9
    return result
