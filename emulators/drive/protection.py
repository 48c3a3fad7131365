"""Conditions that a drive watches and that count only after a time."""

from __future__ import annotations


class WindowTimer:
    """A condition that counts only after it has held for a time.

    Args:
        time_s: How long the condition has to hold, s; 0 = at once.

    """

    def __init__(self, time_s: float = 0.0) -> None:
        self.time_s = time_s
        self._elapsed = 0.0
        self.expired = False
        """Whether the condition has held long enough at the last update."""

    def update(self, condition: bool, dt_s: float) -> bool:
        """Advance by `dt_s` and return whether the condition has held for the time."""
        if not condition:
            self._elapsed = 0.0
            self.expired = False
        elif not self.expired:
            # The time starts with the first update that sees the condition; half a step absorbs rounding.
            self.expired = self._elapsed + 0.5 * dt_s >= self.time_s
            self._elapsed += dt_s
        return self.expired

    def reset(self) -> None:
        """Start again."""
        self._elapsed = 0.0
        self.expired = False
