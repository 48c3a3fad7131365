"""The object table of the emulated drive: one source for EDS file, dictionary, defaults and tests (C402-309).

`python -m emulators.eds` writes the EDS file from it.
"""

from __future__ import annotations

from functools import cache

from emulators.drive.cia402.objects.communication import communication_objects
from emulators.drive.cia402.objects.profile import profile_objects
from fieldbus.canopen.object_table import ObjectRow


@cache
def all_objects() -> tuple[ObjectRow, ...]:
    """Return the whole table in ascending order."""
    rows = (*communication_objects(), *profile_objects())
    return tuple(sorted(rows, key=lambda row: row.index))
