"""EDS and DCF files in the forms in which vendors write them, and the files of the devices that ship."""

from __future__ import annotations

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from emulators.drive.cia402.eds import EDS
from fieldbus.canopen import load_dictionary, notes_of
from fieldbus.canopen.dictionary import entries_of
from fieldbus.errors import ConfigurationError
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._eds_forms import HEAD, LIMITS, MISTAKES, NOTED, VALUES, variable
from testcases.campaigns.support import equal, same

CAMPAIGN: Final = Campaign(
    "eds files", controller="", tags=("canopen",), bench="testcases.campaigns.can_bus:BENCH"
)


def _loaded(text: str, *, ending: str = "eds", node_id: int | None = 5) -> Any:
    """Return the dictionary of a file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"device.{ending}"
        path.write_text(text, encoding="utf-8")
        return load_dictionary(path, node_id)


def _entry(text: str) -> Any:
    return entries_of(_loaded(HEAD + text), 5)[0x200000]


@CAMPAIGN.case("values", requirements=("C301-014",))
def values(ctx: CaseContext) -> None:
    """Every data type and number format of a default, and the limits of every numeric type."""
    for data_type, text, value in VALUES:
        entry = _entry(variable(DataType=f"0x{data_type:04X}", DefaultValue=text))
        same(ctx, f"{text!r} of type {data_type:X}h", entry.default, value, "C301-014")
    for kind, low, high, limits in LIMITS:
        entry = _entry(variable(DataType=kind, LowLimit=low, HighLimit=high))
        same(ctx, f"limits {low!r}, {high!r} of type {kind}", (entry.low, entry.high), limits)


@CAMPAIGN.case("mistakes")
def mistakes(ctx: CaseContext) -> None:
    """What cannot be understood is refused with file, section, key and what is allowed."""
    for text, where in MISTAKES:
        reason = ""
        try:
            _loaded(HEAD + text, node_id=None)
        except ConfigurationError as error:
            reason = str(error)
        found = bool(re.search(where, reason)) and "device.eds" in reason
        equal(ctx, f"{where} is in the reason {reason!r}", found, 1)


@CAMPAIGN.case("notes")
def notes(ctx: CaseContext) -> None:
    """Files of vendors contradict themselves; what they mean is taken, and said with section and key."""
    for name, (text, wanted, look, expected) in NOTED.items():
        dictionary = _loaded(HEAD + text, node_id=None)
        same(ctx, name, look(dictionary), expected)
        said = notes_of(dictionary)
        fits = len(said) == len(wanted) and all(map(str.startswith, said, wanted))
        equal(ctx, f"notes {wanted} (they are {said})", fits, 1)


@CAMPAIGN.case("compact-pdos")
def compact_pdos(ctx: CaseContext) -> None:
    """`CompactPDO` says which members the missing records of PDOs have; what is written out stays."""
    count = "CompactPDO=0x13\nNrOfRXPDO=1\nNrOfTXPDO=6\n"
    dictionary = _loaded(
        HEAD.replace("VendorName=x", count)
        + variable("1800", ObjectType="9", DataType=None, AccessType=None)
        + variable("1800sub1", DataType="0x0007", AccessType="ro", DefaultValue="0x1A5")
    )
    entries = entries_of(dictionary, 5)

    def members(index: int) -> list[int]:
        return [sub for sub in range(0x80) if index << 8 | sub in entries]

    same(ctx, "members of RPDO1", members(0x1400), [0, 1, 2, 5])
    same(ctx, "highest sub-index", entries[0x140000].default, 5)
    same(ctx, "members of TPDO1, which is written out", members(0x1800), [1])
    same(ctx, "members of TPDO7, which is not there", members(0x1806), [])
    wanted = {
        0x1400: 0x205,
        0x1800: 0x1A5,
        0x1801: 0x285,
        0x1802: 0x385,
        0x1803: 0x485,
        0x1804: 1 << 31,
        0x1805: 1 << 31,
    }
    found = {index: entries[index << 8 | 1].default for index in wanted}
    same(ctx, "identifiers", found, wanted)
    for index in (0x1600, 0x1A00, 0x1A05):
        same(ctx, f"entries of {index:04X}h", members(index), list(range(0x41)))
        equal(ctx, "an entry is writable and empty", entries[index << 8 | 0x40].writable, 1)
        same(ctx, "default of an entry", entries[index << 8 | 1].default, 0)
    rest = "RPDO1, TPDO2, TPDO3, TPDO4, TPDO5, TPDO6"
    same(
        ctx, "notes", notes_of(dictionary), (f"[DeviceInfo] CompactPDO: the file does not write out {rest}",)
    )


@CAMPAIGN.case("commissioning")
def commissioning(ctx: CaseContext) -> None:
    """A DCF brings node-ID, bit rate and values, which go before the defaults; names, types and arrays."""
    text = "[DeviceComissioning]\nNodeID=0x11\nBaudrate=250\n" + variable(
        DataType="7", DefaultValue="$NODEID+0x100", ParameterValue="$NODEID+0x300"
    )
    dictionary = _loaded(HEAD + text, ending="dcf", node_id=None)
    found = (dictionary.node_id, dictionary.bitrate, dictionary[0x2000].value, dictionary[0x2000].default)
    same(ctx, "node-ID, bit rate, value, default", found, (17, 250_000, 0x311, 0x111))
    text = variable(ObjectType="8", CompactSubObj="0x3", DefaultValue="7", ParameterName="Compact")
    text += "\n[2000Name]\nNrOfEntries=1\n2=Second\n\n[2000Value]\nNrOfEntries=1\n3=0x20\n"
    entries = entries_of(_loaded(HEAD + text), 5)
    same(ctx, "elements", [entries[0x200000 | sub].default for sub in range(4)], [3, 7, 7, 32])
    same(ctx, "name", entries[0x200002].name, "Compact: Second")
    same(ctx, "an element too many", 0x200004 in entries, False)
    kinds = "".join(variable(f"200{number}", ObjectType=str(number)) for number in (0, 5, 6))
    same(ctx, "definitions are no entries", list(entries_of(_loaded(HEAD + kinds), 5)), [0x100000])
    domain = _entry(variable(ObjectType="2", DataType=None, AccessType=None))
    same(ctx, "type of a domain", domain.data_type, 0x0F)


@CAMPAIGN.case("shipped")
def shipped(ctx: CaseContext) -> None:
    """The file of the emulated drive is what its table says: read back it has the same objects, types and
    access.
    """
    text = EDS.text()
    same(ctx, "file", EDS.path.read_text(encoding="ascii") == text, True)
    written, read = entries_of(_loaded(text), 5), entries_of(EDS.dictionary(), 5)
    same(ctx, "objects", list(written), list(read))
    for key, entry in written.items():
        facts = [(one.data_type, one.default, one.writable, one.low, one.high) for one in (entry, read[key])]
        same(ctx, f"{key >> 8:04X}h:{key & 0xFF}", facts[0], facts[1])
