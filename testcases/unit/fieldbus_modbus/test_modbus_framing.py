"""The envelopes of the serial line and of TCP; any bytes at a server; our values against pymodbus's own."""

import struct

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU

from fieldbus.modbus import (
    Area,
    Function,
    ModbusError,
    ModbusServer,
    Request,
    ResponseError,
    RtuResponder,
    TcpResponder,
    TcpSplitter,
    crc16,
    decode_request,
    decode_response,
    is_well_formed,
    rtu_frame,
    tcp_frame,
    unwrap_rtu,
)
from testcases.unit.fieldbus_modbus.conftest import IDENTIFICATION, new_map

pytestmark = pytest.mark.exhaustive

READ = Request(3, 10, 2)


@pytest.mark.requirement("MODB-005", "MODB-006")
def test_crc_of_the_example():
    """The request of the standard's example ends with 84 0A."""
    assert crc16(bytes.fromhex("01 03 00 00 00 01")) == bytes.fromhex("84 0a")
    assert rtu_frame(1, Request(3, 0, 1).encode()) == bytes.fromhex("01 03 00 00 00 01 84 0a")


@pytest.mark.requirement("MODB-006")
@given(st.binary(min_size=0, max_size=300))
def test_crc_is_that_of_the_polynomial(data):
    """The CRC is what a division bit by bit gives."""
    register = 0xFFFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = register >> 1 ^ (0xA001 if register & 1 else 0)
    assert crc16(data) == struct.pack("<H", register)


@pytest.mark.requirement("MODB-007", "MODB-008")
def test_who_answers_on_a_serial_line(server):
    """The device's own unit is answered; another, a broken CRC, damage and a short frame are not."""
    face = RtuResponder(server)
    good = rtu_frame(5, READ.encode())
    assert face.receive(good) == rtu_frame(5, bytes.fromhex("03 04 100a 100b"))
    for unit in (0, 1, 6, 247, 255):
        assert face.receive(rtu_frame(unit, READ.encode())) is None
    for position in range(len(good) * 8):
        broken = bytearray(good)
        broken[position // 8] ^= 1 << position % 8
        assert face.receive(bytes(broken)) is None
    assert face.receive(good, damaged=True) is None
    for size in range(len(good)):
        assert face.receive(good[:size]) is None
    assert server.bus_errors == len(good) * 8 + 1 + len(good)


@pytest.mark.requirement("MODB-005")
def test_frames_beyond_256_bytes_are_none(server):
    """The longest frame is taken, one byte more is not, even with a good CRC."""
    assert unwrap_rtu(rtu_frame(5, bytes(253))) == (5, bytes(253))
    assert unwrap_rtu(rtu_frame(5, bytes(254))) is None


@pytest.mark.requirement("MODB-038", "MODB-044")
def test_frames_of_tcp_come_in_any_segments(server):
    """Two frames in one segment, one in three, and every other cut give the same two responses."""
    stream = tcp_frame(7, 5, READ.encode()) + tcp_frame(8, 5, Request(6, 10, 1, (9,)).encode())
    expected = tcp_frame(7, 5, bytes.fromhex("03 04 100a 100b")) + tcp_frame(
        8, 5, Request(6, 10, 1, (9,)).encode()
    )
    for first in range(len(stream)):
        for second in range(first, len(stream)):
            server.registers.set(Area.HOLDING_REGISTERS, 10, 0x100A)
            face = TcpResponder(server)
            parts = stream[:first], stream[first:second], stream[second:]
            assert b"".join(face.receive(part) for part in parts) == expected


@pytest.mark.requirement("MODB-036", "MODB-037")
@pytest.mark.parametrize(
    ("header", "good"),
    [
        ("0001 0000 0006", True),
        ("0001 0001 0006", False),
        ("0001 0100 0006", False),
        ("0001 0000 0001", False),
        ("0001 0000 0000", False),
        ("0001 0000 0002", True),
        ("0001 0000 00fe", True),
        ("0001 0000 00ff", False),
        ("0001 0000 ffff", False),
    ],
)
def test_wrong_headers_break_the_connection(header, good):
    """Protocol other than 0, length up to 1 or beyond 254: dropped, the frames before it are served, no
    wedge.
    """
    before = tcp_frame(9, 5, b"\x03")
    head = bytes.fromhex(header)
    splitter = TcpSplitter()
    frames = splitter.feed(before + head + bytes(head[4] << 8 | head[5]))
    assert frames[0] == (9, 5, b"\x03")
    assert len(frames) == (2 if good else 1)
    assert splitter.broken is not good
    if not good:
        assert splitter.feed(before) == []
        assert splitter.pending == 0


@pytest.mark.requirement("MODB-036", "MODB-040")
def test_units_over_tcp_are_mirrored(registers):
    """A server with a unit answers that one, 0 and 255; one without answers all; unit and transaction are
    mirrored.
    """
    pdu = READ.encode()
    face = TcpResponder(ModbusServer(registers, unit=5))
    for unit in (0, 5, 255):
        assert face.receive(tcp_frame(0xABCD, unit, pdu))[:7] == bytes.fromhex("abcd 0000 0007") + bytes(
            (unit,)
        )
    assert face.receive(tcp_frame(1, 6, pdu)) == b""
    assert face.ignored == 1
    anybody = TcpResponder(ModbusServer(registers, unit=None))
    assert all(anybody.receive(tcp_frame(1, unit, pdu))[6] == unit for unit in range(256))


# ------------------------------------------------------------------------------------------------- any bytes

# Lambdas: given the class itself, Hypothesis would fill the other fields as well.
requests = st.one_of(
    st.builds(
        lambda function, at, quantity: Request(function, address=at, quantity=quantity),
        st.sampled_from((1, 2)),
        st.integers(0, 65535),
        st.integers(1, 2000),
    ),
    st.builds(
        lambda function, at, quantity: Request(function, address=at, quantity=quantity),
        st.sampled_from((3, 4)),
        st.integers(0, 65535),
        st.integers(1, 125),
    ),
    st.builds(lambda at, bit: Request(5, at, 1, (bit,)), st.integers(0, 65535), st.integers(0, 1)),
    st.builds(lambda at, word: Request(6, at, 1, (word,)), st.integers(0, 65535), st.integers(0, 65535)),
    st.builds(
        lambda at, bits: Request(15, at, len(bits), tuple(bits)),
        st.integers(0, 65535),
        st.lists(st.integers(0, 1), min_size=1, max_size=1968),
    ),
    st.builds(
        lambda at, words: Request(16, at, len(words), tuple(words)),
        st.integers(0, 65535),
        st.lists(st.integers(0, 65535), min_size=1, max_size=123),
    ),
    st.builds(
        lambda at, one, two: Request(22, at, 1, and_mask=one, or_mask=two),
        st.integers(0, 65535),
        st.integers(0, 65535),
        st.integers(0, 65535),
    ),
    st.builds(
        lambda at, count, to, words: Request(23, at, count, tuple(words), to),
        st.integers(0, 65535),
        st.integers(1, 125),
        st.integers(0, 65535),
        st.lists(st.integers(0, 65535), min_size=1, max_size=121),
    ),
    st.builds(lambda word: Request(8, code=0, data=word.to_bytes(2, "big")), st.integers(0, 65535)),
    st.builds(
        lambda code, first: Request(43, code=code, object_id=first), st.integers(1, 4), st.integers(0, 255)
    ),
)


@pytest.mark.requirement("MODB-012", "MODB-013", "MODB-017", "MODB-018", "MODB-020")
@given(requests)
def test_requests_come_back_as_encoded(request_):
    """Encoding and decoding a request gives it back, and it is well-formed and within the longest PDU."""
    pdu = request_.encode()
    assert len(pdu) <= 253
    assert is_well_formed(pdu)
    assert decode_request(pdu) == request_


@given(requests)
def test_responses_of_our_server_are_understood(request_):
    """What the server answers to any good request decodes as a response to it, by us and by pymodbus."""
    server = ModbusServer(new_map(), identification=IDENTIFICATION)
    pdu = server.respond(request_.encode(), serial=True)
    response = decode_response(request_, pdu)
    theirs = DecodePDU(is_server=False).decode(pdu)
    assert theirs is not None
    assert theirs.isError() == bool(response.exception)
    if not response.exception and request_.function in (3, 4, 23):
        assert tuple(theirs.registers) == response.values
    if not response.exception and request_.function in (1, 2):
        assert tuple(map(int, theirs.bits[: request_.quantity])) == response.values


@given(requests, st.binary(max_size=260))
def test_any_bytes_as_a_response_are_judged(request_, data):
    """Bytes are a response to the request or a `ResponseError`, nothing else."""
    try:
        response = decode_response(request_, data)
    except ResponseError:
        return
    assert response.exception or data[0] == request_.function


@example(b"\x03\x00\x0a\x00\x01")
@given(st.one_of(st.binary(max_size=300), requests.map(lambda one: one.encode())))
def test_any_bytes_at_the_server(data):
    """Every PDU gets a response of its own function with at most 253 bytes, or an exception; then reading
    works.
    """
    server = ModbusServer(new_map(), identification=IDENTIFICATION)
    answer = server.respond(data, serial=True)
    if answer is None:
        assert not data or server.listen_only
    else:
        assert answer[0] & 0x7F == data[0] & 0x7F
        assert len(answer) <= 253
    server.respond(bytes.fromhex("08 0001 0000"), serial=True)
    assert server.respond(bytes.fromhex("03 000b 0001"), serial=True)[0] == 3


@given(st.lists(st.binary(max_size=40), max_size=10))
def test_any_stream_at_the_tcp_face(parts):
    """Any bytes in any segments: whole frames come out, or the connection is broken; nothing piles up."""
    face = TcpResponder(ModbusServer(new_map()))
    splitter = TcpSplitter()
    for part in parts:
        out = face.receive(part)
        check = splitter.feed(out)
        assert not splitter.broken
        assert splitter.pending == 0
        assert all(len(frame.pdu) <= 253 for frame in check)


@given(requests, st.integers(0, 255), st.integers(0, 65535))
def test_envelopes_are_those_of_pymodbus(request_, unit, transaction):
    """Pymodbus as a server reads our frames as the same request."""
    for framer, frame in (
        (FramerRTU(DecodePDU(True)), rtu_frame(unit, request_.encode())),
        (FramerSocket(DecodePDU(True)), tcp_frame(transaction, unit, request_.encode())),
    ):
        used, theirs = framer.handleFrame(frame, 0, 0)
        assert used == len(frame)
        assert theirs.function_code == request_.function
        assert theirs.dev_id == unit


def test_requests_that_cannot_be_are_refused():
    """Quantities and values out of range raise where the request is encoded; words tell what it is."""
    for bad in (
        Request(3, 0, 126),
        Request(3, 70000, 1),
        Request(6, 0, 1, (70000,)),
        Request(99),
        Request(23, 0, 1),
    ):
        with pytest.raises(ModbusError):
            bad.encode()
    assert str(Request(3, 0x258, 2)) == "03 read holding registers 0258h x 2"
    assert str(Request(6, 99, 1, (0x47F,))) == "06 write single register 0063h = 047F"
    assert (
        str(decode_response(READ, b"\x83\x02"))
        == "03 read holding registers: exception 02h illegal data address"
    )
    assert all(str(Request(function)) for function in Function)
