"""Configurations of benches with NC axes: what a bench file may say otherwise of axis, tasks and machine."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from hypothesis import strategies as st

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hypothesis.strategies import SearchStrategy

    from hil.bench.config import BenchConfig
    from reports.json_types import Json

Table = dict[str, "Json"]

_PARAMETERS: Final[Mapping[str, tuple[Mapping[str, Json], ...]]] = {
    "limits": (
        {
            "axis.soft_limit_min_enable": True,
            "axis.soft_limit_min": -80.0,
            "axis.soft_limit_max_enable": True,
            "axis.soft_limit_max": 80.0,
        },
    ),
    "dynamics": ({"axis.default_jerk": 20_000.0}, {"axis.default_deceleration": 800.0}),
    "divider": ({"axis.cycle_divider": 2}, {"axis.cycle_divider": 3, "axis.cycle_modulo": 1}),
    "override": ({"axis.velocity_override_type": "Original (iterated)"},),
    "lag": ({"axis.position_lag_monitoring": False}, {"axis.position_lag_filter_time": 0.0}),
    "target": (
        {"axis.target_position_monitoring": False},
        {"axis.in_target_alarm": True, "axis.in_target_timeout": 0.3},
    ),
    "motion": ({"axis.motion_monitoring": True, "axis.motion_monitoring_window": 0.0005},),
    "commands": (
        {"axis.allow_commands_slave": False},
        {"axis.allow_commands_ext_setpoint": True},
    ),
    "encoder": ({"enc.encoder_mode": "POSVELOACC"}, {"enc.filter_time_velocity": 0.05}),
    "homing": (
        {"enc.homing_invert_cam_search": True},
        {"enc.reference_mode": "Software Sync"},
        {"enc.homing_sensor_source": "Digital Input 3", "enc.home_position": 100.0},
    ),
    "tolerance": ({"drv.error_tolerance": "IGNORE SELECTED ERRORS"},),
}
_OF_VELOCITY: Final[Mapping[str, tuple[Mapping[str, Json], ...]]] = {
    "controller": (
        {
            "ctrl.type": "Position controller with two P constants (with Ka)",
            "ctrl.pos_kv_standstill": 20.0,
            "ctrl.pos_kv_moving": 10.0,
        },
        {"ctrl.type": "Position controller PID (with Ka)", "ctrl.pos_kv": 10.0, "ctrl.pos_ti_tn": 0.5},
        {"ctrl.pos_kv": 5.0, "ctrl.velocity_precontrol_weight": 0.8},
    ),
    "output": ({"drv.output_delay_velocity": 0.002}, {"ctrl.output_limit": 0.2}),
}
"""Parts that matter where the NC closes the position loop."""
_MACHINES: Final = ({"load_mass_kg": 5.0}, {"coulomb_friction_n": 150.0})


def nc_configurations(config: BenchConfig) -> Mapping[str, SearchStrategy[Table]]:
    """Return the parts of a configuration for the first axis of a bench and its drive, by name.

    Args:
        config: The content of the bench file (`BenchFile.config`).

    """
    name, axis = next(iter(config.nc_axes.items()))

    def of_axis(values: Mapping[str, Json]) -> Table:
        return {"axis": {name: {"parameters": dict(values)}}}

    def one(tables: list[Table]) -> SearchStrategy[Table]:
        return st.sampled_from(tables)

    choices = dict(_PARAMETERS)
    if axis.interface == "velocity":
        choices |= _OF_VELOCITY
    parts = {part: one([of_axis(values) for values in several]) for part, several in choices.items()}
    parts["program"] = one([{"bench": {"program_cycles": cycles}} for cycles in (2, 3)])
    parts["watchdog"] = one(
        [{"nc": {"parameters": {"task.watchdog_cycles": cycles}}} for cycles in (0, 1, 50)]
    )
    parts["preparation"] = one([{"nc": {"svb_ms": 40.0}}])
    drive = config.drive.get(axis.drive)
    if drive is None:
        return parts
    if drive.profile not in {"tm_pto", "two_speed"}:
        parts["machine"] = one([{"drive": {axis.drive: {"mechanics": table}}} for table in _MACHINES])
    if drive.profile == "cia402":
        parts["interface"] = one(
            [{"axis": {name: {"interface": interface}}} for interface in ("position", "torque")]
        )
        parts["cycle"] = one([{"bench": {"cycle_ms": cycle}} for cycle in (1, 2, 4)])
    return parts
