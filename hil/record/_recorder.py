"""The recorder: samples groups of columns once per cycle into flat buffers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from struct import Struct
from struct import error as StructError  # noqa: N812 - the library's own name `error` says nothing here
from typing import TYPE_CHECKING, Final

from fieldbus.clock import Scheduler
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from hil.errors import RecordingError

if TYPE_CHECKING:
    from hil.record._frames import FrameLog
    from hil.record._trace import Trace
    from hil.record._vocabulary import Vocabulary

ROWS_PER_CHUNK: Final = 512
"""Rows of one buffer; a full buffer is set aside and a new one begun."""


class Group:
    """Columns that are sampled together; made by `Recorder.add_group`.

    `sample` is the hot path: one call of the row function and one packing into a preallocated buffer.
    """

    __slots__ = (
        "_buffer",
        "_chunks",
        "_dropped",
        "_end",
        "_offset",
        "_pack_into",
        "_row",
        "_scheduler",
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
        scheduler: Scheduler,
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
            self._pack_into(self._buffer, offset, self._scheduler.now, *self._row())
        except StructError as error:
            raise RecordingError(
                f"group {self.name!r}: the row function did not return {len(self.columns)} numbers: {error}"
            ) from None
        offset += self._stride
        if offset == self._end:
            self._chunks.append(self._buffer)
            self._buffer = bytearray(self._end)
            offset = 0
        self._offset = offset

    @property
    def rows(self) -> int:
        """Number of rows recorded so far, those that were dropped included."""
        return self._dropped + len(self._chunks) * ROWS_PER_CHUNK + self._offset // self._stride

    @property
    def first_row(self) -> int:
        """Number of the oldest row that is kept."""
        return self._dropped

    def reader(self, column: str) -> Callable[[], float | None]:
        """Return a cheap function that gives the newest value of `column` (None before the first sample)."""
        names = [name for name, _ in self.columns]
        if column not in names:
            raise RecordingError(f"group {self.name!r} has no column {column!r}; it has: {', '.join(names)}")
        field = 8 * (1 + names.index(column))
        unpack_from = Struct("<d").unpack_from
        stride = self._stride

        def read() -> float | None:
            offset = self._offset
            if offset:
                buffer = self._buffer
            elif self._chunks:
                buffer = self._chunks[-1]
                offset = self._end
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
        if chunks > 0:
            del self._chunks[:chunks]
            self._dropped += chunks * ROWS_PER_CHUNK

    def content_from(self, row: int) -> bytes:
        """Return the rows from number `row` on, as `content` does, as far as they are kept."""
        chunk, place = divmod(max(0, row - self._dropped), ROWS_PER_CHUNK)
        parts = [memoryview(one) for one in self._chunks[chunk:]]
        parts.append(memoryview(self._buffer)[: self._offset])
        if chunk > len(self._chunks):
            return b""
        parts[0] = parts[0][place * self._stride :]
        return b"".join(parts)

    def content(self) -> bytes:
        """Return all rows, little endian: one 64-bit time in ns and one float64 per column."""
        return b"".join([*self._chunks, memoryview(self._buffer)[: self._offset]])


class Recorder:
    """Collects what a bench does: sampled groups, the event log and the frames of its buses.

    Args:
        history: Event log of the bench.
        scheduler: Source of the time stamps.

    """

    def __init__(self, history: History, scheduler: Scheduler) -> None:
        self.history = history
        self._scheduler = scheduler
        self._groups: dict[str, Group] = {}
        self._buses: dict[str, Callable[[], FrameLog]] = {}
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
            name, tuple((column, unit) for column, unit in columns), row, enums or {}, self._scheduler
        )
        self._groups[name] = group
        return group

    def add_bus(self, name: str, log: FrameLog | Callable[[], FrameLog]) -> None:
        """Take over the frame log of a segment: a growing list of (time_ns, sender, frame, error), or what
        returns it.
        """
        if not name or name in self._buses:
            raise ConfigurationError("recorder bus", name, "a new name")
        self._buses[name] = log if callable(log) else lambda: log

    def forget(self) -> None:
        """Drop what is recorded so far, of a bench that runs on and on and is not judged."""
        for group in self._groups.values():
            group.forget()
        for log in self._buses.values():
            entries = log()
            if isinstance(entries, list):
                entries.clear()
        self.history.events.clear()

    @property
    def frame_count(self) -> int:
        """Number of frames that are recorded of all buses."""
        return sum(len(log()) for log in self._buses.values())

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
        from hil.record._trace import Trace, TraceGroup

        groups = [
            TraceGroup.from_bytes(group.name, group.columns, group.enums, group.content())
            for group in self._groups.values()
        ]
        return Trace(
            groups,
            events=self.history.events,
            frames={name: log() for name, log in self._buses.items()},
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
