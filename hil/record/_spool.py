"""Bytes that only grow: in memory while they are few, then in a temporary file, whose pages the system drops
and reads again as it likes.
"""

from __future__ import annotations

import tempfile
from typing import IO, Any, Final

import numpy as np
from numpy.typing import DTypeLike, NDArray

IN_MEMORY: Final = 16 * 1024 * 1024
"""Bytes from which on a temporary file is taken."""
_CHUNK: Final = 1024 * 1024


class Spool:
    """A store of bytes; the temporary file, in TMPDIR, ends with the last view of it."""

    def __init__(self) -> None:
        self._held = bytearray()
        self._file: IO[bytes] | None = None

    def write(self, data: bytes) -> None:
        """Add bytes at the end."""
        self._held += data
        if len(self._held) >= (IN_MEMORY if self._file is None else _CHUNK):
            self._flush()

    def _flush(self) -> None:
        if self._file is None:
            self._file = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as its views
        self._file.write(self._held)
        self._file.flush()
        self._held = bytearray()

    def view(self, dtype: DTypeLike) -> NDArray[Any]:
        """Return what was written so far, read-only."""
        if self._file is None:
            return np.frombuffer(bytes(self._held), dtype=dtype)
        if self._held:
            self._flush()
        return np.memmap(self._file, dtype=dtype, mode="r")


def new_array(rows: int, columns: int) -> NDArray[np.float64]:
    """Return an array of numbers that are not set, in memory or, if it is large, in a temporary file."""
    if rows * columns * 8 < IN_MEMORY:
        return np.empty((rows, columns))
    with tempfile.TemporaryFile() as file:
        return np.memmap(file, dtype=np.float64, mode="w+", shape=(rows, columns))
