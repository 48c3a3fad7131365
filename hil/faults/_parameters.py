"""Parameters of faults: descriptions with type, unit and range, and the values of one fault."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from reports.json_types import JsonObject

Scalar = str | int | float | bool
ParameterType = Literal["float", "int", "bool", "text"]
Environment = Literal["virtual", "live", "hardware"]
V = TypeVar("V", str, int, float, bool)
ENVIRONMENTS: tuple[Environment, ...] = ("virtual", "live", "hardware")


@dataclass(frozen=True)
class Parameter:
    """One parameter of a fault type."""

    name: str
    type: ParameterType
    summary: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    default: Scalar | None = None
    """Value when not given; None: not given has a meaning of its own, stated in the summary."""
    required: bool = False
    choices: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        """What a value may be, as a text."""
        if self.choices:
            return ", ".join(self.choices)
        words = {"float": "a number", "int": "a whole number", "bool": "true or false", "text": "a text"}[
            self.type
        ]
        unit = f" {self.unit}" if self.unit else ""
        form = ".0f" if self.type == "int" else "g"
        if self.minimum is not None and self.maximum is not None:
            return f"{words} {self.minimum:{form}}..{self.maximum:{form}}{unit}"
        if self.minimum is not None:
            return f"{words} >= {self.minimum:{form}}{unit}"
        return f"{words}{unit}"

    def check(self, where: str, value: Any) -> Scalar:
        """Return `value` in the right type.

        Raises:
            ConfigurationError: The value has the wrong type or lies outside the range.

        """
        good = {
            "float": isinstance(value, (int, float)) and not isinstance(value, bool),
            "int": isinstance(value, int) and not isinstance(value, bool),
            "bool": isinstance(value, bool),
            "text": isinstance(value, str),
        }[self.type]
        if good and self.choices:
            good = value in self.choices
        if good and self.type == "float":
            try:
                value = float(value)
                good = math.isfinite(value)
            except OverflowError:
                good = False
        if good and self.type in {"float", "int"}:
            good = (self.minimum is None or value >= self.minimum) and (
                self.maximum is None or value <= self.maximum
            )
        if not good:
            raise ConfigurationError(f"{where}.{self.name}", value, self.allowed)
        checked: Scalar = value
        return checked

    def to_dict(self) -> JsonObject:
        """Return the description as JSON values."""
        result: JsonObject = {
            "name": self.name,
            "type": self.type,
            "unit": self.unit,
            "summary": self.summary,
        }
        result["range"] = (
            list(self.choices)
            if self.choices
            else None
            if self.minimum is None and self.maximum is None
            else [self.minimum, self.maximum]
        )
        result["required"] = self.required
        result["default"] = self.default
        return result


class Values:
    """The parameters of one fault, with defaults where nothing was given.

    Args:
        parameters: What the kind has.
        given: What was given, checked.

    """

    def __init__(self, parameters: Sequence[Parameter], given: Mapping[str, Scalar]) -> None:
        self._values = {one.name: given.get(one.name, one.default) for one in parameters}

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Values) and self._values == other._values

    __hash__ = None  # type: ignore[assignment]  # compared, never a key

    def get(self, name: str) -> Scalar | None:
        """Return a value, whatever its type; None: neither given nor a default."""
        return self._values[name]

    def number(self, name: str) -> float:
        """Return a number."""
        return float(self._typed(name, (int, float)))

    def integer(self, name: str) -> int:
        """Return a whole number."""
        return self._typed(name, int)

    def optional_integer(self, name: str) -> int | None:
        """Return a whole number, or None where none was given and there is no default."""
        return None if self._values[name] is None else self.integer(name)

    def flag(self, name: str) -> bool:
        """Return a truth value."""
        return self._typed(name, bool)

    def text(self, name: str) -> str:
        """Return a text."""
        return self._typed(name, str)

    def names(self, name: str) -> list[str]:
        """Return a text as a list of names with commas between."""
        return [one.strip() for one in self.text(name).split(",") if one.strip()]

    def _typed(self, name: str, kind: type[V] | tuple[type[V], ...]) -> V:
        value = self._values[name]
        if not isinstance(value, kind):
            raise TypeError(f"parameter {name!r} is {value!r}")
        return value
