"""CAN frames in capture files, as SocketCAN gives them to Wireshark and tcpdump: packets of the link types
LINKTYPE_CAN_SOCKETCAN, and of the "cooked" ones of the interface `any`.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final, NamedTuple

from fieldbus.can.confinement import ErrorCode
from fieldbus.can.fd import check_fd
from fieldbus.can.frame import CanFrame
from fieldbus.can.frame_log import LogEntry
from fieldbus.can.message import ERROR_BUS, ERROR_FLAG, error_message
from fieldbus.capture import PcapngWriter, PcapWriter, read_packets
from fieldbus.errors import BusError

CAPTURES: Final = (".pcap", ".pcapng")
"""Suffixes of the files."""

_SOCKETCAN, _COOKED, _COOKED_2 = 227, 113, 276
_CAN, _CAN_FD = 0x000C, 0x000D
_EXTENDED, _REMOTE, _ERROR = 0x8000_0000, 0x4000_0000, ERROR_FLAG
_ID: Final = 0x1FFF_FFFF
_BRS, _ESI, _FDF = 0x01, 0x02, 0x04
_HEAD: Final = struct.Struct(">IBBBB")
_FD_SIZE: Final = 72


class Captured(NamedTuple):
    """A frame of a capture file."""

    time_ns: int
    """Unix time."""
    channel: str
    frame: CanFrame
    error: str
    """What an error frame says; empty: it is none."""


def read_capture(path: str | Path) -> Iterator[Captured]:
    """Read the CAN frames of a pcap or pcapng file one after the other; packets of other links are left out.

    Raises:
        BusError: It is no such file, is cut off or damaged, or holds packets of other links only.
        OSError: It cannot be read.

    """
    others: set[int] = set()
    found = False
    for time_ns, interface, link_type, data, number in read_packets(path):
        channel, can = _payload(link_type, interface, data)
        if can is None:
            others.add(link_type)
            continue
        found = True
        frame, error = _frame(can, f"{path}, packet {number}")
        yield Captured(time_ns, channel, frame, error)
    if others and not found:
        listed = ", ".join(map(str, sorted(others)))
        raise BusError(
            f"{path} holds no CAN frame, but packets of link type {listed}; allowed: {_SOCKETCAN} "
            f"(SocketCAN), {_COOKED} and {_COOKED_2} (Linux cooked)"
        )


def _payload(link_type: int, interface: str, data: bytes) -> tuple[str, bytes | None]:
    """Return channel and CAN frame of a packet; None: it holds another protocol."""
    if link_type == _SOCKETCAN:
        return interface, data
    if link_type == _COOKED and len(data) >= 16 and int.from_bytes(data[14:16], "big") in (_CAN, _CAN_FD):
        return interface, data[16:]
    if link_type == _COOKED_2 and len(data) >= 20 and int.from_bytes(data[:2], "big") in (_CAN, _CAN_FD):
        return str(int.from_bytes(data[4:8], "big")), data[20:]
    return interface, None


def _frame(data: bytes, where: str) -> tuple[CanFrame, str]:
    if len(data) < _HEAD.size:
        raise BusError(f"{where}: a CAN frame of {len(data)} bytes; the file is damaged")
    word, length, flags, _, raw_dlc = _HEAD.unpack_from(data)
    if word & _ERROR:
        return CanFrame(0), "bus error"
    if flags & _FDF or len(data) == _FD_SIZE:
        return _fd_frame(word, flags, data[_HEAD.size : _HEAD.size + length], where), ""
    remote = word & _REMOTE != 0
    if length > 8 or (not remote and len(data) < _HEAD.size + length):
        raise BusError(f"{where}: a CAN frame with {length} bytes of data; the file is damaged")
    return (
        CanFrame(
            word & (_ID if word & _EXTENDED else 0x7FF),
            b"" if remote else data[_HEAD.size : _HEAD.size + length],
            extended=word & _EXTENDED != 0,
            remote=remote,
            dlc=raw_dlc if length == 8 and 9 <= raw_dlc <= 15 else length,
        ),
        "",
    )


def _fd_frame(word: int, flags: int, data: bytes, where: str) -> CanFrame:
    extended = word & _EXTENDED != 0
    frame = CanFrame(
        word & (_ID if extended else 0x7FF),
        data,
        extended=extended,
        fd=True,
        brs=flags & _BRS != 0,
        esi=flags & _ESI != 0,
    )
    try:
        check_fd(frame)
    except BusError as error:
        raise BusError(f"{where}: {error}; the file is damaged") from error
    return frame


def write_capture(log: Iterable[LogEntry], path: Path, channel: str, epoch_s: int) -> None:
    """Write the log of a segment as pcap or, by the suffix, pcapng; see `fieldbus.can.export.write_log`."""
    with path.open("wb") as file:
        writer = (
            PcapngWriter(file, _SOCKETCAN, epoch_s, interface=channel)
            if path.suffix.lower() == ".pcapng"
            else PcapWriter(file, _SOCKETCAN, epoch_s)
        )
        for time_ns, _, frame, error in log:
            if error:
                code = next((one for one in ErrorCode if one.value == error), ErrorCode.FORM)
                message = error_message(code)
                flags = 0
                word, data, length, raw_dlc = (
                    _ERROR | ERROR_BUS | message.arbitration_id, bytes(message.data), 8, 0,
                )  # fmt: skip
            else:
                word = frame.can_id | (_EXTENDED if frame.extended else 0) | (_REMOTE if frame.remote else 0)
                data = b"" if frame.remote else bytes(frame.data)
                length = min(frame.dlc, 8) if frame.remote else len(data)
                raw_dlc = frame.dlc if frame.dlc > 8 and not frame.fd else 0
                flags = (_FDF | frame.brs * _BRS | frame.esi * _ESI) if frame.fd else 0
            writer.write(time_ns, _HEAD.pack(word, length, flags, 0, raw_dlc) + data)
