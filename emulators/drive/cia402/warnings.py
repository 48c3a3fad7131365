"""Warnings of the drive: bit 7 of the status word, 1002h and 2100h (C402-041)."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntFlag

from emulators.events import Emit
from fieldbus.canopen.slave import CanopenSlave


class DriveWarning(IntFlag):
    """Causes of bit 7 of the status word: 1002h and 2100h."""

    MOTOR_OVERLOAD = 1 << 0
    """i2t of the motor within 5 % of its end."""
    STAGE_OVERLOAD = 1 << 1
    MOTOR_TEMPERATURE = 1 << 2
    STAGE_TEMPERATURE = 1 << 3
    CHOPPER_LOAD = 1 << 4
    """Brake resistor above 80 % of its continuous power, or switched off."""
    MAINS_MISSING = 1 << 5
    PHASE_MISSING = 1 << 6
    DC_LINK_LOW = 1 << 7
    TORQUE_OFF = 1 << 8
    """Safe torque off is in effect."""
    SAFE_STOP = 1 << 9
    """Safe stop 1 is under way."""
    INTERLOCK_OPEN = 1 << 10
    DERATED = 1 << 11
    """The torque is limited because of overload or temperature."""
    MODE_REFUSED = 1 << 12
    """6060h asks for a mode that the drive does not have (C402-090)."""
    TARGET_REFUSED = 1 << 13
    """607Ah asks for a position outside of 607Bh (C402-164)."""
    SETPOINT_REFUSED = 1 << 14
    """60C1h has met a full buffer (C402-172)."""
    BUFFER_EMPTY = 1 << 15
    """Interpolated position mode has run out of setpoints (C402-099)."""
    INJECTED = 1 << 31
    """Set by a test."""

    @property
    def text(self) -> str:
        """The causes as text."""
        return ", ".join((one.name or "").lower().replace("_", " ") for one in type(self) if one in self)


class Warnings:
    """The warnings that are present, shown in 1002h and 2100h where the EDS has them.

    Args:
        slave: Holds the objects.
        emit: Writes changes into the log.

    """

    def __init__(self, slave: CanopenSlave, emit: Emit) -> None:
        self._slave = slave
        self._emit = emit
        self.bits = 0
        """Present warnings, bits of `DriveWarning`."""
        self.on_change: Callable[[], None] = _nothing
        """Called after every change."""

    def warn(self, bit: DriveWarning, present: bool) -> None:
        """Show a warning, or take it back."""
        self.show(int(bit), int(bit) if present else 0)

    def show(self, mask: int, bits: int) -> None:
        """Set the warnings in `mask` to `bits`."""
        before = self.bits
        if before & mask == bits:
            return
        self.bits = before & ~mask | bits
        slave = self._slave
        for index in (0x1002, 0x2100):
            if index << 8 in slave.values:
                slave.set(index, 0, self.bits)
        self._emit("drive.warning", warnings=self.bits, text=DriveWarning(self.bits).text)
        self.on_change()


def _nothing() -> None:
    pass
