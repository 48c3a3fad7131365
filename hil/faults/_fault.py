"""A fault: a value that says what breaks, where, when, for how long and how often."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from fieldbus.errors import ConfigurationError
from hil.faults._catalogue import fault_type
from hil.faults._kind import FaultType
from hil.faults._parameters import Scalar, Values
from hil.faults._trigger import ONCE, Immediately, Trigger, as_trigger, trigger_from_dict
from hil.record import EventSelector
from reports.json_types import JsonObject

_KEYS = ("kind", "target", "trigger", "until", "duration_s", "count", "parameters")


@dataclass(frozen=True)
class Fault:
    """A fault, checked against the definition of its kind when it is made.

    Raises:
        ConfigurationError: Unknown kind or parameter, value outside its range, or options that contradict
            each other.

    """

    kind: str
    target: str = ""
    """Name of the segment, drive or axis; empty: the only one, or the first segment."""
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
            if self.count > 1 and not entry.counted:
                if isinstance(self.trigger, ONCE):
                    raise ConfigurationError(
                        "fault.count", self.count, f"1, because the trigger is '{self.trigger}'"
                    )
                if self.lasting and self.duration_s is None and self.until is None:
                    raise ConfigurationError("fault.count", self.count, "1, or give duration_s or until")

    @property
    def entry(self) -> FaultType:
        """Definition of its kind."""
        return fault_type(self.kind)

    @property
    def values(self) -> Values:
        """Parameters, with the defaults of those that are not given."""
        return self.entry.values(self.parameters)

    @property
    def lasting(self) -> bool:
        """Whether it stays until it is removed; False: it is over the moment it is applied."""
        entry = self.entry
        return entry.lasting and (not entry.has("persistent") or self.values.flag("persistent"))

    def to_dict(self) -> JsonObject:
        """Return the fault as TOML/JSON values (no nulls); `from_dict` reads it back."""
        result: JsonObject = {"kind": self.kind}
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
    def from_dict(cls, content: object, where: str = "fault") -> Fault:
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
