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
    number: int = 1
    """1 = the first match; negative counts from the last (only for finished traces)."""
    offset_s: float = 0.0
    data: Mapping[str, Scalar] = field(default_factory=dict)

    def __hash__(self) -> int:
        return hash((self.kind, self.source, self.number, self.offset_s, tuple(sorted(self.data))))

    def matches(self, entry: Event) -> bool:
        """Whether the event is of this kind, source and details (whatever its number)."""
        if self.source is not None and entry.source != self.source:
            return False
        if not kind_matches(self.kind, entry.kind):
            return False
        return all(key in entry.data and entry.data[key] == value for key, value in self.data.items())

    def select(self, events: Iterable[Event]) -> Iterator[Event]:
        """Return all matching events."""
        return (entry for entry in events if self.matches(entry))

    def find(self, events: Iterable[Event], *, not_before_ns: int = 0) -> Event | None:
        """Return the `number`-th match at or after `not_before_ns`, or None."""
        found = [entry for entry in self.select(events) if entry.time_ns >= not_before_ns]
        index = self.number - 1 if self.number > 0 else self.number
        return found[index] if -len(found) <= index < len(found) else None

    def plus(self, seconds: float) -> EventSelector:
        """Return the instant `seconds` after this event (negative: before it)."""
        return EventSelector(self.kind, self.source, self.number, self.offset_s + seconds, self.data)

    def __str__(self) -> str:
        parts = [self.kind]
        if self.source is not None:
            parts.append(f"of {self.source}")
        if self.data:
            parts.append("with " + ", ".join(f"{key}={value}" for key, value in self.data.items()))
        if self.number != 1:
            parts.append(f"(number {self.number})")
        if self.offset_s:
            parts.append(f"{self.offset_s:+g} s")
        return " ".join(parts)


def event(kind: str, source: str | None = None, *, number: int = 1, **data: Scalar) -> EventSelector:
    """Select the `number`-th event of `kind`.

    Args:
        kind: Dotted kind, `fault.applied`; with a trailing dot a family, `alarm.`.
        source: Component that emitted it; None for any.
        number: 1 for the first, -1 for the last.
        data: Details that must be present with these values.

    Raises:
        ConfigurationError: `kind` is empty or `number` is 0.

    """
    if not kind:
        raise ConfigurationError("event kind", kind, "a dotted kind such as 'alarm.raised'")
    if number == 0:
        raise ConfigurationError(
            "event number", number, "1, 2, ... from the start or -1, -2, ... from the end"
        )
    return EventSelector(kind, source, number, 0.0, dict(data))
