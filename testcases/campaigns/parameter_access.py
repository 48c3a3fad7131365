"""Parameters of a PROFIdrive device by themselves: lists from files, every check of an access in its order
and with its error number, what the device computes, limits in force, saving.
"""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from emulators.drive.profidrive.parameters.definitions import (
    ParameterDefinition,
    WriteRule,
    load_definitions,
    range_of,
)
from emulators.drive.profidrive.parameters.server import ParameterServer
from emulators.drive.profidrive.parameters.store import ParameterStore
from fieldbus.profidrive import TypeCode
from fieldbus.profidrive.errors import ParameterAccessError
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.device_settings import refused
from testcases.campaigns.support import raises, same

CAMPAIGN: Final = Campaign(
    "parameter access", controller="", tags=("profidrive",), bench="testcases.campaigns.can_bus:BENCH"
)

GOOD: Final = """
[parameters]
p0300 = { type = "U16", text = "choice", values = [1, 4], default = 4, write = "S1" }
r0100 = { type = "F32", text = "speed", unit = "rpm", default = 0.1 }
p0200 = { type = "I16", size = 3, default = [-1, 0, 1], low = -5, high = 5, texts = ["a", "b"], save = false }
p1 = { type = "STRING", size = 4, default = "ab" }
p65535 = { type = "U8", size = 1024 }
p0400 = { type = "F32", low = -0.1, high = 0.1, write = "reset" }
"""
FILES: Final[tuple[tuple[str, str], ...]] = (
    ("[parameters]\n", ""),
    (GOOD, ""),
    ("", ".toml"),
    ("parameters = 1\n", ".toml"),
    ("[parameters]\n[others]\n", ".toml"),
    ('[parameters]\np1 = { type = "U8" }\nr0001 = { type = "U8" }', "r0001"),
    *((f'[parameters]\n{key} = {{ type = "U8" }}', key) for key in ("x1", "p", "P1", "p123456", "p1a")),
    ('[parameters]\np0 = { type = "U8" }', "parameter number"),
    ('[parameters]\np65536 = { type = "U8" }', "parameter number"),
    ("[parameters]\np1 = 1", "p1"),
    ('[parameters]\np1 = { type = "U8", colour = 1 }', "p1"),
    ("[parameters]\np1 = {}", "p1, type"),
    ('[parameters]\np1 = { type = "u8" }', "p1, type"),
    *(
        (f'[parameters]\np1 = {{ type = "U8", {row} }}', f"p1, {row.split(' ')[0]}")
        for row in (
            "size = 0",
            "size = 1025",
            "size = true",
            "size = 1.0",
            'write = "never"',
            'write = "sometimes"',
            'low = "1"',
            "low = true",
            "high = inf",
            "high = nan",
            "text = 1",
            "unit = 1",
            "save = 1",
            "default = 1.5",
            "default = true",
            "default = [1, 2]",
            "default = []",
            'default = "a"',
        )
    ),
    ('[parameters]\nr1 = { type = "U8", write = "always" }', "r1, write"),
    ('[parameters]\nr1 = { type = "U8", write = "never" }', ""),
    ('[parameters]\np1 = { type = "U8", size = 2, default = [1] }', "p1, default"),
    ('[parameters]\np1 = { type = "F32", default = 3.5e38 }', "p1, default"),
    ('[parameters]\np1 = { type = "F32", default = 3.4e38 }', ""),
    ('[parameters]\np1 = { type = "F32", default = nan }', "p1, default"),
    ('[parameters]\np1 = { type = "STRING", size = 2, default = "abc" }', "p1, default"),
    ('[parameters]\np1 = { type = "STRING", size = 3, default = "abc" }', ""),
    ('[parameters]\np1 = { type = "U8", values = [1.0] }', "p1"),
    ('[parameters]\np1 = { type = "U8", values = "1" }', "p1"),
    ('[parameters]\np1 = { type = "U8", texts = [1] }', "p1"),
    ('[parameters]\np1 = { type = "U8", low = 5, high = 4, default = 5 }', "p0001 low, high"),
    ('[parameters]\np1 = { type = "U8", low = 5, high = 5, default = 5 }', ""),
    ('[parameters]\np1 = { type = "U8", low = 5, default = 4 }', "p0001 default"),
    ('[parameters]\np1 = { type = "U8", high = 5, default = 6 }', "p0001 default"),
    ('[parameters]\np1 = { type = "U8", values = [1, 3], default = 2 }', "p0001 default"),
    ('[parameters]\np1 = { type = "U8", default = 256 }', "p0001 default"),
    ('[parameters]\np1 = { type = "U8", default = 255 }', ""),
    ('[parameters]\np1 = { type = "I8", default = -128 }', ""),
    ('[parameters]\np1 = { type = "I8", default = -129 }', "p0001 default"),
    ('[parameters]\np1 = { type = "BOOL", default = 2 }', "p0001 default"),
)
"""Content of a file, and what it is refused for; empty: it is taken."""


@CAMPAIGN.case("lists-from-files", requirements=("PD-199", "PD-209"))
def lists_from_files(ctx: CaseContext) -> None:
    """A list of parameters says what is wrong with it under its name and key; what a row does not say has the
    value that the description of the file gives.
    """
    with TemporaryDirectory() as folder:
        path = Path(folder) / "own.toml"
        for text, where in FILES:
            path.write_text(text, encoding="utf-8")
            said = refused(load_definitions, path=path)
            fits = where in said if where else not said
            same(ctx, f"{text!r} says {said!r}, about {where!r}", fits, wanted=True)
        path.write_text(GOOD, encoding="utf-8")
        found = {one.number: one for one in load_definitions(path)}
    same(ctx, "numbers, ascending", tuple(found), (1, 100, 200, 300, 400, 65_535), "PD-199")
    rules = ("always", "never", "always", "S1", "reset", "always")
    same(ctx, "write rules", tuple(str(one.write) for one in found.values()), rules)
    names = ("p0001", "r0100", "p0200", "p0300", "p0400", "p65535")
    same(ctx, "names", tuple(one.name for one in found.values()), names)
    same(ctx, "elements", tuple(one.elements for one in found.values()), (4, 1, 3, 1, 1, 1024), "PD-199")
    sizes = (4, None, 3, None, None, 1024)
    same(ctx, "sizes", tuple(one.size for one in found.values()), sizes)
    same(ctx, "texts", tuple(one.text for one in found.values()), ("", "speed", "", "choice", "", ""))
    same(ctx, "units", (found[100].unit, found[200].unit), ("rpm", ""))
    same(
        ctx, "what is saved", tuple(one.save for one in found.values()), (True, True, False, True, True, True)
    )
    same(ctx, "a string", found[1].defaults, (97, 98, 0, 0), "PD-209")
    same(ctx, "a float is one of single precision", found[100].defaults, (0.10000000149011612,))
    same(ctx, "a list of defaults", found[200].defaults, (-1, 0, 1))
    same(ctx, "one default for all", set(found[65_535].defaults), {0})
    same(ctx, "limits", found[200].limits, (-5, 5), "PD-212")
    same(ctx, "limits of single precision", found[400].limits, (-0.10000000149011612, 0.10000000149011612))
    same(ctx, "limits of the type", found[65_535].limits, (0, 255), "PD-212")
    same(ctx, "permitted values", found[300].values, frozenset({1, 4}), "PD-222")
    same(ctx, "texts of elements", found[200].texts, ("a", "b"))


RANGES: Final[tuple[tuple[TypeCode, float, float], ...]] = (
    (TypeCode.BOOLEAN, 0, 1),
    (TypeCode.INTEGER8, -128, 127),
    (TypeCode.INTEGER16, -32_768, 32_767),
    (TypeCode.INTEGER32, -2_147_483_648, 2_147_483_647),
    (TypeCode.UNSIGNED8, 0, 255),
    (TypeCode.UNSIGNED16, 0, 65_535),
    (TypeCode.UNSIGNED32, 0, 4_294_967_295),
    (TypeCode.N2, -32_768, 32_767),
    (TypeCode.N4, -2_147_483_648, 2_147_483_647),
    (TypeCode.V2, 0, 65_535),
    (TypeCode.OCTET_STRING, 0, 255),
    (TypeCode.VISIBLE_STRING, 0, 255),
)
"""Whole-numbered data types and their ends."""
LARGEST: Final = 3.4028234663852886e38


@CAMPAIGN.case("fitted", requirements=("PD-199", "PD-215"))
def fitted(ctx: CaseContext) -> None:
    """What a device computes is shown rounded and held at the ends of the data type; values in a format of
    the same size are those bytes.
    """
    for code, low, high in RANGES:
        one = ParameterDefinition(number=1, type=code)
        same(ctx, f"range of {code.name}", range_of(code), (low, high), "PD-199")
        found = tuple(one.fitted(value) for value in (low - 1, low, high, high + 1, 0.6, math.nan, math.inf))
        same(ctx, f"{code.name} at its ends", found, (low, low, high, high, 1, 0, high), "PD-199")
    real = ParameterDefinition(number=1, type=TypeCode.FLOAT32)
    found = tuple(real.fitted(value) for value in (0.1, 1e39, -1e39, math.nan))
    same(ctx, "FLOAT32 at its ends", found, (0.10000000149011612, LARGEST, -LARGEST, 0), "PD-199")
    same(ctx, "a double word as a float", real.reinterpreted(0x43, 0x3F80_0000), 1.0, "PD-215")
    same(ctx, "a float as it is", real.reinterpreted(TypeCode.FLOAT32, 2.5), 2.5, "PD-215")
    signed = ParameterDefinition(number=1, type=TypeCode.INTEGER16)
    same(ctx, "a word as a number with sign", signed.reinterpreted(0x42, 0xFFFF), -1, "PD-215")
    date = raises(lambda: signed.reinterpreted(TypeCode.INTEGER16, b"1"), ParameterAccessError)
    same(ctx, "bytes are no number", date != "", wanted=True)


def _parameter(number: int, code: TypeCode = TypeCode.UNSIGNED16, **options: Any) -> ParameterDefinition:
    given: dict[str, Any] = {"write": WriteRule.ALWAYS, "text": f"p{number}"} | options
    given.setdefault("defaults", (0,) * (given.get("size") or 1))
    return ParameterDefinition(number=number, type=code, **given)


def _store() -> ParameterStore:
    return ParameterStore(
        (
            _parameter(10),
            _parameter(100, low=5, high=50, defaults=(7,)),
            _parameter(101, size=4, defaults=(1, 2, 3, 4), high=100),
            _parameter(102, write=WriteRule.NEVER),
            _parameter(103, size=3, texts=("first", "second")),
            _parameter(104, text=""),
            _parameter(105, values=frozenset({0, 2, 9})),
            _parameter(106, write=WriteRule.RESET),
            _parameter(107, write=WriteRule.INHIBITED),
            _parameter(108, write=WriteRule.PULSES_OFF),
            _parameter(109, write=WriteRule.COMMISSIONING),
            _parameter(110, TypeCode.VISIBLE_STRING, size=12),
            _parameter(111, TypeCode.UNSIGNED32, size=234),
            _parameter(112, save=False, defaults=(3,)),
            _parameter(927, TypeCode.V2, defaults=(1,)),
        )
    )


ASKED: Final[tuple[tuple[str, str, str, str], ...]] = (
    ("a header cut off", "", "00 80 00 01 44 01 0018", "PD-226"),
    ("three bytes", "05 01 01", "05 81 01 01 44 01 0018", "PD-226"),
    ("a service that there is not", "05 03 09 FF", "05 83 09 01 44 01 0021", "PD-207"),
    ("service 0", "05 00 01 01 1000 0064 0000", "05 80 01 01 44 01 0021", "PD-229"),
    ("another drive object before the number", "05 01 09 FF", "05 81 09 01 44 01 0019", "PD-207"),
    ("drive object 0", "05 01 00 01 1000 0064 0000", "05 81 00 01 44 01 0019", "PD-227"),
    ("40 parameters before their addresses", "05 01 01 28", "05 81 01 01 44 01 0022", "PD-207"),
    ("39 parameters without addresses", "05 01 01 27", "05 81 01 01 44 01 0018", "PD-230"),
    ("no parameter", "05 01 01 00", "05 81 01 01 44 01 0018", "PD-226"),
    ("one value", "05 01 01 01 1000 0064 0000", "05 01 01 01 06 01 0007", "PD-202"),
    ("one value of one", "05 01 01 01 1001 0064 0000", "05 01 01 01 06 01 0007", "PD-208"),
    ("two values of one", "05 01 01 01 1002 0064 0000", "05 81 01 01 44 01 0004", "PD-214"),
    ("element 1 of one", "05 01 01 01 1001 0064 0001", "05 81 01 01 44 01 0004", "PD-214"),
    ("the last element", "05 01 01 01 1001 0065 0003", "05 01 01 01 06 01 0004", "PD-199"),
    ("all elements", "05 01 01 01 1004 0065 0000", "05 01 01 01 06 04 0001 0002 0003 0004", "PD-199"),
    ("one beyond", "05 01 01 01 1004 0065 0001", "05 81 01 01 44 02 0003 0004", "PD-213"),
    ("an element that there is not", "05 01 01 01 1001 0065 0004", "05 81 01 01 44 02 0003 0004", "PD-213"),
    ("one far behind", "05 01 01 01 1001 0065 0064", "05 81 01 01 44 02 0003 0064", "PD-213"),
    ("no elements of an array", "05 01 01 01 1000 0065 0000", "05 81 01 01 44 01 0016", "PD-208"),
    ("234 elements", "05 01 01 01 10EA 0065 0000", "05 81 01 01 44 02 0003 0004", "PD-224"),
    ("235 elements", "05 01 01 01 10EB 0065 0000", "05 81 01 01 44 01 0016", "PD-224"),
    ("attribute 00h", "05 01 01 01 0001 0064 0000", "05 81 01 01 44 01 0016", "PD-224"),
    ("attribute before number", "05 01 01 01 4001 03E8 0000", "05 81 01 01 44 01 0016", "PD-208"),
    ("no such parameter", "05 01 01 01 1001 03E8 0000", "05 81 01 01 44 01 0000", "PD-210"),
    ("58 double words", "05 01 01 01 103A 006F 0000", "05 01 01 01 07 3A" + 58 * "00000000", "PD-223"),
    ("59 double words", "05 01 01 01 103B 006F 0000", "05 81 01 01 44 01 0015", "PD-223"),
    ("no texts", "05 01 01 01 3001 0064 0000", "05 81 01 01 44 01 000F", "PD-220"),
    (
        "one text",
        "05 01 01 01 3001 0067 0001",
        "05 01 01 01 09 10" + b"second".ljust(16).hex(),
        "PD-220",
    ),
    (
        "both texts",
        "05 01 01 01 3002 0067 0000",
        "05 01 01 01 09 20" + (b"first".ljust(16) + b"second".ljust(16)).hex(),
        "PD-220",
    ),
    ("a text that there is not", "05 01 01 01 3001 0067 0002", "05 81 01 01 44 02 0003 0002", "PD-213"),
    ("texts beyond the last", "05 01 01 01 3002 0067 0001", "05 81 01 01 44 02 0003 0002", "PD-213"),
    ("no description", "05 01 01 01 2000 0068 0000", "05 81 01 01 44 01 0009", "PD-218"),
    ("two descriptions", "05 01 01 01 2002 0064 0000", "05 81 01 01 44 01 0016", "PD-224"),
    ("description, part 12", "05 01 01 01 2001 0064 000C", "05 01 01 01 0A 02 0000", "PD-199"),
    ("description, part 13", "05 01 01 01 2001 0064 000D", "05 81 01 01 44 02 0003 000D", "PD-213"),
    ("description, elements", "05 01 01 01 2001 0065 0002", "05 01 01 01 0A 02 0004", "PD-199"),
    ("description, no elements", "05 01 01 01 2001 0064 0002", "05 01 01 01 0A 02 0000", "PD-199"),
    ("description, identifier", "05 01 01 01 2001 0064 0001", "05 01 01 01 0A 02 0106", "PD-199"),
    ("... of an array with texts", "05 01 01 01 2001 0067 0001", "05 01 01 01 0A 02 4506", "PD-199"),
    ("... of one to be read", "05 01 01 01 2001 0066 0001", "05 01 01 01 0A 02 0306", "PD-199"),
    ("... of one to be reset", "05 01 01 01 2001 006A 0001", "05 01 01 01 0A 02 2106", "PD-199"),
    ("description, lowest value", "05 01 01 01 2001 0064 0007", "05 01 01 01 0A 04 00000005", "PD-199"),
    ("description, highest value", "05 01 01 01 2001 0064 0008", "05 01 01 01 0A 04 00000032", "PD-199"),
    ("a byte too many", "05 01 01 01 1000 0064 0000 00", "05 81 01 01 44 01 0018", "PD-208"),
    ("... after what is refused", "05 01 01 01 1000 03E8 0000 00", "05 81 01 01 44 01 0000", "PD-208"),
    ("the lowest value", "05 02 01 01 1000 0064 0000 42 01 0005", "05 02 01 01", "PD-212"),
    ("less", "05 02 01 01 1000 0064 0000 42 01 0004", "05 82 01 01 44 02 0002 0000", "PD-212"),
    ("the highest value", "05 02 01 01 1001 0064 0000 06 01 0032", "05 02 01 01", "PD-212"),
    ("more", "05 02 01 01 1000 0064 0000 42 01 0033", "05 82 01 01 44 02 0002 0000", "PD-212"),
    ("the highest value stayed", "05 01 01 01 1000 0064 0000", "05 01 01 01 06 01 0032", "PD-212"),
    (
        "... it is changed",
        "05 01 01 01 2001 0064 0001",
        "05 01 01 01 0A 02 1106",
        "PD-199",
    ),
    (
        "one wrong element of two",
        "05 02 01 01 1002 0065 0001 42 02 0009 0065",
        "05 82 01 01 44 02 0002 0002",
        "PD-212",
    ),
    ("... changes neither", "05 01 01 01 1002 0065 0001", "05 01 01 01 06 02 0002 0003", "PD-212"),
    ("two elements", "05 02 01 01 1002 0065 0001 42 02 0009 0064", "05 02 01 01", "PD-202"),
    ("... are there", "05 01 01 01 1004 0065 0000", "05 01 01 01 06 04 0001 0009 0064 0004", "PD-202"),
    ("only to be read", "05 02 01 01 1000 0066 0000 42 01 0000", "05 82 01 01 44 02 0001 0000", "PD-211"),
    (
        "... before its sub-index",
        "05 02 01 01 1001 0066 0005 42 01 0000",
        "05 82 01 01 44 02 0001 0005",
        "PD-208",
    ),
    ("a description", "05 02 01 01 2000 0064 0000 42 01 0000", "05 82 01 01 44 02 0007 0000", "PD-217"),
    ("a text", "05 02 01 01 3001 0067 0000 42 01 0000", "05 82 01 01 44 01 0020", "PD-228"),
    ("a text that is not there", "05 02 01 01 3001 0064 0000 42 01 0000", "05 82 01 01 44 01 000F", "PD-220"),
    ("a value that is permitted", "05 02 01 01 1000 0069 0000 42 01 0009", "05 02 01 01", "PD-222"),
    ("one that is not", "05 02 01 01 1000 0069 0000 42 01 0003", "05 82 01 01 44 02 0014 0000", "PD-222"),
    ("to be reset, 1", "05 02 01 01 1000 006A 0000 42 01 0001", "05 82 01 01 44 02 0006 0000", "PD-216"),
    ("to be reset, 0", "05 02 01 01 1000 006A 0000 42 01 0000", "05 02 01 01", "PD-216"),
    ("no values", "05 02 01 01 1000 0064 0000", "05 82 01 01 44 01 0018", "PD-226"),
    ("format zero", "05 02 01 01 1000 0064 0000 40 00", "05 82 01 01 44 01 0017", "PD-225"),
    ("format error", "05 02 01 01 1000 0064 0000 44 01 0006", "05 82 01 01 44 01 0017", "PD-225"),
    ("format that there is not", "05 02 01 01 1000 0064 0000 7F 01 0006", "05 82 01 01 44 01 0017", "PD-225"),
    ("two values", "05 02 01 01 1000 0064 0000 42 02 0006 0007", "05 82 01 01 44 01 0018", "PD-226"),
    ("a byte", "05 02 01 01 1000 0064 0000 41 01 0600", "05 82 01 01 44 01 0005", "PD-215"),
    ("a type of the same size", "05 02 01 01 1000 0064 0000 03 01 0006", "05 82 01 01 44 01 0005", "PD-215"),
    ("number before format", "05 02 01 01 1000 03E8 0000 7F 01 0006", "05 82 01 01 44 01 0000", "PD-208"),
    (
        "two parameters, one refused",
        "05 02 01 02 1000 0064 0000 1000 03E8 0000 42 01 0008 42 01 0008",
        "05 82 01 02 40 00 44 01 0000",
        "PD-203",
    ),
    (
        "... the other one is written",
        "05 01 01 02 1000 0064 0000 1000 03E8 0000",
        "05 81 01 02 06 01 0008 44 01 0000",
        "PD-203",
    ),
    (
        "three bytes fill up to four",
        "05 01 01 02 1003 006E 0000 1000 0064 0000",
        "05 01 01 02 09 03 000000 00 06 01 0008",
        "PD-202",
    ),
)
"""What is asked, the request and the answer, one after the other at the same drive."""


@CAMPAIGN.case(
    "requests",
    requirements=(
        *("PD-199", "PD-202", "PD-203", "PD-207", "PD-208", "PD-210", "PD-211", "PD-212", "PD-213", "PD-214"),
        *("PD-215", "PD-216", "PD-217", "PD-218", "PD-220", "PD-222", "PD-223", "PD-224", "PD-225", "PD-226"),
        *("PD-227", "PD-228", "PD-229", "PD-230"),
    ),
)
def requests(ctx: CaseContext) -> None:
    """Each request has its answer to the byte, whatever else would be wrong with it too; requests and errors
    are counted.
    """
    server = ParameterServer({1: _store()})
    for what, request, wanted, requirement in ASKED:
        found = server.request(bytes.fromhex(request))
        same(ctx, f"{what}: the answer", found.hex(" "), bytes.fromhex(wanted).hex(" "), requirement)
    same(ctx, "requests", server.requests, len(ASKED))
    refusals = sum(bytes.fromhex(wanted)[1] >= 0x80 for _, _, wanted, _ in ASKED)
    same(ctx, "parameters refused", server.refused.total(), refusals)
    same(ctx, "... of number 19h", server.refused[0x19], 2)
    same(ctx, "... of number 09h", server.refused[0x09], 1)


@CAMPAIGN.case("one-at-a-time", requirements=("PD-207",))
def one_at_a_time(ctx: CaseContext) -> None:
    """A drive without multi-parameter access refuses two, before it looks at what they are, and takes one;
    each drive object has its own parameters.
    """
    server = ParameterServer({0: _store(), 255: _store()}, multi=False)
    for what, request, wanted in (
        ("one", "01 01 00 01 1000 0064 0000", "01 01 00 01 06 01 0007"),
        ("two", "01 01 00 02 1000 0064 0000 1000 0064 0000", "01 81 00 01 44 01 0023"),
        ("two without addresses", "01 01 00 02", "01 81 00 01 44 01 0023"),
        ("40", "01 01 00 28", "01 81 00 01 44 01 0022"),
        ("the other drive object", "01 02 FF 01 1000 0064 0000 42 01 0009", "01 02 FF 01"),
        ("... has it", "01 01 FF 01 1000 0064 0000", "01 01 FF 01 06 01 0009"),
        ("... the first one has not", "01 01 00 01 1000 0064 0000", "01 01 00 01 06 01 0007"),
    ):
        found = server.request(bytes.fromhex(request))
        same(ctx, f"{what}: the answer", found.hex(" "), bytes.fromhex(wanted).hex(" "), "PD-207")


def _error(store: ParameterStore, number: int, value: float, sub_index: int = 0) -> int:
    """Return the error number of writing; -1: it is taken."""
    try:
        store.write(number, value, sub_index)
    except ParameterAccessError as error:
        return error.error
    return -1


@CAMPAIGN.case("states", requirements=("PD-211", "PD-219", "PD-221", "PD-231", "PD-235"))
def states(ctx: CaseContext) -> None:
    """A store by itself: write rules, control authority, locks, refusals of the device, limits in force,
    values that the device computes.
    """
    store = _store()
    same(ctx, "S1 at first", _error(store, 107, 1), -1, "PD-221")
    same(ctx, "pulses off at first", _error(store, 108, 1), -1, "PD-231")
    same(ctx, "not in commissioning at first", _error(store, 109, 1), 0x6B, "PD-231")
    store.switching_on_inhibited = lambda: False
    store.pulses_enabled = lambda: True
    same(ctx, "out of S1", _error(store, 107, 2), 0x11, "PD-221")
    same(ctx, "with pulses", _error(store, 108, 2), 0x77, "PD-231")
    same(ctx, "p0010 = 1", _error(store, 10, 1), -1, "PD-231")
    same(ctx, "in commissioning", (store.commissioning, _error(store, 109, 2)), (True, -1), "PD-231")
    same(ctx, "values", tuple(store.value(number) for number in (107, 108, 109)), (1, 1, 2))
    same(ctx, "control given away", _error(store, 927, 0), -1, "PD-219")
    same(ctx, "without it", (_error(store, 100, 9), _error(store, 107, 9)), (0x0B, 0x0B), "PD-219")
    same(ctx, "a wrong value goes before it", _error(store, 100, 51), 0x02, "PD-212")
    same(ctx, "control taken back", (_error(store, 927, 1), _error(store, 100, 9)), (-1, -1), "PD-219")
    store.locked.add(100)
    same(ctx, "locked", (store.is_writable(100), _error(store, 100, 8)), (False, 0x01), "PD-235")
    store.locked.clear()
    store.refusals[100] = 0x65
    same(ctx, "deactivated", _error(store, 100, 8), 0x65, "PD-231")
    server = ParameterServer({1: store})
    for request, wanted in (
        ("01 01 01 01 1000 0064 0000", "01 81 01 01 44 01 0065"),
        ("01 02 01 01 1000 0064 0000 42 01 0008", "01 82 01 01 44 01 0065"),
    ):
        same(ctx, "... by the bus", server.request(bytes.fromhex(request)).hex(), bytes.fromhex(wanted).hex())
    store.refusals.clear()
    store.limits[100] = lambda: (10.0, 20.0)
    found = tuple(_error(store, 100, value) for value in (4, 9, 10, 20, 21, 51))
    same(ctx, "limits in force", found, (0x02, 0xC8, -1, -1, 0xC9, 0x02), "PD-231")
    same(ctx, "the last value taken", store.value(100), 20)
    seen: list[tuple[int, float]] = []

    def note(sub_index: int, value: float) -> None:
        if value == 13:
            raise ParameterAccessError("the machine does not want it", 0x87)
        seen.append((sub_index, value))

    store.writers[101] = note
    same(ctx, "taken by the device", (_error(store, 101, 5, 3), seen), (-1, [(3, 5)]), "PD-231")
    same(ctx, "not taken", (_error(store, 101, 13, 3), store.value(101, 3)), (0x87, 5), "PD-231")
    two_elements = bytes.fromhex("01 02 01 01 1002 0065 0000 42 02 0006 000D")
    same(ctx, "... by the bus", server.request(two_elements).hex(), "0182010144010087", "PD-231")
    same(ctx, "... what was before it stays", store.values(101, 0, 4), (6, 2, 3, 5))
    same(ctx, "element 4", (_error(store, 101, 5, 4), _error(store, 101, 5, -1)), (0x03, 0x03), "PD-213")
    same(ctx, "no such parameter", _error(store, 999_999, 1), 0x00, "PD-210")
    store.readers[102] = lambda at: 12.6 + at
    same(ctx, "computed", store.value(102), 13)
    store.readers[102] = lambda at: 1e6 + at
    same(ctx, "computed, too large", store.value(102), 65_535)
    store.set(100, 51)
    same(ctx, "set from inside", store.value(100), 51)
    store.set_text(110, "a name that is too long")
    same(ctx, "a string is cut", store.text(110), "a name that ", "PD-209")
    store.set_text(110, "Ωé")
    same(ctx, "a string of other letters", store.text(110), "?é", "PD-209")
    same(ctx, "... filled up", store.values(110, 0, 4), (63, 0xE9, 0, 0), "PD-209")


@CAMPAIGN.case("saving", requirements=("PD-250", "PD-256", "PD-257"))
def saving(ctx: CaseContext) -> None:
    """What is saved comes back with loading, everything else gets its factory value; parameters that differ
    are listed, those that are no settings never.
    """
    store = _store()
    same(ctx, "nothing is changed at first", store.changed(), (), "PD-257")
    same(ctx, "nothing is saved at first", store.saved, {}, "PD-250")
    listed = (*(10, *range(100, 113)), 927, *range(980, 1000))
    same(ctx, "the list of all", store.values(980, 0, 36), (*listed, 0), "PD-256")
    same(ctx, "... leads no further", store.value(980, 116), 0, "PD-256")
    same(ctx, "the second list of all", set(store.values(981, 0, 117)), {0}, "PD-256")
    store.write(100, 9)
    store.write(101, 9, 2)
    store.write(112, 9)
    store.set(102, 9)
    same(ctx, "what is changed", store.changed(), (100, 101), "PD-257")
    same(ctx, "the list of it", store.values(990, 0, 3), (100, 101, 0), "PD-257")
    store.save()
    same(ctx, "p100 and p101 saved", (store.saved["100"], store.saved["101"]), ([9], [1, 2, 9, 4]), "PD-250")
    kept = {"10", "100", "101", "103", "104", "105", "107", "108", "109", "110", "111", "927"}
    same(ctx, "the settings", set(store.saved), kept, "PD-250")
    store.write(100, 10)
    store.write(105, 2)
    store.load()
    found = tuple(store.value(number) for number in (100, 105, 102, 112))
    same(ctx, "loaded", found, (9, 0, 9, 3), "PD-250")
    store.write(112, 9)
    store.locked.add(101)
    store.factory_reset()
    found = (store.value(100), store.value(112), store.value(101, 2))
    same(ctx, "factory settings but for what is locked", found, (7, 3, 9), "PD-250")
    store.locked.clear()
    store.factory_reset()
    same(ctx, "nothing is changed", store.changed(), (), "PD-257")
    store.load()
    same(ctx, "what was saved is still there", (store.value(100), store.value(101, 2)), (9, 9), "PD-250")
    other = _store()
    other.saved = store.saved | {"104": [1, 2], "5": [1], "x": [1]}
    other.load()
    same(ctx, "taken over by another one", (other.value(100), other.value(104)), (9, 0), "PD-250")
    same(ctx, "... but for what does not fit", set(other.saved), kept - {"104"}, "PD-250")

    def refuse(_sub_index: int, value: float) -> None:
        if value == 9:
            raise ParameterAccessError("the machine does not want it", 0x87)

    other.factory_reset()
    other.writers[100] = refuse
    other.load()
    same(ctx, "what the machine refuses stays", (other.value(100), other.value(101, 2)), (7, 9), "PD-250")
    for number in range(2000, 2220):
        store.define(_parameter(number))
    more = (*listed, *range(2000, 2220))
    same(ctx, "many: the first list", store.values(980, 0, 116), more[:116], "PD-256")
    links = tuple(store.value(number, 116) for number in (980, 981, 982))
    same(ctx, "many: where it goes on", links, (981, 982, 0), "PD-256")
    same(ctx, "many: the last list", store.values(982, 0, len(more) - 232), more[232:], "PD-256")
    store.write(2219, 1)
    same(ctx, "many: changed", store.changed(), (100, 101, 2219), "PD-257")
    store.define(_parameter(2219))
    same(ctx, "defined again", store.changed(), (100, 101), "PD-257")
