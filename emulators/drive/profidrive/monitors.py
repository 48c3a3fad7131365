"""What the drive watches in its control cycle: process data, clock, heat,
supply, blocked motor, overspeed.
"""

from __future__ import annotations

import math
from typing import Final

from emulators.drive.core import RPM, ServoCore
from emulators.drive.power_stage import PowerStage
from emulators.drive.profidrive.config import DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.faults import catalogue as numbers
from emulators.drive.profidrive.faults.catalogue import DriveWarning
from emulators.drive.profidrive.faults.state import FaultState, RaiseFault
from emulators.drive.profidrive.process_data import ProcessData
from emulators.drive.profidrive.safety.functions import SafetyFunctions
from emulators.drive.profidrive.torque import TorqueLimits
from emulators.drive.protection import WindowTimer
from fieldbus.clock import MS, Scheduler
from fieldbus.profidrive.sign_of_life import SignOfLife

_OVERSPEED: Final = 1.2
"""F07901 from this multiple of p1082 on."""


class Monitors:
    """Monitoring of a PROFIdrive axis; all of it raises faults and warnings of the catalogue.

    Args:
        scheduler: Clock of the drive.
        config: Times, rated torque, reaction to an overload.
        settings: Parameters in effect.
        core: Servo core.
        power: Heat and supply.
        data: When telegrams came.
        signs: Sign of life; None: the drive is not isochronous.
        torque: Torque limits.
        safety: Safety functions, watched in the same cycle.
        faults: Faults and warnings.
        raise_fault: Raises a fault of the drive.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        config: ProfidriveConfig,
        *,
        settings: DriveSettings,
        core: ServoCore,
        power: PowerStage,
        data: ProcessData,
        signs: SignOfLife | None,
        torque: TorqueLimits,
        safety: SafetyFunctions,
        faults: FaultState,
        raise_fault: RaiseFault,
    ) -> None:
        self._scheduler = scheduler
        self._settings = settings
        self._core = core
        self._power = power
        self._data = data
        self._signs = signs
        self._torque = torque
        self._safety = safety
        self._faults = faults
        self._raise_fault = raise_fault
        self._cycle_ns = config.cycle_ns
        self._rated_torque_Nm = config.rated_torque_nm
        self._period_s = config.control_period_ns / 1e9
        self._blocked_time_s = config.blocked_time_ms / 1000.0
        self._blocked = WindowTimer(config.blocked_time_ms / 1000.0)
        self._phase_s = 0.0

    def restart(self) -> None:
        """Begin as after power-on."""
        self._blocked.reset()
        self._phase_s = 0.0

    def update(self) -> None:
        """Look at everything; once per control cycle."""
        now = self._scheduler.now
        if self._power.update():
            self._power.advance(now)
            self.look_at_models()
        if self._safety.watching:
            self._safety.watch()
        if self._data.controlled_cyclically:
            self._look_at_bus(now)
        core = self._core
        if self._blocked_time_s and self._blocked.update(
            core.enabled and core.torque_limited and core.standing and not self._torque.at_fixed_stop,
            self._period_s,
        ):
            self._raise_fault(numbers.BLOCKED)
        if core.enabled and abs(core.velocity) > _OVERSPEED * self._settings.max_speed_rpm * RPM:
            self._raise_fault(numbers.OVERSPEED)

    def _look_at_bus(self, now: int) -> None:
        """Notice that telegrams or the clock are missing (PD-030, PD-292)."""
        faults = self._faults
        limit_ms = self._settings.setpoint_monitoring_ms
        silent_ns = now - self._data.received_at_ns
        # The first condition only saves the rounding: in every cycle but that of the fault.
        if limit_ms and silent_ns > limit_ms * MS - 1.0 and silent_ns > round(limit_ms * MS):
            faults.keep(numbers.SETPOINT_TIMEOUT, self._silent)
            self._raise_fault(numbers.SETPOINT_TIMEOUT)
        signs = self._signs
        if signs is not None:
            missed = self._settings.sign_of_life_tolerance + 1.5
            if now - self._data.cycle_at_ns > missed * self._cycle_ns and (
                signs.synchronised and signs.value
            ):
                signs.reset()
                self._raise_fault(numbers.CLOCK_FAILURE)

    def _silent(self) -> bool:
        limit_ms = self._settings.setpoint_monitoring_ms
        return bool(limit_ms) and self._scheduler.now - self._data.received_at_ns > round(limit_ms * MS)

    # -- heat and supply -------------------------------------------------------------------------------

    def look_at_models(self) -> None:
        """React to temperatures, overload and DC link."""
        power = self._power
        faults = self._faults
        motor, stage = power.motor_overload, power.stage_overload
        if power.thermal.overload == "limit":
            rated = self._rated_torque_Nm
            if motor.utilisation >= 1.0 or stage.utilisation >= 1.0:
                cap = rated if motor.utilisation >= 1.0 else rated * power.thermal.stage_overload
                self._torque.cap(protection_Nm=cap)
            elif motor.utilisation < 0.9 and stage.utilisation < 0.9:
                self._torque.cap(protection_Nm=math.inf)
        else:
            if motor.tripped:
                faults.keep(numbers.MOTOR_OVERLOAD, lambda: not motor.recovered)
                self._raise_fault(numbers.MOTOR_OVERLOAD)
            if stage.tripped:
                faults.keep(numbers.STAGE_OVERLOAD, lambda: not stage.recovered)
                self._raise_fault(numbers.STAGE_OVERLOAD)
        for node, number in (
            (power.motor, numbers.MOTOR_TEMPERATURE),
            (power.stage, numbers.STAGE_TEMPERATURE),
        ):
            if node.hot:
                faults.keep(number, lambda node=node: node.warm)  # type: ignore[misc]
                self._raise_fault(number)
        faults.warn(DriveWarning.MOTOR_OVERLOAD, motor.near or stage.near)
        faults.warn(DriveWarning.MOTOR_TEMPERATURE, power.motor.warm)
        faults.warn(DriveWarning.STAGE_TEMPERATURE, power.stage.warm)
        self.look_at_link()
        link = power.dc_link
        if link.phase_missing and self._core.enabled:
            self._phase_s += power.dt_s
            if self._phase_s >= link.config.phase_loss_time_s:
                faults.keep(numbers.PHASE_LOSS, lambda: link.phase_missing)
                self._raise_fault(numbers.PHASE_LOSS)
        else:
            self._phase_s = 0.0

    def look_at_link(self) -> None:
        """React to the voltage of the DC link and to the mains."""
        faults = self._faults
        link = self._power.dc_link
        faults.warn(DriveWarning.CHOPPER, link.chopper_overloaded or link.chopper_load > 0.8)
        faults.warn(DriveWarning.MAINS_MISSING, not link.mains_on or link.phase_missing)
        if link.high:
            faults.keep(numbers.OVERVOLTAGE, lambda: link.high)
            self._raise_fault(numbers.OVERVOLTAGE)
        elif link.low and self._core.enabled:
            faults.keep(numbers.UNDERVOLTAGE, lambda: link.low)
            self._raise_fault(numbers.UNDERVOLTAGE)
