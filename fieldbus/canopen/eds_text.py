"""EDS files from an object table (CiA 306): `load_dictionary` and every other tool read them back.

A device of the product that ships an EDS declares it as one `DeviceEds`; `write_eds_files` is the command
that writes the files, or checks that they are up to date.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fieldbus.canopen.eds import shared_dictionary
from fieldbus.canopen.object_table import STRING, VAR, Item, ObjectRow

if TYPE_CHECKING:
    import canopen

_MANDATORY: Final = (0x1000, 0x1001, 0x1018)
_BITRATES_K: Final = (10, 20, 50, 125, 250, 500, 800, 1000)


@dataclass(frozen=True, kw_only=True)
class EdsInfo:
    """What an EDS says of the file and of the device, apart from its objects.

    Args:
        file_name: Name of the file, with ending.
        description: A few words.
        product_name: Name of the device.
        product_number: Product code of 1018h:2.
        comment: Lines for `[Comments]`.
        vendor_name: Name of the vendor.
        vendor_number: Vendor-ID of 1018h:1.
        revision_number: 1018h:3.
        order_code: Order code.
        bitrates_k: Bit rates that the device supports, kbit/s.
        lss: Whether it has LSS.

    """

    file_name: str
    description: str
    product_name: str
    product_number: int
    comment: str
    vendor_name: str = "motion-hil"
    vendor_number: int = 0
    revision_number: int = 0x00010000
    order_code: str = ""
    bitrates_k: tuple[int, ...] = (10, 20, 50, 125, 250, 500, 800, 1000)
    lss: bool = True


def eds_text(rows: Sequence[ObjectRow], info: EdsInfo) -> str:
    """Return the EDS of an object table, whose rows are in ascending order."""
    return "\n".join(_lines(rows, info)) + "\n"


@dataclass(frozen=True, kw_only=True)
class DeviceEds:
    """The EDS of a device that ships with the product: made of its object table, kept as a file.

    Args:
        path: The file.
        objects: Returns the rows of the object table, in ascending order.
        product_name: Name of the device.
        product_code: 1018h:2.
        description: A few words; default: the name.

    """

    path: Path
    objects: Callable[[], Sequence[ObjectRow]]
    product_name: str
    product_code: int
    description: str = ""

    def text(self) -> str:
        """Return the EDS of the object table (CiA 306)."""
        info = EdsInfo(
            file_name=self.path.name,
            description=self.description or self.product_name,
            product_name=self.product_name,
            product_number=self.product_code,
            comment="Generated from the object table of the emulated device; do not edit.",
        )
        return eds_text(self.objects(), info)

    def dictionary(self, path: str | PathLike[str] | None = None) -> canopen.ObjectDictionary:
        """Return the object dictionary of the file, or of another one in its place.

        The result is shared between devices, and read again when the file has changed: nobody may change it.

        Raises:
            ConfigurationError: The file is no EDS.

        """
        return shared_dictionary(self.path if path is None else path)


def write_eds_files(files: Iterable[DeviceEds], arguments: Sequence[str]) -> int:
    """Write the files; with `--check` among `arguments` compare them instead, and name those that differ.

    Returns:
        The exit status of the command: 1 if a file is not up to date.

    """
    status = 0
    for eds in files:
        text = eds.text()
        if "--check" not in arguments:
            eds.path.write_text(text, encoding="ascii")
        elif not eds.path.exists() or eds.path.read_text(encoding="ascii") != text:
            sys.stderr.write(f"{eds.path} does not agree with the object table\n")
            status = 1
    return status


def _lines(rows: Sequence[ObjectRow], info: EdsInfo) -> Iterator[str]:
    yield from head_lines([row.index for row in rows], info)
    for row in rows:
        yield from _object_lines(row)


def head_lines(indices: Sequence[int], info: EdsInfo) -> Iterator[str]:
    """Return everything before the objects: file, device, dummies, comments and the lists of objects."""
    comments = info.comment.splitlines()
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
        f"VendorName={info.vendor_name}",
        f"VendorNumber=0x{info.vendor_number:08X}",
        f"ProductName={info.product_name}",
        f"ProductNumber=0x{info.product_number:08X}",
        f"RevisionNumber=0x{info.revision_number:08X}",
        f"OrderCode={info.order_code}",
        *(f"BaudRate_{rate}={int(rate in info.bitrates_k)}" for rate in _BITRATES_K),
        "SimpleBootUpMaster=0",
        "SimpleBootUpSlave=1",
        "Granularity=8",
        "DynamicChannelsSupported=0",
        "GroupMessaging=0",
        f"NrOfRXPDO={sum(0x1400 <= index < 0x1600 for index in indices)}",
        f"NrOfTXPDO={sum(0x1800 <= index < 0x1A00 for index in indices)}",
        f"LSS_Supported={int(info.lss)}",
        "",
        "[DummyUsage]",
        *(f"Dummy{code:04X}={int(code > 1)}" for code in range(1, 8)),
        "",
        "[Comments]",
        f"Lines={len(comments)}",
        *(f"Line{number}={line}" for number, line in enumerate(comments, 1)),
        "",
    )
    for title, chosen in (
        ("MandatoryObjects", [index for index in indices if index in _MANDATORY]),
        (
            "OptionalObjects",
            [index for index in indices if index not in _MANDATORY and not 0x2000 <= index < 0x6000],
        ),
        ("ManufacturerObjects", [index for index in indices if 0x2000 <= index < 0x6000]),
    ):
        yield f"[{title}]"
        yield f"SupportedObjects={len(chosen)}"
        yield from (f"{number}=0x{index:04X}" for number, index in enumerate(chosen, 1))
        yield ""


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
    yield f"DataType=0x{item.data_type:04X}"
    yield f"AccessType={item.eds_access}"
    yield f"DefaultValue={_default(item)}"
    yield f"PDOMapping={int(item.pdo != '-')}"
    if item.volatile:
        yield "ObjFlags=0x1"  # not part of a configuration
    yield ""


def _default(item: Item) -> str:
    value = item.default
    if value is None:
        return ""
    if isinstance(value, str):
        return value
    if item.data_type == STRING:
        return str(value)
    return str(value) if value < 10 else f"0x{value:X}"
