"""A log that grows at its end, whose older entries may be kept somewhere else than in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from typing import Protocol, TypeVar, overload

T = TypeVar("T")

_READ = 4096
"""Entries that are read at a time."""


class Store(Protocol[T]):
    """Keeps entries in their order, for example in a file; what is in it never changes."""

    def extend(self, entries: Iterable[T], /) -> None:
        """Add entries at the end."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> T: ...

    def __iter__(self) -> Iterator[T]: ...

    def part(self, first: int, last: int, /) -> Sequence[T]:
        """Return the entries with numbers from `first` to `last` - 1."""


class LogPart(Sequence[T]):
    """Entries of a log from one number to another; they are read when they are wanted.

    Args:
        log: The log; it only grows.
        first: Number of the first entry.
        last: Number behind the last one.

    """

    def __init__(self, log: Sequence[T], first: int, last: int) -> None:
        self._log = log
        self._first = first
        self._count = max(0, last - first)

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> T: ...

    @overload
    def __getitem__(self, index: slice) -> list[T]: ...

    def __getitem__(self, index: int | slice) -> T | list[T]:
        if isinstance(index, slice):
            begin, end, step = index.indices(self._count)
            return list(self._log[self._first + begin : self._first + max(begin, end)])[::step]
        at = index + self._count if index < 0 else index
        if not 0 <= at < self._count:
            raise IndexError(index)
        return self._log[self._first + at]

    def __iter__(self) -> Iterator[T]:
        for begin in range(0, self._count, _READ):
            yield from self[begin : begin + _READ]


class GrowingLog(Sequence[T]):
    """All entries of a log by their number from its begin: those in a store, then those in memory.

    Args:
        newest: The entries in memory, in their order; who writes the log may append to this list itself.

    """

    def __init__(self, newest: list[T]) -> None:
        self.newest = newest
        self._older: Store[T] | None = None
        self._stored = 0

    @property
    def stored(self) -> int:
        """Number of entries that are not in memory."""
        return self._stored

    def append(self, entry: T) -> None:
        """Add an entry at the end."""
        self.newest.append(entry)

    def move(
        self, count: int, make: Callable[[], Store[T]], drop: Callable[[int], None] | None = None
    ) -> None:
        """Move the oldest entries of the memory to the store.

        Args:
            count: How many.
            make: Makes the store; called once.
            drop: Removes so many entries from the begin of `newest`; None: they are just removed.

        """
        if self._older is None:
            self._older = make()
        self._older.extend(self.newest[:count])
        self._stored += count
        if drop is None:
            del self.newest[:count]
        else:
            drop(count)

    def clear(self) -> None:
        """Drop all entries; numbers start at 0 again."""
        self.newest.clear()
        self.forget_stored()

    def forget_stored(self) -> None:
        """Drop the entries in the store; those in memory are numbered from 0."""
        self._older, self._stored = None, 0

    def copy(self) -> Sequence[T]:
        """Return the entries of this moment; those in the store are not read for it."""
        if not self._stored:
            return tuple(self.newest)
        copied = GrowingLog(list(self.newest))
        copied._older, copied._stored = self._older, self._stored
        return copied

    def __len__(self) -> int:
        return self._stored + len(self.newest)

    @overload
    def __getitem__(self, index: int) -> T: ...

    @overload
    def __getitem__(self, index: slice) -> list[T]: ...

    def __getitem__(self, index: int | slice) -> T | list[T]:
        stored, older = self._stored, self._older
        if isinstance(index, slice):
            if older is None:
                return self.newest[index]
            begin, end, step = index.indices(len(self))
            if step != 1:
                return [self[one] for one in range(begin, end, step)]
            kept = older.part(begin, min(end, stored)) if begin < min(end, stored) else ()
            return [*kept, *self.newest[max(begin - stored, 0) : max(end - stored, 0)]]
        if older is None or not stored:
            return self.newest[index]
        at = index + len(self) if index < 0 else index
        if not 0 <= at < len(self):
            raise IndexError(index)
        return older[at] if at < stored else self.newest[at - stored]

    def __iter__(self) -> Iterator[T]:
        if self._older is not None:
            # A store that has grown since a copy was made has more entries than the copy.
            yield from islice(self._older, self._stored)
        yield from self.newest

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, list | tuple | GrowingLog):
            return NotImplemented
        return len(self) == len(other) and all(a == b for a, b in zip(self, other, strict=True))

    __hash__ = None  # type: ignore[assignment]  # it changes

    def __repr__(self) -> str:
        return f"<GrowingLog of {len(self)} entries, {self._stored} of them stored>"
