"""`MC_SaveAbsoluteEncoderData` (section 2.15 of the instruction specification)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

from motion.s7.axis.jobs import ERROR_CARD_WRITE, ERROR_SAVE_INSTANCES, ERROR_SAVE_RUNNING, NO_ERROR

if TYPE_CHECKING:
    from collections.abc import Sequence

    from motion.s7.axis import ExternalEncoder, TechnologyAxis
    from motion.s7.memory_card import MemoryCard

_INSTANCES = 2


class SavingController(Protocol):
    """What the instruction asks of its controller."""

    card: MemoryCard | None
    """The memory card; None = there is none."""
    saver: object | None
    """The instance whose save runs."""

    @property
    def objects(self) -> Sequence[TechnologyAxis | ExternalEncoder]:
        """All technology objects."""

    def count_saver(self) -> int:
        """Return the number of one more instance of the instruction, from 1 on."""


class MC_SaveAbsoluteEncoderData:
    """Save the adjustment of all absolute encoders of the controller to its memory card.

    Input: `Execute`. Outputs: `Done`, `Busy`, `Error`, `ErrorID`. It has no axis; two instances may exist,
    one save runs at a time and takes a cycle.

    Args:
        runtime: The controller.

    """

    instruction = "MC_SaveAbsoluteEncoderData"

    def __init__(self, runtime: SavingController, *, Execute: bool = False) -> None:
        self._runtime = runtime
        self._last = False
        self._number = runtime.count_saver()
        self.Execute = Execute
        self.Done = self.Busy = self.Error = False
        self.ErrorID = NO_ERROR

    def __call__(self, Execute: bool | None = None) -> None:
        """Call the instance once."""
        if Execute is not None:
            self.Execute = Execute
        rising = self.Execute and not self._last
        self._last = bool(self.Execute)
        runtime = self._runtime
        if rising and not self.Busy:
            self.Done = self.Error = False
            self.ErrorID = NO_ERROR
            if self._number > _INSTANCES:
                self._fail(ERROR_SAVE_INSTANCES)
            elif runtime.saver is not None:
                self._fail(ERROR_SAVE_RUNNING)
            elif runtime.card is None:
                self._fail(ERROR_CARD_WRITE)
            else:
                runtime.saver = self
                self.Busy = True
        elif self.Busy:
            runtime.saver = None
            self.Busy = False
            card = runtime.card
            error = ERROR_CARD_WRITE if card is None else card.save(runtime.objects)
            if error:
                self._fail(error)
            else:
                self.Done = True
        elif not self.Execute:
            self.Done = self.Error = False
            self.ErrorID = NO_ERROR

    def warm_restart(self) -> None:
        """Start again after a warm restart of the controller: nothing runs,
        outputs are as at the beginning.
        """
        self._last = False
        self.Execute = self.Done = self.Busy = self.Error = False
        self.ErrorID = NO_ERROR

    def _fail(self, error_id: int) -> None:
        self.Error = True
        self.ErrorID = error_id

    def done(self) -> bool:
        """Return `Done`."""
        return self.Done

    def error(self) -> bool:
        """Return `Error`."""
        return self.Error

    def ended(self) -> bool:
        """Return whether it has ended, one way or another."""
        return self.Done or self.Error
