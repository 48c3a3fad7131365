"""Inputs and outputs of a station: filter, scaling, wire break, substitute values, and how they break. They
know no bus.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from emulators.input_filter import INPUT_FILTER_MS
from fieldbus.clock import MS, Scheduler, Timer
from fieldbus.errors import ConfigurationError, UnsupportedFaultError

if TYPE_CHECKING:
    import numpy as np

_FULL_SCALE: Final = 27648
_OVERFLOW: Final = 32767
_UNDERFLOW: Final = -32768
_OVERRANGE: Final = 32511
_UNDERRANGE: Final = -32512
_LONGEST_FILTER_MS: Final = 1000.0


class _DigitalChannel(ABC):
    """A digital channel, its terminal and the wire at it."""

    def __init__(self) -> None:
        self._stuck: bool | None = None
        self._broken = False

    def hold(self, level: bool | None) -> None:
        """Let the channel have a level whatever comes or is written; None: it works again."""
        self._stuck = level
        self._changed()

    def break_wire(self, broken: bool) -> None:
        """Break the wire, so that no level arrives at its end (an input reads 0); or repair it."""
        self._broken = broken
        self._changed()

    @abstractmethod
    def _changed(self) -> None:
        """Evaluate the level again."""


class DigitalInput(_DigitalChannel):
    """An input with a filter: a level counts when it has lasted for the filter time.

    Args:
        scheduler: Time.
        filter_ms: Filter time, ms, 0..1000; 0 for none.

    """

    def __init__(self, scheduler: Scheduler, filter_ms: float = INPUT_FILTER_MS) -> None:
        if not 0 <= filter_ms <= _LONGEST_FILTER_MS:
            raise ConfigurationError("digital input, filter_ms", filter_ms, f"0..{_LONGEST_FILTER_MS:g}")
        super().__init__()
        self._scheduler = scheduler
        self._filter_ns = round(filter_ms * MS)
        self._timer: Timer | None = None
        self.raw = False
        """Level from outside."""
        self.value = False
        """Level behind the filter."""

    @property
    def level(self) -> bool:
        """Level at the terminal: the level from outside, unless it is stuck or the wire is broken."""
        if self._stuck is not None:
            return self._stuck
        return self.raw and not self._broken

    def set(self, level: bool) -> None:
        """Bring a level."""
        if level != self.raw:
            self.raw = level
            self._changed()

    def _changed(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        level = self.level
        if level == self.value:
            return  # it was shorter than the filter
        if self._filter_ns:
            self._timer = self._scheduler.after(self._filter_ns, self._settle)
        else:
            self.value = level

    def _settle(self) -> None:
        self._timer = None
        self.value = self.level


class DigitalOutput(_DigitalChannel):
    """An output.

    Args:
        on_change: Called with every new level at the end of the wire.
        substitute: Level when the controller is lost; None keeps the last one.

    """

    def __init__(
        self, on_change: Callable[[bool], object] | None = None, *, substitute: bool | None = False
    ) -> None:
        super().__init__()
        self.on_change = on_change
        self.substitute = substitute
        self.value = False
        """What the controller has written."""
        self.level = False
        """Level at the end of the wire."""

    def set(self, level: bool) -> None:
        """Switch it."""
        if level != self.value:
            self.value = level
            self._changed()

    def _changed(self) -> None:
        level = (self.value if self._stuck is None else self._stuck) and not self._broken
        if level != self.level:
            self.level = level
            if self.on_change is not None:
                self.on_change(level)


class Disturbance:
    """What is wrong with an analog channel: offset, gain, noise, a value that stands, a broken wire.

    Args:
        rng: Source of the noise; None: the channel cannot be made noisy.

    """

    def __init__(self, rng: np.random.Generator | None = None) -> None:
        self._rng = rng
        self.offset = 0.0
        """In the unit of the channel."""
        self.gain = 1.0
        self.noise = 0.0
        """Largest deviation either way, in the unit of the channel."""
        self.stuck: float | None = None
        self.broken = False

    def set_noise(self, amplitude: float) -> None:
        """Disturb every sample by -amplitude..amplitude; 0: no more.

        Raises:
            UnsupportedFaultError: There is no source of randomness.

        """
        if amplitude and self._rng is None:
            raise UnsupportedFaultError("this analog channel has no source of noise")
        self.noise = amplitude

    def __call__(self, value: float) -> float:
        """Return what becomes of a value."""
        if self.broken:
            return 0.0
        if self.stuck is not None:
            return self.stuck
        value = value * self.gain + self.offset
        if self.noise and self._rng is not None:
            value += self.noise * (2.0 * float(self._rng.random()) - 1.0)
        return value


class AnalogInput:
    """An input with a range and a smoothing of first order.

    Args:
        scheduler: Time.
        low: Value of the quantity at the lower end of the range, in its unit (for 4..20 mA: 4).
        high: Value at the upper end.
        smoothing_ms: Time constant, ms; 0 for none.
        bipolar: Whether the range reaches from -high to high.
        wire_break_below: Value below which the wire counts as broken; None for never.
        rng: Source of noise, for faults.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        low: float = 0.0,
        high: float = 10.0,
        *,
        smoothing_ms: float = 0.0,
        bipolar: bool = False,
        wire_break_below: float | None = None,
        rng: np.random.Generator | None = None,
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
        self.disturbance = Disturbance(rng)
        """What is wrong with it."""
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
    def value(self) -> float:
        """The quantity that the converter sees, in its unit: smoothed, and disturbed."""
        return self.disturbance(self.smoothed)

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
        limit = self._wire_break
        return limit is not None and (self.disturbance.broken or self._target < limit)

    @property
    def word(self) -> int:
        """The value for the bus: 27648 is the end of the range; 32767 and
        -32768 are overflow and underflow.
        """
        if self.wire_broken:
            return _OVERFLOW
        scaled = round((self.value - self._low) / (self._high - self._low) * _FULL_SCALE)
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
        on_change: Called with the quantity at the end of the wire, whenever a word is written.
        rng: Source of noise, for faults.

    """

    def __init__(
        self,
        low: float = 0.0,
        high: float = 10.0,
        *,
        substitute: int | None = 0,
        on_change: Callable[[float], object] | None = None,
        rng: np.random.Generator | None = None,
    ) -> None:
        if not low < high:
            raise ConfigurationError("analog output, low and high", (low, high), "low < high")
        self._low = low
        self._high = high
        self.substitute = substitute
        self.on_change = on_change
        self.disturbance = Disturbance(rng)
        """What is wrong with it."""
        self.word = 0
        """What the controller has written."""

    def set(self, word: int) -> None:
        """Write a word."""
        if word != self.word or self.disturbance.noise:
            self.word = word
            self.refresh()

    def refresh(self) -> None:
        """Tell the end of the wire the present quantity."""
        if self.on_change is not None:
            self.on_change(self.level)

    @property
    def value(self) -> float:
        """The quantity that the word means, in its unit; words beyond the overrange give the end of it."""
        word = min(max(self.word, _UNDERRANGE), _OVERRANGE)
        return self._low + (self._high - self._low) * word / _FULL_SCALE

    @property
    def level(self) -> float:
        """The quantity at the end of the wire, in its unit: disturbed, with new noise at every call."""
        return self.disturbance(self.value)


class CounterInput:
    """A 32-bit counter of an incremental encoder.

    Args:
        read: Returns the count of the encoder, of any length.

    """

    def __init__(self, read: Callable[[], int] | None = None) -> None:
        self._read = read
        self._start = 0
        self._held: int | None = None
        self._stuck = self._broken = False

    def connect(self, read: Callable[[], int]) -> None:
        """Count what an encoder counts from now on."""
        self._start = self.count - read()
        self._read = read

    @property
    def count(self) -> int:
        """Present count, signed 32 bit."""
        if self._held is not None:
            return self._held
        value = self._start + (self._read() if self._read is not None else 0)
        return (value + 0x8000_0000 & 0xFFFF_FFFF) - 0x8000_0000

    def set(self, count: int) -> None:
        """Let the counter continue from a value."""
        self._start += count - self.count

    def restart(self) -> None:
        """Begin at 0, as after a loss of supply."""
        self.set(0)

    def hold(self, stuck: bool) -> None:
        """Let the count stand still; or continue from there: what has passed meanwhile is lost."""
        self._stuck = stuck
        self._settle()

    def break_wire(self, broken: bool) -> None:
        """Break the wire: the count stands still; or repair it."""
        self._broken = broken
        self._settle()

    def _settle(self) -> None:
        if self._stuck or self._broken:
            self._held = self.count
        elif self._held is not None:
            held, self._held = self._held, None
            self.set(held)
