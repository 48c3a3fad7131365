"""Another node that uses an identifier of this one (C301-125)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from fieldbus.can.frame import CanFrame
from fieldbus.clock import S, Scheduler, Timer

EMCY_COLLISION: Final = 0x8150

QUIET_NS: Final = 1 * S
"""The error ends when it has not occurred for this long, ns."""


class BusWatch:
    """Raises 8150h when another node sends with an identifier that this one sends with.

    Args:
        scheduler: Time.
        emcy: Raises an error by code.
        emcy_clear: Ends an error by code.

    """

    __slots__ = ("_emcy", "_emcy_clear", "_last_ns", "_scheduler", "_timer", "collisions")

    def __init__(
        self,
        scheduler: Scheduler,
        *,
        emcy: Callable[[int], object],
        emcy_clear: Callable[[int], object],
    ) -> None:
        self._scheduler = scheduler
        self._emcy = emcy
        self._emcy_clear = emcy_clear
        self._last_ns = 0
        self._timer: Timer | None = None
        self.collisions = 0
        """Frames of others with an identifier that this node sends."""

    def stop(self) -> None:
        """Forget everything, as at power-off and reset; the error ends with the reset."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def collision(self, _frame: CanFrame, time_ns: int) -> None:
        """Take a frame of another node with an own identifier."""
        self.collisions += 1
        self._last_ns = time_ns
        if self._timer is None:
            self._emcy(EMCY_COLLISION)
            self._timer = self._scheduler.at(max(time_ns + QUIET_NS, self._scheduler.now), self._due)

    def _due(self) -> None:
        due = self._last_ns + QUIET_NS
        if due > self._scheduler.now:
            self._timer = self._scheduler.at(due, self._due)
            return
        self._timer = None
        self._emcy_clear(EMCY_COLLISION)
