"""Base mode parameter access: requests and answers as bytes (PD-199 to PD-230).
Serves controller, drive and fuzzer.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from types import MappingProxyType
from typing import Final

from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.formats import TypeCode

LONGEST_RECORD: Final = 240
"""Bytes of a request or an answer."""
MOST_PARAMETERS: Final = 39
MOST_ELEMENTS: Final = 234


class RequestId(IntEnum):
    """Second byte of a request; with 80h added that of a negative answer."""

    READ = 0x01
    WRITE = 0x02


class Attribute(IntEnum):
    """What of a parameter is meant."""

    VALUE = 0x10
    DESCRIPTION = 0x20
    TEXT = 0x30


class Format(IntEnum):
    """Formats of values besides the data types (PD-204)."""

    ZERO = 0x40
    BYTE = 0x41
    WORD = 0x42
    DOUBLE_WORD = 0x43
    ERROR = 0x44


class ParameterError(IntEnum):
    """Error numbers of an answer (PD-210 to PD-231)."""

    NUMBER = 0x00
    READ_ONLY = 0x01
    LIMIT = 0x02
    SUB_INDEX = 0x03
    NO_ARRAY = 0x04
    TYPE = 0x05
    RESET_ONLY = 0x06
    DESCRIPTION_READ_ONLY = 0x07
    NO_DESCRIPTION = 0x09
    NO_CONTROL = 0x0B
    NO_TEXT = 0x0F
    OPERATING_STATE = 0x11
    VALUE = 0x14
    TOO_LONG = 0x15
    ADDRESS = 0x16
    FORMAT = 0x17
    COUNT = 0x18
    DRIVE_OBJECT = 0x19
    TEXT_READ_ONLY = 0x20
    SERVICE = 0x21
    TOO_MANY = 0x22
    MULTI = 0x23


ERROR_TEXTS: Final = MappingProxyType(
    {
        0x00: "parameter number not permitted",
        0x01: "value cannot be changed",
        0x02: "lower or upper limit exceeded",
        0x03: "wrong sub-index",
        0x04: "not an array",
        0x05: "wrong data type",
        0x06: "may only be reset",
        0x07: "description cannot be changed",
        0x09: "no description",
        0x0B: "no control authority",
        0x0F: "no text",
        0x11: "not possible in this operating state",
        0x14: "value not permitted",
        0x15: "answer too long",
        0x16: "parameter address not permitted",
        0x17: "format not permitted",
        0x18: "wrong number of values",
        0x19: "drive object does not exist",
        0x20: "text cannot be changed",
        0x21: "service not supported",
        0x22: "too many parameter requests",
        0x23: "access to several parameters not supported",
        0x65: "parameter deactivated",
        0x6B: "write access only in a commissioning state",
        0x77: "write access only with pulse inhibit",
        0x82: "control authority is elsewhere",
        0x85: "change locked",
        0xC8: "below the limit in force",
        0xC9: "above the limit in force",
        0xCC: "write access not permitted",
    }
)
"""Texts of error numbers; those from 65h on are vendor-specific."""

_WITH_SUB_INDEX: Final = frozenset({0x01, 0x02, 0x03, 0x06, 0x07, 0x14})
"""Errors that are followed by the sub-index (PD-205)."""

_PACKING: Final[dict[int, str]] = {
    TypeCode.BOOLEAN: "B",
    TypeCode.INTEGER8: "b",
    TypeCode.INTEGER16: "h",
    TypeCode.INTEGER32: "i",
    TypeCode.UNSIGNED8: "B",
    TypeCode.UNSIGNED16: "H",
    TypeCode.UNSIGNED32: "I",
    TypeCode.FLOAT32: "f",
    TypeCode.VISIBLE_STRING: "B",
    TypeCode.OCTET_STRING: "B",
    TypeCode.FLOAT64: "d",
    TypeCode.INTEGER64: "q",
    TypeCode.UNSIGNED64: "Q",
    TypeCode.N2: "h",
    TypeCode.N4: "i",
    TypeCode.V2: "H",
    TypeCode.L2: "H",
    TypeCode.R2: "H",
    TypeCode.T2: "H",
    TypeCode.T4: "I",
    TypeCode.D2: "H",
    TypeCode.E2: "h",
    TypeCode.C4: "i",
    TypeCode.X2: "h",
    TypeCode.X4: "i",
    TypeCode.DATE: "7s",
    TypeCode.TIME_OF_DAY: "6s",
    TypeCode.TIME_DIFFERENCE: "6s",
    TypeCode.TIME_OF_DAY_WITHOUT_DATE: "I",
    TypeCode.TIME_DIFFERENCE_WITH_DATE: "6s",
    TypeCode.TIME_DIFFERENCE_WITHOUT_DATE: "I",
    Format.BYTE: "B",
    Format.WORD: "H",
    Format.DOUBLE_WORD: "I",
}

_LAYOUTS: Final = {int(code): struct.Struct(">" + packing) for code, packing in _PACKING.items()}
_SIZES: Final = {code: layout.size for code, layout in _LAYOUTS.items()}

Value = int | float | bytes


def size_of(code: int) -> int | None:
    """Return the bytes of one value of a format or data type; None for one that does not exist."""
    return _SIZES.get(code)


def pack_values(code: int, values: Sequence[Value]) -> bytes:
    """Return values of a format as bytes, high byte first, without padding.

    Raises:
        ParameterAccessError: A value does not fit the format.

    """
    layout = _LAYOUTS.get(code)
    if layout is None:
        raise ParameterAccessError(f"format {code:02X}h carries no values")
    try:
        return b"".join([layout.pack(value) for value in values])
    except (struct.error, OverflowError) as error:
        raise ParameterAccessError(f"{list(values)} in format {code:02X}h: {error}") from None


def unpack_values(code: int, data: bytes) -> tuple[Value, ...]:
    """Return the values of a format; `data` has their exact length.

    Raises:
        ParameterAccessError: It has not, or there is no such format.

    """
    size = size_of(code)
    if size is None or len(data) % size:
        raise ParameterAccessError(f"{len(data)} bytes are no values of format {code:02X}h")
    return tuple([one[0] for one in _LAYOUTS[code].iter_unpack(data)])


@dataclass(frozen=True)
class Address:
    """Which values of a parameter.

    Args:
        number: PNU, 0..65535.
        sub_index: First element, 0..65535.
        elements: Number of elements, 0..234; 0 (or 1) for a parameter that is no array.
        attribute: `Attribute`, or any byte of a request that is not understood.

    """

    number: int
    sub_index: int = 0
    elements: int = 0
    attribute: int = Attribute.VALUE


@dataclass(frozen=True)
class Values:
    """Values in a format: of a write request, or of a good answer to reading. A word
    of zero values answers writing.
    """

    code: int
    values: tuple[Value, ...]


@dataclass(frozen=True)
class Refusal:
    """A parameter that was refused.

    Args:
        error: `ParameterError` or a vendor's number, 0..255.
        sub_index: Where, for the errors that have it.

    """

    error: int
    sub_index: int | None = None

    @property
    def text(self) -> str:
        """The reason in words."""
        reason = ERROR_TEXTS.get(self.error, "unknown error")
        where = "" if self.sub_index is None else f" at sub-index {self.sub_index}"
        return f"{self.error:02X}h {reason}{where}"


@dataclass(frozen=True)
class Request:
    """A request: reading or writing of one or several parameters.

    Args:
        reference: Number that the answer mirrors, 1..255.
        service: `RequestId`, or any byte of a request that is not understood.
        drive_object: DO-ID, 0..255.
        addresses: What is asked for.
        values: For writing, one per address; empty for reading.

    """

    reference: int
    service: int
    drive_object: int
    addresses: tuple[Address, ...]
    values: tuple[Values, ...] = ()

    def encode(self) -> bytes:
        """Return the request as bytes.

        Raises:
            ParameterAccessError: A field is out of its range, or the request does not fit a record.

        """
        out = bytearray()
        try:
            out += struct.pack(">BBBB", self.reference, self.service, self.drive_object, len(self.addresses))
            for address in self.addresses:
                out += struct.pack(
                    ">BBHH", address.attribute, address.elements, address.number, address.sub_index
                )
        except struct.error as error:
            raise ParameterAccessError(f"{self}: {error}") from None
        for entry in self.values:
            out += _block(entry)
        if len(out) > LONGEST_RECORD:
            raise ParameterAccessError(f"a request of {len(out)} bytes is longer than {LONGEST_RECORD}")
        return bytes(out)


def decode_request(data: bytes) -> Request:
    """Return a request from its bytes. What the parameters are is not looked at.

    Raises:
        ParameterAccessError: The bytes are no whole request; `error` is the number with which to refuse
            it (PD-207, PD-208).

    """
    if len(data) < 4:
        raise ParameterAccessError(f"{len(data)} bytes are no request", ParameterError.COUNT)
    reference, service, drive_object, count = data[:4]
    addresses: list[Address] = []
    at = 4
    for _ in range(count):
        if at + 6 > len(data):
            raise ParameterAccessError(
                f"{count} addresses are announced, {len(addresses)} are there", ParameterError.COUNT
            )
        attribute, elements, number, sub_index = struct.unpack_from(">BBHH", data, at)
        addresses.append(Address(number, sub_index, elements, attribute))
        at += 6
    values = []
    if service == RequestId.WRITE:
        for _ in addresses:
            block, at = _read_block(data, at)
            values.append(block)
    if at != len(data):
        raise ParameterAccessError(f"{len(data) - at} bytes too many", ParameterError.COUNT)
    return Request(reference, service, drive_object, tuple(addresses), tuple(values))


@dataclass(frozen=True)
class Answer:
    """An answer.

    Args:
        reference: That of the request.
        service: That of the request, without the bit for negative.
        drive_object: That of the request.
        results: One per parameter: `Values` read, `Refusal`, or None for a parameter that was written.

    """

    reference: int
    service: int
    drive_object: int
    results: tuple[Values | Refusal | None, ...]

    @property
    def positive(self) -> bool:
        """Whether nothing was refused."""
        return not any(isinstance(result, Refusal) for result in self.results)

    def encode(self) -> bytes:
        """Return the answer as bytes; a positive one to writing is the header alone (PD-202, PD-203)."""
        positive = self.positive
        service = self.service & 0x7F | (0 if positive else 0x80)
        out = bytearray((self.reference, service, self.drive_object, len(self.results)))
        if positive and self.service == RequestId.WRITE:
            return bytes(out)
        for result in self.results:
            if isinstance(result, Refusal):
                numbers = [result.error]
                if result.error in _WITH_SUB_INDEX and result.sub_index is not None:
                    numbers.append(result.sub_index)
                out += bytes((Format.ERROR, len(numbers))) + pack_values(Format.WORD, numbers)
            else:
                out += _block(result if result is not None else Values(Format.ZERO, ()))
        return bytes(out)


def decode_answer(data: bytes) -> Answer:
    """Return an answer from its bytes.

    Raises:
        ParameterAccessError: The bytes are no whole answer.

    """
    if len(data) < 4:
        raise ParameterAccessError(f"{len(data)} bytes are no answer")
    reference, service, drive_object, count = data[:4]
    if service == RequestId.WRITE and len(data) == 4:
        return Answer(reference, RequestId.WRITE, drive_object, (None,) * count)
    results: list[Values | Refusal | None] = []
    at = 4
    for _ in range(count):
        block, at = _read_block(data, at)
        if block.code == Format.ERROR:
            numbers = [int(value) for value in block.values]
            if not numbers:
                raise ParameterAccessError("an error without a number")
            results.append(Refusal(numbers[0], numbers[1] if len(numbers) > 1 else None))
        else:
            results.append(None if block.code == Format.ZERO else block)
    if at != len(data):
        raise ParameterAccessError(f"{len(data) - at} bytes too many")
    return Answer(reference, service & 0x7F, drive_object, tuple(results))


def _block(entry: Values) -> bytes:
    """Return format, number of values, values, filled up to an even length."""
    if len(entry.values) > MOST_ELEMENTS:
        raise ParameterAccessError(f"{len(entry.values)} values are more than {MOST_ELEMENTS}")
    content = b"" if entry.code == Format.ZERO else pack_values(entry.code, entry.values)
    return bytes((entry.code, len(entry.values))) + content + bytes(len(content) % 2)


def _read_block(data: bytes, at: int) -> tuple[Values, int]:
    if at + 2 > len(data):
        raise ParameterAccessError("values are missing", ParameterError.COUNT)
    code, count = data[at], data[at + 1]
    at += 2
    if code == Format.ZERO:
        return Values(code, ()), at
    size = 2 if code == Format.ERROR else size_of(code)
    if size is None:
        raise ParameterAccessError(f"there is no format {code:02X}h", ParameterError.FORMAT)
    end = at + size * count
    if end > len(data):
        raise ParameterAccessError(f"{count} values do not fit into what is left", ParameterError.COUNT)
    content = data[at:end]
    values = unpack_values(Format.WORD if code == Format.ERROR else code, content)
    return Values(code, values), end + (end - at) % 2
