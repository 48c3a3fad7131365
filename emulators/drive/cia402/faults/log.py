"""History of faults with their time, kept over power-off (manufacturer objects 2104h to 2107h)."""

from __future__ import annotations

from collections import deque
from typing import Final, NamedTuple

from fieldbus.clock import MS, Scheduler

CAPACITY: Final = 16
"""Faults that are remembered."""


class LoggedFault(NamedTuple):
    """One fault of the past."""

    code: int
    """Code as sent in the EMCY."""
    state: int
    """`DriveState` in which it struck."""
    mode: int
    """Mode of operation then."""
    time_ms: int
    """Operating time then, ms."""


class FaultLog:
    """The last faults, newest first, and the operating time of the drive.

    Args:
        scheduler: Time.

    """

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._before_ns = 0
        self._since_ns: int | None = None
        self.entries: deque[LoggedFault] = deque(maxlen=CAPACITY)
        """Newest first."""

    @property
    def operating_ms(self) -> int:
        """Time under power since the drive was built, ms."""
        running = 0 if self._since_ns is None else self._scheduler.now - self._since_ns
        return (self._before_ns + running) // MS

    def power(self, on: bool) -> None:
        """Let the operating time run, or stop it."""
        if on:
            if self._since_ns is None:
                self._since_ns = self._scheduler.now
        elif self._since_ns is not None:
            self._before_ns += self._scheduler.now - self._since_ns
            self._since_ns = None

    def add(self, code: int, state: int, mode: int) -> None:
        """Remember a fault that strikes now."""
        self.entries.appendleft(LoggedFault(code, state, mode, self.operating_ms))

    def clear(self) -> None:
        """Forget all faults; the operating time stays."""
        self.entries.clear()

    def packed(self, number: int) -> int:
        """Return entry `number` (0 = newest) as bits 15..0 code, 23..16 state,
        31..24 mode; 0 = there is none.
        """
        if number >= len(self.entries):
            return 0
        entry = self.entries[number]
        return entry.code | entry.state << 16 | (entry.mode & 0xFF) << 24

    def time_ms(self, number: int) -> int:
        """Return the operating time of entry `number`, ms, 32 bits; 0 = there is none."""
        return self.entries[number].time_ms & 0xFFFFFFFF if number < len(self.entries) else 0
