"""A fault: a value that says what breaks, where, when, for how long and how often."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fieldbus.errors import ConfigurationError
from hil.faults._catalogue import fault_type
from hil.faults._parameters import FaultType, Scalar
from hil.faults._trigger import REPEATABLE, Immediately, Trigger, as_trigger, trigger_from_dict
from hil.record import EventSelector

_KEYS = ("kind", "target", "trigger", "until", "duration_s", "count", "parameters")
COUNTED = ("frame.", "telegram.", "modbus.")
"""Kinds whose `count` says how many frames or telegrams are hit."""
_COMMANDED = (2, 3, 4, 15, 16)


def parse_payload(where: str, text: str) -> bytes:
    """Return hexadecimal text as 0 to 8 bytes; blanks are ignored."""
    try:
        data = bytes.fromhex(text)
    except ValueError:
        raise ConfigurationError(where, text, "hexadecimal text such as '3702 0000'") from None
    if len(data) > 8:
        raise ConfigurationError(where, text, "0 to 8 bytes")
    return data


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault, checked against the catalogue when it is made.

    Raises:
        ConfigurationError: Unknown kind or parameter, value outside its range, or options that contradict
            each other.

    """

    kind: str
    target: str = ""
    """Name of the segment, drive or axis; empty: the default one of the bench."""
    trigger: Trigger | EventSelector = field(default_factory=Immediately)
    until: Trigger | EventSelector | None = None
    """Removed when this happens."""
    duration_s: float | None = None
    """Removed after this time, s; not together with `until`."""
    count: int | None = None
    """Frame and telegram faults: how many are hit, then over (None: no limit). Others: how often the trigger
    applies it (None: once).
    """
    parameters: Mapping[str, Scalar] = field(default_factory=dict)

    def __post_init__(self) -> None:
        entry = fault_type(self.kind)
        if not isinstance(self.target, str):
            raise ConfigurationError("fault.target", self.target, "the name of a part of the bench")
        object.__setattr__(self, "trigger", as_trigger(self.trigger))
        if self.until is not None:
            object.__setattr__(self, "until", as_trigger(self.until))
        object.__setattr__(self, "parameters", entry.check(self.parameters))
        self._check_end(entry)
        self._check_parameters()

    def __hash__(self) -> int:
        return hash(
            (
                self.kind,
                self.target,
                self.trigger,
                self.duration_s,
                self.count,
                tuple(self.parameters.items()),
            )
        )

    def _check_end(self, entry: FaultType) -> None:
        if self.duration_s is not None:
            good = isinstance(self.duration_s, (int, float)) and not isinstance(self.duration_s, bool)
            if not (good and math.isfinite(self.duration_s) and self.duration_s > 0):
                raise ConfigurationError("fault.duration_s", self.duration_s, "a number > 0 s")
            if self.until is not None:
                raise ConfigurationError(
                    "fault.duration_s", self.duration_s, "nothing, because until is given"
                )
        if not entry.lasting and (self.duration_s is not None or self.until is not None):
            given = self.duration_s if self.duration_s is not None else str(self.until)
            raise ConfigurationError(
                "fault.duration_s/until", given, f"nothing: {self.kind} is over once applied"
            )
        if self.count is not None:
            if not isinstance(self.count, int) or isinstance(self.count, bool) or self.count < 1:
                raise ConfigurationError("fault.count", self.count, "a whole number >= 1")
            if self.count > 1 and not self.kind.startswith(COUNTED):
                if not isinstance(self.trigger, REPEATABLE):
                    raise ConfigurationError(
                        "fault.count", self.count, f"1, because the trigger is '{self.trigger}'"
                    )
                if self.lasting and self.duration_s is None and self.until is None:
                    raise ConfigurationError("fault.count", self.count, "1, or give duration_s or until")

    def _check_parameters(self) -> None:
        values = self.parameters
        if "data" in values:
            parse_payload(f"{self.kind}.parameters.data", str(values["data"]))
        if values.get("message") and "can_id" in values:
            raise ConfigurationError(
                f"{self.kind}.parameters.can_id", values["can_id"], "nothing, because message is given"
            )
        shortest, longest = values.get("shortest_s"), values.get("longest_s")
        if self.kind == "switch.bounce":
            entry = self.entry
            low = float(shortest if shortest is not None else entry.parameter("shortest_s").default or 0.0)
            high = float(longest if longest is not None else entry.parameter("longest_s").default or 0.0)
            if low > high:
                raise ConfigurationError(
                    "switch.bounce.parameters.shortest_s", low, f"at most longest_s = {high:g} s"
                )
        if self.kind == "drive.refuse_transition" and values["transition"] not in _COMMANDED:
            raise ConfigurationError(
                "drive.refuse_transition.parameters.transition",
                values["transition"],
                ", ".join(map(str, _COMMANDED)),
            )
        if self.kind in ("frame.inject", "can.babble", "can.load") and not values.get("extended", False):
            for name in ("can_id", "lowest_id", "highest_id"):
                if int(values.get(name, 0)) > 0x7FF:
                    raise ConfigurationError(
                        f"{self.kind}.parameters.{name}", values[name], "0..7FFh, or extended = true"
                    )
        if self.kind == "can.load":
            for lower, upper in (("lowest_id", "highest_id"), ("shortest", "longest")):
                if self.value(lower) > self.value(upper):
                    raise ConfigurationError(
                        f"can.load.parameters.{lower}",
                        self.value(lower),
                        f"at most {upper} = {self.value(upper)}",
                    )

    @property
    def entry(self) -> FaultType:
        """Catalogue entry of this kind."""
        return fault_type(self.kind)

    @property
    def lasting(self) -> bool:
        """Whether it stays until it is removed; False: it is over the moment it is applied."""
        kind = self.entry
        once = any(one.name == "persistent" for one in kind.parameters) and not self.value("persistent")
        return kind.lasting and not once

    def value(self, name: str) -> Any:
        """Return a parameter, or its default."""
        if name in self.parameters:
            return self.parameters[name]
        return self.entry.parameter(name).default

    def to_dict(self) -> dict[str, Any]:
        """Return the fault as TOML/JSON values (no nulls); `from_dict` reads it back."""
        result: dict[str, Any] = {"kind": self.kind}
        if self.target:
            result["target"] = self.target
        trigger = as_trigger(self.trigger)
        if not isinstance(trigger, Immediately):
            result["trigger"] = trigger.to_dict()
        if self.until is not None:
            result["until"] = as_trigger(self.until).to_dict()
        if self.duration_s is not None:
            result["duration_s"] = self.duration_s
        if self.count is not None:
            result["count"] = self.count
        if self.parameters:
            result["parameters"] = dict(self.parameters)
        return result

    @classmethod
    def from_dict(cls, content: Any, where: str = "fault") -> Fault:
        """Build a fault from TOML/JSON values.

        Raises:
            ConfigurationError: A key is unknown, missing or ill-typed; the message names it.

        """
        if not isinstance(content, Mapping):
            raise ConfigurationError(where, content, "a table with kind, target, trigger, ...")
        for key in content:
            if key not in _KEYS:
                raise ConfigurationError(f"{where}.{key}", content[key], ", ".join(_KEYS))
        if "kind" not in content:
            raise ConfigurationError(f"{where}.kind", None, "the kind of fault, see `hil faults`")
        parameters = content.get("parameters", {})
        if not isinstance(parameters, Mapping):
            raise ConfigurationError(f"{where}.parameters", parameters, "a table")
        return cls(
            content["kind"],
            content.get("target", ""),
            trigger_from_dict(content["trigger"], f"{where}.trigger")
            if "trigger" in content
            else Immediately(),
            trigger_from_dict(content["until"], f"{where}.until") if "until" in content else None,
            content.get("duration_s"),
            content.get("count"),
            parameters,
        )

    def __str__(self) -> str:
        parts = [self.kind]
        if self.target:
            parts.append(f"on {self.target}")
        if self.parameters:
            parts.append("(" + ", ".join(f"{name}={value}" for name, value in self.parameters.items()) + ")")
        parts.append(str(self.trigger))
        if self.duration_s is not None:
            parts.append(f"for {self.duration_s:g} s")
        if self.until is not None:
            parts.append(f"until {self.until}")
        if self.count is not None:
            parts.append(f"x{self.count}")
        return " ".join(parts)
