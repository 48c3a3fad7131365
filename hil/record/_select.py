"""Choosing events of the log: one value for triggers, reference instants and expectations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from fieldbus.errors import ConfigurationError
from fieldbus.history import Event, Scalar


def kind_matches(pattern: str, kind: str) -> bool:
    """Whether `kind` is `pattern`; a pattern with a trailing dot means the whole family (`alarm.`)."""
    return kind.startswith(pattern) if pattern.endswith(".") else kind == pattern


@dataclass(frozen=True, slots=True)
class EventSelector:
    """The n-th event of a kind, of a source, with given details; optionally some time after it.

    Make it with `event(...)`.
    """

    kind: str
    source: str | None = None
    nth: int = 1
    """1 = the first match; negative counts from the last (only for finished traces)."""
    offset_s: float = 0.0
    data: Mapping[str, Scalar] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.kind, self.source, self.nth, self.offset_s, tuple(sorted(self.data))))

    def matches(self, entry: Event) -> bool:
        """Whether the event is of this kind, source and details (whatever its place in the order)."""
        if self.source is not None and entry.source != self.source:
            return False
        if not kind_matches(self.kind, entry.kind):
            return False
        return all(key in entry.data and entry.data[key] == value for key, value in self.data.items())

    def select(self, events: Iterable[Event]) -> Iterator[Event]:
        """Return all matching events."""
        return (entry for entry in events if self.matches(entry))

    def find(self, events: Iterable[Event], *, not_before_ns: int = 0) -> Event | None:
        """Return the `nth` match at or after `not_before_ns`, or None."""
        found = [entry for entry in self.select(events) if entry.time_ns >= not_before_ns]
        index = self.nth - 1 if self.nth > 0 else self.nth
        return found[index] if -len(found) <= index < len(found) else None

    def plus(self, seconds: float) -> EventSelector:
        """Return the instant `seconds` after this event (negative: before it)."""
        return EventSelector(self.kind, self.source, self.nth, self.offset_s + seconds, self.data)

    def __str__(self) -> str:
        parts = [self.kind]
        if self.source is not None:
            parts.append(f"of {self.source}")
        if self.data:
            parts.append("with " + ", ".join(f"{key}={value}" for key, value in self.data.items()))
        if self.nth != 1:
            parts.append(f"(match {self.nth})")
        if self.offset_s:
            parts.append(f"{self.offset_s:+g} s")
        return " ".join(parts)


def event(kind: str, source: str | None = None, *, nth: int = 1, **data: Scalar) -> EventSelector:
    """Select the `nth` event of `kind` among those that fit.

    `event("alarm.raised", "axis1", number=421, nth=2)` is the second alarm 421 of the axis.

    Args:
        kind: Dotted kind, `fault.applied`; with a trailing dot a family, `alarm.`.
        source: Component that emitted it; None for any.
        nth: 1 for the first match, -1 for the last.
        data: Details that must be present with these values.

    Raises:
        ConfigurationError: `kind` is empty or `nth` is no whole number or 0.

    """
    if not kind:
        raise ConfigurationError("event kind", kind, "a dotted kind such as 'alarm.raised'")
    if not isinstance(nth, int) or isinstance(nth, bool) or nth == 0:
        raise ConfigurationError("event nth", nth, "1, 2, ... from the start or -1, -2, ... from the end")
    return EventSelector(kind, source, nth, 0.0, dict(data))
