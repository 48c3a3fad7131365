"""The rows of a group that another process records."""

from __future__ import annotations

from collections.abc import Mapping

from hil.record._column_file import ColumnFile
from hil.record._spool import IN_MEMORY
from hil.record._trace import TraceGroup


class ReceivedRows:
    """The rows of a group of another recorder, as they come from it: in memory while they are few.

    Args:
        name: Name of the group.
        columns: Name and unit of its columns.
        enums: Texts of the values of state columns, by column.

    """

    def __init__(
        self,
        name: str,
        columns: tuple[tuple[str, str], ...],
        enums: Mapping[str, Mapping[int, str]],
    ) -> None:
        self._name = name
        self._columns = columns
        self._enums = enums
        self._held = bytearray()
        self._file: ColumnFile | None = None

    @property
    def rows(self) -> int:
        """Number of rows that have come."""
        held = len(self._held) // (8 * (1 + len(self._columns)))
        return held if self._file is None else self._file.rows + held

    def add(self, content: bytes) -> None:
        """Add rows as `Group.content` has them.

        Raises:
            RecordingError: The disk is full.

        """
        self._held += content
        if len(self._held) > IN_MEMORY:
            self._store()

    def _store(self) -> None:
        if self._file is None:
            self._file = ColumnFile(self._name, len(self._columns))
        self._file.write(self._held, at=self._file.rows)
        self._held = bytearray()

    def so_far(self) -> TraceGroup:
        """Return the rows that have come; those on disk are not read for it."""
        file = self._file
        if file is None:
            return TraceGroup.from_bytes(self._name, self._columns, self._enums, bytes(self._held))
        self._store()
        return TraceGroup(
            self._name, self._columns, self._enums, file.times(0, file.rows), file.values(0, file.rows)
        )
