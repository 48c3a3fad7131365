"""Safety inputs of the drive: safe torque off, safe stop 1, interlock (C402-030, C402-168)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from emulators.drive.cia402.faults import codes as faults
from emulators.drive.cia402.function import DriveFunction
from emulators.drive.cia402.parameters import Parameters
from emulators.drive.cia402.warnings import DriveWarning, Warnings
from emulators.drive.inputs import DigitalInputs
from emulators.drive.machine import SafetyConfig
from fieldbus.cia402 import DriveState
from fieldbus.clock import S, Scheduler, Timer, seconds_to_ns

_WITH_TORQUE: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
_INTERLOCK: Final = 1 << 3
_ALLOWANCE: Final = 0.1
"""The monitored ramp may be exceeded by this share of the speed at its beginning."""


class SafetyFunctions:
    """Safe torque off, safe stop 1 and interlock of a drive.

    Args:
        scheduler: Clock of the drive.
        config: What the inputs do.
        function: State machine and modes.
        inputs: Digital inputs; the interlock shows there.
        parameters: Taken over before a stop.
        warnings: Gets the warnings.
        raise_fault: Raises a fault of the drive.
        refresh_status: Forms the status word.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        config: SafetyConfig,
        *,
        function: DriveFunction,
        inputs: DigitalInputs,
        parameters: Parameters,
        warnings: Warnings,
        raise_fault: Callable[[int], None],
        refresh_status: Callable[[], None],
    ) -> None:
        self._scheduler = scheduler
        self._config = config
        self._core = function.axis.core
        self._function = function
        self._machine = function.machine
        self._inputs = inputs
        self._parameters = parameters
        self._warnings = warnings
        self._raise_fault = raise_fault
        self._refresh_status = refresh_status
        self._ss1_timer: Timer | None = None
        self._start_ns = 0
        self._limit = 0.0
        self.sto_input = False
        """The input of safe torque off demands it."""
        self.ss1_input = False
        """The input of safe stop 1 demands it."""
        self.interlock_open = False
        self.monitoring = False
        """The ramp of safe stop 1 has to be watched in every control cycle."""
        self.torque_off = False
        """Safe torque off is in effect."""

    @property
    def bits(self) -> int:
        """2108h: bit 0 safe torque off in effect, 1 its input, 2 input of safe stop 1, 3 its ramp runs, 4
        interlock open.
        """
        return (
            self.torque_off
            | self.sto_input << 1
            | self.ss1_input << 2
            | self.monitoring << 3
            | self.interlock_open << 4
        )

    # -- inputs ----------------------------------------------------------------------------------------

    def set_sto(self, active: bool) -> None:
        """Demand safe torque off, or release it."""
        self.sto_input = active
        self._settle()

    def set_ss1(self, active: bool) -> None:
        """Demand safe stop 1, or release it: the drive brakes with its quick
        stop, then safe torque off follows.
        """
        if active is self.ss1_input:
            return
        self.ss1_input = active
        if not active:
            self._end_ramp()
            self._settle()
            return
        machine = self._machine
        if not self._core.enabled:
            self._settle()
            return
        self._parameters.take()
        self._start_ns = self._scheduler.now
        self._limit = abs(self._core.velocity)
        self.monitoring = True
        machine.inhibited = True
        self._ss1_timer = self._scheduler.after(seconds_to_ns(self._config.ss1_time_s), self._time_over)
        self._warnings.warn(DriveWarning.SAFE_STOP, True)
        self._function.execute(machine.quick_stop())
        self._refresh_status()

    def set_interlock(self, open_: bool) -> None:
        """Open or close the interlock."""
        self.interlock_open = open_
        self._parameters.take()
        self._warnings.warn(DriveWarning.INTERLOCK_OPEN, open_)
        self.show_interlock()
        reaction = self._config.interlock
        self._inhibit()
        if open_:
            if reaction == "fault":
                self._raise_fault(faults.EXTERNAL)
            elif reaction == "inhibit" or self._machine.state not in _WITH_TORQUE:
                self._function.execute(self._machine.disable_voltage())
            else:
                self._function.execute(self._machine.quick_stop())
        else:
            self._function.evaluate_again()
        self._refresh_status()

    def show_interlock(self) -> None:
        """Show the interlock in 60FDh, where one is wired: 1 = closed."""
        if self._config.interlock != "none":
            self._inputs.set_level(_INTERLOCK, not self.interlock_open)

    # -- safe stop 1 -----------------------------------------------------------------------------------

    def watch(self) -> None:
        """Compare the speed with the ramp of safe stop 1; call in every control cycle while `monitoring`."""
        config = self._config
        if not config.ss1_monitored:
            return
        core = self._core
        if core.standing and not (core.enabled and self._machine.ramping_down):
            self._end_ramp()
            self._settle()
            return
        elapsed_s = (self._scheduler.now - self._start_ns) / S
        allowed = (
            self._limit * max(1.0 - elapsed_s / config.ss1_time_s + _ALLOWANCE, 0.0) + core.standstill_speed
        )
        if abs(core.velocity) > allowed:
            self._violated()

    def _time_over(self) -> None:
        self._ss1_timer = None
        if self._config.ss1_monitored and not self._core.standing:
            self._violated()
            return
        self._end_ramp()
        self._settle()

    def _violated(self) -> None:
        self._end_ramp()
        self._settle(silent=True)
        self._raise_fault(faults.SAFE_STOP)

    def _end_ramp(self) -> None:
        if self._ss1_timer is not None:
            self._ss1_timer.cancel()
            self._ss1_timer = None
        self.monitoring = False
        self._warnings.warn(DriveWarning.SAFE_STOP, False)

    # -- safe torque off -------------------------------------------------------------------------------

    def _settle(self, *, silent: bool = False) -> None:
        """Put safe torque off in effect, or release it (C402-030)."""
        machine = self._machine
        wanted = self.sto_input or (self.ss1_input and not self.monitoring)
        if wanted is self.torque_off:
            self._inhibit()
            return
        self.torque_off = wanted
        self._inhibit()
        self._warnings.warn(DriveWarning.TORQUE_OFF, wanted)
        if wanted:
            if self._config.sto == "fault" and machine.state in _WITH_TORQUE and not silent:
                self._raise_fault(faults.SAFE_TORQUE_OFF)
            elif not silent:
                self._function.execute(machine.disable_voltage())
        else:
            self._function.evaluate_again()
        self._refresh_status()

    def _inhibit(self) -> None:
        self._machine.inhibited = (
            self.torque_off or self.monitoring or (self.interlock_open and self._config.interlock != "none")
        )

    def holds(self, code: int) -> bool:
        """Return whether the cause of a latched fault is still there."""
        if code == faults.SAFE_TORQUE_OFF:
            return self.torque_off
        if code == faults.SAFE_STOP:
            return self.ss1_input
        return code == faults.EXTERNAL and self.interlock_open
