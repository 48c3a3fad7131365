"""Pulse generator: frequency ramps and the exact count of pulses at any instant (PTO-291).

Between two commands the frequency is a list of pieces with constant slope, so that count and time of a pulse
are calculated, not sampled.
"""

from __future__ import annotations

import math
from typing import Final

from emulators.drive.pto_settings import Signals
from emulators.io.tm_pto.config import FREQUENCY_MIN_HZ
from fieldbus.clock import S

_SLACK: Final = 1e-6
"""Share of a pulse by which rounding may miss one that is due."""


class PulseGenerator:
    """Counts its output pulses. Positive frequencies count up.

    Args:
        pause_ns: No pulses for this time between two directions.
        count: First value of the count.

    """

    def __init__(self, *, pause_ns: int = 0, count: int = 0) -> None:
        self._pause = pause_ns
        self._now = 0
        self._x = float(count)
        self._pieces: list[tuple[int, float, float]] = []  # ns, slope in Hz/s, frequency at the end
        self._target = 0.0
        self._slope = 0.0
        self._direction = 0
        self._still_since = 0
        self.count = count
        """Output pulses, with their sign, since power-on, not wrapped."""
        self.frequency = 0.0
        """Present frequency, Hz, with its sign."""

    @property
    def negative(self) -> bool:
        """Whether the direction is negative: level of the terminal D."""
        return self._direction < 0

    @property
    def acceleration(self) -> float:
        """Present slope of the frequency, Hz/s."""
        return self._pieces[0][1] if self._pieces else 0.0

    def advance(self, now_ns: int) -> None:
        """Go on to a time, not before the last one."""
        left = now_ns - self._now
        while self._pieces and left > 0:
            duration, slope, end = self._pieces[0]
            took = min(left, duration)
            if took < duration:
                end = self.frequency + slope * (took / S)
                self._pieces[0] = (duration - took, slope, self._pieces[0][2])
            else:
                del self._pieces[0]
            self._move(0.5 * (self.frequency + end) * (took / S))
            self.frequency = end
            left -= took
            self._now += took
            if end == 0.0:
                self._still_since = self._now
        if left > 0:
            if self.frequency:
                self._move(self.frequency * (left / S))
            self._now = now_ns

    def steer(self, now_ns: int, target_hz: float, slope: float) -> None:
        """Ramp to a frequency; below 0.1 Hz that is none (PTO-167).

        Args:
            now_ns: Present time.
            target_hz: Frequency with its sign.
            slope: Hz/s, > 0.

        """
        self.advance(now_ns)
        if abs(target_hz) < FREQUENCY_MIN_HZ:
            target_hz = 0.0
        if (target_hz, slope) == (self._target, self._slope):
            return
        self._target, self._slope = target_hz, slope
        pieces = []
        at = self.frequency
        turn = 1 if target_hz > 0.0 else -1
        if target_hz and at * turn <= 0.0:
            if at:
                pieces.append(_ramp(at, 0.0, slope))
                rest = self._pause
            else:
                rest = self._pause - (now_ns - self._still_since)
            if rest > 0 and self._direction == -turn:
                pieces.append((rest, 0.0, 0.0))
            at = 0.0
        if at != target_hz:
            pieces.append(_ramp(at, target_hz, slope))
        self._pieces = pieces

    def halt(self, now_ns: int) -> None:
        """Stop at once, without a ramp."""
        self.advance(now_ns)
        if self.frequency:
            self._still_since = now_ns
        self._pieces = []
        self.frequency = self._target = self._slope = 0.0

    def time_of(self, count: int) -> int | None:
        """Return when the count becomes `count` if nothing else is commanded, ns; None: it does not."""
        if count == self.count:
            return self._now
        x, frequency, at = self._x, self.frequency, self._now
        for duration, slope, end in self._pieces:
            way = 0.5 * (frequency + end) * (duration / S)
            # A piece is monotone: it passes the place if its ends lie on both sides.
            if way and min(x, x + way) <= count <= max(x, x + way) and (way > 0.0) is (count > self.count):
                return at + math.ceil(_solve(count - x, frequency, slope, duration / S) * S)
            x, frequency, at = x + way, end, at + duration
        if frequency and (frequency > 0.0) is (count > self.count) and (count - x) * frequency >= 0.0:
            return at + math.ceil((count - x) / frequency * S)
        return None

    def levels(self, signals: Signals) -> tuple[bool, bool]:
        """Return the levels of both pulse terminals now."""
        phase = self._x % 1.0
        if signals == "pulse_direction":
            return bool(self.frequency) and phase < 0.5, self.negative
        if signals == "up_down":
            pulse = bool(self.frequency) and phase < 0.5
            return pulse and not self.negative, pulse and self.negative
        quarter = self.count % 4 if signals == "ab_fourfold" else int(phase * 4.0)
        return quarter in {1, 2}, quarter in {2, 3}

    def _move(self, way: float) -> None:
        """Count the whole pulses on a way in one direction; a reversal needs a whole pulse to count back."""
        self._x += way
        if way > 0.0:
            self._direction = 1
            self.count = max(self.count, math.floor(self._x + _SLACK))
        elif way < 0.0:
            self._direction = -1
            self.count = min(self.count, math.ceil(self._x - _SLACK))


def _ramp(start: float, end: float, slope: float) -> tuple[int, float, float]:
    duration = max(1, round(abs(end - start) / slope * S))
    return duration, (end - start) / (duration / S), end


def _solve(way: float, frequency: float, slope: float, longest: float) -> float:
    """Return after which time, s, a way has been gone with a linear frequency."""
    if slope == 0.0:
        return way / frequency
    root = math.sqrt(max(0.0, frequency * frequency + 2.0 * slope * way))
    divisor = frequency + math.copysign(root, way)
    return min(longest, max(0.0, 2.0 * way / divisor)) if divisor else longest
