"""Safety inputs of the drive: safe torque off, safe stop 1, interlock (C402-030, C402-168)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emulators.drive.cia402.faults import codes as faults
from emulators.drive.cia402.protection import DriveWarning
from fieldbus.cia402 import DriveState
from fieldbus.clock import S, Timer, seconds_to_ns

if TYPE_CHECKING:
    from emulators.drive.cia402.drive import CiA402Drive

_WITH_TORQUE: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
_INTERLOCK: Final = 1 << 3
_ALLOWANCE: Final = 0.1
"""The monitored ramp may be exceeded by this share of the speed at its beginning."""


class SafetyFunctions:
    """Safe torque off, safe stop 1 and interlock of a drive.

    Args:
        drive: The drive.

    """

    __slots__ = (
        "_drive",
        "_limit",
        "_ss1_timer",
        "_start_ns",
        "interlock_open",
        "monitoring",
        "ss1_input",
        "sto_input",
        "torque_off",
    )

    def __init__(self, drive: CiA402Drive) -> None:
        self._drive = drive
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
        """Safe torque off is in force."""

    @property
    def bits(self) -> int:
        """2108h: bit 0 safe torque off in force, 1 its input, 2 input of safe stop 1, 3 its ramp runs, 4
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
        """Demand safe stop 1, or release it: the drive brakes with its quick stop, then safe torque off
        follows.
        """
        if active is self.ss1_input:
            return
        self.ss1_input = active
        drive = self._drive
        if not active:
            self._end_ramp()
            self._settle()
            return
        machine = drive.machine
        if not drive.core.enabled:
            self._settle()
            return
        drive.take_parameters()
        self._start_ns = drive.now_ns
        self._limit = abs(drive.core.velocity)
        self.monitoring = True
        machine.inhibited = True
        self._ss1_timer = drive.scheduler.after(
            seconds_to_ns(drive.config.safety.ss1_time_s), self._time_over
        )
        drive.protection.warn(DriveWarning.SAFE_STOP, True)
        drive.function.execute(machine.quick_stop())
        drive.refresh_status()

    def set_interlock(self, open_: bool) -> None:
        """Open or close the interlock."""
        self.interlock_open = open_
        drive = self._drive
        drive.take_parameters()
        drive.protection.warn(DriveWarning.INTERLOCK_OPEN, open_)
        self.show_interlock()
        reaction = drive.config.safety.interlock
        self._inhibit()
        if open_:
            if reaction == "fault":
                drive.raise_fault(faults.EXTERNAL)
            elif reaction == "inhibit" or drive.machine.state not in _WITH_TORQUE:
                drive.function.execute(drive.machine.disable_voltage())
            else:
                drive.function.execute(drive.machine.quick_stop())
        else:
            drive.function.evaluate_again()
        drive.refresh_status()

    def show_interlock(self) -> None:
        """Show the interlock in 60FDh, where one is wired: 1 = closed."""
        drive = self._drive
        if drive.config.safety.interlock != "none":
            drive.digital_inputs.set_level(_INTERLOCK, not self.interlock_open)

    # -- safe stop 1 -----------------------------------------------------------------------------------

    def watch(self) -> None:
        """Compare the speed with the ramp of safe stop 1; call in every control cycle while `monitoring`."""
        drive = self._drive
        config = drive.config.safety
        if not config.ss1_monitored:
            return
        core = drive.core
        if core.standing and not (core.enabled and drive.machine.ramping_down):
            self._end_ramp()
            self._settle()
            return
        elapsed_s = (drive.now_ns - self._start_ns) / S
        allowed = (
            self._limit * max(1.0 - elapsed_s / config.ss1_time_s + _ALLOWANCE, 0.0) + core.standstill_speed
        )
        if abs(core.velocity) > allowed:
            self._violated()

    def _time_over(self) -> None:
        self._ss1_timer = None
        if self._drive.config.safety.ss1_monitored and not self._drive.core.standing:
            self._violated()
            return
        self._end_ramp()
        self._settle()

    def _violated(self) -> None:
        self._end_ramp()
        self._settle(silent=True)
        self._drive.raise_fault(faults.SAFE_STOP)

    def _end_ramp(self) -> None:
        if self._ss1_timer is not None:
            self._ss1_timer.cancel()
            self._ss1_timer = None
        self.monitoring = False
        self._drive.protection.warn(DriveWarning.SAFE_STOP, False)

    # -- safe torque off -------------------------------------------------------------------------------

    def _settle(self, *, silent: bool = False) -> None:
        """Put safe torque off in force, or release it (C402-030)."""
        drive = self._drive
        machine = drive.machine
        wanted = self.sto_input or (self.ss1_input and not self.monitoring)
        if wanted is self.torque_off:
            self._inhibit()
            return
        self.torque_off = wanted
        self._inhibit()
        drive.protection.warn(DriveWarning.TORQUE_OFF, wanted)
        if wanted:
            if drive.config.safety.sto == "fault" and machine.state in _WITH_TORQUE and not silent:
                drive.raise_fault(faults.SAFE_TORQUE_OFF)
            elif not silent:
                drive.function.execute(machine.disable_voltage())
        else:
            drive.function.evaluate_again()
        drive.refresh_status()

    def _inhibit(self) -> None:
        self._drive.machine.inhibited = (
            self.torque_off
            or self.monitoring
            or (self.interlock_open and self._drive.config.safety.interlock != "none")
        )

    def holds(self, code: int) -> bool:
        """Return whether the cause of a latched fault is still there."""
        if code == faults.SAFE_TORQUE_OFF:
            return self.torque_off
        if code == faults.SAFE_STOP:
            return self.ss1_input
        return code == faults.EXTERNAL and self.interlock_open
