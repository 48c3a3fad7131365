"""EDS files from an object table (CiA 306): `load_dictionary` and every other tool read them back."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from fieldbus.canopen.dictionary import INTEGERS
from fieldbus.canopen.object_table import STRING, VAR, Item, ObjectRow

_MANDATORY: Final = (0x1000, 0x1001, 0x1018)


@dataclass(frozen=True, slots=True, kw_only=True)
class EdsInfo:
    """What an EDS says of the file and of the device, beside its objects.

    Args:
        file_name: Name of the file, with ending.
        description: A few words.
        product_name: Name of the device.
        product_number: Product code of 1018h:2.
        comment: One line for `[Comments]`.

    """

    file_name: str
    description: str
    product_name: str
    product_number: int
    comment: str


def eds_text(rows: Sequence[ObjectRow], info: EdsInfo) -> str:
    """Return the EDS of an object table, whose rows are in ascending order."""
    return "\n".join(_lines(rows, info)) + "\n"


def write_or_check(path: Path, text: str, arguments: Sequence[str]) -> int:
    """Write an EDS file, or with `--check` compare it; returns the exit status of the command that does this."""
    if "--check" in arguments:
        current = path.read_text(encoding="ascii") if path.exists() else ""
        if current != text:
            sys.stderr.write(f"{path} does not agree with the object table\n")
            return 1
        return 0
    path.write_text(text, encoding="ascii")
    return 0


def _lines(rows: Sequence[ObjectRow], info: EdsInfo) -> Iterator[str]:
    yield from (
        "[FileInfo]",
        f"FileName={info.file_name}",
        "FileVersion=1",
        "FileRevision=0",
        "EDSVersion=4.0",
        f"Description={info.description}",
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
        f"ProductName={info.product_name}",
        f"ProductNumber=0x{info.product_number:08X}",
        "RevisionNumber=0x00010000",
        "OrderCode=",
        *(f"BaudRate_{rate}=1" for rate in (10, 20, 50, 125, 250, 500, 800, 1000)),
        "SimpleBootUpMaster=0",
        "SimpleBootUpSlave=1",
        "Granularity=8",
        "DynamicChannelsSupported=0",
        "GroupMessaging=0",
        f"NrOfRXPDO={sum(0x1400 <= row.index < 0x1600 for row in rows)}",
        f"NrOfTXPDO={sum(0x1800 <= row.index < 0x1A00 for row in rows)}",
        "LSS_Supported=1",
        "",
        "[DummyUsage]",
        *(f"Dummy{code:04X}={int(code > 1)}" for code in range(1, 8)),
        "",
        "[Comments]",
        "Lines=1",
        f"Line1={info.comment}",
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
        return f"0x{value & (1 << INTEGERS[item.data_type][0]) - 1:X}"
    return str(value) if value < 10 else f"0x{value:X}"
