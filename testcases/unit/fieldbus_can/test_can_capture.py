"""Bus logs as capture files, pcap and pcapng: round trip to the nanosecond, other byte orders, links and
units, and files that are damaged.
"""

from __future__ import annotations

import re
import struct

import pytest

from fieldbus.can import CanFrame
from fieldbus.can.capture import CAPTURES, read_capture
from fieldbus.can.export import EPOCH_S, read_log, write_log
from fieldbus.capture import PcapWriter, read_packets
from fieldbus.clock import MS, S
from fieldbus.errors import BusError
from hil.errors import CannotRunError
from hil.logs import read_bus_log

LOG = [
    (1_501, "a", CanFrame(0x80), ""),
    (250_007, "b", CanFrame(0x181, bytes(range(8))), ""),
    (MS, "b", CanFrame(0x181, b"\x01"), "BIT_ERROR"),
    (MS + 123_457, "a", CanFrame(0x12345678, b"\xff\x00", extended=True), ""),
    (2 * MS, "a", CanFrame(0x123, bytes(8), dlc=14), ""),
    (3600 * S + 1, "a", CanFrame(0x701, remote=True, dlc=5), ""),
]
SOCKETCAN = 227


@pytest.mark.parametrize("suffix", CAPTURES)
def test_a_log_comes_back(tmp_path, suffix):
    """Identifiers, formats, data, raw DLCs, errors and times to the nanosecond survive, for both readers."""
    path = write_log(LOG, tmp_path / f"bus{suffix}", channel="vcan3")
    found = list(read_capture(path))
    assert [one.time_ns - int(EPOCH_S) * S for one in found] == [time_ns for time_ns, *_ in LOG]
    assert [bool(one.error) for one in found] == [bool(error) for *_, error in LOG]
    good = [(time_ns, frame) for time_ns, _, frame, error in LOG if not error]
    back = [one.frame for one in found if not one.error]
    assert back == [frame for _, frame in good]
    assert [frame.dlc for frame in back] == [frame.dlc for _, frame in good]
    assert [frame for _, frame in read_log(path, origin_s=EPOCH_S)] == back
    log = read_bus_log(path)
    (channel,) = log.channels
    assert channel == ("vcan3" if suffix == ".pcapng" else "")
    assert [time_ns for time_ns, *_ in log.channels[channel]] == [time_ns for time_ns, *_ in LOG]


def packet(can_id=0x181, data=b"\x37\x02", *, flags=0):
    return struct.pack(">IBBBB", can_id, len(data), flags, 0, 0) + data


def test_big_endian_and_microseconds(tmp_path):
    """A pcap file from a machine of the other byte order, with microseconds."""
    path = tmp_path / "old.pcap"
    content = struct.pack(">IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, SOCKETCAN)
    content += struct.pack(">IIII", 1_700_000_000, 123_456, 10, 10) + packet()
    path.write_bytes(content)
    (one,) = read_capture(path)
    assert (one.time_ns, one.frame) == (1_700_000_000_123_456_000, CanFrame(0x181, b"\x37\x02"))


def test_cooked_links_and_can_fd(tmp_path):
    """What the interface `any` gives is read, also beside other protocols, and of CAN FD."""
    fd = packet(data=bytes(12), flags=0x04)
    for link_type, head, other, channel in (
        (113, bytes(14) + b"\x00\x0c", bytes(14) + b"\x08\x00", ""),
        (276, b"\x00\x0c" + bytes(2) + b"\x00\x00\x00\x07" + bytes(12), b"\x08\x00" + bytes(18), "7"),
    ):
        path = tmp_path / f"{link_type}.pcap"
        with path.open("wb") as file:
            writer = PcapWriter(file, link_type, 1_700_000_000)
            for number, data in enumerate((head + packet(), other + b"E", head + fd)):
                writer.write(number * MS, data)
        log = read_bus_log(path)
        assert (log.frames, log.fd_frames, list(log.channels)) == (2, 1, [channel])


def test_units_and_interfaces_of_pcapng(tmp_path):
    """Several interfaces with units of their own: microseconds without an option, powers of two, an offset;
    blocks of other kinds and a second section are passed over.
    """

    def block(kind, body):
        body += bytes(-len(body) % 4)
        length = struct.pack("<I", len(body) + 12)
        return struct.pack("<I", kind) + length + body + length

    section = block(0x0A0D0D0A, struct.pack("<IHHq", 0x1A2B3C4D, 1, 0, -1))
    plain = block(1, struct.pack("<HHI", SOCKETCAN, 0, 0))
    binary = block(
        1,
        struct.pack("<HHI", SOCKETCAN, 0, 0)
        + struct.pack("<HHB3x", 9, 1, 0x80 | 10)
        + struct.pack("<HHq", 14, 8, 1_700_000_000)
        + struct.pack("<HH4s", 2, 4, b"can1"),
    )

    def enhanced(which, ticks):
        data = packet()
        head = struct.pack("<IIIII", which, ticks >> 32, ticks & 0xFFFFFFFF, len(data), len(data))
        return block(6, head + data + bytes(-len(data) % 4))

    path = tmp_path / "mixed.pcapng"
    path.write_bytes(
        section + plain + block(0x0BAD, b"what") + binary
        + enhanced(0, 1_700_000_000_000_001) + enhanced(1, 512)
        + section + plain + enhanced(0, 1_700_000_001_000_000)
    )  # fmt: skip
    assert [(one.time_ns - 1_700_000_000 * S, one.channel) for one in read_capture(path)] == [
        (1_000, "0"),
        (S // 2, "can1"),
        (S, "0"),
    ]


def test_damaged_files_are_refused_where_they_are(tmp_path):
    """Cut off at any byte, a file ends with a whole packet or is refused with the place; never a crash."""
    for suffix, where in ((".pcap", r"packet \d+|header"), (".pcapng", r"block at byte \d+")):
        whole = write_log(LOG[:3], tmp_path / f"bus{suffix}").read_bytes()
        path = tmp_path / f"cut{suffix}"
        said = set()
        for end in range(len(whole)):
            path.write_bytes(whole[:end])
            try:
                assert len(list(read_packets(path))) < 3
            except BusError as error:
                said.add(re.sub(where, "AT", str(error)))
        assert said == {
            f"{path}, AT: the file is cut off there",
            *(f"{path} is no capture file: it has {count} bytes" for count in range(4)),
        }
        with pytest.raises(CannotRunError, match="the file is cut off there"):
            read_bus_log(path)


def test_what_is_no_capture_of_can_is_refused(tmp_path):
    """Another file, packets of other links, lengths that cannot be: refused with the reason."""
    head = struct.pack("<IHHiII", 0xA1B23C4D, 2, 4, 0, 0, 9)
    for content, message in (
        (b"Hello, world", "begins with 48 65 6c 6c, not as pcap or pcapng does"),
        (
            head + struct.pack("<IIIII", 1, 1, 1, 1, 1) + b"x",
            r"no CAN frame, but packets of link type 1; allowed: 227 \(SocketCAN\)",
        ),
        (
            head + struct.pack("<IIIII", SOCKETCAN, 1, 1, 1 << 31, 1),
            "packet 1: a length of 2147483648 bytes; the file is damaged",
        ),
        (
            head + struct.pack("<IIIII", SOCKETCAN, 1, 1, 8, 8) + b"\0\0\1\1\x09\0\0\0",
            "packet 1: a CAN frame with 9 bytes of data; the file is damaged",
        ),
    ):
        path = tmp_path / "bad.pcap"
        path.write_bytes(content)
        with pytest.raises(CannotRunError, match=message):
            read_bus_log(path)
