"""Rows of signals as they come from a log: columns appear when the first frame brings them."""

from __future__ import annotations

import math
from array import array
from collections.abc import Mapping

import numpy as np

from hil.record import TraceGroup


class Table:
    """A recorder group in the making: values hold until the next frame brings others."""

    def __init__(self, name: str, enums: Mapping[str, Mapping[int, str]] | None = None) -> None:
        self.name = name
        self._enums = enums or {}
        self._place: dict[str, int] = {}
        self._units: list[str] = []
        self._now: list[float] = []
        self._times = array("q")
        self._blocks: list[tuple[int, array[float]]] = []
        """Rows one behind the other, a block for every number of columns that there were."""

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
        if self._times and self._times[-1] == time_ns:
            width, values = self._blocks[-1]
            del values[len(values) - width :]
        else:
            self._times.append(time_ns)
        if not self._blocks or self._blocks[-1][0] != len(self._now):
            self._blocks.append((len(self._now), array("d")))
        self._blocks[-1][1].extend(self._now)

    def group(self) -> TraceGroup | None:
        """Return the rows; what had not come yet is no number. None without any."""
        if not self._times:
            return None
        values = np.full((len(self._times), len(self._now)), np.nan)
        first = 0
        for width, block in self._blocks:
            rows = np.frombuffer(block, dtype=np.float64).reshape(-1, width)
            values[first : first + len(rows), :width] = rows
            first += len(rows)
        columns = tuple(zip(self._place, self._units, strict=True))
        enums = {column: dict(texts) for column, texts in self._enums.items() if column in self._place}
        return TraceGroup(self.name, columns, enums, np.array(self._times, dtype=np.int64), values)
