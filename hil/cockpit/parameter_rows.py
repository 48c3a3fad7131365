"""The parameters of a PROFIdrive drive for the page: rows of a list, and texts as values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Final

from emulators.drive.profidrive import WriteRule
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import TypeCode

if TYPE_CHECKING:
    from emulators.drive.profidrive import ParameterDefinition
    from reports.json_types import JsonObject

_MOST_ELEMENTS: Final = 64
"""Elements of an array that are listed."""
_WHEN: Final = {
    WriteRule.NEVER: "",
    WriteRule.ALWAYS: "",
    WriteRule.INHIBITED: "written in S1, switching on inhibited",
    WriteRule.PULSES_OFF: "written with pulses off",
    WriteRule.COMMISSIONING: "written with p0009 or p0010 other than 0",
    WriteRule.RESET: "only 0 is written",
}


def parameter_rows(definitions: Iterable[ParameterDefinition]) -> Iterator[JsonObject]:
    """Yield a row for each element, as `BusView.objects` has it of entries of an EDS."""
    for one in definitions:
        low, high = one.limits
        name = f"{one.text}, {one.unit}" if one.unit else one.text
        for index in range(min(one.elements, _MOST_ELEMENTS)):
            element = one.texts[index] if index < len(one.texts) else ""
            yield {
                "index": one.number,
                "sub": index,
                "object": one.name if one.size is None else f"{one.name}[{index}]",
                "name": f"{name}: {element}" if element else name,
                "type": one.type.name,
                "access": "r" if one.write is WriteRule.NEVER else "rw",
                "default": one.defaults[index],
                "low": low if one.type != TypeCode.FLOAT32 or low > -1e38 else None,
                "high": high if one.type != TypeCode.FLOAT32 or high < 1e38 else None,
                "note": _WHEN[one.write],
            }


def parameter_value(one: ParameterDefinition, text: str) -> float:
    """Return the number that a text stands for, checked by type and limits.

    Raises:
        ConfigurationError: The parameter is read-only, or the text is no value of it; the message says what
            is allowed.

    """
    where = f"{one.name} {one.text}"
    if one.write is WriteRule.NEVER:
        raise ConfigurationError(where, text, "nothing: it is read-only")
    low, high = one.limits
    allowed = f"a number {low:g} to {high:g}"
    if one.values:
        allowed = f"one of {', '.join(map(str, sorted(one.values)))}"
    try:
        number = float(text) if one.type == TypeCode.FLOAT32 else float(int(text.strip(), 0))
    except ValueError:
        raise ConfigurationError(where, text, allowed) from None
    if not (math.isfinite(number) and low <= number <= high) or (one.values and number not in one.values):
        raise ConfigurationError(where, text, allowed)
    return number


def parameter_text(one: ParameterDefinition, value: float) -> str:
    """Return a value with its unit."""
    shown = f"{value:g}" if one.type == TypeCode.FLOAT32 else f"{round(value)}"
    return f"{shown} {one.unit}".rstrip()
