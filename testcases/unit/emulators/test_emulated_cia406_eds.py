"""Object tables, EDS files and dictionaries of the encoders."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import canopen
import pytest

from emulators.encoder.cia406 import EDS, FAMILIES
from emulators.encoder.cia406._objects import all_objects
from fieldbus.canopen.dictionary import entries_of
from fieldbus.canopen.object_table import STRING, TYPE_NAMES
from fieldbus.cia406 import OBJECT_NAMES, EncoderType

# The object table of the profile chapter, in its own notation: index, sub-indices, type, access, PDO,
# default.
COMMON = """
6000 0 U16 rw - 4 | 6002 0 U32 rw - ? | 6003 0 I32 rw - 0 | 6004 0 I32 ro T 0 | 6008 0 I64 ro T 0 | 6009 0 I64 rw - 0
600C 0 U32 ro T 0 | 6030 1 I16 ro T 0 | 6031 1 U8 rw - 0 | 6031 2-4 U16 rw - 1 | 6040 1 I16 ro T 0 | 6050 1 I16 ro T 0
6200 0 U16 rw - 0 | 6300 1 U8 ro T 0 | 6301 1 U8 rw - 0 | 6302 1 U8 rw - 0 | 6400 1 U8 ro T 0 | 6401 1 I32 rw - ?
6402 1 I32 rw - ? | 6500 0 U16 ro - 4 | 6501 0 U32 ro - ? | 6503 0 U16 ro T 0 | 6504 0 U16 ro - 1 | 6505 0 U16 ro T 0
6506 0 U16 ro - 63 | 6507 0 U32 ro - ? | 6508 0 U32 ro - ? | 6509 0 I32 ro - 0 | 650A 1-3 I32 ro - ? | 650B 0 U32 ro - ?
650D 0 U8 ro - ? | 650E 0 U32 ro - ?
1001 0 U8 ro T 0 | 1002 0 U32 ro T 0 | 1003 1-8 U32 ro - 0 | 1005 0 U32 rw - 128 | 1006 0 U32 rw - 0 | 1007 0 U32 rw - 0
100C 0 U16 rw - 0 | 100D 0 U8 rw - 0 | 1010 1-3 U32 rw - 1 | 1011 1-3 U32 rw - 1 | 1014 0 U32 rw - 133 | 1015 0 U16 rw - 0
1016 1 U32 rw - 0 | 1017 0 U16 rw - 0 | 1018 1-4 U32 ro - ? | 1019 0 U8 rw - 0 | 1020 1-2 U32 rw - 0 | 1029 1 U8 rw - 0
1200 1 U32 ro - 1541 | 1200 2 U32 ro - 1413
"""  # noqa: E501
CAMS = "".join(
    f"{base + cam:04X} 1 {kind} rw - 0 | "
    for base, kind in ((0x6310, "I32"), (0x6320, "I32"), (0x6330, "U16"))
    for cam in range(8)
)
OWN = {
    "rotary": "1000 0 U32 ro - 131478 | 6001 0 U32 rw - 8192 | 6002 0 U32 rw - 33554432 | 6501 0 U32 ro - "
    "8192 | 6502 0 U16 ro - 4096",
    "linear": "1000 0 U32 ro - 524694 | 6005 1-4 U32 rw - ?",
    "multi_sensor": "1000 0 U32 ro - 655766 | 6005 1-4 U32 rw - ? | 6010 1-2 I32 rw - 0 | 6020 1-2 I32 ro T "
    "0 | 650C 1-2 I32 ro - 0 "
    "| 6030 1-2 I16 ro T 0 | 6300 1-2 U8 ro T 0 | 6310 1-2 I32 rw - 0 | 6401 1-2 I32 rw - ?",
}


def table(text: str) -> list[tuple[int, int, str, str, str, int | None]]:
    found = []
    for cell in text.replace("\n", "|").split("|"):
        if not cell.strip():
            continue
        index, subs, kind, access, pdo, default = cell.split()
        first, _, last = subs.partition("-")
        found += [
            (int(index, 16), sub, kind, access, pdo, None if default == "?" else int(default))
            for sub in range(int(first), int(last or first) + 1)
        ]
    return found


@pytest.mark.requirement("C402-309")
@pytest.mark.parametrize("family", FAMILIES)
def test_file_and_table_agree(family):
    """The EDS that ships is exactly what the object table generates."""
    assert EDS[family].path.read_text(encoding="ascii") == EDS[family].text()


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-309")
def test_the_command_checks_the_files():
    """`--check` says that the files are up to date."""
    check = subprocess.run(
        [sys.executable, "-m", "emulators.eds", "--check"],
        check=False,
        cwd=Path(__file__).parents[3],
    )
    assert check.returncode == 0


@pytest.mark.requirement("C402-309")
@pytest.mark.parametrize("family", FAMILIES)
def test_the_library_reads_what_the_table_says(family):
    """Every entry of the table is in the imported dictionary with its type, access and mapping flag, and none
    besides.
    """
    dictionary = canopen.import_od(str(EDS[family].path), 5)
    found = set()
    for row in all_objects(family):
        for sub, item in row.items.items():
            entry = dictionary[row.index] if row.kind == 7 else dictionary[row.index][sub]
            found.add((row.index, sub))
            assert entry.data_type == item.data_type
            assert entry.access_type == item.eds_access
            assert entry.pdo_mappable == (item.pdo != "-")
            if item.data_type == STRING and item.default:
                assert entry.default == item.default
    names = {
        (index, sub)
        for index in dictionary.indices
        if index >= 0x1000
        for sub in getattr(dictionary.indices[index], "subindices", {0: None})
    }
    assert names == found


@pytest.mark.requirement(
    *(f"C406-0{number}" for number in (*range(13, 49),) if number != 21),
    "C406-021",
    "C406-001",
    "C301-132",
)
@pytest.mark.parametrize("family", FAMILIES)
def test_every_object_of_the_profile_is_there(family):
    """Type, access right, PDO direction and default of each object are those of the profile's table."""
    entries = entries_of(EDS[family].dictionary(), 5)
    for index, sub, kind, access, pdo, default in table(COMMON + CAMS + OWN[family]):
        entry = entries.get(index << 8 | sub)
        where = f"{index:04X}h:{sub}"
        assert entry is not None, where
        assert TYPE_NAMES[entry.data_type] == kind, where
        assert entry.readable, where
        assert entry.writable == (access == "rw"), where
        assert entry.maps_transmit == (pdo == "T"), where
        assert not entry.maps_receive, where
        if default is not None:
            assert entry.default == default, where


@pytest.mark.requirement("C406-009", "C406-010", "C406-011")
@pytest.mark.parametrize("family", FAMILIES)
def test_default_pdos(family):
    """Identifier, validity, transmission type and mapping of the TPDOs; a multi-sensor device sends
    6020h:1.
    """
    entries = entries_of(EDS[family].dictionary(), 5)
    position = 0x60200120 if family == "multi_sensor" else 0x60040020
    for record, cob_id, kind, mapping in (
        (0x1800, 0x40000185, 254, [position]),
        (0x1801, 0x40000285, 1, [position]),
        (0x1802, 0xC0000385, 1, [position, 0x60300110]),
    ):
        assert entries[record << 8 | 1].default == cob_id
        assert entries[record << 8 | 2].default == kind
        target = record + 0x200 << 8
        assert [entries[target | sub].default for sub in range(1, entries[target].default + 1)] == mapping
    assert 0x140001 not in entries, "an encoder receives no process data"


def test_names_of_the_profile_are_those_of_the_file():
    """The names that a decoder shows are those of the EDS, for every object of the profile that there is."""
    for family in FAMILIES:
        dictionary = EDS[family].dictionary()
        for index in dictionary.indices:
            if index >= 0x6000:
                assert dictionary[index].name == OBJECT_NAMES[index]


@pytest.mark.requirement("C406-001")
def test_device_types():
    """The high word of 1000h counts the ten kinds of encoders, the low word is the profile."""
    assert [f"{kind.device_type:08X}" for kind in EncoderType] == [
        f"{number:04X}0196" for number in range(1, 11)
    ]
