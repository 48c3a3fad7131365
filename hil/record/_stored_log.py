"""Entries of a log in a temporary file, in blocks that are read as a whole."""

from __future__ import annotations

import pickle
from array import array
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from typing import Final, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from hil.record._spool import Spool

T = TypeVar("T")

_BLOCK: Final = 256
"""Entries of a block."""


class StoredLog(Generic[T]):
    """Entries of any kind, such as events; equal to what was put in, types of numbers included."""

    def __init__(self) -> None:
        self._spool = Spool(in_memory=0)
        self._firsts = array("q")
        self._places = array("q", [0])
        self._count = 0
        self._view: NDArray[np.uint8] | None = None
        self._read: tuple[int, Sequence[T]] | None = None
        """The block that was read last, and its number."""

    def extend(self, entries: Iterable[T]) -> None:
        """Add entries at the end."""
        left = iter(entries)
        self._view = None
        while block := list(islice(left, _BLOCK)):
            data = pickle.dumps(block, pickle.HIGHEST_PROTOCOL)
            self._spool.write(data)
            self._firsts.append(self._count)
            self._count += len(block)
            self._places.append(self._places[-1] + len(data))

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index: int) -> T:
        if not 0 <= index < self._count:
            raise IndexError(index)
        number = bisect_right(self._firsts, index) - 1
        return self._block(number)[index - self._firsts[number]]

    def __iter__(self) -> Iterator[T]:
        for number in range(len(self._firsts)):
            yield from self._block(number)

    def part(self, first: int, last: int) -> list[T]:
        """Return the entries with numbers from `first` to `last` - 1."""
        return [self[index] for index in range(first, last)]

    def _block(self, number: int) -> Sequence[T]:
        if self._read is None or self._read[0] != number:
            if self._view is None:
                self._view = self._spool.view(np.uint8)
            data = self._view[self._places[number] : self._places[number + 1]].tobytes()
            # Written by this object into a file that nobody else can open.
            self._read = number, pickle.loads(data)  # noqa: S301
        return self._read[1]
