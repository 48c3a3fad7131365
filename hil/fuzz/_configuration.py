"""Configurations: what a program changes in the bench file before it begins, as JSON values."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError
from hil.bench.units import UnitScale, variables_in_units
from hil.errors import CannotRunError
from reports.json_types import Json, JsonObject

if TYPE_CHECKING:
    from hil.bench import BenchFile as OwnBenchFile
    from hil.bench.bench import Bench
    from hil.protocols import BenchFile

UNITS: Final = "units"
"""The part that says in which units the axis counts; its values are codes of
`Units.LengthUnit` and `.VelocityUnit`.
"""


MACHINE: Final = "other machine"
"""The part that takes another bench file: its only value is the `name` of a configuration of the bench."""


@dataclass(frozen=True)
class Configuration:
    """What is laid over a bench file.

    Args:
        parts: By a name that says what it is about, tables of a bench file; the part `units` has the
            codes of `length` and `velocity` instead, and tells the same machine to the axis in these units;
            the part `other machine` has the `name` of a configuration of the bench, which takes the place of
            the bench file.

    """

    parts: Mapping[str, Mapping[str, Json]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name, part in self.parts.items():
            if not isinstance(part, Mapping):
                raise ConfigurationError(f"configuration.{name}", part, "a table")
        units = self.parts.get(UNITS)
        if units is not None:
            UnitScale.of_codes(*_codes(units))
        if MACHINE in self.parts:
            self._machine_name()

    def __bool__(self) -> bool:
        return bool(self.parts)

    def _machine_name(self) -> str:
        from hil.configurations import read_name

        part = self.parts[MACHINE]
        name = part.get("name")
        if not isinstance(name, str) or len(part) > 1:
            raise ConfigurationError(f"configuration.{MACHINE}", dict(part), "the name of a configuration")
        read_name(name)
        return name

    def machine(self) -> OwnBenchFile:
        """Return the bench file of the part `other machine`."""
        from hil.configurations import Configuration as Machine

        return Machine.of(self._machine_name()).bench_file()

    def without(self, name: str) -> Configuration:
        """Return the configuration without one of its parts."""
        return Configuration({key: part for key, part in self.parts.items() if key != name})

    def to_json(self) -> JsonObject:
        """Return the configuration as JSON values."""
        return {name: dict(part) for name, part in self.parts.items()}

    @classmethod
    def from_json(cls, content: object) -> Configuration:
        """Build a configuration from JSON values; `ConfigurationError` names the part that is wrong."""
        if not isinstance(content, Mapping):
            raise ConfigurationError("configuration", content, "an object with parts by name")
        return cls(dict(content))

    def applied_to(self, bench_file: BenchFile[Bench]) -> BenchFile[Bench]:
        """Return a bench file with this configuration laid over it; the same one when nothing changes.

        Raises:
            ConfigurationError: The result is no valid bench file.
            CannotRunError: The bench is no file whose tables can be changed.

        """
        if not self.parts:
            return bench_file
        bench_file = self.machine() if MACHINE in self.parts else bench_file_of(bench_file)
        for name, part in self.parts.items():
            if name not in (UNITS, MACHINE):
                bench_file = bench_file.configured(part)
        units = self.parts.get(UNITS)
        return bench_file if units is None else bench_file.configured(_in_units(bench_file, *_codes(units)))

    def lines(self) -> Iterator[str]:
        """Yield a line per value."""
        for name, part in self.parts.items():
            for path, value in _leaves(part):
                yield f"{name}: {path} = {json.dumps(value)}"


def _codes(units: Mapping[str, object]) -> tuple[int, int]:
    """Return the codes of length and velocity of the part `units`."""
    length, velocity = units.get("length"), units.get("velocity")
    if len(units) == 2 and type(length) is int and type(velocity) is int:
        return length, velocity
    raise ConfigurationError("configuration.units", dict(units), "codes of length and velocity")


def _leaves(table: Mapping[str, object], path: str = "") -> Iterator[tuple[str, object]]:
    for key, value in table.items():
        here = f"{path}.{key}" if path else key
        if isinstance(value, Mapping) and value:
            yield from _leaves(value, here)
        else:
            yield here, value


def bench_file_of(bench_file: BenchFile[Bench]) -> OwnBenchFile:
    """Return a bench that comes from a bench file.

    Raises:
        CannotRunError: It comes from none: it has no tables that could be changed.

    """
    from hil.bench import BenchFile as OwnBenchFile

    if not isinstance(bench_file, OwnBenchFile):
        raise CannotRunError(
            f"the bench {bench_file.name!r} comes from no bench file: it has no configurations"
        )
    return bench_file


def _in_units(bench_file: OwnBenchFile, length: int, velocity: int) -> JsonObject:
    """Return the variables of all axes with a position, as numbers in other units: the
    same machine, given otherwise.
    """
    tables = {
        name: {"variables": variables_in_units(axis, length, velocity)}
        for name, axis in bench_file.config.s7_axes.items()
        if axis.type != "speed"
    }
    return {"axis": tables}
