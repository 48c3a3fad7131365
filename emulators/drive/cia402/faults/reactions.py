"""What a drive does when something fails: fault reaction, reset, lost communication
(C402-014 to C402-016, C402-077).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emulators.drive.cia402.config import DriveConfig
from emulators.drive.cia402.faults import codes as faults
from emulators.drive.cia402.faults.codes import FaultMemory
from emulators.drive.cia402.faults.rules import RESTART_FAULTS
from emulators.drive.cia402.function import DriveFunction
from emulators.drive.cia402.parameters import Parameters
from emulators.drive.supply import DcLink
from emulators.events import Emit
from fieldbus.canopen.slave import CanopenSlave
from fieldbus.cia402 import DriveState
from fieldbus.clock import Scheduler, Timer, seconds_to_ns
from fieldbus.errors import ConfigurationError

_IN_FAULT: Final = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)
_CODES: Final = {
    "bus_off": faults.BUS_OFF,
    "nmt": faults.LEFT_OPERATIONAL,
    "rpdo_timeout": faults.RPDO_TIMEOUT,
    "setpoint": faults.RPDO_TIMEOUT,
}


class FaultReactions:
    """Raises and ends faults of a drive.

    Args:
        scheduler: Clock of the drive.
        config: Reactions that depend on the drive.
        slave: Node on the bus.
        function: State machine and modes.
        memory: Fault memory.
        parameters: Taken over before a reaction.
        dc_link: Its overvoltage forbids a reset.
        refresh_status: Forms the status word.
        emit: Writes events into the log.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        config: DriveConfig,
        slave: CanopenSlave,
        *,
        function: DriveFunction,
        memory: FaultMemory,
        parameters: Parameters,
        dc_link: DcLink,
        refresh_status: Callable[[], None],
        emit: Emit,
    ) -> None:
        self._scheduler = scheduler
        self._config = config
        self._slave = slave
        self._function = function
        self._machine = function.machine
        self._memory = memory
        self._parameters = parameters
        self._dc_link = dc_link
        self._refresh_status = refresh_status
        self._emit = emit
        self.causes: list[Callable[[int], bool]] = []
        """Each says whether the cause of a latched fault is still there."""
        self._resets = 0
        self._timer: Timer | None = None

    def forget(self) -> None:
        """Start as at power-on."""
        self._resets = 0
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def raise_fault(self, code: int, *, persistent: bool = False) -> None:
        """Latch a fault and enter its reaction; see `CiA402Drive.raise_fault`."""
        if not 1 <= code <= 0xFFFF:
            raise ConfigurationError("emcy_code", code, "1..65535")
        memory = self._memory
        state = self._machine.state
        if not self._slave.powered or state is DriveState.NOT_READY_TO_SWITCH_ON:
            return
        if code in memory.causes and state in _IN_FAULT:
            memory.causes[code] |= persistent
            return
        memory.enter(code, persistent=persistent, state=state, mode=self._function.mode.number)
        self._parameters.take()
        self._function.execute(self._machine.fault(can_brake=code not in self._config.coasting_faults))
        self._refresh_status()

    def present(self) -> bool:
        """Return whether something still forbids a reset (C402-016)."""
        memory = self._memory
        return (
            memory.persistent
            or self._dc_link.high
            or (faults.COMMUNICATION in memory.causes and self._slave.error_control.anyone_lost)
            or any(
                code in RESTART_FAULTS or any(holds(code) for holds in self.causes) for code in memory.causes
            )
        )

    # -- faults that clear themselves ------------------------------------------------------------------

    def reset_commanded(self) -> None:
        """Note that the controller wants a reset: the drive's own attempts start from zero."""
        self._resets = 0

    def arm_auto_reset(self) -> None:
        """Try to leave Fault without a command, after the time that is usual for this drive."""
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._scheduler.after(
            seconds_to_ns(self._config.quirks.auto_reset_s), self._reset_itself
        )

    def _reset_itself(self) -> None:
        self._timer = None
        if not self._slave.powered or self._machine.state is not DriveState.FAULT:
            return
        if self.present():
            self.arm_auto_reset()
        elif self._resets < self._config.quirks.auto_reset_attempts:
            self._resets += 1
            self._function.execute(self._machine.reset_itself())
            self._refresh_status()

    # -- communication ---------------------------------------------------------------------------------

    def communication_lost(self, reason: str) -> None:
        """React to lost communication as 6007h says (C402-077)."""
        machine = self._machine
        self._parameters.take()
        self._emit("drive.connection_lost", reason=reason)
        option = machine.options.abort_connection
        if option == 1:
            self.raise_fault(_CODES.get(reason, faults.COMMUNICATION))
        elif option == 2:
            self._function.execute(machine.disable_voltage())
        elif option == 3:
            self._function.execute(machine.quick_stop())
        self._refresh_status()

    def sync_lost(self) -> None:
        """React to a lost SYNC in a cyclic mode (C301-037)."""
        if not self._function.mode.cyclic or self._machine.state is not DriveState.OPERATION_ENABLED:
            return
        if self._config.sync_loss == "fault":
            self.raise_fault(faults.SYNC_LOST)
        elif self._config.sync_loss == "warning":
            self._slave.emcy(faults.SYNC_LOST)
            self._slave.emcy_clear(faults.SYNC_LOST)
