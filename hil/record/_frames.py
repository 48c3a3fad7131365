"""The frame log of a bus, and the one of a long log in little memory: packed, and made when they are read."""

from __future__ import annotations

from array import array
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final, TypeAlias, overload

from fieldbus.can.frame import CanFrame

if TYPE_CHECKING:
    from fieldbus.modbus import ModbusFrame

BusFrame: TypeAlias = "CanFrame | ModbusFrame"
Entry: TypeAlias = tuple[int, str, CanFrame, str]
"""Time (ns), sender, frame, error (empty: none)."""
FrameLog: TypeAlias = "Sequence[tuple[int, str, BusFrame, str]]"
"""The log of a bus of any kind, in the order in which the frames ended."""

_EXTENDED: Final = 0x8000_0000
_REMOTE: Final = 0x4000_0000
_ID: Final = 0x1FFF_FFFF
_WIDTH: Final = 8


class PackedFrames(Sequence[Entry]):
    """A log of CAN frames without senders, 21 bytes per frame; it grows at its end only."""

    def __init__(self) -> None:
        self._times = array("q")
        self._ids = array("I")
        self._lengths = array("B")
        self._data = bytearray()
        self._errors: dict[int, str] = {}

    def append(self, time_ns: int, frame: CanFrame, error: str = "") -> None:
        """Add a frame at the end."""
        if error:
            self._errors[len(self._times)] = error
        self._times.append(time_ns)
        self._ids.append(
            frame.can_id | (_EXTENDED if frame.extended else 0) | (_REMOTE if frame.remote else 0)
        )
        self._lengths.append(len(frame.data) | frame.dlc << 4)
        self._data += frame.data.ljust(_WIDTH, b"\0")

    def shift(self, by_ns: int) -> None:
        """Move the times of all frames."""
        if by_ns:
            self._times = array("q", (time_ns + by_ns for time_ns in self._times))

    @property
    def first_ns(self) -> int:
        """Time of the first frame."""
        return self._times[0]

    @property
    def last_ns(self) -> int:
        """Time of the last frame."""
        return self._times[-1]

    def __len__(self) -> int:
        return len(self._times)

    @overload
    def __getitem__(self, index: int) -> Entry: ...

    @overload
    def __getitem__(self, index: slice) -> list[Entry]: ...

    def __getitem__(self, index: int | slice) -> Entry | list[Entry]:
        if isinstance(index, slice):
            return [self[one] for one in range(*index.indices(len(self)))]
        if index < 0:
            index += len(self)
        return (self._times[index], "", self._frame(index), self._errors.get(index, ""))

    def __iter__(self) -> Iterator[Entry]:
        errors = self._errors
        for index, time_ns in enumerate(self._times):
            yield time_ns, "", self._frame(index), errors.get(index, "") if errors else ""

    def _frame(self, index: int) -> CanFrame:
        word, length = self._ids[index], self._lengths[index]
        at = _WIDTH * index
        data = bytes(self._data[at : at + (length & 0xF)])
        return CanFrame(
            word & _ID, data, extended=word & _EXTENDED != 0, remote=word & _REMOTE != 0, dlc=length >> 4
        )
