"""Capture files, pcap and pcapng: packets of any link, with times exact to the nanosecond.

What is in a packet is the affair of who reads or writes it. Formats: draft-ietf-opsawg-pcap and
draft-ietf-opsawg-pcapng. Packets are read one after the other, so that a long file takes no memory. It is own
code because libraries for such files give times as floating-point seconds, which hold no nanoseconds of Unix
time.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final, NamedTuple

from fieldbus.clock import S
from fieldbus.errors import BusError

_PCAP_US: Final = 0xA1B2C3D4
_PCAP_NS: Final = 0xA1B23C4D
_SECTION: Final = 0x0A0D0D0A
_BYTE_ORDER: Final = 0x1A2B3C4D
_INTERFACE, _SIMPLE, _PACKET = 1, 3, 6
_IF_NAME, _IF_TSRESOL, _IF_TSOFFSET = 2, 9, 14
_DEFAULT_RESOLUTION: Final = 6
_SNAPSHOT: Final = 262_144
_LARGEST: Final = 16 * 1024 * 1024
"""A packet or block beyond this is no packet: the file is damaged."""
_RECORD: Final = struct.Struct("<IIII")


class Packet(NamedTuple):
    """One packet."""

    time_ns: int
    """Unix time."""
    interface: str
    """Name of its interface, its number where it has none; empty in pcap, which knows none."""
    link_type: int
    """What it begins with: LINKTYPE_ of tcpdump.org."""
    data: bytes
    number: int
    """From 1, by the order in the file."""


class PcapWriter:
    """Writes a pcap file with nanoseconds.

    Args:
        file: Where it goes.
        link_type: LINKTYPE_ of all packets.
        epoch_s: Unix time of time zero, s.

    """

    def __init__(self, file: BinaryIO, link_type: int, epoch_s: int) -> None:
        self._file = file
        self._epoch_s = epoch_s
        file.write(struct.pack("<IHHiIII", _PCAP_NS, 2, 4, 0, 0, _SNAPSHOT, link_type))

    def write(self, time_ns: int, data: bytes) -> None:
        """Add a packet."""
        seconds, rest = divmod(time_ns, S)
        self._file.write(_RECORD.pack(self._epoch_s + seconds, rest, len(data), len(data)) + data)


class PcapngWriter:
    """Writes a pcapng file with one interface and nanoseconds; arguments as of `PcapWriter`, and its name."""

    def __init__(self, file: BinaryIO, link_type: int, epoch_s: int, *, interface: str) -> None:
        self._file = file
        self._epoch_ns = epoch_s * S
        self._block(_SECTION, struct.pack("<IHHq", _BYTE_ORDER, 1, 0, -1))
        name = interface.encode()
        options = struct.pack("<HH", _IF_NAME, len(name)) + _padded(name)
        options += struct.pack("<HHB3xHH", _IF_TSRESOL, 1, 9, 0, 0)
        self._block(_INTERFACE, struct.pack("<HHI", link_type, 0, _SNAPSHOT) + options)

    def write(self, time_ns: int, data: bytes) -> None:
        """Add a packet."""
        high, low = divmod(self._epoch_ns + time_ns, 1 << 32)
        head = struct.pack("<IIIII", 0, high, low, len(data), len(data))
        self._block(_PACKET, head + _padded(data))

    def _block(self, kind: int, body: bytes) -> None:
        length = struct.pack("<I", len(body) + 12)
        self._file.write(struct.pack("<I", kind) + length + body + length)


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def read_packets(path: str | Path) -> Iterator[Packet]:
    """Read the packets of a pcap or pcapng file, whatever its suffix says.

    Raises:
        BusError: It is neither, or is cut off or damaged; the message says where.
        OSError: It cannot be read.

    """
    with Path(path).open("rb") as file:
        magic = file.read(4)
        if len(magic) < 4:
            raise BusError(f"{path} is no capture file: it has {len(magic)} bytes")
        if int.from_bytes(magic, "little") == _SECTION:
            yield from _Pcapng(file, str(path)).packets()
            return
        for order in "<>":
            (number,) = struct.unpack(f"{order}I", magic)
            if number in (_PCAP_US, _PCAP_NS):
                yield from _pcap(file, str(path), order, 1 if number == _PCAP_NS else 1000)
                return
    raise BusError(f"{path} is no capture file: it begins with {magic.hex(' ')}, not as pcap or pcapng does")


def _read(file: BinaryIO, count: int, where: str) -> bytes:
    data = file.read(count)
    if len(data) < count:
        raise BusError(f"{where}: the file is cut off there")
    return data


def _pcap(file: BinaryIO, path: str, order: str, unit_ns: int) -> Iterator[Packet]:
    head = _read(file, 20, f"{path}, header")
    link_type = struct.unpack(f"{order}HHiIII", head)[5] & 0xFFFF
    record = struct.Struct(f"{order}IIII")
    number = 0
    while True:
        head = file.read(record.size)
        if not head:
            return
        number += 1
        where = f"{path}, packet {number}"
        if len(head) < record.size:
            raise BusError(f"{where}: the file is cut off there")
        seconds, fraction, length, _ = record.unpack(head)
        if length > _LARGEST:
            raise BusError(f"{where}: a length of {length} bytes; the file is damaged")
        yield Packet(seconds * S + fraction * unit_ns, "", link_type, _read(file, length, where), number)


class _Interface(NamedTuple):
    name: str
    link_type: int
    unit: tuple[int, int]
    """A tick in ns, as a fraction."""
    offset_ns: int


class _Pcapng:
    """Reads the blocks of a pcapng file behind its first four bytes."""

    def __init__(self, file: BinaryIO, path: str) -> None:
        self._file = file
        self._path = path
        self._order = "<"
        self._interfaces: list[_Interface] = []

    def packets(self) -> Iterator[Packet]:
        file, number, at = self._file, 0, 0
        kind = _SECTION
        while True:
            where = f"{self._path}, block at byte {at}"
            body, length = self._body(kind, where)
            if kind == _SECTION:
                self._interfaces = []
            elif kind == _INTERFACE:
                self._interfaces.append(self._interface(body, where))
            elif kind == _PACKET:
                number += 1
                yield self._packet(body, number, where)
            elif kind == _SIMPLE:
                raise BusError(f"{where}: a packet without a time stamp")
            at += length
            head = file.read(4)
            if not head:
                return
            if len(head) < 4:
                raise BusError(f"{self._path}, block at byte {at}: the file is cut off there")
            (kind,) = struct.unpack(f"{self._order}I", head)

    def _body(self, kind: int, where: str) -> tuple[bytes, int]:
        """Return what is between the lengths of a block, and the length of the whole."""
        file = self._file
        raw = _read(file, 4, where)
        if kind == _SECTION:
            magic = _read(file, 4, where)
            order = next((one for one in "<>" if struct.unpack(f"{one}I", magic)[0] == _BYTE_ORDER), "")
            if not order:
                raise BusError(f"{where}: {magic.hex(' ')} is no byte order of pcapng; the file is damaged")
            self._order = order
        (length,) = struct.unpack(f"{self._order}I", raw)
        read = 12 if kind == _SECTION else 8
        if length % 4 or not read + 4 <= length <= _LARGEST:
            raise BusError(f"{where}: a length of {length} bytes; the file is damaged")
        body = _read(file, length - read - 4, where)
        if _read(file, 4, where) != raw:
            raise BusError(f"{where}: its two lengths differ; the file is damaged")
        return body, length

    def _interface(self, body: bytes, where: str) -> _Interface:
        if len(body) < 8:
            raise BusError(f"{where}: an interface of {len(body)} bytes; the file is damaged")
        (link_type,) = struct.unpack_from(f"{self._order}H", body)
        name, resolution, offset_s = str(len(self._interfaces)), _DEFAULT_RESOLUTION, 0
        at = 8
        while at + 4 <= len(body):
            code, size = struct.unpack_from(f"{self._order}HH", body, at)
            value = body[at + 4 : at + 4 + size]
            at += 4 + size + -size % 4
            if code == 0:
                break
            if code == _IF_NAME and value:
                name = value.rstrip(b"\0").decode("utf-8", errors="replace")
            elif code == _IF_TSRESOL and value:
                resolution = value[0]
            elif code == _IF_TSOFFSET and size == 8:
                (offset_s,) = struct.unpack(f"{self._order}q", value)
        ticks = 1 << (resolution & 0x7F) if resolution & 0x80 else 10**resolution
        return _Interface(name, link_type, (S, ticks), offset_s * S)

    def _packet(self, body: bytes, number: int, where: str) -> Packet:
        if len(body) < 20:
            raise BusError(f"{where}: a packet of {len(body)} bytes; the file is damaged")
        which, high, low, length, _ = struct.unpack_from(f"{self._order}IIIII", body)
        if which >= len(self._interfaces) or 20 + length > len(body):
            raise BusError(f"{where}: a packet of interface {which} with {length} bytes; the file is damaged")
        one = self._interfaces[which]
        ns, ticks = one.unit
        time_ns = (high << 32 | low) * ns // ticks + one.offset_ns
        return Packet(time_ns, one.name, one.link_type, body[20 : 20 + length], number)
