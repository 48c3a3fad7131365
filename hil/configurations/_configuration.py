"""A configuration: values of all factors and a seed, which together are a bench file."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import tomli_w

from fieldbus.errors import ConfigurationError
from hil.bench import BenchFile
from hil.bench.units import UnitScale, variables_in_units
from hil.configurations._machine import Dice, Machine, Table, cycle_ms, units_of
from hil.configurations._names import name_of, read_name
from hil.configurations.factors import CONFIGURATION, FACTORS, USUAL, Row, objection

_SERVO_US: Final = {"250us": 250, "200us": 200, "500us": 500}
_AXIS: Final = "z"
_DRIVE: Final = "z_drive"
_SCALE: Final = "z_scale"
_CAN: Final = "can0"
_SEGMENTS: Final = {"can": _CAN, "modbus-tcp": "net0", "modbus-rtu": "line0"}


@dataclass(frozen=True)
class Configuration:
    """Values of all factors and a seed.

    Args:
        values: A value for every factor.
        seed: Seed of the numbers.

    Raises:
        ConfigurationError: There is no such machine, or the seed is negative.

    """

    values: Row
    seed: int = 0

    def __post_init__(self) -> None:
        for name, factor in FACTORS.items():
            if self.values.get(name) not in factor.values:
                raise ConfigurationError(
                    f"configuration.{name}", self.values.get(name), ", ".join(factor.values)
                )
        reason = objection(self.values)
        if reason:
            raise ConfigurationError("configuration", dict(self.values), f"not this one: {reason}")
        if self.seed < 0:
            raise ConfigurationError("configuration.seed", self.seed, "0 or more")

    @property
    def name(self) -> str:
        """Short name: all values and the seed as digits."""
        return name_of(self.values, self.seed)

    @property
    def reference(self) -> str:
        """What `--bench` takes."""
        return CONFIGURATION + self.name

    @property
    def words(self) -> str:
        """The values that differ from those of the reference bench, in a line."""
        return (
            ", ".join(f"{name} {self.values[name]}" for name in FACTORS if self.values[name] != USUAL[name])
            or "as the reference bench"
        )

    @classmethod
    def of(cls, reference: str) -> Configuration:
        """Return the configuration that a reference or a name stands for.

        Raises:
            ConfigurationError: There is none with this name.

        """
        return cls(*read_name(reference))

    def bench_file(self) -> BenchFile:
        """Return the bench file of this configuration."""
        return _bench_file(self.reference)

    def text(self) -> str:
        """Return the content of the bench file."""
        lines = [
            f"# Configuration {self.name}, made by motion-hil; `hil benches show {self.reference}` prints it."
        ]
        lines += [
            f"# {factor.meaning}: {factor.values[self.values[name]]}" for name, factor in FACTORS.items()
        ]
        return "\n".join(lines) + "\n\n" + tomli_w.dumps(_tables(self))


@cache
def _bench_file(reference: str) -> BenchFile:
    return BenchFile(reference, Configuration.of(reference).text())


def _tables(configuration: Configuration) -> Table:
    """Return the tables of the bench file."""
    row = configuration.values
    machine = Machine(row, Dice(configuration.name))
    segment = _SEGMENTS[row["bus"]]
    tables: Table = {
        "bench": {
            "name": f"configuration {configuration.name}",
            "cycle_ms": cycle_ms(row),
            "servo_period_us": _SERVO_US[row["servo"]],
            "program_cycles": int(row["program"]),
            "cpu": row["cpu"],
        },
        "segment": {segment: _segment(row["bus"])},
        "drive": {_DRIVE: machine.drive(segment, 23)},
        "axis": {_AXIS: {"type": "positioning", "drive": _DRIVE}},
    }
    if row["interpolator"] != "1":
        tables["bench"]["interpolator_ms"] = cycle_ms(row) * int(row["interpolator"])
    axis = tables["axis"][_AXIS]
    axis["variables"] = machine.variables(_SERVO_US[row["servo"]] * 1e-6)
    if row["feedback"] in ("load", "both"):
        axis["encoders"] = [_SCALE] if row["feedback"] == "load" else [_DRIVE, _SCALE]
        tables["encoder"] = {_SCALE: machine.load_encoder(_DRIVE, segment, 41)}
    elif row["feedback"] == "second":
        axis["encoders"] = [f"{_DRIVE}.encoder2"]
    elif row["telegram"] in ("103", "106"):
        axis["encoders"] = [_DRIVE]
    _count_in_units(tables, machine)
    _add_neighbours(tables, configuration)
    return tables


def _segment(bus: str) -> Table:
    if bus == "can":
        return {"bitrate": 1_000_000}
    return {"kind": "modbus_tcp"} if bus == "modbus-tcp" else {"kind": "modbus_rtu", "baud": 115_200}


def _count_in_units(tables: Table, machine: Machine) -> None:
    """Give the numbers of the axis in its own units, and adjust its absolute encoder."""
    row = machine.row
    length, velocity = units_of(row)
    table = BenchFile("configuration", tomli_w.dumps(tables)).config.s7_axes[_AXIS]
    own: Table = tables["axis"][_AXIS]["variables"]
    own |= variables_in_units(table, length, velocity)
    if row["encoder"] != "incremental":
        scale = UnitScale.of_codes(length, velocity).length
        own |= {
            "StatusSensor[1].AbsEncoderOffset": -machine.first_value * scale,
            "StatusSensor[1].Adjusted": 1,
        }


def _add_neighbours(tables: Table, configuration: Configuration) -> None:
    row = configuration.values
    kind = row["neighbours"]
    if kind == "none":
        return
    own = {**USUAL} | {name: row[name] for name in ("cycle", "bus", "neighbours", "servo")}
    if kind == "twin":
        own |= {"profile": row["profile"], "telegram": "none" if row["profile"] == "cia402" else "105"}
        _add_axis(tables, configuration, "w", own, 4)
        return
    tables["segment"].setdefault(_CAN, _segment("can"))
    own["bus"] = "can"
    if kind == "mixed":
        _add_axis(tables, configuration, "a", own, 3)
        _add_axis(tables, configuration, "b", own | {"profile": "profidrive", "telegram": "5"}, 67)
        return
    other = Machine(own | {"profile": "profidrive", "telegram": "105"}, Dice(f"{configuration.name} p"))
    drive: Any = other.drive(_CAN, 9)
    tables["drive"]["p_drive"] = drive | {"telegram": 111}


def _add_axis(tables: Table, configuration: Configuration, name: str, row: Row, address: int) -> None:
    machine = Machine(row, Dice(f"{configuration.name} {name}"))
    segment = _SEGMENTS[row["bus"]]
    drive = f"{name}_drive"
    tables["drive"][drive] = machine.drive(segment, address)
    variables = machine.variables(_SERVO_US[row["servo"]] * 1e-6)
    tables["axis"][name] = {"type": "positioning", "drive": drive, "variables": variables}
