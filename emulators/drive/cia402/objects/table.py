"""The object table of the emulated drive: one source for EDS file, dictionary, defaults and tests (C402-309).

`python -m emulators.drive.cia402.eds` writes the EDS file from it.
"""

from __future__ import annotations

from functools import cache

from fieldbus.canopen.object_table import (
    ARRAY,
    BOOLEAN,
    I8,
    I16,
    I32,
    RECORD,
    STRING,
    TYPE_NAMES,
    U8,
    U16,
    U32,
    VAR,
    Item,
    ObjectRow,
    array,
    record,
    var,
)

__all__ = [
    "ARRAY",
    "BOOLEAN",
    "I8",
    "I16",
    "I32",
    "RECORD",
    "STRING",
    "TYPE_NAMES",
    "U8",
    "U16",
    "U32",
    "VAR",
    "Item",
    "ObjectRow",
    "all_objects",
    "array",
    "record",
    "var",
]


@cache
def all_objects() -> tuple[ObjectRow, ...]:
    """Return the whole table in ascending order."""
    from emulators.drive.cia402.objects.communication import communication_objects
    from emulators.drive.cia402.objects.profile import profile_objects

    rows = (*communication_objects(), *profile_objects())
    return tuple(sorted(rows, key=lambda row: row.index))
