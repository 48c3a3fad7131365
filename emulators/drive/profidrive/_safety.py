"""Safety inputs of a PROFIdrive axis: safe torque off and safe stop 1."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from emulators.drive.profidrive import fault_catalogue as numbers
from emulators.drive.profidrive.statemachine import Off
from fieldbus.clock import S

if TYPE_CHECKING:
    from emulators.drive.profidrive.device import ProfidriveDrive

_ALLOWANCE: Final = 0.1
"""The monitored ramp may be exceeded by this share of the speed at its beginning."""


class SafetyInputs:
    """Safe torque off acts as OFF2 without a fault, safe stop 1 as OFF3 and then as safe torque off.

    Args:
        drive: The drive.

    """

    __slots__ = ("_drive", "_limit", "_start_ns", "braking", "off", "ss1_input", "sto_input", "torque_off")

    def __init__(self, drive: ProfidriveDrive) -> None:
        self._drive = drive
        self._limit = 0.0
        self._start_ns = 0
        self.sto_input = False
        self.ss1_input = False
        self.braking = False
        """Safe stop 1 is under way."""
        self.torque_off = False
        """Safe torque off is in force."""
        self.off = 0
        """Stop commands, bits of `Off`."""

    def set_sto(self, active: bool) -> None:
        """Demand safe torque off, or release it."""
        self.sto_input = active
        self._settle()

    def set_ss1(self, active: bool) -> None:
        """Demand safe stop 1, or release it."""
        if active is self.ss1_input:
            return
        self.ss1_input = active
        drive = self._drive
        self.braking = active and drive.core.enabled
        if self.braking:
            self._start_ns = drive.now_ns
            self._limit = abs(drive.core.velocity)
        self._settle()

    def watch(self) -> None:
        """Compare the speed with the ramp of safe stop 1; call in every control cycle while `braking`."""
        drive = self._drive
        config = drive.config.safety
        core = drive.core
        elapsed_s = (drive.now_ns - self._start_ns) / S
        if elapsed_s >= config.ss1_time_s:
            self.braking = False
            self._settle()
            if config.ss1_monitored and not core.standing:
                drive.raise_fault(numbers.SAFE_STOP)
        elif config.ss1_monitored:
            if not core.enabled:
                self.braking = False
                self._settle()
                return
            share = max(1.0 - elapsed_s / config.ss1_time_s + _ALLOWANCE, 0.0)
            if abs(core.velocity) > self._limit * share + core.standstill_speed:
                self.braking = False
                self._settle()
                drive.raise_fault(numbers.SAFE_STOP)

    def _settle(self) -> None:
        drive = self._drive
        torque_off = self.sto_input or (self.ss1_input and not self.braking)
        self.off = int(Off.OFF2) if torque_off else int(Off.OFF3) if self.braking else 0
        if torque_off is not self.torque_off:
            self.torque_off = torque_off
            drive.faults.warn(numbers.DriveWarning.SAFE_TORQUE_OFF, torque_off)
            if (
                torque_off
                and drive.config.safety.sto == "fault"
                and drive.core.enabled
                and not self.ss1_input
            ):
                drive.raise_fault(numbers.SAFE_TORQUE_OFF)
                drive.faults.keep(numbers.SAFE_TORQUE_OFF, lambda: self.torque_off)
        drive.act()
