"""Overload, temperatures, DC link and warnings of the drive (C402-029, C402-041, C402-160).

The models are those of `emulators.drive.power_stage`; here is what the drive does about them.
"""

from __future__ import annotations

import math
from enum import IntFlag
from typing import TYPE_CHECKING, Final

from emulators.drive.cia402.faults import codes as faults
from fieldbus.cia402 import DriveState
from fieldbus.clock import Timer, seconds_to_ns

if TYPE_CHECKING:
    from emulators.drive.cia402.drive import CiA402Drive

_WITH_TORQUE: Final = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)


class DriveWarning(IntFlag):
    """Causes of bit 7 of the status word: 1002h and 2100h."""

    MOTOR_OVERLOAD = 1 << 0
    """i2t of the motor within 5 % of its end."""
    STAGE_OVERLOAD = 1 << 1
    MOTOR_TEMPERATURE = 1 << 2
    STAGE_TEMPERATURE = 1 << 3
    CHOPPER_LOAD = 1 << 4
    """Brake resistor above 80 % of what it bears for ever, or switched off."""
    MAINS_MISSING = 1 << 5
    PHASE_MISSING = 1 << 6
    DC_LINK_LOW = 1 << 7
    TORQUE_OFF = 1 << 8
    """Safe torque off is in force."""
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
    """Interpolated position mode has run out of set-points (C402-099)."""
    INJECTED = 1 << 31
    """Set by a test."""

    @property
    def text(self) -> str:
        """The causes in words."""
        return ", ".join((one.name or "").lower().replace("_", " ") for one in type(self) if one in self)


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
        drive: The drive.

    """

    __slots__ = (
        "_core",
        "_drive",
        "_link_state",
        "_motor_cap",
        "_phase_s",
        "_power_timer",
        "cap_Nm",
        "dc_link",
        "injected_cap_Nm",
        "motor",
        "motor_overload",
        "power",
        "stage",
        "stage_overload",
        "warnings",
    )  # fmt: skip

    def __init__(self, drive: CiA402Drive) -> None:
        self._drive = drive
        self._core = drive.core
        self.power = models = drive.power
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
        """Torque limit in force because of overload, temperature or a test, Nm."""
        self.warnings = 0
        """Present warnings, bits of `DriveWarning`."""

    # -- life ------------------------------------------------------------------------------------------

    def restart(self) -> None:
        """Start after power-on or reset: i2t forgets, what is hot has cooled meanwhile, the DC link is
        charged if mains are there.
        """
        self.power.restart(self._drive.now_ns)
        self._phase_s = 0.0
        self._motor_cap = math.inf
        self._cancel_power_timer()
        self._limit_torque()
        self.look_at_link()

    def update(self) -> None:
        """Note the torque of a control cycle; every few cycles advance the models and look at them."""
        power_stage = self.power
        if power_stage.update(self._drive.scheduler.now):
            self.look_at_link()
            self._look_at_phase(power_stage.dt_s)
            self._look_at_heat()

    # -- heat ------------------------------------------------------------------------------------------

    def _look_at_heat(self) -> None:
        drive = self._drive
        motor, stage = self.motor_overload, self.stage_overload
        thermal = drive.config.thermal
        if thermal.overload == "limit":
            rated = drive.config.rated_torque_Nm
            if motor.utilisation >= 1.0 or stage.utilisation >= 1.0:
                self._motor_cap = rated if motor.utilisation >= 1.0 else rated * thermal.stage_overload
            elif motor.utilisation < 0.9 and stage.utilisation < 0.9:
                self._motor_cap = math.inf
            self._limit_torque()
        else:
            if motor.tripped:
                drive.raise_fault(faults.OVERLOAD)
            if stage.tripped:
                drive.raise_fault(faults.STAGE_OVERLOAD)
        if self.motor.hot:
            drive.raise_fault(faults.MOTOR_TEMPERATURE)
        if self.stage.hot:
            drive.raise_fault(faults.STAGE_TEMPERATURE)
        self._show(
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
            self._drive.raise_fault(faults.PHASE_LOSS)

    # -- supply ----------------------------------------------------------------------------------------

    def look_at_link(self) -> None:
        """React to the voltage of the DC link and to the mains (C402-029)."""
        link = self.dc_link
        drive = self._drive
        machine = drive.machine
        machine.power_available = not link.low
        if link.chopper_overloaded:
            drive.raise_fault(faults.CHOPPER_OVERLOAD)
        self._show(
            _SUPPLY,
            (_CHOPPER_LOAD if link.chopper_overloaded or link.chopper_load > 0.8 else 0)
            | (0 if link.mains_on else _MAINS_MISSING)
            | (_PHASE_MISSING if link.phase_missing else 0)
            | (_DC_LINK_LOW if link.low else 0),
        )
        state = "high" if link.high else "low" if link.low else ""
        before, self._link_state = self._link_state, state
        if state == "high":
            drive.raise_fault(faults.OVERVOLTAGE)
        elif state == "low":
            if machine.state in _WITH_TORQUE:
                drive.raise_fault(faults.UNDERVOLTAGE)
            elif machine.state is DriveState.SWITCHED_ON:
                self._fall_back()
        elif before:
            self._cancel_power_timer()
            drive.function.evaluate_again()

    def on_switched_on(self) -> None:
        """Note that Switched on has been entered, perhaps without power."""
        if self.dc_link.low:
            self._fall_back()

    def _fall_back(self) -> None:
        delay_s = self._drive.config.quirks.falls_back_without_power_s
        if not delay_s:
            self._drive.function.execute(self._drive.machine.disable_voltage())
        elif self._power_timer is None:
            self._power_timer = self._drive.scheduler.after(seconds_to_ns(delay_s), self._power_missed)

    def _power_missed(self) -> None:
        self._power_timer = None
        drive = self._drive
        if drive.machine.state is DriveState.SWITCHED_ON and self.dc_link.low:
            drive.function.execute(drive.machine.disable_voltage())
            drive.refresh_status()

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
            drive = self._drive
            drive.axis.protection_cap = cap
            drive.refresh_parameters()
            self.warn(DriveWarning.DERATED, self._motor_cap < math.inf)

    def warn(self, bit: DriveWarning, present: bool) -> None:
        """Show a warning, or take it back: bit 7 of the status word, 1002h, 2100h."""
        self._show(int(bit), int(bit) if present else 0)

    def _show(self, mask: int, bits: int) -> None:
        """Set the warnings in `mask` to `bits`."""
        before = self.warnings
        if before & mask != bits:
            self.warnings = before & ~mask | bits
            self._drive.show_warnings(DriveWarning(self.warnings))

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
