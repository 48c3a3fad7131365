"""What the bus log says: every service of a CANopen node in words, from its frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from fieldbus.can import CanFrame
from fieldbus.canopen import NmtCommand
from fieldbus.canopen.decode import FrameDecoder
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._led_servo import NODE, Node
from testcases.campaigns.canopen_device import NODE as DEVICE
from testcases.campaigns.canopen_device import dictionary
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "bus log", controller="", tags=("canopen",), bench="testcases.campaigns._led_servo:BENCH"
)
SERVER: Final = 0x600 + NODE


class Log:
    """The words for the frames on the bus.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self._ctx = ctx
        self._begin = len(ctx.trace().frames)

    def texts(self, *cob_ids: int) -> list[str]:
        """Return what has come since the last call, of some identifiers or of all."""
        frames = ctx_frames = self._ctx.trace().frames
        new = ctx_frames[self._begin :]
        self._begin = len(frames)
        return [
            str(self._ctx.bench.decode(CanFrame(one.can_id, one.data)))
            for one in new
            if not cob_ids or one.can_id in cob_ids
        ]

    def says(self, wanted: Sequence[str], *cob_ids: int) -> None:
        """Expect these texts since the last call, of these identifiers, in this order."""
        found = self.texts(*cob_ids)
        for place, text in enumerate(wanted):
            have = found[place] if place < len(found) else "nothing"
            equal(self._ctx, f"line {place + 1} is {text!r} (it is {have!r})", have == text, 1)
        equal(self._ctx, f"number of lines {found}", len(found), len(wanted))


def started(ctx: CaseContext) -> tuple[Node, Log]:
    """Return the node behind its boot-up, and the log from then on."""
    node = Node(ctx)
    ctx.run_for(0.05)
    return node, Log(ctx)


_SDO: Final = (SERVER, 0x580 + NODE)


@CAMPAIGN.case("sdo/expedited")
def expedited(ctx: CaseContext) -> None:
    """Reading and writing of up to four bytes: object, name, value, and the abort with its reason."""
    node, log = started(ctx)
    node.download(0x6083, 0, (12345).to_bytes(4, "little"))
    log.says(
        [
            "SDO drive1 write 6083h Profile acceleration = 12345",
            "SDO drive1 written 6083h Profile acceleration",
        ],
        *_SDO,
    )
    node.upload(0x6083)
    log.says(
        ["SDO drive1 read 6083h Profile acceleration", "SDO drive1 read 6083h Profile acceleration = 12345"],
        *_SDO,
    )
    node.upload(0x6041)
    log.says(
        ["SDO drive1 read 6041h Statusword", "SDO drive1 read 6041h Statusword = 0250h (Switch on disabled)"],
        *_SDO,
    )
    node.upload(0x5FFF)
    log.says(["SDO drive1 read 5FFFh", "SDO drive1 abort 06020000h object does not exist (5FFFh)"], *_SDO)
    node.download(0x1000, 0, bytes(4))
    log.says(
        [
            "SDO drive1 write 1000h Device type = 0",
            "SDO drive1 abort 06010002h read-only (1000h Device type)",
        ],
        *_SDO,
    )
    node.send(SERVER, bytes((0x80, 0x41, 0x60, 0, 0, 0, 4, 5)))
    log.says(["SDO drive1 abort by client 05040000h transfer timed out (6041h Statusword)"], *_SDO)


@CAMPAIGN.case("sdo/segmented")
def segmented(ctx: CaseContext) -> None:
    """Every segment is one, the last one shows the whole text."""
    node, log = started(ctx)
    node.upload(0x1008)
    begin = "SDO drive1 read 1008h Device name"
    log.says(
        [
            begin,
            f"{begin} segmented, 28 bytes",
            *["SDO drive1 next segment", "SDO drive1 segment"] * 3,
            "SDO drive1 next segment",
            "SDO drive1 segment, last: 1008h Device name = 'Emulated servo drive CiA 402'",
        ],
        *_SDO,
    )


@CAMPAIGN.case("sdo/blocks")
def blocks(ctx: CaseContext) -> None:
    """A block upload: request, length, numbered segments, receipt, checksum, end."""
    node, log = started(ctx)
    for request in (
        bytes((0xA4, 8, 0x10, 0, 127, 0, 0, 0)),
        bytes((0xA3,)).ljust(8, b"\0"),
        bytes((0xA2, 4, 127)).ljust(8, b"\0"),
        bytes((0xA1,)).ljust(8, b"\0"),
    ):
        node.send(SERVER, request)
        ctx.run_for(0.02)
    log.says(
        [
            "SDO drive1 read 1008h Device name in blocks of 127",
            "SDO drive1 read 1008h Device name in blocks, 28 bytes",
            "SDO drive1 block start",
            "SDO drive1 block segment 1",
            "SDO drive1 block segment 2",
            "SDO drive1 block segment 3",
            "SDO drive1 block segment 4, last",
            "SDO drive1 block received up to 4",
            "SDO drive1 block end, CRC",
            "SDO drive1 block end",
        ],
        *_SDO,
    )


@CAMPAIGN.case("states")
def states(ctx: CaseContext) -> None:
    """NMT commands with their node, heartbeats with the state, boot-up, SYNC and TIME."""
    node, log = started(ctx)
    node.download(0x1017, 0, (20).to_bytes(2, "little"))
    ctx.run_for(0.03)
    log.texts()
    for command, words, state in (
        (NmtCommand.START, "NMT start node 5", "Operational"),
        (NmtCommand.STOP, "NMT stop node 5", "Stopped"),
        (NmtCommand.ENTER_PRE_OPERATIONAL, "NMT enter pre-operational node 5", "Pre-operational"),
    ):
        node.nmt(command)
        log.texts(0x700 + NODE)
        ctx.run_for(0.021)
        log.says([f"heartbeat drive1 {state}"], 0x700 + NODE)
        node.nmt(command)
        log.says([words], 0)
    node.nmt(NmtCommand.RESET_NODE)
    ctx.run_for(0.3)
    found = log.texts(0, 0x700 + NODE)
    equal(ctx, f"reset and boot-up in {found}", {"NMT reset node 5", "boot-up drive1"} <= set(found), 1)
    node.send(0x80, b"")
    log.says(["SYNC"], 0x80)
    node.send(0x100, bytes(6))
    log.says(["TIME"], 0x100)


@CAMPAIGN.case("pdo")
def pdo(ctx: CaseContext) -> None:
    """Process data with names and values; a frame that is too short, its error, and what nobody knows."""
    node, log = started(ctx)
    node.nmt(NmtCommand.START)
    log.texts()
    node.send(0x200 + NODE, bytes((0x06, 0x00)))
    found = log.texts(0x200 + NODE, 0x180 + NODE)
    equal(
        ctx,
        f"both words are in {found}",
        found
        == [
            "RPDO1 drive1: Controlword 0006h (shutdown)",
            "TPDO1 drive1: Statusword 0231h (Ready to switch on)",
        ],
        1,
    )
    node.send(0x200 + NODE, b"\x0f")
    log.says(
        [
            "RPDO1 drive1: too short, 1 byte more",
            "EMCY drive1 8210h PDO not processed, too short, register 11h",
        ],
        0x200 + NODE,
        0x80 + NODE,
    )
    node.send(0x333, bytes((1, 2)))
    found = log.texts(0x333)
    equal(
        ctx, f"a frame of nobody: {found}", bool(found) and "333" in found[0] and "drive1" not in found[0], 1
    )


@CAMPAIGN.product(
    "emcy/{code:04x}",
    parameters=[
        {"code": 0x2310, "words": "continuous overcurrent", "register": 0x03},
        {"code": 0x3210, "words": "DC link overvoltage", "register": 0x05},
    ],
    title="EMCY {code:04X}h in the log",
)
def emergency(ctx: CaseContext, code: int, words: str, register: int) -> None:
    """Code, words and register of the error; the end of it is one too."""
    node, log = started(ctx)
    ctx.inject("drive.fault", "drive1", code=code)
    ctx.run_for(0.05)
    log.says([f"EMCY drive1 {code:04X}h {words}, register {register:02X}h"], 0x80 + NODE)
    for word in (0x00, 0x80):
        node.control(word)
    ctx.run_for(0.05)
    found = log.texts(0x80 + NODE)
    equal(
        ctx, f"the end of the error in {found}", bool(found) and found[-1].startswith("EMCY drive1 0000h"), 1
    )


FRAMES: Final[tuple[tuple[CanFrame, str], ...]] = (
    (CanFrame(0, b"\x01\x05"), "NMT start node 5"),
    (CanFrame(0, b"\x01\x00"), "NMT start all nodes"),
    (CanFrame(0, b"\x82\x09"), "NMT reset communication node 9"),
    (CanFrame(0, b"\x03\x05"), "NMT command 03h node 5"),
    (CanFrame(0, b"\x01"), "NMT malformed 01"),
    (CanFrame(0x80), "SYNC"),
    (CanFrame(0x80, b"\x0c"), "SYNC 12"),
    (CanFrame(0x100, bytes(6)), "TIME"),
    (CanFrame(0x705, b"\x05"), "heartbeat drive1 Operational"),
    (CanFrame(0x705, b"\x85"), "heartbeat drive1 Operational, toggle"),
    (CanFrame(0x705, b"\x84"), "heartbeat drive1 Stopped, toggle"),
    (CanFrame(0x705, b"\x03"), "heartbeat drive1 state 3"),
    (CanFrame(0x705, b"\x05\x00"), "error control drive1 malformed 05 00"),
    (CanFrame(0x709, b"\x7f"), "heartbeat node 9 Pre-operational"),
    (CanFrame(0x709, b"\x00"), "boot-up node 9"),
    (CanFrame(0x705, remote=True, dlc=1), "guarding request drive1"),
    (CanFrame(0x709, remote=True, dlc=1), "guarding request node 9"),
    (CanFrame(0x185, remote=True, dlc=2), "request for TPDO1 drive1"),
    (CanFrame(0x333, remote=True), "remote frame 333h"),
    (CanFrame(0x085, bytes((0x10, 0x23, 3, 1, 2, 0, 0, 0))),
     "EMCY drive1 2310h continuous overcurrent, register 03h, data 01 02 00 00 00"),
    (CanFrame(0x085, bytes((0x10, 0x23, 3))), "EMCY drive1 malformed 10 23 03"),
    (CanFrame(0x089, bytes(8)), "EMCY node 9 0000h error reset or no error, register 00h"),
    (CanFrame(0x605, b"\x40\x00"), "SDO drive1 malformed 40 00"),
    (CanFrame(0x185, b"\x37\2\xaa"), "TPDO1 drive1: Statusword 0237h (Operation enabled), 1 byte more"),
    (CanFrame(0x185, bytes((0x37,))), "TPDO1 drive1: too short, 1 byte more"),
    (CanFrame(0x12345678, b"\1\2", extended=True), repr(CanFrame(0x12345678, b"\1\2", extended=True))),
    (CanFrame(0x333, b"\1"), repr(CanFrame(0x333, b"\1"))),
)  # fmt: skip
"""Frames and the words for them, for a drive that has the state in its first PDO."""


@CAMPAIGN.case("words", requirements=("C301-016", "C301-023", "C301-108"))
def frames_in_words(ctx: CaseContext) -> None:
    """Each kind of frame has its words, whole, with the parts that are missing, and of nodes nobody knows."""
    for frame, words in FRAMES:
        found = str(ctx.bench.decode(frame))
        equal(ctx, f"{frame} is {words!r} (it is {found!r})", found == words, 1)


def _written(index: int, sub: int, value: int, size: int) -> tuple[CanFrame, CanFrame]:
    """Return request and answer of an expedited download to node 33."""
    mux = index.to_bytes(2, "little") + bytes((sub,))
    data = bytes((0x23 | (4 - size) << 2,)) + mux + value.to_bytes(size, "little").ljust(4, b"\0")
    return CanFrame(0x600 + DEVICE, data), CanFrame(0x580 + DEVICE, b"\x60" + mux + bytes(4))


@CAMPAIGN.case("learnt", requirements=("C301-051", "C301-140", "C301-141"))
def learnt(ctx: CaseContext) -> None:
    """Which PDO carries what is learnt from the SDO writes on the bus, kept by `save`, lost by a boot-up
    without it and by `load`; identifiers of SYNC and EMCY follow; a write that is refused changes nothing.
    """
    decoder = FrameDecoder({DEVICE: "small", 9: "other"}, {DEVICE: dictionary()})

    def same(what: str, found: object, wanted: object, *ids: str) -> None:
        equal(ctx, f"{what} is {wanted!r} (it is {found!r})", found == wanted, 1, *ids)

    def write(*rows: tuple[int, int, int, int]) -> None:
        for row in rows:
            for frame in _written(*row):
                decoder.observe(frame)

    same(
        "identifiers",
        [decoder.pdo_ids.get(can_id) for can_id in (0x189, 0x209, 0x280 + DEVICE)],
        [9, 9, DEVICE],
    )
    same("identifier of SYNC", decoder.sync_id, 0x80)
    write((0x1801, 1, 0x2AA, 4), (0x1A01, 0, 0, 1), (0x1A01, 1, 0x60410010, 4), (0x1A01, 2, 0x60640020, 4),
          (0x1A01, 3, 0x00050008, 4), (0x1A01, 4, 0x60610008, 4), (0x1A01, 0, 4, 1))  # fmt: skip
    frame = CanFrame(0x2AA, bytes((0x37, 0x02)) + (-5 & 0xFFFFFFFF).to_bytes(4, "little") + b"\xee\xfe")
    values = [(0x604100, 0x237), (0x606400, -5), (0x000500, 0xEE), (0x606100, -2)]
    same("values", decoder.mapped(frame), (DEVICE, values), "C301-051")
    same("of a short one", decoder.mapped(CanFrame(0x2AA, frame.data[:6])), (DEVICE, values[:2]), "C301-054")
    same("of another frame", decoder.mapped(CanFrame(0x2AB, frame.data)), None)
    for other in (CanFrame(0x2AA, frame.data, extended=True), CanFrame(0x2AA, remote=True)):
        same("of no PDO", (decoder.mapped(other), decoder.fields(other)), (None, []))
    fields = [
        (one.object_index, one.sub, one.first_bit, one.bits, one.number, one.text)
        for one in decoder.fields(frame)
    ]
    wanted = [
        (0x6041, 0, 0, 16, 0x237, "0237h (Operation enabled)"),
        (0x6064, 0, 16, 32, 0xFFFFFFFB, "-5"),
        (0x6061, 0, 56, 8, 0xFE, "-2"),
    ]
    same("fields", fields, wanted, "C301-051")
    same("fields of a short one", len(decoder.fields(CanFrame(0x2AA, frame.data[:6]))), 2)
    same("length", (decoder.mapped_length(0x2AA), decoder.mapped_length(0x2AB)), (8, 0))
    same("mapping seen", (decoder.mapping_seen(0x2AA), decoder.mapping_seen(0x180 + DEVICE)), (True, False))
    request, _ = _written(0x1801, 1, 0x2BB, 4)
    decoder.observe(request)
    decoder.observe(CanFrame(0x580 + DEVICE, b"\x80\1\x18\1\0\0\2\6"))
    same("a refused write", (0x2AA in decoder.pdo_ids, 0x2BB in decoder.pdo_ids), (True, False))
    write((0x1801, 1, 1 << 31 | 0x2AA, 4))
    same("an invalid PDO", 0x2AA in decoder.pdo_ids, False)
    write((0x1801, 1, 0x2AA, 4), (0x1005, 0, 0x85, 4), (0x1014, 0, 0x90, 4))
    same(
        "SYNC and EMCY",
        (decoder.sync_id, decoder.emcy_node(0x90), decoder.emcy_node(0x89), decoder.emcy_node(0x85)),
        (0x85, DEVICE, 9, 0),
    )
    same("frames in words", [decoder.decode(CanFrame(can_id)) for can_id in (0x85,)], ["SYNC"])
    write((0x1010, 1, int.from_bytes(b"save", "little"), 4), (0x1A01, 0, 1, 1))
    same("length before the boot-up", decoder.mapped_length(0x2AA), 2)
    decoder.observe(CanFrame(0x700 + DEVICE, b"\0"))
    same(
        "what was saved is there",
        (decoder.mapped_length(0x2AA), decoder.sync_id, decoder.mapping_seen(0x2AA)),
        (8, 0x85, False),
        "C301-140",
    )
    write((0x1011, 1, int.from_bytes(b"load", "little"), 4))
    decoder.observe(CanFrame(0x700 + DEVICE, b"\0"))
    same(
        "the defaults are back",
        (0x2AA in decoder.pdo_ids, decoder.sync_id, 0x280 + DEVICE in decoder.pdo_ids),
        (False, 0x80, True),
        "C301-141",
    )
    decoder.set_mapping(9, {(0x1800, 1): 0x333, (0x1A00, 0): 1, (0x1A00, 1): 0x60640020})
    same("given values", decoder.mapped(CanFrame(0x333, b"\5\0\0\0")), (9, [(0x606400, 5)]))
    same("a frame of CAN FD", decoder.mapped(CanFrame(0x333, bytes(8), fd=True)), None)
    for index, sub, data, text in (
        (0x6040, 0, b"\x0f\0", "000Fh (enable operation)"),
        (0x6060, 0, b"\x08", "8 (csp)"),
        (0x1010, 1, b"save", "'save'"),
        (0x1017, 0, b"\xf4\1", "500"),
        (0x607A, 0, b"\xff\xff\xff\xff", "-1"),
        (0x2008, 0, b"\0\0\0\x3f", "0.5"),
        (0x1008, 0, b"name", "'name'"),
        (0x5FFF, 0, b"\x12\x34", "3412h"),
        (0x5FFF, 0, b"", "empty"),
    ):
        same(f"{data.hex()} of {index:04X}h in words", decoder.value_text(DEVICE, index, sub, data), text)
