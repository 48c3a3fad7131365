"""The recorder: samples groups of columns once per cycle into flat buffers."""

from __future__ import annotations

import gc
from collections.abc import Callable, Mapping, Sequence
from struct import Struct
from struct import error as StructError  # noqa: N812 - the library's own name `error` says nothing here
from typing import TYPE_CHECKING, Any, Final

from fieldbus.clock import Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from hil.errors import RecordingError
from hil.record._bus_recording import BusRecording
from hil.record._column_file import ColumnFile
from hil.record._stored_log import StoredLog

if TYPE_CHECKING:
    from hil.record._frames import FrameLog
    from hil.record._trace import Trace, TraceGroup
    from hil.record._vocabulary import Vocabulary

ROWS_PER_CHUNK: Final = 512
"""Rows of one buffer; a full buffer is set aside and a new one begun."""
MEMORY_MB: Final = 128
"""Memory of a recording from which on it goes to disk, unless the bench file says otherwise, MB."""
STORE_EVERY_NS: Final = 50_000_000
"""From one call of `Recorder.store_a_little` to the next on a live bench, ns."""
_EVENT_BYTES: Final = 700
"""What an event takes in memory, about."""
_EVENTS_KEPT: Final = 1024
"""Newest events that stay in memory: those that triggers and texts of a running bench look at."""
_FRAMES_KEPT: Final = 16_384
"""Newest frames of a bus that stay in memory, for its load and for who shows it."""
_ROOM_BUFFERS: Final = 2
_ROOM_FRAMES: Final = 2000
_ROOM_EVENTS: Final = 200
"""Buffers of a group, frames of a bus and events that are written in one step on a live bench: a matter of a
millisecond or two.
"""


class Group:
    """Columns that are sampled together; made by `Recorder.add_group`.

    `sample` is the hot path: one call of the row function and one packing into a preallocated buffer.
    """

    __slots__ = (
        "_buffer",
        "_chunks",
        "_dropped",
        "_end",
        "_file",
        "_filled",
        "_offset",
        "_pack_into",
        "_row",
        "_scheduler",
        "_stored",
        "_stride",
        "columns",
        "enums",
        "name",
    )

    def __init__(
        self,
        name: str,
        columns: tuple[tuple[str, str], ...],
        row: Callable[[], Sequence[float]],
        enums: Mapping[str, Mapping[int, str]],
        *,
        scheduler: Scheduler,
        filled: Callable[[], None],
    ) -> None:
        self.name = name
        self.columns = columns
        self.enums = {column: dict(texts) for column, texts in enums.items()}
        layout = Struct(f"<q{len(columns)}d")
        self._pack_into = layout.pack_into
        self._stride = layout.size
        self._end = layout.size * ROWS_PER_CHUNK
        self._chunks: list[bytearray] = []
        self._dropped = 0
        self._file: ColumnFile | None = None
        self._stored = 0
        self._filled = filled
        self._buffer = bytearray(self._end)
        self._offset = 0
        self._row = row
        self._scheduler = scheduler

    def sample(self) -> None:
        """Record one row at the present time.

        Raises:
            RecordingError: The row function returned something else than one number per column.

        """
        offset = self._offset
        try:
            head: tuple[Any, ...] = (self._buffer, offset, self._scheduler.time_ns)
            self._pack_into(*(head + tuple(self._row())))
        except StructError as error:
            raise RecordingError(
                f"group {self.name!r}: the row function did not return {len(self.columns)} numbers: {error}"
            ) from None
        offset += self._stride
        if offset == self._end:
            self._chunks.append(self._buffer)
            self._buffer = bytearray(self._end)
            self._offset = 0
            self._filled()
            return
        self._offset = offset

    @property
    def rows(self) -> int:
        """Number of rows recorded so far, those that were dropped included."""
        held = len(self._chunks) * ROWS_PER_CHUNK + self._offset // self._stride
        return self._dropped + self._stored + held

    @property
    def first_row(self) -> int:
        """Number of the oldest row that is kept."""
        return self._dropped

    @property
    def memory(self) -> int:
        """Bytes of full buffers in memory."""
        return len(self._chunks) * self._end

    def store(self, most: int | None = None) -> None:
        """Write full buffers to disk, the oldest first.

        Args:
            most: Number of buffers at most; None: all.

        Raises:
            RecordingError: The disk is full.

        """
        chunks = self._chunks if most is None else self._chunks[:most]
        if not chunks:
            return
        if self._file is None:
            self._file = ColumnFile(self.name, len(self.columns))
        content = chunks[0] if len(chunks) == 1 else b"".join(chunks)
        self._file.write(content, at=self._stored)
        self._stored += len(chunks) * ROWS_PER_CHUNK
        del self._chunks[: len(chunks)]

    def reader(self, column: str) -> Callable[[], float | None]:
        """Return a cheap function that gives the newest value of `column` (None before the first sample)."""
        names = [name for name, _ in self.columns]
        if column not in names:
            raise RecordingError(f"group {self.name!r} has no column {column!r}; it has: {', '.join(names)}")
        number = names.index(column)
        field = 8 * (1 + number)
        unpack_from = Struct("<d").unpack_from
        stride = self._stride

        def read() -> float | None:
            offset = self._offset
            if offset:
                buffer = self._buffer
            elif self._chunks:
                buffer = self._chunks[-1]
                offset = self._end
            elif self._file is not None:
                return float(self._file.values(self._stored - 1, 1)[0, number])
            else:
                return None
            value: float = unpack_from(buffer, offset - stride + field)[0]
            return value

        return read

    def forget(self, keep: int = 0) -> None:
        """Drop all rows but the newest ones.

        Args:
            keep: Number of rows that stay at least.

        """
        chunks = len(self._chunks) - -(-keep // ROWS_PER_CHUNK)
        if self._file is not None:
            first = 0 if chunks < 0 else self._stored
            if chunks < 0:
                first = max(0, self._stored + chunks * ROWS_PER_CHUNK)
            if not first:
                return
            left = self._stored - first
            before, self._file = self._file, None
            if left:
                self._file = ColumnFile(self.name, len(self.columns))
                self._file.write(before.content(first, left), at=0)
            self._stored = left
            self._dropped += first
        if chunks > 0:
            del self._chunks[:chunks]
            self._dropped += chunks * ROWS_PER_CHUNK

    def content_from(self, row: int, most: int | None = None) -> bytes:
        """Return the rows from number `row` on, as `content` does, as far as they are kept.

        Args:
            row: Number of the first row.
            most: Number of rows at most; None: all.

        """
        first = max(0, row - self._dropped)
        end = self.rows - self._dropped
        if most is not None:
            end = min(end, first + most)
        parts: list[bytes | memoryview] = []
        if self._file is not None and first < self._stored:
            parts.append(self._file.content(first, min(end, self._stored) - first))
        begin = self._stored
        stride = self._stride
        for held in [*(memoryview(one) for one in self._chunks), memoryview(self._buffer)[: self._offset]]:
            place, size = max(first - begin, 0), len(held) // stride
            behind = min(end - begin, size)
            if place < behind:
                parts.append(held[place * stride : behind * stride])
            begin += size
        return b"".join(parts)

    def content(self) -> bytes:
        """Return all rows, little endian: one 64-bit time in ns and one float64 per column."""
        return self.content_from(self._dropped)

    def rows_so_far(self) -> TraceGroup:
        """Return the rows that are kept; what is on disk is not read for it."""
        from hil.record._trace import TraceGroup

        file = self._file
        if file is None:
            return TraceGroup.from_bytes(self.name, self.columns, self.enums, self.content())
        self.store()
        file.write(memoryview(self._buffer)[: self._offset], at=self._stored)
        rows = self._stored + self._offset // self._stride
        return TraceGroup(self.name, self.columns, self.enums, file.times(0, rows), file.values(0, rows))


class Recorder:
    """Collects what a bench does: sampled groups, the event log and the frames of its buses.

    Args:
        history: Event log of the bench.
        scheduler: Source of the time stamps.
        memory_mb: Memory that it takes at most, about, MB; when it is full, everything but the newest goes to
            temporary files.

    """

    def __init__(self, history: History, scheduler: Scheduler, *, memory_mb: int = MEMORY_MB) -> None:
        self.history = history
        self._limit = memory_mb * 1_000_000
        self._gradual = False
        self._full = False
        self._held = False
        self._scheduler = scheduler
        self._groups: dict[str, Group] = {}
        self._buses: dict[str, BusRecording] = {}
        self._constants: dict[str, float] = {}
        self._looked_at: set[str] = set()

    def add_group(
        self,
        name: str,
        columns: Sequence[tuple[str, str]],
        row: Callable[[], Sequence[float]],
        *,
        enums: Mapping[str, Mapping[int, str]] | None = None,
    ) -> Group:
        """Add a group of columns; call `sample` of the result once per cycle.

        Args:
            name: Component, first part of the signal names (`axis1` in `axis1.actual_velocity`).
            columns: Name and unit of every column ("" for none).
            row: Called at every sample; returns one number per column.
            enums: Texts of the values of state columns, by column.

        Raises:
            ConfigurationError: The name is taken or has a dot, a column is doubled, an enum names no column.

        """
        if not name or "." in name or name in self._groups:
            raise ConfigurationError("recorder group", name, "a new name without a dot")
        names = [column for column, _ in columns]
        if not names or len(set(names)) != len(names) or "" in names:
            raise ConfigurationError(f"recorder group {name}", names, "at least one column, every name once")
        for column in enums or {}:
            if column not in names:
                raise ConfigurationError(f"recorder group {name}, enum", column, ", ".join(names))
        group = Group(
            name,
            tuple((column, unit) for column, unit in columns),
            row,
            enums or {},
            scheduler=self._scheduler,
            filled=self._filled,
        )
        self._groups[name] = group
        return group

    def add_bus(
        self,
        name: str,
        log: FrameLog | Callable[[], FrameLog],
        *,
        drop: Callable[[int], None] | None = None,
        held: Callable[[], int] | None = None,
    ) -> None:
        """Take over the frame log of a segment.

        Args:
            name: The segment.
            log: A growing list of (time_ns, sender, frame, error), or what returns it.
            drop: Removes so many entries from its begin, when they are on disk; None: they stay in memory.
            held: Number of entries in memory, where `log` has to make them first; None: what `log` returns.

        """
        if not name or name in self._buses:
            raise ConfigurationError("recorder bus", name, "a new name")
        self._buses[name] = BusRecording(log, drop, held)

    # -- memory ---------------------------------------------------------------------------------------------

    @property
    def memory(self) -> int:
        """What the recording takes in memory, about, bytes."""
        groups = sum(group.memory for group in self._groups.values())
        buses = sum(bus.memory for bus in self._buses.values())
        return groups + buses + len(self.history.events.newest) * _EVENT_BYTES

    def _filled(self) -> None:
        """Look at the memory, when a buffer is full."""
        if not self._gradual and self.memory > self._limit:
            self.store()
            # A case runs without looking for cycles; one that is so long has left some.
            gc.collect()

    def hold(self) -> None:
        """Keep in memory what comes from now on, however much: a process that was forked shares its temporary
        files with the others.
        """
        self._held = True

    def store(self, *, frames_kept: int = _FRAMES_KEPT, events_kept: int = _EVENTS_KEPT) -> None:
        """Write all but the newest to temporary files.

        Args:
            frames_kept: Newest frames of each bus that stay in memory.
            events_kept: Newest events that do.

        Raises:
            RecordingError: The disk is full.

        """
        if self._held:
            return
        for group in self._groups.values():
            group.store()
        for bus in self._buses.values():
            bus.store(len(bus) - frames_kept)
        self._store_events(len(self.history.events.newest) - events_kept)

    def _store_events(self, count: int) -> None:
        if count > 0:
            self.history.events.move(count, StoredLog)

    def store_a_little(self) -> None:
        """Write a part to temporary files, if the memory is full: a live bench calls it again and again, and
        is not held up by it.

        Raises:
            RecordingError: The disk is full.

        """
        self._gradual = True
        if self._held:
            return
        if not self._full and self.memory <= self._limit:
            return
        self._full = True
        fullest = max(self._groups.values(), key=lambda group: group.memory, default=None)
        if fullest is not None:
            fullest.store(_ROOM_BUFFERS)
        for bus in self._buses.values():
            bus.store(min(_ROOM_FRAMES, len(bus) - _FRAMES_KEPT))
        self._store_events(min(_ROOM_EVENTS, len(self.history.events.newest) - _EVENTS_KEPT))

    def forget(self) -> None:
        """Drop what is recorded so far, of a bench that runs on and on and is not judged."""
        for group in self._groups.values():
            group.forget()
        for bus in self._buses.values():
            bus.forget()
        self.history.events.clear()

    @property
    def frame_count(self) -> int:
        """Number of frames that are recorded of all buses."""
        return sum(len(bus.entries()) for bus in self._buses.values())

    def frames(self, bus: str) -> FrameLog:
        """Return the frames of a bus so far, by their number from the first.

        Raises:
            RecordingError: There is no such bus.

        """
        try:
            return self._buses[bus].entries()
        except KeyError:
            known = ", ".join(self._buses) or "none"
            raise RecordingError(f"no bus {bus!r} is recorded; recorded are: {known}") from None

    @property
    def buses(self) -> tuple[str, ...]:
        """Names of the recorded buses."""
        return tuple(self._buses)

    @property
    def constants(self) -> dict[str, float]:
        """Facts of the bench that judges of the trace need, by name; those of `set_constant`."""
        return self._constants

    def set_constant(self, name: str, value: float) -> None:
        """Note a fact of the bench (`axis1.max_deceleration`) that a judge of the trace needs."""
        self._constants[name] = float(value)

    def sample(self, group: Group | str) -> None:
        """Record one row of a group; `Group.sample` is the same without the look-up."""
        if isinstance(group, str):
            group = self._group(group)
        group.sample()

    def reader(self, signal: str) -> Callable[[], float | None]:
        """Return a cheap function that gives the newest value of `component.column`."""
        name, _, column = signal.partition(".")
        return self._group(name).reader(column)

    def has_signal(self, signal: str) -> bool:
        """Whether `component.column` is recorded."""
        name, _, column = signal.partition(".")
        group = self._groups.get(name)
        return group is not None and any(column == known for known, _ in group.columns)

    @property
    def groups(self) -> tuple[Group, ...]:
        """The groups in the order in which they were added."""
        return tuple(self._groups.values())

    def trace(self, vocabulary: Vocabulary | None = None) -> Trace:
        """Return an immutable copy of everything recorded so far, with what could be in it."""
        from hil.record._trace import Trace

        return Trace(
            [group.rows_so_far() for group in self._groups.values()],
            events=self.history.events.copy(),
            frames={name: bus.entries() for name, bus in self._buses.items()},
            constants=self._constants,
            end_ns=self._scheduler.now,
            vocabulary=vocabulary,
            looked_at=self._looked_at,
        )

    def _group(self, name: str) -> Group:
        try:
            return self._groups[name]
        except KeyError:
            known = ", ".join(self._groups) or "none"
            raise RecordingError(f"no group {name!r} is recorded; recorded are: {known}") from None
