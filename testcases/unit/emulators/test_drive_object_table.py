"""The object table of the profile, row by row: over the bus by SDO, in the mapping of PDOs, and in the
EDS.
"""

from __future__ import annotations

from dataclasses import dataclass

import canopen
import pytest

from emulators.drive.cia402 import EDS_PATH, DriveConfig
from fieldbus.canopen import PumpedNetwork
from testcases.unit.emulators.conftest import DriveBench

# ID | index:subs | type | access | PDO | default. A default of "-" is not given by the profile, or lives.
# Velocities are in rpm and accelerations in rpm/s, the default units; 100 rps^2 are 6000 rpm/s.
ROWS = """
C402-175 | 6007:0   | I16 | rw | -  | 1
C402-176 | 603F:0   | U16 | ro | T  | 0
C402-177 | 6040:0   | U16 | rw | RT | 0
C402-178 | 6041:0   | U16 | ro | T  | -
C402-179 | 6042:0   | I16 | rw | RT | 0
C402-180 | 6043:0   | I16 | ro | T  | -
C402-181 | 6044:0   | I16 | ro | T  | -
C402-182 | 6046:1-2 | U32 | rw | R  | 0 3000
C402-183 | 6047:1-4 | U32 | rw | R  | 0 3000 0 3000
C402-184 | 6048:1   | U32 | rw | R  | 3000
C402-184 | 6048:2   | U16 | rw | R  | 1
C402-185 | 6049:1   | U32 | rw | R  | 3000
C402-185 | 6049:2   | U16 | rw | R  | 1
C402-186 | 604A:1   | U32 | rw | R  | 3000
C402-186 | 604A:2   | U16 | rw | R  | 1
C402-187 | 604B:1-2 | I16 | rw | R  | 1 1
C402-188 | 604C:1-2 | I32 | rw | R  | 1 1
C402-189 | 604D:0   | U8  | rw | R  | 4
C402-190 | 604E:0   | U32 | rw | R  | 3000
C402-191 | 604F:0   | U32 | rw | R  | 1000
C402-191 | 6050:0   | U32 | rw | R  | 1000
C402-191 | 6051:0   | U32 | rw | R  | 1000
C402-192 | 6052:0   | I16 | rw | RT | 0
C402-192 | 6053:0   | I16 | ro | T  | 0
C402-192 | 6054:0   | I16 | ro | T  | 0
C402-192 | 6055:0   | I16 | ro | T  | 0
C402-193 | 605A:0   | I16 | rw | -  | 2
C402-193 | 605B:0   | I16 | rw | -  | 0
C402-193 | 605C:0   | I16 | rw | -  | 1
C402-193 | 605D:0   | I16 | rw | -  | 1
C402-193 | 605E:0   | I16 | rw | -  | 2
C402-194 | 6060:0   | I8  | rw | RT | 0
C402-195 | 6061:0   | I8  | ro | T  | 0
C402-196 | 6062:0   | I32 | ro | T  | -
C402-197 | 6063:0   | I32 | ro | T  | -
C402-198 | 6064:0   | I32 | ro | T  | -
C402-199 | 6065:0   | U32 | rw | R  | 4294967295
C402-200 | 6066:0   | U16 | rw | R  | 0
C402-201 | 6067:0   | U32 | rw | R  | 4294967295
C402-202 | 6068:0   | U16 | rw | R  | 0
C402-203 | 6069:0   | I32 | ro | T  | -
C402-204 | 606A:0   | I16 | rw | R  | 0
C402-205 | 606B:0   | I32 | ro | T  | -
C402-206 | 606C:0   | I32 | ro | T  | -
C402-207 | 606D:0   | U16 | rw | R  | 0
C402-207 | 606E:0   | U16 | rw | R  | 0
C402-208 | 606F:0   | U16 | rw | R  | 0
C402-208 | 6070:0   | U16 | rw | R  | 0
C402-209 | 6071:0   | I16 | rw | RT | 0
C402-210 | 6072:0   | U16 | rw | R  | 3000
C402-211 | 6073:0   | U16 | rw | R  | 3000
C402-212 | 6074:0   | I16 | ro | T  | -
C402-213 | 6075:0   | U32 | rw | -  | 5000
C402-214 | 6076:0   | U32 | rw | -  | 2000
C402-215 | 6077:0   | I16 | ro | T  | -
C402-216 | 6078:0   | I16 | ro | T  | -
C402-217 | 6079:0   | U32 | ro | T  | 560000
C402-218 | 607A:0   | I32 | rw | RT | 0
C402-219 | 607B:1-2 | I32 | rw | R  | -2147483648 2147483647
C402-220 | 607C:0   | I32 | rw | R  | 0
C402-221 | 607D:1-2 | I32 | rw | R  | -2147483648 2147483647
C402-222 | 607E:0   | U8  | rw | R  | 0
C402-223 | 607F:0   | U32 | rw | R  | 3000
C402-224 | 6080:0   | U32 | rw | R  | 3000
C402-225 | 6081:0   | U32 | rw | R  | 1000
C402-226 | 6082:0   | U32 | rw | R  | 0
C402-227 | 6083:0   | U32 | rw | R  | 6000
C402-227 | 6084:0   | U32 | rw | R  | 6000
C402-228 | 6085:0   | U32 | rw | R  | 24000
C402-229 | 6086:0   | I16 | rw | R  | 0
C402-230 | 6087:0   | U32 | rw | R  | 100000
C402-230 | 6088:0   | I16 | rw | R  | 0
C402-231 | 6089:0   | I8  | rw | -  | 0
C402-231 | 608A:0   | U8  | rw | -  | 0
C402-231 | 608B:0   | I8  | rw | -  | 0
C402-231 | 608C:0   | U8  | rw | -  | 0
C402-231 | 608D:0   | I8  | rw | -  | 0
C402-231 | 608E:0   | U8  | rw | -  | 0
C402-232 | 608F:1-2 | U32 | rw | R  | 131072 1
C402-233 | 6090:1-2 | U32 | rw | R  | 131072 1
C402-234 | 6091:1-2 | U32 | rw | R  | 1 1
C402-235 | 6092:1-2 | U32 | rw | R  | 10000 1
C402-236 | 6093:1-2 | U32 | rw | R  | 1 1
C402-237 | 6094:1-2 | U32 | rw | R  | 1 1
C402-238 | 6096:1-2 | U32 | rw | R  | 1 1
C402-239 | 6097:1-2 | U32 | rw | R  | 1 1
C402-240 | 6098:0   | I8  | rw | R  | 0
C402-241 | 6099:1-2 | U32 | rw | R  | 200 20
C402-242 | 609A:0   | U32 | rw | R  | 6000
C402-243 | 60A3:0   | U8  | rw | R  | 1
C402-244 | 60A4:1-2 | U32 | rw | R  | 0 0
C402-245 | 60A8:0   | U32 | rw | -  | 0
C402-245 | 60A9:0   | U32 | rw | -  | 11814656
C402-246 | 60B0:0   | I32 | rw | RT | 0
C402-247 | 60B1:0   | I32 | rw | RT | 0
C402-248 | 60B2:0   | I16 | rw | RT | 0
C402-249 | 60B8:0   | U16 | rw | RT | 0
C402-250 | 60B9:0   | U16 | ro | T  | 0
C402-251 | 60BA:0   | I32 | ro | T  | 0
C402-251 | 60BB:0   | I32 | ro | T  | 0
C402-251 | 60BC:0   | I32 | ro | T  | 0
C402-251 | 60BD:0   | I32 | ro | T  | 0
C402-252 | 60C0:0   | I16 | rw | R  | 0
C402-253 | 60C1:1   | I32 | rw | RT | 0
C402-254 | 60C2:1   | U8  | rw | R  | 1
C402-254 | 60C2:2   | I8  | rw | R  | -3
C402-255 | 60C4:1   | U32 | ro | -  | 16
C402-255 | 60C4:2   | U32 | rw | R  | 1
C402-255 | 60C4:3   | U8  | rw | R  | 0
C402-255 | 60C4:4   | U16 | rw | R  | 0
C402-255 | 60C4:5   | U8  | wo | R  | 1
C402-255 | 60C4:6   | U8  | wo | R  | 0
C402-256 | 60C5:0   | U32 | rw | R  | 60000
C402-256 | 60C6:0   | U32 | rw | R  | 60000
C402-257 | 60C8:0   | I32 | rw | RT | -2147483648
C402-257 | 60C9:0   | I32 | rw | RT | 2147483647
C402-258 | 60D0:1-2 | I16 | rw | R  | 1 2
C402-259 | 60D1:0   | U32 | ro | T  | 0
C402-259 | 60D2:0   | U32 | ro | T  | 0
C402-259 | 60D3:0   | U32 | ro | T  | 0
C402-259 | 60D4:0   | U32 | ro | T  | 0
C402-260 | 60D5:0   | U16 | ro | T  | 0
C402-260 | 60D6:0   | U16 | ro | T  | 0
C402-260 | 60D7:0   | U16 | ro | T  | 0
C402-260 | 60D8:0   | U16 | ro | T  | 0
C402-261 | 60E0:0   | U16 | rw | RT | 3000
C402-261 | 60E1:0   | U16 | rw | RT | 3000
C402-262 | 60E3:1   | I8  | ro | -  | -
C402-263 | 60E4:1   | I32 | ro | T  | -
C402-263 | 60E5:1   | I32 | ro | T  | -
C402-264 | 60F2:0   | U16 | rw | R  | 0
C402-265 | 60F4:0   | I32 | ro | T  | -
C402-266 | 60F8:0   | I32 | rw | R  | 0
C402-267 | 60FA:0   | I32 | ro | T  | -
C402-268 | 60FC:0   | I32 | ro | T  | -
C402-269 | 60FD:0   | U32 | ro | T  | -
C402-270 | 60FE:1-2 | U32 | rw | R  | 0 0
C402-271 | 60FF:0   | I32 | rw | RT | 0
C402-272 | 6402:0   | U16 | rw | -  | 10
C402-273 | 6403:0   | STR | rw | -  | -
C402-273 | 6404:0   | STR | rw | -  | -
C402-274 | 6410:1   | any | rw | -  | -
C402-275 | 6502:0   | U32 | ro | T  | 1007
C402-276 | 6503:0   | STR | ro | -  | -
C402-276 | 6504:0   | STR | ro | -  | -
C402-276 | 6505:0   | STR | ro | -  | -
C402-277 | 6510:1   | any | -  | -  | -
C402-278 | 67FE:0   | U32 | ro | -  | -
C402-278 | 67FF:0   | U32 | ro | -  | 131474
"""

TYPES = {"I8": 2, "I16": 3, "I32": 4, "U8": 5, "U16": 6, "U32": 7, "STR": 9}
BITS = {"I8": 8, "I16": 16, "I32": 32, "U8": 8, "U16": 16, "U32": 32}
READ_ONLY, WRITE_ONLY, NOT_MAPPABLE = 0x06010002, 0x06010001, 0x06040041


@dataclass(frozen=True)
class Row:
    requirement: str
    index: int
    sub: int
    kind: str
    access: str
    pdo: str
    default: int | None

    @property
    def requirements(self) -> tuple[str, ...]:
        """The row, and for motor and drive data the rule that names them."""
        return (self.requirement, "C402-170") if 0x6402 <= self.index <= 0x67FF else (self.requirement,)

    @property
    def length(self) -> int:
        return BITS[self.kind] // 8

    @property
    def mapping(self) -> int:
        return self.index << 16 | self.sub << 8 | BITS.get(self.kind, 32)

    def encode(self, value: int) -> bytes:
        return value.to_bytes(self.length, "little", signed=value < 0)

    def decode(self, data: bytes) -> int:
        return int.from_bytes(data, "little", signed=self.kind[0] == "I")


def rows() -> list[Row]:
    result = []
    for line in ROWS.strip().splitlines():
        requirement, place, kind, access, pdo, default = (part.strip() for part in line.split("|"))
        index, _, subs = place.partition(":")
        first, _, last = subs.partition("-")
        numbers = range(int(first), int(last or first) + 1)
        values = default.split() if default != "-" else ["-"] * len(numbers)
        result += [
            Row(requirement, int(index, 16), sub, kind, access, pdo, None if value == "-" else int(value))
            for sub, value in zip(numbers, values, strict=True)
        ]
    return result


def label(row: Row) -> str:
    return f"{row.index:04X}h:{row.sub}"


every_row = pytest.mark.requirement(*dict.fromkeys(one for row in rows() for one in row.requirements))


@pytest.fixture(scope="module")
def bench() -> DriveBench:
    return DriveBench(DriveConfig())


@pytest.fixture(scope="module")
def sdo(bench):
    """Return an SDO client on the bus of a drive with all its defaults."""
    with PumpedNetwork(bench.medium, name="tester") as network:
        yield network.add_node(1, canopen.ObjectDictionary()).sdo


@pytest.fixture(scope="module")
def eds():
    return canopen.import_od(str(EDS_PATH), 1)


def refusal(sdo, index: int, sub: int, data: bytes | None = None) -> int:
    """Return the abort code of an upload, or of an expedited download of 1 to 4 bytes, as single frames."""
    command = 0x40 if data is None else 0x23 | 4 - len(data) << 2
    place = index.to_bytes(2, "little") + bytes((sub,))
    with pytest.raises(canopen.SdoAbortedError) as caught:
        sdo.request_response(bytes((command,)) + place + (data or b"").ljust(4, b"\0"))
    return caught.value.code


def test_the_table_is_whole():
    """Every number from 175 to 278 has at least one row here."""
    assert {row.requirement for row in rows()} == {f"C402-{number}" for number in range(175, 279)}


@pytest.mark.exhaustive
@every_row
def test_by_sdo(sdo, subtests):
    """Length of the type, default, and the access right with its abort codes."""
    for row in rows():
        with subtests.test(label(row)):
            check_by_sdo(sdo, row)


def check_by_sdo(sdo, row):
    if row.access == "wo":
        assert refusal(sdo, row.index, row.sub) == WRITE_ONLY
        sdo.download(row.index, row.sub, row.encode(row.default))
        return
    data = bytes(sdo.upload(row.index, row.sub))
    if row.kind in BITS:
        assert len(data) == row.length
    if row.default is not None:
        assert row.decode(data) == row.default
    if row.access == "ro":
        assert refusal(sdo, row.index, row.sub, data[:4] or b"x") == READ_ONLY
    elif row.access == "rw":
        sdo.download(row.index, row.sub, data or b"x")
        assert sdo.upload(row.index, row.sub) == (data or b"x")


@pytest.mark.exhaustive
@every_row
@pytest.mark.parametrize(("direction", "record", "mapping"), [("R", 0x1407, 0x1607), ("T", 0x1807, 0x1A07)])
def test_mapping(sdo, direction, record, mapping, subtests):
    """What the table allows can be mapped into an RPDO or TPDO, all else is 06040041h."""
    sdo.download(record, 1, (1 << 31).to_bytes(4, "little"))
    for row in rows():
        with subtests.test(label(row)):
            sdo.download(mapping, 0, b"\0")
            arguments = (mapping, 1, row.mapping.to_bytes(4, "little"))
            if direction in row.pdo:
                sdo.download(*arguments)
            else:
                assert refusal(sdo, *arguments) == NOT_MAPPABLE


@pytest.mark.exhaustive
@pytest.mark.requirement(
    *dict.fromkeys(one for row in rows() if row.kind != "any" for one in row.requirements)
)
def test_in_the_eds(eds, subtests):
    """Type, access right, mapping flag and default of the EDS are those of the table."""
    for row in rows():
        if row.kind == "any":
            continue
        with subtests.test(label(row)):
            entry = eds[row.index] if not row.sub else eds[row.index][row.sub]
            assert entry.data_type == TYPES[row.kind]
            expected = {"R": "rww", "T": "rwr"}.get(row.pdo, "rw") if row.access == "rw" else row.access
            assert entry.access_type == expected
            assert entry.pdo_mappable == (row.pdo != "-")
            if row.default is not None:
                # An EDS writes negative numbers as their bits, or with a sign.
                assert (entry.default - row.default) % (1 << BITS[row.kind]) == 0
