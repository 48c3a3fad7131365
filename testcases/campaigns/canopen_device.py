"""A CANopen device that is its dictionary, under a plain master and under the `canopen` library: long SDO
transfers, losses on the way, mappings of bits and long numbers, multiplex PDOs, SYNC producer, TIME, EMCY,
LSS bit rates, storage.
"""

from __future__ import annotations

import random
from binascii import crc_hqx
from collections.abc import Callable, Generator
from functools import cache
from itertools import pairwise
from pathlib import Path
from struct import pack, unpack
from tempfile import TemporaryDirectory
from typing import Any, Final

import canopen

from fieldbus.can import CanFrame
from fieldbus.canopen import CanopenSlave, NmtCommand, PumpedNetwork, load_dictionary, virtual_time
from fieldbus.canopen.eds_export import device_eds
from fieldbus.errors import BusError, ConfigurationError
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._led_servo import Node
from testcases.campaigns._small_drive import eds_text
from testcases.campaigns.can_bus import Segment
from testcases.campaigns.canopen_services import LOAD, SAVE, clauses
from testcases.campaigns.canopen_services import head as sdo
from testcases.campaigns.canopen_services import number as four
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "canopen device", controller="", tags=("canopen",), bench="testcases.campaigns.can_bus:BENCH"
)
NODE: Final = 33
SERVER, CLIENT, EMCY, BEAT = 0x580 + NODE, 0x600 + NODE, 0x80 + NODE, 0x700 + NODE
DOMAIN: Final = 0x2002
MS: Final = 1_000_000
VALUE, VALUE_HIGH, VALUE_LOW, CROSSED, STATE, NO_RESOURCE = (
    0x06090030,
    0x06090031,
    0x06090032,
    0x06090036,
    0x08000022,
    0x060A0023,
)
INVALID: Final = 1 << 31


@cache
def dictionary(more: str = "") -> canopen.ObjectDictionary:
    """Return the dictionary, with more objects, read from a file as that of any device."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "small_drive.eds"
        path.write_text(eds_text() + more, encoding="utf-8")
        return load_dictionary(path)


class Device(Node):
    """The device on the segment of the bench, and its plain master.

    Args:
        ctx: The case.
        lists: More objects, as sections of an EDS.

    """

    def __init__(self, ctx: CaseContext, *, lists: str = "") -> None:
        super().__init__(ctx, NODE)
        self.ctx = ctx
        segment: Any = ctx.bench.segment("can0")
        self.segment = segment
        self.slave = CanopenSlave(segment.scheduler, segment, dictionary(lists), NODE, name="small")
        self.listen(SERVER, EMCY, BEAT)
        self._noted = 0
        self.slave.power_on()
        ctx.run_for(0.05)
        self.equal("boot-up", self.taken(BEAT) == [b"\0"], 1, "C301-022")

    def is_so(self, what: str, found: object, wanted: object, *ids: str) -> None:
        """Expect a value of any kind."""
        self.equal(f"{what} is {wanted} (it is {found})", found == wanted, 1, *ids)

    def aborts(self, index: int, sub: int, data: bytes, code: int) -> None:
        """Expect an abort code of a download; 0: it is taken."""
        found = self.download(index, sub, data)
        self.equal(f"abort code of {index:04X}h:{sub} = {data[:8].hex()}", found, code, *clauses(code))

    def requests(self) -> list[bytes]:
        """Return what the master has sent to the server since the last call."""
        frames = self.ctx.trace().frames
        new, self._noted = frames[self._noted :], len(frames)
        return [bytes(frame.data) for frame in new if frame.can_id == CLIENT]

    def emcys(self) -> list[str]:
        """Return the EMCYs since the last call: code, register and first byte."""
        found = self.taken(EMCY)
        return [f"{data[1]:02X}{data[0]:02X} {data[2]:02X} {data[3]:02X}" for data in found]

    def number(self, index: int, sub: int, value: int, size: int) -> int:
        """Write a number of so many bytes; return the abort code."""
        return self.download(index, sub, (value & (1 << 8 * size) - 1).to_bytes(size, "little"))


def content_of(size: int) -> bytes:
    """Return bytes that differ from their neighbours."""
    return bytes((7 * number + 3) & 0xFF for number in range(size))


# -- SDO ----------------------------------------------------------------------------------------------------

SIZES: Final = (1, 4, 5, 6, 7, 8, 13, 14, 15, 28, 29, 888, 889, 890, 1779)


@CAMPAIGN.product(
    "sdo/sizes-{how}",
    parameters=[{"how": "segments", "block": False}, {"how": "blocks", "block": True}],
    title="there and back in {how}",
    requirements=("C301-058", "C301-060", "C301-064", "C301-066", "C301-069"),
)
def sizes(ctx: CaseContext, how: str, block: bool) -> None:
    """Contents around the borders of segment and block come back as they were, by the right protocol."""
    del how
    device = Device(ctx)
    for size in SIZES:
        content = content_of(size)
        ctx.run_for(0.002)
        device.requests()
        code = device.download(DOMAIN, 0, content, block=block)
        device.equal(f"abort code of {size} bytes", code, 0, "C301-058")
        first = device.requests()[0][0] & 0xE0
        wanted = 0xC0 if block and size > 4 else 0x20
        device.equal("command of the request", first, wanted, "C301-063")
        device.is_so("content in the device", device.slave.get(DOMAIN), content, "C301-064")
        for upload in (False, True):
            found = device.upload(DOMAIN, 0, block=upload)
            device.is_so(f"content read {'in blocks' if upload else ''}", found, content, "C301-066")


OBJECTS: Final = ((DOMAIN, 0), (DOMAIN, 0), (0x1008, 0), (0x1018, 1), (0x1017, 0), (0x5FFF, 0))


def _upload(index: int, sub: int) -> Generator[bytes, bytes, None]:
    """Read in segments."""
    answer = yield sdo(0x40, index, sub)
    toggle = 0
    while answer[:1] == b"\x41" or (toggle and answer and not answer[0] & 0xE1):
        answer = yield bytes((0x60 | toggle << 4,))
        toggle ^= 1
        if not toggle and answer and not answer[0] & 0xE1:
            answer = b"\x41"


def _download(index: int, sub: int, content: bytes, size: int) -> Generator[bytes, bytes, None]:
    """Write in segments, with a size that may be wrong."""
    yield sdo(0x21, index, sub) + four(size)
    for place in range(0, max(len(content), 1), 7):
        part = content[place : place + 7]
        last = place + 7 >= len(content)
        yield bytes((place // 7 % 2 << 4 | (7 - len(part)) << 1 | last,)) + part


def _upload_blocks(index: int, sub: int, block: int, draw: random.Random) -> Generator[bytes, bytes, None]:
    """Read in blocks of which not every segment is acknowledged."""
    answer = yield sdo(0xA4, index, sub) + bytes((block, draw.choice((0, 0, 40))))
    request = b"\xa3"
    for _ in range(12):
        if not answer or answer[0] == 0x80 or answer[0] >> 5 == 2:
            return
        answer = yield request
        if answer and answer[0] & 0xE3 == 0xC1:
            yield b"\xa1"
            return
        last = answer[0] & 0x7F if answer else 0
        block = draw.choice((1, 2, 127))
        request = bytes((0xA2, draw.choice((last, last, max(last - 1, 0))), block))


def _download_blocks(
    index: int, sub: int, content: bytes, draw: random.Random
) -> Generator[bytes, bytes, None]:
    """Write in blocks, with a checksum that may be wrong."""
    answer = yield sdo(0xC6, index, sub) + four(len(content))
    if not answer or answer[0] == 0x80:
        return
    parts = [content[place : place + 7].ljust(7, b"\0") for place in range(0, len(content), 7)]
    for place, part in enumerate(parts):
        yield bytes((place + 1 | (place + 1 == len(parts)) << 7,)) + part
    wrong = draw.choice((0, 0, 0, 1))
    unused = -len(content) % 7
    yield bytes((0xC1 | unused << 2,)) + (crc_hqx(content, 0) ^ wrong).to_bytes(2, "little")


@CAMPAIGN.product(
    "sdo/drawn-{seed}",
    parameters={"seed": (1, 2, 3)},
    title="drawn SDO requests, seed {seed}",
    requirements=("C301-057", "C301-059", "C301-061", "C301-064", "C301-067", "C301-069", "C301-072"),
)
def drawn(ctx: CaseContext, seed: int) -> None:
    """Transfers of every kind, broken off, mixed and with wrong bits: each answer fits its request, as the
    rule of the SDO dialogue says, what was written is read, and a plain upload is answered at any time.
    """
    device = Device(ctx)
    draw = random.Random(seed)
    device.download(DOMAIN, 0, content_of(40))
    for _ in range(40):
        content = draw.randbytes(draw.choice((1, 4, 6, 7, 8, 14, 15, 21)))
        index, sub = draw.choice(
            ((DOMAIN, 0), (DOMAIN, 0), (0x1008, 0), (0x1018, 1), (0x1017, 0), (0x5FFF, 0))
        )
        flow = draw.choice(
            (
                _upload(index, sub),
                _download(index, sub, content, len(content) + draw.choice((0, 0, 0, 1, -1))),
                _upload_blocks(index, sub, draw.choice((0, 1, 2, 3, 127, 128)), draw),
                _download_blocks(index, sub, content, draw),
            )
        )
        answer: bytes | None = None
        try:
            while True:
                request = bytearray((flow.send(answer) if answer is not None else next(flow)).ljust(8, b"\0"))
                if draw.random() < 0.06:
                    request[0] ^= 1 << draw.randrange(8)
                device.taken(SERVER)
                device.send(CLIENT, bytes(request))
                ctx.run_for(0.006)
                found = device.taken(SERVER)
                answer = found[-1] if found else b""
                if draw.random() < 0.03:
                    break
        except StopIteration:
            pass
    device.send(CLIENT, sdo(0x80, 0, 0) + four(0))
    ctx.run_for(0.01)
    for size in (3, 4, 30):
        device.is_so("written", device.download(DOMAIN, 0, content_of(size)), 0, "C301-058")
        device.is_so("read", device.upload(DOMAIN), content_of(size), "C301-060")


@CAMPAIGN.product(
    "sdo/lost-{what}",
    parameters=[
        {"what": "segment-of-block-download", "block": True, "read": False, "who": CLIENT, "frame": 6},
        {"what": "answer-of-block-download", "block": True, "read": False, "who": SERVER, "frame": 2},
        {"what": "segment-of-block-upload", "block": True, "read": True, "who": SERVER, "frame": 5},
        {"what": "last-of-block-upload", "block": True, "read": True, "who": SERVER, "frame": 30},
        {"what": "segment-of-upload", "block": False, "read": True, "who": SERVER, "frame": 3},
        {"what": "segment-of-download", "block": False, "read": False, "who": CLIENT, "frame": 4},
    ],
    title="a frame is lost: {what}",
    requirements=("C301-070", "C301-072", "C301-078"),
)
def lost(ctx: CaseContext, what: str, block: bool, read: bool, who: int, frame: int) -> None:
    """A lost frame is made good: asked for again within a block, or by repeating the transfer."""
    del what
    device = Device(ctx)
    content = content_of(7 * 29)
    device.download(DOMAIN, 0, content, block=False)
    ctx.inject("frame.drop", "can0", can_id=who, mask=0x7FF, first=frame, count=1)
    if read:
        device.is_so("content", device.upload(DOMAIN, 0, block=block), content, "C301-070")
        return
    device.equal("abort code", device.download(DOMAIN, 0, content[::-1], block=block), 0, "C301-070")
    device.is_so("content", device.slave.get(DOMAIN), content[::-1], "C301-070")


@CAMPAIGN.case("sdo/silent", requirements=("C301-072", "C301-078"))
def silent(ctx: CaseContext) -> None:
    """A silent server is asked again after the time-out, each attempt with an abort, and then given up."""
    device = Device(ctx)
    device.slave.sdo.silent = True
    device.requests()
    begun = ctx.now_s
    device.is_so("abort code", device.upload(0x1000), 0x05040000, "C301-072")
    took = ctx.now_s - begun
    ctx.run_for(0.002)
    frames = device.requests()
    request, abort = bytes.fromhex("4000100000000000"), bytes.fromhex("8000100000000405")
    attempts = len(frames) // 2
    device.is_so("frames of the client", frames, [request, abort] * attempts, "C301-072")
    device.equal("attempts", attempts, 2, within=1)
    device.equal("time of an attempt, s", took / attempts, 0.5, within=0.45)
    device.slave.sdo.silent = False
    device.slave.sdo.response_delay_ns = 30 * MS
    begun = ctx.now_s
    device.shows(0x1000, 0x00020192)
    device.equal("delay of the answer, s", ctx.now_s - begun, 0.03, within=0.002)
    for refused, index, found in ((0x2000, 0x2000, 1), (0x2000, 0x6083, 0), (0, 0x6083, 1)):
        device.slave.sdo.refusal = (refused, 0x08000021)
        answer = device.upload(index)
        device.equal(f"refusal of {refused:04X}h at {index:04X}h", answer == 0x08000021, found)


ABORTS: Final[tuple[tuple[int, int, bytes, int], ...]] = (
    (0x4711, 0, b"\0", 0x06020000),
    (0x1018, 9, b"\0", 0x06090011),
    (0x1018, 1, bytes(4), 0x06010002),
    (0x6041, 0, bytes(2), 0x06010002),
    (0x200A, 0, bytes(9), 0x06010002),
    (0x2000, 0, b"\0\0", VALUE_LOW),
    (0x2000, 0, b"\1\0", 0),
    (0x2000, 0, b"\5\0", 0),
    (0x2000, 0, b"\6\0", VALUE_HIGH),
    (0x2000, 0, b"\1", 0x06070010),
    (0x2000, 0, b"\1\0\0\0", 0x06070010),
    (0x2009, 0, b"\5\0", CROSSED),
    (0x6083, 0, bytes(6), 0x06070012),
    (0x2006, 0, bytes(4), 0x06070010),
    (0x2006, 0, b"\1\2\3", 0),
    (0x2007, 0, bytes(7), 0x06070013),
    (0x2007, 0, bytes(range(8)), 0),
    (0x2004, 0, b"\1", 0),
    (0x1400, 4, b"\0", 0x06090011),
    (0x1F50, 1, b"\0", 0x06020000),
    (0x1003, 0, b"\1", VALUE),
    (0x1006, 0, bytes((99, 0, 0, 0)), VALUE_LOW),
    (0x1006, 0, bytes(4), 0),
    (0x1019, 0, b"\1", VALUE),
    (0x1019, 0, b"\xf1", VALUE),
    (0x1019, 0, b"\xf0", 0),
    (0x1019, 0, b"\2", 0),
    (0x1019, 0, b"\0", 0),
    (0x1029, 1, b"\3", VALUE),
    (0x1010, 1, b"evas", 0x08000020),
    (0x1011, 1, b"save", 0x08000020),
)
"""Object, sub-index, bytes, abort code; 0: taken."""


@CAMPAIGN.case("sdo/abort-codes", requirements=("C301-074", "C301-076", "C301-085", "C301-086", "C301-087"))
def abort_codes(ctx: CaseContext) -> None:
    """Each mistake has its abort code in a download, in segments too; what is refused is not there."""
    device = Device(ctx)
    for index, sub, data, code in ABORTS:
        before = device.upload(index, sub)
        device.aborts(index, sub, data, code)
        if code:
            after = device.upload(index, sub)
            device.equal(f"{index:04X}h:{sub} is unchanged", after == before, 1, *clauses(code))
        elif index < 0x3000:
            device.is_so(f"{index:04X}h:{sub}", device.upload(index, sub), data, "C301-058")
    device.is_so("write-only object", device.upload(0x2003), 0x06010001, "C301-085")
    device.is_so("the highest sub-index", device.upload(0x1018), b"\4")


@CAMPAIGN.case("sdo/second-server", requirements=("C301-012", "C301-101", "C301-150"))
def second_server(ctx: CaseContext) -> None:
    """A second server takes no restricted identifier and none that is taken; then it serves there."""
    device = Device(ctx)
    for can_id in (
        0x001,
        0x07F,
        0x101,
        0x180,
        0x581,
        0x5FF,
        0x601,
        0x67F,
        0x6E0,
        0x701,
        0x780,
        0x7FF,
        0x20000690,
    ):
        device.equal(f"abort code of {can_id:X}h", device.number(0x1201, 1, can_id, 4), VALUE, "C301-012")
    for sub, can_id, code in (
        (1, 0x6C0, 0),
        (2, 0x6C0, NO_RESOURCE),
        (2, 0x6C1, 0),
        (1, 0x6C2, STATE),
        (1, INVALID | 0x6C0, 0),
        (1, 0x6C2, 0),
    ):
        device.equal(f"abort code of {can_id:X}h", device.number(0x1201, sub, can_id, 4), code, "C301-101")
    device.listen(0x6C1)
    device.equal(
        "device type by the second server",
        device.ask(0x6C2, bytes.fromhex("4000100000000000"), 0x6C1) == bytes.fromhex("4300100092010200"),
        1,
        "C301-150",
    )
    device.equal(
        "answers of the one that is gone", len(device.ask(0x6C0, bytes.fromhex("4000100000000000"), 0x6C1)), 0
    )


# -- PDO ----------------------------------------------------------------------------------------------------


@CAMPAIGN.case("pdo/kinds", requirements=("C301-051", "C301-053", "C301-056", "C301-076"))
def kinds(ctx: CaseContext) -> None:
    """Bits, 24 and 64 bits, floats and gaps have their places in receive and transmit PDOs; numbers beyond a
    type are held at its end.
    """
    device = Device(ctx)
    device.listen(0x180 + NODE)
    bits = (0x20040001, 0x20050001, 0x20060018, 0x60600008, 0x60400010)
    device.map_pdo(1, bits, 255, transmit=False)
    device.map_pdo(1, bits, 255, transmit=True)
    device.nmt(NmtCommand.START)
    for bit_0, bit_1, number, mode, word in (
        (1, 0, -2, -128, 0xABCD),
        (0, 1, 8_388_607, 127, 0x0001),
        (1, 1, -8_388_608, 0, 0x8000),
    ):
        raw = bit_0 | bit_1 << 1 | (number & 0xFFFFFF) << 2 | (mode & 0xFF) << 26 | word << 34
        device.taken(0x180 + NODE)
        device.send(0x200 + NODE, raw.to_bytes(7, "little"))
        ctx.run_for(0.01)
        found = [device.slave.get(index) for index in (0x2004, 0x2005, 0x2006, 0x6060, 0x6040)]
        device.is_so(
            "objects", [int(value) for value in found], [bit_0, bit_1, number, mode, word], "C301-053"
        )
        device.slave.trigger_tpdos()
        ctx.run_for(0.01)
        device.is_so(
            "the same as a TPDO", device.taken(0x180 + NODE)[-1:], [raw.to_bytes(7, "little")], "C301-056"
        )
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    device.map_pdo(1, (0x20070040,), 255, transmit=False)
    device.map_pdo(1, (0x20070040,), 255, transmit=True)
    device.map_pdo(2, (0x00050008, 0x60FF0020, 0x00060010), 255, transmit=False)
    device.map_pdo(3, (0x20080020, 0x20000010), 255, transmit=False)
    device.nmt(NmtCommand.START)
    device.send(0x200 + NODE, pack("<q", -(1 << 60)))
    device.send(0x300 + NODE, b"\xee" + pack("<i", -77) + b"\xee\xee")
    device.send(0x400 + NODE, pack("<fH", 0.25, 5))
    ctx.run_for(0.01)
    device.is_so("64 bits", device.slave.get(0x2007), -(1 << 60), "C301-051")
    device.is_so("number behind a gap", device.slave.get(0x60FF), -77, "C301-053")
    device.is_so("float, limited number", (device.slave.get(0x2008), device.slave.get(0x2000)), (0.25, 5))
    device.send(0x400 + NODE, pack("<fH", 0.5, 6))
    ctx.run_for(0.01)
    device.is_so(
        "float, number out of its limits",
        (device.slave.get(0x2008), device.slave.get(0x2000)),
        (0.5, 5),
        "C301-076",
    )
    device.slave.set(0x6064, 0, 1 << 40)
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    device.map_pdo(1, (0x60640020, 0x60770010), 255, transmit=True)
    device.nmt(NmtCommand.START)
    device.slave.set(0x6077, 0, -40_000)
    device.slave.trigger_tpdos()
    ctx.run_for(0.01)
    device.is_so(
        "numbers beyond their types", unpack("<ih", device.taken(0x180 + NODE)[-1]), (0x7FFFFFFF, -32_768)
    )


RULES: Final[tuple[tuple[int, int, int, int, int], ...]] = (
    (0x1600, 1, 0x50000010, 4, 0x06020000),
    (0x1600, 1, 0x10180910, 4, 0x06090011),
    (0x1600, 1, 0x60400020, 4, 0x06040041),
    (0x1600, 1, 0x60400008, 4, 0x06040041),
    (0x1600, 1, 0x10170010, 4, 0x06040041),
    (0x1600, 1, 0x60410010, 4, 0x06040041),
    (0x1600, 1, 0x00050108, 4, 0x06040041),
    (0x1600, 1, 0x00050010, 4, 0x06040041),
    (0x1600, 1, 0x00020008, 4, 0),
    (0x1600, 1, 0x00070020, 4, 0),
    (0x1600, 1, 0x00080020, 4, 0x06020000),
    (0x1600, 1, 0x60400010, 4, 0),
    (0x1600, 2, 0x60FF0020, 4, 0),
    (0x1600, 3, 0x607A0020, 4, 0),
    (0x1600, 0, 3, 1, 0x06040042),
    (0x1600, 0, 9, 1, 0x06040042),
    (0x1600, 0, 2, 1, 0),
    (0x1600, 2, 0x60FF0020, 4, STATE),
    (0x1A00, 1, 0x20030010, 4, 0x06040041),
    (0x1A00, 1, 0x00050008, 4, 0x06040041),
    (0x1A00, 1, 0x10010008, 4, 0),
    (0x1400, 2, 240, 1, 0),
    (0x1400, 2, 241, 1, VALUE),
    (0x1400, 2, 251, 1, VALUE),
    (0x1400, 2, 252, 1, VALUE),
    (0x1400, 2, 253, 1, VALUE),
    (0x1400, 2, 254, 1, 0),
    (0x1800, 2, 241, 1, VALUE),
    (0x1800, 2, 252, 1, 0),
    (0x1800, 2, 253, 1, 0),
    (0x1400, 1, 0x000, 4, VALUE),
    (0x1400, 1, 0x07F, 4, VALUE),
    (0x1400, 1, 0x101, 4, VALUE),
    (0x1400, 1, 0x180, 4, VALUE),
    (0x1400, 1, 0x581, 4, VALUE),
    (0x1400, 1, 0x601, 4, VALUE),
    (0x1400, 1, 0x6E0, 4, VALUE),
    (0x1400, 1, 0x701, 4, VALUE),
    (0x1400, 1, 0x080, 4, 0),
    (0x1400, 1, 0x100, 4, STATE),
    (0x1400, 1, INVALID | 0x080, 4, 0),
    (0x1400, 1, 0x6DF, 4, 0),
    (0x1800, 3, 5, 2, 0),
    (0x1800, 6, 5, 1, 0),
    (0x1800, 1, 0x40000181, 4, 0),
    (0x1800, 3, 6, 2, STATE),
    (0x1800, 3, 5, 2, 0),
    (0x1800, 6, 6, 1, STATE),
    (0x1800, 1, 0x40000182, 4, STATE),
    (0x1800, 1, 0xC0000182, 4, 0),
)
"""Object, sub-index, number, its bytes, abort code; one after the other, from PDOs that are invalid and
empty.
"""


@CAMPAIGN.case(
    "pdo/rules", requirements=("C301-012", "C301-040", "C301-046", "C301-047", "C301-051", "C301-052")
)
def rules(ctx: CaseContext) -> None:
    """Mapping, types, identifiers and times are taken or refused one by one with the right code."""
    device = Device(ctx)
    for record in (0x1400, 0x1800):
        device.number(record, 1, INVALID | 0x40000000 | (0x221 if record == 0x1400 else 0x1A1), 4)
        device.number(record + 0x200, 0, 0, 1)
    for index, sub, value, size, code in RULES:
        found = device.number(index, sub, value, size)
        device.equal(f"abort code of {index:04X}h:{sub} = {value:X}h", found, code, *clauses(code))


@CAMPAIGN.case("pdo/multiplex", requirements=("C301-051", "C301-054", "C301-128"))
def multiplex(ctx: CaseContext) -> None:
    """A multiplex PDO writes the object that it names, of this node or of all; a destination that is not
    there is 8230h, once until one is found; it has eight bytes.
    """
    device = Device(ctx)
    device.number(0x1400, 1, INVALID | 0x200 + NODE, 4)
    device.number(0x1400, 2, 254, 1)
    device.number(0x1600, 0, 0xFF, 1)
    device.number(0x1400, 1, 0x200 + NODE, 4)
    device.nmt(NmtCommand.START)
    device.taken(EMCY)

    def frame(head: int, index: int, sub: int, value: int) -> None:
        device.send(0x200 + NODE, pack("<BHBI", head, index, sub, value))
        ctx.run_for(0.005)

    for head, value, taken in (
        (0x80 | NODE, 1234, 1),
        (0x80, 55, 1),
        (0x80 | NODE + 1, 66, 0),
        (NODE, 77, 0),
    ):
        before = device.slave.get(0x60FF)
        frame(head, 0x60FF, 0, value)
        device.is_so("60FFh", device.slave.get(0x60FF), value if taken else before, "C301-051")
    frame(0x80 | NODE, 0x6040, 0, 0xABCD0006)
    frame(0x80 | NODE, 0x2000, 0, 9)
    device.is_so("6040h, 2000h", (device.slave.get(0x6040), device.slave.get(0x2000)), (6, 3), "C301-076")
    device.is_so("EMCYs", device.emcys(), [])
    for index, sub in ((0x4711, 0), (0x6040, 1), (0x6041, 0), (0x2007, 0)):
        frame(0x80 | NODE, index, sub, 1)
        frame(0x80 | NODE, index, sub, 1)
        device.is_so("EMCYs", device.emcys(), ["8230 11 00"], "C301-128")
        frame(0x80 | NODE, 0x6040, 0, 6)
        device.is_so("EMCYs", device.emcys(), ["0000 00 00"], "C301-128")
    device.send(0x200 + NODE, pack("<BHBI", 0x80 | NODE, 0x6040, 0, 7)[:7])
    ctx.run_for(0.005)
    device.is_so("EMCYs for seven bytes", device.emcys(), ["8210 11 00"], "C301-054")
    device.is_so("6040h", device.slave.get(0x6040), 6)


@CAMPAIGN.case("pdo/multiplex-sent", requirements=("C301-051",))
def multiplex_sent(ctx: CaseContext) -> None:
    """A PDO in destination mode carries what the device sends to a node, in eight bytes."""
    device = Device(ctx)
    device.listen(0x180 + NODE)
    device.number(0x1800, 1, 0xC0000000 | 0x180 + NODE, 4)
    device.number(0x1800, 2, 254, 1)
    device.number(0x1A00, 0, 0xFF, 1)
    device.number(0x1800, 1, 0x40000180 + NODE, 4)
    device.nmt(NmtCommand.START)
    device.taken(0x180 + NODE)
    sent = device.slave.send_multiplexed(1, 7, 0x2345, 6, b"\x11\x22")
    ctx.run_for(0.005)
    device.is_so("sent", sent, True)
    device.is_so("frame", device.taken(0x180 + NODE), [bytes.fromhex("8745230611220000")], "C301-051")


LISTS: Final = """
[1FA0]
ParameterName=Scanner list
ObjectType=8
DataType=0x0007
AccessType=rw
CompactSubObj=2

[1FD0]
ParameterName=Dispatcher list
ObjectType=8
DataType=0x001B
AccessType=rw
CompactSubObj=3
"""


@CAMPAIGN.case("pdo/multiplex-lists", requirements=("C301-051",))
def multiplex_lists(ctx: CaseContext) -> None:
    """In source mode objects of the scanner list are sent when they change, and those of other nodes go where
    the dispatcher list says, block by block: the entries on either side of a block do not.
    """
    device = Device(ctx, lists=LISTS)
    device.listen(0x180 + NODE)
    device.is_so(
        "scanner list",
        [device.number(0x1FA0, 1, 0x01606400, 4), device.number(0x1FA0, 2, 0x01604000, 4)],
        [0, 0],
    )
    blocks = (
        2 << 56 | 0x6083 << 40 | 0x3000 << 16 | 2 << 8 | 9,
        0x6040 << 40 | 0x3001 << 16 | 9,
        3 << 56 | 0x60FF << 40 | 0x3002 << 16 | 1 << 8 | 9,
    )
    for sub, block in enumerate(blocks, 1):
        device.is_so("dispatcher list", device.download(0x1FD0, sub, block.to_bytes(8, "little")), 0)
    for record, can_id in ((0x1400, 0x200 + NODE), (0x1800, 0x40000180 + NODE)):
        device.number(record, 1, INVALID | can_id, 4)
        device.number(record, 2, 254, 1)
        device.is_so("source mode", device.number(record + 0x200, 0, 0xFE, 1), 0, "C301-051")
        device.number(record, 1, can_id, 4)
    device.nmt(NmtCommand.START)
    device.taken(0x180 + NODE)
    device.slave.set(0x6064, 0, -2)
    device.slave.set(0x606C, 0, 7)
    ctx.run_for(0.005)
    own = f"{NODE:02x}"
    device.is_so(
        "sent", [one.hex() for one in device.taken(0x180 + NODE)], [own + "646000feffffff"], "C301-051"
    )
    device.slave.set(0x6064, 0, -2)
    device.number(0x6040, 0, 6, 2)
    ctx.run_for(0.005)
    device.is_so(
        "sent", [one.hex() for one in device.taken(0x180 + NODE)], [own + "40600006000000"], "C301-051"
    )
    for head, index, sub, value, taken in (
        (9, 0x3000, 2, 11, {0x6083: 11}),
        (9, 0x3000, 1, 22, {}),
        (9, 0x3000, 4, 33, {}),
        (8, 0x3000, 2, 44, {}),
        (0x89, 0x3000, 2, 55, {}),
        (9, 0x3001, 0, 7, {0x6040: 7}),
        (9, 0x3001, 1, 8, {}),
        (9, 0x3002, 1, 99, {0x60FF: 99}),
        (9, 0x3003, 1, 98, {}),
    ):
        wanted = {key: device.slave.get(key) for key in (0x6083, 0x6040, 0x60FF)} | taken
        device.send(0x200 + NODE, pack("<BHBI", head, index, sub, value))
        ctx.run_for(0.002)
        device.is_so(
            f"objects behind {index:04X}h:{sub} of {head:02X}h",
            {key: device.slave.get(key) for key in wanted},
            wanted,
            "C301-051",
        )
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    device.taken(0x180 + NODE)
    device.slave.set(0x6064, 0, 5)
    ctx.run_for(0.005)
    device.is_so("sent in Pre-operational", device.taken(0x180 + NODE), [], "C301-056")


# -- SYNC, TIME, EMCY, guarding -----------------------------------------------------------------------------


@CAMPAIGN.case("sync-producer", requirements=("C301-032", "C301-033", "C301-034"))
def sync_producer(ctx: CaseContext) -> None:
    """A producer keeps its period, counts from 1 to 1019h and from 1 again after Stopped; its identifier and
    its counter are locked meanwhile.
    """
    device = Device(ctx)
    device.listen(0x085)
    for index, sub, value, size, code in (
        (0x1005, 0, 0x101, 4, VALUE),
        (0x1005, 0, 0x085, 4, 0),
        (0x1019, 0, 3, 1, 0),
        (0x1006, 0, 10_000, 4, 0),
        (0x1019, 0, 4, 1, STATE),
        (0x1005, 0, 0x40000085, 4, 0),
        (0x1005, 0, 0x40000086, 4, STATE),
    ):
        device.equal(
            f"abort code of {index:04X}h = {value:X}h",
            device.number(index, sub, value, size),
            code,
            "C301-032",
        )
    ctx.run_for(0.005)
    device.taken(0x085)
    ctx.run_for(0.06)
    gaps = [later - earlier for earlier, later in pairwise(device.times(0x085))]
    device.equal("SYNCs in 60 ms", len(gaps) + 1, 6, "C301-032")
    for gap in gaps:
        device.equal("period, s", gap, 0.01, "C301-032", within=2e-5)
    counted = [data[0] for data in device.taken(0x085)]
    wanted = [(counted[0] - 1 + step) % 3 + 1 for step in range(6)]
    device.is_so("counters", counted, wanted, "C301-033")
    device.nmt(NmtCommand.STOP)
    device.taken(0x085)
    ctx.run_for(0.03)
    device.is_so("SYNCs in Stopped", device.taken(0x085), [])
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    ctx.run_for(0.035)
    device.is_so("counters after Stopped", device.taken(0x085)[:3], [b"\1", b"\2", b"\3"], "C301-033")
    device.equal("abort code", device.number(0x1005, 0, 0x085, 4), 0)
    device.taken(0x085)
    ctx.run_for(0.03)
    device.is_so("SYNCs of one that is no producer", device.taken(0x085), [], "C301-032")


@CAMPAIGN.case("sync-length", requirements=("C301-034", "C301-129"))
def sync_length(ctx: CaseContext) -> None:
    """A SYNC of another length than 1019h says is 8240h, once, and counts all the same."""
    device = Device(ctx)
    device.listen(0x280 + NODE)
    device.number(0x1005, 0, 0x085, 4)
    device.nmt(NmtCommand.START)
    ctx.run_for(0.01)
    device.taken(0x280 + NODE)
    device.emcys()
    for data in (b"\1", b"\2"):
        device.send(0x085, data)
        ctx.run_for(0.005)
    device.is_so("EMCYs", device.emcys(), ["8240 11 00"], "C301-034")
    device.equal("TPDO2 for each", len(device.taken(0x280 + NODE)), 2, "C301-034")
    device.send(0x085, b"")
    ctx.run_for(0.005)
    device.is_so("EMCYs", device.emcys(), ["0000 00 00"], "C301-034")
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    device.number(0x1019, 0, 10, 1)
    device.send(0x085, b"")
    ctx.run_for(0.005)
    device.is_so("EMCYs without the counter", device.emcys(), ["8240 11 00"], "C301-034")


DAY_MS: Final = 86_400_000


@CAMPAIGN.case("time", requirements=("C301-004", "C301-012", "C301-142"))
def time(ctx: CaseContext) -> None:
    """TIME sets the clock, which goes on over midnight; wrong ones are ignored; the producer sends it where
    1012h and the state allow it.
    """
    device = Device(ctx)
    clock = device.slave.time
    device.listen(0x200)
    device.send(0x100, pack("<IH", 1, 1))
    device.is_so("time without bit 31", clock.time_of_day(), None, "C301-142")
    for can_id in (0x000, 0x07F, 0x101, 0x180, 0x601, 0x701):
        device.equal(
            f"abort code of {can_id:X}h", device.number(0x1012, 0, INVALID | can_id, 4), VALUE, "C301-012"
        )
    device.equal("abort code", device.number(0x1012, 0, INVALID | 0x100, 4), 0)
    for data in (b"", bytes(5), bytes(7), pack("<IH", DAY_MS, 0)):
        device.send(0x100, data)
        ctx.run_for(0.002)
    device.is_so("time after wrong frames", (clock.time_of_day(), clock.malformed), (None, 4), "C301-004")
    device.send(0x100, pack("<IH", 0xF0000000 | DAY_MS - 1, 4711))
    device.send(0x100, pack("<IH", DAY_MS - 1000, 4711))
    begun = ctx.now_s
    for passed, days in ((0.5, 4711), (1.0, 4712)):
        ctx.run_for(passed)
        found = clock.time_of_day() or (0, 0)
        wanted = (DAY_MS - 1000 + (ctx.now_s - begun) * 1000) % DAY_MS
        device.equal("milliseconds", found[0], wanted, "C301-142", within=2.5)
        device.equal("days", found[1], days, "C301-142")
    device.equal(
        "another identifier while it is used", device.number(0x1012, 0, INVALID | 0x200, 4), STATE, "C301-012"
    )
    for value in (0x100, 0x40000200):
        device.equal("abort code", device.number(0x1012, 0, value, 4), 0)
    clock.set_time(3_600_000, 10)
    for command, sent in (
        (NmtCommand.STOP, False),
        (NmtCommand.ENTER_PRE_OPERATIONAL, True),
        (NmtCommand.START, True),
    ):
        device.nmt(command)
        device.taken(0x200)
        device.is_so(f"sent after {command.name}", clock.produce(), sent, "C301-142")
        ctx.run_for(0.002)
        frames = device.taken(0x200)
        device.equal("frames", len(frames), sent)
        for data in frames:
            milliseconds, days = unpack("<IH", data)
            device.equal("milliseconds", milliseconds, 3_600_010, within=15)
            device.equal("days", days, 10)


@CAMPAIGN.case("emcy", requirements=("C301-108", "C301-109", "C301-110", "C301-111", "C301-112", "C301-114"))
def emcy(ctx: CaseContext) -> None:
    """Register bits by group of codes, once until it has gone, history with its count, inhibit time, Stopped,
    another identifier, none at all.
    """
    device = Device(ctx)
    slave = device.slave
    for code, bits in (
        (0x1000, 0x01),
        (0x2310, 0x03),
        (0x3220, 0x05),
        (0x4310, 0x09),
        (0x5510, 0x01),
        (0x6010, 0x01),
        (0x7121, 0x21),
        (0x8130, 0x11),
        (0x8611, 0x21),
        (0x9000, 0x01),
        (0xF001, 0x01),
        (0xFF80, 0x81),
    ):
        slave.emcy(code, data=b"\x55")
        slave.emcy(code)
        ctx.run_for(0.003)
        device.is_so("EMCY", device.emcys(), [f"{code:04X} {bits:02X} 55"], "C301-112")
        device.shows(0x1001, bits, "C301-112", signed=False)
        slave.emcy_clear(code)
        ctx.run_for(0.003)
        device.is_so("end", device.emcys(), ["0000 00 00"], "C301-109")
    device.shows(0x1003, 4, "C301-111")
    device.is_so(
        "history",
        [device.read(0x1003, sub, signed=False) & 0xFFFF for sub in range(1, 5)],
        [0xFF80, 0xF001, 0x9000, 0x8611],
        "C301-111",
    )
    device.write(0x1003, 0)
    device.shows(0x1003, 0, "C301-111")
    device.is_so("an empty entry", device.upload(0x1003, 1), 0x08000024, "C301-111")
    slave.emcy(0x2310)
    slave.emcy(0x4310)
    slave.emcy_clear(0x2310)
    slave.emcy_clear(0x4310)
    ctx.run_for(0.005)
    device.is_so(
        "two errors", device.emcys(), ["2310 03 00", "4310 0B 00", "0000 09 00", "0000 00 00"], "C301-114"
    )
    device.number(0x1015, 0, 100, 2)
    for code in range(0xFF01, 0xFF06):
        slave.emcy(code)
    ctx.run_for(0.1)
    gaps = [later - earlier for earlier, later in pairwise(device.times(EMCY))]
    device.equal("shortest gap, s", min(gaps), 0.01, "C301-110", within=5e-4)
    device.is_so(
        "codes", [one[:4] for one in device.emcys()], ["FF01", "FF02", "FF03", "FF04", "FF05"], "C301-110"
    )
    device.number(0x1015, 0, 0, 2)
    slave.emcy_clear()
    ctx.run_for(0.02)
    device.is_so("end of all", device.emcys(), ["0000 00 00"])
    device.nmt(NmtCommand.STOP)
    slave.emcy(0x8611)
    ctx.run_for(0.01)
    device.is_so("EMCYs in Stopped", device.emcys(), [], "C301-108")
    device.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    ctx.run_for(0.01)
    device.is_so("EMCYs after it", device.emcys(), ["8611 21 00"], "C301-108")
    slave.emcy_clear()
    for value, code in ((0xA5, STATE), (INVALID | 0xA5, 0), (0x585, VALUE), (0xA5, 0)):
        device.equal(f"abort code of {value:X}h", device.number(0x1014, 0, value, 4), code, "C301-012")
    device.listen(0xA5)
    device.emcys()
    slave.emcy(0x8611)
    ctx.run_for(0.01)
    device.is_so("EMCYs", (device.emcys(), len(device.taken(0xA5))), ([], 1), "C301-143")
    device.number(0x1014, 0, INVALID | 0xA5, 4)
    slave.emcy(0x2310)
    ctx.run_for(0.01)
    device.is_so("EMCYs switched off", device.taken(0xA5), [], "C301-110")
    device.shows(0x1001, 0x23, "C301-110")


@CAMPAIGN.case("collision", requirements=("C301-125",))
def collision(ctx: CaseContext) -> None:
    """A frame of another node with an identifier of this one is 8150h, once, and over a second after the
    last.
    """
    device = Device(ctx)
    device.nmt(NmtCommand.START)
    for can_id in (0x080, 0x100, 0x081, 0x186, 0x482):
        device.send(can_id, b"" if can_id == 0x080 else bytes(8))
    device.emcys()
    for can_id in (0x180 + NODE, SERVER, BEAT):
        device.taken(can_id)
        for _ in range(2):
            device.send(can_id, b"\5")
            ctx.run_for(0.3)
        device.is_so("EMCYs", device.emcys(), ["8150 11 00"], "C301-125")
        ctx.run_for(0.65)
        device.is_so("EMCYs before the end", device.emcys(), [], "C301-125")
        ctx.run_for(0.1)
        device.is_so("EMCYs", device.emcys(), ["0000 00 00"], "C301-125")


@CAMPAIGN.case("guarding", requirements=("C301-025", "C301-026", "C301-123"))
def guarding(ctx: CaseContext) -> None:
    """Two watched nodes are one error that ends when both are back; a node that restarts is no silence;
    unused entries watch nobody, and no node is watched twice.
    """
    device = Device(ctx)
    device.number(0x1016, 1, 50 << 16 | 30, 4)
    device.number(0x1016, 2, 51 << 16 | 60, 4)
    code = device.number(0x1016, 3, 50 << 16 | 80, 4)
    device.equal("abort code of a node that is watched already", code, 0x06040043, "C301-025")
    device.equal("abort code of an unused entry", device.number(0x1016, 3, 52 << 16, 4), 0)
    ctx.run_for(0.2)
    device.is_so("EMCYs before the first heartbeat", device.emcys(), [], "C301-026")
    for node in (50, 51, 52):
        device.send(0x700 + node, b"\5")
    begun = ctx.now_s
    ctx.wait_until(lambda: device.times(EMCY), 0.2, "the EMCY comes")
    device.equal("time until the EMCY, s", ctx.now_s - begun, 0.028, "C301-026", within=0.002)
    device.is_so("EMCYs", device.emcys(), ["8130 11 00"], "C301-026")
    ctx.run_for(0.1)
    device.send(0x732, b"\5")
    ctx.run_for(0.001)
    device.is_so("EMCYs while one is missing", device.emcys(), [], "C301-109")
    device.send(0x733, b"\5")
    ctx.run_for(0.003)
    device.is_so("EMCYs", device.emcys(), ["0000 00 00"], "C301-109")


# -- LSS and storage ----------------------------------------------------------------------------------------


@CAMPAIGN.case("lss/bit-rates", requirements=("C301-156", "C301-157"))
def bit_rates(ctx: CaseContext) -> None:
    """The bit rates of the table are taken, others refused; activated, the node is silent for two delays and
    then works at the other rate.
    """
    segment = Segment(ctx, "a")
    master, heard = segment["a"], segment.received["a"]
    slave = CanopenSlave(segment.scheduler, segment.medium, dictionary(), NODE, name="small")
    slave.power_on()
    segment.run_us(5_000)

    def ask(can_id: int, data: bytes) -> list[bytes]:
        heard.clear()
        master.send(CanFrame(can_id, data.ljust(8, b"\0")))
        segment.run_us(10_000)
        return [frame.data for _, frame in heard if frame.can_id in (0x7E4, SERVER)]

    ask(0x7E5, b"\x04\1")
    supported = {1_000_000}  # what the file lists
    table = {0: 1_000_000, 1: 800_000, 2: 500_000, 3: 250_000, 4: 125_000, 6: 50_000, 7: 20_000, 8: 10_000}
    for index in (*range(11), 255):
        wanted = bytes((0x13, table.get(index) not in supported)) + bytes(6)
        segment.is_so(f"answer to index {index}", ask(0x7E5, bytes((0x13, 0, index))), [wanted], "C301-156")
    segment.is_so("answer to another table", ask(0x7E5, b"\x13\1\0"), [b"\x13\1" + bytes(6)], "C301-156")
    read = bytes.fromhex("4018100100000000")
    ask(0x7E5, b"\x15\x32")
    segment.is_so("silent", ask(CLIENT, read), [], "C301-157")
    segment.run_us(60_000)
    segment.is_so("still silent", ask(CLIENT, read), [], "C301-157")
    segment.run_us(20_000)
    segment.is_so("back", len(ask(CLIENT, read)), 1, "C301-157")
    # A bit rate that was asked for and not stored is gone with a reset: there is nothing to activate.
    ask(0x7E5, b"\x13\0\0")
    master.send(CanFrame(0, bytes((NmtCommand.RESET_NODE, NODE))))
    segment.run_us(5_000)
    ask(0x7E5, b"\x04\1")
    ask(0x7E5, b"\x15\x32")
    segment.is_so("answers after a reset", len(ask(CLIENT, read)), 1, "C301-157")


@CAMPAIGN.product(
    "store/{group}",
    parameters=[
        {"group": 1, "beat": 500, "acceleration": 77, "limited": 5},
        {"group": 2, "beat": 500, "acceleration": 1000, "limited": 3},
        {"group": 3, "beat": 0, "acceleration": 77, "limited": 5},
    ],
    title="1010h:{group} and 1011h:{group}",
    requirements=("C301-140", "C301-141"),
)
def store(ctx: CaseContext, group: int, beat: int, acceleration: int, limited: int) -> None:
    """A group saves its objects over power-off, mapping included; restored, its defaults come with the
    reset.
    """
    device = Device(ctx)
    device.number(0x1017, 0, 500, 2)
    device.number(0x6083, 0, 77, 4)
    device.number(0x2000, 0, 5, 2)
    device.map_pdo(2, (0x60600008,), 255, transmit=False)
    device.shows(0x1010, 1, sub=group)
    device.number(0x1010, group, SAVE, 4)
    device.number(0x1017, 0, 900, 2)
    device.number(0x6083, 0, 88, 4)
    device.slave.power_off()
    ctx.run_for(0.01)
    device.slave.power_on()
    ctx.run_for(0.05)
    for index, value in ((0x1017, beat), (0x6083, acceleration), (0x2000, limited)):
        device.shows(index, value, "C301-140")
    mapped = device.read(0x1601, 1, signed=False)
    device.equal("mapping is kept", mapped == 0x60600008, group != 3, "C301-140")
    device.number(0x1011, group, LOAD, 4)
    device.shows(0x6083, acceleration, "C301-141")
    device.nmt(NmtCommand.RESET_NODE)
    ctx.run_for(0.05)
    for index, value in ((0x1017, 0), (0x6083, 1000), (0x2000, 3)):
        device.shows(index, value, "C301-141")
    for left in (1, 2, 3):
        device.number(0x6083, 0, 70 + left, 4)
        device.number(0x1011, 1, LOAD, 4)
        device.number(0x1010, left, SAVE, 4)
        device.nmt(NmtCommand.RESET_NODE)
        ctx.run_for(0.05)
        wanted = 1000 if left == 2 else 70 + left
        device.shows(0x6083, wanted, "C301-141")


# -- the canopen library ------------------------------------------------------------------------------------


@CAMPAIGN.case(
    "library", requirements=("C301-057", "C301-058", "C301-060", "C301-063", "C301-066", "C301-108")
)
def library(ctx: CaseContext) -> None:
    """The unmodified `canopen` library reads, writes, maps, guards and configures the device in virtual
    time.
    """
    device = Device(ctx)
    with PumpedNetwork(device.segment) as network, virtual_time(device.segment.scheduler):
        node = network.add_node(NODE, dictionary())
        for index, value in (
            (0x6060, -2),
            (0x6040, 0xBEEF),
            (0x2006, -(1 << 23)),
            (0x6083, 0xFFFFFFFF),
            (0x2008, 0.5),
        ):
            node.sdo[index].raw = value
            device.is_so(f"{index:04X}h", node.sdo[index].raw, value, "C301-057")
        for size in (1, 7, 8, 889, 900):
            for block in (False, True):
                content = content_of(size)
                with node.sdo.open(DOMAIN, 0, "wb", size=size, block_transfer=block) as stream:
                    stream.write(content)
                device.is_so("content", device.slave.get(DOMAIN), content, "C301-063")
                with node.sdo.open(DOMAIN, 0, "rb", block_transfer=block) as stream:
                    device.is_so("content read", stream.read(), content, "C301-066")
        for index, code in ((0x4711, 0x06020000), (0x2003, 0x06010001)):
            found = 0
            try:
                node.sdo.upload(index, 0)
            except canopen.SdoAbortedError as error:
                found = error.code
            device.equal(f"abort code of {index:04X}h", found, code, "C301-085")
        node.sdo[0x1017].raw = 20
        node.nmt.state = "OPERATIONAL"
        node.nmt.wait_for_heartbeat(1.0)
        device.is_so("state", node.nmt.state, "OPERATIONAL", "C301-017")
        device.slave.emcy(0x2310, data=b"\1\2\3\4\5")
        error = node.emcy.wait(timeout=0.5)
        device.is_so("EMCY", (error.code, error.register, error.data), (0x2310, 3, b"\1\2\3\4\5"), "C301-108")
        begun = ctx.now_s
        device.is_so("no further EMCY", node.emcy.wait(timeout=0.4), None)
        device.equal("time-out, s", ctx.now_s - begun, 0.4, within=0.01)
        network.sync.transmit()
        node.nmt.state = "PRE-OPERATIONAL"
        network.lss.send_switch_state_selective(0x1234, 0x5678, 0x10000, 42)
        device.equal("node-ID by LSS", network.lss.inquire_node_id(), NODE, "C301-162")


@CAMPAIGN.case("library/waits", requirements=("C301-023", "C301-028", "C301-108", "C301-142"))
def library_waits(ctx: CaseContext) -> None:
    """Whatever the library waits for ends in time of the bench, just behind its time-out and not before;
    periodic messages keep their period; what cannot be is refused, and a network that is left is silent.
    """
    device = Device(ctx)
    scheduler = device.segment.scheduler

    def fails(
        what: str, error: type[Exception], act: Callable[[], object], time_s: float | None = None
    ) -> None:
        begun, found = ctx.now_s, ""
        try:
            act()
        except error as reason:
            found = type(reason).__name__
        device.equal(f"{what} fails ({found})", found != "", 1)
        if time_s is not None:
            device.equal(f"{what}: time, s", ctx.now_s - begun, time_s, within=0.002)

    with PumpedNetwork(device.segment) as network:
        node = network.add_node(NODE, dictionary())
        node.sdo.RESPONSE_TIMEOUT, node.sdo.MAX_RETRIES = 0.25, 1
        device.slave.sdo.silent = True
        fails("a read of a silent server", canopen.SdoCommunicationError, lambda: node.sdo[0x1000].raw, 0.25)
        device.slave.sdo.silent = False
        device.is_so("read again", node.sdo[0x1000].raw, 0x20192)
        node.sdo[0x1017].raw = 50
        ctx.run_for(0.03)
        fails(
            "a wait of 19 ms for a heartbeat",
            canopen.nmt.NmtError,
            lambda: node.nmt.wait_for_heartbeat(0.019),
        )
        device.is_so("state", node.nmt.wait_for_heartbeat(0.06), "PRE-OPERATIONAL", "C301-023")
        fails("a wait for a boot-up", canopen.nmt.NmtError, lambda: node.nmt.wait_for_bootup(0.2))
        device.slave.boot_time_ns = 300 * MS
        node.nmt.state = "RESET"
        begun = ctx.now_s
        node.nmt.wait_for_bootup(1)
        device.equal("boot-up, s", ctx.now_s - begun, 0.3, "C301-022", within=0.005)
        device.slave.boot_time_ns = 0
        scheduler.after(100 * MS, lambda: device.slave.emcy(0x2310))
        scheduler.after(200 * MS, lambda: device.slave.emcy(0x8611, None, b"\1\2"))
        begun = ctx.now_s
        found = node.emcy.wait(0x8611, timeout=1)
        device.is_so(
            "EMCY", (found.code, found.register, found.data), (0x8611, 0x23, b"\1\2\0\0\0"), "C301-108"
        )
        device.equal("EMCY, s", ctx.now_s - begun, 0.2, within=0.001)
        node.sdo[0x100C].raw, node.sdo[0x100D].raw = 20, 2
        reasons: list[str] = []
        states: list[int] = []
        device.slave.on_communication_error.append(reasons.append)
        node.nmt.add_heartbeat_callback(states.append)
        node.nmt.start_node_guarding(0.02)
        ctx.run_for(0.2)
        device.is_so(
            "guarded", (reasons, set(states), len(states) in (10, 11)), ([], {0x7F}, True), "C301-028"
        )
        node.nmt.stop_node_guarding()
        ctx.run_for(0.1)
        device.is_so("guarding has ended", reasons, ["life_guarding"], "C301-029")
        device.listen(0x123, 0x100)
        fails("a period of 0", BusError, lambda: network.send_periodic(0x123, b"", 0.0))
        task = network.send_periodic(0x123, b"\1", 0.01)
        ctx.run_for(0.045)
        task.update(b"\2")
        ctx.run_for(0.05)
        task.stop()
        task.stop()
        ctx.run_for(0.05)
        times = device.times(0x123)
        device.equal("ten messages, s", times[-1] - times[0], 0.09, within=1e-5)
        device.is_so("their content", b"".join(device.taken(0x123)), b"\1" * 5 + b"\2" * 5)
        network.time.transmit()
        ctx.run_for(0.002)
        milliseconds, days = unpack("<LH", device.taken(0x100)[0])
        device.is_so("days of TIME", days, 16 * 365 + 4, "C301-142")
        device.equal("time of day, ms", milliseconds, 1000 * ctx.now_s, "C301-142", within=4)
        network.scanner.search(60)
        ctx.run_for(0.05)
        device.is_so("nodes found", NODE in network.scanner.nodes, True)
        before = network.malformed
        for can_id, data in ((0x80 + NODE, b"\x11\x86"), (0x700 + NODE, b"")):
            device.send(can_id, data)
        ctx.run_for(0.005)
        device.is_so("frames that are too short", network.malformed - before, 2)
        refused: list[str] = []

        def read() -> None:
            try:
                node.sdo.upload(0x1000, 0)
            except BusError as reason:
                refused.append(str(reason))

        scheduler.after(MS, read)
        ctx.run_for(0.005)
        device.equal(f"waiting in a callback is refused ({refused})", len(refused), 1)
        network.sync.start(0.01)
        ctx.run_for(0.025)
    device.listen(0x80)
    ctx.run_for(0.05)
    device.is_so("SYNCs of a network that is left", device.taken(0x80), [])
    fails("a command over it", BusError, lambda: network.nmt.send_command(1))


@CAMPAIGN.case("storage", requirements=("C301-018", "C301-140", "C301-141", "C301-158"))
def storage(ctx: CaseContext) -> None:
    """What was saved is in a file and in a new device on it, values of all types and the node-ID by LSS; a
    restore that was ordered is carried out by the next start; a damaged file is refused.
    """
    saved: dict[tuple[int, int], object] = {
        (0x6083, 0): 4711,
        (0x607D, 1): -77,
        (0x2001, 0): "name of the axis",
        (0x200B, 0): b"\x00\xff\x10",
        (0x2007, 0): -(1 << 63),
        (0x2008, 0): 0.25,
        (0x1017, 0): 100,
    }
    with TemporaryDirectory() as folder:
        path = Path(folder) / "memory.json"

        def start() -> tuple[Segment, CanopenSlave]:
            segment = Segment(ctx, "a")
            device = CanopenSlave(
                segment.scheduler, segment.medium, dictionary(), NODE, name="small", storage=path
            )
            device.power_on()
            segment.run_us(5_000)
            return segment, device

        def ask(segment: Segment, can_id: int, data: bytes) -> list[bytes]:
            segment.received["a"].clear()
            segment["a"].send(CanFrame(can_id, data.ljust(8, b"\0")))
            segment.run_us(5_000)
            return [
                frame.data for _, frame in segment.received["a"] if frame.can_id in (SERVER, 0x7E4, 0x589)
            ]

        save, load = bytes.fromhex("2310100173617665"), bytes.fromhex("231110016C6F6164")
        segment, device = start()
        for (index, sub), value in saved.items():
            device.set(index, sub, value)
        segment.is_so("file before saving", path.exists(), False)
        segment.is_so("answer", ask(segment, CLIENT, save), [bytes.fromhex("6010100100000000")], "C301-140")
        device.set(0x6083, 0, 4712)
        segment, device = start()
        for (index, sub), value in saved.items():
            segment.is_so(f"{index:04X}h:{sub}", device.get(index, sub), value, "C301-140")
        ask(segment, CLIENT, load)
        segment.is_so("6083h before the restart", device.get(0x6083), 4711, "C301-141")
        segment, device = start()
        segment.is_so("6083h, 1017h", (device.get(0x6083), device.get(0x1017)), (1000, 0), "C301-141")
        for service, answer in ((b"\x04\1", []), (b"\x11\x09", [b"\x11\0"]), (b"\x17", [b"\x17\0"])):
            wanted = [one.ljust(8, b"\0") for one in answer]
            segment.is_so(f"answer to LSS {service.hex()}", ask(segment, 0x7E5, service), wanted, "C301-158")
        segment, device = start()
        found = ask(segment, 0x609, bytes.fromhex("4000100000000000"))
        segment.is_so("answer of node 9", found, [bytes.fromhex("4300100092010200")], "C301-158")
        path.write_text(path.read_text("utf-8").replace('"node_id": 9', '"node_id": 8'), "utf-8")
        refused = 0
        try:
            start()
        except ConfigurationError as error:
            refused = int("damaged" in str(error))
        equal(ctx, "a damaged file is refused", refused, 1)


@CAMPAIGN.product(
    "eds/{kind}",
    parameters=[{"kind": "eds", "dcf": False}, {"kind": "dcf", "dcf": True}],
    title="the device as a file: {kind}",
)
def as_file(ctx: CaseContext, kind: str, dcf: bool) -> None:
    """The file that is made of a device makes the same device: entries, types, access, defaults, limits; a
    DCF has its values and its node-ID too.
    """
    device = Device(ctx)
    for index, sub, value in ((0x6083, 0, 4711), (0x607D, 1, -77), (0x1017, 0, 100)):
        device.slave.set(index, sub, value)
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"small.{kind}"
        path.write_text(device_eds(device.slave, dcf=dcf), encoding="utf-8")
        again = load_dictionary(path)
    segment = Segment(ctx, "a")
    other = CanopenSlave(segment.scheduler, segment.medium, again, NODE, name="again")
    first, second = device.slave.store.entries, other.store.entries
    device.is_so("entries", sorted(second) == sorted(first), True)
    for key, entry in first.items():
        twin = second[key]
        facts = [
            (one.bits, one.signed, one.maps_receive, one.maps_transmit, one.low, one.high)
            for one in (entry, twin)
        ]
        device.is_so(f"facts of {key >> 8:04X}h:{key & 0xFF}", facts[1], facts[0])
    wanted = (4711, -77, 100) if dcf else (1000, -(1 << 31), 0)
    other.power_on()
    segment.run_us(5_000)
    found = (other.get(0x6083), other.get(0x607D, 1), other.get(0x1017))
    device.is_so("values of the new device", found, wanted)


@CAMPAIGN.case("multiplex-source", requirements=("C301-051",))
def multiplex_source(ctx: CaseContext) -> None:
    """A source PDO is nothing to a node without a list that wants it."""
    device = Device(ctx)
    device.number(0x1400, 1, INVALID | 0x200 + NODE, 4)
    device.number(0x1400, 2, 254, 1)
    device.number(0x1600, 0, 0xFE, 1)
    device.number(0x1400, 1, 0x200 + NODE, 4)
    device.nmt(NmtCommand.START)
    device.taken(EMCY)
    device.send(0x200 + NODE, pack("<BHBI", 50, 0x60FF, 0, 1234))
    ctx.run_for(0.005)
    device.is_so("60FFh", device.slave.get(0x60FF), 0, "C301-051")
    device.is_so("EMCYs", device.emcys(), [])
