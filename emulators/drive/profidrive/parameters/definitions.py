"""What a parameter of a PROFIdrive device is: definitions, and the file from which they come.

A file is TOML. A key names the parameter as a parameter list does, `r` for display, `p` for setting; values:

    [parameters]
    p1120 = { type = "F32", text = "ramp-up time", unit = "s", low = 0, high = 999999, default = 10 }

    type     name of a data type: BOOL I8 I16 I32 U8 U16 U32 F32 N2 N4 V2 OCTETS STRING
    text     name; a parameter without one has no description
    size     elements, when it is an array (1..1024); strings are arrays of bytes
    default  factory value: one for all elements, a list, or a text for a STRING
    unit     as in the manual
    low/high limits; those of the data type when they are missing
    values   the only permitted values
    write    always, S1, pulses_off, commissioning, reset (only to 0); settings only
    texts    texts of the elements
    save     false: neither saved nor listed as changed
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import TypeCode
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import Value, pack_values, unpack_values
from fieldbus.toml_text import toml_content

FACTORY: Final = Path(__file__).with_name("parameters.toml")
"""The parameter list of the emulated drive."""
LARGEST_ARRAY: Final = 1024

TYPE_NAMES: Final = MappingProxyType(
    {
        "BOOL": TypeCode.BOOLEAN,
        "I8": TypeCode.INTEGER8,
        "I16": TypeCode.INTEGER16,
        "I32": TypeCode.INTEGER32,
        "U8": TypeCode.UNSIGNED8,
        "U16": TypeCode.UNSIGNED16,
        "U32": TypeCode.UNSIGNED32,
        "F32": TypeCode.FLOAT32,
        "N2": TypeCode.N2,
        "N4": TypeCode.N4,
        "V2": TypeCode.V2,
        "OCTETS": TypeCode.OCTET_STRING,
        "STRING": TypeCode.VISIBLE_STRING,
    }
)
"""Names of data types in a parameter file."""
_BITS: Final[Mapping[int, tuple[int, bool]]] = {
    TypeCode.BOOLEAN: (1, False),
    TypeCode.INTEGER8: (8, True),
    TypeCode.INTEGER16: (16, True),
    TypeCode.INTEGER32: (32, True),
    TypeCode.UNSIGNED8: (8, False),
    TypeCode.UNSIGNED16: (16, False),
    TypeCode.UNSIGNED32: (32, False),
    TypeCode.N2: (16, True),
    TypeCode.N4: (32, True),
    TypeCode.V2: (16, False),
    TypeCode.OCTET_STRING: (8, False),
    TypeCode.VISIBLE_STRING: (8, False),
}
_LARGEST_FLOAT: Final = struct.unpack(">f", bytes.fromhex("7f7fffff"))[0]
_KEYS: Final = frozenset(
    {"type", "text", "size", "default", "unit", "low", "high", "values", "write", "texts", "save"}
)
_NAME: Final = re.compile(r"([rp])(\d{1,5})")


class WriteRule(StrEnum):
    """When a parameter may be written."""

    NEVER = "never"
    ALWAYS = "always"
    INHIBITED = "S1"
    """In state S1, switching on inhibited."""
    PULSES_OFF = "pulses_off"
    COMMISSIONING = "commissioning"
    """With p0009 or p0010 other than 0."""
    RESET = "reset"
    """Any time, but only with 0."""


@dataclass(frozen=True, kw_only=True)
class ParameterDefinition:
    """A parameter.

    Args:
        number: PNU, 1..65535.
        type: Data type of an element.
        text: Name; empty: the parameter has no description.
        size: Elements of an array, 1..1024; None = no array.
        defaults: Factory values, one per element.
        unit: As in the manual.
        low: Lowest value; NaN-free.
        high: Highest value.
        values: The only permitted values; empty = all within the limits.
        write: When it may be written.
        texts: Texts of the elements, up to 16 characters each on the wire.
        save: Whether it is saved and listed as changed.

    Raises:
        ConfigurationError: Values contradict each other or the data type.

    """

    number: int
    type: TypeCode
    text: str = ""
    size: int | None = None
    defaults: tuple[int | float, ...] = (0,)
    unit: str = ""
    low: float = -math.inf
    high: float = math.inf
    values: frozenset[int] = frozenset()
    write: WriteRule = WriteRule.NEVER
    texts: tuple[str, ...] = ()
    save: bool = True

    def __post_init__(self) -> None:
        where = self.name
        if not 1 <= self.number <= 0xFFFF:
            raise ConfigurationError("parameter number", self.number, "1..65535")
        if self.type not in TYPE_NAMES.values():
            raise ConfigurationError(f"{where} type", self.type, ", ".join(TYPE_NAMES))
        if self.size is not None and not 1 <= self.size <= LARGEST_ARRAY:
            raise ConfigurationError(f"{where} size", self.size, f"1..{LARGEST_ARRAY}")
        if len(self.defaults) != self.elements:
            raise ConfigurationError(f"{where} default", self.defaults, f"{self.elements} values")
        low, high = self.limits
        if not low <= high:
            raise ConfigurationError(f"{where} low, high", (self.low, self.high), "low <= high")
        for value in self.defaults:
            allowed = f"{low:g}..{high:g}" if not self.values else ", ".join(map(str, sorted(self.values)))
            if not low <= value <= high or (self.values and value not in self.values):
                raise ConfigurationError(f"{where} default", value, allowed)

    @property
    def name(self) -> str:
        """As in a parameter list: r0002, p1120."""
        return f"{'r' if self.write is WriteRule.NEVER else 'p'}{self.number:04}"

    @property
    def elements(self) -> int:
        """Number of values."""
        return 1 if self.size is None else self.size

    @property
    def limits(self) -> tuple[float, float]:
        """Lowest and highest value, those of the data type included."""
        low, high = range_of(self.type)
        return max(low, self.low), min(high, self.high)

    def fitted(self, value: float) -> int | float:
        """Return a computed value as the data type can show it: rounded, held at the ends of the range; NaN
        is 0.
        """
        if value != value:  # noqa: PLR0124 - not-a-number
            return 0
        low, high = range_of(self.type)
        held = min(max(value, low), high)
        return _single(held) if self.type == TypeCode.FLOAT32 else round(held)

    def reinterpreted(self, code: int, value: Value) -> int | float:
        """Return a value that came in another format of the same size as one of the data type.

        Raises:
            ParameterAccessError: The sizes differ.

        """
        if code == self.type:
            return number_of(value)
        return number_of(unpack_values(self.type, pack_values(code, [value]))[0])


def number_of(value: Value) -> int | float:
    """Return a value that is a number.

    Raises:
        ParameterAccessError: It is one of a type of several bytes, such as a date.

    """
    if isinstance(value, bytes):
        raise ParameterAccessError(f"{value!r} is no number", 0x05)
    return value


def _single(value: float) -> float:
    """Return the nearest number of single precision: what comes back over the bus has to compare equal."""
    return float(struct.unpack(">f", struct.pack(">f", value))[0])


def range_of(code: int) -> tuple[float, float]:
    """Return the lowest and highest value of a data type of `TYPE_NAMES`."""
    if code == TypeCode.FLOAT32:
        return -_LARGEST_FLOAT, _LARGEST_FLOAT
    bits, signed = _BITS[code]
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)


@cache
def factory_definitions() -> tuple[ParameterDefinition, ...]:
    """Return the parameters of the emulated drive, read once."""
    return load_definitions(FACTORY)


def load_definitions(path: Path = FACTORY) -> tuple[ParameterDefinition, ...]:
    """Return the parameters of a file, ascending by number.

    Raises:
        ConfigurationError: The file cannot be read, or a parameter in it is wrong; the message names it.

    """
    content = toml_content(path)
    rows = content.get("parameters")
    if set(content) != {"parameters"} or not isinstance(rows, dict):
        raise ConfigurationError(str(path), sorted(content), "one table, [parameters]")
    found: dict[int, ParameterDefinition] = {}
    for key, row in rows.items():
        definition = _definition(f"{path.name}, {key}", key, row)
        if definition.number in found:
            raise ConfigurationError(f"{path.name}, {key}", key, "each parameter number once")
        found[definition.number] = definition
    return tuple(found[number] for number in sorted(found))


def _definition(where: str, key: str, row: Any) -> ParameterDefinition:
    name = _NAME.fullmatch(key)
    if name is None:
        raise ConfigurationError(where, key, "r or p and a number, as in p1120")
    if not isinstance(row, dict) or not set(row) <= _KEYS:
        raise ConfigurationError(where, row, f"a table with {', '.join(sorted(_KEYS))}")
    code = TYPE_NAMES.get(row.get("type", ""))
    if code is None:
        raise ConfigurationError(f"{where}, type", row.get("type"), ", ".join(TYPE_NAMES))
    size = row.get("size")
    if size is not None and (type(size) is not int or not 1 <= size <= LARGEST_ARRAY):
        raise ConfigurationError(f"{where}, size", size, f"1..{LARGEST_ARRAY}")
    rule = row.get("write", "always" if name[1] == "p" else "never")
    if rule not in set(WriteRule) or (rule == WriteRule.NEVER) is not (name[1] == "r"):
        raise ConfigurationError(
            f"{where}, write", rule, f"for a p: {', '.join(set(WriteRule) - {WriteRule.NEVER})}"
        )
    for one in ("low", "high"):
        if one in row and not _is_number(row[one]):
            raise ConfigurationError(f"{where}, {one}", row[one], "a number")
    values, texts = row.get("values", []), row.get("texts", [])
    if not _is_list(values, int) or not _is_list(texts, str):
        raise ConfigurationError(where, (values, texts), "lists: whole numbers as values, texts as texts")
    for one, kind in (("text", str), ("unit", str), ("save", bool)):
        if one in row and not isinstance(row[one], kind):
            raise ConfigurationError(f"{where}, {one}", row[one], kind.__name__)
    return ParameterDefinition(
        number=int(name[2]),
        type=code,
        text=row.get("text", ""),
        size=size,
        defaults=_defaults(where, row.get("default", 0), size or 1, code),
        unit=row.get("unit", ""),
        low=_limit(row.get("low", -math.inf), code),
        high=_limit(row.get("high", math.inf), code),
        values=frozenset(values),
        write=WriteRule(rule),
        texts=tuple(texts),
        save=row.get("save", True),
    )


def _defaults(where: str, given: Any, elements: int, code: TypeCode) -> tuple[int | float, ...]:
    if isinstance(given, str) and code == TypeCode.VISIBLE_STRING:
        raw = given.encode("latin-1", "replace")
        if len(raw) > elements:
            raise ConfigurationError(f"{where}, default", given, f"at most {elements} characters")
        return tuple(raw.ljust(elements, b"\0"))
    row = given if isinstance(given, list) else [given] * elements
    kind = (int, float) if code == TypeCode.FLOAT32 else (int,)
    fits = all(_is_number(value) and isinstance(value, kind) and abs(value) < _LARGEST_FLOAT for value in row)
    if len(row) != elements or not fits:
        raise ConfigurationError(f"{where}, default", given, f"one value or {elements}, of the data type")
    return tuple(_single(value) for value in row) if code == TypeCode.FLOAT32 else tuple(row)


def _limit(value: float, code: TypeCode) -> float:
    return _single(value) if code == TypeCode.FLOAT32 and abs(value) < _LARGEST_FLOAT else value


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _is_list(value: Any, kind: type) -> bool:
    return (
        isinstance(value, Sequence) and not isinstance(value, str) and all(type(one) is kind for one in value)
    )
