"""What instructions with a level at `Enable` have in common (MC-082 to MC-085, MC-124)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from motion.s7.axis.jobs import NO_ERROR
from motion.s7.instructions.base import Instruction

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis


class EnableInstruction(Instruction):
    """Level-controlled: active while `Enable` is TRUE, from an edge on; no job aborts
    it (MC-082 to MC-085, MC-124).
    """

    Enable: bool

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: float) -> None:
        self._active = False
        self._last_enable = False
        super().__init__(axis, name=name, **inputs)

    def _begin(self) -> int:
        """Return the ErrorID of what prevents the start, 0 if nothing does."""
        raise NotImplementedError

    def _update(self) -> int:
        """Take the inputs over; returns the ErrorID of one that is not permitted."""
        raise NotImplementedError

    def _end(self) -> int:
        """End the function; returns the ErrorID of what keeps it active."""
        raise NotImplementedError

    def _call(self) -> None:
        enable = bool(self.Enable)
        rising = enable and not self._last_enable
        self._last_enable = enable
        if rising:
            self.Error = False
            self.ErrorID = NO_ERROR
            # An instance whose end was refused (clamped axis) is still active and continues.
            error = NO_ERROR if self._active else self._refused() or self._begin()
            if error:
                self._fail(error)
                return
            self._active = True
        if enable and self._active:
            error = self._update()
            if error:
                self._fail(error)
                if self._end() == NO_ERROR:
                    self._active = False
                return
        elif self._active:
            error = self._end()
            if error:
                self._fail(error)
                return
            self._active = False
        if not enable:
            self.Error = False
            self.ErrorID = NO_ERROR
        self.Busy = enable and self._active and not self.Error

    def _fail(self, error_id: int) -> None:
        if not self.Error:
            self._log_rejection(error_id)
        self.Busy = False
        self.Error = True
        self.ErrorID = error_id
