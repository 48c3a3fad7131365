"""Descriptions of fault types and their parameters: data that validates, documents and generates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from fieldbus.errors import ConfigurationError

Scalar = str | int | float | bool
ParameterType = Literal["float", "int", "bool", "text"]
Environment = Literal["virtual", "live", "hardware"]
ENVIRONMENTS: tuple[Environment, ...] = ("virtual", "live", "hardware")


@dataclass(frozen=True, slots=True)
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
        """What a value may be, in words."""
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

    def to_dict(self) -> dict[str, Any]:
        """Return the description as JSON values."""
        result: dict[str, Any] = {
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


@dataclass(frozen=True, slots=True)
class FaultType:
    """An entry of the catalogue."""

    name: str
    summary: str
    target: Literal["segment", "drive", "axis", "switch", "mechanics", "encoder", "station", "controller"]
    """What kind of thing is broken; switch, mechanics and encoder are addressed by the name of their drive,
    an
    encoder with a node of its own by its own."""
    seam: str
    """Where in the bench the fault is applied."""
    parameters: tuple[Parameter, ...] = ()
    lasting: bool = True
    """Whether it stays until removed; False: it is over the moment it is applied."""
    refused: Mapping[Environment, str] = field(default_factory=dict)
    """Where it cannot be injected, and why."""
    remark: str = ""
    example: Mapping[str, Any] = field(default_factory=dict)

    def parameter(self, name: str) -> Parameter:
        """Return the description of a parameter; `ConfigurationError` when there is none."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        allowed = ", ".join(parameter.name for parameter in self.parameters) or "no parameters"
        raise ConfigurationError(f"{self.name}.parameters", name, allowed)

    def check(self, values: Mapping[str, Any]) -> dict[str, Scalar]:
        """Return the given parameters, validated, in catalogue order.

        Raises:
            ConfigurationError: Unknown name, wrong type, outside the range, or a required one is missing.

        """
        for name in values:
            self.parameter(name)
        checked: dict[str, Scalar] = {}
        for parameter in self.parameters:
            if parameter.name in values:
                checked[parameter.name] = parameter.check(f"{self.name}.parameters", values[parameter.name])
            elif parameter.required:
                raise ConfigurationError(f"{self.name}.parameters.{parameter.name}", None, parameter.allowed)
        return checked

    def injectable(self, environment: Environment) -> str:
        """Return why the fault cannot be injected there; empty when it can."""
        return self.refused.get(environment, "")

    def to_dict(self) -> dict[str, Any]:
        """Return the entry as JSON values."""
        return {
            "name": self.name,
            "summary": self.summary,
            "target": self.target,
            "targets": [self.target],
            "seam": self.seam,
            "lasting": self.lasting,
            "parameters": [parameter.to_dict() for parameter in self.parameters],
            "benches": {
                environment: {
                    "injectable": not self.injectable(environment),
                    "reason": self.injectable(environment),
                }
                for environment in ENVIRONMENTS
            },
            "remark": self.remark,
            "example": dict(self.example),
        }
