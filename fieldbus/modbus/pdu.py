"""Requests and responses as values: checked, decoded and encoded (MODB-012
to MODB-021). Serves both sides.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import cache
from typing import Final, NamedTuple

from fieldbus.modbus import _pymodbus as library
from fieldbus.modbus.codes import (
    EXCEPTION_BIT,
    LIMITS,
    LONGEST_PDU,
    MOST_WRITTEN_WHEN_READING,
    READ_DEVICE_IDENTIFICATION,
    Function,
    exception_text,
    function_text,
)
from fieldbus.modbus.errors import ModbusError, ResponseError

_F: Final = Function
_BITS: Final = frozenset({_F.READ_COILS, _F.READ_DISCRETE_INPUTS})
_READS: Final = frozenset({*_BITS, _F.READ_HOLDING_REGISTERS, _F.READ_INPUT_REGISTERS})
_COIL_VALUES: Final = (b"\x00\x00", b"\xff\x00")

# Reading and writing of registers is what every cycle of a bus asks for, so it is laid out here; everything
# else is left to the library. A value that does not fit is left to it too: it has the message.
_REGISTER_READS: Final = frozenset({3, 4})
_WRITE_REGISTERS: Final = 16
_READ_WRITE_REGISTERS: Final = 23
_HEAD: Final = struct.Struct(">BHH")


@cache
def _written(count: int) -> struct.Struct:
    """Return the layout of function 16: function, address, quantity, bytes, registers."""
    return struct.Struct(f">BHHB{count}H")


@cache
def _exchanged(count: int) -> struct.Struct:
    """Return the layout of function 23: function, what is read, what is written, bytes, registers."""
    return struct.Struct(f">BHHHHB{count}H")


@cache
def _content(count: int) -> struct.Struct:
    """Return the layout of a response with registers: function, bytes, registers."""
    return struct.Struct(f">BB{count}H")


class Request(NamedTuple):
    """A request. Which fields count depends on the function; the others keep their default."""

    function: int
    address: int = 0
    """First register or coil on the wire, 0..65535."""
    quantity: int = 0
    """How many to read or to write."""
    values: tuple[int, ...] = ()
    """Registers (0..65535) or coils (0, 1) to write."""
    write_address: int = 0
    """Function 23: where to write; `address` is where to read."""
    and_mask: int = 0xFFFF
    or_mask: int = 0
    code: int = 0
    """Sub-function of function 08, or the code of function 43/14 that selects objects."""
    object_id: int = 0
    data: bytes = b""
    """Function 08: the data behind the sub-function."""

    def encode(self) -> bytes:
        """Return the PDU.

        Raises:
            ModbusError: A field is out of its range.

        """
        function = self.function
        laid_out = self._registers()
        if laid_out is not None:
            return laid_out
        try:
            if function == _F.DIAGNOSTICS:
                return bytes((function,)) + self.code.to_bytes(2, "big") + self.data
            if function == _F.ENCAPSULATED_INTERFACE:
                return library.identification_request(self.code, self.object_id)
            if function == _F.MASK_WRITE_REGISTER:
                return library.mask_request(self.address, self.and_mask, self.or_mask)
            if function == _F.READ_WRITE_MULTIPLE_REGISTERS:
                return library.read_write_request(
                    self.address, self.quantity, self.write_address, self.values
                )
            if function in (_F.WRITE_SINGLE_COIL, _F.WRITE_MULTIPLE_COILS):
                return library.bit_request(function, self.address, [bool(value) for value in self.values])
            values = () if function in _READS else self.values
            return library.register_request(function, self.address, len(values) or self.quantity, values)
        except (ValueError, KeyError, OverflowError, struct.error) as error:
            raise ModbusError(f"{self}: {error}") from None

    def _registers(self) -> bytes | None:
        """Return a request for registers; None for another one, and for fields that are out of range."""
        function, count = self.function, len(self.values)
        try:
            if function in _REGISTER_READS and 1 <= self.quantity <= LIMITS[function]:
                return _HEAD.pack(function, self.address, self.quantity)
            if function == _WRITE_REGISTERS and 1 <= count <= LIMITS[function]:
                return _written(count).pack(function, self.address, count, 2 * count, *self.values)
        except struct.error:
            pass
        return None

    def __str__(self) -> str:
        """Return the request in words."""
        text = function_text(self.function)
        if self.function == _F.DIAGNOSTICS:
            return f"{text}, sub-function {self.code}"
        if self.function == _F.ENCAPSULATED_INTERFACE:
            return f"{text}, device identification {self.code} from object {self.object_id}"
        where = f"{text} {self.address:04X}h"
        if self.function == _F.MASK_WRITE_REGISTER:
            return f"{where} AND {self.and_mask:04X}h OR {self.or_mask:04X}h"
        if self.function == _F.READ_WRITE_MULTIPLE_REGISTERS:
            return f"{where} x {self.quantity}, write {self.write_address:04X}h = {_hex(self.values)}"
        if self.values:
            return f"{where} = {_hex(self.values)}"
        return f"{where} x {self.quantity}"


class Response(NamedTuple):
    """A response to a request of the same function."""

    function: int
    values: tuple[int, ...] = ()
    """Registers (0..65535) or coils (0, 1) that were read."""
    exception: int = 0
    """Exception code; 0 when the request was carried out."""
    data: bytes = b""
    """Function 08: the data behind the sub-function."""
    objects: tuple[tuple[int, bytes], ...] = ()
    """Function 43/14: objects of the device identification."""
    next_object: int | None = None
    """Function 43/14: the object to continue with, when not all fitted."""

    def __str__(self) -> str:
        """Return the response in words."""
        text = function_text(self.function)
        if self.exception:
            return f"{text}: exception {exception_text(self.exception)}"
        if self.objects:
            return f"{text}: " + ", ".join(f"{number:02X}h {value!r}" for number, value in self.objects)
        return f"{text}: {_hex(self.values)}" if self.values else f"{text}: done"


def _hex(values: tuple[int, ...]) -> str:
    return " ".join(f"{value:04X}" for value in values)


def is_well_formed(pdu: bytes, limits: Mapping[int, int] = LIMITS) -> bool:
    """Return whether length, quantity, byte count and value of a request of a served
    function are right (MODB-024).

    Args:
        pdu: At least the function code.
        limits: Largest quantities, as `LIMITS` has them.

    """
    function, size = pdu[0], len(pdu)
    if size > LONGEST_PDU:
        return False
    if function in LIMITS:
        if size < 5:
            return False
        count = pdu[3] << 8 | pdu[4]
        if not 1 <= count <= limits[function]:
            return False
        if function in _READS:
            return size == 5
        if function == _F.READ_WRITE_MULTIPLE_REGISTERS:
            if size < 10:
                return False
            written = pdu[7] << 8 | pdu[8]
            return 1 <= written <= MOST_WRITTEN_WHEN_READING and pdu[9] == 2 * written and size == 10 + pdu[9]
        content = (count + 7) // 8 if function == _F.WRITE_MULTIPLE_COILS else 2 * count
        return size > 5 and pdu[5] == content and size == 6 + content
    if function == _F.WRITE_SINGLE_COIL:
        return size == 5 and pdu[3:] in _COIL_VALUES
    if function == _F.WRITE_SINGLE_REGISTER:
        return size == 5
    if function == _F.MASK_WRITE_REGISTER:
        return size == 7
    if function == _F.DIAGNOSTICS:
        return size >= 3 and (size == 5 or pdu[1:3] == b"\x00\x00")
    return size >= 2 and (size == 4 or pdu[1] != READ_DEVICE_IDENTIFICATION)


def decode_request(pdu: bytes) -> Request:
    """Return a request; `is_well_formed` has to have said yes."""
    function = pdu[0]
    if function in _REGISTER_READS:
        return Request(function, pdu[1] << 8 | pdu[2], pdu[3] << 8 | pdu[4])
    if function == _WRITE_REGISTERS:
        _, address, count, _, *values = _written(pdu[5] // 2).unpack(pdu)
        return Request(function, address, count, tuple(values))
    if function == _READ_WRITE_REGISTERS:
        _, address, count, write_address, _, _, *values = _exchanged(pdu[9] // 2).unpack(pdu)
        return Request(function, address, count, tuple(values), write_address)
    if function == _F.DIAGNOSTICS:
        return Request(function, code=pdu[1] << 8 | pdu[2], data=pdu[3:])
    fields = library.request_fields(pdu)
    if function == _F.ENCAPSULATED_INTERFACE:
        if pdu[1] != READ_DEVICE_IDENTIFICATION:
            return Request(function, code=-1)
        # not from the library's fields: it does not distinguish code 0, which is refused, from no code
        return Request(function, code=pdu[2], object_id=pdu[3])
    if function in _READS:
        return Request(function, fields.address, fields.count)
    if function == _F.MASK_WRITE_REGISTER:
        return Request(function, fields.address, 1, and_mask=fields.and_mask, or_mask=fields.or_mask)
    if function == _F.WRITE_SINGLE_COIL:
        return Request(function, fields.address, 1, (int(fields.bits[0]),))
    if function == _F.WRITE_MULTIPLE_COILS:
        return Request(function, fields.address, fields.count, tuple(map(int, fields.bits[: fields.count])))
    return Request(function, fields.address, len(fields.registers), tuple(fields.registers))


def encode_response(request: Request, response: Response) -> bytes:
    """Return the PDU of a response; what it mirrors comes from the request."""
    function = request.function
    if response.exception:
        return library.exception_response(function, response.exception)
    if response.values and (function in _REGISTER_READS or function == _READ_WRITE_REGISTERS):
        count = len(response.values)
        return _content(count).pack(function, 2 * count, *response.values)
    if function == _WRITE_REGISTERS:
        return _HEAD.pack(function, request.address, request.quantity)
    if function == _F.DIAGNOSTICS:
        return bytes((function,)) + request.code.to_bytes(2, "big") + response.data
    if function == _F.MASK_WRITE_REGISTER:
        return library.mask_request(request.address, request.and_mask, request.or_mask)
    if function == _F.WRITE_SINGLE_COIL:
        return library.bit_response(function, request.address, (bool(request.values[0]),))
    if function in _BITS:
        return library.bit_response(function, 0, [bool(value) for value in response.values])
    values = request.values if function == _F.WRITE_SINGLE_REGISTER else ()
    return library.register_response(function, request.address, request.quantity, values)


def decode_response(request: Request, pdu: bytes) -> Response:
    """Return a response, compared with the request that it answers.

    Raises:
        ResponseError: The bytes are no response to this request.

    """
    function = request.function
    if not pdu:
        raise ResponseError("an empty response")
    if pdu[0] == function | EXCEPTION_BIT:
        if len(pdu) != 2 or pdu[1] == 0:
            raise ResponseError(f"no exception response: {pdu.hex(' ')}")
        return Response(function, exception=pdu[1])
    if pdu[0] != function:
        raise ResponseError(f"a response of function {pdu[0]} to a request of function {function}")
    if function in _READS or function == _F.READ_WRITE_MULTIPLE_REGISTERS:
        content = (request.quantity + 7) // 8 if function in _BITS else 2 * request.quantity
        if len(pdu) != 2 + content or pdu[1] != content:
            raise ResponseError(f"{len(pdu) - 2} bytes for a quantity of {request.quantity}: {pdu.hex(' ')}")
        if function in _BITS:
            bits = library.response_fields(pdu).bits
            return Response(function, tuple(map(int, bits[: request.quantity])))
        return Response(function, _content(request.quantity).unpack(pdu)[2:])
    if function == _F.DIAGNOSTICS:
        if len(pdu) < 3 or pdu[1] << 8 | pdu[2] != request.code:
            raise ResponseError(f"a response of another sub-function: {pdu.hex(' ')}")
        return Response(function, data=pdu[3:])
    if function == _F.ENCAPSULATED_INTERFACE:
        return _identification(pdu)
    if function == _WRITE_REGISTERS:
        expected = _HEAD.pack(function, request.address, len(request.values) or request.quantity)
    else:
        sent = request.encode()
        expected = sent[:5] if function == _F.WRITE_MULTIPLE_COILS else sent
    if pdu != expected:
        raise ResponseError(f"a response that does not mirror its request: {pdu.hex(' ')}")
    return Response(function)


def _identification(pdu: bytes) -> Response:
    # Not by the library: it runs over the end of objects with a length beyond the data, and merges equal
    # ones.
    if len(pdu) < 7 or pdu[1] != READ_DEVICE_IDENTIFICATION:
        raise ResponseError(f"no device identification: {pdu.hex(' ')}")
    objects: list[tuple[int, bytes]] = []
    at = 7
    while at < len(pdu):
        if at + 2 > len(pdu) or at + 2 + pdu[at + 1] > len(pdu):
            raise ResponseError(f"an object behind the end: {pdu.hex(' ')}")
        objects.append((pdu[at], pdu[at + 2 : at + 2 + pdu[at + 1]]))
        at += 2 + pdu[at + 1]
    if len(objects) != pdu[6]:
        raise ResponseError(f"{pdu[6]} objects are announced, {len(objects)} are there")
    return Response(pdu[0], objects=tuple(objects), next_object=pdu[5] if pdu[4] == 0xFF else None)
