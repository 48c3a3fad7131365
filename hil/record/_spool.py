"""Bytes that only grow: in memory while they are few, then in a temporary file, whose pages the system drops
and reads again as it likes.

A temporary file has no name from its begin: the system takes it away with the last view of it, and at the end
of the process, however that ends.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any, Final

import numpy as np
from numpy.typing import DTypeLike, NDArray

from hil.errors import RecordingError

IN_MEMORY: Final = 16 * 1024 * 1024
"""Bytes from which on a temporary file is taken."""
_CHUNK: Final = 1024 * 1024


@contextmanager
def naming_the_disk() -> Iterator[None]:
    """Say of what cannot be written where the file is, and what to do.

    Raises:
        RecordingError: In place of an `OSError`.

    """
    try:
        yield
    except OSError as error:
        raise RecordingError(
            f"the recording cannot be kept in a temporary file in {tempfile.gettempdir()}: {error.strerror}; "
            "TMPDIR names another folder, recording_memory_mb in [bench] keeps more in memory"
        ) from error


class Spool:
    """A store of bytes; the temporary file, in TMPDIR, ends with the last view of it.

    Args:
        in_memory: Bytes from which on a temporary file is taken.

    """

    def __init__(self, in_memory: int = IN_MEMORY) -> None:
        self._in_memory = in_memory
        self._held = bytearray()
        self._file: IO[bytes] | None = None

    def write(self, data: bytes | bytearray) -> None:
        """Add bytes at the end."""
        self._held += data
        if len(self._held) >= (self._in_memory if self._file is None else _CHUNK):
            self._flush()

    def _flush(self) -> None:
        with naming_the_disk():
            if self._file is None:
                self._file = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115 - lives as long as its views
            left = memoryview(self._held)
            while left:
                left = left[self._file.write(left) :]
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
    with naming_the_disk(), tempfile.TemporaryFile() as file:
        return np.memmap(file, dtype=np.float64, mode="w+", shape=(rows, columns))
