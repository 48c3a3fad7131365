"""Python source of calls: what is written and what is tried come from one value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import ConfigurationError
from hil import faults as _faults
from hil.faults import (
    AnyOf,
    AtTime,
    ByChance,
    Every,
    Immediately,
    InCondition,
    InSequence,
    InState,
    OnEvent,
    OnFrame,
    SignalCrossing,
    Trigger,
)
from hil.record import event

if TYPE_CHECKING:
    from hil.record import EventSelector

WIDTH: Final = 88
"""Columns of a line: what `ruff format` and `black` allow without settings."""
_HEX: Final = frozenset({"code", "can_id", "mask", "error_id", "ones", "zeros", "index"})
"""Names of numbers that people write in hexadecimal."""


@dataclass(frozen=True)
class Code:
    """Source text with the value that it stands for."""

    text: str
    value: Any


@dataclass(frozen=True)
class Call:
    """A call of a function of `hil.expect` or `hil.faults`, or of a method that a test has."""

    function: str
    """As it is written: `alarm`, `axis.move_absolute`."""
    positional: tuple[Any, ...] = ()
    options: Mapping[str, Any] | None = None
    module: str = ""
    """Where it is imported from; empty: from nowhere."""
    made: Any = None
    """What the call returns, where it is not made by evaluating it."""
    suffix: str = ""
    """Written behind the call: `.plus(0.2)`."""

    def imports(self) -> Iterator[tuple[str, str]]:
        """Yield module and name of everything that has to be imported."""
        if self.module:
            yield self.module, self.function
        for value in (*self.positional, *(self.options or {}).values()):
            if isinstance(value, Call):
                yield from value.imports()
            elif isinstance(value, Enum):
                yield type(value).__module__, type(value).__name__

    def text(self, indent: int = 0, used: int = 0) -> str:
        """Return the source, over several lines where one is too short.

        Args:
            indent: Columns in front of the statement.
            used: Columns on the first line besides it: an assignment, a comma behind.

        """
        parts = [*((None, one) for one in self.positional), *(self.options or {}).items()]
        flat = f"{self.function}({', '.join(_argument(name, one) for name, one in parts)}){self.suffix}"
        if "\n" not in flat and indent + used + len(flat) <= WIDTH:
            return flat
        inside = " " * (indent + 4)
        row = ", ".join(_argument(name, one) for name, one in parts)
        if indent + 4 + len(row) <= WIDTH:
            return f"{self.function}(\n{inside}{row}\n{' ' * indent}){self.suffix}"
        rows = "".join(f"{inside}{_argument(name, one, indent + 4)},\n" for name, one in parts)
        return f"{self.function}(\n{rows}{' ' * indent}){self.suffix}"


def _argument(name: str | None, value: Any, indent: int = -1) -> str:
    head = f"{name}=" if name else ""
    if isinstance(value, Call):
        # indent < 0: on one line, however long
        return head + (value.text(indent, len(head) + 1) if indent >= 0 else value.text(-10_000))
    return head + literal(value, name or "")


def literal(value: Any, name: str = "") -> str:
    """Return a plain value, or the text of a `Code`, as source; numbers without digits of rounding."""
    if isinstance(value, Code):
        return value.text
    if isinstance(value, bool) or value is None:
        return repr(value)
    if isinstance(value, Enum):
        return f"{type(value).__name__}.{value.name}"
    if isinstance(value, int):
        return f"0x{value:04X}" if name in _HEX and value > 9 else str(value)
    if isinstance(value, float):
        return repr(float(f"{value:.9g}"))
    if isinstance(value, str):
        return _quoted(value)
    raise ConfigurationError("value", value, "a number, a text or true/false")


def _quoted(text: str) -> str:
    shown = repr(text)
    return shown if '"' in text else f'"{shown[1:-1]}"'


def event_call(kind: str, source: str | None = None, *, nth: int = 1, **data: Any) -> Call:
    """Return `event(...)` with its value."""
    return Call(
        "event",
        (kind,) if source is None else (kind, source),
        {**({} if nth == 1 else {"nth": nth}), **data},
        "hil.expect",
        made=event(kind, source, nth=nth, **data),
    )


def selector_call(selector: EventSelector, name: str) -> Call:
    """Return the call that makes an event selector, as `event` or `on_event`."""
    options = {**({} if selector.nth == 1 else {"nth": selector.nth}), **selector.data}
    where = (selector.kind,) if selector.source is None else (selector.kind, selector.source)
    return Call(name, where, options, "hil.faults" if name == "on_event" else "hil.expect")


def trigger_call(trigger: Trigger) -> Call:
    """Return the call that makes a trigger, as a test writes it."""
    return Call(*_trigger(trigger), module="hil.faults", made=trigger)


def _options(**values: Any) -> dict[str, Any]:
    return {name: value for name, value in values.items() if value not in (None, "", 0)}


def _trigger(trigger: Trigger) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
    match trigger:
        case Immediately():
            return "immediately", (), {}
        case AtTime():
            return "after" if trigger.relative else "at", (trigger.time_s,), {}
        case SignalCrossing():
            return _crossing(trigger)
        case InState():
            return "state", (trigger.component, trigger.state), _options(kind=trigger.kind)
        case OnEvent():
            call = selector_call(trigger.selector, "on_event")
            return call.function, call.positional, dict(call.options or {})
        case OnFrame():
            options = _options(
                message=trigger.message, drive=trigger.drive, segment=trigger.segment, data=trigger.data
            )
            options |= {} if trigger.number == 1 else {"number": trigger.number}
            options |= {} if trigger.mask == _faults.frame(can_id=0).mask else {"mask": trigger.mask}
            head = () if trigger.can_id is None else (Code(f"0x{trigger.can_id:X}", trigger.can_id),)
            return "frame", head, options
        case InCondition():
            options = {"low": trigger.low, "high": trigger.high}
            options = {name: value for name, value in options.items() if value is not None}
            return "condition", (trigger.signal,), options | _options(ones=trigger.ones, zeros=trigger.zeros)
        case Every():
            return "every", (trigger.period_s,), _options(first_s=trigger.first_s)
        case InSequence():
            return "sequence", tuple(trigger_call(one) for one in trigger.parts), {}
        case AnyOf():
            return "any_of", tuple(trigger_call(one) for one in trigger.parts), {}
        case ByChance():
            return "chance", (trigger_call(trigger.part), trigger.probability), {}


def _crossing(trigger: SignalCrossing) -> tuple[str, tuple[Any, ...], dict[str, Any]]:
    """Return `position` or `velocity` of an axis where it is that, as people write it, else `signal`."""
    axis, _, column = trigger.signal.rpartition(".")
    way = {} if trigger.direction == "any" else {"direction": trigger.direction}
    for name in ("position", "velocity"):
        if column == f"actual_{name}":
            return name, (trigger.value,), _options(axis=axis) | way
    return "signal", (trigger.signal, trigger.value), way


def import_lines(calls: Mapping[str, set[str]]) -> list[str]:
    """Return import statements, sorted, over several lines where they are long.

    Args:
        calls: Names by module.

    """
    lines: list[str] = []
    for module in sorted(calls):
        names = sorted(calls[module], key=lambda name: (not name.isupper(), name))
        flat = f"from {module} import {', '.join(names)}"
        if len(flat) <= WIDTH:
            lines.append(flat)
        else:
            lines += [f"from {module} import (", *(f"    {name}," for name in names), ")"]
    return lines
