"""Columns that the recorder takes from a device, declared with unit and texts in one table per device."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

from emulators.drive.core import RPM, ServoCore
from emulators.mechanics import AxisMechanics
from fieldbus.canopen import NmtState

LOAD: Final = "load"
"""Unit that stands for that of the load: m or rad."""
_PER_RPM: Final = 1.0 / RPM


class Column(NamedTuple):
    """One column."""

    name: str
    unit: str = ""
    """Unit of the values; `LOAD` and `LOAD/s` stand for m or rad, and m/s or rad/s."""
    texts: Mapping[int, str] = {}
    """Texts of the values of a column that shows a state."""


NMT_STATE: Final = Column("nmt_state", texts={int(state): state.name for state in NmtState})
SERVO: Final = (
    Column("position", LOAD),
    Column("velocity", f"{LOAD}/s"),
    Column("motor_speed", "rpm"),
    Column("torque", "Nm"),
    Column("torque_demand", "Nm"),
    Column("velocity_demand", "rpm"),
)
"""What every servo drive shows first; position, velocity and speed are the true ones (STP-550)."""


def servo_values(mechanics: AxisMechanics, core: ServoCore) -> tuple[float, ...]:
    """Return the values of `SERVO`."""
    return (
        mechanics.position,
        mechanics.velocity,
        mechanics.motor_speed * _PER_RPM,
        core.torque,
        core.torque_demand,
        core.velocity_demand * _PER_RPM,
    )


def names_and_units(columns: Iterable[Column], load_unit: str = "") -> tuple[tuple[str, str], ...]:
    """Return (name, unit) of columns; `load_unit` is m or rad."""
    return tuple((one.name, one.unit.replace(LOAD, load_unit)) for one in columns)


def value_texts(columns: Iterable[Column]) -> dict[str, dict[int, str]]:
    """Return the texts of the columns that show a state, by name."""
    return {one.name: dict(one.texts) for one in columns if one.texts}
