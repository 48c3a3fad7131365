"""The setpoints that wait for interpolated position mode: 60C1h and 60C4h (C402-172)."""

from __future__ import annotations

from typing import Final

FIFO: Final = 0
RING: Final = 1
MAXIMUM: Final = 16
"""60C4h:1: most setpoints that can wait."""


class InterpolationBuffer:
    """Positions in the order in which they are to be reached.

    While access is disabled (60C4h:6 = 0) the data record itself is the buffer: one place, and a new
    setpoint takes that of one that still waits. Enabled, there are as many places as 60C4h:2 says. A full
    first-in-first-out buffer refuses a setpoint; a full ring gives the place of the oldest to it.
    """

    def __init__(self) -> None:
        self.enabled = False
        self.size = 1
        """60C4h:2."""
        self.organisation = FIFO
        """60C4h:3."""
        self.write = 0
        """60C4h:4: place that the next setpoint takes."""
        self._places = [0] * MAXIMUM
        self._read = 0
        self._waiting = 0

    def __len__(self) -> int:
        return self._waiting

    def clear(self) -> None:
        """Forget all setpoints."""
        self.write = self._read = self._waiting = 0

    def configure(self, *, size: int, organisation: int, enabled: bool) -> None:
        """Take 60C4h:2, :3 and :6; the buffer is empty afterwards.

        Args:
            size: Places, 1..`MAXIMUM`.
            organisation: `FIFO` or `RING`.
            enabled: Whether setpoints queue up.

        """
        self.size = size
        self.organisation = organisation
        self.enabled = enabled
        self.clear()

    def put(self, position: int) -> bool:
        """Add a setpoint; returns False when the buffer is full."""
        if not self.enabled:
            self._places[0] = position
            self._read = self.write = 0
            self._waiting = 1
            return True
        if self._waiting == self.size:
            if self.organisation == FIFO:
                return False
            self._read = (self._read + 1) % self.size
            self._waiting -= 1
        self._places[self.write] = position
        self.write = (self.write + 1) % self.size
        self._waiting += 1
        return True

    def take(self) -> int | None:
        """Return the next setpoint and give its place free; None when none waits."""
        if not self._waiting:
            return None
        position = self._places[self._read]
        self._waiting -= 1
        if self.enabled:
            self._read = (self._read + 1) % self.size
        return position

    def go_to(self, place: int) -> None:
        """Put the next setpoint at a place of the ring; those from there on are given up."""
        if self._waiting:
            kept = (place - self._read) % self.size
            self._waiting = min(self._waiting, kept)
        else:
            self._read = place
        self.write = (self._read + self._waiting) % self.size
