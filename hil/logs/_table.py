"""Rows of signals as they come from a log: columns appear when the first frame brings them."""

from __future__ import annotations

import math
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
        self._times: list[int] = []
        self._rows: list[list[float]] = []

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
        """Keep the present values under a time; a second row of the same instant takes the place of the first."""
        if self._times and self._times[-1] == time_ns:
            self._rows[-1] = self._now.copy()
            return
        self._times.append(time_ns)
        self._rows.append(self._now.copy())

    def group(self) -> TraceGroup | None:
        """Return the rows; what had not come yet is no number. None without any."""
        if not self._rows:
            return None
        width = len(self._now)
        values = np.full((len(self._rows), width), np.nan)
        for index, row in enumerate(self._rows):
            values[index, : len(row)] = row
        columns = tuple(zip(self._place, self._units, strict=True))
        enums = {column: dict(texts) for column, texts in self._enums.items() if column in self._place}
        return TraceGroup(self.name, columns, enums, np.array(self._times, dtype=np.int64), values)
