"""The columns that a recorder takes from a PROFIdrive axis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emulators.drive.core import RPM
from emulators.drive.profidrive.statemachine import AxisState

if TYPE_CHECKING:
    from emulators.drive.profidrive.drive import ProfidriveDrive

_SETPOINTS: Final = ("nsoll", "xerr", "kpc", "m_add")
"""Setpoints of the telegram as they came, whole numbers: N4 or N2, increments of G1_XIST1, 0.001 1/s, N2; 0
without such a word.
"""
_SECOND: Final = (("g2_zsw", ""), ("g2_xist1", "inc"), ("g2_xist2", ""))


def trace_columns(
    position_unit: str, bus: tuple[str, ...] = (), *, second: bool = False
) -> tuple[tuple[str, str], ...]:
    """Return (name, unit) of the columns; `position_unit` is m or rad, `bus` are the columns of the
    transport, `second` adds those of G2.
    """
    return (
        ("position", position_unit),
        ("velocity", f"{position_unit}/s"),
        ("motor_speed", "rpm"),
        ("torque", "Nm"),
        ("torque_demand", "Nm"),
        ("velocity_demand", "rpm"),
        ("following_error", "rad"),
        ("encoder_increments", "inc"),
        ("drive_stw1", ""),
        ("drive_zsw1", ""),
        ("drive_stw2", ""),
        ("drive_zsw2", ""),
        ("state", ""),
        *((name, "") for name in bus),
        ("inputs", ""),
        ("brake_closed", ""),
        ("fault_number", ""),
        ("warning_number", ""),
        ("safety", ""),
        *((name, "") for name in _SETPOINTS),
        *(_SECOND if second else ()),
    )


TRACE_ENUMS: Final[dict[str, dict[int, str]]] = {
    "state": {state.number: state.text for state in AxisState},
}
"""Texts of the columns that show a state."""

_PER_RPM: Final = 1.0 / RPM


def trace_row(drive: ProfidriveDrive, *bus: float) -> tuple[float, ...]:
    """Return the present values: position, velocity and speed are those of the true mechanics (STP-550)."""
    core = drive.core
    mechanics = drive.mechanics
    faults = drive.faults
    data = drive.data
    row = data.row
    nsoll, xerr, kpc, m_add = data.control_places
    return (
        mechanics.position,
        mechanics.velocity,
        mechanics.motor_speed * _PER_RPM,
        core.torque,
        core.torque_demand,
        core.velocity_demand * _PER_RPM,
        core.position_demand - core.position,
        drive.encoder.increments,
        data.stw1,
        drive.words.zsw1(),
        data.stw2,
        drive.words.zsw2(),
        drive.operation.machine.state.number,
        *bus,
        drive.digital_inputs.value,
        core.brake.torque_Nm > 0.0 and core.brake.holding_torque_Nm > 0.0,
        faults.number,
        faults.warning_number,
        drive.safety.s_zsw1b(),
        row[nsoll],
        row[xerr],
        row[kpc],
        row[m_add],
        *(() if drive.second is None else drive.second.words),
    )
