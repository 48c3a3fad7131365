"""Parts of the buses by themselves: every Modbus function byte by byte, registers and maps at their borders,
the clock of a bench, messages of errors.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from fieldbus.clock import VirtualScheduler
from fieldbus.errors import (
    CombinedConfigurationError,
    ConfigurationError,
    MissingValueError,
    SchedulerError,
    UnknownKeyError,
    UnknownNameError,
)
from fieldbus.modbus import load_map
from fieldbus.modbus.pdu import (
    Request,
    Response,
    decode_request,
    decode_response,
    encode_response,
    is_well_formed,
)
from fieldbus.modbus.registers import Area, Block, ExceptionCode, RegisterMap, RegisterRefusal, WordOrder
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.device_settings import refused
from testcases.campaigns.support import equal, raises, same

CAMPAIGN: Final = Campaign(
    "bus parts", controller="", tags=("modbus",), bench="testcases.campaigns.can_bus:BENCH"
)


# -- Modbus -----------------------------------------------------------------------------------------------

PDUS: Final[tuple[tuple[Request, str, Response, str], ...]] = (
    (
        Request(1, 0x13, 19),
        "01 0013 0013",
        Response(1, (1, 0, 1, 1, 0, 0, 1, 1, 1, 1, 0, 1, 0, 1, 1, 0, 1, 0, 1)),
        "01 03 CD6B05",
    ),
    (Request(2, 0xC4, 8), "02 00C4 0008", Response(2, (0, 0, 1, 1, 0, 1, 0, 1)), "02 01 AC"),
    (Request(3, 0x6B, 3), "03 006B 0003", Response(3, (0x22B, 0, 0x64)), "03 06 022B 0000 0064"),
    (Request(4, 8, 1), "04 0008 0001", Response(4, (10,)), "04 02 000A"),
    (Request(5, 0xAC, 1, (1,)), "05 00AC FF00", Response(5), "05 00AC FF00"),
    (Request(5, 0xAC, 1, (0,)), "05 00AC 0000", Response(5), "05 00AC 0000"),
    (Request(6, 1, 1, (3,)), "06 0001 0003", Response(6), "06 0001 0003"),
    (
        Request(15, 0x13, 10, (1, 0, 1, 1, 0, 0, 1, 1, 1, 0)),
        "0F 0013 000A 02 CD01",
        Response(15),
        "0F 0013 000A",
    ),
    (Request(16, 1, 2, (10, 0x102)), "10 0001 0002 04 000A 0102", Response(16), "10 0001 0002"),
    (Request(22, 4, 1, and_mask=0xF2, or_mask=0x25), "16 0004 00F2 0025", Response(22), "16 0004 00F2 0025"),
    (
        Request(23, 3, 6, (0xFF, 0xFE, 0xFD), 0xE),
        "17 0003 0006 000E 0003 06 00FF 00FE 00FD",
        Response(23, (0xFE, 0xACD, 1, 3, 0xD, 0xFF)),
        "17 0C 00FE 0ACD 0001 0003 000D 00FF",
    ),
    (Request(8, code=0, data=b"\xa5\x37"), "08 0000 A537", Response(8, data=b"\xa5\x37"), "08 0000 A537"),
    (Request(43, code=1, object_id=0), "2B 0E 01 00", Response(43), ""),
)  # fmt: skip
"""Requests and responses as the specification of the protocol shows them."""
MALFORMED: Final = (
    *("01 0013", "01 0013 0000", "01 0013 07D1", "03 006B 0003 00", "03 0000 0000", "03 0000 007E"),
    *("05 00AC FF01", "05 00AC 01", "05 00AC 0000 00", "06 0001", "06 0001 0003 00", "0F 0013 000A 01 CD"),
    *("0F 0013 000A 02 CD", "0F 0013 000A 02 CD0101", "10 0001 0002 04 000A 01", "10 0001 0002 03 000A 01"),
    *("10 0001 0000 00", "16 0004 00F2", "16 0004 00F2 0025 00", "17 0003 0006 000E 0003 06 00FF 00FE"),
    *("17 0003 0000 000E 0001 02 00FF", "17 0003 007E 000E 0001 02 00FF", "17 0003 0001 000E 0000 00"),
    *("17 0003 0001 000E 0001 03 00FF", "08 00", "08 0001 A5", "2B", "2B 0E 01"),
)
"""Requests whose length, quantity, byte count or value is wrong."""


def _bytes(text: str) -> bytes:
    return bytes.fromhex(text.replace(" ", ""))


@CAMPAIGN.case("pdus", requirements=("MODB-006", "MODB-012", "MODB-024"))
def pdus(ctx: CaseContext) -> None:
    """Every function there and back, byte by byte; what is not well formed; responses that fit no request."""
    for request, text, response, answer in PDUS:
        wire = _bytes(text)
        same(ctx, f"request {text}", request.encode().hex(), wire.hex(), "MODB-006")
        same(ctx, f"{text} is well formed", is_well_formed(wire), True, "MODB-024")
        same(ctx, f"{text} read", decode_request(wire), request, "MODB-006")
        if answer:
            back = _bytes(answer)
            same(ctx, f"response {answer}", encode_response(request, response).hex(), back.hex(), "MODB-012")
            found = decode_response(request, back)
            same(
                ctx,
                f"{answer} read",
                (found.values, found.data),
                (response.values, response.data),
                "MODB-012",
            )
            others = (b"", bytes((back[0] ^ 1,)) + back[1:])
            for wrong in others if request.function == 8 else (*others, back[:-1], back + b"\0"):
                said = raises(lambda w=wrong, r=request: decode_response(r, w))
                equal(ctx, f"{wrong.hex()} is no response to {text}", bool(said), 1, "MODB-012")
        for code in (1, 2, 3, 4, 6):
            refusal = encode_response(request, Response(request.function, exception=code))
            same(ctx, "exception", refusal.hex(), bytes((request.function | 0x80, code)).hex(), "MODB-012")
            same(ctx, "exception read", decode_response(request, refusal).exception, code, "MODB-012")
        for wrong in (
            bytes((request.function | 0x80,)),
            bytes((request.function | 0x80, 0)),
            refusal + b"\1",
        ):
            equal(
                ctx,
                f"{wrong.hex()} is no exception",
                bool(raises(lambda w=wrong, r=request: decode_response(r, w))),
                1,
            )
    for text in MALFORMED:
        same(ctx, f"{text} is well formed", is_well_formed(_bytes(text)), False, "MODB-024")
    for function, most in ((1, 2000), (2, 2000), (3, 125), (4, 125)):
        for count, fits in ((1, True), (most, True), (most + 1, False)):
            wire = bytes((function, 0, 0)) + count.to_bytes(2, "big")
            same(ctx, f"function {function} x {count}", is_well_formed(wire), fits, "MODB-024")
    for function, most in ((15, 1968), (16, 123)):
        for count, fits in ((most, True), (most + 1, False)):
            size = (count + 7) // 8 if function == 15 else 2 * count
            wire = bytes((function, 0, 0)) + count.to_bytes(2, "big") + bytes((size & 0xFF,)) + bytes(size)
            same(ctx, f"function {function} x {count}", is_well_formed(wire), fits, "MODB-024")
    for written, fits in ((121, True), (122, False)):
        wire = (
            _bytes("17 0000 0001 0000")
            + written.to_bytes(2, "big")
            + bytes((2 * written,))
            + bytes(2 * written)
        )
        same(ctx, f"function 23 with {written} written", is_well_formed(wire), fits, "MODB-024")
    same(ctx, "too long", is_well_formed(_bytes("08 0000") + bytes(251)), False, "MODB-024")
    same(ctx, "as long as may be", is_well_formed(_bytes("08 0000") + bytes(250)), True, "MODB-024")
    for wrong in (
        Request(3, 0x1_0000, 1),
        Request(6, 0, 1, (0x1_0000,)),
        Request(16, 0, 1, (-1,)),
        Request(99),
    ):
        equal(ctx, f"{wrong!r} cannot be sent", bool(raises(wrong.encode)), 1)


@CAMPAIGN.case("identification", requirements=("MODB-021",))
def identification(ctx: CaseContext) -> None:
    """Objects of 43/14 in order, more that follow, and what is cut off or counted wrongly."""
    request = Request(43, code=1)
    body = b"\0\2ab\1\0\2\3xyz"
    for more, following, wanted in ((0, 0, None), (0xFF, 7, 7)):
        found = decode_response(request, bytes((0x2B, 0x0E, 1, 1, more, following, 3)) + body)
        same(ctx, "objects", found.objects, ((0, b"ab"), (1, b""), (2, b"xyz")), "MODB-021")
        same(ctx, "next object", found.next_object, wanted, "MODB-021")
    for wrong in (
        bytes((0x2B, 0x0E, 1, 1, 0, 0)),
        bytes((0x2B, 0x0D, 1, 1, 0, 0, 3)) + body,
        bytes((0x2B, 0x0E, 1, 1, 0, 0, 2)) + body,
        bytes((0x2B, 0x0E, 1, 1, 0, 0, 3)) + body[:-1],
        bytes((0x2B, 0x0E, 1, 1, 0, 0, 4)) + body + b"\3",
    ):
        equal(ctx, f"{wrong.hex()} is refused", bool(raises(lambda w=wrong: decode_response(request, w))), 1)
    same(ctx, "another code", decode_request(_bytes("2B 0D 00 00")).code, -1)
    said = raises(lambda: decode_response(Request(8, code=1), _bytes("08 0000 A537")))
    equal(ctx, f"another sub-function: {said}", bool(said), 1)


@CAMPAIGN.case("texts")
def texts(ctx: CaseContext) -> None:
    """Requests and responses in words name what is in them."""
    for request, words in (
        (Request(8, code=2), ("sub-function 2",)),
        (Request(43, code=1, object_id=3), ("identification 1", "object 3")),
        (Request(22, 0x12, and_mask=0xF2, or_mask=0x25), ("0012h", "00F2h", "0025h")),
        (Request(23, 3, 6, (255, 254), 14), ("0003h x 6", "000Eh", "00FF 00FE")),
        (Request(16, 1, 2, (10, 258)), ("0001h", "000A 0102")),
        (Request(3, 0x6B, 3), ("006Bh x 3",)),
    ):
        equal(ctx, f"{request} has {words}", all(word in str(request) for word in words), 1)
    for response, words in (
        (Response(3, (1, 0xABC)), ("0001 0ABC",)),
        (Response(6), ("done",)),
        (Response(3, exception=2), ("exception", "2")),
        (Response(43, objects=((1, b"ab"),)), ("01h", "ab")),
    ):
        equal(ctx, f"{response} has {words}", all(word in str(response) for word in words), 1)


REGISTERS: Final = Area.HOLDING_REGISTERS


def _registers(ctx: CaseContext, known: RegisterMap, *, in_part: bool) -> None:
    plain = known.add(REGISTERS, Block(10, 3, name="plain"))
    limited = known.add(REGISTERS, Block(13, 2, minimum=-5, maximum=7))
    known.add(REGISTERS, Block(15, 1, writable=False))
    known.add(REGISTERS, Block(20, 1, readable=False))
    for start, count in ((9, 2), (12, 1), (14, 3), (10, 1), (5, 40)):
        equal(
            ctx,
            f"{start} x {count} overlaps",
            bool(refused(lambda s=start, c=count: known.add(REGISTERS, Block(s, c)))),
            1,
        )
    same(ctx, "blocks", [one.start for one in known.blocks(REGISTERS)], [10, 13, 15, 20])
    for address, count, there in (
        (10, 6, True),
        (9, 1, False),
        (10, 7, False),
        (16, 1, False),
        (20, 1, True),
    ):
        same(ctx, f"{address} x {count} exists", known.exists(REGISTERS, address, count), there, "MODB-022")
    missing, value = ExceptionCode.ILLEGAL_DATA_ADDRESS, ExceptionCode.ILLEGAL_DATA_VALUE
    same(ctx, "a gap", known.read(REGISTERS, 15, 2), missing, "MODB-022")
    same(ctx, "a gap written", known.write(REGISTERS, 15, (1, 2)), missing, "MODB-022")
    same(ctx, "not readable", known.read(REGISTERS, 20, 1), value)
    same(ctx, "written over two blocks", known.write(REGISTERS, 11, (1, 2, 7, 0xFFFB)), None)
    same(ctx, "read over two blocks", known.read(REGISTERS, 10, 5), (0, 1, 2, 7, 0xFFFB))
    for word, fits in ((7, 1), (8, 0), (0xFFFB, 1), (0xFFFA, 0), (0x8000, 0)):
        same(ctx, f"{word:04X}h is accepted", limited.accepts(word), bool(fits), "PD-337")
    same(ctx, "unlimited", (plain.unlimited, limited.unlimited), (True, False))
    before = known.read(REGISTERS, 10, 6)
    code = known.write(REGISTERS, 12, (9, 8, 3, 4))
    same(ctx, "refused", code, ExceptionCode.SERVER_DEVICE_FAILURE, "PD-337")
    after = (0, 1, 9, 7, 3, 0) if in_part else before
    same(ctx, f"afterwards, in part {in_part}", known.read(REGISTERS, 10, 6), after, "PD-293")

    def refuse(offset: int, values: Any) -> None:
        raise RegisterRefusal(6 if values[0] == 1 else 99)

    hooked = known.add(REGISTERS, Block(30, 2, write=refuse, read=lambda _offset, count: [-1] * count))
    same(ctx, "hook", known.write(REGISTERS, 30, (1,)), ExceptionCode.SERVER_DEVICE_BUSY)
    same(ctx, "hook, no code", known.write(REGISTERS, 31, (2,)), ExceptionCode.SERVER_DEVICE_FAILURE)
    same(ctx, "read hook", known.read(REGISTERS, 30, 2), (0xFFFF, 0xFFFF))
    hooked.read = lambda _offset, _count: [1]
    equal(ctx, "too few values", bool(raises(lambda: known.read(REGISTERS, 30, 2))), 1)


@CAMPAIGN.case("registers", requirements=("MODB-022", "PD-293", "PD-337"))
def registers(ctx: CaseContext) -> None:
    """Blocks side by side, limits with and without a sign, what cannot be read or written, hooks that refuse,
    and writes that are stored in part.
    """
    for start, count, fits in (
        (0, 1, 1),
        (-1, 1, 0),
        (65_535, 1, 1),
        (65_536, 1, 0),
        (65_535, 2, 0),
        (5, 0, 0),
    ):
        equal(ctx, f"{count} from {start}", not refused(Block, start=start, count=count), fits)
    for low, high, fits in (
        (0, 65_535, 1),
        (-1, 32_767, 1),
        (-1, 32_768, 0),
        (-32_769, 0, 0),
        (5, 5, 1),
        (6, 5, 0),
    ):
        said = refused(Block, start=0, count=1, minimum=low, maximum=high)
        equal(ctx, f"limits {low} to {high}", not said, fits)
    for in_part in (False, True):
        _registers(ctx, RegisterMap("m", partial_writes=in_part), in_part=in_part)
    for order, words in ((WordOrder.HIGH_FIRST, (0x8000, 1)), (WordOrder.LOW_FIRST, (1, 0x8000))):
        known = RegisterMap("m", word_order=order)
        known.add(REGISTERS, Block(0, 2))
        known.set_long(REGISTERS, 0, 0x8000_0001)
        same(ctx, f"{order}", known.read(REGISTERS, 0, 2), words)
        same(ctx, "long", known.get_long(REGISTERS, 0), 0x8000_0001)
        same(ctx, "with sign", known.get_long(REGISTERS, 0, signed=True), 0x8000_0001 - (1 << 32))
        known.set(REGISTERS, 0, -2, 5)
        same(ctx, "words", (known.get(REGISTERS, 0), known.get(REGISTERS, 1)), (0xFFFE, 5))
        equal(ctx, "no such register", "2" in raises(partial(known.get, REGISTERS, 2)), 1)


MAP: Final = 'name = "own"\nfirst = 40001\n[[block]]\nregister = 40001\ncount = 4\n'
MAPS: Final = (
    (MAP, ""),
    (MAP + 'hook = "setpoints"\n', ""),
    (MAP + 'hook = "something"\n', "block.0.hook"),
    (MAP + 'hook = "setpoints"\nparameter = 5\n', "block.0"),
    (MAP + "parameter = 5\nbit = 31\n", ""),
    (MAP + "parameter = 5\nbit = 32\n", "block.0.bit"),
    (MAP + "bit = 1\n", "block.0"),
    (MAP + "words = 2\n", "block.0"),
    (MAP + "parameter = 5\nwords = 2\n", ""),
    (MAP.replace("= 4", "= 3") + "parameter = 5\nwords = 2\n", "block.0"),
    (MAP + "parameter = 5\nwords = 2\nbit = 1\n", "block.0"),
    (MAP + "parameter = 0\n", "block.0.parameter"),
    (MAP + "parameter = 65536\n", "block.0.parameter"),
    (MAP + "parameter = 5\nscale = 0\n", "block.0.scale"),
    (MAP.replace("count = 4", "count = 0"), "block.0.count"),
    (MAP.replace("register = 40001", "register = 40000"), "block.register"),
    (MAP.replace("first = 40001", "first = -1"), "first"),
    ("colour = 1\n" + MAP, "colour"),
    ("timeout_ms = 2000001\n" + MAP, "timeout_ms"),
    ("watched = 0\n" + MAP, "watched"),
    ('name = "own"\n', "block"),
    ("name = ", ""),
)


@CAMPAIGN.case("maps")
def maps(ctx: CaseContext) -> None:
    """A register map from a file; what is wrong is said with file and key."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "own.toml"
        for text, where in MAPS:
            path.write_text(text, encoding="utf-8")
            said = refused(load_map, source=path)
            fits = f"own.toml: {where}:" in said if where else not said or text == "name = "
            equal(ctx, f"{text!r} says {said!r}", fits, 1)
        equal(ctx, "no TOML is refused", bool(said), 1)
    for wrong in ("no_such_map", Path(folder) / "none.toml"):
        equal(ctx, f"{wrong} is refused", "register map" in refused(load_map, source=wrong), 1)


# -- clock and messages -----------------------------------------------------------------------------------


@CAMPAIGN.case("clock")
def clock(ctx: CaseContext) -> None:
    """Events by time, priority and order of entry; grids from time zero; what is in the past is refused."""
    scheduler = VirtualScheduler()
    told: list[str] = []
    scheduler.run_for(5)
    scheduler.at(20, lambda: told.append("late"))
    scheduler.at(10, lambda: told.append("second"), priority=1)
    scheduler.at(10, lambda: told.append("first"))
    scheduler.after(5, lambda: told.append("third"), priority=1)
    scheduler.every(4, lambda: told.append(f"grid {scheduler.now}"), phase_ns=1)
    same(ctx, "next", scheduler.next_due_ns, 5)
    scheduler.run_for(5)
    same(ctx, "up to and with 10", told, ["grid 5", "grid 9", "first", "second", "third"])
    same(ctx, "now", scheduler.now, 10)
    gone = scheduler.after(1, lambda: told.append("never"))
    gone.cancel()
    same(ctx, "next without what is cancelled", scheduler.next_due_ns, 13)
    told.clear()
    found = scheduler.run_until(lambda: "late" in told, 100)
    same(ctx, "until", (found, scheduler.now), (True, 20))
    same(ctx, "not until", (scheduler.run_until(lambda: False, 3), scheduler.now), (False, 23))
    told.clear()
    again = scheduler.after(2, lambda: told.append(f"again {scheduler.now}"))
    scheduler.run_for(2)
    scheduler.again(again, 31)
    scheduler.post(lambda: told.append(f"posted {scheduler.now}"))
    scheduler.run_for(6)
    same(
        ctx,
        "again and posted",
        [one for one in told if "grid" not in one],
        ["again 25", "posted 25", "again 31"],
    )
    for name, call in (
        ("the past", lambda: scheduler.at(30, lambda: None)),
        ("a negative delay", lambda: scheduler.after(-1, lambda: None)),
        ("no period", lambda: scheduler.every(0, lambda: None)),
        ("a phase of a period", lambda: scheduler.every(4, lambda: None, phase_ns=4)),
        ("a negative phase", lambda: scheduler.every(4, lambda: None, phase_ns=-1)),
        ("a negative duration", lambda: scheduler.run_for(-1)),
        ("a negative timeout", lambda: scheduler.run_until(lambda: True, -1)),
    ):
        equal(ctx, f"{name} is refused", bool(raises(call, SchedulerError)), 1)
    same(ctx, "at once", scheduler.run_until(lambda: True, 0), True)
    inner: list[str] = []
    scheduler.after(1, lambda: inner.append(raises(lambda: scheduler.run_for(1), SchedulerError)))
    scheduler.run_for(2)
    equal(ctx, "waiting within an event is refused", bool(inner and inner[0]), 1)
    scheduler.move(lambda timer: 1000 if timer is again else None)
    same(ctx, "running", scheduler.running, False)


class _Counted:
    """A calculation that counts its steps."""

    def __init__(self) -> None:
        self.steps: list[int] = []
        self.scheduler = VirtualScheduler()

    def step(self) -> None:
        self.steps.append(self.scheduler.now)

    def calm(self) -> bool:
        return False

    def advance(self, steps: int) -> None:
        raise AssertionError(steps)


@CAMPAIGN.case("steps")
def steps(ctx: CaseContext) -> None:
    """Steps of a calculation come on their grid, before the events that were entered behind them."""
    counted = _Counted()
    scheduler = counted.scheduler
    seen: list[tuple[int, int]] = []
    scheduler.every(15, lambda: seen.append((scheduler.now, len(counted.steps))))
    scheduler.every_step(5, counted)
    scheduler.every(10, lambda: seen.append((scheduler.now, len(counted.steps))))
    same(ctx, "next", scheduler.next_due_ns, 0)
    scheduler.run_for(30)
    same(ctx, "steps", counted.steps, [0, 5, 10, 15, 20, 25, 30])
    same(ctx, "what events see", seen, [(0, 0), (0, 1), (10, 3), (15, 3), (20, 5), (30, 6), (30, 7)])
    scheduler.make_steps_events()
    scheduler.run_for(10)
    same(ctx, "as events", counted.steps[7:], [35, 40])


@CAMPAIGN.case("errors")
def errors(ctx: CaseContext) -> None:
    """Messages say where, what and what is allowed, name what is similar, and keep their parts when a place
    is put in front of them.
    """
    one = ConfigurationError("speed", 7, "1 to 5")
    same(ctx, "parts", (one.where, one.value, one.allowed), ("speed", 7, "1 to 5"))
    placed = one.within("bench.toml")
    equal(ctx, f"placed: {placed}", str(placed).startswith("bench.toml: ") and "1 to 5" in str(placed), 1)
    same(ctx, "parts of it", (type(placed), placed.value), (ConfigurationError, 7))
    other = MissingValueError("drive.node_id", "1 to 127")
    equal(ctx, f"{other}", "drive.node_id is missing" in str(other) and "1 to 127" in str(other), 1)
    same(ctx, "missing", (other.where, other.value, other.allowed), ("drive.node_id", None, "1 to 127"))
    both = CombinedConfigurationError([one, other])
    same(ctx, "lines", str(both).split("\n"), [str(one), str(other)])
    same(ctx, "first", (both.where, both.value, both.allowed), ("speed", 7, "1 to 5"))
    lines = str(both.within("a.toml")).split("\n")
    equal(ctx, f"each is placed: {lines}", all(line.startswith("a.toml: ") for line in lines), 1)
    near = UnknownNameError("fault", "drive.faul", "a kind of fault", ["drive.fault", "bus.cut"])
    equal(
        ctx, f"{near}", "drive.fault" in str(near) and "'drive.faul' is not a kind of fault" in str(near), 1
    )
    far = UnknownNameError("", "zzz", "a bench", ["alpha", "beta"], more="or a file")
    equal(ctx, f"{far}", "alpha, beta" in str(far) and "or a file" in str(far) and far.where == "zzz", 1)
    listed = UnknownNameError("x", "zzz", "a bench", ["alpha"], listed_by="hil benches list")
    equal(ctx, f"{listed}", "hil benches list" in str(listed) and "alpha" not in str(listed), 1)
    none = UnknownNameError("x", "zzz", "a bench", [])
    equal(ctx, f"{none}", "none" in str(none), 1)
    key = UnknownKeyError("drive.d", "nod_id", ["node_id", "segment"])
    equal(ctx, f"{key}", "did you mean node_id" in str(key) and str(key).startswith("drive.d: "), 1)
    strange = UnknownKeyError("drive.d", "zzz", ["node_id", "segment"])
    equal(ctx, f"{strange}", "unknown key; allowed: node_id, segment" in str(strange), 1)
