"""Definitions of the variables of technology objects: what the data says about each of them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from math import isnan
from operator import index
from typing import Any, Final

from fieldbus.errors import ConfigurationError, HilError
from motion.s7.data import load

_INTEGERS: Final = {
    "DINT": (-(1 << 31), (1 << 31) - 1),
    "UDINT": (0, (1 << 32) - 1),
    "UINT": (0, (1 << 16) - 1),
    "BYTE": (0, (1 << 8) - 1),
    "WORD": (0, (1 << 16) - 1),
    "DWORD": (0, (1 << 32) - 1),
    "VREF": (0, (1 << 16) - 1),
    "DB_ANY": (0, (1 << 16) - 1),
}
"""Range of each integer data type."""

_ARRAY: Final = re.compile(r"\[(\d+)\.\.(\d+)\]")


class VariableError(HilError):
    """Wrong use of a variable of a technology object; the message names the variable."""


class UnknownVariableError(VariableError):
    """The technology object has no such variable; the message names similar ones."""


class VariableAccessError(VariableError):
    """The access class of the variable does not permit this way of writing it; the
    message names the way that works.
    """


class ParameterError(VariableError):
    """`MC_WriteParameter` is rejected."""

    def __init__(self, message: str, error_id: int) -> None:
        super().__init__(message)
        self.error_id = error_id
        """ErrorID of the instruction."""


@dataclass(frozen=True)
class Variable:
    """One variable of a technology object type, as defined by the system.

    For elements of an array it is shared; `path` then carries the range of the index: `Sensor[1..4].Type`.
    """

    path: str
    data_type: str
    """`LREAL`, `BOOL`, `DINT`, `UDINT`, `UINT`, `BYTE`, `WORD`, `DWORD`, `VREF` or `DB_ANY`."""
    access: str
    """`DIR` direct, `CAL` on call of an instruction, `RES` restart, `RON` read only."""
    unit: str
    """Kind of unit (`velocity`, `position`, ...) or fixed unit (`1/min`, `percent`); empty without."""
    initial: float
    """Start value of a new technology object."""
    minimum: float | None
    maximum: float | None
    enum: dict[int, str]
    """Permitted values with their names; empty where the values have no names."""
    bits: dict[int, str]
    """Names of the bits in use of a word of bits."""
    variants: dict[str, tuple[float, float]]
    """Ranges for `LINEAR` and `ROTARY` objects, where the range depends on `Properties.MotionType`."""
    vendor_default: bool
    """Whether `initial` is a default of the vendor; otherwise it is a choice of this product."""

    def convert(self, path: str, value: object) -> float:
        """Return `value` as the data type stores it.

        Raises:
            VariableError: The value has another type (names `path`).

        """
        kind = self.data_type
        if kind == "LREAL":
            if isinstance(value, int | float) and not isinstance(value, bool):
                try:
                    return float(value)
                except OverflowError:
                    raise VariableError(
                        f"{path}: an integer of this size is outside the range of LREAL"
                    ) from None
        elif not isinstance(value, float | str):
            try:
                number = index(value)  # type: ignore[arg-type]
            except TypeError:
                pass
            else:
                if kind == "BOOL":
                    return bool(number) if number in (0, 1) else number
                if not isinstance(value, bool):
                    return number
        raise VariableError(f"{path} is of type {kind} and cannot take {value!r}")

    def limits(self, motion_type: int) -> tuple[float | None, float | None]:
        """Return the range; `motion_type` is 0 for a linear and 1 for a rotary object."""
        if self.variants:
            return self.variants["ROTARY" if motion_type == 1 else "LINEAR"]
        if self.minimum is None and self.data_type in _INTEGERS:
            return _INTEGERS[self.data_type]
        return self.minimum, self.maximum

    def permits(self, value: float, motion_type: int) -> bool:
        """Return whether `value`, of the right type, lies in the range; both ends are inside (VAR-016)."""
        if self.data_type == "BOOL":
            return isinstance(value, bool)
        if self.enum:
            return value in self.enum
        low, high = self.limits(motion_type)
        return not isnan(value) and (low is None or low <= value) and (high is None or value <= high)

    def allowed(self, motion_type: int) -> str:
        """Return in words what `permits` accepts."""
        if self.data_type == "BOOL":
            return "False or True"
        if self.enum:
            return ", ".join(f"{value} ({name})" for value, name in self.enum.items())
        low, high = self.limits(motion_type)
        return "any number" if low is None or high is None else f"{low:g} to {high:g}"


@dataclass(frozen=True)
class Parameter:
    """One parameter of `MC_WriteParameter`."""

    number: int
    variable: str | None
    """Path of the variable that it changes at once; None for a parameter that takes effect with a restart."""
    name: str
    data_type: str
    default: float


def object_types() -> tuple[str, ...]:
    """Return the technology object types that have variables."""
    return tuple(_data()["objects"])


@cache
def _data() -> Any:
    return load("to_variables")


@cache
def variables_of(object_type: str) -> tuple[Variable, ...]:
    """Return the variables of a technology object type.

    Raises:
        ConfigurationError: There is no such type.

    """
    objects = _data()["objects"]
    if object_type not in objects:
        raise ConfigurationError("object type", object_type, ", ".join(objects))
    entry = objects[object_type]
    own = tuple(_define(*row) for row in entry["variables"])
    return (*variables_of(entry["inherits"]), *own) if entry["inherits"] else own


def _define(  # noqa: PLR0917 - the columns of a row of the data file
    path: str,
    data_type: str,
    access: str,
    unit: str,
    initial: float,
    minimum: float | None,
    maximum: float | None,
    more: dict[str, Any] | None = None,
) -> Variable:
    """Return the definition made of one row."""
    more = more or {}
    return Variable(
        path,
        data_type,
        access,
        unit,
        initial,
        minimum,
        maximum,
        {int(value): name for value, name in more.get("enum", {}).items()},
        {int(bit): name for bit, name in more.get("bits", {}).items()},
        {kind: (low, high) for kind, (low, high) in more.get("variants", {}).items()},
        "vendor" in more,
    )


def elements(variable: Variable) -> list[str]:
    """Return the paths of a variable: one, or one for every element of the array that it is in."""
    found = _ARRAY.search(variable.path)
    if found is None:
        return [variable.path]
    head, tail = variable.path[: found.start()], variable.path[found.end() :]
    return [f"{head}[{number}]{tail}" for number in range(int(found[1]), int(found[2]) + 1)]


@cache
def paths_of(object_type: str) -> tuple[tuple[str, Variable], ...]:
    """Return all paths of a technology object type with their definitions, in the order of the data block.

    Raises:
        ConfigurationError: There is no such type.

    """
    return tuple((path, variable) for variable in variables_of(object_type) for path in elements(variable))


@cache
def parameters_of(object_type: str) -> dict[int, Parameter]:
    """Return the parameters of `MC_WriteParameter` of a technology object type by their numbers."""
    return {
        row["number"]: Parameter(
            row["number"],
            row["variable"],
            row["name"] or row["variable"],
            row["data_type"],
            row["default"] or 0.0,
        )
        for row in _data()["parameters"]
        if object_type in row["objects"]
    }
