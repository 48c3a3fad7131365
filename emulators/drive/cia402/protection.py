"""Overload, temperatures, DC link and warnings of the drive (C402-029, C402-041, C402-160).

The models are those of `emulators.drive.power_stage`; here is what the drive does about them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from emulators.drive.cia402.config import DriveConfig
from emulators.drive.cia402.faults import codes as faults
from emulators.drive.cia402.function import DriveFunction
from emulators.drive.cia402.parameters import Parameters
from emulators.drive.cia402.warnings import DriveWarning, Warnings
from emulators.drive.power_stage import PowerStage
from fieldbus.cia402 import DriveState
from fieldbus.clock import Scheduler, Timer, seconds_to_ns

_WITH_TORQUE: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)


# Plain integers: operations on flags cost ten times as much.
_MOTOR_OVERLOAD: Final = int(DriveWarning.MOTOR_OVERLOAD)
_STAGE_OVERLOAD: Final = int(DriveWarning.STAGE_OVERLOAD)
_MOTOR_TEMPERATURE: Final = int(DriveWarning.MOTOR_TEMPERATURE)
_STAGE_TEMPERATURE: Final = int(DriveWarning.STAGE_TEMPERATURE)
_HEAT: Final = _MOTOR_OVERLOAD | _STAGE_OVERLOAD | _MOTOR_TEMPERATURE | _STAGE_TEMPERATURE
_CHOPPER_LOAD: Final = int(DriveWarning.CHOPPER_LOAD)
_MAINS_MISSING: Final = int(DriveWarning.MAINS_MISSING)
_PHASE_MISSING: Final = int(DriveWarning.PHASE_MISSING)
_DC_LINK_LOW: Final = int(DriveWarning.DC_LINK_LOW)
_SUPPLY: Final = _CHOPPER_LOAD | _MAINS_MISSING | _PHASE_MISSING | _DC_LINK_LOW


class Protection:
    """Models of heat and supply, and what the drive does about them.

    Args:
        scheduler: Clock of the drive.
        config: Rated torque, and when a drive without power falls back.
        power: Models of heat and supply.
        function: State machine and modes.
        parameters: Taken over when the torque limit changes.
        warnings: Gets the warnings.
        raise_fault: Raises a fault of the drive.
        refresh_status: Forms the status word.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        config: DriveConfig,
        power: PowerStage,
        *,
        function: DriveFunction,
        parameters: Parameters,
        warnings: Warnings,
        raise_fault: Callable[[int], None],
        refresh_status: Callable[[], None],
    ) -> None:
        self._scheduler = scheduler
        self._rated_torque_Nm = config.rated_torque_nm
        self._fall_back_s = config.quirks.falls_back_without_power_s
        self._axis = function.axis
        self._core = function.axis.core
        self._function = function
        self._machine = function.machine
        self._parameters = parameters
        self._warnings = warnings
        self._raise_fault = raise_fault
        self._refresh_status = refresh_status
        self.power = models = power
        self._phase_s = 0.0
        self._motor_cap = math.inf
        self._link_state = ""
        self._power_timer: Timer | None = None
        self.dc_link = models.dc_link
        self.motor_overload = models.motor_overload
        self.stage_overload = models.stage_overload
        self.motor = models.motor
        self.stage = models.stage
        self.injected_cap_Nm = math.inf
        """Torque limit set by a test, Nm."""
        self.cap_Nm = math.inf
        """Torque limit in effect because of overload, temperature or a test, Nm."""

    @property
    def derated(self) -> bool:
        """Whether the torque is limited because of overload, temperature or a test."""
        return self._axis.derated

    # -- life ------------------------------------------------------------------------------------------

    def restart(self) -> None:
        """Start after power-on or reset: i2t forgets, what is hot has cooled meanwhile, the DC link is
        charged if mains are there.
        """
        self.power.restart(self._scheduler.now)
        self._phase_s = 0.0
        self._motor_cap = math.inf
        self._cancel_power_timer()
        self._limit_torque()
        self.look_at_link()

    def update(self) -> None:
        """Note the torque of a control cycle; every few cycles advance the models and look at them."""
        power_stage = self.power
        if power_stage.update():
            power_stage.advance(self._scheduler.now)
            self.look_at_link()
            self._look_at_phase(power_stage.dt_s)
            self._look_at_heat()

    # -- heat ------------------------------------------------------------------------------------------

    def _look_at_heat(self) -> None:
        motor, stage = self.motor_overload, self.stage_overload
        thermal = self.power.thermal
        if thermal.overload == "limit":
            rated = self._rated_torque_Nm
            if motor.utilisation >= 1.0 or stage.utilisation >= 1.0:
                self._motor_cap = rated if motor.utilisation >= 1.0 else rated * thermal.stage_overload
            elif motor.utilisation < 0.9 and stage.utilisation < 0.9:
                self._motor_cap = math.inf
            self._limit_torque()
        else:
            if motor.tripped:
                self._raise_fault(faults.OVERLOAD)
            if stage.tripped:
                self._raise_fault(faults.STAGE_OVERLOAD)
        if self.motor.hot:
            self._raise_fault(faults.MOTOR_TEMPERATURE)
        if self.stage.hot:
            self._raise_fault(faults.STAGE_TEMPERATURE)
        self._warnings.show(
            _HEAT,
            (_MOTOR_OVERLOAD if motor.near else 0)
            | (_STAGE_OVERLOAD if stage.near else 0)
            | (_MOTOR_TEMPERATURE if self.motor.warm else 0)
            | (_STAGE_TEMPERATURE if self.stage.warm else 0),
        )

    def _look_at_phase(self, dt_s: float) -> None:
        link = self.dc_link
        if not link.phase_missing or not self._core.enabled:
            self._phase_s = 0.0
            return
        self._phase_s += dt_s
        if self._phase_s >= link.config.phase_loss_time_s:
            self._raise_fault(faults.PHASE_LOSS)

    # -- supply ----------------------------------------------------------------------------------------

    def look_at_link(self) -> None:
        """React to the voltage of the DC link and to the mains (C402-029)."""
        link = self.dc_link
        machine = self._machine
        machine.power_available = not link.low
        if link.chopper_overloaded:
            self._raise_fault(faults.CHOPPER_OVERLOAD)
        self._warnings.show(
            _SUPPLY,
            (_CHOPPER_LOAD if link.chopper_overloaded or link.chopper_load > 0.8 else 0)
            | (0 if link.mains_on else _MAINS_MISSING)
            | (_PHASE_MISSING if link.phase_missing else 0)
            | (_DC_LINK_LOW if link.low else 0),
        )
        state = "high" if link.high else "low" if link.low else ""
        before, self._link_state = self._link_state, state
        if state == "high":
            self._raise_fault(faults.OVERVOLTAGE)
        elif state == "low":
            if machine.state in _WITH_TORQUE:
                self._raise_fault(faults.UNDERVOLTAGE)
            elif machine.state is DriveState.SWITCHED_ON:
                self._fall_back()
        elif before:
            self._cancel_power_timer()
            self._function.evaluate_again()

    def on_switched_on(self) -> None:
        """Note that Switched on has been entered, perhaps without power."""
        if self.dc_link.low:
            self._fall_back()

    def _fall_back(self) -> None:
        delay_s = self._fall_back_s
        if not delay_s:
            self._function.execute(self._machine.disable_voltage())
        elif self._power_timer is None:
            self._power_timer = self._scheduler.after(seconds_to_ns(delay_s), self._power_missed)

    def _power_missed(self) -> None:
        self._power_timer = None
        if self._machine.state is DriveState.SWITCHED_ON and self.dc_link.low:
            self._function.execute(self._machine.disable_voltage())
            self._refresh_status()

    def _cancel_power_timer(self) -> None:
        if self._power_timer is not None:
            self._power_timer.cancel()
            self._power_timer = None

    # -- torque and warnings ---------------------------------------------------------------------------

    def cap_torque(self, torque_Nm: float) -> None:
        """Limit the torque from outside, Nm; inf = not."""
        self.injected_cap_Nm = torque_Nm
        self._limit_torque()

    def _limit_torque(self) -> None:
        cap = min(self._motor_cap, self.injected_cap_Nm)
        if cap != self.cap_Nm:
            self.cap_Nm = cap
            self._axis.protection_cap = cap
            self._parameters.refresh()
            self._warnings.warn(DriveWarning.DERATED, self._motor_cap < math.inf)

    # -- faults ----------------------------------------------------------------------------------------

    def holds(self, code: int) -> bool:
        """Return whether the cause of a latched fault is still there (C402-016)."""
        link = self.dc_link
        if code == faults.OVERLOAD:
            return not self.motor_overload.recovered
        if code == faults.STAGE_OVERLOAD:
            return not self.stage_overload.recovered
        if code == faults.MOTOR_TEMPERATURE:
            return self.motor.warm
        if code == faults.STAGE_TEMPERATURE:
            return self.stage.warm
        if code == faults.UNDERVOLTAGE:
            return link.low
        if code == faults.PHASE_LOSS:
            return link.phase_missing
        return code == faults.CHOPPER_OVERLOAD and link.chopper_overloaded
