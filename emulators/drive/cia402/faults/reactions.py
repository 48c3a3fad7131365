"""What a drive does when something fails: fault reaction, reset, lost communication (C402-014 to C402-016,
C402-077).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emulators.drive.cia402.faults import codes as faults
from emulators.drive.cia402.faults.rules import RESTART_FAULTS
from fieldbus.cia402 import DriveState
from fieldbus.clock import Timer, seconds_to_ns
from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from emulators.drive.cia402.drive import CiA402Drive

_IN_FAULT: Final = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
_CODES: Final = {
    "bus_off": faults.BUS_OFF,
    "rpdo_timeout": faults.RPDO_TIMEOUT,
    "setpoint": faults.RPDO_TIMEOUT,
}


class FaultReactions:
    """Raises and ends faults of a drive.

    Args:
        drive: The drive.

    """

    __slots__ = ("_drive", "_resets", "_timer")

    def __init__(self, drive: CiA402Drive) -> None:
        self._drive = drive
        self._resets = 0
        self._timer: Timer | None = None

    def forget(self) -> None:
        """Start anew, as at power-on."""
        self._resets = 0
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def raise_fault(self, code: int, *, persistent: bool = False) -> None:
        """Latch a fault and enter its reaction; see `CiA402Drive.raise_fault`."""
        if not 1 <= code <= 0xFFFF:
            raise ConfigurationError("emcy_code", code, "1..65535")
        drive = self._drive
        memory = drive.faults
        state = drive.machine.state
        if not drive.slave.powered or state is DriveState.NOT_READY_TO_SWITCH_ON:
            return
        if code in memory.causes and state in _IN_FAULT:
            memory.causes[code] |= persistent
            return
        memory.enter(code, persistent=persistent, state=state, mode=drive.mode.number)
        drive.take_parameters()
        drive.function.execute(drive.machine.fault(can_brake=code not in drive.config.coasting_faults))
        drive.refresh_status()

    def present(self) -> bool:
        """Return whether something still forbids a reset (C402-016)."""
        drive = self._drive
        memory = drive.faults
        return (
            memory.persistent
            or drive.dc_link.high
            or (faults.COMMUNICATION in memory.causes and drive.slave.error_control.anyone_lost)
            or any(
                drive.protection.holds(code) or drive.safety.holds(code) or code in RESTART_FAULTS
                for code in memory.causes
            )
        )

    # -- faults that clear themselves ------------------------------------------------------------------

    def reset_commanded(self) -> None:
        """Note that the controller wants a reset: attempts of the drive's own count anew."""
        self._resets = 0

    def arm_auto_reset(self) -> None:
        """Try to leave Fault without a command, after the time that is usual for this drive."""
        if self._timer is not None:
            self._timer.cancel()
        drive = self._drive
        self._timer = drive.scheduler.after(
            seconds_to_ns(drive.config.quirks.auto_reset_s), self._reset_itself
        )

    def _reset_itself(self) -> None:
        self._timer = None
        drive = self._drive
        if not drive.slave.powered or drive.machine.state is not DriveState.FAULT:
            return
        if self.present():
            self.arm_auto_reset()
        elif self._resets < drive.config.quirks.auto_reset_attempts:
            self._resets += 1
            drive.function.execute(drive.machine.reset_itself())
            drive.refresh_status()

    # -- communication ---------------------------------------------------------------------------------

    def communication_lost(self, reason: str) -> None:
        """React to lost communication as 6007h says (C402-077)."""
        drive = self._drive
        machine = drive.machine
        drive.take_parameters()
        drive.emit("drive.connection_lost", reason=reason)
        option = machine.options.abort_connection
        if option == 1:
            self.raise_fault(_CODES.get(reason, faults.COMMUNICATION))
        elif option == 2:
            drive.function.execute(machine.disable_voltage())
        elif option == 3:
            drive.function.execute(machine.quick_stop())
        drive.refresh_status()

    def sync_lost(self) -> None:
        """React to a lost SYNC in a cyclic mode (C301-037)."""
        drive = self._drive
        if not drive.mode.cyclic or drive.machine.state is not DriveState.OPERATION_ENABLED:
            return
        if drive.config.sync_loss_reaction == "fault":
            self.raise_fault(faults.SYNC_LOST)
        elif drive.config.sync_loss_reaction == "warning":
            drive.slave.emcy(faults.SYNC_LOST)
            drive.slave.emcy_clear(faults.SYNC_LOST)
