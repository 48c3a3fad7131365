"""The columns that a recorder takes from a drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emulators.drive.core import RPM
from fieldbus.canopen import NmtState
from fieldbus.cia402 import DriveState, Mode

if TYPE_CHECKING:
    from emulators.drive.cia402.drive import CiA402Drive


def trace_columns(position_unit: str) -> tuple[tuple[str, str], ...]:
    """Return (name, unit) of the columns; `position_unit` is m or rad."""
    return (
        ("position", position_unit),
        ("velocity", f"{position_unit}/s"),
        ("motor_speed", "rpm"),
        ("torque", "Nm"),
        ("torque_demand", "Nm"),
        ("velocity_demand", "rpm"),
        ("following_error", "pu"),
        ("encoder_increments", "inc"),
        ("controlword", ""),
        ("statusword", ""),
        ("state", ""),
        ("mode", ""),
        ("nmt_state", ""),
        ("inputs", ""),
        ("outputs", ""),
        ("brake_closed", ""),
        ("error_code", ""),
    )


TRACE_ENUMS: Final[dict[str, dict[int, str]]] = {
    "state": {int(state): state.text for state in DriveState},
    "mode": {0: "none", **{int(mode): mode.short for mode in Mode}},
    "nmt_state": {int(state): state.name for state in NmtState},
}
"""Texts of the columns that show a state."""

_PER_RPM: Final = 1.0 / RPM


def trace_row(drive: CiA402Drive) -> tuple[float, ...]:
    """Return the present values: position, velocity and speed are those of the true mechanics (STP-550)."""
    core = drive.core
    mechanics = drive.mechanics
    values = drive.slave.values
    return (
        mechanics.position,
        mechanics.velocity,
        mechanics.motor_speed * _PER_RPM,
        core.torque,
        core.torque_demand,
        core.velocity_demand * _PER_RPM,
        drive.axis.following_error,
        core.encoder.increments,
        values[0x604000],
        values[0x604100],
        drive.machine.state,
        drive.function.mode.number,
        drive.slave.nmt_state,
        drive.inputs,
        drive.parameters.outputs,
        core.brake.holding_torque_Nm > 0.0,
        values[0x603F00],
    )
