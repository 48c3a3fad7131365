"""What is wrong with the drive now: fault situation, reactions, lasting causes,
warnings (PD-115, PD-133 to PD-139).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, Protocol

from emulators.drive.profidrive.faults.buffer import FaultBuffer, FaultMessage
from emulators.drive.profidrive.faults.catalogue import Acknowledgement, DriveWarning, Fault, fault
from emulators.drive.profidrive.statemachine import Off
from fieldbus.clock import MS, Scheduler

Listener = Callable[[Fault, int], None]
_WORD: Final = 0xFFFF


class RaiseFault(Protocol):
    """Raises a fault of a drive."""

    def __call__(
        self, code: int, *, value: int = 0, persistent: bool = False, reaction: Off | None = None
    ) -> None:
        """Raise a fault; see `ProfidriveDrive.raise_fault`."""


class FaultState:
    """Faults and warnings of an axis.

    Args:
        scheduler: Time of the entries.

    """

    def __init__(self, scheduler: Scheduler) -> None:
        self._scheduler = scheduler
        self._since_ns = 0
        self._causes: dict[int, Callable[[], bool]] = {}
        self.buffer = FaultBuffer()
        self.off = 0
        """Stop commands of the present situation, bits of `Off`."""
        self.warnings: dict[int, None] = {}
        """Present warnings by number, oldest first."""
        self.on_fault: Listener = _nothing
        """Called with a new fault and its value."""
        self.on_acknowledged: Callable[[], None] = _nobody
        """Called when a situation has been acknowledged."""
        self.pulses: Callable[[], bool] = _no
        """Says whether there are pulses: some faults cannot be acknowledged then."""
        self.on_warning: Callable[[], None] = _nobody
        """Called when the warnings have changed."""
        self.fault_codes: Mapping[int, int] = {}
        """Number of a fault -> what FAULT_CODE shows in its place, for drives of another make."""
        self.warning_codes: Mapping[int, int] = {}
        """Number of a warning -> what WARN_CODE shows in its place."""

    @property
    def present(self) -> bool:
        """Whether there is a fault (ZSW1 bit 3)."""
        return bool(self.buffer.current)

    @property
    def number(self) -> int:
        """Number of the oldest present fault, 0 = none (PD-043)."""
        messages = self.buffer.current
        return messages[0].number if messages else 0

    @property
    def warning_number(self) -> int:
        """Number of the oldest present warning, 0 = none (PD-043)."""
        warnings = self.warnings
        return next(iter(warnings)) if warnings else 0

    @property
    def fault_code(self) -> int:
        """FAULT_CODE: the oldest present fault by the numbers of this make, 0 = none."""
        number = self.number
        return self.fault_codes.get(number, number)

    @property
    def warning_code(self) -> int:
        """WARN_CODE: the oldest present warning by the numbers of this make, 0 = none."""
        number = self.warning_number
        return self.warning_codes.get(number, number)

    def restart(self) -> None:
        """Begin as after power-on: what was there goes into the history; causes last."""
        self._since_ns = self._scheduler.now
        self.buffer.acknowledge()
        self.off = 0
        self.warnings.clear()

    def enter(self, row: Fault, value: int = 0, *, reaction: Off | None = None) -> bool:
        """Enter a fault into the present situation; returns whether it is new there."""
        off = int(row.reaction if reaction is None else reaction)
        time_ms = (self._scheduler.now - self._since_ns) // MS
        message = FaultMessage(row.number, value & 0xFFFFFFFF, time_ms, row.emcy & _WORD)
        if not self.buffer.enter(message):
            return False
        self.off |= off
        self.on_fault(row, value)
        return True

    def keep(self, number: int, holds: Callable[[], bool]) -> None:
        """Set the check whether the cause of a fault is still there when it is acknowledged."""
        self._causes[number] = holds

    def forget(self, number: int | None = None) -> None:
        """End the lasting cause of a fault, or of all."""
        if number is None:
            self._causes.clear()
        else:
            self._causes.pop(number, None)

    def acknowledge(self) -> bool:
        """Acknowledge the situation; returns whether there was one.

        What lasts opens a new one at once (PD-137), and so does what cannot be acknowledged now (PD-139).
        """
        before = self.buffer.present
        if not self.buffer.acknowledge():
            return False
        self.off = 0
        self.on_acknowledged()
        for message in before:
            how = fault(message.number).acknowledgement
            if how is Acknowledgement.POWER_ON or (how is Acknowledgement.PULSE_INHIBIT and self.pulses()):
                self.enter(fault(message.number), message.value)
                continue
            holds = self._causes.get(message.number)
            if holds is None:
                continue
            if holds():
                self.enter(fault(message.number), message.value)
            else:
                del self._causes[message.number]
        return True

    def warn(self, number: int, present: bool) -> None:
        """Show a warning, or take it back (PD-138)."""
        if present is (number in self.warnings):
            return
        if present:
            self.warnings[int(number)] = None
        else:
            del self.warnings[number]
        self.on_warning()

    def warns(self, warning: DriveWarning) -> bool:
        """Return whether a warning is there."""
        return int(warning) in self.warnings


def _nothing(_fault: Fault, _value: int) -> None:
    pass


def _no() -> bool:
    return False


def _nobody() -> None:
    pass
