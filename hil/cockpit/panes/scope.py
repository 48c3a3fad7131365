"""The scope: recorded signals to the pages, every sample of them, in binary frames.

A frame holds rows of one group of signals, which are sampled together; little endian:

    uint8 1, uint8 flags, uint16 number of the subscription, uint32 rows, uint32 group, uint32 columns,
    float64 times[rows] in s, then float64 values[rows] of every column

`flags` bit 0: samples are missing before this frame, because the page was too slow. Numbers of groups and
columns are those of the reply to the subscription.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from struct import Struct
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

import numpy as np
from pydantic import Field

from hil.cockpit.messages import Message, MessageError
from hil.cockpit.pane import Handler, Pane
from hil.record import Trace, TraceGroup
from hil.record.export import write_signals

if TYPE_CHECKING:
    from collections.abc import Iterable

    from hil.bench.bench import Bench
    from hil.cockpit.client import Client
    from hil.record import Group, Recorder

_HEADER: Final = Struct("<BBHIII")
_SAMPLES: Final = 1
_GAP: Final = 1
_PERIOD_S: Final = 1 / 30
"""Time between two frames, s."""
_MOST_BYTES: Final = 256 * 1024
"""Longest frame, bytes: what waits for a page stays small."""
_LATEST_S: Final = 3.0
"""Time in which a sample has to go out, s; else the page gets the newest ones, and a gap."""
KEPT_ROWS: Final = 300_000
"""Rows of a group that are kept for pages that come later, and for what is saved: five minutes at 1 kHz."""


class Subscribe(Message):
    """Show these signals from now on, in place of those before; none: no more."""

    operates = False
    kind: Literal["scope.subscribe"]
    signals: Annotated[list[Annotated[str, Field(min_length=3, max_length=200)]], Field(max_length=64)]
    number: Annotated[int, Field(ge=0, le=65535)]
    """Number of the subscription, which its frames carry."""
    back_s: Annotated[float, Field(ge=0.0, le=600.0)] = 0.0
    """How much of what is recorded already comes first, s."""


class HoldWindow(Message):
    """Hold the samples of signals between two times, to be saved."""

    kind: Literal["scope.hold"]
    signals: Annotated[list[Annotated[str, Field(min_length=3, max_length=200)]], Field(max_length=64)]
    from_s: Annotated[float, Field(ge=0.0, le=1e6)]
    to_s: Annotated[float, Field(ge=0.0, le=1e6)]


class SaveWindow(Message):
    """Save what is held into the working folder, in the format of the suffix."""

    aside = True
    kind: Literal["scope.save"]
    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,80}\.(mf4|csv|npz)$")]


class _Stream:
    """The samples of one group to one page."""

    __slots__ = ("_marks", "_overdue", "columns", "group", "index", "lost", "row")

    def __init__(self, index: int, group: Group, columns: list[int], row: int) -> None:
        self._marks: deque[tuple[float, int]] = deque()
        """Monotonic time, s, and rows that there were."""
        self._overdue = 0
        """Rows that should have gone out by now."""
        self.index = index
        self.group = group
        self.columns = columns
        self.row = row
        """Number of the next row that goes out."""
        self.lost = False

    def look(self, now_s: float) -> None:
        """Note how many rows there are at a time."""
        self._marks.append((now_s, self.group.rows))
        while self._marks[0][0] < now_s - _LATEST_S:
            self._overdue = self._marks.popleft()[1]

    def frame(self, number: int, most_behind: int) -> bytes | None:
        """Return the next rows, of the last `most_behind` ones; None when there are no new ones."""
        group = self.group
        rows = group.rows
        oldest = max(group.first_row, rows - most_behind)
        if self.row < self._overdue:
            oldest = max(oldest, rows - 1)
        if self.row < oldest:
            self.row = oldest
            self.lost = True
        if self.row >= rows:
            return None
        width = 1 + len(group.columns)
        table = np.frombuffer(group.content_from(self.row), dtype="<f8").reshape(-1, width)
        table = table[: max(1, _MOST_BYTES // (8 * (1 + len(self.columns))))]
        flags = _GAP if self.lost else 0
        self.lost = False
        self.row += len(table)
        times = table[:, 0].view("<i8") * 1e-9
        values = np.ascontiguousarray(table[:, [1 + one for one in self.columns]].T)
        header = _HEADER.pack(_SAMPLES, flags, number, len(table), self.index, len(self.columns))
        return b"".join([header, times.tobytes(), values.tobytes()])


class _Subscription:
    def __init__(self, number: int, streams: list[_Stream]) -> None:
        self.number = number
        self.streams = streams


class ScopePane(Pane):
    """Signals of the recorder for the pages.

    Args:
        folder: Where samples are saved.
        most_behind: Rows that a page may lag behind before samples are left out.

    """

    name = "scope"

    def __init__(self, folder: Path, most_behind: int = 60_000) -> None:
        self._folder = folder
        self._most_behind = most_behind
        self._held: Trace | None = None
        self._recorder: Recorder | None = None
        self._now_ns: Callable[[], int] = lambda: 0
        self._subscriptions: dict[Client, _Subscription] = {}
        self._next_s = 0.0

    @property
    def handlers(self) -> Mapping[type[Message], Handler]:
        """What it takes."""
        return {Subscribe: self._subscribe, HoldWindow: self._hold, SaveWindow: self._save}

    def begin(self, bench: Bench) -> None:
        """Take up a bench; the pages subscribe anew when they get its description."""
        scheduler = bench.scheduler
        self._recorder, self._now_ns = bench.recorder, lambda: scheduler.now

    def end(self) -> None:
        """Let go of it."""
        self._recorder = None
        self._subscriptions.clear()

    def gone(self, client: Client) -> None:
        """Forget a page."""
        self._subscriptions.pop(client, None)

    def _subscribe(self, message: Subscribe, client: Client) -> object:
        streams = []
        for index, (group, columns) in enumerate(self._wanted(message.signals)):
            back = self._rows_back(group, message.back_s)
            streams.append(_Stream(index, group, columns, group.rows - back))
        self._subscriptions[client] = _Subscription(message.number, streams)
        return [
            [f"{stream.group.name}.{stream.group.columns[one][0]}" for one in stream.columns]
            for stream in streams
        ]

    def _hold(self, message: HoldWindow, _: Client) -> int:
        ends = [round(one * 1e9) for one in (message.from_s, message.to_s)]
        groups = []
        for group, columns in self._wanted(message.signals):
            content = group.content_from(0)
            stride = 8 * (1 + len(group.columns))
            times = np.frombuffer(content, dtype="<i8").reshape(-1, stride // 8)[:, 0]
            first, end = np.searchsorted(times, ends[0]), np.searchsorted(times, ends[1], side="right")
            part = np.frombuffer(content[first * stride : end * stride], dtype="<f8").reshape(-1, stride // 8)
            kept = np.ascontiguousarray(part[:, [0, *(1 + one for one in columns)]]).tobytes()
            names = tuple(group.columns[one] for one in columns)
            enums = {name: group.enums[name] for name, _ in names if name in group.enums}
            groups.append(TraceGroup.from_bytes(group.name, names, enums, kept))
        self._held = Trace(groups, end_ns=self._now_ns())
        return max((len(group.time_ns) for group in groups), default=0)

    def _save(self, message: SaveWindow, _: Client) -> str:
        path = self._folder / message.name
        if self._held is None:
            raise MessageError("nothing is held: the message scope.hold comes first")
        if path.exists():
            raise MessageError(f"name: {message.name} is there already")
        return str(write_signals(self._held, path))

    def _rows_back(self, group: Group, seconds: float) -> int:
        """Return how many of the newest rows are not older than some seconds."""
        if not seconds:
            return 0
        from_row = max(group.first_row, group.rows - self._most_behind)
        table = np.frombuffer(group.content_from(from_row), dtype="<i8").reshape(-1, 1 + len(group.columns))
        return len(table) - int(np.searchsorted(table[:, 0], self._now_ns() - round(seconds * 1e9)))

    def pulse(self, now_s: float) -> None:
        """Send what is new, and bound what is kept."""
        recorder = self._recorder
        if recorder is None or now_s < self._next_s:
            return
        self._next_s = now_s + _PERIOD_S
        for client, subscription in self._subscriptions.items():
            for stream in subscription.streams:
                stream.look(now_s)
                if client.busy:
                    continue
                frame = stream.frame(subscription.number, self._most_behind)
                if frame is not None:
                    client.send(frame)
        for group in recorder.groups:
            if group.rows - group.first_row > 2 * KEPT_ROWS:
                group.forget(KEPT_ROWS)

    def description(self) -> object:
        """Return all signals with their units, and the texts of those that are states."""
        return None if self._recorder is None else list(_signals(self._recorder.groups))

    def _wanted(self, signals: Iterable[str]) -> list[tuple[Group, list[int]]]:
        """Return the groups of signals with the numbers of their columns.

        Raises:
            MessageError: No bench is up, or a signal is not recorded.

        """
        if self._recorder is None:
            raise MessageError("signals: no bench is up")
        groups = {group.name: group for group in self._recorder.groups}
        wanted: dict[str, list[int]] = {}
        for signal in dict.fromkeys(signals):
            name, _, column = signal.partition(".")
            names = [one for one, _ in groups[name].columns] if name in groups else []
            if column not in names:
                raise MessageError(f"signals: {signal!r} is not recorded")
            wanted.setdefault(name, []).append(names.index(column))
        return [(groups[name], columns) for name, columns in wanted.items()]


def _signals(groups: Iterable[Group]) -> Iterable[dict[str, Any]]:
    for group in groups:
        for column, unit in group.columns:
            signal: dict[str, Any] = {"name": f"{group.name}.{column}", "unit": unit}
            if column in group.enums:
                signal["texts"] = group.enums[column]
            yield signal
