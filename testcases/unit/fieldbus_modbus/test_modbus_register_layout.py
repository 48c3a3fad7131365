"""Requests and responses for registers, which are laid out here, against pymodbus, which does all others."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer.socket import FramerSocket

from fieldbus.modbus import _pymodbus as library
from fieldbus.modbus.framing import tcp_frame
from fieldbus.modbus.pdu import Request, Response, decode_request, decode_response, encode_response

ADDRESS = st.integers(0, 0xFFFF)
WORDS = st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=121).map(tuple)


@given(st.sampled_from([3, 4]), ADDRESS, WORDS)
def test_reading_of_registers_is_laid_out_as_by_the_library(function, address, words):
    """Functions 03 and 04: request and response have the bytes that pymodbus makes, and are read back."""
    request = Request(function, address, len(words))
    pdu = request.encode()
    assert pdu == library.register_request(function, address, len(words), ())
    assert decode_request(pdu) == request
    answer = encode_response(request, Response(function, words))
    assert answer == library.register_response(function, 0, 0, words)
    assert decode_response(request, answer) == Response(
        function, tuple(library.response_fields(answer).registers)
    )


@given(ADDRESS, WORDS)
def test_writing_of_registers_is_laid_out_as_by_the_library(address, words):
    """Function 16: request and response have the bytes that pymodbus makes, and are read back."""
    request = Request(16, address, len(words), words)
    pdu = request.encode()
    assert pdu == library.register_request(16, address, len(words), words)
    assert decode_request(pdu) == request
    answer = encode_response(request, Response(16))
    assert answer == library.register_response(16, address, len(words), ())
    assert decode_response(request, answer) == Response(16)


@given(ADDRESS, ADDRESS, WORDS, WORDS)
def test_reading_and_writing_in_one_request_is_laid_out_as_by_the_library(
    address, write_address, read, written
):
    """Function 23: request and response have the bytes that pymodbus makes, and are read back."""
    request = Request(23, address, len(read), written, write_address)
    assert decode_request(request.encode()) == request
    answer = encode_response(request, Response(23, read))
    assert answer == library.register_response(23, 0, 0, read)
    assert decode_response(request, answer) == Response(23, read)


@given(ADDRESS, st.integers(0, 255), st.binary(min_size=1, max_size=253))
def test_a_frame_of_tcp_has_the_header_that_the_library_makes(transaction, unit, pdu):
    """The MBAP header is that of pymodbus."""
    assert tcp_frame(transaction, unit, pdu) == FramerSocket(None).encode(pdu, unit, transaction)
