"""Object table, EDS file and dictionary of the drive."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import canopen
import pytest

from emulators.drive.cia402 import EDS, EDS_PATH
from emulators.drive.cia402.objects.table import all_objects
from fieldbus.canopen import write_eds_files
from fieldbus.canopen.dictionary import entries_of
from fieldbus.canopen.object_table import STRING, TYPE_NAMES

# The object table of the profile chapter, in its own notation: index, sub-indices, types, access, PDO
# direction.
PROFILE = """
6007 0 I16 rw - | 603F 0 U16 ro T | 6040 0 U16 rw RT | 6041 0 U16 ro T | 6042 0 I16 rw RT | 6043 0 I16 ro T
6044 0 I16 ro T | 6046 1-2 U32 rw R | 6047 1-4 U32 rw R | 6048 1 U32 rw R | 6048 2 U16 rw R | 6049 1 U32 rw R
6049 2 U16 rw R | 604A 1 U32 rw R | 604A 2 U16 rw R | 604B 1-2 I16 rw R | 604C 1-2 I32 rw R | 604D 0 U8 rw R
604E 0 U32 rw R | 604F 0 U32 rw R | 6050 0 U32 rw R | 6051 0 U32 rw R | 6052 0 I16 rw RT | 6053 0 I16 ro T
6054 0 I16 ro T | 6055 0 I16 ro T | 605A 0 I16 rw - | 605B 0 I16 rw - | 605C 0 I16 rw - | 605D 0 I16 rw -
605E 0 I16 rw - | 6060 0 I8 rw RT | 6061 0 I8 ro T | 6062 0 I32 ro T | 6063 0 I32 ro T | 6064 0 I32 ro T
6065 0 U32 rw R | 6066 0 U16 rw R | 6067 0 U32 rw R | 6068 0 U16 rw R | 6069 0 I32 ro T | 606A 0 I16 rw R
606B 0 I32 ro T | 606C 0 I32 ro T | 606D 0 U16 rw R | 606E 0 U16 rw R | 606F 0 U16 rw R | 6070 0 U16 rw R
6071 0 I16 rw RT | 6072 0 U16 rw R | 6073 0 U16 rw R | 6074 0 I16 ro T | 6075 0 U32 rw - | 6076 0 U32 rw -
6077 0 I16 ro T | 6078 0 I16 ro T | 6079 0 U32 ro T | 607A 0 I32 rw RT | 607B 1-2 I32 rw R | 607C 0 I32 rw R
607D 1-2 I32 rw R | 607E 0 U8 rw R | 607F 0 U32 rw R | 6080 0 U32 rw R | 6081 0 U32 rw R | 6082 0 U32 rw R
6083 0 U32 rw R | 6084 0 U32 rw R | 6085 0 U32 rw R | 6086 0 I16 rw R | 6087 0 U32 rw R | 6088 0 I16 rw R
6089 0 I8 rw - | 608A 0 U8 rw - | 608B 0 I8 rw - | 608C 0 U8 rw - | 608D 0 I8 rw - | 608E 0 U8 rw -
608F 1-2 U32 rw R | 6090 1-2 U32 rw R | 6091 1-2 U32 rw R | 6092 1-2 U32 rw R | 6093 1-2 U32 rw R
6094 1-2 U32 rw R | 6096 1-2 U32 rw R | 6097 1-2 U32 rw R | 6098 0 I8 rw R | 6099 1-2 U32 rw R | 609A 0 U32 rw R
60A3 0 U8 rw R | 60A4 1-2 U32 rw R | 60A8 0 U32 rw - | 60A9 0 U32 rw - | 60B0 0 I32 rw RT | 60B1 0 I32 rw RT
60B2 0 I16 rw RT | 60B8 0 U16 rw RT | 60B9 0 U16 ro T | 60BA 0 I32 ro T | 60BB 0 I32 ro T | 60BC 0 I32 ro T
60BD 0 I32 ro T | 60C0 0 I16 rw R | 60C1 1 I32 rw RT | 60C2 1 U8 rw R | 60C2 2 I8 rw R | 60C4 1 U32 ro -
60C4 2 U32 rw R | 60C4 3 U8 rw R | 60C4 4 U16 rw R | 60C4 5 U8 wo R | 60C4 6 U8 wo R | 60C5 0 U32 rw R
60C6 0 U32 rw R | 60C8 0 I32 rw RT | 60C9 0 I32 rw RT | 60D0 1-2 I16 rw R | 60D1 0 U32 ro T | 60D2 0 U32 ro T
60D3 0 U32 ro T | 60D4 0 U32 ro T | 60D5 0 U16 ro T | 60D6 0 U16 ro T | 60D7 0 U16 ro T | 60D8 0 U16 ro T
60E0 0 U16 rw RT | 60E1 0 U16 rw RT | 60E3 1 I8 ro - | 60E4 1 I32 ro T | 60E5 1 I32 ro T | 60F2 0 U16 rw R
60F4 0 I32 ro T | 60F8 0 I32 rw R | 60FA 0 I32 ro T | 60FC 0 I32 ro T | 60FD 0 U32 ro T | 60FE 1-2 U32 rw R
60FF 0 I32 rw RT | 6402 0 U16 rw - | 6403 0 STRING rw - | 6404 0 STRING rw - | 6502 0 U32 ro T
6503 0 STRING ro - | 6504 0 STRING ro - | 6505 0 STRING ro - | 67FE 0 U32 ro - | 67FF 0 U32 ro -
1000 0 U32 ro - | 1001 0 U8 ro T | 1002 0 U32 ro T | 1003 1-8 U32 ro - | 1005 0 U32 rw - | 1006 0 U32 rw -
1007 0 U32 rw - | 1008 0 STRING const - | 1009 0 STRING const - | 100A 0 STRING const - | 100C 0 U16 rw -
100D 0 U8 rw - | 1010 1-3 U32 rw - | 1011 1-3 U32 rw - | 1012 0 U32 rw - | 1014 0 U32 rw - | 1015 0 U16 rw -
1016 1 U32 rw - | 1017 0 U16 rw - | 1018 1-4 U32 ro - | 1019 0 U8 rw - | 1020 1-2 U32 rw - | 1029 1 U8 rw -
1200 1-2 U32 ro -
"""  # noqa: E501

DEFAULTS = {
    (0x6007, 0): 1,
    (0x605A, 0): 2,
    (0x605B, 0): 0,
    (0x605C, 0): 1,
    (0x605D, 0): 1,
    (0x605E, 0): 2,
    (0x6065, 0): 0xFFFFFFFF,
    (0x6067, 0): 0xFFFFFFFF,
    (0x6072, 0): 3000,
    (0x6073, 0): 3000,
    (0x6075, 0): 5000,
    (0x6076, 0): 2000,
    (0x6079, 0): 560000,
    (0x607B, 1): -0x80000000,
    (0x607B, 2): 0x7FFFFFFF,
    (0x607D, 1): -0x80000000,
    (0x607D, 2): 0x7FFFFFFF,
    (0x607F, 0): 3000,
    (0x6080, 0): 3000,
    (0x6081, 0): 1000,
    (0x6083, 0): 6000,
    (0x6084, 0): 6000,
    (0x6085, 0): 24000,
    (0x6087, 0): 100000,
    (0x608F, 1): 131072,
    (0x608F, 2): 1,
    (0x6091, 1): 1,
    (0x6091, 2): 1,
    (0x6092, 1): 10000,
    (0x6092, 2): 1,
    (0x6096, 1): 1,
    (0x6099, 1): 200,
    (0x6099, 2): 20,
    (0x609A, 0): 6000,
    (0x60A3, 0): 1,
    (0x60A8, 0): 0,
    (0x60A9, 0): 0x00B44700,
    (0x60C2, 1): 1,
    (0x60C2, 2): -3,
    (0x60C4, 1): 16,
    (0x60C4, 2): 1,
    (0x60C5, 0): 60000,
    (0x60C6, 0): 60000,
    (0x60C8, 0): -0x80000000,
    (0x60C9, 0): 0x7FFFFFFF,
    (0x60D0, 1): 1,
    (0x60D0, 2): 2,
    (0x60E0, 0): 3000,
    (0x60E1, 0): 3000,
    (0x6402, 0): 10,
    (0x6502, 0): 0x3EF,
    (0x67FF, 0): 0x00020192,
    (0x1000, 0): 0x00020192,
    (0x1005, 0): 0x80,
    (0x1010, 1): 1,
    (0x1011, 3): 1,
    (0x1012, 0): 0x100,
    (0x1014, 0): 0x80 + 5,
    (0x1200, 1): 0x600 + 5,
    (0x1200, 2): 0x580 + 5,
    (0x604D, 0): 4,
    (0x604E, 0): 3000,
    (0x6046, 2): 3000,
    (0x6048, 1): 3000,
    (0x6048, 2): 1,
    (0x604B, 1): 1,
    (0x604C, 2): 1,
}

PDOS = {
    # communication record: (COB-ID for node 5, transmission type, mapping)
    0x1400: (0x205, 255, [0x60400010]),
    0x1401: (0x305, 255, [0x60400010, 0x60600008]),
    0x1402: (0x405, 1, [0x60400010, 0x607A0020]),
    0x1403: (0x505, 1, [0x60400010, 0x60FF0020]),
    0x1404: (0x80000000, 1, [0x60400010, 0x60710010]),
    0x1405: (0x80000000, 255, [0x60400010, 0x60420010]),
    0x1406: (0x80000000, 255, [0x60400010, 0x60FE0120]),
    0x1407: (0x80000000, 255, [0x60400010, 0x60600008]),
    0x1800: (0x40000185, 255, [0x60410010]),
    0x1801: (0x40000285, 255, [0x60410010, 0x60610008]),
    0x1802: (0x40000385, 1, [0x60410010, 0x60640020]),
    0x1803: (0x40000485, 1, [0x60410010, 0x606C0020]),
    0x1804: (0xC0000000, 1, [0x60410010, 0x60770010]),
    0x1805: (0xC0000000, 255, [0x60410010, 0x60440010]),
    0x1806: (0xC0000000, 255, [0x60410010, 0x60FD0020]),
    0x1807: (0xC0000000, 1, [0x60B90010, 0x60BA0020]),
}


def profile_rows() -> list[tuple[int, int, str, str, str]]:
    rows = []
    for line in PROFILE.replace("|", "\n").split("\n"):
        if not line.strip():
            continue
        index, subs, kind, access, pdo = line.split()
        first, _, last = subs.partition("-")
        rows += [
            (int(index, 16), sub, kind, access, pdo) for sub in range(int(first), int(last or first) + 1)
        ]
    return rows


@pytest.fixture(scope="module")
def entries():
    return entries_of(EDS.dictionary(), 5)


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-309")
def test_file_and_table_agree():
    """The EDS that ships is exactly what the object table generates."""
    assert EDS_PATH.read_text(encoding="ascii") == EDS.text()
    check = subprocess.run(
        [sys.executable, "-m", "emulators.eds", "--check"],
        check=False,
        cwd=Path(__file__).parents[3],
    )
    assert check.returncode == 0


@pytest.mark.exhaustive
@pytest.mark.requirement("C402-309")
def test_the_library_reads_what_the_table_says():
    """Every entry of the table is in the imported dictionary with its type, access and mapping flag, and none
    besides.
    """
    dictionary = canopen.import_od(str(EDS_PATH), 5)
    found = set()
    for row in all_objects():
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
    *(f"C402-{number}" for number in range(175, 279) if number not in (274, 275, 277)),
    "C301-132",
    "C301-133",
    "C301-135",
    "C301-136",
    "C301-139",
    "C301-143",
    "C301-144",
    "C301-145",
    "C301-146",
    "C301-147",
    "C301-148",
    "C301-150",
)
def test_every_object_of_the_profile_is_there(entries):
    """Type, access right and PDO direction of each object are those of the profile's table."""
    for index, sub, kind, access, pdo in profile_rows():
        entry = entries.get(index << 8 | sub)
        where = f"{index:04X}h:{sub}"
        assert entry is not None, where
        assert TYPE_NAMES[entry.data_type] == kind, where
        assert entry.readable == (access != "wo"), where
        assert entry.writable == (access in ("rw", "wo")), where
        assert entry.maps_receive == ("R" in pdo), where
        assert entry.maps_transmit == ("T" in pdo), where
    for (index, sub), value in DEFAULTS.items():
        assert entries[index << 8 | sub].default == value, f"{index:04X}h:{sub}"


@pytest.mark.requirement(*(f"C402-{number}" for number in range(279, 295)))
def test_default_pdos(entries):
    """Identifier, transmission type and mapping of the eight RPDOs and TPDOs."""
    for record, (cob_id, kind, mapping) in PDOS.items():
        assert entries[record << 8 | 1].default == cob_id
        assert entries[record << 8 | 2].default == kind
        target = record + 0x200
        assert entries[target << 8].default == len(mapping)
        assert [entries[target << 8 | sub].default for sub in range(1, len(mapping) + 1)] == mapping
        assert target << 8 | 8 in entries


def test_commands_are_not_stored(entries):
    """Setpoints and the control word are never saved by 1010h."""
    for index in (0x6040, 0x607A, 0x60FF, 0x6071, 0x60B0, 0x60B1, 0x60B2):
        assert not entries[index << 8].storable
    for index in (0x6083, 0x605A, 0x6060):
        assert entries[index << 8].storable


def test_check_reports_a_stale_file(tmp_path, capsys):
    """`--check` fails when the file differs from the table, and writing repairs it."""
    stale = replace(EDS, path=tmp_path / "servo.eds")
    stale.path.write_text("old", encoding="ascii")
    assert write_eds_files([stale], ["--check"]) == 1
    assert "does not agree" in capsys.readouterr().err
    assert write_eds_files([stale], []) == 0
    assert write_eds_files([stale], ["--check"]) == 0
