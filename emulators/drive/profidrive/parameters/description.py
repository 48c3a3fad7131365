"""The description of a parameter as bytes: twelve parts, 46 bytes (attribute 20h)."""

from __future__ import annotations

import struct
from typing import Final

from emulators.drive.profidrive.parameters.definitions import ParameterDefinition, WriteRule
from fieldbus.profidrive import TypeCode
from fieldbus.profidrive.requests import pack_values

DESCRIPTION_PARTS: Final = (2, 2, 4, 2, 4, 16, 4, 4, 2, 2, 2, 2)
"""Bytes of: identifier, elements, standardisation, variable attribute, reserved, name, low, high, reserved,
extension, reference parameter, normalisation."""

_ARRAY: Final = 0x4000
_RESET_ONLY: Final = 0x2000
_CHANGED: Final = 0x1000
_HAS_TEXTS: Final = 0x0400
_READ_ONLY: Final = 0x0200
_NO_STANDARDISATION: Final = 0x0100

TEXT_LENGTH: Final = 16


def text_of(text: str) -> bytes:
    """Return a text in its sixteen bytes."""
    return text.encode("latin-1", "replace")[:TEXT_LENGTH].ljust(TEXT_LENGTH)


def describe(definition: ParameterDefinition, *, changed: bool) -> bytes:
    """Return the description of a parameter; units and standardisation are left
    out, which its identifier says.
    """
    identifier = int(definition.type) | _NO_STANDARDISATION
    if definition.size is not None:
        identifier |= _ARRAY
    if definition.write is WriteRule.NEVER:
        identifier |= _READ_ONLY
    if definition.write is WriteRule.RESET:
        identifier |= _RESET_ONLY
    if definition.texts:
        identifier |= _HAS_TEXTS
    if changed:
        identifier |= _CHANGED
    low, high = (_limit(definition.type, limit) for limit in definition.limits)
    return struct.pack(
        ">HHfH4s16s4s4s2sHHH",
        identifier,
        definition.elements if definition.size is not None else 0,
        1.0,
        0,
        b"",
        text_of(definition.text),
        low,
        high,
        b"",
        0,
        0,
        0,
    )


def _limit(code: TypeCode, limit: float) -> bytes:
    """Return a limit in four bytes, right-aligned; a whole number keeps its sign."""
    if code == TypeCode.FLOAT32:
        return pack_values(code, [limit])
    return struct.pack(">q", round(limit))[-4:]
