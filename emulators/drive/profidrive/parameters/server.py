"""Base mode parameter access of a drive: any bytes in, an answer of at most
240 bytes out (PD-199 to PD-231).
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Mapping
from typing import Final

from emulators.drive.profidrive.parameters.definitions import ParameterDefinition
from emulators.drive.profidrive.parameters.description import DESCRIPTION_PARTS, describe, text_of
from emulators.drive.profidrive.parameters.store import ParameterStore
from fieldbus.profidrive import TypeCode
from fieldbus.profidrive.errors import ParameterAccessError
from fieldbus.profidrive.requests import (
    LONGEST_RECORD,
    MOST_ELEMENTS,
    MOST_PARAMETERS,
    Address,
    Answer,
    Attribute,
    Format,
    ParameterError,
    Refusal,
    RequestId,
    Values,
    decode_request,
    size_of,
)

_HEADER: Final = 4
_LONGEST_REFUSAL: Final = 6
_ATTRIBUTES: Final = frozenset(Attribute)
_FORMATS: Final = frozenset({Format.BYTE, Format.WORD, Format.DOUBLE_WORD})

Result = Values | Refusal | None


class ParameterServer:
    """Answers requests from the parameters of one or several drive objects.

    Args:
        objects: Parameters by DO-ID, 0..255.
        multi: Whether a request may hold several parameters.

    """

    def __init__(self, objects: Mapping[int, ParameterStore], *, multi: bool = True) -> None:
        self._objects = dict(objects)
        self.multi = multi
        self.requests = 0
        """Requests so far."""
        self.refused: Counter[int] = Counter()
        """Parameters that were refused so far, by error number."""

    def request(self, data: bytes) -> bytes:
        """Return the answer to a request, whatever it is; it is never longer than 240 bytes."""
        self.requests += 1
        reference, service, drive_object, count = data[:_HEADER].ljust(_HEADER, b"\0")
        error = self._wrong_header(data)
        if error is not None:
            return self._answer(reference, service, drive_object, (Refusal(error),))
        store = self._objects[drive_object]
        addresses = [
            Address(number, sub_index, elements, attribute)
            for attribute, elements, number, sub_index in struct.iter_unpack(
                ">BBHH", data[_HEADER : _HEADER + 6 * count]
            )
        ]
        if service == RequestId.WRITE:
            results = _write_all(store, addresses, data)
        else:
            wrong = ParameterError.COUNT if len(data) != _HEADER + 6 * count else None
            results = _read_all(store, addresses, wrong)
        return self._answer(reference, service, drive_object, tuple(results))

    def _wrong_header(self, data: bytes) -> int | None:
        """Return why nothing of the request is looked at; None if it is (PD-207)."""
        if len(data) < _HEADER:
            return ParameterError.COUNT
        _, service, drive_object, count = data[:_HEADER]
        if service not in {RequestId.READ, RequestId.WRITE}:
            return ParameterError.SERVICE
        if drive_object not in self._objects:
            return ParameterError.DRIVE_OBJECT
        if count > MOST_PARAMETERS:
            return ParameterError.TOO_MANY
        if count > 1 and not self.multi:
            return ParameterError.MULTI
        if count == 0 or len(data) < _HEADER + 6 * count or len(data) > LONGEST_RECORD:
            return ParameterError.COUNT
        return None

    def _answer(self, reference: int, service: int, drive_object: int, results: tuple[Result, ...]) -> bytes:
        for result in results:
            if isinstance(result, Refusal):
                self.refused[result.error] += 1
        return Answer(reference, service & 0x7F, drive_object, results).encode()


# ---------------------------------------------------------------------------------------------------- reading


def _read_all(store: ParameterStore, addresses: list[Address], wrong: int | None) -> list[Result]:
    """Return one result per address; what does not fit into the answer is refused with 15h (PD-223)."""
    results: list[Result] = []
    space = LONGEST_RECORD - _HEADER - _LONGEST_REFUSAL * len(addresses)
    for address in addresses:
        result = _read(store, address, space + _LONGEST_REFUSAL, wrong)
        if isinstance(result, Values):
            space += _LONGEST_REFUSAL - _block_length(result.code, len(result.values))
        results.append(result)
    return results


def _read(store: ParameterStore, address: Address, space: int, wrong: int | None) -> Values | Refusal:
    refusal = _wrong_address(address)
    if refusal is not None:
        return refusal
    definition = store.definition(address.number)
    if definition is None:
        return Refusal(ParameterError.NUMBER)
    if address.number in store.refusals:
        return Refusal(store.refusals[address.number], address.sub_index)
    if address.attribute == Attribute.DESCRIPTION:
        result = _read_description(store, definition, address)
    elif address.attribute == Attribute.TEXT:
        result = _read_text(definition, address)
    else:
        result = _read_values(store, definition, address, space)
    if isinstance(result, Refusal):
        return result
    if wrong is not None:
        return Refusal(wrong)
    if _block_length(result.code, len(result.values)) > space:
        return Refusal(ParameterError.TOO_LONG)
    return result


def _read_values(
    store: ParameterStore, definition: ParameterDefinition, address: Address, space: int
) -> Values | Refusal:
    refusal = _wrong_index(definition, address)
    if refusal is not None:
        return refusal
    count = max(1, address.elements)
    if _block_length(definition.type, count) > space:
        return Refusal(ParameterError.TOO_LONG)
    try:
        values = store.values(definition.number, address.sub_index, count)
    except ParameterAccessError as error:
        return Refusal(error.error, address.sub_index)
    return Values(definition.type, values)


def _read_description(
    store: ParameterStore, definition: ParameterDefinition, address: Address
) -> Values | Refusal:
    if not definition.text:
        return Refusal(ParameterError.NO_DESCRIPTION)
    if address.elements > 1:
        return Refusal(ParameterError.ADDRESS)
    if address.sub_index > len(DESCRIPTION_PARTS):
        return Refusal(ParameterError.SUB_INDEX, address.sub_index)
    whole = describe(definition, changed=store.is_changed(definition.number))
    if not address.sub_index:
        return Values(TypeCode.OCTET_STRING, tuple(whole))
    start = sum(DESCRIPTION_PARTS[: address.sub_index - 1])
    part = whole[start : start + DESCRIPTION_PARTS[address.sub_index - 1]]
    return Values(TypeCode.OCTET_STRING, tuple(part))


def _read_text(definition: ParameterDefinition, address: Address) -> Values | Refusal:
    if not definition.texts:
        return Refusal(ParameterError.NO_TEXT)
    count = max(1, address.elements)
    if address.sub_index + count > len(definition.texts):
        return Refusal(ParameterError.SUB_INDEX, max(address.sub_index, len(definition.texts)))
    characters = b"".join(
        text_of(text) for text in definition.texts[address.sub_index : address.sub_index + count]
    )
    if len(characters) > MOST_ELEMENTS:
        return Refusal(ParameterError.TOO_LONG)
    return Values(TypeCode.VISIBLE_STRING, tuple(characters))


# ---------------------------------------------------------------------------------------------------- writing


def _write_all(store: ParameterStore, addresses: list[Address], data: bytes) -> list[Result]:
    """Return one result per address. A record whose values cannot be separated writes nothing."""
    blocks: list[Values | int]
    try:
        blocks = list(decode_request(data).values)
    except ParameterAccessError as error:
        blocks = [error.error] * len(addresses)
    return [_write(store, address, block) for address, block in zip(addresses, blocks, strict=True)]


def _write(store: ParameterStore, address: Address, block: Values | int) -> Refusal | None:
    refusal = _wrong_address(address)
    if refusal is not None:
        return refusal
    if address.attribute == Attribute.DESCRIPTION:
        return Refusal(ParameterError.DESCRIPTION_READ_ONLY, address.sub_index)
    definition = store.definition(address.number)
    if definition is None:
        return Refusal(ParameterError.NUMBER)
    if address.number in store.refusals:
        return Refusal(store.refusals[address.number], address.sub_index)
    if address.attribute == Attribute.TEXT:
        return Refusal(ParameterError.TEXT_READ_ONLY if definition.texts else ParameterError.NO_TEXT)
    if not store.is_writable(definition.number):
        return Refusal(ParameterError.READ_ONLY, address.sub_index)
    refusal = _wrong_index(definition, address)
    if refusal is not None:
        return refusal
    if isinstance(block, int):
        return Refusal(block)
    return _write_values(store, definition, address, block)


def _write_values(
    store: ParameterStore, definition: ParameterDefinition, address: Address, block: Values
) -> Refusal | None:
    if block.code in {Format.ZERO, Format.ERROR}:
        return Refusal(ParameterError.FORMAT)
    if len(block.values) != max(1, address.elements):
        return Refusal(ParameterError.COUNT)
    fits = block.code == definition.type or (
        block.code in _FORMATS and size_of(block.code) == size_of(definition.type)
    )
    if not fits:
        return Refusal(ParameterError.TYPE)
    values = [definition.reinterpreted(block.code, value) for value in block.values]
    for at, value in enumerate(values, address.sub_index):
        refusal = store.check_value(definition.number, at, value)
        if refusal is not None:
            return refusal
    refusal = store.check_state(definition.number)
    if refusal is not None:
        return refusal
    for at, value in enumerate(values, address.sub_index):
        try:
            store.put(definition.number, at, value)
        except ParameterAccessError as error:
            return Refusal(error.error, at)
    return None


# ----------------------------------------------------------------------------------------------------- common


def _wrong_address(address: Address) -> Refusal | None:
    if address.attribute not in _ATTRIBUTES or address.elements > MOST_ELEMENTS:
        return Refusal(ParameterError.ADDRESS)
    return None


def _wrong_index(definition: ParameterDefinition, address: Address) -> Refusal | None:
    if definition.size is None:
        if address.sub_index or address.elements > 1:
            return Refusal(ParameterError.NO_ARRAY)
        return None
    if not address.elements:
        return Refusal(ParameterError.ADDRESS)
    if address.sub_index + address.elements > definition.size:
        return Refusal(ParameterError.SUB_INDEX, max(address.sub_index, definition.size))
    return None


def _block_length(code: int, count: int) -> int:
    content = (size_of(code) or 0) * count
    return 2 + content + content % 2
