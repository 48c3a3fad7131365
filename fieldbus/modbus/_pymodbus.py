"""The only module that knows pymodbus: PDUs of requests and responses, the CRC,
and the envelope of RTU.

pymodbus changes its interface with every minor version, so it is held to one of them and asked for little. It
is not asked to judge: what it decodes was checked by `fieldbus.modbus.pdu` before, because its decoders take
a coil value of 1234h for true, and do not compare a response with its request. It does not split a stream
either: its decoder waits forever after a wrong protocol identifier.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from pymodbus.framer.rtu import FramerRTU
from pymodbus.pdu import DecodePDU, ExceptionResponse, ModbusPDU
from pymodbus.pdu.mei_message import ReadDeviceInformationRequest, ReadDeviceInformationResponse
from pymodbus.pdu.register_message import MaskWriteRegisterRequest, ReadWriteMultipleRegistersRequest

_REQUESTS: Final = DecodePDU(is_server=True)
_RESPONSES: Final = DecodePDU(is_server=False)
_RTU: Final = FramerRTU(_RESPONSES)


def crc16(data: bytes) -> bytes:
    """Return the two CRC bytes as they stand on the wire, low byte first (MODB-006)."""
    return FramerRTU.compute_CRC(data).to_bytes(2, "big")


def rtu_frame(unit: int, pdu: bytes) -> bytes:
    """Return a frame of the serial line (MODB-005)."""
    return _RTU.encode(pdu, unit, 0)


def _encode(pdu: ModbusPDU) -> bytes:
    return bytes((pdu.function_code,)) + pdu.encode()


def request_fields(pdu: bytes) -> Any:
    """Return the fields of a well-formed request."""
    return _REQUESTS.decode(pdu)


def response_fields(pdu: bytes) -> Any:
    """Return the fields of a well-formed response."""
    return _RESPONSES.decode(pdu)


def register_request(function: int, address: int, count: int, registers: Sequence[int]) -> bytes:
    """Return a request that reads anything or writes registers at one address."""
    return _encode(_REQUESTS.pdu_table[function][0](address=address, count=count, registers=registers))


def bit_request(function: int, address: int, bits: Sequence[bool]) -> bytes:
    """Return a request that writes coils."""
    return _encode(_REQUESTS.pdu_table[function][0](address=address, bits=bits))


def mask_request(address: int, and_mask: int, or_mask: int) -> bytes:
    """Return a request of function 22; its response is the same."""
    return _encode(MaskWriteRegisterRequest(address, and_mask, or_mask))


def read_write_request(address: int, count: int, write_address: int, registers: Sequence[int]) -> bytes:
    """Return a request of function 23."""
    return _encode(ReadWriteMultipleRegistersRequest(address, count, write_address, registers))


def identification_request(read_code: int, object_id: int) -> bytes:
    """Return a request of function 43/14."""
    return _encode(ReadDeviceInformationRequest(read_code, object_id))


def register_response(function: int, address: int, count: int, registers: Sequence[int]) -> bytes:
    """Return a response with registers, or with the address and quantity that were written."""
    return _encode(_RESPONSES.pdu_table[function][1](address=address, count=count, registers=registers))


def bit_response(function: int, address: int, bits: Sequence[bool]) -> bytes:
    """Return a response with coils that were read, or with the coil that was written."""
    return _encode(_RESPONSES.pdu_table[function][1](address=address, bits=bits))


def exception_response(function: int, code: int) -> bytes:
    """Return an exception response (MODB-032)."""
    return _encode(ExceptionResponse(function, code))


def identification_response(read_code: int, conformity: int, objects: Mapping[int, bytes]) -> bytes:
    """Return as many objects of a device identification as fit; the header says where to continue."""
    pdu = ReadDeviceInformationResponse(read_code, dict(objects))
    pdu.conformity = conformity
    return _encode(pdu)
