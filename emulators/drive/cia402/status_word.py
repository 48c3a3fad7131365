"""Status word 6041h and mode display 6061h, with what a test overrides in them (C402-039 to C402-048)."""

from __future__ import annotations

from typing import Final

from emulators.drive.cia402.function import DriveFunction
from emulators.drive.cia402.quirks import Quirks
from emulators.drive.cia402.warnings import Warnings
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.cia402 import DriveState, Mode

_VOLTAGE_ENABLED: Final = 1 << 4
_WARNING: Final = 1 << 7
_REMOTE: Final = 1 << 9
_TARGET_REACHED: Final = 1 << 10
_INTERNAL_LIMIT: Final = 1 << 11
_MODE_12: Final = 1 << 12
_HOMING_START: Final = 0x10
_BITS: Final = tuple(state.bits for state in DriveState)
"""Bits of a state by its number."""
_OPERATION_ENABLED: Final = DriveState.OPERATION_ENABLED


class StatusWord:
    """Forms the status word of a drive.

    Args:
        slave: Holds 6041h and 6061h.
        function: State machine and modes.
        warnings: Shown in bit 7.
        quirks: What this drive shows beyond the profile.

    """

    def __init__(
        self, slave: CanopenSlave, function: DriveFunction, warnings: Warnings, quirks: Quirks
    ) -> None:
        self._slave = slave
        self._function = function
        self._machine = function.machine
        self._axis = function.axis
        self._core = function.axis.core
        self._warnings = warnings
        self._quirks = quirks
        self._quirky = quirks.shown_in_status
        self._overridden = False
        self._set = self._cleared = 0
        self._mode_display: int | None = None
        self._value = 0
        self.frozen = False
        """The status word does not change: a fault to inject."""
        self.homing_refused = False
        """The last homing was refused or failed."""

    def forget(self) -> None:
        """Start as at power-on."""
        self.homing_refused = False
        self._value = -1

    def read(self) -> int:
        """Return 6041h for a reader on the bus.

        Raises:
            SdoAbort: 08000022h: this drive has no status word before it is ready.

        """
        machine = self._machine
        if self._quirks.silent_until_ready and machine.state is DriveState.NOT_READY_TO_SWITCH_ON:
            raise SdoAbort(AbortCode.DEVICE_STATE)
        machine.status_seen = True
        return max(self._value, 0)

    def refresh(self) -> None:
        """Form 6041h."""
        if self.frozen:
            return
        machine = self._machine
        function = self._function
        state = machine.state
        status = _BITS[state]
        if machine.power_available:
            status |= _VOLTAGE_ENABLED
        if self._warnings.bits:
            status |= _WARNING
        if not function.local_control:
            status |= _REMOTE
        if state is _OPERATION_ENABLED:
            mode = function.mode
            if machine.follows_commands:
                status |= mode.status
            core = self._core
            axis = self._axis
            if (
                mode.limited
                or core.torque_limited
                or core.speed_limited
                or function.limit_stop
                or axis.blocked_positive
                or axis.blocked_negative
                or axis.derated
            ):
                status |= _INTERNAL_LIMIT
        elif (
            state is DriveState.QUICK_STOP_ACTIVE
            and function.mode.tells_arrival
            and self._core.standing
            and not self._core.stopping
        ):
            status |= _TARGET_REACHED
        if self._quirky:
            status = self._with_quirks(status)
        if self._overridden:
            status = status & ~self._cleared | self._set
        if status != self._value:
            self._value = status
            self._slave.set(0x6041, 0, status)

    def _with_quirks(self, status: int) -> int:
        """Return the status word with the bits that this drive shows beyond, or against, the profile."""
        quirks = self._quirks
        if self._axis.homed:
            status |= quirks.status_homed
        if self.homing_refused:
            status |= quirks.status_homing_refused
        function = self._function
        if (
            quirks.homing_finishes_on_release
            and function.mode.number == Mode.HOMING
            and function.word & _HOMING_START
            and status & _MODE_12
        ):
            status &= ~_TARGET_REACHED
        return status

    # -- overridden bits -------------------------------------------------------------------------------

    def override_bits(self, *, set_bits: int = 0, clear_bits: int = 0) -> None:
        """Show bits as 1 or 0, whatever they should be; none = the truth."""
        self._set = set_bits
        self._cleared = clear_bits
        self._overridden = bool(set_bits or clear_bits)
        self.refresh()

    def override_mode_display(self, number: int | None) -> None:
        """Show a wrong mode in 6061h, or the true one again (None)."""
        self._mode_display = number
        self.show_mode()

    def show_mode(self) -> None:
        """Write 6061h."""
        display = self._mode_display
        self._slave.set(0x6061, 0, self._function.mode.number if display is None else display)
