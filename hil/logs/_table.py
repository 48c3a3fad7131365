"""Rows of signals as they come from a log: columns appear when the first frame brings them."""

from __future__ import annotations

import math
import sys
from array import array
from collections.abc import Mapping
from typing import Final

import numpy as np

from hil.record import TraceGroup
from hil.record._spool import Spool, new_array

_ROWS: Final = 65_536
"""Rows that are copied at a time."""


class Table:
    """A recorder group in the making: values hold until the next frame brings others."""

    def __init__(self, name: str, enums: Mapping[str, Mapping[int, str]] | None = None) -> None:
        self.name = name
        self._enums = enums or {}
        self._place: dict[str, int] = {}
        self._units: list[str] = []
        self._now: list[float] = []
        self._times = Spool()
        self._values = Spool()
        self._blocks: list[list[int]] = []
        """Columns and rows of the blocks one behind the other, one for every number of columns there was."""
        self._pending: tuple[int, array[float]] | None = None
        """The last row, which another one of the same instant may replace."""

    def set(self, column: str, value: float, unit: str = "") -> None:
        """Give a column its present value."""
        at = self._place.get(column)
        if at is None:
            at = self._place[column] = len(self._now)
            self._units.append(unit)
            self._now.append(math.nan)
        self._now[at] = value

    def get(self, column: str) -> float | None:
        """Return the present value of a column; None before the first."""
        at = self._place.get(column)
        return None if at is None else self._now[at]

    def row(self, time_ns: int) -> None:
        """Keep the present values under a time; a second row of the same
        instant takes the place of the first.
        """
        if not self._now:
            return
        if self._pending is not None and self._pending[0] != time_ns:
            self._commit()
        self._pending = time_ns, array("d", self._now)

    def _commit(self) -> None:
        if self._pending is None:
            return
        time_ns, row = self._pending
        self._pending = None
        if not self._blocks or self._blocks[-1][0] != len(row):
            self._blocks.append([len(row), 0])
        self._blocks[-1][1] += 1
        self._times.write(time_ns.to_bytes(8, sys.byteorder, signed=True))
        self._values.write(row.tobytes())

    def group(self) -> TraceGroup | None:
        """Return the rows; what had not come yet is no number. None without any."""
        self._commit()
        if not self._blocks:
            return None
        cells = self._values.view(np.float64)
        width = len(self._now)
        if len(self._blocks) == 1:
            values = cells.reshape(-1, width)
        else:
            values = new_array(sum(rows for _, rows in self._blocks), width)
            first = at = 0
            for known, rows in self._blocks:
                for begin in range(0, rows, _ROWS):
                    count = min(_ROWS, rows - begin)
                    part = cells[at : at + count * known].reshape(count, known)
                    values[first : first + count, :known] = part
                    values[first : first + count, known:] = math.nan
                    first, at = first + count, at + count * known
        columns = tuple(zip(self._place, self._units, strict=True))
        enums = {column: dict(texts) for column, texts in self._enums.items() if column in self._place}
        return TraceGroup(self.name, columns, enums, self._times.view(np.int64), values)
