"""Triggers: when a fault is applied or removed. Values that serialise; the injector evaluates them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from fieldbus.errors import ConfigurationError
from hil.record import EventSelector
from hil.record import event as select_event
from hil.record._signal import DIRECTIONS, Direction
from reports.json_types import JsonObject


@dataclass(frozen=True)
class Immediately:
    """As soon as the fault is armed."""

    def to_dict(self) -> JsonObject:
        """Return the trigger as TOML/JSON values."""
        return {"when": "immediately"}

    def __str__(self) -> str:
        return "immediately"


@dataclass(frozen=True)
class AtTime:
    """At a time of the bench, or some time after arming."""

    time_s: float
    relative: bool = False

    def __post_init__(self) -> None:
        if not (math.isfinite(self.time_s) and self.time_s >= 0):
            raise ConfigurationError("trigger.time_s", self.time_s, "a number >= 0 s")

    def to_dict(self) -> JsonObject:
        """Return the trigger as TOML/JSON values."""
        return {"when": "after" if self.relative else "at", "time_s": self.time_s}

    def __str__(self) -> str:
        return f"{self.time_s:g} s after arming" if self.relative else f"at {self.time_s:g} s"


@dataclass(frozen=True)
class SignalCrossing:
    """When a recorded signal passes a value; evaluated once per application cycle."""

    signal: str
    """`component.column`; without a component that of the axis that the fault is about, or the only one."""
    value: float
    direction: Direction = "any"

    def __post_init__(self) -> None:
        if not math.isfinite(self.value):
            raise ConfigurationError("trigger.value", self.value, "a finite number in the unit of the signal")
        if self.direction not in DIRECTIONS:
            raise ConfigurationError("trigger.direction", self.direction, ", ".join(DIRECTIONS))
        if not self.signal:
            raise ConfigurationError("trigger.signal", self.signal, "component.column")

    def to_dict(self) -> JsonObject:
        """Return the trigger as TOML/JSON values."""
        return {"when": "signal", "signal": self.signal, "value": self.value, "direction": self.direction}

    def __str__(self) -> str:
        verb = {"rising": "rises through", "falling": "falls through", "any": "passes"}[self.direction]
        return f"when {self.signal} {verb} {self.value:g}"


@dataclass(frozen=True)
class InState:
    """When a component is in a state, at once if it already is."""

    component: str
    state: str
    kind: str = ""
    """Kind of the state events; empty: any kind ending in `.state`."""

    def __post_init__(self) -> None:
        if not self.component or not self.state:
            raise ConfigurationError(
                "trigger.state", f"{self.component}/{self.state}", "a component and a state text"
            )

    def applies(self, kind: str) -> bool:
        """Whether events of this kind report the state."""
        return kind == self.kind if self.kind else kind.endswith(".state")

    def to_dict(self) -> JsonObject:
        """Return the trigger as TOML/JSON values."""
        result: JsonObject = {"when": "state", "component": self.component, "state": self.state}
        if self.kind:
            result["kind"] = self.kind
        return result

    def __str__(self) -> str:
        return f"when {self.component} is in state {self.state}"


@dataclass(frozen=True)
class OnEvent:
    """At the n-th event of a kind after arming."""

    selector: EventSelector

    def __post_init__(self) -> None:
        if self.selector.nth < 1:
            raise ConfigurationError(
                "trigger.nth", self.selector.nth, "1, 2, ...: the last event is not known yet"
            )
        if self.selector.offset_s < 0:
            raise ConfigurationError("trigger.offset_s", self.selector.offset_s, "a number >= 0 s")

    def to_dict(self) -> JsonObject:
        """Return the trigger as TOML/JSON values."""
        selector = self.selector
        result: JsonObject = {"when": "event", "kind": selector.kind}
        if selector.source is not None:
            result["source"] = selector.source
        if selector.nth != 1:
            result["nth"] = selector.nth
        if selector.offset_s:
            result["offset_s"] = selector.offset_s
        if selector.data:
            result["data"] = dict(selector.data)
        return result

    def __str__(self) -> str:
        return f"at {self.selector}"


@dataclass(frozen=True)
class OnFrame:
    """At the n-th frame after arming that fits: identifier under a mask, or message name, and the beginning
    of its data.
    """

    can_id: int | None = None
    number: int = 1
    message: str = ""
    """Message name of a drive instead of an identifier."""
    drive: str = ""
    segment: str = ""
    mask: int = 0x1FFFFFFF
    """Bits of the identifier that are compared."""
    data: str = ""
    """Begin of the data, hexadecimal; `..` is any byte: `2F .. 60`."""

    def __post_init__(self) -> None:
        if not 0 <= self.mask <= 0x1FFFFFFF:
            raise ConfigurationError("trigger.mask", self.mask, "0..1FFFFFFFh")
        parse_pattern(self.data)
        if self.number < 1:
            raise ConfigurationError("trigger.number", self.number, "1, 2, ...")
        if (self.can_id is None) == (not self.message):
            raise ConfigurationError("trigger.can_id", self.can_id, "either an identifier or a message name")
        if self.can_id is not None and not 0 <= self.can_id <= 0x1FFFFFFF:
            raise ConfigurationError("trigger.can_id", self.can_id, "0..1FFFFFFFh")

    def to_dict(self) -> JsonObject:
        """Return the trigger as TOML/JSON values."""
        result: JsonObject = {"when": "frame"}
        if self.can_id is not None:
            result["can_id"] = self.can_id
        texts = {"message": self.message, "drive": self.drive, "segment": self.segment, "data": self.data}
        result |= {key: text for key, text in texts.items() if text}
        if self.mask != 0x1FFFFFFF:
            result["mask"] = self.mask
        if self.number != 1:
            result["number"] = self.number
        return result

    def __str__(self) -> str:
        name = self.message if self.can_id is None else f"{self.can_id:03X}h"
        owner = f" of {self.drive}" if self.drive else ""
        mask = "" if self.mask == 0x1FFFFFFF else f" under mask {self.mask:X}h"
        data = f" with {self.data}" if self.data else ""
        return f"at frame {name}{mask}{owner}{data} number {self.number}"


@dataclass(frozen=True)
class InCondition:
    """When a recorded signal comes to be as described, at once if it is already; looked at once per
    application cycle.
    """

    signal: str
    """`component.column`; without a component that of the axis that the fault is about, or the only one."""
    low: float | None = None
    high: float | None = None
    ones: int = 0
    zeros: int = 0

    def __post_init__(self) -> None:
        if not self.signal:
            raise ConfigurationError("trigger.signal", self.signal, "component.column")
        limits = [limit for limit in (self.low, self.high) if limit is not None]
        if any(not math.isfinite(limit) for limit in limits) or (len(limits) == 2 and limits[0] > limits[1]):
            raise ConfigurationError("trigger.low/high", (self.low, self.high), "finite numbers, low <= high")
        if self.ones < 0 or self.zeros < 0 or self.ones & self.zeros:
            raise ConfigurationError(
                "trigger.ones/zeros", (self.ones, self.zeros), "masks without a bit in both"
            )
        if not limits and not self.ones and not self.zeros:
            raise ConfigurationError("trigger.condition", self.signal, "low, high, ones or zeros")

    def holds(self, value: float) -> bool:
        """Whether a value is as described; what is no number is not."""
        if math.isnan(value) or (self.low is not None and value < self.low):
            return False
        if self.high is not None and value > self.high:
            return False
        word = int(value) if self.ones or self.zeros else 0
        return word & self.ones == self.ones and not word & self.zeros

    def to_dict(self) -> JsonObject:
        """Return the trigger as TOML/JSON values."""
        result: JsonObject = {"when": "condition", "signal": self.signal}
        limits, masks = {"low": self.low, "high": self.high}, {"ones": self.ones, "zeros": self.zeros}
        result |= {key: limit for key, limit in limits.items() if limit is not None}
        return result | {key: mask for key, mask in masks.items() if mask}

    def __str__(self) -> str:
        parts = [f">= {self.low:g}"] if self.low is not None else []
        parts += [f"<= {self.high:g}"] if self.high is not None else []
        parts += [f"has 16#{self.ones:X}"] if self.ones else []
        parts += [f"has not 16#{self.zeros:X}"] if self.zeros else []
        return f"when {self.signal} {' and '.join(parts)}"


@dataclass(frozen=True)
class Every:
    """Again and again after arming."""

    period_s: float
    first_s: float | None = None
    """Time from arming to the first; None: one period."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.period_s) and self.period_s > 0):
            raise ConfigurationError("trigger.period_s", self.period_s, "a number > 0 s")
        if self.first_s is not None and not (math.isfinite(self.first_s) and self.first_s >= 0):
            raise ConfigurationError("trigger.first_s", self.first_s, "a number >= 0 s")

    def to_dict(self) -> JsonObject:
        """Return the trigger as TOML/JSON values."""
        first = {} if self.first_s is None else {"first_s": self.first_s}
        return {"when": "every", "period_s": self.period_s, **first}

    def __str__(self) -> str:
        begin = "" if self.first_s is None else f", first {self.first_s:g} s after arming"
        return f"every {self.period_s:g} s{begin}"


@dataclass(frozen=True)
class InSequence:
    """When the last of several triggers fires, each of which is armed when the one before it has fired."""

    parts: tuple[Trigger, ...]

    def __post_init__(self) -> None:
        if len(self.parts) < 2:
            raise ConfigurationError("trigger.triggers", self.parts, "two triggers or more")
        for part in self.parts[1:]:
            if isinstance(part, AtTime) and not part.relative:
                raise ConfigurationError(
                    "trigger.triggers", str(part), "a time after the trigger before: after(...)"
                )
            if isinstance(part, Immediately):
                raise ConfigurationError(
                    "trigger.triggers", str(part), "a trigger that something brings about"
                )

    def to_dict(self) -> JsonObject:
        """Return the trigger as TOML/JSON values."""
        return {"when": "sequence", "triggers": [part.to_dict() for part in self.parts]}

    def __str__(self) -> str:
        return ", then ".join(map(str, self.parts))


@dataclass(frozen=True)
class AnyOf:
    """Whenever one of several triggers fires."""

    parts: tuple[Trigger, ...]

    def __post_init__(self) -> None:
        if len(self.parts) < 2:
            raise ConfigurationError("trigger.triggers", self.parts, "two triggers or more")

    def to_dict(self) -> JsonObject:
        """Return the trigger as TOML/JSON values."""
        return {"when": "any", "triggers": [part.to_dict() for part in self.parts]}

    def __str__(self) -> str:
        return " or ".join(map(str, self.parts))


@dataclass(frozen=True)
class ByChance:
    """With a probability whenever another trigger fires, drawn from the seeded stream of the fault."""

    part: Trigger
    probability: float

    def __post_init__(self) -> None:
        if not 0.0 < self.probability <= 1.0:
            raise ConfigurationError("trigger.probability", self.probability, "a number above 0, at most 1")

    def to_dict(self) -> JsonObject:
        """Return the trigger as TOML/JSON values."""
        return {"when": "chance", "trigger": self.part.to_dict(), "probability": self.probability}

    def __str__(self) -> str:
        return f"{self.part}, with probability {self.probability:g}"


def parse_pattern(text: str) -> tuple[int | None, ...]:
    """Return the bytes of a pattern of data, None for any; blanks are ignored.

    Raises:
        ConfigurationError: It is no hexadecimal text of at most 8 bytes, with `..` for any byte.

    """
    packed = "".join(text.split())
    pairs = [packed[at : at + 2] for at in range(0, len(packed), 2)]
    try:
        found = tuple(None if pair == ".." else bytes.fromhex(pair)[0] for pair in pairs)
    except (ValueError, IndexError):
        found = (None,) * 9
    if len(found) > 8:
        raise ConfigurationError("trigger.data", text, "up to 8 bytes in hexadecimal, .. for any: '2F .. 60'")
    return found


Trigger = (
    Immediately
    | AtTime
    | SignalCrossing
    | InState
    | OnEvent
    | OnFrame
    | InCondition
    | Every
    | InSequence
    | AnyOf
    | ByChance
)
"""What a fault waits for."""
TriggerOrSelector = Trigger | EventSelector
ONCE: Final = (Immediately, AtTime)
"""Triggers that fire once only."""


# -- functions that make them ----------------------------------------------------------------------------


def immediately() -> Immediately:
    """As soon as the fault is armed."""
    return Immediately()


_LONGEST_S: Final = 1e9
"""Longest time of a trigger, s; the clock counts nanoseconds in 64 bits."""


def _number(name: str, value: object, limit: float = math.inf) -> float:
    """Return `value` as a finite number, or say which argument of a trigger is none."""
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if isinstance(value, str) or not math.isfinite(number) or abs(number) > limit:
        allowed = "a finite number" if limit == math.inf else f"a number of at most {limit:g}"
        raise ConfigurationError(f"trigger.{name}", value, allowed)
    return number


def at(time_s: float) -> AtTime:
    """At `time_s` seconds from the start of the bench."""
    return AtTime(_number("at", time_s, _LONGEST_S))


def after(delay_s: float) -> AtTime:
    """`delay_s` seconds after arming."""
    return AtTime(_number("after", delay_s, _LONGEST_S), relative=True)


def signal(name: str, value: float, *, direction: Direction = "any") -> SignalCrossing:
    """When the recorded signal `component.column` passes `value`."""
    return SignalCrossing(name, _number("signal", value), direction)


def position(value: float, *, axis: str = "", direction: Direction = "any") -> SignalCrossing:
    """When the actual position of an axis passes `value` [mm or degrees]."""
    return SignalCrossing(
        f"{axis}.actual_position" if axis else "actual_position", _number("position", value), direction
    )


def velocity(value: float, *, axis: str = "", direction: Direction = "any") -> SignalCrossing:
    """When the actual velocity of an axis passes `value` [mm/s or degrees/s]."""
    return SignalCrossing(
        f"{axis}.actual_velocity" if axis else "actual_velocity", _number("velocity", value), direction
    )


def state(component: str, text: str, *, kind: str = "") -> InState:
    """When `component` is in the state `text`."""
    return InState(component, text, kind)


def on_event(
    kind: str, source: str | None = None, *, nth: int = 1, **data: str | float | bool | None
) -> OnEvent:
    """At the `nth` event of `kind` after arming; see `hil.record.event`."""
    return OnEvent(select_event(kind, source, nth=nth, **data))


def frame(
    can_id: int | None = None,
    *,
    message: str = "",
    drive: str = "",
    number: int = 1,
    segment: str = "",
    mask: int = 0x1FFFFFFF,
    data: str = "",
) -> OnFrame:
    """At the `number`-th frame with an identifier under `mask`, or a message name of a drive, whose data
    begin with `data`.
    """
    return OnFrame(can_id, number, message, drive, segment, mask, data)


def condition(
    signal: str, *, low: float | None = None, high: float | None = None, ones: int = 0, zeros: int = 0
) -> InCondition:
    """When a recorded signal is within limits, or a word has bits set and
    cleared; at once if it is so already.
    """
    return InCondition(signal, low, high, ones, zeros)


def every(period_s: float, *, first_s: float | None = None) -> Every:
    """Every `period_s` seconds after arming; `count` of the fault says how often."""
    return Every(period_s, first_s)


def sequence(*triggers: TriggerOrSelector) -> InSequence:
    """When the last of `triggers` fires; each counts from when the one before it has fired.

    `sequence(on_event("fault.removed", fault="drive.sto"), after(0.3))` is 0.3 s
    behind the end of another fault.
    """
    return InSequence(tuple(as_trigger(one) for one in triggers))


def any_of(*triggers: TriggerOrSelector) -> AnyOf:
    """Whenever one of `triggers` fires."""
    return AnyOf(tuple(as_trigger(one) for one in triggers))


def chance(trigger: TriggerOrSelector, probability: float) -> ByChance:
    """With `probability` whenever `trigger` fires; the same seed gives the same occasions."""
    return ByChance(as_trigger(trigger), probability)


def as_trigger(value: Trigger | EventSelector) -> Trigger:
    """Accept an event selector where a trigger is wanted.

    Raises:
        ConfigurationError: It is neither.

    """
    if isinstance(value, EventSelector):
        return OnEvent(value)
    given: object = value
    if not isinstance(given, Trigger):
        raise ConfigurationError(
            "trigger",
            given,
            "a trigger of hil.faults, such as at(0.5), after(0.5), velocity(45.0), or an event",
        )
    return value


# -- the form in files -----------------------------------------------------------------------------------

Value = Literal["text", "number", "whole", "table", "trigger", "triggers"]
_ALLOWED: Final[dict[Value, str]] = {
    "text": "a text",
    "number": "a number",
    "whole": "a whole number",
    "table": "a table",
    "trigger": "a table with when",
    "triggers": "a list of tables",
}
_TYPES: Final[dict[Value, type | tuple[type, ...]]] = {
    "text": str,
    "number": (int, float),
    "whole": int,
    "table": Mapping,
    "trigger": Mapping,
    "triggers": (list, tuple),
}
_CONTROLLER: Final = "live: signals of the controller, once per application cycle"
_EVENTS: Final = "live: events of the controller; drive.*, encoder.*, emcy.raised and nmt.state are refused"
_PARTS: Final = "live: as its parts"
_YES: Final = "live: yes"


@dataclass(frozen=True)
class TriggerForm:
    """The form of a trigger in files, by its `when`."""

    summary: str
    live: str
    """What it can use on a live bench."""
    make: Callable[[Mapping[str, Any]], Trigger]
    """Returns the trigger, given its keys; nested triggers are triggers already."""
    required: Mapping[str, Value] = field(default_factory=dict)
    optional: Mapping[str, Value] = field(default_factory=dict)

    def read(self, when: str, content: Mapping[str, object], where: str) -> Trigger:
        """Return the trigger that a table describes.

        Raises:
            ConfigurationError: Unknown, missing or ill-typed key.

        """
        known = {**self.required, **self.optional}
        for key, value in content.items():
            if key == "when":
                continue
            kind = known.get(key)
            if kind is None:
                raise ConfigurationError(f"{where}.{key}", value, ", ".join(["when", *known]))
            if not isinstance(value, _TYPES[kind]) or isinstance(value, bool):
                raise ConfigurationError(f"{where}.{key}", value, _ALLOWED[kind])
        for key in self.required:
            if key not in content:
                raise ConfigurationError(f"{where}.{key}", None, f"required with when = {when}")
        return self.make(
            {
                key: _nested(value, f"{where}.{key}", known[key])
                for key, value in content.items()
                if key != "when"
            }
        )


def _nested(value: Any, where: str, kind: Value) -> Any:
    """Return the value of a key, with the triggers in it read."""
    if kind == "trigger":
        return trigger_from_dict(value, where)
    if kind == "triggers":
        return tuple(trigger_from_dict(one, f"{where}[{number}]") for number, one in enumerate(value))
    return value


def _event_from(values: Mapping[str, Any]) -> OnEvent:
    selector = select_event(
        values["kind"], values.get("source"), nth=values.get("nth", 1), **values.get("data", {})
    )
    return OnEvent(selector.plus(float(values.get("offset_s", 0.0))))


TRIGGERS: Final[dict[str, TriggerForm]] = {
    "immediately": TriggerForm("As soon as the fault is armed", _YES, lambda _: Immediately()),
    "at": TriggerForm(
        "At a time of the bench", _YES, lambda v: AtTime(float(v["time_s"])), {"time_s": "number"}
    ),
    "after": TriggerForm(
        "A time after arming",
        _YES,
        lambda v: AtTime(float(v["time_s"]), relative=True),
        {"time_s": "number"},
    ),
    "position": TriggerForm(
        "When the actual position of an axis passes a value",
        _CONTROLLER,
        lambda v: position(**v),
        {"value": "number"},
        {"axis": "text", "direction": "text"},
    ),
    "velocity": TriggerForm(
        "When the actual velocity of an axis passes a value",
        _CONTROLLER,
        lambda v: velocity(**v),
        {"value": "number"},
        {"axis": "text", "direction": "text"},
    ),
    "signal": TriggerForm(
        "When a recorded signal passes a value",
        _CONTROLLER,
        lambda v: SignalCrossing(v["signal"], float(v["value"]), v.get("direction", "any")),
        {"signal": "text", "value": "number"},
        {"direction": "text"},
    ),
    "condition": TriggerForm(
        "When a recorded signal is within limits, or has bits set and cleared",
        _CONTROLLER,
        lambda v: InCondition(**v),
        {"signal": "text"},
        {"low": "number", "high": "number", "ones": "whole", "zeros": "whole"},
    ),
    "state": TriggerForm(
        "When a component is in a state",
        _EVENTS,
        lambda v: InState(**v),
        {"component": "text", "state": "text"},
        {"kind": "text"},
    ),
    "event": TriggerForm(
        "At the n-th event of a kind: phase of a job, alarm, begin or end of another fault",
        _EVENTS,
        _event_from,
        {"kind": "text"},
        {"source": "text", "nth": "whole", "offset_s": "number", "data": "table"},
    ),
    "frame": TriggerForm(
        "At the n-th frame that fits identifier, mask and data",
        "live: frames that a local port sends or receives, or that pass a bridge",
        lambda v: OnFrame(**v),
        {},
        {
            "can_id": "whole",
            "message": "text",
            "drive": "text",
            "number": "whole",
            "segment": "text",
            "mask": "whole",
            "data": "text",
        },
    ),
    "every": TriggerForm(
        "Again and again after arming",
        _YES,
        lambda v: Every(**v),
        {"period_s": "number"},
        {"first_s": "number"},
    ),
    "sequence": TriggerForm(
        "When the last of several triggers fires, one after the other",
        _PARTS,
        lambda v: InSequence(v["triggers"]),
        {"triggers": "triggers"},
    ),
    "any": TriggerForm(
        "Whenever one of several triggers fires",
        _PARTS,
        lambda v: AnyOf(v["triggers"]),
        {"triggers": "triggers"},
    ),
    "chance": TriggerForm(
        "With a probability whenever another trigger fires",
        _PARTS,
        lambda v: ByChance(v["trigger"], v["probability"]),
        {"trigger": "trigger", "probability": "number"},
    ),
}
"""The triggers, by the value of `when` in a file."""


def trigger_from_dict(content: object, where: str = "trigger") -> Trigger:
    """Build a trigger from TOML/JSON values.

    Raises:
        ConfigurationError: Unknown `when`, unknown, missing or ill-typed key.

    """
    if not isinstance(content, Mapping):
        raise ConfigurationError(where, content, f"a table with when = {', '.join(TRIGGERS)}")
    when = content.get("when")
    form = TRIGGERS.get(when) if isinstance(when, str) else None
    if when is None or form is None:
        raise ConfigurationError(f"{where}.when", when, ", ".join(TRIGGERS))
    return form.read(when, content, where)
