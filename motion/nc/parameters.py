"""Parameters of tasks, axes, encoders, drives and controllers: catalogue, checks, values in effect.

A value has an offline side, which the bench file gives, and an online side, which `ParameterSet.write`
changes while the axis runs. Both are checked in the same way; what is refused leaves the value as it is
(NC-003).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import isfinite
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError, ErrorCollector, UnknownNameError
from motion.kernel.cell import Cell
from motion.nc.data import load

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping


Value = bool | int | float | str
"""A value as a user writes it; an enumeration by its text."""

_LARGEST: Final = 0xFFFFFFFF


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter of the catalogue.

    Args:
        key: Name in files and programs, with its component: `axis.maximum_velocity`.
        name: Name in the parameter dialogs.
        component: task, axis, encoder, drive or controller.
        group: Group of the dialog.
        type: bool, float, uint32, enum, string.
        unit: Unit with mm as base unit; empty for none.
        default: Value of a new object.
        choices: Texts of an enumeration.
        min: Lowest number; None for none.
        max: Highest number; None for none.
        above: The lowest number itself is not allowed.
        effect: What it does.
        requirement: Identifier of its row in the specification.
        aliases: Further keys of the same value: limits under the encoder, for example (NC-128).
        controller_types: Controllers that have it; empty: all.

    """

    key: str
    name: str
    component: str
    group: str
    type: str
    unit: str
    default: Value
    choices: tuple[str, ...]
    min: float | None
    max: float | None
    above: bool
    effect: str
    requirement: str
    aliases: tuple[str, ...]
    controller_types: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        """Which values it takes, in words."""
        if self.type == "bool":
            return "true or false"
        if self.type == "enum":
            return ", ".join(map(repr, self.choices))
        if self.type == "string":
            return "a text"
        kind = "a whole number" if self.type == "uint32" else "a number"
        low = self.min if self.type == "float" else (self.min or 0)
        if low is None:
            return f"{kind}"
        if self.max is not None:
            return f"{kind} from {low:g} to {self.max:g}"
        return f"{kind} above {low:g}" if self.above else f"{kind} of {low:g} or more"

    def check(self, value: object) -> Value:
        """Return a value as this parameter keeps it.

        Raises:
            ConfigurationError: It has another type, is out of range, or is no text of the enumeration.

        """
        if self.type == "bool":
            if isinstance(value, bool):
                return value
        elif self.type == "string":
            if isinstance(value, str):
                return value
        elif self.type == "enum":
            if value in self.choices:
                return str(value)
        elif isinstance(value, int | float) and not isinstance(value, bool) and self._in_range(value):
            return float(value) if self.type == "float" else int(value)
        raise ConfigurationError(self.key, value, self.allowed)

    def _in_range(self, value: float) -> bool:
        if not isfinite(value):
            return False
        if self.type == "uint32" and not (value == int(value) and 0 <= value <= _LARGEST):
            return False
        if self.min is not None and (value <= self.min if self.above else value < self.min):
            return False
        return self.max is None or value <= self.max


@cache
def catalogue() -> Mapping[str, Parameter]:
    """Return all parameters by key."""
    rows = (
        Parameter(
            **{**row, **{key: tuple(row.get(key, ())) for key in ("choices", "aliases", "controller_types")}}
        )
        for row in load("parameters")
    )
    return {one.key: one for one in rows}


@cache
def keys() -> Mapping[str, str]:
    """Return the key of the catalogue for every key that a user may write, aliases included."""
    found = {key: key for key in catalogue()}
    for key, one in catalogue().items():
        found.update(dict.fromkeys(one.aliases, key))
    return found


def known_key(key: str) -> str:
    """Return the key of the catalogue for a key or an alias.

    Raises:
        UnknownNameError: There is no such parameter.

    """
    known = keys().get(key)
    if known is None:
        raise UnknownNameError("parameters", key, "a parameter", keys())
    return known


def check_parameter(key: str, value: object, *, of_task: bool) -> None:
    """Check a parameter of the tasks, or one of an axis, by its key.

    Raises:
        ConfigurationError: There is no such parameter, it is of the other kind, or it cannot have the value.

    """
    one = catalogue()[known_key(key)]
    if (one.component == "task") is not of_task:
        place = "in [axis.NAME.parameters]" if of_task else "in [nc.parameters], for all axes"
        raise ConfigurationError(key, value, place)
    one.check(value)


class RefusedParameterError(ConfigurationError):
    """A parameter cannot be changed in the present state of the axis.

    Args:
        key: The parameter.
        value: What it was to become.
        error_id: Error code that a PLC or an ADS client gets.
        allowed: What would be accepted, in words.

    """

    def __init__(self, key: str, value: object, error_id: int, allowed: str) -> None:
        super().__init__(key, value, allowed, problem=f"is refused with 0x{error_id:04X}")
        self.error_id = error_id


Guard = Callable[[Value], tuple[int, str] | None]
"""Gets the new value of a parameter; returns the error code that refuses it and what is allowed, or None."""


class ParameterSet:
    """The parameters of one axis, its components and its task, with the values in effect.

    Args:
        values: Values by key; every other parameter has its default.
        tasks: The set whose task parameters these are as well; None: own ones.

    Raises:
        ConfigurationError: With every parameter that there is not, or that cannot have its value.

    """

    def __init__(
        self, values: Mapping[str, object] | None = None, *, tasks: ParameterSet | None = None
    ) -> None:
        self._cells: dict[str, Cell[float]] = {}
        self._texts: dict[str, str] = {}
        self.changes = 0
        """Counts the changes of values."""
        self.guards: dict[str, Guard] = {}
        """What decides whether a parameter may change in the present state, by key."""
        for key, one in catalogue().items():
            if tasks is not None and one.component == "task":
                self._cells[key] = tasks.cell(key)
            else:
                self._keep(one, one.check(one.default), new=key)
        errors = ErrorCollector()
        for key, value in (values or {}).items():
            with errors.located(""):
                one = catalogue()[known_key(key)]
                self._keep(one, one.check(value))
        errors.check()
        self._check_together()
        for key, value in (values or {}).items():
            with errors.located(""):
                self._check_present(catalogue()[known_key(key)], value)
        errors.check()

    def _keep(self, one: Parameter, value: Value, *, new: str = "") -> None:
        self.changes += 1
        if new:
            self._cells[one.key] = Cell(0.0)
        if one.type == "string":
            self._texts[one.key] = str(value)
        else:
            number = one.choices.index(str(value)) if one.type == "enum" else float(value)
            self._cells[one.key].value = number

    def cell(self, key: str) -> Cell[float]:
        """Return the value of a parameter as parts read it in every cycle: a flag as 0 or 1, an enumeration
        as the index of its text.
        """
        return self._cells[known_key(key)]

    def read(self, key: str) -> Value:
        """Return the value of a parameter.

        Raises:
            UnknownNameError: There is no such parameter.

        """
        one = catalogue()[known_key(key)]
        if one.type == "string":
            return self._texts[one.key]
        number = self._cells[one.key].value
        if one.type == "enum":
            return one.choices[int(number)]
        if one.type == "bool":
            return bool(number)
        return number if one.type == "float" else int(number)

    def write(self, key: str, value: object) -> None:
        """Change a value; it acts from the next cycle on.

        Raises:
            ConfigurationError: There is no such parameter, or it cannot have the value, alone or together
                with the others, or not in the present state. The value is as before then.

        """
        self.write_all({key: value})

    def write_all(self, values: Mapping[str, object]) -> None:
        """Change several values at once; they act from the next cycle on.

        Raises:
            ConfigurationError: One of them is refused, alone or together with the others. All values are as
                before then.

        """
        new: dict[Parameter, Value] = {}
        for key, value in values.items():
            one = catalogue()[known_key(key)]
            new[one] = checked = one.check(value)
            guard = self.guards.get(one.key)
            refused = guard(checked) if guard is not None and checked != self.read(one.key) else None
            if refused is not None:
                raise RefusedParameterError(one.key, value, *refused)
        before = {one: self.read(one.key) for one in new}
        for one, checked in new.items():
            self._keep(one, checked)
        try:
            self._check_together()
            for one, checked in new.items():
                self._check_present(one, checked)
        except ConfigurationError:
            for one, old in before.items():
                self._keep(one, old)
            raise

    @property
    def controller_type(self) -> str:
        """Text of `ctrl.type`."""
        return str(self.read("ctrl.type"))

    def present(self, key: str) -> bool:
        """Return whether the controller of the axis has a parameter (NC-482 to NC-515)."""
        types = catalogue()[known_key(key)].controller_types
        return not types or self.controller_type in types

    def _check_present(self, one: Parameter, value: object) -> None:
        if value != one.default and not self.present(one.key):
            raise ConfigurationError(
                one.key,
                value,
                f"its default {one.default}; these controllers have it: {', '.join(one.controller_types)}",
                problem=f"is not possible with {self.controller_type!r}",
            )

    def unit(self, key: str) -> str:
        """Return the unit of a parameter, with the base unit of the axis (NC-071)."""
        return catalogue()[known_key(key)].unit.replace("mm", self._texts["axis.unit"])

    def _check_together(self) -> None:
        """Check what one value says of another (NC-082, NC-083, NC-076, NC-100)."""
        number = self._number
        highest, reference = number("axis.maximum_velocity"), number("axis.reference_velocity")
        ratio = number("drv.output_ratio")
        if highest < 0.0:
            raise ConfigurationError("axis.maximum_velocity", highest, "0 or more")
        if ratio <= 0.0:
            raise ConfigurationError("drv.output_ratio", ratio, "above 0, up to 1")
        if highest > reference / ratio:
            raise ConfigurationError(
                "axis.maximum_velocity",
                highest,
                f"up to Reference Velocity / Output Ratio = {reference / ratio:g}",
            )
        phase, divider = number("axis.cycle_modulo"), number("axis.cycle_divider")
        if phase >= divider:
            raise ConfigurationError("axis.cycle_modulo", int(phase), f"0 to {divider - 1:g}, below Divider")

    def _number(self, key: str) -> float:
        return self._cells[key].value

    def warnings(self) -> Iterator[str]:
        """Yield what is permitted but not advisable (NC-026, NC-090, NC-204)."""
        number = self._number
        for key, text in (
            ("axis.position_lag_monitoring", "position lag monitoring is off"),
            ("axis.soft_limit_min_enable", "the lower software limit is not monitored"),
            ("axis.soft_limit_max_enable", "the upper software limit is not monitored"),
        ):
            if not number(key):
                yield f"{key}: {text}"
        for quantity in ("acceleration", "deceleration"):
            default, most = number(f"axis.default_{quantity}"), number(f"axis.maximum_{quantity}")
            if default > most:
                yield f"axis.default_{quantity}: {default:g} is above the maximum of {most:g}"
        if number("axis.dead_time_compensation"):
            yield "axis.dead_time_compensation: use the time compensation of encoder and drive instead"
