"""The rows of a group in a temporary file, each column in one piece.

The file has a region of the same length for the times and for every column; what has not been written yet
takes no room on the disk (a sparse file). So a column grows at its end and is still one array in the mapped
file: who reads one touches the pages of this one alone.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from typing import IO, Final

import numpy as np
from numpy.typing import NDArray

from hil.errors import RecordingError
from hil.record._spool import naming_the_disk

_LONGEST: Final = 2**40
"""Bytes of all regions: what every usual file system takes for one sparse file."""
_LONGEST_REGION: Final = 2**36
_PAGE: Final = 2**16
"""A region is a multiple of it: no page of any system has parts of two columns."""
_PROBE: Final = 2**26


class ColumnFile:
    """Rows of one 64-bit time and `columns` float64 each.

    Args:
        name: Name of the group, for messages.
        columns: Number of its columns.

    Raises:
        RecordingError: No such file can be made in TMPDIR.

    """

    def __init__(self, name: str, columns: int) -> None:
        self._name = name
        self._columns = columns
        self._region = min(_LONGEST_REGION, _LONGEST // (columns + 1)) // _PAGE * _PAGE
        self.rows = 0
        """Number of rows that are written."""
        with naming_the_disk():
            self._file: IO[bytes] = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - lives with its views
            self._number = self._file.fileno()
            self._refuse_dense()
            length = self._region * (columns + 1)
            self._file.truncate(length)
            self._map = mmap.mmap(self._number, length, access=mmap.ACCESS_READ)

    def _refuse_dense(self) -> None:
        """Refuse a file system that would fill the room between two columns."""
        os.pwrite(self._number, b"\1", _PROBE)
        taken = getattr(os.fstat(self._number), "st_blocks", 0) * 512
        self._file.truncate(0)
        if taken > _PROBE // 2:
            raise RecordingError(
                f"a long recording needs sparse files, which {tempfile.gettempdir()} does not have: "
                "TMPDIR names another folder"
            )

    def write(self, content: bytes | bytearray | memoryview, *, at: int) -> None:
        """Write rows as `Group.content` has them, from row `at` on, at most `rows`.

        Raises:
            RecordingError: The disk is full, or the recording longer than the file can be.

        """
        table = np.frombuffer(content, dtype="<u8").reshape(-1, 1 + self._columns)
        if not len(table):
            return
        end = at + len(table)
        if end * 8 > self._region:
            raise RecordingError(f"the recording of {self._name} is full: {self._region // 8} rows")
        turned = np.ascontiguousarray(table.T)
        values = turned[1:].view("<f8")
        # One bit pattern for every not-a-number, as in a trace in memory.
        values[np.isnan(values)] = np.nan
        with naming_the_disk():
            for number, column in enumerate(turned):
                # What is zero all the time, as many flags are, is a hole of the file.
                if at < self.rows or column.any():
                    _write_all(self._number, column.tobytes(), number * self._region + at * 8)
        self.rows = max(self.rows, end)

    def times(self, first: int, rows: int) -> NDArray[np.int64]:
        """Return the times of rows from number `first` on, ns."""
        return np.ndarray((rows,), np.dtype("<i8"), self._map, first * 8)

    def values(self, first: int, rows: int) -> NDArray[np.float64]:
        """Return rows by columns, from row number `first` on; a column of it lies in one piece."""
        return np.ndarray(
            (rows, self._columns),
            np.dtype("<f8"),
            self._map,
            self._region + first * 8,
            (8, self._region),
        )

    def content(self, first: int, rows: int) -> bytes:
        """Return rows from number `first` on, as `Group.content` has them."""
        table = np.empty((rows, 1 + self._columns), dtype="<f8")
        table[:, 0] = self.times(first, rows).view("<f8")
        table[:, 1:] = self.values(first, rows)
        return table.tobytes()

    def release(self) -> None:
        """Let the system take back the memory of pages that were read; they are read again when needed."""
        if hasattr(self._map, "madvise"):
            self._map.madvise(mmap.MADV_DONTNEED)


def _write_all(number: int, data: bytes, place: int) -> None:
    done = 0
    while done < len(data):
        done += os.pwrite(number, data[done:] if done else data, place + done)
