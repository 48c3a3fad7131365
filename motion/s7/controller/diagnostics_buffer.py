"""The diagnostics buffer of the controller: what a service engineer reads first after a stop.

`DiagnosticsBuffer.append` is the one way in. What other parts write to the event log is copied by `follow`,
so that they need not know the buffer.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

from fieldbus.clock import S
from fieldbus.errors import ConfigurationError
from motion.s7.alarms import catalogue

if TYPE_CHECKING:
    from fieldbus.clock import Scheduler
    from fieldbus.history import Event, History

CAPACITY: Final = 3200
"""Entries of a buffer; the oldest ones are lost."""
_RETAINED: Final = 500
"""Entries, the newest ones, that outlast power-off."""

Direction = Literal["", "coming", "going"]


class DiagnosticsEntry(NamedTuple):
    """One entry."""

    number: int
    """Counts from 1 over the life of the buffer; a gap at the beginning shows that older entries are lost."""
    time_ns: int
    """Time from the start of the bench, ns."""
    source: str
    """Who reports it: the controller, a technology object, a drive, a station."""
    text: str
    direction: Direction
    """Whether a condition comes or goes; empty for what only happens."""

    def __str__(self) -> str:
        mark = {"coming": "+", "going": "-", "": " "}[self.direction]
        return f"{self.number:>5}  {self.time_ns / S:10.3f} s  {mark} {self.source}: {self.text}"

    def as_dict(self) -> dict[str, object]:
        """Return the entry in types that JSON knows."""
        return {
            "number": self.number,
            "time_s": self.time_ns / S,
            "source": self.source,
            "text": self.text,
            "direction": self.direction,
        }


class DiagnosticsBuffer:
    """Bounded and ordered by time.

    Args:
        scheduler: Source of the time stamps.
        capacity: Number of entries that are kept, 1 or more.

    Raises:
        ConfigurationError: `capacity` is less than 1.

    """

    def __init__(self, scheduler: Scheduler, *, capacity: int = CAPACITY) -> None:
        if capacity < 1:
            raise ConfigurationError("capacity of the diagnostics buffer", capacity, "1 or more")
        self.capacity = capacity
        self._scheduler = scheduler
        self._entries: deque[DiagnosticsEntry] = deque(maxlen=capacity)
        self._number = 0

    @property
    def entries(self) -> tuple[DiagnosticsEntry, ...]:
        """The entries that are left, oldest first."""
        return tuple(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def append(self, source: str, text: str, direction: Direction = "") -> None:
        """Enter what has happened now.

        Args:
            source: Who reports it.
            text: What it is, as text.
            direction: Whether a condition comes or goes.

        """
        self._number += 1
        self._entries.append(DiagnosticsEntry(self._number, self._scheduler.now, source, text, direction))

    def lose_power(self) -> None:
        """Keep what is retentive: the newest entries."""
        while len(self._entries) > _RETAINED:
            self._entries.popleft()

    def find(self, words: str) -> tuple[DiagnosticsEntry, ...]:
        """Return the entries whose source or text contains `words`."""
        return tuple(entry for entry in self._entries if words in entry.source or words in entry.text)

    def text(self, newest: int | None = None) -> str:
        """Return the entries as lines for a person, the newest one first, as an engineering tool shows them.

        Args:
            newest: How many; None for all.

        """
        entries = reversed(self._entries if newest is None else list(self._entries)[-newest:])
        return "\n".join(str(entry) for entry in entries)

    # -- from the event log
    # -----------------------------------------------------------------------------

    def follow(self, history: History) -> Callable[[], None]:
        """Copy alarms and connections of the event log from now on; returns the function that
        ends it.

        Technology alarms come in as far as the catalogue says that the
        diagnostics buffer records them (TA-011).
        """
        texts = _TEXTS
        append = self.append

        def listen(event: Event) -> None:
            text_of = texts.get(event.kind)
            if text_of is not None:
                entry = text_of(event)
                if entry is not None:
                    append(event.source, *entry)

        return history.listen(listen)


Entry = tuple[str, Direction] | None


def _alarm(direction: Direction) -> Callable[[Event], Entry]:
    def words(event: Event) -> Entry:
        entry = catalogue().get(int(event.data.get("number") or 0))
        if entry is None or not entry.diagnostic_buffer:
            return None
        if direction == "going":
            return f"technology alarm {entry.number}: {entry.text}", direction
        reaction, text = event.data.get("reaction"), event.data.get("text") or entry.text
        return f"technology alarm {entry.number}, reaction {reaction}: {text}", direction

    return words


class _Facts(dict[str, object]):
    """Data of an event; what is missing is left open, because a user's own parts may emit the same kinds."""

    def __missing__(self, key: str) -> str:
        return "?"


def _plain(text: str, direction: Direction = "") -> Callable[[Event], Entry]:
    """Return words with places for the data of the event."""
    return lambda event: (text.format_map(_Facts(event.data)), direction)


_TEXTS: Final[dict[str, Callable[[Event], Entry]]] = {
    "alarm.raised": _alarm("coming"),
    "alarm.cleared": _alarm("going"),
    "link.down": _plain("no cyclic communication", "coming"),
    "link.up": _plain("cyclic communication", "going"),
    "link.node_lost": _plain("device lost: {reason}"),
    "link.heartbeat_lost": _plain("device lost: heartbeat"),
    "link.request_failed": _plain("request failed: {text}"),
    "node.failed": _plain("{message}"),
    "power.waits": _plain("MC_Power waits: {reason}"),
    "station.down": _plain("I/O station lost", "coming"),
    "station.up": _plain("I/O station answers", "going"),
    "program.error": _plain("programming error, OB {ob}: {path} = {value}"),
    "controller.encoder_data_saved": _plain("data backup for absolute encoder adjustment saved"),
    "controller.encoder_data_restored": _plain(
        "data backup for absolute encoder adjustment restored successfully"
    ),
    "controller.encoder_data_refused": _plain(
        "data backup for absolute encoder adjustment not restored: {reason}"
    ),
}
"""Kind of event -> text and direction."""
