"""CANopen services of a drive under a plain master: SDO frame by frame, PDO, EMCY, memory, LSS."""

from __future__ import annotations

from binascii import crc_hqx
from itertools import pairwise
from typing import Final

from fieldbus.canopen import NmtCommand
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._led_servo import DRIVE, NODE, Node, words

CAMPAIGN: Final = Campaign(
    "canopen services", controller="", tags=("canopen",), bench="testcases.campaigns._led_servo:BENCH"
)

NAME: Final = b"Emulated servo drive CiA 402"
TOGGLE, TIMEOUT, COMMAND, BLOCK_SIZE = 0x05030000, 0x05040000, 0x05040001, 0x05040002
WRITE_ONLY, READ_ONLY, NO_OBJECT, NOT_MAPPABLE = 0x06010001, 0x06010002, 0x06020000, 0x06040041
PDO_LENGTH, PARAMETER, LENGTH, TOO_LONG, TOO_SHORT = (
    0x06040042,
    0x06040043,
    0x06070010,
    0x06070012,
    0x06070013,
)
NO_SUB, RANGE, STATE, NO_DATA, SIGNATURE = 0x06090011, 0x06090030, 0x08000022, 0x08000024, 0x08000020
_CLAUSES: Final = {
    TOGGLE: "C301-077",
    TIMEOUT: "C301-078",
    COMMAND: "C301-079",
    BLOCK_SIZE: "C301-080",
    0x05040003: "C301-081",
    0x05040004: "C301-082",
    WRITE_ONLY: "C301-085",
    READ_ONLY: "C301-086",
    NO_OBJECT: "C301-087",
    NOT_MAPPABLE: "C301-088",
    PDO_LENGTH: "C301-089",
    PARAMETER: "C301-090",
    LENGTH: "C301-093",
    TOO_LONG: "C301-094",
    TOO_SHORT: "C301-095",
    NO_SUB: "C301-096",
    RANGE: "C301-097",
    0x06090031: "C301-098",
    0x06090032: "C301-099",
    0x06090036: "C301-100",
    0x060A0023: "C301-101",
    SIGNATURE: "C301-103",
    STATE: "C301-105",
    NO_DATA: "C301-107",
}
SAVE, LOAD = int.from_bytes(b"save", "little"), int.from_bytes(b"load", "little")


def clauses(code: int) -> tuple[str, ...]:
    """Return the identifiers of an abort code; none for 0, which is no abort."""
    return (_CLAUSES[code],) if code in _CLAUSES else ()


class Raw:
    """The SDO server of a drive, asked frame by frame.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self._ctx = ctx
        self.node = Node(ctx)
        self.node.listen(0x580 + NODE, 0x700 + NODE, 0x80 + NODE)

    def ask(self, data: bytes) -> bytes:
        """Send a request, return the answer."""
        return self.node.ask(0x600 + NODE, data.ljust(8, b"\0"), 0x580 + NODE)

    def expect(self, request: bytes, answer: bytes, *ids: str) -> None:
        """Expect an answer, byte for byte."""
        found = self.ask(request)
        self._ctx.do(f"SDO {request.hex(' ')}: {found.hex(' ')}")
        self.node.equal(
            f"answer to {request.hex(' ')} is {answer.hex(' ')}", found == answer.ljust(8, b"\0"), 1, *ids
        )

    def aborts(self, request: bytes, code: int) -> None:
        """Expect an abort with a code, for the object of the request."""
        found, ids = self.ask(request), clauses(code)
        self.node.equal(f"command of the answer to {request.hex(' ')}", found[0] if found else 0, 0x80, *ids)
        self.node.equal("abort code", int.from_bytes(found[4:], "little"), code, *ids)


def head(command: int, index: int, sub: int = 0) -> bytes:
    """Return the first four bytes of an SDO frame."""
    return bytes((command,)) + index.to_bytes(2, "little") + bytes((sub,))


def number(value: int) -> bytes:
    """Return four bytes."""
    return (value & 0xFFFFFFFF).to_bytes(4, "little")


# -- SDO ---------------------------------------------------------------------------------------------------


@CAMPAIGN.product(
    "sdo/expedited-{size}",
    parameters=[
        {"size": 1, "index": 0x6060, "value": 3},
        {"size": 2, "index": 0x605D, "value": 2},
        {"size": 4, "index": 0x6083, "value": 0x01ABCDEF},
    ],
    title="expedited transfer of {size} bytes",
    requirements=("C301-057",),
)
def expedited(ctx: CaseContext, size: int, index: int, value: int) -> None:
    """Download with and without size, upload: the bytes of the value and the number of unused ones."""
    raw = Raw(ctx)
    data = number(value)
    raw.expect(head(0x23 | (4 - size) << 2, index) + data, head(0x60, index), "C301-057")
    raw.expect(head(0x40, index), head(0x43 | (4 - size) << 2, index) + data, "C301-057")
    raw.expect(head(0x22, index) + number(1), head(0x60, index), "C301-057")
    raw.expect(head(0x40, index), head(0x43 | (4 - size) << 2, index) + number(1), "C301-057")
    wrong = 1 if size == 2 else 2
    raw.aborts(head(0x23 | (4 - wrong) << 2, index) + data, LENGTH)


@CAMPAIGN.case("sdo/segmented-upload", requirements=("C301-060", "C301-061", "C301-072"))
def segmented_upload(ctx: CaseContext) -> None:
    """Segments alternate the toggle bit, the last one is marked and padded; a repeated toggle aborts."""
    raw = Raw(ctx)
    raw.expect(head(0x40, 0x1008), head(0x41, 0x1008) + number(len(NAME)), "C301-060")
    for part in range(4):
        last = part == 3
        raw.expect(
            bytes((0x60 | (part & 1) << 4,)),
            bytes(((part & 1) << 4 | last,)) + NAME[7 * part : 7 * part + 7],
            "C301-061",
        )
    raw.aborts(b"\x60", COMMAND)
    raw.ask(head(0x40, 0x1008))
    raw.ask(b"\x60")
    raw.aborts(b"\x60", TOGGLE)
    raw.aborts(b"\x70", COMMAND)


@CAMPAIGN.product(
    "sdo/block-upload-{size}",
    parameters={"size": (1, 2, 127)},
    title="block upload with {size} segments in a block",
    requirements=("C301-066", "C301-067", "C301-068", "C301-069"),
)
def block_upload(ctx: CaseContext, size: int) -> None:
    """Blocks of so many segments with sequence numbers, the length of the last one, and the checksum."""
    raw = Raw(ctx)
    node = raw.node
    raw.expect(head(0xA4, 0x1008) + bytes((size, 0)), head(0xC6, 0x1008) + number(len(NAME)), "C301-066")
    content, left = b"", 4
    request = b"\xa3"
    while left:
        node.taken(0x580 + NODE)
        node.send(0x600 + NODE, request.ljust(8, b"\0"))
        ctx.run_for(0.03)
        block = node.taken(0x580 + NODE)
        sent = min(size, left)
        numbers = [frame[0] & 0x7F for frame in block]
        node.equal("sequence numbers", numbers == list(range(1, sent + 1)), 1, "C301-067")
        node.equal(
            "only the last one is marked", [f[0] >> 7 for f in block] == [0] * (sent - 1) + [left == sent], 1
        )
        content += b"".join(frame[1:] for frame in block)
        left -= sent
        request = bytes((0xA2, sent, size))
    node.equal("content", content[: len(NAME)] == NAME, 1, "C301-067")
    found = raw.ask(request)
    node.equal("end of the upload", found[0], 0xC1 | (28 - len(NAME)) << 2, "C301-068")
    node.equal("checksum", int.from_bytes(found[1:3], "little"), crc_hqx(NAME, 0), "C301-069")
    node.send(0x600 + NODE, b"\xa1".ljust(8, b"\0"))
    raw.expect(head(0x40, 0x1000), head(0x43, 0x1000) + number(0x00020192))


@CAMPAIGN.case("sdo/block-again", requirements=("C301-070", "C301-071"))
def block_again(ctx: CaseContext) -> None:
    """Segments that were not acknowledged come again; wrong block sizes and sequence numbers abort."""
    raw = Raw(ctx)
    node = raw.node
    for wrong in (0, 128):
        raw.aborts(head(0xA4, 0x1008) + bytes((wrong, 0)), BLOCK_SIZE)
    raw.ask(head(0xA4, 0x1008) + b"\x03\0")
    node.send(0x600 + NODE, b"\xa3".ljust(8, b"\0"))
    ctx.run_for(0.03)
    node.taken(0x580 + NODE)
    node.send(0x600 + NODE, b"\xa2\x01\x02".ljust(8, b"\0"))
    ctx.run_for(0.03)
    again = node.taken(0x580 + NODE)
    node.equal(
        "segments after the acknowledged one", b"".join(f[1:] for f in again) == NAME[7:21], 1, "C301-070"
    )
    raw.aborts(b"\xa2\x05\x02", 0x05040003)
    raw.expect(head(0xA4, 0x6040) + b"\x7f\x04", head(0x4B, 0x6040), "C301-071")


ABORTS: Final[dict[str, tuple[bytes, int]]] = {
    "no-object": (head(0x40, 0x5FFF), NO_OBJECT),
    "no-object-written": (head(0x23, 0x5FFF), NO_OBJECT),
    "no-sub-index": (head(0x40, 0x1018, 9), NO_SUB),
    "no-sub-index-of-a-variable": (head(0x40, 0x6040, 1), NO_SUB),
    "read-only": (head(0x23, 0x1000), READ_ONLY),
    "read-only-actual-value": (head(0x23, 0x6064), READ_ONLY),
    "too-long": (head(0x23, 0x6040), LENGTH),
    "too-short": (head(0x2F, 0x6083), LENGTH),
    "out-of-range": (head(0x2F, 0x6060) + b"\x05", RANGE),
    "no-data": (head(0x40, 0x1003, 1), NO_DATA),
    "history-not-zero": (head(0x2F, 0x1003) + b"\x01", RANGE),
    "signature": (head(0x23, 0x1010, 1) + b"evas", SIGNATURE),
    "signature-of-defaults": (head(0x23, 0x1011, 1) + b"dola", SIGNATURE),
    "command": (head(0xE0, 0x1000), COMMAND),
    "no-transfer": (b"\x60", COMMAND),
    "heartbeat-range": (head(0x2F, 0x1019) + b"\x01", RANGE),
}


@CAMPAIGN.product(
    "sdo/abort-{what}",
    parameters={"what": tuple(ABORTS)},
    title="abort code: {what}",
    requirements=("C301-072",),
)
def abort(ctx: CaseContext, what: str) -> None:
    """Each mistake has its own abort code, and the server goes on."""
    raw = Raw(ctx)
    request, code = ABORTS[what]
    raw.aborts(request, code)
    raw.expect(head(0x40, 0x1000), head(0x43, 0x1000) + number(0x00020192))


@CAMPAIGN.case("sdo/silent-client", requirements=("C301-072",))
def silent_client(ctx: CaseContext) -> None:
    """A transfer that its client gives up is aborted after the time-out, not before, and once."""
    raw = Raw(ctx)
    raw.ask(head(0x40, 0x1008))
    begun = ctx.now_s
    raw.node.taken(0x580 + NODE)
    ctx.wait_until(lambda: raw.node.times(0x580 + NODE), 10.0, "the server aborts")
    raw.node.equal("abort code", int.from_bytes(raw.node.taken(0x580 + NODE)[0][4:], "little"), TIMEOUT)
    raw.node.equal("time-out, s", ctx.now_s - begun, 1.0, "C301-072", within=0.9)
    ctx.run_for(2.0)
    raw.node.equal("aborts after that", len(raw.node.taken(0x580 + NODE)), 0)


@CAMPAIGN.product(
    "sdo/download-{how}",
    parameters={"how": ("segmented", "block")},
    title="{how} download of four bytes",
    requirements=("C301-058", "C301-059", "C301-063", "C301-064", "C301-065"),
)
def download(ctx: CaseContext, how: str) -> None:
    """A number may come in segments or in a block; the checksum and the toggle bit are checked."""
    raw = Raw(ctx)
    data = number(7_654_321)
    if how == "segmented":
        raw.expect(head(0x21, 0x6083) + number(4), head(0x60, 0x6083), "C301-058")
        raw.expect(bytes((0x01 | 3 << 1,)) + data, b"\x20", "C301-059")
        raw.ask(head(0x21, 0x6083) + number(4))
        raw.aborts(b"\x11", TOGGLE)
    else:
        for checksum, good in ((crc_hqx(data, 0), True), (crc_hqx(data, 0) ^ 1, False)):
            answer = raw.ask(head(0xC6, 0x6083) + number(4))
            raw.node.equal("block download begins", answer[0], 0xA4, "C301-063")
            raw.node.equal("segments in a block", answer[4], 64, within=63)
            raw.expect(b"\x81" + data, bytes((0xA2, 1, answer[4])), "C301-064")
            end = bytes((0xC1 | 3 << 2,)) + checksum.to_bytes(2, "little")
            if good:
                raw.expect(end, b"\xa1", "C301-065")
            else:
                raw.aborts(end, 0x05040004)
    raw.node.shows(0x6083, 7_654_321, "C301-058")


# -- NMT, heartbeat, EMCY ----------------------------------------------------------------------------------


@CAMPAIGN.case("nmt", requirements=("C301-016", "C301-017", "C301-022", "C301-023"))
def nmt(ctx: CaseContext) -> None:
    """Each command leads to its state, as the heartbeat shows; a reset sends the boot-up."""
    raw = Raw(ctx)
    node = raw.node
    node.listen(0x180 + NODE)
    node.write(0x1017, 20)
    states = {
        NmtCommand.START: 5,
        NmtCommand.STOP: 4,
        NmtCommand.ENTER_PRE_OPERATIONAL: 127,
    }
    for command in (*states, NmtCommand.START):
        node.nmt(command)
        node.taken(0x700 + NODE)
        node.taken(0x180 + NODE)
        ctx.run_for(0.05)
        beats = node.taken(0x700 + NODE)
        node.equal(f"state after {command.name}", beats[-1][0], states[command], "C301-016")
        node.equal("heartbeats in 50 ms", len(beats), 2.5, "C301-023", within=0.5)
        answer = raw.ask(head(0x40, 0x1000))
        node.equal("SDO is answered", len(answer) > 0, command is not NmtCommand.STOP, "C301-016")
    for wrong in (b"\x02", b"\x02\x05\x00", b"\x03\x05", b"\x00\x05", b""):
        node.send(0, wrong)
        node.taken(0x700 + NODE)
        ctx.run_for(0.05)
        beats = node.taken(0x700 + NODE)
        node.equal(f"state after {wrong.hex(' ')}", beats[-1][0], 5, "C301-017")
    for command in (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION):
        node.taken(0x700 + NODE)
        node.nmt(command)
        ctx.run_for(0.05)
        beats = node.taken(0x700 + NODE)
        node.equal("boot-up, and no heartbeat any more", beats == [b"\0"], 1, "C301-022")
        node.shows(0x1017, 0, signed=False)
        node.write(0x1017, 20)


@CAMPAIGN.product(
    "heartbeat-consumer/{time_ms}-{reaction}",
    parameters=[{"time_ms": 50, "reaction": 1}, {"time_ms": 120, "reaction": 0}],
    title="heartbeat of node 99 missing for {time_ms} ms, 6007h = {reaction}",
    requirements=("C301-026", "C301-123", "C402-050"),
)
def heartbeat_consumer(ctx: CaseContext, time_ms: int, reaction: int) -> None:
    """After the first heartbeat its absence is an error after the consumer time, not before."""
    node = Node(ctx)
    node.listen(0x80 + NODE)
    node.write(0x6007, reaction)
    node.write(0x1016, 99 << 16 | time_ms, 1)
    node.nmt(NmtCommand.START)
    ctx.run_for(0.3)
    node.equal("EMCYs before the first heartbeat", len(node.taken(0x80 + NODE)), 0, "C301-026")
    for _ in range(3):
        node.send(0x763, b"\x05")
        ctx.run_for(0.8 * time_ms / 1000)
    node.equal("EMCYs in time", len(node.times(0x80 + NODE)), 0, "C301-026")
    node.send(0x763, b"\x05")
    begun = ctx.now_s - 0.001
    ctx.wait_until(lambda: node.times(0x80 + NODE), 1.0, "the EMCY comes")
    node.equal(
        "time until the EMCY, s", node.times(0x80 + NODE)[0] - begun, time_ms / 1000, "C301-026", within=0.003
    )
    frames = node.taken(0x80 + NODE)
    node.equal("EMCY 8130h, register 11h", frames[0][:3] == b"\x30\x81\x11", 1, "C301-123")
    node.shows(0x1001, 0x11, "C301-112")
    node.equal("entry of 1003h", node.read(0x1003, 1, signed=False) & 0xFFFF, 0x8130)
    node.bits(0x08, 0x08 if reaction == 1 else 0, "C402-050")
    node.send(0x763, b"\x05")
    ctx.run_for(0.01)
    if reaction == 0:
        ends = node.taken(0x80 + NODE)
        node.equal("EMCY 0000h", ends != [] and ends[-1][:3] == b"\0\0\0", 1, "C301-109")
        node.shows(0x1001, 0)


@CAMPAIGN.product(
    "error-behaviour/{value}",
    parameters=[{"value": 0, "state": 127}, {"value": 1, "state": 5}, {"value": 2, "state": 4}],
    title="1029h:1 = {value} at a communication error",
    requirements=("C301-113",),
)
def error_behaviour(ctx: CaseContext, value: int, state: int) -> None:
    """1029h says into which state a communication error takes the node; NMT start takes it back, although
    the error register still shows the error.
    """
    node = Node(ctx)
    node.listen(0x700 + NODE)
    node.configure({(0x1029, 1): value, (0x1016, 1): 99 << 16 | 50, 0x1017: 20})
    node.nmt(NmtCommand.START)
    node.send(0x763, b"\x05")
    ctx.run_for(0.12)
    node.equal("state", node.taken(0x700 + NODE)[-1][0], state, "C301-113")
    node.nmt(NmtCommand.START)
    ctx.run_for(0.05)
    node.equal("state after NMT start", node.taken(0x700 + NODE)[-1][0], 5)


@CAMPAIGN.case("node-guarding", requirements=("C301-028", "C301-029"))
def node_guarding(ctx: CaseContext) -> None:
    """Every answer to a remote frame has the state and a toggled bit 7; silence of the master is an error."""
    node = Node(ctx)
    node.listen(0x700 + NODE, 0x80 + NODE)
    master = ctx.bench.network()
    node.configure({0x100C: 20, 0x100D: 3})
    node.nmt(NmtCommand.START)
    node.taken(0x700 + NODE)
    answers = []
    for _ in range(4):
        master.send_remote(0x700 + NODE, 1)
        ctx.run_for(0.02)
        answers += node.taken(0x700 + NODE)
    node.equal("states and toggle bits", [a[0] for a in answers] == [0x05, 0x85, 0x05, 0x85], 1, "C301-028")
    begun = ctx.now_s - 0.02
    ctx.wait_until(lambda: node.times(0x80 + NODE), 1.0, "the EMCY comes")
    node.equal("life time, s", node.times(0x80 + NODE)[0] - begun, 0.06, "C301-029", within=0.003)
    node.equal("EMCY 8130h", node.taken(0x80 + NODE)[0][:2] == b"\x30\x81", 1)
    master.send_remote(0x700 + NODE, 1)
    ctx.run_for(0.02)
    node.nmt(NmtCommand.RESET_COMMUNICATION)
    ctx.run_for(0.05)
    answers = []
    for _ in range(2):
        node.taken(0x700 + NODE)
        master.send_remote(0x700 + NODE, 1)
        ctx.run_for(0.005)
        answers += node.taken(0x700 + NODE)
    node.equal("toggle bits after the reset", [a[0] for a in answers] == [0x7F, 0xFF], 1, "C301-028")


@CAMPAIGN.case("emcy", requirements=("C301-109", "C301-111", "C301-112"))
def emcy(ctx: CaseContext) -> None:
    """Code, register, history with the newest first, its deletion, inhibit time, and 1014h switched off."""
    node = Node(ctx)
    node.listen(0x80 + NODE)
    for code, register in ((0x4310, 0x09), (0x3210, 0x0D)):
        ctx.inject("drive.fault", DRIVE, code=code)
        ctx.run_for(0.02)
        frame = node.taken(0x80 + NODE)[0]
        node.equal("code", int.from_bytes(frame[:2], "little"), code, "C301-109")
        node.equal("register", frame[2], register, "C301-112")
        node.shows(0x1001, register, "C301-112")
    node.shows(0x1003, 2)
    node.equal("newest", node.read(0x1003, 1, signed=False) & 0xFFFF, 0x3210, "C301-111")
    node.equal("older", node.read(0x1003, 2, signed=False) & 0xFFFF, 0x4310, "C301-111")
    node.write(0x1003, 0)
    node.shows(0x1003, 0)
    node.shows(0x1001, 0x0D)
    node.control(0x80, 0.02)
    ends = node.taken(0x80 + NODE)
    node.equal("last EMCY is 0000h 00h", ends[-1][:3] == b"\0\0\0", 1, "C301-109")
    node.shows(0x1001, 0)
    node.control(0x00)
    # With an inhibit time every EMCY keeps its distance from the one before.
    node.write(0x1015, 150)
    ctx.run_for(0.05)
    node.taken(0x80 + NODE)
    for code in (0x4310, 0x3210, 0x2310, 0x8611):
        ctx.inject("drive.fault", DRIVE, code=code)
    ctx.run_for(0.1)
    gaps = [b - a for a, b in pairwise(node.times(0x80 + NODE))]
    node.equal(f"EMCYs within the inhibit time {len(gaps)}", len(gaps) >= 3, 1)
    for gap in gaps:
        node.equal("distance of EMCYs, s", gap, 0.015, "C301-110", within=0.001)
    node.control(0x80, 0.1)
    node.control(0x00)
    node.write(0x1015, 0)
    node.write(0x1003, 0)
    node.taken(0x80 + NODE)
    node.write(0x1014, 1 << 31 | 0x80 + NODE)
    ctx.inject("drive.fault", DRIVE, code=0x4310)
    ctx.run_for(0.05)
    node.equal("EMCYs when switched off", len(node.taken(0x80 + NODE)), 0)
    node.shows(0x1001, 0x09)
    node.shows(0x1003, 1)


# -- PDO ---------------------------------------------------------------------------------------------------


def mapped(ctx: CaseContext, kind: int) -> Node:
    """Return a drive whose TPDO1 has status word and position, with a transmission type, started."""
    node = Node(ctx)
    node.listen(0x180 + NODE, 0x80 + NODE)
    for other in (2, 3, 4):
        node.write(0x1800 + other - 1, 3 << 30 | 0x80 + 0x100 * other + NODE, 1)
    node.map_pdo(1, (0x60410010, 0x60640020), kind, transmit=True)
    return node


def syncs(ctx: CaseContext, node: Node, count: int, period_s: float = 0.01) -> None:
    """Send SYNC so often."""
    for _ in range(count):
        node.send(0x80, b"")
        ctx.run_for(period_s - 0.001)


@CAMPAIGN.product(
    "tpdo/sync-{kind}",
    parameters=[{"kind": 1, "frames": 12}, {"kind": 3, "frames": 4}, {"kind": 240, "frames": 0}],
    title="TPDO with every SYNC number {kind}",
    requirements=("C301-039",),
)
def tpdo_sync(ctx: CaseContext, kind: int, frames: int) -> None:
    """Types 1 to 240 come with every n-th SYNC, and outside of Operational never."""
    node = mapped(ctx, kind)
    syncs(ctx, node, 4)
    node.equal("frames in Pre-operational", len(node.taken(0x180 + NODE)), 0, "C301-056")
    node.nmt(NmtCommand.START)
    node.taken(0x180 + NODE)
    syncs(ctx, node, 12)
    found = node.taken(0x180 + NODE)
    node.equal("frames for 12 SYNCs", len(found), frames, "C301-039")
    if found:
        node.equal("length", len(found[0]), 6)
        node.equal("status word", int.from_bytes(found[0][:2], "little"), node.read(0x6041, signed=False))
        node.equal("position", int.from_bytes(found[0][2:], "little", signed=True), node.read(0x6064))


@CAMPAIGN.case("tpdo/event", requirements=("C301-044", "C301-047", "C301-048"))
def tpdo_event(ctx: CaseContext) -> None:
    """Type 255 follows changes, not more often than the inhibit time and not less often than the timer."""
    node = mapped(ctx, 255)
    node.map_pdo(1, (0x60410010,), 255, transmit=True)
    node.write(0x6007, 0)
    node.nmt(NmtCommand.START)
    ctx.run_for(0.05)
    node.taken(0x180 + NODE)
    node.control(0x06)
    node.control(0x07)
    found = [int.from_bytes(data, "little") & 0x6F for data in node.taken(0x180 + NODE)]
    node.equal("status words are 21h, 23h", found == [0x21, 0x23], 1, "C301-044")
    node.write(0x1800, 40, 5)
    begun = ctx.now_s
    ctx.run_for(0.13)
    times = [time_s - begun for time_s in node.times(0x180 + NODE)]
    node.equal("frames of the timer", len(times), 3, "C301-048")
    for count, time_s in enumerate(times, 1):
        node.equal("time of a frame, s", time_s, 0.04 * count, "C301-048", within=0.003)
    # An event in between restarts the timer.
    ctx.run_for(0.015)
    node.taken(0x180 + NODE)
    ctx.run_for(0.012)
    begun = ctx.now_s
    node.control(0x06, 0.05)
    times = [time_s - begun for time_s in node.times(0x180 + NODE)]
    node.equal("time of the event, s", times[0], 0.0, "C301-048", within=0.002)
    node.equal("time of the timer behind it, s", times[1] - times[0], 0.04, "C301-048", within=0.002)
    node.control(0x07)
    node.write(0x1800, 0, 5)
    node.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
    node.write(0x1800, 1 << 31 | 0x180 + NODE, 1)
    node.write(0x1800, 500, 3)
    node.write(0x1800, 0x180 + NODE, 1)
    node.nmt(NmtCommand.START)
    ctx.run_for(0.1)
    node.taken(0x180 + NODE)
    for word in (0x06, 0x07, 0x06, 0x07, 0x06):
        node.control(word, 0.001)
        ctx.run_for(0.004)
    ctx.run_for(0.1)
    times = node.times(0x180 + NODE)
    gaps = [b - a for a, b in pairwise(times)]
    node.equal("frames", len(times) >= 2, 1)
    node.equal("shortest gap, s", min(gaps), 0.05, "C301-047", within=0.0015)
    node.equal(
        "last status word", int.from_bytes(node.taken(0x180 + NODE)[-1], "little") & 0x6F, 0x21, "C301-047"
    )


@CAMPAIGN.product(
    "tpdo/remote-{kind}",
    parameters={"kind": (252, 253)},
    title="TPDO on request, type {kind}",
    requirements=("C301-041", "C301-042"),
)
def tpdo_remote(ctx: CaseContext, kind: int) -> None:
    """Types 252 and 253 are sent on request alone: as the last SYNC has sampled, or as it is now."""
    node = mapped(ctx, kind)
    node.nmt(NmtCommand.START)
    syncs(ctx, node, 2)
    node.control(0x06)
    node.equal(
        "frames without a request",
        len(node.taken(0x180 + NODE)),
        0,
        "C301-041" if kind == 252 else "C301-042",
    )
    ctx.bench.network().send_remote(0x180 + NODE, 6)
    ctx.run_for(0.01)
    found = node.taken(0x180 + NODE)
    node.equal("frames", len(found), 1, "C301-041" if kind == 252 else "C301-042")
    state = int.from_bytes(found[0][:2], "little") & 0x6F
    node.equal(
        "status word",
        state,
        0x40 if kind == 252 else 0x21,
        "C301-041" if kind == 252 else "C301-042",
        within=0x20 if kind == 252 else 0,
    )


@CAMPAIGN.product(
    "rpdo/length-{size}",
    parameters=[
        {"size": 5, "code": 0x8210, "acts": 0},
        {"size": 6, "code": 0, "acts": 1},
        {"size": 8, "code": 0x8220, "acts": 1},
    ],
    title="RPDO of {size} bytes for a mapping of 6",
    requirements=("C301-054", "C301-112", "C301-127"),
)
def rpdo_length(ctx: CaseContext, size: int, code: int, acts: int) -> None:
    """A short one is not processed (8210h), of a long one the mapped bytes are (8220h), each told once."""
    node = mapped(ctx, 255)
    node.map_pdo(1, (0x60400010, 0x607A0020), 255, transmit=False)
    node.nmt(NmtCommand.START)
    ctx.run_for(0.01)
    node.taken(0x80 + NODE)
    for _ in range(2):
        node.send(0x200 + NODE, (words(0x06) + number(-1234)).ljust(8, b"\x55")[:size])
        ctx.run_for(0.01)
    node.shows(0x607A, -1234 if acts else 0, "C301-054")
    node.bits(0x6F, 0x21 if acts else 0x40, "C301-054")
    emcys = [int.from_bytes(data[:2], "little") for data in node.taken(0x80 + NODE)]
    node.equal("EMCY once", emcys == ([code] if code else []), 1, "C301-127")
    if code:
        register = node.read(0x1001, signed=False)
        node.equal("communication error in 1001h", register & 0x10, 0x10, "C301-112")
        node.send(0x200 + NODE, words(0x06) + number(99))
        ctx.run_for(0.01)
        node.shows(0x607A, 99)
        node.equal("EMCY 0000h", node.taken(0x80 + NODE)[-1][:2] == b"\0\0", 1, "C301-054")


@CAMPAIGN.case("rpdo/sync", requirements=("C301-035", "C301-039"))
def rpdo_sync(ctx: CaseContext) -> None:
    """A synchronous RPDO counts with the next SYNC, the later of two, and not outside of Operational."""
    node = mapped(ctx, 255)
    node.map_pdo(1, (0x60400010, 0x607A0020), 1, transmit=False)
    node.send(0x200 + NODE, words(0x06) + number(5))
    syncs(ctx, node, 1)
    node.shows(0x607A, 0, "C301-056")
    node.nmt(NmtCommand.START)
    for value in (11, 22):
        node.send(0x200 + NODE, words(0x06) + number(value))
    node.shows(0x607A, 0, "C301-035")
    syncs(ctx, node, 1)
    node.shows(0x607A, 22, "C301-035")
    node.write(0x607A, 33)
    syncs(ctx, node, 1)
    node.shows(0x607A, 33, "C301-035")


@CAMPAIGN.product(
    "rpdo/time-out-{time_ms}",
    parameters={"time_ms": (30, 90)},
    title="RPDO missing for {time_ms} ms",
    requirements=("C301-049",),
)
def rpdo_timeout(ctx: CaseContext, time_ms: int) -> None:
    """From its first reception on an RPDO has to come within its event time; else EMCY 8250h."""
    node = mapped(ctx, 255)
    node.map_pdo(1, (0x60400010, 0x607A0020), 255, transmit=False)
    node.write(0x1400, time_ms, 5)
    node.nmt(NmtCommand.START)
    ctx.run_for(0.2)
    node.taken(0x80 + NODE)
    for _ in range(3):
        node.send(0x200 + NODE, words(0x06) + number(1))
        ctx.run_for(0.8 * time_ms / 1000)
    node.equal("EMCYs in time", len(node.times(0x80 + NODE)), 0, "C301-049")
    node.send(0x200 + NODE, words(0x06) + number(1))
    begun = ctx.now_s - 0.001
    ctx.wait_until(lambda: node.times(0x80 + NODE), 1.0, "the EMCY comes")
    node.equal(
        "time until the EMCY, s", node.times(0x80 + NODE)[0] - begun, time_ms / 1000, "C301-049", within=0.002
    )
    node.equal("EMCY 8250h", node.taken(0x80 + NODE)[0][:2] == b"\x50\x82", 1, "C301-049")
    node.send(0x200 + NODE, words(0x06) + number(1))
    ctx.run_for(0.01)
    node.equal("EMCY 0000h", node.taken(0x80 + NODE)[-1][:2] == b"\0\0", 1, "C301-049")


@CAMPAIGN.case("rpdo/two-missing", requirements=("C301-049", "C301-109"))
def two_missing(ctx: CaseContext) -> None:
    """The error of overdue RPDOs comes once, and ends with the last of them that has come, in either
    order.
    """
    node = mapped(ctx, 255)
    data = {1: words(0x06) + number(1), 2: number(0)}
    node.map_pdo(1, (0x60400010, 0x607A0020), 255, transmit=False)
    node.map_pdo(2, (0x60FF0020,), 255, transmit=False)
    for one, time_ms in ((1, 20), (2, 30)):
        node.write(0x1400 + one - 1, time_ms, 5)
    node.nmt(NmtCommand.START)
    for order in ((1, 2), (2, 1)):
        for one in order:
            node.send(0x100 + 0x100 * one + NODE, data[one])
        ctx.run_for(0.01)
        node.taken(0x80 + NODE)
        ctx.run_for(0.05)
        found = [one[:2].hex() for one in node.taken(0x80 + NODE)]
        node.equal(f"EMCYs of two that are missing {found}", found == ["5082"], 1, "C301-049")
        for one, wanted in zip(order, ([], ["0000"]), strict=True):
            node.send(0x100 + 0x100 * one + NODE, data[one])
            ctx.run_for(0.002)
            found = [one[:2].hex() for one in node.taken(0x80 + NODE)]
            node.equal(f"EMCYs when RPDO{one} has come {found}", found == wanted, 1, "C301-109")


MAPPING: Final[dict[str, tuple[int, int, int, int]]] = {
    "not-mappable": (0x1A00, 1, 0x10080020, NOT_MAPPABLE),
    "no-object": (0x1A00, 1, 0x5FFF0020, NO_OBJECT),
    "wrong-length": (0x1A00, 1, 0x60410020, NOT_MAPPABLE),
    "too-many": (0x1A00, 0, 9, PDO_LENGTH),
    "write-only-direction": (0x1600, 1, 0x60410010, NOT_MAPPABLE),
    "type": (0x1800, 2, 245, RANGE),
}


@CAMPAIGN.product(
    "mapping/{what}",
    parameters={"what": tuple(MAPPING)},
    title="mapping is refused: {what}",
    requirements=("C301-051", "C301-052"),
)
def mapping(ctx: CaseContext, what: str) -> None:
    """A mapping that cannot be is refused with its abort code, and changes nothing."""
    node = mapped(ctx, 255)
    index, sub, value, code = MAPPING[what]
    direction = 0x1800 if index >= 0x1800 else 0x1400
    base = (0x180 if direction == 0x1800 else 0x200) + NODE
    node.write(direction, 1 << 31 | base, 1)
    if index in (0x1A00, 0x1600):
        node.write(index, 0)
    found = node.try_write(index, value, sub)
    node.equal("is refused", found != 0, 1)
    node.equal("abort code", found, code, within=1)
    node.write(direction, base, 1)
    if index in (0x1A00, 0x1600):
        node.equal("a valid PDO is locked", node.try_write(index, 0x60410010, 1) != 0, 1, "C301-052")


# -- SYNC, TIME, store, LSS --------------------------------------------------------------------------------


@CAMPAIGN.case("store", requirements=("C301-140", "C301-141"))
def store(ctx: CaseContext) -> None:
    """What was stored is there after a reset, what was not is not; the defaults come back after `load`."""
    node = Node(ctx)
    default = {index: node.read(index) for index in (0x6083, 0x6084, 0x1017)}
    node.configure({0x6083: 1_234_567, 0x1017: 333})
    node.write(0x1010, SAVE, 1)
    node.write(0x6084, 7_654_321)
    node.nmt(NmtCommand.RESET_NODE)
    ctx.run_for(0.1)
    node.shows(0x6083, 1_234_567, "C301-140")
    node.shows(0x1017, 333, "C301-140")
    node.shows(0x6084, default[0x6084], "C301-140")
    node.write(0x1011, LOAD, 1)
    node.shows(0x6083, 1_234_567, "C301-141")
    node.nmt(NmtCommand.RESET_NODE)
    ctx.run_for(0.1)
    for index, value in default.items():
        node.shows(index, value, "C301-141")
    node.configure({0x6083: 1_111_111, 0x1017: 444})
    node.write(0x1010, SAVE, 3)
    node.nmt(NmtCommand.RESET_NODE)
    ctx.run_for(0.1)
    node.shows(0x6083, 1_111_111, "C301-140")
    node.shows(0x1017, default[0x1017], "C301-140")


@CAMPAIGN.case("reset-communication", requirements=("C301-018",))
def reset_communication(ctx: CaseContext) -> None:
    """Reset communication gives communication objects their defaults and leaves those of the drive."""
    node = Node(ctx)
    node.configure({0x6083: 1_234_567, 0x1017: 333, (0x1016, 1): 99 << 16 | 50})
    node.nmt(NmtCommand.RESET_COMMUNICATION)
    ctx.run_for(0.1)
    node.shows(0x6083, 1_234_567, "C301-018")
    node.shows(0x1017, 0, "C301-018")
    node.shows(0x1016, 0, "C301-018", sub=1)


class Lss:
    """A plain LSS master.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self.node = Node(ctx)
        self.node.listen(0x7E4)
        self.identity = [self.node.read(0x1018, sub, signed=False) for sub in range(1, 5)]

    def ask(self, service: int, content: bytes = b"") -> bytes:
        """Return the answer to a service; empty: there is none."""
        return self.node.ask(0x7E5, (bytes((service,)) + content).ljust(8, b"\0"), 0x7E4)

    def expect(self, service: int, content: bytes, answer: bytes, *ids: str) -> None:
        """Expect an answer, byte for byte; empty: none."""
        found = self.ask(service, content)
        wanted = answer.ljust(8, b"\0") if answer else b""
        self.node.equal(
            f"answer to LSS {service:02X}h {content.hex()} is {wanted.hex()}", found == wanted, 1, *ids
        )


@CAMPAIGN.case("lss/inquire", requirements=("C301-153", "C301-162"))
def lss_inquire(ctx: CaseContext) -> None:
    """Identity and node-ID are told in the configuration state alone."""
    lss = Lss(ctx)
    lss.expect(0x5E, b"", b"", "C301-153")
    lss.expect(0x04, b"\x01", b"", "C301-153")
    for part, value in enumerate(lss.identity):
        lss.expect(0x5A + part, b"", bytes((0x5A + part,)) + number(value), "C301-162")
    lss.expect(0x5E, b"", bytes((0x5E, NODE)), "C301-162")
    lss.expect(0x04, b"\x00", b"", "C301-153")
    lss.expect(0x5A, b"", b"", "C301-153")
    lss.node.send(0x7E5, b"\x04\x01")
    lss.expect(0x5E, b"", b"", "C301-011")


@CAMPAIGN.product(
    "lss/select-{wrong}",
    parameters={"wrong": ("none", "vendor", "product", "revision", "serial")},
    title="switch mode selective, wrong: {wrong}",
    requirements=("C301-154",),
)
def lss_select(ctx: CaseContext, wrong: str) -> None:
    """All four parts of the identity have to agree."""
    lss = Lss(ctx)
    names = ("vendor", "product", "revision", "serial")
    for part, value in enumerate(lss.identity):
        last = part == 3 and wrong == "none"
        lss.expect(0x40 + part, number(value ^ (names[part] == wrong)), b"\x44" if last else b"", "C301-154")
    lss.expect(0x5E, b"", bytes((0x5E, NODE)) if wrong == "none" else b"", "C301-154")


@CAMPAIGN.product(
    "lss/identify-{what}",
    parameters=[
        {"what": "inside", "low": (0, 0), "high": (0, 0), "found": True},
        {"what": "revision-above", "low": (1, 0), "high": (1, 0), "found": False},
        {"what": "revision-below", "low": (-1, 0), "high": (-1, 0), "found": False},
        {"what": "serial-above", "low": (0, 1), "high": (0, 9), "found": False},
        {"what": "serial-below", "low": (0, -9), "high": (0, -1), "found": False},
        {"what": "range", "low": (-1, -3), "high": (2, 4), "found": True},
    ],
    title="identify remote slave: {what}",
    requirements=("C301-159",),
)
def lss_identify(
    ctx: CaseContext, what: str, low: tuple[int, int], high: tuple[int, int], found: bool
) -> None:
    """Answered where revision and serial number lie in the ranges, ends included."""
    del what
    lss = Lss(ctx)
    vendor, product, revision, serial = lss.identity
    asked = (vendor, product, revision + low[0], revision + high[0], serial + low[1], serial + high[1])
    for step, value in enumerate(asked):
        lss.expect(0x46 + step, number(max(value, 0)), b"\x4f" if found and step == 5 else b"", "C301-159")
    lss.expect(0x4C, b"", b"", "C301-160")


@CAMPAIGN.case("lss/node-id", requirements=("C301-155", "C301-158", "C301-163"))
def lss_node_id(ctx: CaseContext) -> None:
    """A node-ID is checked, comes with reset communication, and stays if it was stored."""
    lss = Lss(ctx)
    node = lss.node
    node.listen(0x709, 0x705)
    lss.expect(0x11, b"\x09", b"", "C301-153")
    node.equal("boot-up after power-on", len(node.taken(0x705)), 1, "C301-022")
    lss.ask(0x04, b"\x01")
    for wanted, error in ((0, 1), (128, 1), (254, 1), (127, 0), (9, 0)):
        lss.expect(0x11, bytes((wanted,)), bytes((0x11, error)), "C301-155")
    lss.expect(0x5E, b"", bytes((0x5E, NODE)), "C301-155")
    lss.expect(0x13, b"\x00\x05", b"\x13\x01", "C301-156")
    lss.expect(0x13, b"\x00\x02", b"\x13\x00", "C301-156")
    lss.expect(0x13, b"\x00\x00", b"\x13\x00", "C301-156")
    lss.expect(0x17, b"", b"\x17\x00", "C301-158")
    lss.ask(0x04, b"\x00")
    node.nmt(NmtCommand.RESET_COMMUNICATION)
    ctx.run_for(0.1)
    node.equal("boot-up of node 9", len(node.taken(0x709)), 1, "C301-163")
    moved = Node(ctx, 9)
    moved.shows(0x1000, 0x00020192, "C301-163")
    moved.shows(0x1014, 0x89, "C301-163")
    moved.nmt(NmtCommand.RESET_NODE)
    ctx.run_for(0.1)
    node.equal("boot-up of node 9 again", len(node.taken(0x709)), 1, "C301-158")
    node.equal("boot-up of node 5", len(node.taken(0x705)), 0, "C301-158")


@CAMPAIGN.case("lss/fast-scan", requirements=("C301-161",))
def lss_fast_scan(ctx: CaseContext) -> None:
    """A node with a node-ID does not take part in fastscan; one without is found bit by bit."""
    lss = Lss(ctx)
    start = number(0) + bytes((0x80, 0, 0))
    lss.expect(0x51, start, b"", "C301-161")
    lss.ask(0x04, b"\x01")
    lss.expect(0x11, b"\xff", b"\x11\x00", "C301-155")
    lss.ask(0x04, b"\x00")
    lss.node.nmt(NmtCommand.RESET_COMMUNICATION)
    ctx.run_for(0.1)
    lss.expect(0x4C, b"", b"\x50", "C301-160")
    lss.expect(0x51, start, b"\x4f", "C301-161")
    for part, value in enumerate(lss.identity):
        known = 0
        for bit in range(31, -1, -1):
            answer = lss.ask(0x51, number(known) + bytes((bit, part, part)))
            if not answer:
                known |= 1 << bit
        lss.node.equal(f"part {part} of the identity", known, value, "C301-161")
        following = (part + 1) % 4
        lss.expect(0x51, number(value) + bytes((0, part, following)), b"\x4f", "C301-161")
    lss.expect(0x5E, b"", bytes((0x5E, 0xFF)), "C301-161")


@CAMPAIGN.case("sync-window", requirements=("C301-035",))
def sync_window(ctx: CaseContext) -> None:
    """With 1007h an RPDO that comes after the window does not count at the next SYNC."""
    node = mapped(ctx, 255)
    node.map_pdo(1, (0x60400010, 0x607A0020), 1, transmit=False)
    node.write(0x1007, 3000)
    node.nmt(NmtCommand.START)
    for delay_s, value, counts in ((0.001, 111, True), (0.006, 222, False)):
        node.send(0x80, b"")
        ctx.run_for(delay_s)
        node.send(0x200 + NODE, words(0x06) + number(value))
        ctx.run_for(0.004)
        node.send(0x80, b"")
        ctx.run_for(0.01)
        node.equal(f"RPDO {delay_s} s after SYNC counts", node.read(0x607A) == value, counts, "C301-035")


@CAMPAIGN.product(
    "sync-counter/{start}",
    parameters={"start": (0, 3)},
    title="SYNC counter, start value {start}",
    requirements=("C301-050",),
)
def sync_counter(ctx: CaseContext, start: int) -> None:
    """With a start value the PDO begins at the SYNC with that counter, and then comes with every second."""
    node = mapped(ctx, 255)
    node.write(0x1019, 10)
    node.write(0x1800, 1 << 31 | 0x180 + NODE, 1)
    node.write(0x1800, 2, 2)
    node.write(0x1800, start, 6)
    node.write(0x1800, 0x180 + NODE, 1)
    for counters, wanted in (
        (range(1, 9), [3, 5, 7] if start else [2, 4, 6, 8]),
        ((9, 10, *range(1, 8)), [3, 5, 7] if start else [10, 2, 4, 6]),
    ):
        node.nmt(NmtCommand.ENTER_PRE_OPERATIONAL)
        node.nmt(NmtCommand.START)
        node.taken(0x180 + NODE)
        came = []
        for counter in counters:
            node.send(0x80, bytes((counter,)))
            ctx.run_for(0.004)
            if node.taken(0x180 + NODE):
                came.append(counter)
        node.equal(f"SYNCs {came} are {wanted}", came == wanted, 1, "C301-050")
