"""Logs of Modbus links as capture files (pcap), which Wireshark and its relatives read.

TCP is written as IPv4 packets between 192.0.2.2 (client) and 192.0.2.1, port 502 (server), with handshake and
end of every connection; a serial line as frames of the link type USER0 (147), for which Wireshark has to be
set to `mbrtu`. What a fault has dropped is not in the file. Times are exact to the nanosecond.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from fieldbus.capture import PcapWriter
from fieldbus.modbus.serial_line import SerialFrame
from fieldbus.modbus.tcp_link import TcpSegment

EPOCH_S: Final = 946_684_800
"""2000-01-01T00:00:00Z, the default time of bench time zero."""
LINK_TYPE_IP: Final = 101
LINK_TYPE_SERIAL: Final = 147
PORT: Final = 502

_CLIENT, _SERVER = bytes((192, 0, 2, 2)), bytes((192, 0, 2, 1))
_FIRST_PORT: Final = 49152
_FIN, _SYN, _RST, _PSH, _ACK = 0x01, 0x02, 0x04, 0x08, 0x10
_WINDOW: Final = 65535
_TCP: Final = 6
_IP: Final = struct.Struct(">BBHHHBBH4s4s")
_SEGMENT: Final = struct.Struct(">HHIIBBHHH")


class _Connection:
    """The two directions of a connection: sequence numbers, and packets made of them."""

    def __init__(self, number: int) -> None:
        self._port = _FIRST_PORT + number % (65536 - _FIRST_PORT)
        self._sequence = {True: 0, False: 0}

    def packet(self, data: bytes, flags: int, *, from_server: bool) -> bytes:
        sequence, expected = self._sequence[from_server], self._sequence[not from_server]
        self._sequence[from_server] = sequence + len(data) + bool(flags & (_SYN | _FIN)) & 0xFFFFFFFF
        ports = (PORT, self._port) if from_server else (self._port, PORT)
        hosts = (_SERVER, _CLIENT) if from_server else (_CLIENT, _SERVER)
        if not flags & _ACK:
            expected = 0
        head = _SEGMENT.pack(*ports, sequence, expected, _SEGMENT.size << 2, flags, _WINDOW, 0, 0)
        size = len(head) + len(data)
        pseudo = b"".join(hosts) + struct.pack(">BBH", 0, _TCP, size)
        segment = head[:16] + _checksum(pseudo + head + data) + head[18:] + data
        outer = _IP.pack(0x45, 0, _IP.size + size, 0, 0x4000, 64, _TCP, 0, *hosts)
        return outer[:10] + _checksum(outer) + outer[12:] + segment


def _checksum(data: bytes) -> bytes:
    data += bytes(len(data) % 2)
    total = sum(struct.unpack(f">{len(data) // 2}H", data))
    while total > 0xFFFF:
        total = (total & 0xFFFF) + (total >> 16)
    return struct.pack(">H", total ^ 0xFFFF)


def write_tcp_capture(log: Iterable[TcpSegment], path: str | Path, *, epoch_s: int = EPOCH_S) -> Path:
    """Write the log of a TCP link as a capture file.

    Args:
        log: `TcpLink.log`, or a part of it.
        path: File; replaced if it exists.
        epoch_s: Unix time of bench time zero, s.

    Returns:
        `path`.

    Raises:
        OSError: The file cannot be written.

    """
    target = Path(path)
    connections: dict[int, _Connection] = {}
    with target.open("wb") as file:
        capture = PcapWriter(file, LINK_TYPE_IP, epoch_s)
        for time_ns, number, sender, data, note in log:
            if note == "dropped":
                continue
            from_server = sender == "server"
            known = number in connections
            connection = connections.setdefault(number, _Connection(number))
            if not known:  # also when the log begins in the middle
                capture.write(time_ns, connection.packet(b"", _SYN, from_server=False))
                if note == "refused":
                    capture.write(time_ns, connection.packet(b"", _RST | _ACK, from_server=True))
                    continue
                capture.write(time_ns, connection.packet(b"", _SYN | _ACK, from_server=True))
                capture.write(time_ns, connection.packet(b"", _ACK, from_server=False))
            if data:
                capture.write(time_ns, connection.packet(data, _PSH | _ACK, from_server=from_server))
            elif note in ("closed", "reset"):
                end = _RST | _ACK if note == "reset" else _FIN | _ACK
                capture.write(time_ns, connection.packet(b"", end, from_server=from_server))
    return target


def write_serial_capture(log: Iterable[SerialFrame], path: str | Path, *, epoch_s: int = EPOCH_S) -> Path:
    """Write the log of a serial line as a capture file; frames of a collision are left out.

    Args:
        log: `SerialLine.log`, or a part of it.
        path: File; replaced if it exists.
        epoch_s: Unix time of bench time zero, s.

    Returns:
        `path`.

    Raises:
        OSError: The file cannot be written.

    """
    target = Path(path)
    with target.open("wb") as file:
        capture = PcapWriter(file, LINK_TYPE_SERIAL, epoch_s)
        for frame in log:
            if "dropped" not in frame.note and "collision" not in frame.note:
                capture.write(frame.end_ns, frame.data)
    return target
