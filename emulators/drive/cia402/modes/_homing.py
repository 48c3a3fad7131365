"""Homing mode, methods without motion: 35 and 37 (C402-127, C402-129, C402-130, C402-134, C402-135, C402-138)."""

from __future__ import annotations

from collections.abc import Callable

from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.modes._base import BIT_10, BIT_12, BIT_13, ModeOfOperation

_NOT_STARTED = BIT_10
_FINISHED = BIT_10 | BIT_12
_ERROR = BIT_10 | BIT_13


class Homing(ModeOfOperation):
    """hm: a rising edge of bit 4 makes the present position the home point."""

    __slots__ = ("_result", "on_homed")

    number = 6

    def __init__(self, axis: ProfileAxis) -> None:
        super().__init__(axis)
        self._result = _NOT_STARTED
        self.on_homed: Callable[[bool], None] | None = None
        """Called after every start, with the success."""

    def enter(self) -> None:
        """See `ModeOfOperation.enter`."""
        super().enter()
        self._result = self.status = _NOT_STARTED

    def control(self, word: int, changed: int) -> None:
        """Start with a rising edge of bit 4."""
        axis = self.axis
        if axis.halted or not word & changed & 0x10:
            return
        success = axis.values[0x609800] in (35, 37)
        if success:
            offset = axis.values[0x607C00]
            axis.set_actual_position(offset if axis.config.home_offset == "vendor" else -offset)
            axis.homed = True
        self._result = _FINISHED if success else _ERROR
        if self.on_homed is not None:
            self.on_homed(success)

    def cycle(self) -> None:
        """See `ModeOfOperation.cycle`."""
        self.status = self._result

    def stopped(self) -> None:
        """See `ModeOfOperation.stopped`."""
        self.status = self._result
