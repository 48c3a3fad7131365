"""Rules of PDO configuration over SDO, and layouts that are not whole bytes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.canopen import AbortCode, NmtCommand

INVALID = 0x80000000


def prepare(bench, index: int = 0x1600) -> None:
    """Make a PDO ready for remapping: invalid, no mapped objects."""
    communication = index - 0x200
    assert bench.write(communication, 1, bench.read(communication, 1) | INVALID, 4) == 0
    assert bench.write(index, 0, 0, 1) == 0


@pytest.mark.requirement("C301-046", "C301-105")
@pytest.mark.parametrize(
    ("index", "valid", "other"), [(0x1400, 0x205, 0x206), (0x1800, 0x40000185, 0x40000186)]
)
def test_identifier_changes_only_while_invalid(bench, index, valid, other):
    """A valid PDO refuses another identifier with 08000022h; by way of invalid it is taken."""
    assert bench.write(index, 1, other, 4) == AbortCode.DEVICE_STATE
    assert bench.read(index, 1) == valid
    assert bench.write(index, 1, valid, 4) == 0
    assert bench.write(index, 1, valid | INVALID, 4) == 0
    assert bench.write(index, 1, other | INVALID, 4) == 0
    assert bench.write(index, 1, other, 4) == 0


@pytest.mark.requirement("C301-012", "C301-097")
@pytest.mark.parametrize(
    "can_id",
    [0x000, 0x001, 0x07F, 0x101, 0x180, 0x581, 0x5FF, 0x601, 0x67F, 0x6E0, 0x6FF, 0x701, 0x77F, 0x780, 0x7FF],
)
def test_restricted_identifiers(bench, can_id):
    """A restricted identifier is refused with 06090030h; its neighbours are not."""
    bench.write(0x1400, 1, INVALID | 0x205, 4)
    assert bench.write(0x1400, 1, can_id, 4) == AbortCode.VALUE


@pytest.mark.requirement("C301-012")
@pytest.mark.parametrize("can_id", [0x080, 0x100, 0x181, 0x580, 0x600, 0x680, 0x6DF, 0x700])
def test_neighbours_of_restricted_identifiers(bench, can_id):
    """Identifiers just outside the restricted ranges are taken."""
    bench.write(0x1400, 1, INVALID | 0x205, 4)
    assert bench.write(0x1400, 1, can_id, 4) == 0


def test_identifier_zero_marks_an_unused_pdo(bench):
    """80000000h, the common value for an unused PDO, is accepted."""
    assert bench.write(0x1400, 1, INVALID, 4) == 0


@pytest.mark.requirement("C301-040", "C301-041", "C301-042", "C301-097")
@pytest.mark.parametrize(
    ("kind", "receive", "transmit"),
    [(0, True, True), (240, True, True), (241, False, False), (251, False, False), (252, False, True),
     (253, False, True), (254, True, True), (255, True, True)],
)  # fmt: skip
def test_transmission_types(bench, kind, receive, transmit):
    """Reserved transmission types are refused with 06090030h; 252 and 253 exist for TPDOs only."""
    assert bench.write(0x1400, 2, kind, 1) == (0 if receive else AbortCode.VALUE)
    assert bench.write(0x1800, 2, kind, 1) == (0 if transmit else AbortCode.VALUE)


@pytest.mark.requirement("C301-047")
@pytest.mark.parametrize("sub", [3, 6])
def test_parameters_that_need_an_invalid_tpdo(bench, sub):
    """Inhibit time and SYNC start value of a TPDO change only while it is invalid."""
    size = 2 if sub == 3 else 1
    assert bench.write(0x1800, sub, 5, size) == AbortCode.DEVICE_STATE
    assert bench.write(0x1800, sub, 0, size) == 0  # no change
    bench.write(0x1800, 1, 0xC0000185, 4)
    assert bench.write(0x1800, sub, 5, size) == 0


@pytest.mark.requirement("C301-045")
def test_reserved_sub_index_4(bench):
    """Sub-index 4 of a communication record does not exist."""
    assert -bench.read(0x1800, 4) == AbortCode.NO_SUB_INDEX


@pytest.mark.requirement("C301-051", "C301-052")
@pytest.mark.parametrize(
    ("entry", "abort"),
    [
        (0x50000010, AbortCode.NO_OBJECT),
        (0x10180910, AbortCode.NO_SUB_INDEX),
        (0x60400020, AbortCode.NOT_MAPPABLE),
        (0x60400008, AbortCode.NOT_MAPPABLE),
        (0x10170010, AbortCode.NOT_MAPPABLE),
        (0x60410010, AbortCode.NOT_MAPPABLE),
        (0x20010040, AbortCode.NOT_MAPPABLE),
        (0x60400010, 0),
    ],
)
def test_entries_of_an_rpdo(bench, entry, abort):
    """An RPDO takes existing, writable, mappable objects with their length; anything else has its abort
    code.
    """
    prepare(bench)
    assert bench.write(0x1600, 1, entry, 4) == abort


@pytest.mark.requirement("C301-052", "C301-053", "C301-088")
@pytest.mark.parametrize(
    ("entry", "abort"),
    [
        (0x60410010, 0),
        (0x60400010, 0),
        (0x10010008, 0),
        (0x20030010, AbortCode.NOT_MAPPABLE),
        (0x00050008, AbortCode.NOT_MAPPABLE),
    ],
)
def test_entries_of_a_tpdo(bench, entry, abort):
    """A TPDO takes readable, mappable objects; write-only ones and dummies are refused."""
    prepare(bench, 0x1A00)
    assert bench.write(0x1A00, 1, entry, 4) == abort


@pytest.mark.requirement("C301-052", "C301-105")
def test_entries_change_only_with_count_zero(bench):
    """Writing an entry while the number of objects is not 0 gives 08000022h, also while the PDO is valid."""
    assert bench.write(0x1600, 1, 0x60600008, 4) == AbortCode.DEVICE_STATE
    bench.write(0x1400, 1, INVALID | 0x205, 4)
    assert bench.write(0x1600, 1, 0x60600008, 4) == AbortCode.DEVICE_STATE
    bench.write(0x1600, 0, 0, 1)
    assert bench.write(0x1600, 1, 0x60600008, 4) == 0


@pytest.mark.requirement("C301-052")
def test_count_changes_only_while_invalid(bench):
    """The number of mapped objects of a valid PDO cannot be changed."""
    assert bench.write(0x1600, 0, 0, 1) == AbortCode.DEVICE_STATE
    assert bench.read(0x1600) == 1


@pytest.mark.requirement("C301-052", "C301-089")
def test_more_than_64_bits(bench):
    """More than 64 bits are refused with 06040042h when the number is written, and nothing is in force
    then.
    """
    prepare(bench)
    for sub in range(1, 4):
        assert bench.write(0x1600, sub, 0x60830020, 4) == 0
    assert bench.write(0x1600, 0, 3, 1) == AbortCode.PDO_LENGTH
    assert bench.read(0x1600) == 0
    assert bench.write(0x1600, 0, 2, 1) == 0


@pytest.mark.requirement("C301-051", "C301-089")
@pytest.mark.parametrize(
    ("count", "abort"), [(9, AbortCode.PDO_LENGTH), (65, AbortCode.PDO_LENGTH), (0xFD, AbortCode.PDO_LENGTH)]
)
def test_count_beyond_the_record(bench, count, abort):
    """More objects than the record has places, or than a PDO has bits, are refused."""
    prepare(bench)
    assert bench.write(0x1600, 0, count, 1) == abort


@pytest.mark.requirement("C301-052")
def test_count_over_an_empty_entry(bench):
    """A number of objects that covers an entry never written is refused."""
    prepare(bench)
    bench.write(0x1600, 1, 0x60600008, 4)
    bench.write(0x1600, 2, 0, 4)
    assert bench.write(0x1600, 0, 2, 1) == AbortCode.NO_OBJECT


@pytest.mark.requirement("C301-052")
def test_remapping_in_operational(bench):
    """A PDO remapped and moved in the prescribed order works under its new identifier and no longer under the
    old.
    """
    bench.nmt(NmtCommand.START)
    bench.map_pdo(1, [0x60600008, 0x60FF0020], 255, transmit=False, cob_id=0x225)
    bench.map_pdo(1, [0x60640020], 255, transmit=True, cob_id=0x400001A5)
    bench.take()
    bench.send(0x205, "0F 00")
    bench.send(0x225, "03 10 27 00 00")
    bench.slave.set(0x6064, 0, 7)
    bench.run()
    assert (bench.slave.get(0x6040), bench.slave.get(0x6060), bench.slave.get(0x60FF)) == (0, 3, 10_000)
    assert [(frame.can_id, frame.data[0]) for _, frame in bench.received] == [(0x1A5, 7)]


def test_remapping_drops_what_waits_for_sync(bench):
    """A payload that waits for its SYNC is not read with a mapping that it was not made for."""
    bench.nmt(NmtCommand.START)
    bench.send(0x305, "0F 00 10 27 00 00 09")
    bench.run()
    bench.map_pdo(2, [0x60600008], 1, transmit=False, cob_id=0x305)
    bench.send(0x080)
    bench.run()
    assert (bench.slave.get(0x6040), bench.slave.get(0x6060)) == (0, 0)


@pytest.mark.requirement("C301-053")
def test_dummies_fill_gaps(bench):
    """Dummy entries skip bytes of an RPDO; their length must be that of their type."""
    prepare(bench)
    assert bench.write(0x1600, 1, 0x00060020, 4) == AbortCode.NOT_MAPPABLE
    bench.map_pdo(1, [0x00060010, 0x60400010, 0x00040020], 255, transmit=False, cob_id=0x205)
    bench.nmt(NmtCommand.START)
    bench.send(0x205, "55 55 0F 00 66 66 66 66")
    bench.run()
    assert bench.slave.get(0x6040) == 0x0F


def test_bits_and_24_bit_numbers(bench):
    """Single bits and 24-bit numbers are packed without gaps, in both directions, with their sign."""
    mapping = [0x20040001, 0x20050001, 0x20060018, 0x60600008]
    bench.map_pdo(3, mapping, 255, transmit=False, cob_id=0x405)
    bench.map_pdo(3, mapping, 255, transmit=True, cob_id=0x40000385)
    bench.nmt(NmtCommand.START)
    bench.run()
    bench.take()
    word = 0 | 1 << 1 | (-5 & 0xFFFFFF) << 2 | (-3 & 0xFF) << 26
    bench.send(0x405, word.to_bytes(5, "little"))
    bench.run()
    slave = bench.slave
    assert [slave.get(index) for index in (0x2004, 0x2005, 0x2006, 0x6060)] == [0, 1, -5, -3]
    assert bench.take(0x385) == [word.to_bytes(5, "little")]


def test_reals_and_64_bit_numbers(bench):
    """REAL32 and 64-bit integers can be mapped."""
    bench.map_pdo(3, [0x20080020], 255, transmit=False, cob_id=0x405)
    bench.map_pdo(3, [0x20070040], 255, transmit=True, cob_id=0x40000385)
    bench.nmt(NmtCommand.START)
    bench.run()
    bench.take()
    bench.send(0x405, "00 00 20 C0")
    bench.slave.set(0x2007, 0, -2)
    bench.run()
    assert bench.slave.get(0x2008) == -2.5
    assert bench.take(0x385) == [b"\xfe" + b"\xff" * 7]


@pytest.mark.requirement("C301-051")
def test_eight_pdos_in_each_direction(bench):
    """All eight PDOs of each direction of the dictionary can be used at once."""
    for number in range(1, 9):
        bench.map_pdo(number, [0x60FF0020], 255, transmit=False, cob_id=0x210 + number)
        bench.map_pdo(number, [0x60640020], 255, transmit=True, cob_id=0x40000190 + number)
    bench.nmt(NmtCommand.START)
    bench.run()
    bench.take()
    bench.slave.set(0x6064, 0, 1)
    bench.run()
    assert sorted(frame.can_id for _, frame in bench.received) == list(range(0x191, 0x199))
    for number in range(1, 9):
        bench.send(0x210 + number, number.to_bytes(4, "little"))
        bench.run(1)
        assert bench.slave.get(0x60FF) == number


def test_defaults_that_the_dictionary_forbids(kit):
    """A default mapping against the dictionary's own rules leaves that PDO silent and is listed; the rest
    works.
    """
    od = kit.dictionary()
    od[0x1A00][1].default = 0x50000010
    bench = kit.Bench(od)
    bench.slave.power_on()
    bench.nmt(NmtCommand.START)
    bench.take()
    bench.send(0x080)
    bench.run()
    assert [frame.can_id for _, frame in bench.received] == [0x285]
    assert len(bench.slave.pdos.problems) == 1
    assert "1A00h" in bench.slave.pdos.problems[0]


@pytest.mark.exhaustive
@given(
    controlword=st.integers(0, 0xFFFF),
    velocity=st.integers(-(1 << 31), (1 << 31) - 1),
    mode=st.integers(-128, 127),
)
def test_what_goes_in_comes_out(controlword, velocity, mode):
    """Any values through an RPDO and back through a TPDO of the same mapping give the same payload."""
    payload = (
        controlword.to_bytes(2, "little")
        + velocity.to_bytes(4, "little", signed=True)
        + mode.to_bytes(1, "little", signed=True)
    )
    bench = mirrored()
    bench.take()
    bench.send(0x405, payload)
    bench.run()
    bench.send(0x080)
    bench.run()
    assert bench.take(0x385)[-1] == payload
    slave = bench.slave
    assert (slave.get(0x6040), slave.get(0x60FF), slave.get(0x6060)) == (controlword, velocity, mode)


_MIRROR = []


@pytest.fixture(autouse=True)
def _mirror(kit):
    if not _MIRROR:
        bench = kit.Bench()
        bench.slave.power_on()
        bench.run()
        mapping = [0x60400010, 0x60FF0020, 0x60600008]
        bench.map_pdo(3, mapping, 255, transmit=False, cob_id=0x405)
        bench.map_pdo(3, mapping, 1, transmit=True, cob_id=0x40000385)
        bench.nmt(NmtCommand.START)
        _MIRROR.append(bench)


def mirrored():
    return _MIRROR[0]
