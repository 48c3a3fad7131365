"""Search for the zero mark of an encoder: what a technology object asks of the device that evaluates it.

The device latches the position of the mark by itself, so that neither the bus cycle nor the time of reading
it out matters (HOM-066, HOM-077).
"""

from __future__ import annotations

from typing import Final

from fieldbus.profidrive.words import COMMAND_SHIFT, G_STW, G_ZSW

_FUNCTION: Final = int(G_STW.FUNCTION_1)
_ACTIVATE: Final = _FUNCTION | 1 << COMMAND_SHIFT
_READ: Final = _FUNCTION | 2 << COMMAND_SHIFT
_CANCEL: Final = _FUNCTION | 3 << COMMAND_SHIFT
_RUNNING: Final = int(G_ZSW.FUNCTION_1)
_VALUE: Final = int(G_ZSW.VALUE_1)
_ERROR: Final = int(G_ZSW.ERROR)
_PATIENCE: Final = 16
"""Cycles without the expected answer after which the search is begun again: a telegram, or the device, may
have been lost.
"""
_HOLD: Final = 4
"""Cycles for which a command without an answer is sent at least: another one may still be on its way."""
_ATTEMPTS: Final = 3
"""How often reading is tried before the search is begun again."""

IDLE, ACTIVATING, SEARCHING, PAUSING, READING, CLOSING, CANCELLING = range(7)


class MarkSearch:
    """One search for a zero mark; `start` it, and look every cycle."""

    def __init__(self) -> None:
        self.supported = True
        """The device can search, as far as is known."""
        self.searching = False
        """Started, and neither found nor failed nor cancelled."""
        self.found = False
        self.failed = False
        """The device has ended the search with an error."""
        self.value = 0
        """Where the mark was passed, in the increments and the range of `encoder_increments`; once `found`.
        """

    def start(self) -> None:
        """Look for the next mark that is passed in any direction from now on."""
        self.searching = True
        self.found = self.failed = False
        self._begin()

    def cancel(self) -> None:
        """Look no more; harmless when nothing is looked for."""
        if self.searching:
            self.searching = False
            self._end()

    def _begin(self) -> None:
        raise NotImplementedError

    def _end(self) -> None:
        raise NotImplementedError

    def _finish(self, value: int) -> None:
        if self.searching:
            self.searching = False
            self.found = True
            self.value = value

    def _fail(self) -> None:
        if self.searching:
            self.searching = False
            self.failed = True


class TelegramMarkSearch(MarkSearch):
    """The handshake of function 1 in Gx_STW and Gx_ZSW (§5.11.2; PD-141 to PD-187).

    The port puts `word` into Gx_STW while it is not 0, and gives every answer to `take` while `busy`.
    """

    def __init__(self) -> None:
        super().__init__()
        self.phase = IDLE
        self.word = 0
        """Bits of Gx_STW for the next telegram."""
        self.busy = False
        """Answers are waited for."""
        self._age = 0
        self._attempts = 0

    def _begin(self) -> None:
        if self.phase is IDLE:
            self._attempts = 0
            self._go(ACTIVATING, _ACTIVATE)

    def _end(self) -> None:
        if self.phase in (ACTIVATING, SEARCHING, PAUSING, READING):
            self._go(CANCELLING, _CANCEL)

    def _go(self, phase: int, word: int) -> None:
        self.phase = phase
        self.word = word
        self.busy = phase is not IDLE
        self._age = 0

    def _rest(self) -> None:
        self._go(IDLE, 0)
        if self.searching:
            self._begin()

    def take(self, zsw: int, xist2: int) -> None:
        """Take over Gx_ZSW and Gx_XIST2 of an answer.

        Args:
            zsw: 0..FFFFh.
            xist2: 32 bits, in the resolution of Gx_XIST1.

        """
        self._age += 1
        if zsw & _ERROR:
            self._fail()
            self._go(IDLE, 0)
            return
        phase = self.phase
        if phase is ACTIVATING:
            if zsw & _RUNNING:
                self._go(SEARCHING, _ACTIVATE)
            elif self._age > _PATIENCE:
                self._go(PAUSING, 0)  # found before its beginning could be seen, or never begun
        elif phase is SEARCHING:
            if not zsw & _RUNNING:
                self._go(PAUSING, 0)  # a value is read from rest only (PD-150)
        elif phase is PAUSING:
            if self._age >= _HOLD:
                self._attempts += 1
                self._go(READING, _READ)
        elif phase is READING:
            if zsw & _VALUE:
                self._finish(xist2)
                self._go(CLOSING, 0)
            elif self._age > _PATIENCE:
                again = self._attempts < _ATTEMPTS
                self._go(PAUSING if again else CANCELLING, 0 if again else _CANCEL)
        elif phase is CLOSING:
            if not zsw & _VALUE:
                self._rest()
        elif phase is CANCELLING and self._age >= _HOLD and not zsw & _RUNNING:
            self._rest()


class IdealMarkSearch(MarkSearch):
    """A search that needs no device: the code that moves the encoder says what it passes.

    Args:
        places: Zero marks, in the increments of `encoder_increments`.

    """

    def __init__(self, *places: int) -> None:
        super().__init__()
        self.places = places

    def _begin(self) -> None:
        """Do nothing: an ideal drive needs no command."""

    def _end(self) -> None:
        """Do nothing: an ideal drive needs no command."""

    def pass_by(self, before: float, after: float) -> None:
        """Take note of a motion from one count to another."""
        if not self.searching or before == after:
            return
        low, high = min(before, after), max(before, after)
        passed = [place for place in self.places if low < place <= high]
        if passed:
            self._finish(min(passed) if after > before else max(passed))
