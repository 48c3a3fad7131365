"""Inputs and outputs of a station: filter, scaling, wire break, substitute values. They know no bus."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from fieldbus.clock import MS, Scheduler, Timer
from fieldbus.errors import ConfigurationError

_FULL_SCALE: Final = 27648
_OVERFLOW: Final = 32767
_UNDERFLOW: Final = -32768
_OVERRANGE: Final = 32511
_UNDERRANGE: Final = -32512
_LONGEST_FILTER_MS: Final = 1000.0


class DigitalInput:
    """An input with a filter: a level counts when it has lasted for the filter time.

    Args:
        scheduler: Time.
        filter_ms: Filter time, ms, 0..1000; 0 for none.

    """

    __slots__ = ("_filter_ns", "_scheduler", "_timer", "raw", "value")

    def __init__(self, scheduler: Scheduler, filter_ms: float = 3.0) -> None:
        if not 0 <= filter_ms <= _LONGEST_FILTER_MS:
            raise ConfigurationError("digital input, filter_ms", filter_ms, f"0..{_LONGEST_FILTER_MS:g}")
        self._scheduler = scheduler
        self._filter_ns = round(filter_ms * MS)
        self._timer: Timer | None = None
        self.raw = False
        """Level at the terminal."""
        self.value = False
        """Level behind the filter."""

    def set(self, level: bool) -> None:
        """Change the level at the terminal."""
        if level == self.raw:
            return
        self.raw = level
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if level == self.value:
            return  # it was shorter than the filter
        if self._filter_ns:
            self._timer = self._scheduler.after(self._filter_ns, self._settle)
        else:
            self.value = level

    def _settle(self) -> None:
        self._timer = None
        self.value = self.raw


class DigitalOutput:
    """An output.

    Args:
        on_change: Called with every new level.
        substitute: Level when the controller is lost; None keeps the last one.

    """

    __slots__ = ("on_change", "substitute", "value")

    def __init__(
        self, on_change: Callable[[bool], object] | None = None, *, substitute: bool | None = False
    ) -> None:
        self.on_change = on_change
        self.substitute = substitute
        self.value = False

    def set(self, level: bool) -> None:
        """Switch it."""
        if level != self.value:
            self.value = level
            if self.on_change is not None:
                self.on_change(level)


class AnalogInput:
    """An input with a range and a smoothing of first order.

    Args:
        scheduler: Time.
        low: Value of the quantity at the lower end of the range, in its unit (for 4..20 mA: 4).
        high: Value at the upper end.
        smoothing_ms: Time constant, ms; 0 for none.
        bipolar: Whether the range reaches from -high to high.
        wire_break_below: Value below which the wire counts as broken; None for never.

    """

    __slots__ = ("_high", "_low", "_scheduler", "_shown", "_since_ns", "_target", "_tau_ns", "_wire_break", "bipolar")  # fmt: skip

    def __init__(
        self,
        scheduler: Scheduler,
        low: float = 0.0,
        high: float = 10.0,
        *,
        smoothing_ms: float = 0.0,
        bipolar: bool = False,
        wire_break_below: float | None = None,
    ) -> None:
        if not low < high:
            raise ConfigurationError("analog input, low and high", (low, high), "low < high")
        if smoothing_ms < 0:
            raise ConfigurationError("analog input, smoothing_ms", smoothing_ms, "0 or more")
        self._scheduler = scheduler
        self._low = low
        self._high = high
        self._tau_ns = smoothing_ms * MS
        self._wire_break = wire_break_below
        self.bipolar = bipolar
        self._target = self._shown = low
        self._since_ns = scheduler.now

    def set(self, value: float) -> None:
        """Change the quantity at the terminal.

        Raises:
            ConfigurationError: It is no number.

        """
        if not math.isfinite(value):
            raise ConfigurationError("analog input", value, "a finite number")
        self._shown = self.smoothed
        self._since_ns = self._scheduler.now
        self._target = value

    @property
    def smoothed(self) -> float:
        """The quantity behind the smoothing, in its unit."""
        if not self._tau_ns:
            return self._target
        left = math.exp(-(self._scheduler.now - self._since_ns) / self._tau_ns)
        return self._target + (self._shown - self._target) * left

    @property
    def wire_broken(self) -> bool:
        """Whether the quantity is below the limit for a broken wire."""
        return self._wire_break is not None and self._target < self._wire_break

    @property
    def word(self) -> int:
        """The value for the bus: 27648 is the end of the range; 32767 and -32768 are overflow and underflow."""
        if self.wire_broken:
            return _OVERFLOW
        scaled = round((self.smoothed - self._low) / (self._high - self._low) * _FULL_SCALE)
        if scaled > _OVERRANGE:
            return _OVERFLOW
        if scaled < (_UNDERRANGE if self.bipolar else -4864):
            return _UNDERFLOW
        return scaled


class AnalogOutput:
    """An output with a range.

    Args:
        low: Quantity at word 0, in its unit.
        high: Quantity at word 27648.
        substitute: Word when the controller is lost; None keeps the last one.

    """

    __slots__ = ("_high", "_low", "substitute", "word")

    def __init__(self, low: float = 0.0, high: float = 10.0, *, substitute: int | None = 0) -> None:
        if not low < high:
            raise ConfigurationError("analog output, low and high", (low, high), "low < high")
        self._low = low
        self._high = high
        self.substitute = substitute
        self.word = 0

    @property
    def value(self) -> float:
        """The quantity at the terminal, in its unit; words beyond the overrange give the end of it."""
        word = min(max(self.word, _UNDERRANGE), _OVERRANGE)
        return self._low + (self._high - self._low) * word / _FULL_SCALE
