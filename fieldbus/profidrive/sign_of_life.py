"""Sign of life: the 4-bit counters with which controller and drive show each other
that they work (PD-123 to PD-132).
"""

from __future__ import annotations

from enum import Enum
from typing import Final

from fieldbus.errors import ConfigurationError

CYCLES_TO_SYNCHRONISE: Final = 16
"""Correct values in a row that make a counter synchronous (PD-125)."""
UNMONITORED: Final = 65_535
"""PNU 925: the sign of life is not monitored (PD-128)."""
_FAILURE: Final = 10
_HIGHEST: Final = 15


def next_sign(value: int) -> int:
    """Return the value after `value`: 1..15, then 1 again; 0 stands for "not running" (PD-123)."""
    return value + 1 if 0 <= value < _HIGHEST else 1


class SignState(Enum):
    """How far the drive is with the counter of its controller (PD-125)."""

    IDLE = "idle"
    COUNTING = "counting"
    ANSWERING = "answering"
    SYNCHRONISED = "synchronised"


_IDLE: Final = SignState.IDLE
_SYNCHRONISED: Final = SignState.SYNCHRONISED


class SignOfLife:
    """The drive's side: follows the counter of the controller, and produces its own.

    Call `step` once per bus cycle with the counter that has come; `value` is then what the drive sends.

    Args:
        tolerance: PNU 925, tolerated failures, 0..65535; 65535 = not monitored.
        factor: Bus cycles in an application cycle of the controller (CACF), for which its counter stands
            still; >= 1.

    Raises:
        ConfigurationError: An argument is out of its range.

    """

    def __init__(self, *, tolerance: int = 1, factor: int = 1) -> None:
        if not 0 <= tolerance <= UNMONITORED:
            raise ConfigurationError("sign of life tolerance (PNU 925)", tolerance, "0..65535")
        if factor < 1:
            raise ConfigurationError("application cycles of the controller", factor, "1 or more")
        self.tolerance = tolerance
        self._prescale = factor
        self.failures = 0
        """Wrong values since construction."""
        self.reset()

    def reset(self) -> None:
        """Begin again as after power-on."""
        self.state = SignState.IDLE
        self.value = 0
        """Counter of the drive, 0 until it answers (PD-126)."""
        self.counter = 0
        """Failure counter: a wrong cycle adds 10, a right one takes 1 away (PD-127)."""
        self._expected = 0
        self._left = 0
        self._good = 0

    @property
    def synchronised(self) -> bool:
        """Whether isochronous operation may begin (PD-131)."""
        return self.state is _SYNCHRONISED or self.tolerance == UNMONITORED

    def step(self, received: int) -> bool:
        """Take the controller's counter of this cycle; return whether the sign of
        life has just failed (PD-129).

        Args:
            received: Bits 12..15 of the control word, 0..15.

        """
        state = self.state
        if state is _IDLE:
            self._begin(received)
            return False
        self._left -= 1
        if self._left == 0:
            self._left = self._prescale
            before = self._expected
            self._expected = before + 1 if 0 <= before < _HIGHEST else 1
        right = received == self._expected
        if state is not _SYNCHRONISED:
            if not right:
                self.reset()
                self._begin(received)
            else:
                self._advance()
            return False
        value = self.value
        self.value = value + 1 if 0 <= value < _HIGHEST else 1
        if right:
            if self.counter:
                self.counter -= 1
            return False
        self.failures += 1
        if self.tolerance == UNMONITORED:
            return False
        self.counter += _FAILURE
        if self.counter <= _FAILURE * self.tolerance:
            return False
        self.reset()
        return True

    def _begin(self, received: int) -> None:
        """Wait for the first change of the counter."""
        if received and self._expected and received == next_sign(self._expected):
            self.state = SignState.COUNTING
            self._left = self._prescale
            self._good = 0
        self._expected = received

    def _advance(self) -> None:
        if self._left == self._prescale:
            self._good += 1
        if self.state is SignState.ANSWERING:
            self.value = next_sign(self.value)
        if self._good < CYCLES_TO_SYNCHRONISE:
            return
        self._good = 0
        if self.state is SignState.COUNTING:
            self.state = SignState.ANSWERING
        else:
            self.state = SignState.SYNCHRONISED


class SignWatch:
    """The controller's side: notices a drive whose counter stands still or jumps (PD-132).

    Args:
        tolerance: Wrong values in a row that are tolerated, 0 or more.

    """

    def __init__(self, *, tolerance: int = 3) -> None:
        self.tolerance = tolerance
        self.reset()

    def reset(self) -> None:
        """Forget what was received."""
        self._before = 0
        self._wrong = 0

    def step(self, received: int) -> bool:
        """Take the drive's counter of this cycle; return whether its sign of life is good.

        A drive that has not begun to count (0) is not judged.
        """
        if received == 0 and self._before == 0:
            return True
        right = self._before == 0 or received == next_sign(self._before)
        self._before = received
        self._wrong = 0 if right else self._wrong + 1
        return self._wrong <= self.tolerance
