"""Base mode parameter access: the worked frames of manuals, and any bytes."""

from __future__ import annotations

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fieldbus.profidrive import TypeCode
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import (
    Address,
    Answer,
    Attribute,
    Format,
    Refusal,
    Request,
    RequestId,
    Values,
    decode_answer,
    decode_request,
)


@pytest.mark.requirement("PD-199", "PD-200", "PD-202", "PD-203", "PD-204")
def test_worked_example_of_reading():
    """Reading r0002: the words of the manual for request and answer."""
    request = Request(0x80, RequestId.READ, 1, (Address(2, 0, 1),))
    assert request.encode().hex(" ", 2) == "8001 0101 1001 0002 0000"
    assert decode_request(request.encode()) == request
    answer = Answer(0x80, RequestId.READ, 1, (Values(TypeCode.INTEGER16, (31,)),))
    assert answer.encode().hex(" ", 2) == "8001 0101 0301 001f"
    assert decode_answer(answer.encode()) == answer


@pytest.mark.requirement("PD-201", "PD-202", "PD-203")
def test_worked_example_of_writing():
    """A write answers with the header alone; bytes are filled up to an even length."""
    request = Request(
        0x80,
        RequestId.WRITE,
        1,
        (Address(1121, 0, 1), Address(922, 0, 1)),
        (Values(TypeCode.FLOAT32, (1.5,)), Values(TypeCode.UNSIGNED8, (3,))),
    )
    data = request.encode()
    assert data.hex(" ", 2) == "8002 0102 1001 0461 0000 1001 039a 0000 0801 3fc0 0000 0501 0300"
    assert decode_request(data) == request
    done = Answer(0x80, RequestId.WRITE, 1, (None,))
    assert done.encode().hex(" ", 2) == "8002 0101"
    assert decode_answer(done.encode()) == done


@pytest.mark.requirement("PD-203", "PD-205")
@pytest.mark.parametrize(
    ("refusal", "words"),
    [
        (Refusal(0x00), "8081 0101 4401 0000"),
        (Refusal(0x02, 3), "8081 0101 4402 0002 0003"),
        (Refusal(0x03, 7), "8081 0101 4402 0003 0007"),
        (Refusal(0x11, 7), "8081 0101 4401 0011"),
        (Refusal(0x14, 0), "8081 0101 4402 0014 0000"),
    ],
)
def test_refusals(refusal, words):
    """A negative answer has format 44h with the error number, and the sub-index where the error has one."""
    answer = Answer(0x80, RequestId.READ, 1, (refusal,))
    assert answer.encode().hex(" ", 2) == words
    back = decode_answer(answer.encode())
    assert not back.positive
    assert back.results[0].error == refusal.error
    assert f"{refusal.error:02X}h" in back.results[0].text


def test_a_mixed_answer():
    """Of several parameters each has its own result, good ones among bad ones."""
    answer = Answer(
        7,
        RequestId.READ,
        2,
        (Values(Format.WORD, (1, 2, 3)), Refusal(0), Values(TypeCode.VISIBLE_STRING, (65,))),
    )
    assert decode_answer(answer.encode()) == answer
    written = Answer(7, RequestId.WRITE, 2, (None, Refusal(1, 0)))
    assert decode_answer(written.encode()) == written


CODES = {
    TypeCode.INTEGER8: st.integers(-128, 127),
    TypeCode.INTEGER16: st.integers(-(1 << 15), (1 << 15) - 1),
    TypeCode.INTEGER32: st.integers(-(1 << 31), (1 << 31) - 1),
    TypeCode.UNSIGNED8: st.integers(0, 255),
    TypeCode.UNSIGNED16: st.integers(0, 65535),
    TypeCode.UNSIGNED32: st.integers(0, (1 << 32) - 1),
    TypeCode.FLOAT32: st.floats(width=32, allow_nan=False),
    TypeCode.N2: st.integers(-(1 << 15), (1 << 15) - 1),
    TypeCode.N4: st.integers(-(1 << 31), (1 << 31) - 1),
    Format.WORD: st.integers(0, 65535),
    Format.BYTE: st.integers(0, 255),
    Format.DOUBLE_WORD: st.integers(0, (1 << 32) - 1),
    TypeCode.UNSIGNED64: st.integers(0, (1 << 64) - 1),
}


@st.composite
def blocks(draw):
    code = draw(st.sampled_from(list(CODES)))
    return Values(code, tuple(draw(st.lists(CODES[code], min_size=1, max_size=6))))


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-044", "PD-199", "PD-200", "PD-201", "PD-204")
@given(
    reference=st.integers(1, 255),
    drive_object=st.integers(0, 255),
    content=st.lists(blocks(), min_size=1, max_size=3),
    number=st.integers(0, 65535),
    sub_index=st.integers(0, 65535),
)
def test_what_is_encoded_is_decoded(reference, drive_object, content, number, sub_index):
    """Requests and answers of every format come back as they were."""
    addresses = tuple(Address(number, sub_index, len(entry.values)) for entry in content)
    request = Request(reference, RequestId.WRITE, drive_object, addresses, tuple(content))
    data = request.encode()
    assert decode_request(data) == request
    assert len(data) % 2 == 0
    answer = Answer(reference, RequestId.READ, drive_object, tuple(content))
    assert decode_answer(answer.encode()) == answer


def outcome(decode, data):
    """Return the error number with which bytes are refused, or what they are."""
    try:
        return None, decode(data)
    except ParameterAccessError as error:
        return error.error, None


@pytest.mark.exhaustive
@pytest.mark.requirement("PD-208")
@given(st.binary(max_size=80))
def test_any_bytes(data):
    """Any bytes are a request that encodes to the same bytes (but for filling), or are refused with an error
    number.
    """
    refused, request = outcome(decode_request, data)
    assert refused in (0x17, 0x18) or len(request.addresses) == data[3]
    refused, answer = outcome(decode_answer, data)
    assert refused is not None or len(answer.results) == data[3]


@pytest.mark.requirement("PD-208", "PD-225", "PD-226")
@pytest.mark.parametrize(
    ("words", "error"),
    [
        ("8001", 0x18),
        ("8001 0102 1001 0002 0000", 0x18),
        ("8001 0101 1001 0002 0000 00", 0x18),
        ("8002 0101 1001 0002 0000 4202 0001", 0x18),
        ("8002 0101 1001 0002 0000 6301 0001", 0x17),
    ],
)
def test_broken_requests_carry_the_error(words, error):
    """Lengths that do not agree are error 18h, a format that does not exist 17h."""
    with pytest.raises(ParameterAccessError) as refused:
        decode_request(bytes.fromhex(words.replace(" ", "")))
    assert refused.value.error == error


def test_requests_that_cannot_be_made():
    """Too long, out of range, or values that do not fit their format: reported when encoding."""
    with pytest.raises(ParameterAccessError, match="longer than 240"):
        Request(1, RequestId.READ, 0, (Address(1),) * 40).encode()
    with pytest.raises(ParameterAccessError, match="70000"):
        Request(1, RequestId.READ, 0, (Address(70000),)).encode()
    with pytest.raises(ParameterAccessError, match="format 03h"):
        Request(1, RequestId.WRITE, 0, (Address(1),), (Values(TypeCode.INTEGER16, (1 << 20,)),)).encode()
    assert struct.unpack(">B", bytes((Attribute.TEXT,))) == (0x30,)
