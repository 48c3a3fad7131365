"""The CANopen master against a device that is written down: SDO dialogues byte for byte, what goes wrong when
a node is taken into service, and both ends of every time by which it is watched.

The device is a table of objects and a script of answers, so that it does what no emulated device would do.
"""

from __future__ import annotations

from binascii import crc_hqx
from dataclasses import dataclass, field
from typing import Any, Final

from fieldbus.can import CanFrame, CanMedium
from fieldbus.canopen import CanopenMaster, NmtCommand
from fieldbus.canopen.boot import BootState
from fieldbus.canopen.node_setup import NodeSetup, Parameter, PdoSetup
from fieldbus.errors import ConfigurationError
from fieldbus.history import History
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "canopen master", controller="", tags=("canopen",), bench="testcases.campaigns.can_bus:BENCH"
)
NODE: Final = 77
OBJECT: Final = "00 20 03"
"""2000h:3 in an SDO frame."""
MS: Final = 1_000_000
TIME_OUT_S: Final = 0.3
"""How long the master waits for an answer."""
TOGGLE, TIMED_OUT, BLOCK_SIZE, SEQUENCE, CRC = 0x05030000, 0x05040000, 0x05040002, 0x05040003, 0x05040004
COMMAND, NO_OBJECT, READ_ONLY, TOO_LONG, TOO_SHORT = (
    0x05040001,
    0x06020000,
    0x06010002,
    0x06070012,
    0x06070013,
)
GENERAL, NO_RESOURCE, WRITE_ONLY = 0x08000000, 0x060A0023, 0x06010001


class Rig:
    """A master and a place for a device on a segment of their own.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self.ctx = ctx
        own: Any = ctx.bench.segment("can0")
        self.scheduler = own.scheduler
        self.segment = CanMedium(self.scheduler, name="lab")
        self.history = History(self.scheduler)
        self.master = CanopenMaster(self.scheduler, self.segment, history=self.history)

    def run_ms(self, milliseconds: float) -> None:
        """Let time pass."""
        self.ctx.run_for(milliseconds * 1e-3)

    def is_so(self, what: str, found: object, wanted: object, *ids: str) -> None:
        """Expect a value of any kind."""
        equal(self.ctx, f"{what} is {wanted} (it is {found})", found == wanted, 1, *ids)


# -- SDO ---------------------------------------------------------------------------------------------------


def _bytes(text: str) -> bytes:
    return bytes.fromhex(text).ljust(8, b"\0")


class ScriptedServer:
    """An SDO server that gives the next answers of a script to every request, whatever that is.

    Args:
        rig: Where it is.
        script: Lines: `>` what the client has to send, `<` what the server answers, at once or with `+` and
            milliseconds in front, in hexadecimal; zeros at the end may be left out.

    """

    def __init__(self, rig: Rig, script: str) -> None:
        lines = [line.split() for line in script.strip().splitlines()]
        self.wanted = [_bytes("".join(words)) for mark, *words in lines if mark == ">"]
        self.heard: list[bytes] = []
        self._answers: list[list[tuple[float, bytes]]] = []
        self._first: list[tuple[float, bytes]] = []
        for mark, *words in lines:
            if mark == ">":
                self._answers.append([])
            else:
                delay = float(words.pop(0)) if words[0].startswith("+") else 0.0
                (self._answers[-1] if self._answers else self._first).append((delay, _bytes("".join(words))))
        self._scheduler = rig.scheduler
        self._port = rig.segment.attach("scripted server", self._take)

    def _take(self, frame: CanFrame, _time_ns: int) -> None:
        if frame.can_id != 0x600 + NODE:
            return
        place = len(self.heard)
        self.heard.append(bytes(frame.data))
        for delay_ms, data in self._answers[place] if place < len(self._answers) else ():
            self._scheduler.after(
                round(delay_ms * MS), lambda data=data: self._port.send(CanFrame(0x580 + NODE, data))
            )


LONG: Final = bytes(range(1, 17))
"""16 bytes: two whole segments and two bytes."""
CHECK: Final = crc_hqx(LONG, 0).to_bytes(2, "little").hex()
PART: Final = ("01 02 03 04 05 06 07", "08 09 0A 0B 0C 0D 0E", "0F 10")
READ, READ_BLOCK, WRITE, WRITE_BLOCK = "read", "read in blocks", "write", "write in blocks"
UP: Final = f"> 40 {OBJECT}\n< 41 {OBJECT} 10\n> 60\n< 00 {PART[0]}\n> 70\n< 10 {PART[1]}\n> 60\n"
ASK: Final = f"> A4 {OBJECT} 7F 1C\n"
ABORT: Final = f"> 80 {OBJECT}"
REFUSE: Final = f"< 80 {OBJECT}"
BLOCKS: Final = (
    f"> A4 {OBJECT} 7F 1C\n< C6 {OBJECT} 10\n> A3\n< 01 {PART[0]}\n< 02 {PART[1]}\n< 83 {PART[2]}\n"
)
DOWN: Final = f"> 21 {OBJECT} 10\n< 60 {OBJECT}\n> 00 {PART[0]}\n< 20\n> 10 {PART[1]}\n"
DOWN_BLOCKS: Final = f"> C6 {OBJECT} 10\n< A4 {OBJECT} 02\n> 01 {PART[0]}\n> 02 {PART[1]}\n"

DIALOGUES: Final[dict[str, tuple[str, str, object]]] = {
    # Uploads, expedited and in segments.
    "four-bytes": (READ, f"> 40 {OBJECT}\n< 43 {OBJECT} 11 22 33 44", bytes.fromhex("11223344")),
    "three-bytes": (READ, f"> 40 {OBJECT}\n< 47 {OBJECT} 11 22 33", bytes.fromhex("112233")),
    "one-byte": (READ, f"> 40 {OBJECT}\n< 4F {OBJECT} 11", b"\x11"),
    "no-size": (READ, f"> 40 {OBJECT}\n< 42 {OBJECT} 11 22", bytes.fromhex("11220000")),
    "segments": (READ, UP + f"< 0B {PART[2]}", LONG),
    "segments-without-size": (READ, UP.replace(f"41 {OBJECT} 10", f"40 {OBJECT}") + f"< 0B {PART[2]}", LONG),
    "toggle-of-the-first": (
        READ,
        f"> 40 {OBJECT}\n< 41 {OBJECT} 10\n> 60\n< 10\n{ABORT} 00 00 03 05",
        TOGGLE,
    ),
    "toggle-of-the-last": (READ, UP + f"< 1B {PART[2]}\n{ABORT} 00 00 03 05", TOGGLE),
    "too-much": (READ, UP + f"< 09 {PART[2]} 11\n{ABORT} 12 00 07 06", TOO_LONG),
    "too-little": (READ, UP + f"< 0D 0F\n{ABORT} 13 00 07 06", TOO_SHORT),
    "end-too-early": (READ, UP.replace("< 10 08", "< 11 08")[:-5] + f"{ABORT} 13 00 07 06", TOO_SHORT),
    "answer-of-another": (
        READ,
        f"> 40 {OBJECT}\n< 43 00 20 04 99\n< 43 01 20 03 99\n< 4F {OBJECT} 11",
        b"\x11",
    ),
    "segment-out-of-turn": (READ, f"> 40 {OBJECT}\n< 00 99\n< 60 {OBJECT}\n< 4F {OBJECT} 11", b"\x11"),
    "refused": (READ, f"> 40 {OBJECT}\n{REFUSE} 00 00 02 06", NO_OBJECT),
    "refused-without-reason": (READ, f"> 40 {OBJECT}\n{REFUSE}", GENERAL),
    "refused-late": (READ, UP + "< 80 00 00 00 00 00 00 08", GENERAL),
    "refusal-of-another": (READ, f"> 40 {OBJECT}\n< 80 01 20 03 00 00 02 06\n< 4F {OBJECT} 11", b"\x11"),
    "endless": (READ, f"> 40 {OBJECT}\n< 41 {OBJECT} 01 00 00 01\n{ABORT} 05 00 04 05", 0x05040005),
    # Uploads in blocks.
    "blocks": (READ_BLOCK, BLOCKS + f"> A2 03 7F\n< D5 {CHECK}\n> A1", LONG),
    "blocks-without-checksum": (
        READ_BLOCK,
        BLOCKS.replace("< C6", "< C2") + "> A2 03 7F\n< D5 12 34\n> A1",
        LONG,
    ),
    "wrong-checksum": (READ_BLOCK, BLOCKS + f"> A2 03 7F\n< D5 12 34\n{ABORT} 04 00 04 05", CRC),
    "block-with-a-gap": (
        READ_BLOCK,
        BLOCKS.replace(f"< 02 {PART[1]}\n", "")
        + f"> A2 01 7F\n< 01 {PART[1]}\n< 82 {PART[2]}\n> A2 02 7F\n< D5 {CHECK}\n> A1",
        LONG,
    ),
    "wrong-length-of-blocks": (
        READ_BLOCK,
        BLOCKS + f"> A2 03 7F\n< D9 {crc_hqx(LONG[:-1], 0).to_bytes(2, 'little').hex()}\n{ABORT} 13 00 07 06",
        TOO_SHORT,
    ),
    "no-blocks": (READ_BLOCK, f"{ASK}{REFUSE} 01 00 04 05\n" + UP + f"< 0B {PART[2]}", LONG),
    "switched-to-segments": (
        READ_BLOCK,
        UP.replace("> 40 " + OBJECT, f"> A4 {OBJECT} 7F 1C") + f"< 0B {PART[2]}",
        LONG,
    ),
    "switched-to-expedited": (READ_BLOCK, f"{ASK}< 4B {OBJECT} 11 22", b"\x11\x22"),
    "blocks-refused": (READ_BLOCK, f"{ASK}{REFUSE} 23 00 0A 06", NO_RESOURCE),
    "block-broken-off": (
        READ_BLOCK,
        f"{ASK}< C6 {OBJECT} 10\n> A3\n< 01 {PART[0]}\n{REFUSE} 00 00 00 08",
        GENERAL,
    ),
    # Downloads.
    "written": (WRITE, DOWN + f"< 30\n> 0B {PART[2]}\n< 20", LONG),
    "written-expedited": (f"{WRITE} 11 22", f"> 2B {OBJECT} 11 22\n< 60 {OBJECT}", b"\x11\x22"),
    "written-nothing": (f"{WRITE} ", f"> 21 {OBJECT}\n< 60 {OBJECT}\n> 0F\n< 20", b""),
    "write-refused": (f"{WRITE} 11 22", f"> 2B {OBJECT} 11 22\n{REFUSE} 02 00 01 06", READ_ONLY),
    "write-refused-at-its-end": (WRITE, DOWN + f"< 30\n> 0B {PART[2]}\n{REFUSE} 02 00 01 06", READ_ONLY),
    "write-toggle": (WRITE, DOWN + f"< 20\n{ABORT} 00 00 03 05", TOGGLE),
    "answer-to-another-write": (
        f"{WRITE} 11",
        f"> 2F {OBJECT} 11\n< 60 00 20 04\n< 43 {OBJECT}\n< 60 {OBJECT}",
        b"\x11",
    ),
    "written-in-blocks": (
        WRITE_BLOCK,
        DOWN_BLOCKS + f"< A2 02 7F\n> 81 {PART[2]}\n< A2 01 7F\n> D5 {CHECK}\n< A1",
        LONG,
    ),
    "written-without-checksum": (
        WRITE_BLOCK,
        DOWN_BLOCKS.replace("< A4", "< A0") + f"< A2 02 7F\n> 81 {PART[2]}\n< A2 01 7F\n> D5\n< A1",
        LONG,
    ),
    "block-half-taken": (
        WRITE_BLOCK,
        DOWN_BLOCKS + f"< A2 01 03\n> 01 {PART[1]}\n> 82 {PART[2]}\n< A2 02 03\n> D5 {CHECK}\n< A1",
        LONG,
    ),
    "block-size-zero": (WRITE_BLOCK, f"> C6 {OBJECT} 10\n< A4 {OBJECT} 00\n{ABORT} 02 00 04 05", BLOCK_SIZE),
    "block-size-128": (WRITE_BLOCK, f"> C6 {OBJECT} 10\n< A4 {OBJECT} 80\n{ABORT} 02 00 04 05", BLOCK_SIZE),
    "more-taken-than-sent": (WRITE_BLOCK, DOWN_BLOCKS + f"< A2 03 7F\n{ABORT} 03 00 04 05", SEQUENCE),
    "no-block-download": (
        WRITE_BLOCK,
        f"> C6 {OBJECT} 10\n{REFUSE} 01 00 04 05\n" + DOWN + f"< 30\n> 0B {PART[2]}\n< 20",
        LONG,
    ),
    "end-refused": (
        WRITE_BLOCK,
        DOWN_BLOCKS + f"< A2 02 7F\n> 81 {PART[2]}\n< A2 01 7F\n> D5 {CHECK}\n{REFUSE} 04 00 04 05",
        CRC,
    ),
    # Silence: asked twice, each time given up with an abort.
    "silent": (READ, f"> 40 {OBJECT}\n{ABORT} 00 00 04 05\n> 40 {OBJECT}\n{ABORT} 00 00 04 05", TIMED_OUT),
    "late": (READ, f"> 40 {OBJECT}\n< +299 4F {OBJECT} 11", b"\x11"),
    "too-late": (
        READ,
        f"> 40 {OBJECT}\n< +300.5 4F {OBJECT} 99\n{ABORT} 00 00 04 05\n> 40 {OBJECT}\n< +1 4F {OBJECT} 11",
        None,
    ),
    "slow-segments": (
        READ,
        UP.replace("< 00", "< +250 00").replace("< 10", "< +250 10") + f"< +250 0B {PART[2]}",
        LONG,
    ),
}
"""What is done, the dialogue, and what comes of it: the bytes, or the abort code; None: either."""


@CAMPAIGN.product(
    "sdo/{group}",
    parameters={"group": (READ, READ_BLOCK, WRITE, WRITE_BLOCK)},
    title="SDO client, {group}: dialogues byte for byte",
    requirements=(
        "C301-057",
        "C301-059",
        "C301-061",
        "C301-064",
        "C301-067",
        "C301-070",
        "C301-071",
        "C301-072",
    ),
)
def dialogue(ctx: CaseContext, group: str) -> None:
    """Whatever the server answers, the client says what the standard has it say, and ends with content or
    abort code.
    """
    for name, (what, script, outcome) in DIALOGUES.items():
        if what.rstrip("0123456789 ") != group:
            continue
        rig = Rig(ctx)
        server = ScriptedServer(rig, script)
        sdo = rig.master.sdo(NODE)
        if what.startswith("read"):
            job = sdo.upload(0x2000, 3, block=what == READ_BLOCK)
        else:
            own = what.removeprefix(group)
            content = bytes.fromhex(own) if own else LONG
            job = sdo.download(0x2000, 3, content, block=what == WRITE_BLOCK)
        ctx.wait_until(job.done, 2.0, f"{name}: the transfer ends")
        rig.run_ms(5)
        found: object = job.data if job.ok else job.abort_code
        if outcome is not None:
            rig.is_so(f"{name}: outcome", found, outcome)
        said = [data.hex(" ") for data in server.heard]
        rig.is_so(f"{name}: what the client says", said, [data.hex(" ") for data in server.wanted])
        rig.master.close()


# -- nodes taken into service --------------------------------------------------------------------------------

DEVICE_TYPE: Final = 0x00020192
IDENTITY: Final = {"vendor_id": 0x11, "product_code": 0x22, "revision": 0x10003, "serial": 44}


@dataclass
class TableDevice:
    """A device that answers expedited SDOs by a table of objects, and obeys NMT commands.

    Args:
        rig: Where it is.
        objects: Values by (index, sub-index): number and bytes of it, or an abort code with 0 bytes; objects
            that are not there do not exist.
        silent: Objects to which it does not answer.
        refuses: Abort codes of downloads.
        write_only: Objects that cannot be read.

    """

    rig: Rig
    objects: dict[tuple[int, int], tuple[int, int]]
    silent: set[tuple[int, int]] = field(default_factory=set)
    refuses: dict[tuple[int, int], int] = field(default_factory=dict)
    write_only: tuple[tuple[int, int], ...] = ()
    obeys: bool = True
    state: int = 127
    writes: list[tuple[int, int, int]] = field(default_factory=list)
    commands: list[int] = field(default_factory=list)
    asked: list[float] = field(default_factory=list)
    answers_guarding: bool = True
    toggle: int = 0
    stuck_toggle: bool = False

    def __post_init__(self) -> None:
        self.port = self.rig.segment.attach("table device", self._take)

    def say(self, base: int, data: bytes) -> None:
        """Send a frame."""
        self.port.send(CanFrame(base + NODE, data))

    def boot_up(self) -> None:
        """Restart."""
        self.state, self.toggle = 127, 0
        self.say(0x700, b"\0")

    def beat(self) -> None:
        """Send a heartbeat."""
        self.say(0x700, bytes((self.state,)))

    def _take(self, frame: CanFrame, time_ns: int) -> None:
        data = bytes(frame.data)
        if frame.can_id == 0 and data[1] in (0, NODE):
            self.commands.append(data[0])
            if self.obeys:
                self.state = {1: 5, 2: 4, 128: 127}.get(data[0], self.state)
        elif frame.can_id == 0x700 + NODE and frame.remote:
            self.asked.append(time_ns / 1e9)
            if self.answers_guarding:
                self.say(0x700, bytes((self.state | self.toggle,)))
                self.toggle ^= 0 if self.stuck_toggle else 0x80
        elif frame.can_id == 0x600 + NODE and data[0] != 0x80:
            self._serve(data)

    def _serve(self, data: bytes) -> None:
        key = int.from_bytes(data[1:3], "little"), data[3]
        if key in self.silent:
            return
        value, size = self.objects.get(key, (NO_OBJECT, 0))
        if data[0] >> 5 == 2 and key in self.write_only:
            head, content = 0x80, WRITE_ONLY
        elif data[0] >> 5 == 2:
            head, content = (0x43 | (4 - size) << 2, value) if size else (0x80, value)
        else:
            count = 4 - (data[0] >> 2 & 3)
            code = self.refuses.get(key, 0 if size == count else NO_OBJECT if not size else 0x06070010)
            written = int.from_bytes(data[4 : 4 + count], "little")
            if not code:
                self.objects[key] = (written, size)
                self.writes.append((*key, written))
            head, content = (0x80, code) if code else (0x60, 0)
        self.say(0x580, bytes((head,)) + data[1:4] + (content & 0xFFFFFFFF).to_bytes(4, "little"))


PDO: Final = PdoSetup(True, 1, 0x180 + NODE, 1, (0x60410010, 0x60640020))
UNUSED: Final = PdoSetup(True, 2, 0x280 + NODE)
PARAMETERS: Final = (
    Parameter(0x1017, 0, 50, 2),
    Parameter(0x6083, 0, 5000, 4),
    Parameter(0x607D, 1, -1000, 4),
)
SETUP: Final[dict[str, Any]] = {
    "node_id": NODE,
    "name": "device",
    "device_profile": 402,
    "prepare": (Parameter(0x6060, 0, 9, 1),),
    "pdos": (PDO, UNUSED),
    "parameters": PARAMETERS,
    **IDENTITY,
}
INVALID: Final = 1 << 31
NO_REMOTE: Final = 1 << 30
PDO_WRITES: Final = [
    (0x1800, 1, INVALID | NO_REMOTE | 0x180 + NODE),
    (0x1A00, 0, 0),
    (0x1A00, 1, 0x60410010),
    (0x1A00, 2, 0x60640020),
    (0x1A00, 0, 2),
    (0x1800, 2, 1),
    (0x1800, 1, NO_REMOTE | 0x180 + NODE),
]
UNUSED_WRITE: Final = (0x1801, 1, INVALID | NO_REMOTE | 0x280 + NODE)
LOW: Final = -1000 & 0xFFFFFFFF
VALUE_WRITES: Final = [(0x1017, 0, 50), (0x6083, 0, 5000), (0x607D, 1, LOW)]
MODE_WRITE: Final = (0x6060, 0, 9)


def factory() -> dict[tuple[int, int], tuple[int, int]]:
    """Return the objects of a device as it leaves the factory."""
    found = {(0x1000, 0): (DEVICE_TYPE, 4), (0x6060, 0): (0, 1), (0x1010, 1): (1, 4)}
    found |= {(0x1018, sub): (value, 4) for sub, value in enumerate(IDENTITY.values(), 1)}
    for number, base in enumerate((0x180, 0x280)):
        found |= {
            (0x1800 + number, 1): (base + NODE, 4),
            (0x1800 + number, 2): (254, 1),
            (0x1A00 + number, 0): (1, 1),
        }
        found |= {(0x1A00 + number, sub): (0, 4) for sub in range(1, 9)}
    return found | {(0x1017, 0): (0, 2), (0x6083, 0): (1, 4), (0x607D, 1): (0, 4)}


def configured() -> dict[tuple[int, int], tuple[int, int]]:
    """Return the objects of a device that has been set up."""
    found = factory()
    for index, sub, value in [*PDO_WRITES, UNUSED_WRITE, *VALUE_WRITES, MODE_WRITE]:
        found[index, sub] = (value, found[index, sub][1])
    return found


@dataclass(frozen=True)
class Boot:
    """A device and what becomes of it."""

    state: BootState
    writes: list[tuple[int, int, int]] = field(default_factory=list)
    """Without those of 1020h, which are a digest."""
    words: str = ""
    """In the reason of a failure."""
    setup: dict[str, Any] = field(default_factory=dict)
    objects: dict[tuple[int, int], tuple[int, int] | None] = field(default_factory=dict)
    """Those that differ from the factory; None: not there."""
    silent: tuple[tuple[int, int], ...] = ()
    refuses: dict[tuple[int, int], int] = field(default_factory=dict)
    write_only: tuple[tuple[int, int], ...] = ()
    ready: bool = False
    """The device has been set up before."""
    obeys: bool = True
    signs: bool = True
    """It sends its PDO when it is Operational."""


ALL_WRITES: Final = [MODE_WRITE, *PDO_WRITES, UNUSED_WRITE, *VALUE_WRITES]
GOOD, FAILED, WAITING = BootState.IN_SERVICE, BootState.FAILED, BootState.WAITING
STAMP: Final = {(0x1020, 1): (0, 4), (0x1020, 2): (0, 4)}
BOOTS: Final[dict[str, Boot]] = {
    "factory": Boot(GOOD, ALL_WRITES),
    "as-wanted": Boot(GOOD, [MODE_WRITE], ready=True),
    "one-value": Boot(GOOD, [MODE_WRITE, VALUE_WRITES[1]], ready=True, objects={(0x6083, 0): (5001, 4)}),
    "negative-value": Boot(GOOD, [MODE_WRITE, VALUE_WRITES[2]], ready=True, objects={(0x607D, 1): (1000, 4)}),
    "kind-of-a-pdo": Boot(GOOD, [MODE_WRITE, *PDO_WRITES], ready=True, objects={(0x1800, 2): (2, 1)}),
    "entry-of-a-pdo": Boot(
        GOOD, [MODE_WRITE, *PDO_WRITES], ready=True, objects={(0x1A00, 2): (0x60640010, 4)}
    ),
    "count-of-a-pdo": Boot(GOOD, [MODE_WRITE, *PDO_WRITES], ready=True, objects={(0x1A00, 0): (1, 1)}),
    "remote-requests": Boot(GOOD, [MODE_WRITE], ready=True, objects={(0x1800, 1): (0x180 + NODE, 4)}),
    "unused-pdo-is-valid": Boot(
        GOOD, [MODE_WRITE, UNUSED_WRITE], ready=True, objects={(0x1801, 1): (0x280 + NODE, 4)}
    ),
    "unused-pdo-elsewhere": Boot(GOOD, [MODE_WRITE], ready=True, objects={(0x1801, 1): (INVALID | 0x333, 4)}),
    "unused-pdo-not-there": Boot(GOOD, [MODE_WRITE], ready=True, objects={(0x1801, 1): None}),
    "write-only": Boot(GOOD, [MODE_WRITE, VALUE_WRITES[1]], ready=True, write_only=((0x6083, 0),)),
    "stamped": Boot(GOOD, [*ALL_WRITES], objects=STAMP),
    "stored": Boot(GOOD, [*ALL_WRITES, (0x1010, 1, 0x65766173)], setup={"store": True}),
    "nothing-to-store": Boot(GOOD, [MODE_WRITE], setup={"store": True}, ready=True),
    "no-check": Boot(GOOD, [], setup={"prepare": (), "pdos": (), "parameters": ()}, signs=False),
    "other-vendor": Boot(FAILED, words="1018h:1", objects={(0x1018, 1): (0x12, 4)}),
    "other-product": Boot(FAILED, words="1018h:2", objects={(0x1018, 2): (0x23, 4)}),
    "other-revision": Boot(FAILED, words="1018h:3", objects={(0x1018, 3): (0x10004, 4)}),
    "other-serial": Boot(FAILED, words="1018h:4", objects={(0x1018, 4): (45, 4)}),
    "no-serial": Boot(FAILED, words="does not have it", objects={(0x1018, 4): None}),
    "no-serial-wanted": Boot(GOOD, ALL_WRITES, setup={"serial": None}, objects={(0x1018, 4): None}),
    "other-profile": Boot(
        FAILED, words="is no device of profile 402", objects={(0x1000, 0): (0x00020191, 4)}
    ),
    "any-profile": Boot(GOOD, ALL_WRITES, setup={"device_profile": None}, objects={(0x1000, 0): (0x191, 4)}),
    "type-refused": Boot(FAILED, words="does not let 1000h:0 be read", objects={(0x1000, 0): (NO_OBJECT, 0)}),
    "value-refused": Boot(
        FAILED,
        [MODE_WRITE, *PDO_WRITES, UNUSED_WRITE, VALUE_WRITES[0]],
        words="refuses 6083h:0 = 5000 (1388h)",
        refuses={(0x6083, 0): 0x06090030},
    ),
    "mode-refused": Boot(FAILED, words="refuses 6060h:0", refuses={(0x6060, 0): 0x06090030}),
    "pdo-refused": Boot(
        FAILED, [MODE_WRITE, *PDO_WRITES[:3]], words="refuses 1A00h:2", refuses={(0x1A00, 2): 0x06040041}
    ),
    "value-too-long": Boot(
        FAILED,
        [MODE_WRITE],
        words="has 16 bits",
        setup={"pdos": (), "parameters": (Parameter(0x1017, 0, 70000, 2),)},
    ),
    "compared": Boot(GOOD, [], setup={"compare_only": True}, ready=True),
    "compared-and-different": Boot(
        FAILED,
        [],
        setup={"compare_only": True},
        ready=True,
        objects={(0x6083, 0): (5001, 4)},
        words="6083h:0 is 00001389h, 00001388h is wanted",
    ),
    "silent": Boot(WAITING, silent=((0x1000, 0),), words="does not answer to 1000h:0"),
    "silent-later": Boot(FAILED, [MODE_WRITE], silent=((0x1A00, 0),), words="does not answer to 1A00h:0"),
    "silent-to-a-write": Boot(FAILED, silent=((0x6060, 0),), words="does not answer to 6060h:0"),
    "does-not-start": Boot(FAILED, ALL_WRITES, obeys=False, words="does not become Operational"),
    "shows-nothing": Boot(FAILED, ALL_WRITES, signs=False, words="does not become Operational"),
}


def booted(ctx: CaseContext, case: Boot) -> tuple[Rig, TableDevice, Any]:
    """Return a device behind its boot."""
    rig = Rig(ctx)
    objects = configured() if case.ready else factory()
    for key, value in case.objects.items():
        if value is None:
            del objects[key]
        else:
            objects[key] = value
    device = TableDevice(
        rig, objects, set(case.silent), dict(case.refuses), case.write_only, obeys=case.obeys
    )
    node = rig.master.add_node(NodeSetup(**(SETUP | case.setup)))
    node.boot()
    device.boot_up()
    for _ in range(40):
        rig.run_ms(50)
        if case.signs and device.state == 5:
            device.say(0x180, bytes(6))
        if node.boot_state in (GOOD, FAILED):
            break
    return rig, device, node


@CAMPAIGN.product(
    "boot/{part}",
    parameters={"part": (0, 1, 2, 3)},
    title="nodes taken into service, part {part} of the table",
    requirements=("C301-146", "C301-052"),
)
def boot(ctx: CaseContext, part: int) -> None:
    """What is checked, what is written and in which order, how it ends and with which reason."""
    for name, case in list(BOOTS.items())[part::4]:
        rig, device, node = booted(ctx, case)
        rig.is_so(f"{name}: state", node.boot_state, case.state)
        written = [one for one in device.writes if one[0] != 0x1020]
        rig.is_so(f"{name}: written", [f"{i:04X}h:{s}={v:X}h" for i, s, v in written],
                  [f"{i:04X}h:{s}={v:X}h" for i, s, v in case.writes])  # fmt: skip
        reason = "" if node.failure is None else str(node.failure)
        if case.state is not GOOD:
            equal(ctx, f"{name}: {case.words!r} in the reason {reason!r}", case.words in reason, 1)
        started = [one for one in device.commands if one == 1]
        late = case.words.startswith("does not become")
        equal(ctx, f"{name}: start commands", len(started) > 0, case.state is GOOD or late)
        alone = not case.writes and "refuses" not in case.words and "to 6060h" not in case.words
        if case.state is not WAITING:
            equal(ctx, f"{name}: taken to Pre-operational", 128 in device.commands, not alone)
        rig.master.close()


@CAMPAIGN.product(
    "watched/{how}",
    parameters={"how": ("heartbeat", "guarding")},
    title="a node in service is watched by {how}: both ends of its time",
    requirements=("C301-026", "C301-028", "C301-030"),
)
def watched(ctx: CaseContext, how: str) -> None:
    """A sign of life just in time keeps the node, one just too late does not; it comes back, is lost again,
    and a boot-up or a state that nobody commanded is noticed.
    """
    beats = how == "heartbeat"
    options = {"heartbeat_timeout_ms": 60} if beats else {"guard_time_ms": 20, "life_time_factor": 3}
    rig, device, node = booted(ctx, Boot(GOOD, ready=True, setup={"parameters": PARAMETERS[1:], **options}))
    rig.is_so("state", node.boot_state, GOOD)
    lost = lambda: [dict(one.data) for one in rig.history.select(kind="node.lost")]  # noqa: E731
    if beats:
        for gap_ms in (59.5, 30.0, 59.5):
            device.beat()
            rig.run_ms(gap_ms)
        rig.is_so("losses with heartbeats in time", node.losses, 0, "C301-026")
        device.beat()
        rig.run_ms(59.9)
        rig.is_so("losses just before the time", node.losses, 0, "C301-026")
        rig.run_ms(0.3)
        rig.is_so("losses just behind it", (node.losses, lost()[-1]["reason"]), (1, "heartbeat"), "C301-026")
        rig.run_ms(100)
        rig.is_so("told once", node.losses, 1)
        device.beat()
    else:
        begun = len(device.asked)
        rig.run_ms(200)
        gaps = [b - a for a, b in zip(device.asked[begun:], device.asked[begun + 1 :], strict=False)]
        equal(ctx, "requests in 200 ms", len(gaps), 9, "C301-028", within=1)
        for gap in gaps:
            equal(ctx, "period of the requests, s", gap, 0.02, "C301-028", within=0.0005)
        device.answers_guarding = False
        last = device.asked[-1]
        ctx.wait_until(lambda: node.losses > 0, 0.5, "the node is lost")
        equal(ctx, "life time, s", ctx.now_s - last, 0.06, "C301-030", within=0.0025)
        rig.is_so("reason", lost()[-1]["reason"], "guarding", "C301-030")
        device.answers_guarding = True
    for _ in range(30):
        rig.run_ms(10)
        if beats:
            device.beat()
        if device.state == 5:
            device.say(0x180, bytes(6))
    rig.is_so("state behind the return", node.boot_state, GOOD)
    for state, reason in ((127, "state"), (4, "state")):
        losses = node.losses
        device.state = state
        if beats:
            device.beat()
        rig.run_ms(25)
        rig.is_so(f"losses with state {state}", node.losses, losses + 1)
        equal(ctx, f"the reason names a {reason}: {lost()[-1]}", bool(lost()[-1]), 1)
        for _ in range(30):
            rig.run_ms(10)
            if beats:
                device.beat()
            if device.state == 5:
                device.say(0x180, bytes(6))
        rig.is_so("state behind the return", node.boot_state, GOOD)
    device.boot_up()
    rig.run_ms(5)
    rig.is_so("a boot-up in service begins the boot again", node.boot_state is GOOD, False, "C301-022")
    if not beats:
        device.stuck_toggle = True
        for _ in range(30):
            rig.run_ms(10)
            if device.state == 5:
                device.say(0x180, bytes(6))
        equal(ctx, "a toggle bit that does not change loses the node", node.losses > 2, 1, "C301-028")
    rig.master.close()


def _go_on(rig: Rig, device: TableDevice, milliseconds: int) -> None:
    """Let the device send heartbeats, and its PDO while it is Operational."""
    for _ in range(milliseconds // 10):
        rig.run_ms(10)
        device.beat()
        if device.state == 5:
            device.say(0x180, bytes(6))


@CAMPAIGN.case("held", requirements=("C301-016", "C301-146"))
def held(ctx: CaseContext) -> None:
    """A node that the program stops, or takes to Pre-operational, is left there and is no loss; one that the
    program starts again is taken into service; a command to another node changes nothing.
    """
    rig, device, node = booted(ctx, Boot(GOOD, ready=True, setup={"heartbeat_timeout_ms": 200}))
    rig.is_so("state", node.boot_state, GOOD)
    shown = [node.describe()[name] for name in ("node", "name", "state", "device_type", "bootups", "failure")]
    rig.is_so("what a report shows", shown, [NODE, "device", "in service", DEVICE_TYPE, 1, None])
    for command in (NmtCommand.STOP, NmtCommand.ENTER_PRE_OPERATIONAL):
        rig.master.nmt(command, NODE + 1)
        _go_on(rig, device, 50)
        rig.is_so(f"state behind {command.name} of another node", node.boot_state, GOOD)
        before = len(device.commands)
        rig.master.nmt(command, NODE)
        _go_on(rig, device, 400)
        rig.is_so(f"state behind {command.name}", node.boot_state, BootState.HELD)
        rig.is_so("commands", [int(one) for one in device.commands[before:]], [int(command)])
        rig.is_so("losses", node.losses, 0)
        rig.master.nmt(NmtCommand.START, NODE)
        _go_on(rig, device, 400)
        rig.is_so("state behind START", node.boot_state, GOOD)
    rig.master.nmt(NmtCommand.STOP)
    _go_on(rig, device, 100)
    rig.is_so("state behind STOP of all", node.boot_state, BootState.HELD)
    device.boot_up()
    _go_on(rig, device, 400)
    rig.is_so("a node that is held and restarts", node.bootups, 2, "C301-022")
    device.say(0x80, bytes((0x10, 0x23, 3, 1, 2, 3, 4, 5)))
    device.say(0x80, bytes(7))
    rig.run_ms(5)
    emcys = [(one.code, one.register, one.data) for one in node.emcys]
    rig.is_so("EMCYs", emcys, [(0x2310, 3, bytes((1, 2, 3, 4, 5)))], "C301-108")
    rig.is_so("error register", node.error_register, 3, "C301-112")
    node.stop()
    count = len(device.commands)
    _go_on(rig, device, 300)
    rig.is_so(
        "state of a node that is left alone",
        (node.boot_state, len(device.commands) - count),
        (BootState.OFF, 0),
    )
    rig.master.close()


@CAMPAIGN.case("watch", requirements=("C301-026", "C301-027"))
def watch(ctx: CaseContext) -> None:
    """A program watches the heartbeat of any node: both ends of the time, changes of the state, a boot-up
    that is no silence, and the end of watching.
    """
    rig = Rig(ctx)
    device = TableDevice(rig, {})
    lost: list[float] = []
    states: list[int] = []
    end = rig.master.watch_heartbeat(NODE, 30 * MS, lambda: lost.append(ctx.now_s), states.append)
    rig.run_ms(100)
    rig.is_so("losses before the first heartbeat", lost, [], "C301-026")
    for gap_ms in (29.5, 29.5, 10.0):
        device.beat()
        rig.run_ms(gap_ms)
    device.state = 5
    device.beat()
    begun = ctx.now_s
    rig.run_ms(29.9)
    rig.is_so("losses just in time", (lost, states), ([], [127, 5]), "C301-027")
    rig.run_ms(100)
    rig.is_so("losses", len(lost), 1, "C301-026")
    equal(ctx, "time of the loss, s", lost[0] - begun, 0.03, "C301-026", within=0.0003)
    device.beat()
    device.boot_up()
    rig.run_ms(100)
    rig.is_so("a boot-up ends the watch until the next heartbeat", (len(lost), states), (1, [127, 5, 5, 0]))
    device.beat()
    rig.run_ms(50)
    rig.is_so("losses", len(lost), 2)
    kinds = [one.kind for one in rig.history.select(kind="heartbeat.")]
    rig.is_so("events", kinds, ["heartbeat.lost", "heartbeat.back", "heartbeat.lost"])
    device.beat()
    end()
    end()
    rig.run_ms(100)
    rig.is_so("losses behind the end", len(lost), 2)
    for node, time_ns in ((0, MS), (128, MS), (NODE, 0)):
        try:
            rig.master.watch_heartbeat(node, time_ns)
            refused = False
        except ConfigurationError:
            refused = True
        rig.is_so(f"watching node {node} for {time_ns} ns is refused", refused, True)
    rig.master.close()
