"""Triggers made of triggers, and conditions on signals: sequences, alternatives, repetition, chance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from fieldbus.errors import ConfigurationError
from hil.faults._trigger import AtTime, ComposedTrigger, Immediately, Trigger, as_trigger, trigger_from_dict
from hil.record import EventSelector

Part = Trigger | EventSelector


@dataclass(frozen=True, slots=True)
class InCondition(ComposedTrigger):
    """When a recorded signal comes to be as described, at once if it is already; looked at once per
    application cycle.
    """

    signal: str
    """`component.column`; without a component the default axis is meant."""
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

    def to_dict(self) -> dict[str, Any]:
        """Return the trigger as TOML/JSON values."""
        result: dict[str, Any] = {"when": "condition", "signal": self.signal}
        result |= {key: value for key in ("low", "high") if (value := getattr(self, key)) is not None}
        return result | {key: value for key in ("ones", "zeros") if (value := getattr(self, key))}

    def __str__(self) -> str:
        parts = [f">= {self.low:g}"] if self.low is not None else []
        parts += [f"<= {self.high:g}"] if self.high is not None else []
        parts += [f"has 16#{self.ones:X}"] if self.ones else []
        parts += [f"has not 16#{self.zeros:X}"] if self.zeros else []
        return f"when {self.signal} {' and '.join(parts)}"


@dataclass(frozen=True, slots=True)
class Every(ComposedTrigger):
    """Again and again after arming."""

    period_s: float
    first_s: float | None = None
    """Time from arming to the first; None: one period."""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.period_s) and self.period_s > 0):
            raise ConfigurationError("trigger.period_s", self.period_s, "a number > 0 s")
        if self.first_s is not None and not (math.isfinite(self.first_s) and self.first_s >= 0):
            raise ConfigurationError("trigger.first_s", self.first_s, "a number >= 0 s")

    def to_dict(self) -> dict[str, Any]:
        """Return the trigger as TOML/JSON values."""
        first = {} if self.first_s is None else {"first_s": self.first_s}
        return {"when": "every", "period_s": self.period_s, **first}

    def __str__(self) -> str:
        begin = "" if self.first_s is None else f", first {self.first_s:g} s after arming"
        return f"every {self.period_s:g} s{begin}"


@dataclass(frozen=True, slots=True)
class InSequence(ComposedTrigger):
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

    def to_dict(self) -> dict[str, Any]:
        """Return the trigger as TOML/JSON values."""
        return {"when": "sequence", "triggers": [part.to_dict() for part in self.parts]}

    def __str__(self) -> str:
        return ", then ".join(map(str, self.parts))


@dataclass(frozen=True, slots=True)
class AnyOf(ComposedTrigger):
    """Whenever one of several triggers fires."""

    parts: tuple[Trigger, ...]

    def __post_init__(self) -> None:
        if len(self.parts) < 2:
            raise ConfigurationError("trigger.triggers", self.parts, "two triggers or more")

    def to_dict(self) -> dict[str, Any]:
        """Return the trigger as TOML/JSON values."""
        return {"when": "any", "triggers": [part.to_dict() for part in self.parts]}

    def __str__(self) -> str:
        return " or ".join(map(str, self.parts))


@dataclass(frozen=True, slots=True)
class ByChance(ComposedTrigger):
    """With a probability whenever another trigger fires, drawn from the seeded stream of the fault."""

    part: Trigger
    probability: float

    def __post_init__(self) -> None:
        if not 0.0 < self.probability <= 1.0:
            raise ConfigurationError("trigger.probability", self.probability, "a number above 0, at most 1")

    def to_dict(self) -> dict[str, Any]:
        """Return the trigger as TOML/JSON values."""
        return {"when": "chance", "trigger": self.part.to_dict(), "probability": self.probability}

    def __str__(self) -> str:
        return f"{self.part}, with probability {self.probability:g}"


def condition(
    signal: str, *, low: float | None = None, high: float | None = None, ones: int = 0, zeros: int = 0
) -> InCondition:
    """When a recorded signal is within limits, or a word has bits set and cleared; at once if it is so
    already.
    """
    return InCondition(signal, low, high, ones, zeros)


def every(period_s: float, *, first_s: float | None = None) -> Every:
    """Every `period_s` seconds after arming; `count` of the fault says how often."""
    return Every(period_s, first_s)


def sequence(*triggers: Part) -> InSequence:
    """When the last of `triggers` fires; each counts from when the one before it has fired.

    `sequence(on_event("fault.removed", fault="drive.sto"), after(0.3))` is 0.3 s behind the end of another
    fault.
    """
    return InSequence(tuple(as_trigger(one) for one in triggers))


def any_of(*triggers: Part) -> AnyOf:
    """Whenever one of `triggers` fires."""
    return AnyOf(tuple(as_trigger(one) for one in triggers))


def chance(trigger: Part, probability: float) -> ByChance:
    """With `probability` whenever `trigger` fires; the same seed gives the same occasions."""
    return ByChance(as_trigger(trigger), probability)


_NUMBERS: Final[Mapping[str, tuple[str, ...]]] = {
    "condition": ("low", "high", "ones", "zeros"),
    "every": ("period_s", "first_s"),
    "chance": ("probability",),
}
_OTHERS: Final[Mapping[str, tuple[str, ...]]] = {
    "condition": ("signal",),
    "every": (),
    "sequence": ("triggers",),
    "any": ("triggers",),
    "chance": ("trigger",),
}
COMPOSED: Final = tuple(_OTHERS)
"""Values of `when` of these triggers."""


def composed_from_dict(content: Mapping[str, Any], where: str) -> ComposedTrigger:
    """Build one of these triggers from TOML/JSON values; `when` is one of `COMPOSED`.

    Raises:
        ConfigurationError: A key is unknown, missing or ill-typed.

    """
    when = content["when"]
    numbers, others = _NUMBERS.get(when, ()), _OTHERS[when]
    for key, value in content.items():
        if key == "when":
            continue
        if key not in (*numbers, *others):
            raise ConfigurationError(f"{where}.{key}", value, ", ".join(["when", *others, *numbers]))
        whole = key in ("ones", "zeros")
        if key in numbers and (
            isinstance(value, bool) or not isinstance(value, int if whole else (int, float))
        ):
            raise ConfigurationError(f"{where}.{key}", value, "a whole number" if whole else "a number")
    for key in (*others, *{"every": ("period_s",), "chance": ("probability",)}.get(when, ())):
        if key not in content:
            raise ConfigurationError(f"{where}.{key}", None, f"required with when = {when}")
    if when == "condition":
        if not isinstance(content["signal"], str):
            raise ConfigurationError(f"{where}.signal", content["signal"], "a value of type str")
        return InCondition(**{key: value for key, value in content.items() if key != "when"})
    if when == "every":
        return Every(content["period_s"], content.get("first_s"))
    if when == "chance":
        return ByChance(trigger_from_dict(content["trigger"], f"{where}.trigger"), content["probability"])
    parts = content["triggers"]
    if not isinstance(parts, Sequence) or isinstance(parts, str):
        raise ConfigurationError(f"{where}.triggers", parts, "a list of tables")
    made = tuple(trigger_from_dict(one, f"{where}.triggers[{number}]") for number, one in enumerate(parts))
    return InSequence(made) if when == "sequence" else AnyOf(made)
