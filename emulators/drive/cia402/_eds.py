"""EDS of the emulated drive: text from the object table, and loading for a node.

`python -m emulators.drive.cia402.eds` rewrites `servo.eds` beside this module; `--check` says whether it is up to date.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

from emulators.drive.cia402.objects import I8, I16, I32, STRING, VAR, Item, ObjectRow, all_objects
from fieldbus.canopen.eds import load_dictionary

if TYPE_CHECKING:
    import canopen

EDS_PATH: Final = Path(__file__).with_name("servo.eds")
"""The file that ships with the product."""

_MANDATORY: Final = (0x1000, 0x1001, 0x1018)
_SIGNED_MASK: Final = {I8: 0xFF, I16: 0xFFFF, I32: 0xFFFFFFFF}


def eds_text() -> str:
    """Return the EDS of the object table (CiA 306)."""
    rows = all_objects()
    return "\n".join(_lines(rows)) + "\n"


def _lines(rows: tuple[ObjectRow, ...]) -> Iterator[str]:
    yield from (
        "[FileInfo]",
        "FileName=servo.eds",
        "FileVersion=1",
        "FileRevision=0",
        "EDSVersion=4.0",
        "Description=Emulated servo drive, CiA 402",
        "CreationTime=12:00AM",
        "CreationDate=01-01-2000",
        "CreatedBy=motion-hil",
        "ModificationTime=12:00AM",
        "ModificationDate=01-01-2000",
        "ModifiedBy=motion-hil",
        "",
        "[DeviceInfo]",
        "VendorName=motion-hil",
        "VendorNumber=0x00000000",
        "ProductName=Emulated servo drive CiA 402",
        "ProductNumber=0x00000402",
        "RevisionNumber=0x00010000",
        "OrderCode=",
        *(f"BaudRate_{rate}=1" for rate in (10, 20, 50, 125, 250, 500, 800, 1000)),
        "SimpleBootUpMaster=0",
        "SimpleBootUpSlave=1",
        "Granularity=8",
        "DynamicChannelsSupported=0",
        "GroupMessaging=0",
        "NrOfRXPDO=8",
        "NrOfTXPDO=8",
        "LSS_Supported=0",
        "",
        "[DummyUsage]",
        *(f"Dummy{code:04X}={int(code > 1)}" for code in range(1, 8)),
        "",
        "[Comments]",
        "Lines=1",
        "Line1=Generated from the object table of the emulated drive; do not edit.",
        "",
    )
    for title, chosen in (
        ("MandatoryObjects", [row for row in rows if row.index in _MANDATORY]),
        (
            "OptionalObjects",
            [row for row in rows if row.index not in _MANDATORY and not 0x2000 <= row.index < 0x6000],
        ),
        ("ManufacturerObjects", [row for row in rows if 0x2000 <= row.index < 0x6000]),
    ):
        yield f"[{title}]"
        yield f"SupportedObjects={len(chosen)}"
        yield from (f"{number}=0x{row.index:04X}" for number, row in enumerate(chosen, 1))
        yield ""
    for row in rows:
        yield from _object_lines(row)


def _object_lines(row: ObjectRow) -> Iterator[str]:
    section = f"{row.index:04X}"
    if row.kind == VAR:
        yield f"[{section}]"
        yield from _item_lines(row.items[0])
        return
    yield f"[{section}]"
    yield f"ParameterName={row.name}"
    yield f"ObjectType=0x{row.kind:X}"
    yield f"SubNumber=0x{len(row.items):X}"
    yield ""
    for sub, item in sorted(row.items.items()):
        yield f"[{section}sub{sub:X}]"
        yield from _item_lines(item)


def _item_lines(item: Item) -> Iterator[str]:
    yield f"ParameterName={item.name}"
    yield "ObjectType=0x7"
    if item.volatile:
        yield "StorageLocation=RAM"
    yield f"DataType=0x{item.data_type:04X}"
    yield f"AccessType={item.eds_access}"
    yield f"DefaultValue={_default(item)}"
    yield f"PDOMapping={int(item.pdo != '-')}"
    yield ""


def _default(item: Item) -> str:
    value = item.default
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    if item.data_type == STRING:
        return str(value)
    if value < 0:
        return f"0x{value & _SIGNED_MASK[item.data_type]:X}"
    return str(value) if value < 10 else f"0x{value:X}"


@lru_cache(maxsize=16)
def drive_dictionary(path: Path | None = None) -> canopen.ObjectDictionary:
    """Return the object dictionary of an EDS file, by default that of this drive.

    The result is shared between drives: nobody may change it.

    Raises:
        ConfigurationError: The file is no EDS.

    """
    return load_dictionary(EDS_PATH if path is None else path)


def main(arguments: list[str]) -> int:
    """Write the EDS file, or check it with `--check`; returns the exit status."""
    text = eds_text()
    if "--check" in arguments:
        current = EDS_PATH.read_text(encoding="ascii") if EDS_PATH.exists() else ""
        if current != text:
            sys.stderr.write(f"{EDS_PATH} does not agree with the object table\n")
            return 1
        return 0
    EDS_PATH.write_text(text, encoding="ascii")
    return 0
