"""Parameter access of a PROFIdrive drive, record by record: every check with its error number, arrays,
several parameters, descriptions and texts, limits, states, lists, saving.
"""

from __future__ import annotations

import struct
from typing import Final

from hil.campaign import Campaign, CaseContext
from testcases.campaigns.modbus_services import READY, RUN, Client
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "profidrive parameters",
    controller="",
    tags=("modbus", "profidrive"),
    bench="testcases.campaigns.modbus_services:TCP",
)
VALUE, DESCRIPTION, TEXT = 0x10, 0x20, 0x30
WORD, DOUBLE = 0x42, 0x43
I16, U16, U32, REAL = 0x03, 0x06, 0x07, 0x08
RAMP_UP, RAMP_DOWN = 1120, 1121


class Records:
    """A plain client that asks for parameters by records.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self._ctx = ctx
        self.client = Client(ctx)

    def ask(self, request: bytes) -> bytes:
        """Return the answer to a record."""
        padded = request + b"\0" * (len(request) % 2)
        words = struct.unpack(f">{len(padded) // 2}H", padded)
        self.client.write(40_601, 1, 0x2F00 | len(request), *words)
        self._ctx.run_for(0.05)
        found = self.client.read(40_601, 122)
        length = found[1] & 0xFF
        return struct.pack(">120H", *found[2:])[:length] if found[0] == 2 else b""

    def read(self, number: int, sub: int = 0, count: int = 1, attribute: int = VALUE) -> tuple[int, bytes]:
        """Return format and values of a parameter; of one that is refused, format 44h and what comes with
        it.
        """
        answer = self.ask(struct.pack(">4B2B2H", 7, 1, 1, 1, attribute, count, number, sub))
        equal(self._ctx, "reference, object and number of parameters", answer[:4:2] == b"\7\1", 1, "PD-202")
        size = {0x44: 2}.get(answer[4])
        return answer[4], answer[6:] if size is None else answer[6 : 6 + size * answer[5]]

    def real(self, number: int, sub: int = 0) -> float:
        """Return a parameter that is a REAL32."""
        code, data = self.read(number, sub)
        return float(struct.unpack(">f", data)[0]) if code == REAL else -999.0

    def word(self, number: int, sub: int = 0, count: int = 1) -> tuple[int, ...]:
        """Return words of a parameter."""
        _, data = self.read(number, sub, count)
        return struct.unpack(f">{count}H", data[: 2 * count])

    def write(self, number: int, code: int, data: bytes, sub: int = 0, count: int = 1) -> int:
        """Write values; return the error number, -1 for none."""
        size = {WORD: 2, DOUBLE: 4, REAL: 4}.get(code, 2)
        values = struct.pack(">BB", code, len(data) // size) + data
        request = struct.pack(">4B2B2H", 9, 2, 1, 1, VALUE, count, number, sub) + values
        answer = self.ask(request)
        return -1 if answer[1] == 2 else int.from_bytes(answer[6:8], "big")

    def set_real(self, number: int, value: float, sub: int = 0) -> int:
        """Write a REAL32; return the error number, -1 for none."""
        return self.write(number, REAL, struct.pack(">f", value), sub)

    def same(self, what: str, found: object, wanted: object, *ids: str) -> None:
        """Expect a value of any kind."""
        equal(self._ctx, f"{what} is {wanted} (it is {found})", found == wanted, 1, *ids)


EXCHANGES: Final = {
    "read-a-display": ("80 01 01 01 1001 0002 0000", "80 01 01 01 0301 002A"),
    "read-no-array": ("81 01 01 01 1000 0460 0000", "81 01 01 01 0801 41200000"),
    "read-part-of-an-array": ("82 01 01 01 1002 0B56 0002", "82 01 01 01 0802 41200000 41A00000"),
    "read-bytes": ("83 01 01 01 1002 03C5 0000", "83 01 01 01 0A02 032A"),
    "write-a-float": ("84 02 01 01 1001 0460 0000 0801 40A00000", "84 02 01 01"),
    "write-a-float-as-double-word": ("85 02 01 01 1001 0460 0000 4301 40A00000", "85 02 01 01"),
    "write-a-word": ("86 02 01 01 1001 039D 0000 4201 0005", "86 02 01 01"),
    "read-two": ("87 01 01 02 1001 0002 0000 1001 0460 0000", "87 01 01 02 0301 002A 0801 41200000"),
    "read-one-of-two": ("88 01 01 02 1001 0001 0000 1001 0002 0000", "88 81 01 02 4401 0000 0301 002A"),
    "write-one-of-two": (
        "89 02 01 02 1001 0460 0000 1001 0002 0000 0801 40A00000 4201 0001",
        "89 82 01 02 4000 4402 0001 0000",
    ),
    "service": ("01 03 01 01 1001 0002 0000", "01 83 01 01 4401 0021"),
    "drive-object": ("01 01 07 01 1001 0002 0000", "01 81 07 01 4401 0019"),
    "too-many": ("01 01 01 28" + "1001 0002 0000" * 39, "01 81 01 01 4401 0022"),
    "none": ("01 01 01 00", "01 81 01 01 4401 0018"),
    "address-missing": ("01 01 01 02 1001 0002 0000", "01 81 01 01 4401 0018"),
    "attribute": ("01 01 01 01 4001 0002 0000", "01 81 01 01 4401 0016"),
    "too-many-elements": ("01 01 01 01 10EB 03D4 0000", "01 81 01 01 4401 0016"),
    "array-without-elements": ("01 01 01 01 1000 03D4 0000", "01 81 01 01 4401 0016"),
    "unknown": ("01 01 01 01 1001 0001 0000", "01 81 01 01 4401 0000"),
    "no-array-sub-index": ("01 01 01 01 1001 0460 0001", "01 81 01 01 4401 0004"),
    "no-array-elements": ("01 01 01 01 1002 0460 0000", "01 81 01 01 4401 0004"),
    "beyond-the-end": ("01 01 01 01 1003 03CE 0001", "01 81 01 01 4402 0003 0003"),
    "behind-the-end": ("01 01 01 01 1001 03CE 0007", "01 81 01 01 4402 0003 0007"),
    "no-text": ("01 01 01 01 3000 0460 0000", "01 81 01 01 4401 000F"),
    "description-part": ("01 01 01 01 2001 0460 000D", "01 81 01 01 4402 0003 000D"),
    "answer-too-long": ("01 01 01 01 10EA 03B4 0000", "01 81 01 01 4402 0003 0040"),
    "write-description": ("01 02 01 01 2001 0460 0000 4201 0009", "01 82 01 01 4402 0007 0000"),
    "write-no-text": ("01 02 01 01 3001 0460 0000 4201 0009", "01 82 01 01 4401 000F"),
    "write-text": ("01 02 01 01 3001 03C4 0000 4201 0009", "01 82 01 01 4401 0020"),
    "write-read-only": ("01 02 01 01 1001 03B0 0000 4201 0009", "01 82 01 01 4402 0001 0000"),
    "write-too-many-values": ("01 02 01 01 1001 039D 0000 4202 0009 0009", "01 82 01 01 4401 0018"),
    "write-half-a-value": ("01 02 01 01 1001 039D 0000 4201 00", "01 82 01 01 4401 0018"),
    "write-nothing": ("01 02 01 01 1001 039D 0000", "01 82 01 01 4401 0018"),
    "write-format": ("01 02 01 01 1001 039D 0000 9901 0009", "01 82 01 01 4401 0017"),
    "write-format-zero": ("01 02 01 01 1001 039D 0000 4000", "01 82 01 01 4401 0017"),
    "write-format-error": ("01 02 01 01 1001 039D 0000 4401 0009", "01 82 01 01 4401 0017"),
    "write-size": ("01 02 01 01 1001 039D 0000 4301 00000009", "01 82 01 01 4401 0005"),
    "write-type": ("01 02 01 01 1001 039D 0000 0301 0009", "01 82 01 01 4401 0005"),
    "write-value": ("01 02 01 01 1001 000A 0000 4201 0007", "01 82 01 01 4402 0014 0000"),
    "write-reset-only": ("01 02 01 01 1001 03B8 0000 4201 0001", "01 82 01 01 4402 0006 0000"),
    "write-commissioning": ("01 02 01 01 1001 0137 0000 0801 41200000", "01 82 01 01 4401 006B"),
}
"""Request and answer, hexadecimal: 0460h is p1120 = 10, 039Dh p0925, 03D4h p0980; r0002 = 2Ah is OFF2."""


@CAMPAIGN.case(
    "exchanges",
    requirements=(
        "PD-199",
        "PD-200",
        "PD-201",
        "PD-202",
        "PD-203",
        "PD-205",
        "PD-207",
        "PD-208",
        "PD-210",
        "PD-211",
        "PD-213",
        "PD-214",
        "PD-215",
        "PD-216",
        "PD-217",
        "PD-220",
        "PD-222",
        "PD-224",
        "PD-225",
        "PD-226",
        "PD-227",
        "PD-228",
        "PD-229",
        "PD-230",
    ),
)
def exchanges(ctx: CaseContext) -> None:
    """Request by request with the bytes of its answer; a request that is refused changes nothing."""
    records = Records(ctx)
    records.set_real(RAMP_UP, 10.0)
    for what, (request, answer) in EXCHANGES.items():
        before = records.real(RAMP_UP), records.word(925)
        found = records.ask(bytes.fromhex(request))
        records.same(f"answer to {what}", found.hex(" "), bytes.fromhex(answer).hex(" "), "PD-207")
        after = records.real(RAMP_UP), records.word(925)
        if "82 01 01" in answer:
            records.same(f"p1120 and p0925 after {what}", after, before, "PD-207")
        if what in ("write-a-float", "write-a-float-as-double-word", "write-one-of-two"):
            records.same("p1120", after[0], 5.0, "PD-201")
            records.set_real(RAMP_UP, 10.0)
        if what == "write-a-word":
            records.same("p0925", after[1], (5,), "PD-201")


LIMITS: Final = (
    (1120, 0.0, 999_999.0),
    (1121, 0.0, 999_999.0),
    (1130, 0.0, 30.0),
    (1131, 0.0, 30.0),
    (1135, 0.0, 5400.0),
    (1136, 0.0, 30.0),
    (1137, 0.0, 30.0),
    (1058, -210_000.0, 210_000.0),
    (1059, -210_000.0, 210_000.0),
    (1083, 0.0, 210_000.0),
    (1086, -210_000.0, 0.0),
    (1082, 0.1, 210_000.0),
    (1226, 0.01, 210_000.0),
    (1227, 0.001, 300.0),
    (1544, 0.0, 100.0),
    (2000, 6.0, 210_000.0),
    (2003, 0.01, 20_000_000.0),
    (2040, 0.0, 2_000_000.0),
    (2194, 0.0, 100.0),
)
"""Parameters with the ends of their range."""


@CAMPAIGN.case("limits", requirements=("PD-212", "PD-269", "PD-271", "PD-200"))
def limits(ctx: CaseContext) -> None:
    """Both ends of a range are taken, the next number beyond them is refused and changes nothing; the
    description names the same ends.
    """
    records = Records(ctx)
    for number, low, high in LIMITS:
        step = max(abs(high), abs(low)) * 1e-6
        for value, code in ((low, -1), (high, -1), (low - max(step, 1e-4), 2), (high + step, 2)):
            found = records.set_real(number, value)
            equal(ctx, f"error number of p{number} = {value:g}", found, code, "PD-212")
        equal(ctx, f"p{number}", records.real(number), high, "PD-212", within=abs(high) * 1e-6)
        _, description = records.read(number, 0, 1, DESCRIPTION)
        ends = struct.unpack(">ff", description[30:38])
        equal(ctx, f"lower end in the description of p{number}", ends[0], low, "PD-200", within=1e-6)
        equal(ctx, f"upper end in the description of p{number}", ends[1], high, "PD-200", within=high * 1e-6)


@CAMPAIGN.case("descriptions", requirements=("PD-200", "PD-209", "PD-218"))
def descriptions(ctx: CaseContext) -> None:
    """The description has 46 bytes in twelve parts: type, array, read-only, reset-only, texts, changed; texts
    of elements have sixteen characters.
    """
    records = Records(ctx)
    for number, identifier, elements, name in (
        (1227, 0x0108, 0, b"standstill time"),
        (944, 0x0306, 0, b"fault counter"),
        (952, 0x2106, 0, b"fault situations"),
        (964, 0x4706, 6, b"device ident."),
        (2902, 0x4308, 15, b"fixed values"),
    ):
        code, whole = records.read(number, 0, 1, DESCRIPTION)
        equal(ctx, f"format of the description of {number}", code, 0x0A, "PD-200")
        equal(ctx, "its length", len(whole), 46, "PD-200")
        records.same(
            "identifier, elements", struct.unpack(">HH", whole[:4]), (identifier, elements), "PD-200"
        )
        records.same("name", whole[14:30], name.ljust(16), "PD-200")
        at = 0
        for part, length in enumerate((2, 2, 4, 2, 4, 16, 4, 4, 2, 2, 2, 2), 1):
            records.same(
                f"part {part}",
                records.read(number, part, 1, DESCRIPTION)[1][:length],
                whole[at : at + length],
                "PD-200",
            )
            at += length
    records.set_real(1227, 3.0)
    _, whole = records.read(1227, 0, 1, DESCRIPTION)
    equal(ctx, "identifier of a changed parameter", int.from_bytes(whole[:2], "big"), 0x1108, "PD-200")
    texts = (b"manufacturer", b"type", b"firmware version", b"year", b"day and month", b"drive objects")
    code, found = records.read(964, 0, 6, TEXT)
    equal(ctx, "format of texts", code, 0x09, "PD-209")
    records.same("texts", found, b"".join(text.ljust(16) for text in texts), "PD-209")
    records.same("two of them", records.read(964, 3, 2, TEXT)[1], found[48:80], "PD-209")
    records.same("beyond them", records.read(964, 5, 2, TEXT), (0x44, b"\0\3\0\6"), "PD-213")


@CAMPAIGN.case("lists", requirements=("PD-256", "PD-257"))
def lists(ctx: CaseContext) -> None:
    """p0980 and following list all parameters in ascending order, each of which can be read; p0990 those that
    differ from the factory setting.
    """
    records = Records(ctx)
    numbers: list[int] = []
    page = 980
    size = int.from_bytes(records.read(page, 0, 1, DESCRIPTION)[1][2:4], "big")
    while page:
        words = [word for at in range(0, size, 39) for word in records.word(page, at, min(39, size - at))]
        listed = [number for number in words[:-1] if number]
        numbers += listed
        page = words[-1]
    records.same("ascending, each once", numbers, sorted(set(numbers)), "PD-256")
    for number in (2, 10, 922, 925, 944, 964, 980, 990, 1120, 2000, 61_000):
        equal(ctx, f"{number} is listed", number in numbers, 1, "PD-256")
    for number in (1, 3, 963, 1119):
        equal(ctx, f"{number} is listed", number in numbers, 0, "PD-256")
    refused = [number for number in numbers if records.read(number)[0] == 0x44]
    records.same("listed parameters that cannot be read", refused, [], "PD-256")
    before = set(records.word(990, 0, size)) - {0}
    records.set_real(1136, 1.25)
    records.write(925, WORD, b"\0\7")
    after = set(records.word(990, 0, size)) - {0}
    records.same("changed parameters", after - before, {1136, 925}, "PD-257")
    records.set_real(1136, 0.0)
    records.same("and set back", set(records.word(990, 0, size)) - {0} - before, {925}, "PD-257")


@CAMPAIGN.case(
    "identity", requirements=("PD-235", "PD-237", "PD-243", "PD-247", "PD-248", "PD-252", "PD-253", "PD-254")
)
def identity(ctx: CaseContext) -> None:
    """What the device says of itself: telegram, words, profile, records, drive objects."""
    records = Records(ctx)
    for number, words in (
        (922, (1,)),
        (925, (1,)),
        (930, (1,)),
        (950, (8, 8)),
        (974, (240, 39)),
        (978, (1, 0)),
    ):
        records.same(f"p{number}", records.word(number, 0, len(words)), words, "PD-235")
    records.same("r0965", records.read(965, 0, 2), (0x0A, b"\x03\x2a"), "PD-248")
    device, axis = records.word(964, 0, 6), records.word(975, 0, 8)
    records.same("manufacturer, version, date", (device[0], *device[2:5]), (axis[0], *axis[2:5]), "PD-253")
    equal(ctx, "number of drive objects", device[5], 1, "PD-247")
    records.same("class and DO-ID", (axis[5], axis[7]), (1, 1), "PD-253")
    for number, setpoints in ((915, (967, 0)), (916, (968, 0))):
        del setpoints
        words = records.word(number, 0, 3)
        equal(ctx, f"words assigned in p{number}", sum(word > 0 for word in words), 2, "PD-233")
    records.same("signals of telegram 1", set(records.word(923, 0, 64)) - {0} >= {1, 2, 5, 6}, True, "PD-236")


@CAMPAIGN.case("states", requirements=("PD-221", "PD-231", "PD-219", "PD-239"))
def states(ctx: CaseContext) -> None:
    """p0930 changes in S1, p1082 without pulses, p0304 in commissioning; without control of parameters
    nothing but that can be written.
    """
    records = Records(ctx)
    client = records.client
    records.set_real(2040, 0.0)
    client.keep(0.05, READY)
    equal(ctx, "r0002 in S2", records.word(2)[0], 31, "PD-259")
    equal(ctx, "p0930 out of S1", records.write(930, WORD, b"\0\1"), 0x11, "PD-221")
    client.keep(0.1, 0x0400)
    equal(ctx, "p0930 in S1", records.write(930, WORD, b"\0\1"), -1, "PD-239")
    equal(ctx, "p1082 without pulses", records.set_real(1082, 2900.0), -1, "PD-231")
    equal(ctx, "p0304 in operation", records.set_real(304, 380.0), 0x6B, "PD-231")
    records.write(10, WORD, b"\0\1")
    equal(ctx, "p0304 in commissioning", records.set_real(304, 380.0), -1, "PD-231")
    equal(ctx, "p0304", records.real(304), 380.0, "PD-231")
    equal(ctx, "r0002 in commissioning", records.word(2)[0], 46, "PD-259")
    records.write(10, WORD, b"\0\0")
    equal(ctx, "p0304 after it", records.set_real(304, 390.0), 0x6B, "PD-231")
    client.enable()
    padded = struct.pack(">4B2B2HBBf", 9, 2, 1, 1, VALUE, 1, 1082, 0, REAL, 1, 2000.0)
    client.write(40_601, 1, 0x2F00 | len(padded), *struct.unpack(">8H", padded))
    client.keep(0.06, RUN)
    found = client.read(40_601, 8)
    equal(ctx, "p1082 with pulses: error number", struct.pack(">6H", *found[2:8])[7], 0x77, "PD-231")
    equal(ctx, "r0002 in operation", client.read(40_110)[0] & 4, 4)
    client.keep(0.3, 0x0400)
    equal(ctx, "control of parameters given away", records.write(927, WORD, b"\0\0"), -1, "PD-219")
    equal(ctx, "p1120 without it", records.set_real(RAMP_UP, 7.0), 0x0B, "PD-219")
    equal(ctx, "control taken back", records.write(927, WORD, b"\0\1"), -1, "PD-219")
    equal(ctx, "p1120 with it", records.set_real(RAMP_UP, 7.0), -1, "PD-219")


@CAMPAIGN.product(
    "saved/{save}-{load}",
    parameters=[
        {"save": 971, "load": 970},
        {"save": 977, "load": 976},
    ],
    title="p{save} saves, p{load} loads",
    requirements=("PD-250",),
)
def saved(ctx: CaseContext, save: int, load: int) -> None:
    """What is saved comes back, what is not does not; 1 gives the factory settings, 10 what was saved; the
    parameter returns to 0.
    """
    records = Records(ctx)
    factory = records.real(RAMP_DOWN)
    records.set_real(RAMP_DOWN, 2.5)
    equal(ctx, "saving", records.write(save, WORD, b"\0\1"), -1, "PD-250")
    ctx.run_for(0.1)
    equal(ctx, f"p{save} afterwards", records.word(save)[0], 0, "PD-250")
    records.set_real(RAMP_DOWN, 3.5)
    equal(ctx, "loading", records.write(load, WORD, b"\0\x0a"), -1, "PD-250")
    ctx.run_for(0.1)
    equal(ctx, "p1121", records.real(RAMP_DOWN), 2.5, "PD-250")
    equal(ctx, f"p{load} afterwards", records.word(load)[0], 0, "PD-250")
    records.set_real(RAMP_DOWN, 3.5)
    equal(ctx, "factory settings", records.write(load, WORD, b"\0\1"), -1, "PD-250")
    ctx.run_for(0.1)
    equal(ctx, "p1121", records.real(RAMP_DOWN), 10.0, "PD-250", within=abs(factory - 10.0) + 1e-3)
    equal(ctx, "a value that there is not", records.write(load, WORD, b"\0\2"), 0x14, "PD-250")


@CAMPAIGN.case("longest", requirements=("PD-206", "PD-223", "PD-230"))
def longest(ctx: CaseContext) -> None:
    """39 parameters fit into a record, and what does not fit into the answer is refused alone; 240 bytes are
    the end.
    """
    records = Records(ctx)
    address = struct.pack(">2B2H", VALUE, 1, 2, 0)
    answer = records.ask(struct.pack(">4B", 1, 1, 1, 39) + address * 39)
    records.same("answer", answer, struct.pack(">4B", 1, 1, 1, 39) + bytes.fromhex("0301002A") * 39, "PD-230")
    code, data = records.read(980, 0, 100)
    records.same("format and length of 100 words", (code, len(data)), (U16, 200), "PD-223")
    long = struct.pack(">2B2H", VALUE, 64, 947, 0)
    answer = records.ask(struct.pack(">4B", 1, 1, 1, 3) + long * 2 + address)
    records.same("length of the first part", (answer[4], answer[5]), (U16, 64), "PD-223")
    records.same("the second part", answer[134:138].hex(), "44010015", "PD-223")
    records.same("the third part", answer[138:].hex(), "0301002a", "PD-223")
    equal(ctx, "bytes of the answer", len(answer), 142, "PD-223")
