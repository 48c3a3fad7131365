"""Functions, limits, exception codes and their order, at the PDU: what the server answers, byte by byte."""

import struct

import pytest

from fieldbus.errors import ConfigurationError
from fieldbus.modbus import (
    Area,
    Block,
    Diagnostic,
    ExceptionCode,
    Function,
    ModbusServer,
    RegisterMap,
    RegisterRefusal,
    WordOrder,
)
from testcases.catalogue import each

START, COUNT = 10, 2200
LAST = START + COUNT - 1


def pdu(*parts) -> bytes:
    """Return one byte for the first part, words for the others, bytes as they are."""
    return b"".join(
        part if isinstance(part, bytes) else struct.pack(">B" if number == 0 else ">H", part)
        for number, part in enumerate(parts)
    )


def refused(function, code) -> bytes:
    return bytes((function | 0x80, code))


READS = [(1, 2000), (2, 2000), (3, 125), (4, 125)]


@pytest.mark.requirement("MODB-012", "MODB-013", "MODB-024", "MODB-032")
@pytest.mark.parametrize(("function", "most"), READS)
def test_reading_up_to_the_limit_and_not_beyond(server, function, most):
    """The limit is answered in full, limit + 1 and 0 with exception 03."""
    answer = server.respond(pdu(function, START, most))
    size = (most + 7) // 8 if function <= 2 else 2 * most
    assert answer[:2] == bytes((function, size & 0xFF))
    assert len(answer) == 2 + size
    for count in (0, most + 1, 0xFFFF):
        assert server.respond(pdu(function, START, count)) == refused(function, 3)


@pytest.mark.requirement("MODB-012")
def test_bits_are_packed_from_the_lowest_on(server):
    """Bit 0 of the first byte is the first coil; what is left over of the last byte is zero."""
    expected = [(START + n) % 3 == 0 for n in range(11)]
    for function in (1, 2):
        answer = server.respond(pdu(function, START, 11))
        number = int.from_bytes(answer[2:], "little")
        assert [bool(number >> n & 1) for n in range(16)] == expected + [False] * 5


@pytest.mark.requirement("MODB-013", "MODB-033")
def test_registers_are_big_endian(server):
    """The high byte of a register comes first."""
    assert server.respond(pdu(3, 10, 2)) == bytes.fromhex("03 04 100a 100b")
    assert server.respond(pdu(4, 10, 1)) == bytes.fromhex("04 02 100a")


WRITES = [
    (5, lambda at, n: pdu(5, at, 0xFF00), None),
    (6, lambda at, n: pdu(6, at, 7), None),
    (15, lambda at, n: pdu(15, at, n, bytes(((n + 7) // 8 & 0xFF,)), bytes((n + 7) // 8)), 1968),
    (16, lambda at, n: pdu(16, at, n, bytes((2 * n & 0xFF,)), bytes(2 * n)), 123),
    (22, lambda at, n: pdu(22, at, 0xFFFF, 0), None),
    (23, lambda at, n: pdu(23, at, 1, START, n, bytes((2 * n & 0xFF,)), bytes(2 * n)), 121),
]


@pytest.mark.requirement("MODB-014", "MODB-015", "MODB-017", "MODB-018", "MODB-020", "MODB-024")
@pytest.mark.parametrize(("function", "make", "most"), WRITES, ids=[f"function {f}" for f, *_ in WRITES])
def test_writing_up_to_the_limit_and_not_beyond(server, function, make, most):
    """The limit is written, limit + 1 and 0 are exception 03; single ones have no quantity."""
    answer = server.respond(make(START, most or 1))
    assert answer[0] == function
    if most:
        assert server.respond(make(START, most + 1)) == refused(function, 3)
        assert server.respond(make(START, 0)) == refused(function, 3)


@pytest.mark.requirement("MODB-020")
def test_reading_while_writing_has_its_own_limit(server):
    """Function 23 reads up to 125 registers."""
    for count, good in ((125, True), (126, False), (0, False)):
        answer = server.respond(pdu(23, START, count, START, 1, b"\x02\x00\x01"))
        assert (answer[0] == 23) is good
        assert good or answer == refused(23, 3)


@pytest.mark.requirement("MODB-023")
@pytest.mark.parametrize(
    ("function", "make"),
    [(f, lambda at, n, f=f: pdu(f, at, n)) for f, _ in READS] + [(f, make) for f, make, _ in WRITES],
    ids=[f"function {f}" for f, *_ in (*READS, *WRITES)],
)
def test_unknown_addresses_are_refused(server, function, make):
    """Before the first, behind the last, and a range that begins inside and ends outside: exception 02."""
    assert server.respond(make(LAST, 1))[0] == function
    assert server.respond(make(START - 1, 1)) == refused(function, 2)
    assert server.respond(make(LAST + 1, 1)) == refused(function, 2)
    assert server.respond(make(65535, 1)) == refused(function, 2)
    if function not in (5, 6, 22, 23):
        assert server.respond(make(LAST, 2)) == refused(function, 2)
        assert server.respond(make(START - 1, 2)) == refused(function, 2)


@pytest.mark.requirement("MODB-022", "MODB-032")
def test_unknown_functions_are_refused(server):
    """Every other function code is exception 01, whatever comes behind it; also those with the exception
    bit.
    """
    for function in range(256):
        if function not in Function._value2member_map_:
            assert server.respond(bytes((function, 1, 2, 3))) == refused(function, 1)
    few = ModbusServer(RegisterMap(), functions=(3, 6, 16))
    assert few.respond(pdu(1, 0, 1)) == refused(1, 1)


@pytest.mark.requirement("MODB-032")
def test_the_order_of_the_checks(server, registers):
    """Function before quantity before address before execution: with everything wrong, the first one is
    reported.
    """
    registers.add(Area.HOLDING_REGISTERS, Block(5000, 1, writable=False))
    few = ModbusServer(registers, functions=(16,))
    assert few.respond(pdu(3, 60000, 0)) == refused(3, 1)
    assert server.respond(pdu(3, 60000, 0)) == refused(3, 3)
    assert server.respond(pdu(16, 60000, 1, b"\x02\x00\x00")) == refused(16, 2)
    assert server.respond(pdu(16, 5000, 1, b"\x02\x00\x00")) == refused(16, 4)


@pytest.mark.requirement("MODB-014", "MODB-024")
@pytest.mark.parametrize("value", [0x0001, 0x1234, 0xFF01, 0x00FF, 0xFFFF])
def test_a_coil_is_on_or_off(server, registers, value):
    """Any other value than 0000h and FF00h is exception 03 and writes nothing."""
    before = registers.get(Area.COILS, START)
    assert server.respond(pdu(5, START, value)) == refused(5, 3)
    assert registers.get(Area.COILS, START) == before


WRONG_LENGTHS_AND_BYTE_COUNTS_ARE_REFUSED_CASES = [
    "03",
    "0300",
    "03000a00",
    "03000a000100",
    "06000a00",
    "06000a000100",
    "05000aff0000",
    "16000a00000000ff",
    "16000a0000",
    "0f000a000901ff",
    "0f000a000802ffff",
    "0f000a000801",
    "10000a00020400010002ff",
    "10000a000203000100",
    "10000a0002040001",
    "10000a0002",
    "17000a0001000a00010300010000",
    "17000a0001000a00010200",
    "17000a0001",
    "0800",
    "080001",
    "0800010000ff",
    "2b0e01",
    "2b0e010000",
    "2b0e0500",
    "2b0e0000",
]


def check_wrong_lengths_and_byte_counts_are_refused(server, text):
    data = bytes.fromhex(text)
    assert server.respond(data, serial=True) == refused(data[0], 3)


@pytest.mark.requirement("MODB-024")
def test_wrong_lengths_and_byte_counts_are_refused(server, subtests):
    """A request that is too short, too long, or whose byte count does not fit is exception 03."""
    for label, values in each(WRONG_LENGTHS_AND_BYTE_COUNTS_ARE_REFUSED_CASES):
        with subtests.test(label):
            check_wrong_lengths_and_byte_counts_are_refused(server, *values)


@pytest.mark.requirement("MODB-014", "MODB-015", "MODB-017", "MODB-018")
def test_what_is_written_is_there_and_mirrored(server, registers):
    """Single writes are echoed, multiple ones answered with address and quantity."""
    assert server.respond(pdu(5, 11, 0xFF00)) == pdu(5, 11, 0xFF00)
    assert registers.get(Area.COILS, 11) == 1
    assert server.respond(pdu(5, 11, 0)) == pdu(5, 11, 0)
    assert registers.get(Area.COILS, 11) == 0
    assert server.respond(pdu(6, 12, 0xABCD)) == pdu(6, 12, 0xABCD)
    assert registers.get(Area.HOLDING_REGISTERS, 12) == 0xABCD
    assert server.respond(pdu(15, 20, 10, b"\x02\xcd\x01")) == pdu(15, 20, 10)
    assert [registers.get(Area.COILS, 20 + n) for n in range(10)] == [1, 0, 1, 1, 0, 0, 1, 1, 1, 0]
    assert server.respond(pdu(16, 30, 2, b"\x04\x00\x01\xff\xfe")) == pdu(16, 30, 2)
    assert [registers.get(Area.HOLDING_REGISTERS, 30 + n) for n in range(3)] == [1, 0xFFFE, 0x1020]


@pytest.mark.requirement("MODB-019")
def test_mask_write(server, registers):
    """(register AND and-mask) OR (or-mask AND NOT and-mask), and the request is echoed."""
    registers.set(Area.HOLDING_REGISTERS, 14, 0x12)
    assert server.respond(pdu(22, 14, 0xF2, 0x25)) == pdu(22, 14, 0xF2, 0x25)
    assert registers.get(Area.HOLDING_REGISTERS, 14) == 0x17
    server.respond(pdu(22, 14, 0, 0xFFFF))
    assert registers.get(Area.HOLDING_REGISTERS, 14) == 0xFFFF


@pytest.mark.requirement("MODB-020")
def test_writing_comes_before_reading(server, registers):
    """Function 23 returns what it has just written; with a wrong read range nothing is written."""
    assert server.respond(pdu(23, 14, 2, 14, 1, b"\x02\x00\x63")) == bytes.fromhex("17 04 0063 100f")
    assert server.respond(pdu(23, 60000, 2, 14, 1, b"\x02\x00\x64")) == refused(23, 2)
    assert registers.get(Area.HOLDING_REGISTERS, 14) == 0x63


# ------------------------------------------------------------------------------------------------ function 08


def diagnose(server, code, data=0):
    return server.respond(pdu(8, code, data), serial=True)


@pytest.mark.requirement("MODB-016")
def test_diagnostics_echo_and_exist_on_the_serial_line_only(server):
    """Sub-function 0 returns any data; over TCP function 08 is unknown, other sub-functions are too."""
    assert server.respond(bytes.fromhex("08 0000 a5 37 01 02"), serial=True) == bytes.fromhex(
        "08 0000 a5370102"
    )
    assert server.respond(pdu(8, 0, 0xA537)) == refused(8, 1)
    for code in (3, 5, 9, 20, 0xFFFF):
        assert diagnose(server, code) == refused(8, 1)
    for code in (1, 2, 4, 10, 11, 18):
        assert diagnose(server, code, 1) == refused(8, 3)


@pytest.mark.requirement("MODB-016")
def test_diagnostic_counters(server):
    """Messages, exceptions and silent ones are counted; sub-function 10 clears them."""
    server.respond(pdu(3, 10, 1), serial=True)
    server.respond(pdu(3, 0, 1), serial=True)
    server.respond(pdu(6, 10, 1), serial=True, broadcast=True)
    assert diagnose(server, Diagnostic.SERVER_MESSAGES) == pdu(8, 14, 4)
    assert diagnose(server, Diagnostic.EXCEPTIONS) == pdu(8, 13, 1)
    assert diagnose(server, Diagnostic.NO_RESPONSES) == pdu(8, 15, 1)
    server.exception_hook = lambda unit, request: ExceptionCode.SERVER_DEVICE_BUSY if request[0] == 3 else 0
    assert server.respond(pdu(3, 10, 1), serial=True) == refused(3, 6)
    assert diagnose(server, Diagnostic.BUSY) == pdu(8, 17, 1)
    assert diagnose(server, Diagnostic.CLEAR_COUNTERS) == pdu(8, 10, 0)
    assert diagnose(server, Diagnostic.EXCEPTIONS) == pdu(8, 13, 0)
    assert diagnose(server, Diagnostic.DIAGNOSTIC_REGISTER) == pdu(8, 2, 0)


@pytest.mark.requirement("MODB-016")
def test_listen_only_ends_with_a_restart(server, registers):
    """In listen-only mode nothing is answered or carried out; a restart ends it, itself without an answer."""
    assert diagnose(server, Diagnostic.LISTEN_ONLY) is None
    assert server.listen_only
    assert server.respond(pdu(6, 10, 1), serial=True) is None
    server.respond(pdu(6, 10, 1), serial=True, broadcast=True)
    assert diagnose(server, Diagnostic.QUERY_DATA) is None
    assert registers.get(Area.HOLDING_REGISTERS, 10) == 0x100A
    assert diagnose(server, Diagnostic.RESTART_COMMUNICATIONS) is None
    assert not server.listen_only
    assert diagnose(server, Diagnostic.RESTART_COMMUNICATIONS, 0xFF00) == pdu(8, 1, 0xFF00)
    assert server.restarts == 2


# --------------------------------------------------------------------------------------------- function 43/14


@pytest.mark.requirement("MODB-021")
def test_device_identification(server):
    """Basic, regular and extended objects as streams, single objects, and what is refused."""
    basic = bytes.fromhex("2b 0e 01 83 00 00 03 00 04") + b"ACME" + b"\x01\x03D-1" + b"\x02\x031.0"
    assert server.respond(bytes.fromhex("2b0e0100")) == basic
    assert server.respond(bytes.fromhex("2b0e0101"))[6] == 2
    assert server.respond(bytes.fromhex("2b0e0177")) == basic
    assert server.respond(bytes.fromhex("2b0e0200"))[6] == 4
    assert server.respond(bytes.fromhex("2b0e0300"))[6] == 5
    assert server.respond(bytes.fromhex("2b0e0404")) == bytes.fromhex("2b 0e 04 83 00 00 01 04 05") + b"drive"
    assert server.respond(bytes.fromhex("2b0e0403")) == refused(43, 2)
    assert server.respond(bytes.fromhex("2b0d0000")) == refused(43, 1)
    assert ModbusServer(RegisterMap()).respond(bytes.fromhex("2b0e0100")) == refused(43, 1)


@pytest.mark.requirement("MODB-021")
def test_identification_that_does_not_fit_goes_on(registers):
    """Objects that are too much for one response are asked for from the object that the first one names."""
    objects = {0: b"a" * 100, 1: b"b" * 100, 2: b"c" * 100, 3: b"d"}
    server = ModbusServer(registers, identification=objects)
    first = server.respond(bytes.fromhex("2b0e0200"))
    assert len(first) <= 253
    assert first[4:7] == bytes((0xFF, 2, 2))
    second = server.respond(bytes((0x2B, 0x0E, 2, first[5])))
    assert second[4:7] == bytes((0, 0, 2))


# --------------------------------------------------------------------------------------------- broadcast, map


@pytest.mark.requirement("MODB-035")
def test_broadcasts_are_carried_out_in_silence(server, registers):
    """Functions 05, 06, 15, 16 are executed, others not; nothing is answered, not even an error."""
    for request in (
        pdu(5, 12, 0),
        pdu(6, 10, 7),
        pdu(15, 20, 1, b"\x01\x01"),
        pdu(16, 11, 1, b"\x02\x00\x08"),
    ):
        assert server.respond(request, serial=True, broadcast=True) is None
    assert registers.get(Area.COILS, 12) == 0
    assert registers.get(Area.HOLDING_REGISTERS, 10) == 7
    assert registers.get(Area.COILS, 20) == 1
    assert registers.get(Area.HOLDING_REGISTERS, 11) == 8
    for request in (
        pdu(22, 10, 0, 0),
        pdu(23, 10, 1, 10, 1, b"\x02\x00\x00"),
        pdu(3, 10, 1),
        pdu(6, 0, 1),
        b"\x10",
    ):
        assert server.respond(request, serial=True, broadcast=True) is None
    assert registers.get(Area.HOLDING_REGISTERS, 10) == 7


@pytest.mark.requirement("MODB-025", "PD-337")
def test_read_only_and_limits_are_refused_as_configured(registers):
    """Writing what is read-only or out of its limits is exception 04, or the one configured; nothing is
    stored.
    """
    for code in (ExceptionCode.SERVER_DEVICE_FAILURE, ExceptionCode.ILLEGAL_DATA_ADDRESS):
        limited = RegisterMap(refused=code)
        limited.add(Area.HOLDING_REGISTERS, Block(0, 1, writable=False))
        limited.add(Area.HOLDING_REGISTERS, Block(1, 2, minimum=-5, maximum=5))
        server = ModbusServer(limited)
        assert server.respond(pdu(6, 0, 1)) == refused(6, code)
        assert server.respond(pdu(6, 1, 6)) == refused(6, code)
        assert server.respond(pdu(6, 1, 0xFFFA)) == refused(6, code)
        assert server.respond(pdu(6, 1, 0xFFFB)) == pdu(6, 1, 0xFFFB)
        assert server.respond(pdu(16, 1, 2, b"\x04\x00\x01\x00\x06")) == refused(16, code)
        assert limited.get(Area.HOLDING_REGISTERS, 1) == 0xFFFB


@pytest.mark.requirement("PD-293")
def test_partial_writes_keep_what_is_valid():
    """With the option the valid registers are written although the exception is returned."""
    registers = RegisterMap(partial_writes=True)
    registers.add(Area.HOLDING_REGISTERS, Block(0, 2))
    registers.add(Area.HOLDING_REGISTERS, Block(2, 1, writable=False))
    registers.add(Area.HOLDING_REGISTERS, Block(3, 3, maximum=9))
    server = ModbusServer(registers)
    assert server.respond(pdu(16, 0, 6, bytes.fromhex("0c 0001 0002 0003 0004 00ff 0005"))) == refused(16, 4)
    assert [registers.get(Area.HOLDING_REGISTERS, n) for n in range(6)] == [1, 2, 0, 4, 0, 5]


@pytest.mark.requirement("MODB-025", "MODB-027")
def test_hooks_supply_and_refuse():
    """A read hook gives the values, a write hook sees them before they are stored, either may refuse with a
    code.
    """
    seen = []

    def read(offset, count):
        if offset == 3:
            raise RegisterRefusal(ExceptionCode.SERVER_DEVICE_BUSY)
        return [100 + offset + n for n in range(count)]

    def write(offset, values):
        seen.append((offset, tuple(values)))
        if 13 in values:
            raise RegisterRefusal

    registers = RegisterMap()
    registers.add(Area.HOLDING_REGISTERS, Block(40, 4, read=read, write=write))
    server = ModbusServer(registers)
    assert server.respond(pdu(3, 41, 2)) == bytes.fromhex("03 04 0065 0066")
    assert server.respond(pdu(3, 43, 1)) == refused(3, 6)
    assert server.respond(pdu(6, 42, 5)) == pdu(6, 42, 5)
    assert server.respond(pdu(6, 43, 13)) == refused(6, 4)
    assert seen == [(2, (5,)), (3, (13,))]
    assert registers.get(Area.HOLDING_REGISTERS, 43) == 0


@pytest.mark.requirement("MODB-033")
def test_word_order_of_long_values():
    """A 32-bit value has its high word first, or last with the option."""
    for order, words in ((WordOrder.HIGH_FIRST, (0xFFFE, 0x0001)), (WordOrder.LOW_FIRST, (0x0001, 0xFFFE))):
        registers = RegisterMap(word_order=order)
        registers.add(Area.HOLDING_REGISTERS, Block(0, 2))
        registers.set_long(Area.HOLDING_REGISTERS, 0, -131071)
        assert (registers.get(Area.HOLDING_REGISTERS, 0), registers.get(Area.HOLDING_REGISTERS, 1)) == words
        assert registers.get_long(Area.HOLDING_REGISTERS, 0, signed=True) == -131071


def test_bad_configuration_says_what_is_allowed(registers):
    """Overlapping blocks, addresses, limits, units, functions and identifications that cannot be are
    refused.
    """
    with pytest.raises(ConfigurationError, match="leaves free"):
        registers.add(Area.COILS, Block(LAST, 2))
    with pytest.raises(ConfigurationError, match="leaves free"):
        registers.add(Area.COILS, Block(START - 1, 2))
    for options in (
        {"start": 65536, "count": 1},
        {"start": 65535, "count": 2},
        {"start": 0, "count": 0},
        {"start": 0, "count": 1, "minimum": -1, "maximum": 40000},
    ):
        with pytest.raises(ConfigurationError):
            Block(**options)
    for options in (
        {"unit": 0},
        {"unit": 248},
        {"functions": (7,)},
        {"limits": {16: 124}},
        {"limits": {99: 1}},
        {"identification": {0: b"a"}},
        {"identification": {0: b"", 1: b"", 2: b"", 0x40: b""}},
    ):
        with pytest.raises(ConfigurationError):
            ModbusServer(registers, **options)
    assert ModbusServer(registers, limits={16: 122}).respond(
        pdu(16, 10, 123, b"\xf6", bytes(246))
    ) == refused(16, 3)
