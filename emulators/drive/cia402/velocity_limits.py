"""Limits that an EDS gives to velocities: numbers in the unit that 60A9h has by default."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Final

from fieldbus.canopen.dictionary import Entry

_TARGETS: Final = (0x60B100, 0x60FF00)
"""Velocities that are no parameters: offset and target."""


class VelocityLimits:
    """Keeps the limits of velocity objects at the same velocities when 60A9h changes.

    A limit that does not fit the type any more limits nothing.

    Args:
        entries: Of the drive, by key.
        parameters: Keys of velocities and accelerations in the unit of 60A9h.
        unit: Size of the unit that the limits are written in, rad/s.

    """

    def __init__(self, entries: Mapping[int, Entry], parameters: Iterable[int], unit: float) -> None:
        self._unit = self._present = unit
        self._limited = [
            (entry, entry.low, entry.high)
            for key in (*parameters, *_TARGETS)
            if (entry := entries.get(key)) is not None
            and entry.integer
            and (entry.low is not None or entry.high is not None)
        ]

    def follow(self, unit: float) -> None:
        """Take over another size of the unit, rad/s."""
        if unit == self._present:
            return
        self._present = unit
        share = self._unit / unit
        for entry, low, high in self._limited:
            least, most = entry.type_range
            scaled_low = None if low is None else round(low * share)
            scaled_high = None if high is None else round(high * share)
            entry.low = scaled_low if scaled_low is not None and scaled_low > least else None
            entry.high = scaled_high if scaled_high is not None and scaled_high < most else None
