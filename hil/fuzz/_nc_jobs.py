"""Blocks of NC axes as instructions of fuzz programs: their inputs are the parameters, by their own names."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING, Final

from hil.faults import Parameter
from motion.nc.blocks import MC_GearIn, MC_GearOut
from motion.nc.library import COMMANDS
from motion.nc.parameters import catalogue

if TYPE_CHECKING:
    from collections.abc import Mapping

    from motion.nc.blocks import Block
    from motion.nc.parameters import Value

WRITE: Final = "write_parameter"
RELEASE: Final = "release"
PACKET: Final = "external_setpoint"
COUPLED: Final = (MC_GearIn.block, MC_GearOut.block)
"""Those of an axis that follows another."""
ONLINE: Final[Mapping[str, tuple[Value, ...]]] = {
    "axis.position_lag_max": (0.5, 5.0, 10.0),
    "axis.position_lag_monitoring": (False, True),
    "axis.target_position_monitoring": (False, True),
    "axis.target_position_window": (0.05, 2.0),
    "axis.in_target_alarm": (False, True),
    "axis.in_target_timeout": (0.1, 1.0),
    "axis.motion_monitoring": (False, True),
    "axis.velocity_override_type": ("Original (iterated)", "Reduced (iterated)"),
    "axis.soft_limit_max_enable": (False, True),
    "axis.soft_limit_max": (50.0, 150.0),
    "axis.soft_limit_min_enable": (False, True),
    "axis.soft_limit_min": (-150.0, -50.0),
    "axis.position_correction": (False, True),
    "axis.allow_commands_slave": (False, True),
    "axis.allow_commands_ext_setpoint": (False, True),
    "axis.error_propagation_mode": ("DELAYED", "INSTANTANEOUS"),
    "axis.error_propagation_delay": (0.0, 0.2),
    "axis.default_jerk": (2250.0, 50_000.0),
    "ctrl.pos_kv": (2.0, 20.0),
    "ctrl.velocity_precontrol_weight": (0.5, 1.0),
    "ctrl.output_limit": (0.1, 0.5),
    "drv.output_limit_max": (0.2, 1.0),
    "drv.error_tolerance": ("IGNORE SELECTED ERRORS", "STANDARD"),
    "enc.modulo_tolerance_window": (0.0, 1.0),
}
"""Parameters that a program writes while the axis runs, and the values that are drawn."""

UNITS: Final = {
    "Position": "mm",
    "Distance": "mm",
    "Velocity": "mm/s",
    "VelocityDiff": "mm/s",
    "EndVelocity": "mm/s",
    "Acceleration": "mm/s2",
    "Deceleration": "mm/s2",
    "Jerk": "mm/s3",
    "Override": "%",
    "Backlash": "mm",
    "PositionCorrectionValue": "mm",
    **dict.fromkeys(("StartPosition", "EndPosition", "SlavePosition", "MasterSyncPosition"), "mm"),
    **dict.fromkeys(("SlaveSyncPosition", "MasterStartDistance", "MasterStopDistance"), "mm"),
    **dict.fromkeys(("Offset", "OffsetDistance", "PhaseShift", "PhasingDistance"), "mm"),
    **dict.fromkeys(("MasterOffset", "SlaveOffset", "LeadingValue", "FollowingValue"), "mm"),
    "ApproachLeadingValue": "mm",
    "AccelerationDiff": "mm/s2",
}
"""Units of the inputs that have one, by their names, for either make of controller."""
_STARTS: Final = "Execute"


def _parameter(name: str, default: object) -> Parameter:
    """Return an input of a block as a parameter."""
    summary = f"Input {name}"
    if isinstance(default, IntEnum):
        members = tuple(type(default).__members__)
        return Parameter(name, "text", summary, choices=members, default=default.name)
    if isinstance(default, bool):
        return Parameter(name, "bool", summary, default=default)
    if default is None:
        return Parameter(name, "text", f"{summary}: name of an axis", required=True)
    if not isinstance(default, (int, float)):
        raise TypeError(name)
    return Parameter(name, "float", summary, UNITS.get(name, ""), -1e12, 1e12, default=float(default))


def _inputs(block: type[Block]) -> tuple[Parameter, ...]:
    return tuple(_parameter(name, value) for name, value in block.inputs.items() if name != _STARTS)


NC_JOBS: Final[dict[str, tuple[Parameter, ...]]] = {
    **{name: _inputs(block) for name, block in COMMANDS.items()},
    RELEASE: (
        Parameter(
            "block",
            "text",
            "Block whose last instance gets Execute, Enable and the jog inputs FALSE",
            choices=tuple(COMMANDS),
            required=True,
        ),
    ),
    PACKET: (
        Parameter("position", "float", "ExtSetPos", "mm", -1e6, 1e6, default=0.0),
        Parameter("velocity", "float", "ExtSetVelo", "mm/s", -1e6, 1e6, default=0.0),
        Parameter("direction", "int", "ExtSetDirection", minimum=-1, maximum=1, default=0),
    ),
    WRITE: (
        Parameter("key", "text", "Key of the parameter", choices=tuple(catalogue()), required=True),
        Parameter("value", "text", "Value: a number, true, false, or the text of a choice", required=True),
    ),
}
"""Instructions for NC axes, with their parameters."""
