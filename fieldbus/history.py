"""The one ordered log of a bench: everything that happens is an event of it, in
the order in which it happened.

Job edges, state changes, alarms, faults and service messages are `Event` entries; CAN frames, which come by
the thousand, are kept by the medium in a log of their own with the same clock (`fieldbus.can`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from fieldbus.clock import Scheduler
from fieldbus.growing_log import GrowingLog

Scalar = str | int | float | bool | None


class Event(NamedTuple):
    """One entry of the log."""

    time_ns: int
    """Time from the start of the bench."""
    source: str
    """Name of the component: a bus, device, axis, job or the bench itself."""
    kind: str
    """What happened, dotted lower case: `drive.state`, `job.done`, `alarm.raised`, `fault.applied`."""
    data: dict[str, Scalar]
    """Details; keys carry their unit where a bare number would be ambiguous."""


class _Listener:
    """A function that listens."""

    def __init__(self, call: Callable[[Event], None]) -> None:
        self.call = call


class History:
    """Append-only event log.

    Args:
        scheduler: Source of the time stamps.

    """

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self.events: GrowingLog[Event] = GrowingLog([])
        """All of them, by their number from the first."""
        self._newest = self.events.newest
        self.declared: set[str] = set()
        """Kinds that a user's own parts will emit."""
        self._listeners: list[_Listener] = []

    def declare(self, *kinds: str) -> None:
        """Announce kinds that a user's own part will emit: a trigger may wait for them from now on."""
        self.declared.update(kinds)

    def emit(self, source: str, kind: str, /, **data: Scalar) -> None:
        """Append an event at the present time, then call the listeners in the
        order in which they were added.
        """
        event = Event(self._scheduler.now, source, kind, data)
        self._newest.append(event)
        if self._listeners:
            self._scheduler.catch_up()  # a listener may look at anything
            for entry in self._listeners:
                entry.call(event)

    def listen(self, listener: Callable[[Event], None]) -> Callable[[], None]:
        """Call `listener` with every event from now on; returns the function
        that ends it (harmless to repeat).

        A listener that emits is served at once: the listeners after it get the inner event first. Who needs
        the order of things reads `events`.
        """
        # A list is never changed, only replaced: a listener may come or go while `emit` goes through the old
        # one.
        # Every entry is an object of its own, so that the same function can listen twice and each ends for
        # itself.
        entry = _Listener(listener)
        self._listeners = [*self._listeners, entry]

        def end() -> None:
            self._listeners = [other for other in self._listeners if other is not entry]

        return end

    def select(self, *, source: str | None = None, kind: str | None = None) -> Iterator[Event]:
        """Return events of a source and of a kind (`kind="alarm."` with a trailing dot selects a family)."""
        for event in self.events:
            if source is not None and event.source != source:
                continue
            if kind is not None and not (
                event.kind.startswith(kind) if kind.endswith(".") else event.kind == kind
            ):
                continue
            yield event
