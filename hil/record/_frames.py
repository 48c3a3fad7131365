"""The frame log of a bus, and the one of a long log in little memory: packed, and made when they are read."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple, TypeAlias, overload

import numpy as np

from fieldbus.can.frame import FD_LENGTHS, CanFrame
from hil.record._spool import IN_MEMORY, Spool

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from fieldbus.modbus import ModbusFrame

BusFrame: TypeAlias = "CanFrame | ModbusFrame"
Entry: TypeAlias = tuple[int, str, CanFrame, str]
"""Time (ns), sender, frame, error (empty: none)."""
FrameLog: TypeAlias = "Sequence[tuple[int, str, BusFrame, str]]"
"""The log of a bus of any kind, in the order in which the frames ended."""

_EXTENDED: Final = 0x8000_0000
_REMOTE: Final = 0x4000_0000
_FD: Final = 0x2000_0000
_ID: Final = 0x1FFF_FFFF
_RECORD: Final = struct.Struct("<qIBI8s")
_FD_RECORD: Final = struct.Struct("<qIBIQ")
_SIZE: Final = _RECORD.size
_RECORDS: Final = np.dtype(
    [("time_ns", "<i8"), ("word", "<u4"), ("length", "u1"), ("origin", "<u4"), ("data", "u1", 8)]
)
"""The same record for NumPy."""
_CANONICAL_HEAD: Final = 15
"""Bytes of a frame in the digest before its data: time, identifier, flags, DLC, number of data bytes."""
_ROWS: Final = 4096
"""Frames that are read at a time."""


class FrameColumns(NamedTuple):
    """The frames of a classic CAN bus, a row per frame."""

    time_ns: NDArray[np.int64]
    records: NDArray[np.void]
    """Packed, with time before a shift."""
    kinds: tuple[tuple[str, str], ...]
    """Sender and error by the number in `records["origin"]`."""

    @property
    def can_id(self) -> NDArray[np.uint32]:
        """Identifiers."""
        word: NDArray[np.uint32] = self.records["word"]
        return word & np.uint32(_ID)

    @property
    def is_base_data(self) -> NDArray[np.bool_]:
        """Where the frame is a data frame with an identifier of 11 bits."""
        found: NDArray[np.bool_] = self.records["word"] & (_EXTENDED | _REMOTE) == 0
        return found

    @property
    def is_base_remote(self) -> NDArray[np.bool_]:
        """Where it is a remote frame with an identifier of 11 bits."""
        found: NDArray[np.bool_] = self.records["word"] & (_EXTENDED | _REMOTE) == _REMOTE
        return found

    @property
    def lengths(self) -> NDArray[np.uint8]:
        """Bytes of data of each."""
        length: NDArray[np.uint8] = self.records["length"]
        return length & np.uint8(0xF)

    @property
    def dlc(self) -> NDArray[np.uint8]:
        """Data length code of each."""
        length: NDArray[np.uint8] = self.records["length"]
        return length >> np.uint8(4)

    @property
    def data(self) -> NDArray[np.uint8]:
        """Data, eight bytes each; those behind the length are 0."""
        found: NDArray[np.uint8] = self.records["data"]
        return found

    @property
    def wrong(self) -> NDArray[np.bool_]:
        """Where something went wrong with the frame."""
        wrong = np.array([error != "" for _, error in self.kinds], dtype=bool)
        return wrong[self.records["origin"]] if len(wrong) else np.zeros(len(self.records), dtype=bool)


def canonical_frames(buses: Sequence[tuple[str, FrameColumns]]) -> bytes:
    """Return the bytes that enter the digest of a trace, of the frames of all buses by time."""
    every = [one for _, one in buses]
    tails = [f"{bus}\0{sender}\0{error}\0".encode() for bus, one in buses for sender, error in one.kinds]
    times = np.concatenate([one.time_ns for one in every])
    if not len(times):
        return b""
    before = np.cumsum([0, *(len(one.kinds) for one in every)])
    origin = np.concatenate(
        [one.records["origin"].astype(np.intp) + first for one, first in zip(every, before, strict=False)]
    )
    word = np.concatenate([one.records["word"] for one in every])
    length = np.concatenate([one.records["length"] for one in every])
    data = np.concatenate([one.data for one in every])
    if len(every) > 1:
        order = np.argsort(times, kind="stable")
        times, origin, word, length, data = (one[order] for one in (times, origin, word, length, data))
    tail_at = _CANONICAL_HEAD + 8
    sizes = np.array([len(one) for one in tails])
    tail_table = np.zeros((len(tails), int(sizes.max())), dtype=np.uint8)
    for row, tail in zip(tail_table, tails, strict=True):
        row[: len(tail)] = np.frombuffer(tail, dtype=np.uint8)
    # A row per frame with room for the longest; what a shorter one does not fill is left out behind.
    rows = np.empty((len(times), tail_at + tail_table.shape[1]), dtype=np.uint8)
    rows[:, :8] = times.astype("<i8").view(np.uint8).reshape(-1, 8)
    rows[:, 8:12] = (word & _ID).astype("<u4").view(np.uint8).reshape(-1, 4)
    rows[:, 12] = (word & _EXTENDED != 0) | (word & _REMOTE != 0).astype(np.uint8) << 1
    rows[:, 13] = length >> 4
    rows[:, 14] = length & 0xF
    rows[:, _CANONICAL_HEAD:tail_at] = data
    rows[:, tail_at:] = tail_table[origin]
    filled = np.ones(rows.shape, dtype=bool)
    filled[:, _CANONICAL_HEAD:tail_at] = np.arange(8) < rows[:, 14:15]
    filled[:, tail_at:] = (np.arange(tail_table.shape[1]) < sizes[:, None])[origin]
    return rows[filled].tobytes()


class PackedFrames(Sequence[Entry]):
    """A log of CAN frames, 25 bytes per frame, those of a long one in a temporary file; it grows at its end
    only. The data of CAN FD frames are in a second store.

    Args:
        in_memory: Bytes from which on a temporary file is taken.

    """

    def __init__(self, in_memory: int = IN_MEMORY) -> None:
        self._spool = Spool(in_memory)
        self._long = Spool(in_memory)
        self._long_bytes = 0
        self._long_view: NDArray[np.uint8] | None = None
        self._view: NDArray[np.uint8] | None = None
        self._origins: dict[tuple[str, str], int] = {}
        self._kinds: list[tuple[str, str]] = []
        """Sender and error of the frames, each pair once."""
        self._count = 0
        self._shift_ns = 0
        self._first_ns = self._last_ns = 0

    def extend(self, entries: Iterable[tuple[int, str, BusFrame, str]]) -> None:
        """Add the CAN frames of a log at the end."""
        # As `append` frame by frame, at a third of the time.
        pack, shift_ns, origins = _RECORD.pack, self._shift_ns, self._origins
        records: list[bytes] = []
        for time_ns, sender, frame, error in entries:
            assert isinstance(frame, CanFrame)  # a CAN bus has no others
            origin = origins.get((sender, error))
            if frame.fd or origin is None or not self._count:
                self._spool.write(b"".join(records))
                records.clear()
                self.append(time_ns, frame, error, sender=sender)
                continue
            word, data = frame.can_id, frame.data
            if frame.extended:
                word |= _EXTENDED
            if frame.remote:
                word |= _REMOTE
            records.append(pack(time_ns - shift_ns, word, len(data) | frame.dlc << 4, origin, data))
            self._count += 1
            self._last_ns = time_ns
        self._spool.write(b"".join(records))
        self._view = None

    def columns(self) -> FrameColumns | None:
        """Return all frames as columns; None: some are of CAN FD, whose data have places of their own."""
        records = self._bytes()[: self._count * _SIZE].view(_RECORDS)
        if (records["word"] & _FD).any():
            return None
        return FrameColumns(records["time_ns"] + self._shift_ns, records, tuple(self._kinds))

    def append(self, time_ns: int, frame: CanFrame, error: str = "", *, sender: str = "") -> None:
        """Add a frame at the end."""
        origin = self._origins.get((sender, error))
        if origin is None:
            origin = self._origins[sender, error] = len(self._kinds)
            self._kinds.append((sender, error))
        if not self._count:
            self._first_ns = time_ns
        self._last_ns = time_ns
        self._count += 1
        self._view = None
        word = frame.can_id | (_EXTENDED if frame.extended else 0) | (_REMOTE if frame.remote else 0)
        if frame.fd:
            self._append_fd(time_ns, word, frame, origin)
            return
        self._spool.write(
            _RECORD.pack(time_ns - self._shift_ns, word, len(frame.data) | frame.dlc << 4, origin, frame.data)
        )

    def _append_fd(self, time_ns: int, word: int, frame: CanFrame, origin: int) -> None:
        """Add a frame of CAN FD: the record has the place of its data, BRS and ESI."""
        place = self._long_bytes << 2 | frame.brs << 1 | frame.esi
        self._long.write(frame.data)
        self._long_bytes += len(frame.data)
        self._long_view = None
        self._spool.write(
            _FD_RECORD.pack(time_ns - self._shift_ns, word | _FD, frame.dlc << 4, origin, place)
        )

    def _fd_frame(self, word: int, dlc: int, place: int) -> CanFrame:
        if self._long_view is None:
            self._long_view = self._long.view(np.uint8)
        begin = place >> 2
        data = self._long_view[begin : begin + FD_LENGTHS[dlc]].tobytes()
        return CanFrame(
            word & _ID,
            data,
            extended=word & _EXTENDED != 0,
            dlc=dlc,
            fd=True,
            brs=bool(place & 2),
            esi=bool(place & 1),
        )

    def shift(self, by_ns: int) -> None:
        """Move the times of all frames."""
        self._shift_ns += by_ns
        self._first_ns += by_ns
        self._last_ns += by_ns

    @property
    def first_ns(self) -> int:
        """Time of the first frame."""
        return self._first_ns

    @property
    def last_ns(self) -> int:
        """Time of the last frame."""
        return self._last_ns

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> Entry: ...

    @overload
    def __getitem__(self, index: slice) -> list[Entry]: ...

    def __getitem__(self, index: int | slice) -> Entry | list[Entry]:
        if isinstance(index, slice):
            begin, end, step = index.indices(len(self))
            return self.part(begin, max(begin, end))[::step] if step > 0 else [*self][index]
        if index < 0:
            index += len(self)
        if not 0 <= index < len(self):
            raise IndexError(index)
        return self._entry(self._bytes()[index * _SIZE : (index + 1) * _SIZE].tobytes(), 0)

    def part(self, first: int, last: int) -> list[Entry]:
        """Return the entries with numbers from `first` to `last` - 1."""
        data = self._bytes()[first * _SIZE : last * _SIZE].tobytes()
        return [self._entry(data, at) for at in range(0, len(data), _SIZE)]

    def __iter__(self) -> Iterator[Entry]:
        for first in range(0, len(self), _ROWS):
            yield from self.part(first, first + _ROWS)

    def _bytes(self) -> NDArray[np.uint8]:
        if self._view is None:
            self._view = self._spool.view(np.uint8)
        return self._view

    def _entry(self, data: bytes, at: int) -> Entry:
        time_ns, word, length, origin, content = _RECORD.unpack_from(data, at)
        sender, error = self._kinds[origin]
        if word & _FD:
            frame = self._fd_frame(word, length >> 4, int.from_bytes(content, "little"))
        else:
            frame = CanFrame(
                word & _ID,
                content[: length & 0xF],
                extended=word & _EXTENDED != 0,
                remote=word & _REMOTE != 0,
                dlc=length >> 4,
            )
        return time_ns + self._shift_ns, sender, frame, error
