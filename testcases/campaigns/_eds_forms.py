"""Forms in which vendors write EDS and DCF files: what each means, what is noted, and what is refused."""

from __future__ import annotations

from typing import Any, Final

from fieldbus.canopen.dictionary import entries_of

HEAD: Final = (
    "[DeviceInfo]\nVendorName=x\n\n[1000]\nParameterName=Device type\nDataType=0x0007\nAccessType=ro\n"
    "DefaultValue=0\n"
)
"""A file with nothing but a device type."""


def variable(section: str = "2000", **keys: Any) -> str:
    """Return a section of a variable; keys replace those of an U16."""
    lines = {
        "ParameterName": "Value",
        "ObjectType": "0x7",
        "DataType": "0x0006",
        "AccessType": "rw",
        "PDOMapping": "0",
    }
    lines.update(keys)
    return f"\n[{section}]\n" + "".join(
        f"{key}={value}\n" for key, value in lines.items() if value is not None
    )


VALUES: Final = (
    (0x01, "1", 1),
    (0x02, "-5", -5),
    (0x02, "0xFB", -5),
    (0x03, "0x7FFF", 32767),
    (0x04, "0x80000000", -(1 << 31)),
    (0x05, "0Xff", 255),
    (0x06, "0x0aBc", 0x0ABC),
    (0x06, "017", 15),
    (0x06, "00", 0),
    (0x06, " 12 ; twelve", 12),
    (0x06, "", 0),
    (0x07, "$NODEID+0x200", 0x205),
    (0x07, "0x200 + $NodeID", 0x205),
    (0x07, "$nodeid", 5),
    (0x08, "1.5", 1.5),
    (0x08, "1,5", 1.5),
    (0x08, "0x3FC00000", 1.5),
    (0x09, "a name; with a sign", "a name; with a sign"),
    (0x09, "a name ;comment", "a name"),
    (0x0A, "00 FF 10", b"\x00\xff\x10"),
    (0x0A, "text", b"text"),
    (0x0B, "name", "name"),
    (0x0C, "0x0102", b"\x02\x01\0\0\0\0"),
    (0x0F, "0a0b", b"\x0a\x0b"),
    (0x0F, "", b""),
    (0x10, "0xFFFFFE", -2),
    (0x11, "-2.25", -2.25),
    (0x15, "0xFFFFFFFFFFFFFFFF", -1),
    (0x16, "0xFFFFFF", 0xFFFFFF),
    (0x1B, "0xFFFFFFFFFFFFFFFF", (1 << 64) - 1),
    (0x1234, "", b""),
)
"""Data type, text of the default, and value for node 5 (C301-014); types that nobody knows are domains."""

LIMITS: Final = (
    ("0x0006", "1", "5", (1, 5)),
    ("0x0006", None, "5", (None, 5)),
    ("0x0006", "1", "", (1, None)),
    ("0x0003", "0xFFFE", "0x0002", (-2, 2)),
    ("0x0010", "0xFFFFFE", "2", (-2, 2)),
    ("0x0008", "-1.5", "2.5", (-1.5, 2.5)),
    ("0x0009", "a", "z", (None, None)),
    ("0x0006", "0", "0xFFFF", (None, None)),
)
"""Data type, low and high limit as written, and both as they count."""

MISTAKES: Final = (
    (variable(DefaultValue="banana"), r"\[2000\] DefaultValue: 'banana'"),
    (variable(DefaultValue="089"), r"\[2000\] DefaultValue"),
    (variable(DefaultValue="70000"), r"\[2000\] DefaultValue: '70000'.*16 bit"),
    (variable(DefaultValue="-1"), r"\[2000\] DefaultValue"),
    (variable(DefaultValue="$NODEID+x"), r"\[2000\] DefaultValue"),
    (variable(DataType="0x0003", DefaultValue="-40000"), r"\[2000\] DefaultValue"),
    (variable(DataType="0x0001", DefaultValue="2"), r"\[2000\] DefaultValue.*1 bit"),
    (variable(DataType="0x0008", DefaultValue="one"), r"\[2000\] DefaultValue"),
    (variable(LowLimit="low"), r"\[2000\] LowLimit: 'low'"),
    (variable(HighLimit="high"), r"\[2000\] HighLimit"),
    (variable(ParameterValue="?"), r"\[2000\] ParameterValue"),
    (variable(DataType=None), r"\[2000\] DataType.*missing"),
    (variable(DataType="U16"), r"\[2000\] DataType: 'U16'"),
    (variable(DataType="0"), r"\[2000\] DataType"),
    (variable(AccessType="readwrite"), r"\[2000\] AccessType: 'readwrite'.*ro, wo, rw"),
    (variable(AccessType=None), r"\[2000\] AccessType"),
    (variable(ObjectType="4"), r"\[2000\] ObjectType: '4'"),
    (variable(PDOMapping="yes"), r"\[2000\] PDOMapping: 'yes'"),
    (variable("2000sub1"), r"\[2000sub1\].*no \[2000\]"),
    (variable() + variable("2000sub1"), r"\[2000sub1\].*variable"),
    ("[2000\nParameterName=x\n", r"line 9: '\[2000'"),
    (variable(ObjectType="8", CompactSubObj="300"), r"\[2000\] CompactSubObj: '300'.*0 to 255"),
    ("\n[DeviceComissioning]\nNodeID=abc\n", r"\[DeviceComissioning\] NodeID: 'abc'"),
)
"""Sections that cannot be understood, and a pattern of the reason: section, key and what is allowed."""

NOTED: Final[dict[str, tuple[str, list[str], Any, object]]] = {
    "a limit beyond the type limits nothing": (
        variable(HighLimit="65536", LowLimit="-1"),
        ["[2000] LowLimit: -1 is beyond the data type", "[2000] HighLimit: 65536 is beyond the data type"],
        lambda od: (od[0x2000].max, od[0x2000].min),
        (None, None),
    ),
    "of repeated keys the first counts": (
        variable(defaultvalue="1", DefaultValue="2"),
        ["[2000] DefaultValue: line 17 repeats it with '2'; '1', which comes first, counts"],
        lambda od: od[0x2000].default,
        1,
    ),
    "a key repeated with the same value is no mistake": (
        variable(defaultvalue="1", DefaultValue="1"),
        [],
        lambda od: od[0x2000].default,
        1,
    ),
    "a repeated section adds what the first one lacks": (
        variable(DefaultValue="3") + "[2000]\nHighLimit=9\nDefaultValue=4\n",
        ["[2000]: line 17 repeats the section", "[2000] DefaultValue: line 19 repeats it with '4'"],
        lambda od: (od[0x2000].default, od[0x2000].max),
        (3, 9),
    ),
    "255 elements are as many as there are sub-indices": (
        variable(ObjectType="8", CompactSubObj="255"),
        ["[2000] CompactSubObj: 255 is above the highest sub-index; 254 counts"],
        lambda od: max(od[0x2000].subindices),
        254,
    ),
    "node-ID 0 is none": (
        variable() + "\n[DeviceComissioning]\nNodeID=0\n",
        ["[DeviceComissioning] NodeID: 0 is no node-ID"],
        lambda od: od.node_id,
        None,
    ),
    "the node-ID under other names": (
        variable(DefaultValue="$MY_NODE_ID+0x180") + variable("2001", DefaultValue="NODEID+0x20"),
        [],
        lambda od: [entries_of(od, 5)[key].default for key in (0x200000, 0x200100)],
        [0x185, 0x25],
    ),
    "a real number as C writes it": (
        variable(DataType="0x0008", DefaultValue="1.5f"),
        [],
        lambda od: od[0x2000].default,
        1.5,
    ),
    "days and milliseconds": (
        variable(DataType="0x000C", DefaultValue="365 43200000"),
        [],
        lambda od: entries_of(od, 5)[0x200000].default,
        bytes.fromhex("002e93026d01"),
    ),
    "remarks behind numbers and headers": (
        variable("2000] # a remark", DefaultValue="0x12 # a number").replace("remark]", "remark"),
        ["[2000] DefaultValue: '0x12 # a number' has a remark; '0x12' counts"],
        lambda od: od[0x2000].default,
        0x12,
    ),
    "whole numbers as spreadsheets and tools write them": (
        variable(DefaultValue="12.0")
        + variable("2001", DefaultValue='"0x10"')
        + variable("2002", HighLimit="7."),
        [
            "[2000] DefaultValue: '12.0' is no whole number as it should be written; 12 counts",
            "[2001] DefaultValue: '\"0x10\"' is no whole number as it should be written; 0x10 counts",
            "[2002] HighLimit: '7.' is no whole number",
        ],
        lambda od: (od[0x2000].default, od[0x2001].default, od[0x2002].max),
        (12, 16, 7),
    ),
    "an object without a name": (
        variable(ParameterName=None),
        ["[2000] ParameterName: it has no name and is called '2000'"],
        lambda od: od[0x2000].name,
        "2000",
    ),
    "the end of a file of an old system": (
        variable(DefaultValue="3") + "\x1a",
        [],
        lambda od: od[0x2000].default,
        3,
    ),
    "types by name": (
        variable(ObjectType="VAR", DataType="INTEGER16", DefaultValue="-3"),
        ["[2000] ObjectType: 'VAR' is taken as 7", "[2000] DataType: 'INTEGER16' is taken as 3"],
        lambda od: entries_of(od, 5)[0x200000].encode(-3),
        b"\xfd\xff",
    ),
    "a factor that is no number": (
        variable(Factor="ERROR"),
        ["[2000] Factor: 'ERROR' is no number and is left out"],
        lambda od: od[0x2000].factor,
        1,
    ),
    "compact PDOs next to records that are written out": (
        "\n[DeviceInfo]\nCompactPDO=23\n" + variable("1A00"),
        ["[DeviceInfo]: line 10 repeats", "[DeviceInfo] CompactPDO: not needed"],
        lambda od: 0x1A00 in od.indices,
        True,
    ),
}
"""Sections that contradict something, the notes on them, what to look at, and what it is."""
