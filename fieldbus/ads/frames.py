"""AMS/TCP frames: bytes in, frames out, and frames to bytes."""

from __future__ import annotations

from struct import Struct
from typing import Final, NamedTuple

from fieldbus.errors import BusError

_TCP: Final = Struct("<HI")
_AMS: Final = Struct("<6sH6sHHHIII")
HEADER: Final = _AMS.size
REQUEST: Final = 0x0004
RESPONSE: Final = 0x0005
MOST_DATA: Final = 1 << 20
"""Bytes of data that a frame may carry here."""


class MalformedFrameError(BusError):
    """What came is no AMS/TCP frame: nothing behind it can be read either."""


class Frame(NamedTuple):
    """One AMS frame."""

    target_net: bytes
    """AMS NetID, six bytes."""
    target_port: int
    source_net: bytes
    source_port: int
    command: int
    flags: int
    error: int
    invoke: int
    data: bytes

    def pack(self) -> bytes:
        """Return the frame with both of its headers."""
        head = _AMS.pack(
            self.target_net,
            self.target_port,
            self.source_net,
            self.source_port,
            self.command,
            self.flags,
            len(self.data),
            self.error,
            self.invoke,
        )
        return _TCP.pack(0, HEADER + len(self.data)) + head + self.data

    def answer(self, data: bytes, error: int = 0) -> Frame:
        """Return the answer to a request."""
        return Frame(
            self.source_net,
            self.source_port,
            self.target_net,
            self.target_port,
            self.command,
            RESPONSE,
            error,
            self.invoke,
            data,
        )


class FrameReader:
    """Takes a stream of bytes apart."""

    def __init__(self) -> None:
        self._waiting = bytearray()

    def feed(self, data: bytes) -> list[Frame]:
        """Take bytes in any pieces; return the frames that are complete.

        Raises:
            MalformedFrameError: The stream does not hold AMS/TCP frames, or one that is too long.

        """
        self._waiting += data
        found: list[Frame] = []
        while len(self._waiting) >= _TCP.size:
            kind, length = _TCP.unpack_from(self._waiting)
            if kind != 0:
                raise MalformedFrameError(f"AMS/TCP: frame of kind {kind:04X}h; allowed: 0")
            if not HEADER <= length <= HEADER + MOST_DATA:
                raise MalformedFrameError(
                    f"AMS/TCP: frame of {length} bytes; allowed: {HEADER} to {HEADER + MOST_DATA}"
                )
            if len(self._waiting) < _TCP.size + length:
                break
            frame = bytes(self._waiting[_TCP.size : _TCP.size + length])
            del self._waiting[: _TCP.size + length]
            target, target_port, source, source_port, command, flags, size, error, invoke = _AMS.unpack_from(
                frame
            )
            if size != length - HEADER:
                raise MalformedFrameError(f"AMS/TCP: {length - HEADER} bytes of data are said to be {size}")
            found.append(
                Frame(
                    target,
                    target_port,
                    source,
                    source_port,
                    command,
                    flags,
                    error,
                    invoke,
                    frame[HEADER:],
                )
            )
        return found


def net_id(text: str) -> bytes:
    """Read an AMS NetID, six numbers with dots.

    Raises:
        ValueError: It is none.

    """
    numbers = text.split(".")
    if len(numbers) != 6 or not all(one.isdecimal() and int(one) < 256 for one in numbers):
        raise ValueError(f"{text!r} is no AMS NetID: six numbers from 0 to 255, with dots")
    return bytes(map(int, numbers))
