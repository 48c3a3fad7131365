"""What the drive watches in its control cycle: process data, clock, heat, supply, blocked motor,
overspeed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from emulators.drive.core import RPM
from emulators.drive.profidrive.faults import catalogue as numbers
from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.protection import WindowTimer
from fieldbus.clock import seconds_to_ns

if TYPE_CHECKING:
    from emulators.drive.profidrive.drive import ProfidriveDrive

_OVERSPEED: Final = 1.2
"""F07901 from this multiple of p1082 on."""


class Monitors:
    """Monitoring of a PROFIdrive axis; all of it raises faults and warnings of the catalogue.

    Args:
        drive: The drive.

    """

    __slots__ = ("_blocked", "_drive", "_period_s", "_phase_s")

    def __init__(self, drive: ProfidriveDrive) -> None:
        self._drive = drive
        self._period_s = drive.config.control_period_ns / 1e9
        self._blocked = WindowTimer(drive.config.blocked_time_s)
        self._phase_s = 0.0

    def restart(self) -> None:
        """Begin as after power-on."""
        self._blocked.reset()
        self._phase_s = 0.0

    def update(self) -> None:
        """Look at everything; once per control cycle."""
        drive = self._drive
        now = drive.scheduler.now
        if drive.power.update(now):
            self.look_at_models()
        if drive.safety.watching:
            drive.safety.watch()
        if drive.controlled_cyclically:
            self._look_at_bus(now)
        core = drive.core
        if drive.config.blocked_time_s and self._blocked.update(
            core.enabled and core.torque_limited and core.standing and not drive.torque.at_fixed_stop,
            self._period_s,
        ):
            drive.raise_fault(numbers.BLOCKED)
        if core.enabled and abs(core.velocity) > _OVERSPEED * drive.settings.max_speed_rpm * RPM:
            drive.raise_fault(numbers.OVERSPEED)

    def _look_at_bus(self, now: int) -> None:
        """Notice that telegrams or the clock stay away (PD-030, PD-292)."""
        drive = self._drive
        faults = drive.faults
        limit_s = drive.settings.setpoint_monitoring_s
        if limit_s and now - drive.data_at_ns > seconds_to_ns(limit_s):
            faults.keep(numbers.SETPOINT_TIMEOUT, self._silent)
            drive.raise_fault(numbers.SETPOINT_TIMEOUT)
        if drive.isochronous:
            missed = drive.settings.sign_of_life_tolerance + 1.5
            if now - drive.cycle_at_ns > missed * drive.config.cycle_ns and (
                drive.sign_of_life.synchronised and drive.sign_of_life.value
            ):
                drive.sign_of_life.reset()
                drive.raise_fault(numbers.CLOCK_FAILURE)

    def _silent(self) -> bool:
        drive = self._drive
        limit_s = drive.settings.setpoint_monitoring_s
        return bool(limit_s) and drive.now_ns - drive.data_at_ns > seconds_to_ns(limit_s)

    # -- heat and supply -------------------------------------------------------------------------------

    def look_at_models(self) -> None:
        """React to temperatures, overload and DC link."""
        drive = self._drive
        power = drive.power
        faults = drive.faults
        motor, stage = power.motor_overload, power.stage_overload
        if power.thermal.overload == "limit":
            rated = drive.config.rated_torque_Nm
            if motor.utilisation >= 1.0 or stage.utilisation >= 1.0:
                cap = rated if motor.utilisation >= 1.0 else rated * power.thermal.stage_overload
                drive.torque.cap(protection_Nm=cap)
            elif motor.utilisation < 0.9 and stage.utilisation < 0.9:
                drive.torque.cap(protection_Nm=math.inf)
        else:
            if motor.tripped:
                faults.keep(numbers.MOTOR_OVERLOAD, lambda: not motor.recovered)
                drive.raise_fault(numbers.MOTOR_OVERLOAD)
            if stage.tripped:
                faults.keep(numbers.STAGE_OVERLOAD, lambda: not stage.recovered)
                drive.raise_fault(numbers.STAGE_OVERLOAD)
        for node, number in (
            (power.motor, numbers.MOTOR_TEMPERATURE),
            (power.stage, numbers.STAGE_TEMPERATURE),
        ):
            if node.hot:
                faults.keep(number, lambda node=node: node.warm)  # type: ignore[misc]
                drive.raise_fault(number)
        faults.warn(DriveWarning.MOTOR_OVERLOAD, motor.near or stage.near)
        faults.warn(DriveWarning.MOTOR_TEMPERATURE, power.motor.warm)
        faults.warn(DriveWarning.STAGE_TEMPERATURE, power.stage.warm)
        self.look_at_link()
        link = power.dc_link
        if link.phase_missing and drive.core.enabled:
            self._phase_s += power.dt_s
            if self._phase_s >= link.config.phase_loss_time_s:
                faults.keep(numbers.PHASE_LOSS, lambda: link.phase_missing)
                drive.raise_fault(numbers.PHASE_LOSS)
        else:
            self._phase_s = 0.0

    def look_at_link(self) -> None:
        """React to the voltage of the DC link and to the mains."""
        drive = self._drive
        faults = drive.faults
        link = drive.power.dc_link
        faults.warn(DriveWarning.CHOPPER, link.chopper_overloaded or link.chopper_load > 0.8)
        faults.warn(DriveWarning.MAINS_MISSING, not link.mains_on or link.phase_missing)
        if link.high:
            faults.keep(numbers.OVERVOLTAGE, lambda: link.high)
            drive.raise_fault(numbers.OVERVOLTAGE)
        elif link.low and drive.core.enabled:
            faults.keep(numbers.UNDERVOLTAGE, lambda: link.low)
            drive.raise_fault(numbers.UNDERVOLTAGE)
