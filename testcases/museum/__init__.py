"""The museum of field errors: published defects of real products that this bench shows and catches."""

from __future__ import annotations

from typing import Final

from hil.museum import FieldError
from testcases.museum import _brakes, _canopen, _coordination, _homing, _modbus, _restart

ENTRIES: Final[tuple[FieldError, ...]] = (
    *_restart.ENTRIES,
    *_brakes.ENTRIES,
    *_canopen.ENTRIES,
    *_modbus.ENTRIES,
    *_homing.ENTRIES,
    *_coordination.ENTRIES,
)
"""All entries, chapter by chapter."""
