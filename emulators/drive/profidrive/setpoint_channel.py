"""Setpoint channel of the speed axis: ramp-function generator, jog, dynamic servo control (PD-116, PD-119 to PD-122, PD-195 to PD-198)."""

from __future__ import annotations

import math
from typing import Final

from emulators.drive.core import RPM, ServoCore
from emulators.drive.profidrive.config import DriveSettings
from fieldbus.profidrive.formats import KPC_PER_SECOND, N4_ONE
from fieldbus.profidrive.words import STW1

_RAMP_ENABLED: Final = int(STW1.RAMP_ENABLE)
_RAMP_RUNS: Final = int(STW1.RAMP_RELEASE)
_SETPOINT_ENABLED: Final = int(STW1.SETPOINT_ENABLE)
_ALL: Final = _RAMP_ENABLED | _RAMP_RUNS | _SETPOINT_ENABLED
_JOG: Final = int(STW1.JOG_1 | STW1.JOG_2)
_JOG_1: Final = int(STW1.JOG_1)


class SetpointChannel:
    """Turns control word and setpoints into commands of the servo core.

    Args:
        core: The servo core.
        settings: Parameters; call `refresh` when they have changed.
        steps: Servo steps of a bus cycle.
        interpolation: Whether setpoints without ramp are reached linearly within the bus cycle.

    """

    __slots__ = (
        "_core", "_down", "_gain", "_limit", "_quick", "_scale", "_settings", "_steps", "_up", "dsc", "ramp_scale",
        "sent_angle", "target",
    )  # fmt: skip

    def __init__(self, core: ServoCore, settings: DriveSettings, *, steps: int, interpolation: bool) -> None:
        self._core = core
        self._settings = settings
        self._steps = steps if interpolation else 1
        self._gain = 0.0
        self.ramp_scale = 1.0
        """Share of their slope that all ramps have."""
        self.target = 0.0
        """Speed setpoint in force, rad/s."""
        self.dsc = False
        """Whether the position is controlled by dynamic servo control now."""
        self.sent_angle = 0.0
        """Measured angle that belongs to the G1_XIST1 sent last, rad."""
        self.refresh()

    def refresh(self) -> None:
        """Take changed parameters over."""
        settings = self._settings
        speed = settings.max_speed_rpm * RPM
        self._limit = speed
        self._gain = 2.0 * math.pi / self._core.encoder.counts_per_revolution
        if settings.dsc_encoder == 2:
            self._gain *= settings.dsc_factor  # XERR comes in increments of the other encoder (PD-197)
        self._scale = settings.reference_speed_rpm * RPM / N4_ONE
        self._up = self._slope(speed, settings.ramp_up_s)
        self._down = self._slope(speed, settings.ramp_down_s)
        self._quick = self._slope(speed, settings.quick_stop_s)

    def _slope(self, speed: float, time_s: float) -> float:
        return speed / time_s * self.ramp_scale if time_s else math.inf

    def jogging(self, stw1: int) -> bool:
        """Say whether the control word asks to jog: one of the bits, and no other setpoint (PD-122)."""
        return stw1 & _JOG not in (0, _JOG) and not stw1 & _ALL

    def _jog_speed(self, stw1: int) -> float:
        return self._settings.jog_rpm[0 if stw1 & _JOG_1 else 1] * RPM

    def stop_ramp(self, stw1: int, *, quick: bool) -> None:
        """Brake from the actual speed: OFF1 with p1121, without ramp generator and on OFF3 with p1135 (PD-116)."""
        self.dsc = False
        jogs = bool(stw1 & _JOG) or not stw1 & _ALL
        slope = self._quick if quick or not (stw1 & _RAMP_ENABLED or jogs) else self._down
        self._core.stop(slope)

    def step(self, stw1: int, nsoll: int, xerr: int, kpc: int) -> None:
        """Command the servo core for a bus cycle of operation (S4).

        Args:
            stw1: Control word in force.
            nsoll: Speed setpoint, N4.
            xerr: Position deviation, increments of G1_XIST1.
            kpc: Gain, 0.001 1/s; 0 = no dynamic servo control.

        """
        core = self._core
        self.dsc = False
        if stw1 & _JOG and not stw1 & _ALL:
            self.target = self._jog_speed(stw1) if self.jogging(stw1) else 0.0
            core.ramp(self.target, self._up, deceleration=self._down)
            return
        target = nsoll * self._scale
        limit = self._limit
        if target > limit:
            target = limit
        elif target < -limit:
            target = -limit
        self.target = target
        if self._settings.operating_mode == 3:
            if stw1 & (_RAMP_ENABLED | _SETPOINT_ENABLED) == _RAMP_ENABLED | _SETPOINT_ENABLED:
                if kpc > 0:
                    self.dsc = True
                    reference = self.sent_angle + xerr * self._gain
                    core.command_servo(target, reference, kpc / KPC_PER_SECOND, self._steps)
                else:
                    core.command_velocity(target, self._steps)
                return
            self.target = 0.0
            if stw1 & _RAMP_ENABLED:
                core.ramp(0.0, self._down)
            else:
                core.command_velocity(0.0, 1)
            return
        if not stw1 & _RAMP_ENABLED:
            self.target = 0.0
            core.ramp(0.0, self._quick)
        elif not stw1 & _RAMP_RUNS:
            core.ramp(core.precontrol_velocity, self._up, deceleration=self._down)
        else:
            if not stw1 & _SETPOINT_ENABLED:
                self.target = 0.0
            core.ramp(self.target, self._up, deceleration=self._down)
