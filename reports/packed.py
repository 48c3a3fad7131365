"""Long lists of a case that hardly anybody looks at again, kept small."""

from __future__ import annotations

import pickle
import zlib
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, Generic, TypeVar, cast, overload

from reports.model import CaseResult

T = TypeVar("T")
_LEVEL = 1  # most of what there is to gain, at a fifth of the time of the highest


class Packed(Sequence[T], Generic[T]):
    """A list that takes a tenth of the memory, unpacked when it is asked for; only the one asked for last
    stays unpacked.

    Args:
        items: What it holds; changes to them afterwards are not seen.

    """

    __slots__ = ("_content", "_length")
    __hash__ = None  # type: ignore[assignment]  # as equal as lists are
    _last: ClassVar[tuple[object, list[Any]] | None] = None

    def __init__(self, items: Sequence[T]) -> None:
        self._length = len(items)
        self._content = zlib.compress(pickle.dumps(list(items), protocol=pickle.HIGHEST_PROTOCOL), _LEVEL)

    def _unpacked(self) -> list[T]:
        last = Packed._last
        if last is None or last[0] is not self:
            # Our own bytes from this process: nothing from outside is unpickled.
            last = Packed._last = (self, pickle.loads(zlib.decompress(self._content)))  # noqa: S301
        return cast("list[T]", last[1])

    def __len__(self) -> int:
        return self._length

    @overload
    def __getitem__(self, index: int) -> T: ...

    @overload
    def __getitem__(self, index: slice) -> list[T]: ...

    def __getitem__(self, index: int | slice) -> T | list[T]:
        """Return an item, or some of them."""
        return self._unpacked()[index]

    def __iter__(self) -> Iterator[T]:
        return iter(self._unpacked())

    def __eq__(self, other: object) -> bool:
        return list(self) == list(other) if isinstance(other, Sequence) else NotImplemented


def pack_case(case: CaseResult) -> None:
    """Make a finished case small: a run keeps thousands of them until its report is written."""
    for name in ("story", "messages"):
        items = getattr(case, name)
        if items and isinstance(items, list):  # not what is packed, or read when it is asked for
            setattr(case, name, Packed(items))
