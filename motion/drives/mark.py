"""Search for the zero mark of an encoder: what a technology object asks of the device that evaluates it.

The device latches the position of the mark by itself, so that neither the bus cycle nor the time of reading
it out matters (HOM-066, HOM-077).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from fieldbus.profidrive.words import COMMAND_SHIFT, G_STW, G_ZSW

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
        self.confirmed = False
        """The device says that it searches; False where it never says so."""
        self.value = 0
        """Where the mark was passed, in the increments and the range of `encoder_increments`; once `found`.
        """

    def start(self) -> None:
        """Look for the next mark that is passed in any direction from now on."""
        self.searching = True
        self.found = self.failed = self.confirmed = False
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
    """The handshake of a function in Gx_STW and Gx_ZSW (§5.11.2; PD-141 to PD-187).

    The port puts `word` into Gx_STW while it is not 0, and gives every answer to `take` while `busy`.

    Args:
        function: Number of the function, 1 to 4.
        measures: It is one of measurement on the fly: 1 and 2 are the edges of probe 1, 3 and 4 of probe 2.

    """

    def __init__(self, function: int = 1, *, measures: bool = False) -> None:
        super().__init__()
        bit = 1 << function - 1
        self._idle = int(G_STW.MEASURE) if measures else 0
        """Word of a command that is over, while the function still has Gx_STW."""
        self._activate = self._idle | bit | 1 << COMMAND_SHIFT
        self._read = self._idle | bit | 2 << COMMAND_SHIFT
        self._cancel = self._idle | bit | 3 << COMMAND_SHIFT
        self._running = bit
        self._value = bit << 4
        self.may_begin: Callable[[TelegramMarkSearch], bool] | None = None
        """Returns whether it has Gx_STW; None: it has it alone."""
        self.phase = IDLE
        self.word = 0
        """Bits of Gx_STW for the next telegram."""
        self.busy = False
        """Answers are waited for."""
        self._age = 0
        self._attempts = 0

    def _begin(self) -> None:
        if self.phase is IDLE and (self.may_begin is None or self.may_begin(self)):
            self._attempts = 0
            self._go(ACTIVATING, self._activate)

    def begin_late(self) -> None:
        """Begin what had to wait for Gx_STW; harmless when nothing has."""
        if self.searching:
            self._begin()

    def _end(self) -> None:
        if self.phase in (ACTIVATING, SEARCHING, PAUSING, READING):
            self._go(CANCELLING, self._cancel)

    def _go(self, phase: int, word: int) -> None:
        self.phase = phase
        self.word = word
        self.busy = phase is not IDLE
        self.confirmed = phase is SEARCHING
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
            if zsw & self._running:
                self._go(SEARCHING, self._activate)
            elif self._age > _PATIENCE:
                self._go(PAUSING, self._idle)  # found before its beginning could be seen, or never begun
        elif phase is SEARCHING:
            if not zsw & self._running:
                self._go(PAUSING, self._idle)  # a value is read from rest only (PD-150)
        elif phase is PAUSING:
            if self._age >= _HOLD:
                self._attempts += 1
                self._go(READING, self._read)
        elif phase is READING:
            if zsw & self._value:
                self._finish(xist2)
                self._go(CLOSING, self._idle)
            elif self._age > _PATIENCE:
                again = self._attempts < _ATTEMPTS
                self._go(PAUSING if again else CANCELLING, self._idle if again else self._cancel)
        elif phase is CLOSING:
            if not zsw & self._value:
                self._rest()
        elif phase is CANCELLING and self._age >= _HOLD and not zsw & self._running:
            self._rest()


class TelegramSearches:
    """The searches of one encoder in a telegram: one at a time has Gx_STW, others wait for it.

    Args:
        probes: Probes of the device, whose edges it can latch; 0, 1 or 2.

    """

    def __init__(self, probes: int = 0) -> None:
        self.mark = TelegramMarkSearch()
        """Search for the zero mark."""
        self.probes: tuple[tuple[MarkSearch, MarkSearch], ...] = ()
        """Searches for the rising and the falling edge of every probe."""
        edges = [TelegramMarkSearch(function, measures=True) for function in range(1, 2 * probes + 1)]
        self.probes = tuple((edges[at], edges[at + 1]) for at in range(0, 2 * probes, 2))
        self.current = self.mark
        """The one that has Gx_STW."""
        self._all = (self.mark, *edges)
        if edges:
            for one in self._all:
                one.may_begin = self._may_begin

    def _may_begin(self, search: TelegramMarkSearch) -> bool:
        if search is not self.current and self.current.busy:
            return False
        self.current = search
        return True

    def take(self, zsw: int, xist2: int) -> None:
        """Take over Gx_ZSW and Gx_XIST2 of an answer, while `current` is busy."""
        self.current.take(zsw, xist2)
        if not self.current.busy:
            for one in self._all:
                if one.searching:
                    one.begin_late()
                    break


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
