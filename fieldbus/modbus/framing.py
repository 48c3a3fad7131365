"""Envelopes: from frames of a serial line and from the stream of a TCP connection to PDUs, and back."""

from __future__ import annotations

from struct import Struct
from typing import Final, NamedTuple

from fieldbus.modbus._pymodbus import crc16, rtu_frame
from fieldbus.modbus.codes import BROADCAST
from fieldbus.modbus.server import ModbusServer

__all__ = [
    "LONGEST_RTU",
    "LONGEST_TCP",
    "RtuResponder",
    "TcpFrame",
    "TcpResponder",
    "TcpSplitter",
    "crc16",
    "rtu_frame",
    "tcp_frame",
    "unwrap_rtu",
]

LONGEST_RTU: Final = 256
"""Bytes of the longest frame on a serial line (MODB-005)."""
LONGEST_TCP: Final = 260
"""Bytes of the longest frame on TCP (MODB-036)."""
_HEADER: Final = 6
_MBAP: Final = Struct(">HHHB")
_LONGEST_LENGTH: Final = 254


def tcp_frame(transaction: int, unit: int, pdu: bytes) -> bytes:
    """Return a frame of TCP with its MBAP header (MODB-036)."""
    return _MBAP.pack(transaction, 0, len(pdu) + 1, unit) + pdu


def unwrap_rtu(frame: bytes) -> tuple[int, bytes] | None:
    """Return unit and PDU of a frame of the serial line; None when it is too
    short, too long or its CRC is wrong.
    """
    if not 4 <= len(frame) <= LONGEST_RTU or crc16(frame[:-2]) != frame[-2:]:
        return None
    return frame[0], frame[1:-2]


class TcpFrame(NamedTuple):
    """A frame of TCP without its header."""

    transaction: int
    unit: int
    pdu: bytes


class TcpSplitter:
    """Cuts the stream of a connection into frames, however it came in segments (MODB-038)."""

    def __init__(self) -> None:
        self._pending = b""
        self.broken = False
        """Whether a header was wrong (MODB-037). Where the next frame begins is unknown from then on:
        everything behind it is ignored, and the connection should be closed.
        """

    @property
    def pending(self) -> int:
        """Bytes of a frame that is not complete."""
        return len(self._pending)

    def feed(self, data: bytes) -> list[TcpFrame]:
        """Take what came and return the frames that are complete."""
        if self.broken:
            return []
        data = self._pending + data if self._pending else data
        frames: list[TcpFrame] = []
        at = 0
        while len(data) - at >= _HEADER:
            length = data[at + 4] << 8 | data[at + 5]
            if data[at + 2] or data[at + 3] or not 2 <= length <= _LONGEST_LENGTH:
                self.broken = True
                self._pending = b""
                return frames
            end = at + _HEADER + length
            if end > len(data):
                break
            frames.append(TcpFrame(data[at] << 8 | data[at + 1], data[at + 6], data[at + 7 : end]))
            at = end
        self._pending = data[at:]
        return frames


class TcpResponder:
    """A server at one TCP connection: bytes in, bytes out.

    Units: None of the server (any) and 0 and 255 (the server itself) are answered with the unit mirrored
    (MODB-040); another unit than the server's own gets no answer.

    Args:
        server: What answers.

    """

    def __init__(self, server: ModbusServer) -> None:
        self._server = server
        self._splitter = TcpSplitter()
        self.requests = 0
        """Complete requests so far."""
        self.ignored = 0
        """Requests for other units."""

    @property
    def broken(self) -> bool:
        """Whether the connection has to be closed because of a wrong header."""
        return self._splitter.broken

    @property
    def pending(self) -> int:
        """Bytes of a request that is not complete."""
        return self._splitter.pending

    def receive(self, data: bytes) -> bytes:
        """Take bytes of any number of frames or parts of them; return the responses."""
        return b"".join(self.responses(data))

    def responses(self, data: bytes) -> list[bytes]:
        """Take bytes; return the responses one by one."""
        out = []
        server = self._server
        was_broken = self._splitter.broken
        for transaction, unit, pdu in self._splitter.feed(data):
            self.requests += 1
            server.bus_messages += 1
            if unit not in (0, 255) and not server.addresses(unit):
                self.ignored += 1
                continue
            answer = server.respond(pdu, unit=unit)
            if answer is not None:
                out.append(tcp_frame(transaction, unit, answer))
        if self._splitter.broken and not was_broken:
            server.bus_errors += 1
        return out


class RtuResponder:
    """A server at a serial line: a frame in, a frame out. The pauses on the line show what is a frame.

    Args:
        server: What answers; with unit None every unit but 0.

    """

    def __init__(self, server: ModbusServer) -> None:
        self._server = server

    def receive(self, frame: bytes, *, damaged: bool = False) -> bytes | None:
        """Take a frame and return the response; None for broadcasts, frames for
        others and broken ones (MODB-008).

        Args:
            frame: All bytes between two pauses.
            damaged: Whether a character had a wrong parity or stop bit, or a
                pause was too long for one frame.

        """
        server = self._server
        content = None if damaged else unwrap_rtu(frame)
        if content is None:
            server.bus_errors += 1
            return None
        server.bus_messages += 1
        unit, pdu = content
        if unit == BROADCAST:
            server.respond(pdu, serial=True, broadcast=True, unit=unit)
            return None
        if not server.addresses(unit):
            return None
        answer = server.respond(pdu, serial=True, unit=unit)
        return None if answer is None else rtu_frame(unit, answer)
