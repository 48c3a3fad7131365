"""A recorded signal with the questions that tests ask of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fieldbus.errors import ConfigurationError
from reports.model import Signal as ReportSignal

Direction = Literal["rising", "falling", "any"]
DIRECTIONS: tuple[str, ...] = ("rising", "falling", "any")

PART: Final = 65_536
"""Samples of a piece."""
_SLACK_S = 5e-10
"""Half a nanosecond: times are whole nanoseconds held as float64 seconds."""


@dataclass
class Signal(ReportSignal):
    """One column of a trace: `time_s` [s], `values` [`unit`], ascending in
    time; do not write to the arrays.
    """

    def __len__(self) -> int:
        return len(self.values)

    def at(self, time_s: float) -> float:
        """Return the value in effect at `time_s`: the last sample not later (the
        first one before all samples).

        Raises:
            ConfigurationError: The signal has no samples.

        """
        if len(self.values) == 0:
            raise ConfigurationError(f"signal {self.name}", time_s, "a signal with samples")
        index = int(np.searchsorted(self.time_s, time_s + _SLACK_S, side="right")) - 1
        return float(self.values[max(index, 0)])

    def between(self, start_s: float, end_s: float) -> Signal:
        """Return the samples with `start_s` <= time <= `end_s`."""
        first = int(np.searchsorted(self.time_s, start_s - _SLACK_S, side="left"))
        last = int(np.searchsorted(self.time_s, end_s + _SLACK_S, side="right"))
        return Signal(self.name, self.unit, self.time_s[first:last], self.values[first:last], self.enum)

    def text_at(self, time_s: float) -> str:
        """Return the text of a state signal at `time_s`; the number as text when it has none."""
        return self.text(self.at(time_s))

    def text(self, value: float) -> str:
        """Return the text of a value of a state signal."""
        number = round(value)
        return self.enum.get(number, str(number))

    def crossings(self, value: float, direction: Direction = "any") -> list[float]:
        """Return the times at which the signal passes `value`, linearly interpolated between samples.

        Rising means from below to at or above `value`; falling the reverse.
        """
        if direction not in DIRECTIONS:
            raise ConfigurationError("direction", direction, ", ".join(DIRECTIONS))
        times: list[float] = []
        if len(self.values) < 2:
            return times
        left, right = self.values[:-1], self.values[1:]
        rising = (left < value) & (right >= value)
        falling = (left > value) & (right <= value)
        wanted = rising if direction == "rising" else falling if direction == "falling" else rising | falling
        for index in np.flatnonzero(wanted):
            before, after = float(left[index]), float(right[index])
            share = (value - before) / (after - before)
            start = float(self.time_s[index])
            times.append(start + share * (float(self.time_s[index + 1]) - start))
        return times

    def changes(self) -> list[tuple[float, float]]:
        """Return time and new value of every change, the first sample included: the
        change log of a word (DIA-111).
        """
        found: list[tuple[float, float]] = []
        last = np.empty(0)
        for time_s, values in self.parts():
            # A value differs from the one before, which may be the last one of the part before.
            before = np.concatenate((last, values[:-1])) if len(last) else values[:-1]
            at = np.flatnonzero(values[len(values) - len(before) :] != before) + len(values) - len(before)
            if not len(last):
                found.append((float(time_s[0]), float(values[0])))
            found += [(float(time_s[place]), float(values[place])) for place in at]
            last = values[-1:]
        return found

    def parts(self) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
        """Return times and values piece by piece: those of a long log do not have to be in memory at once."""
        for first in range(0, len(self.values), PART):
            yield (
                np.asarray(self.time_s[first : first + PART]),
                np.asarray(self.values[first : first + PART]),
            )

    def first_crossing(
        self, value: float, direction: Direction = "any", *, after_s: float = 0.0
    ) -> float | None:
        """Return the first passage of `value` at or after `after_s`; None when there is none."""
        for time_s in self.crossings(value, direction):
            if time_s >= after_s:
                return time_s
        return None

    def settles(self, limit: float, *, after_s: float = 0.0) -> float | None:
        """Return the time of the first sample from which on `|value|` <= `limit` to the end of the trace."""
        part = self.between(after_s, float("inf"))
        if len(part.values) == 0:
            return None
        outside = np.flatnonzero(~(np.abs(part.values) <= limit))
        if len(outside) == 0:
            return float(part.time_s[0])
        index = int(outside[-1]) + 1
        return float(part.time_s[index]) if index < len(part.values) else None

    def derivative(self) -> Signal:
        """Return the difference quotient, placed at the later sample of each pair (unit per second)."""
        steps = np.diff(self.time_s)
        with np.errstate(divide="ignore", invalid="ignore"):
            slopes = np.diff(self.values) / steps
        keep = steps > 0
        return Signal(f"{self.name}'", f"{self.unit}/s", self.time_s[1:][keep], slopes[keep])
