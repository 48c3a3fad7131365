"""Setpoint channel of the speed axis: ramp-function generator, jog, dynamic servo control (PD-116, PD-119 to
PD-122, PD-195 to PD-198).
"""

from __future__ import annotations

import math
from typing import Final

from emulators.drive.core import RPM, ServoCore
from emulators.drive.profidrive.config import DriveSettings
from emulators.drive.rounded_ramp import RoundedRamp, Rounding
from fieldbus.profidrive.formats import KPC_PER_SECOND, N4_ONE
from fieldbus.profidrive.words import STW1

_RAMP_ENABLED: Final = int(STW1.RAMP_ENABLE)
_RAMP_RUNS: Final = int(STW1.RAMP_RELEASE)
_SETPOINT_ENABLED: Final = int(STW1.SETPOINT_ENABLE)
_ALL: Final = _RAMP_ENABLED | _RAMP_RUNS | _SETPOINT_ENABLED
_JOG: Final = int(STW1.JOG_1 | STW1.JOG_2)
_JOG_1: Final = int(STW1.JOG_1)
_INVERTED: Final = int(STW1.BIT_11)
_RAISE: Final = int(STW1.BIT_13)
_LOWER: Final = int(STW1.BIT_14)


class SetpointChannel:
    """Turns control word and setpoints into commands of the servo core.

    Args:
        core: The servo core.
        settings: Parameters; call `refresh` when they have changed.
        steps: Servo steps of a bus cycle.
        cycle_s: Bus cycle, s.
        interpolation: Whether setpoints without ramp are reached linearly within the bus cycle.

    """

    def __init__(
        self, core: ServoCore, settings: DriveSettings, *, steps: int, cycle_s: float, interpolation: bool
    ) -> None:
        self._core = core
        self._settings = settings
        self._steps = steps if interpolation else 1
        self._gain = 0.0
        self._cycle_s = cycle_s
        self._rounded = RoundedRamp()
        self.potentiometer = 0.0
        """Setpoint of the motor potentiometer, rad/s."""
        self.ramp_scale = 1.0
        """Share of their slope that all ramps have."""
        self.target = 0.0
        """Speed setpoint in effect, rad/s."""
        self.dsc = False
        """Whether the position is controlled by dynamic servo control now."""
        self.sent_angle = 0.0
        """Measured angle that belongs to the G1_XIST1 sent last, rad."""
        self.refresh()

    def refresh(self) -> None:
        """Take changed parameters over."""
        settings = self._settings
        speed = settings.max_speed_rpm * RPM
        self._gain = 2.0 * math.pi / self._core.encoder.counts_per_revolution
        if settings.dsc_encoder == 2:
            self._gain *= settings.dsc_factor  # XERR comes in increments of the other encoder (PD-197)
        high, low = settings.speed_limits_rpm
        self._high, self._low = min(speed, high * RPM), -min(speed, low * RPM)
        self._potentiometer_step = (
            speed / settings.motor_potentiometer_s * self._cycle_s if settings.motor_potentiometer else 0.0
        )
        self._scale = settings.reference_speed_rpm * RPM / N4_ONE
        self._up = self._slope(speed, settings.ramp_up_s)
        self._down = self._slope(speed, settings.ramp_down_s)
        self._quick = self._slope(speed, settings.quick_stop_s)
        self._shape = self._rounding(self._up, self._down, settings.rounding_s)
        self._quick_shape = self._rounding(self._quick, self._quick, settings.quick_rounding_s)

    def _slope(self, speed: float, time_s: float) -> float:
        return speed / time_s * self.ramp_scale if time_s else math.inf

    def _rounding(self, up: float, down: float, times_s: tuple[float, float]) -> Rounding | None:
        """Return the shape of the ramps with rounding; None without, or where there is no ramp to round."""
        if not any(times_s) or math.inf in {up, down}:
            return None
        return Rounding(up, down, *times_s, continuous=not self._settings.rounding_breaks_off)

    def _ramp(self, target: float) -> None:
        shape = self._shape
        if shape is None:
            self._core.ramp(target, self._up, deceleration=self._down)
            return
        self._rounded.aim(self._core.precontrol_velocity, target, shape)
        self._core.ramp(target, self._up, deceleration=self._down, rounded=self._rounded)

    def inhibited(self) -> None:
        """The pulses have been taken away: the motor potentiometer begins at 0 again."""
        self.dsc = False
        self.potentiometer = 0.0
        self._rounded.hold()

    def jogging(self, stw1: int) -> bool:
        """Say whether the control word asks to jog: one of the bits, and no other setpoint (PD-122)."""
        return stw1 & _JOG not in (0, _JOG) and not stw1 & _ALL

    def _jog_speed(self, stw1: int) -> float:
        return self._settings.jog_rpm[0 if stw1 & _JOG_1 else 1] * RPM

    def stop_ramp(self, stw1: int, *, quick: bool) -> None:
        """Brake from the actual speed: OFF1 with p1121, without ramp generator
        and on OFF3 with p1135 (PD-116).
        """
        self.dsc = False
        jogs = bool(stw1 & _JOG) or not stw1 & _ALL
        quick = quick or not (stw1 & _RAMP_ENABLED or jogs)
        shape = self._quick_shape if quick else self._shape
        self._core.stop(
            self._quick if quick else self._down,
            rounded=None if shape is None else (self._rounded, shape),
        )

    def step(self, stw1: int, nsoll: int, xerr: int, kpc: int) -> None:
        """Command the servo core for a bus cycle of operation (S4).

        Args:
            stw1: Control word in effect.
            nsoll: Speed setpoint, N4.
            xerr: Position deviation, increments of G1_XIST1.
            kpc: Gain, 0.001 1/s; 0 = no dynamic servo control.

        """
        core = self._core
        self.dsc = False
        if stw1 & _JOG and not stw1 & _ALL:
            self.target = self._jog_speed(stw1) if self.jogging(stw1) else 0.0
            self._ramp(self.target)
            return
        target = nsoll * self._scale
        if self._settings.inverted_by_bit and stw1 & _INVERTED:
            target = -target
        if self._potentiometer_step:
            target += self._turn_potentiometer(stw1)
        if target > self._high:
            target = self._high
        elif target < self._low:
            target = self._low
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
            self._rounded.hold()
            core.ramp(core.precontrol_velocity, self._up, deceleration=self._down)
        else:
            if not stw1 & _SETPOINT_ENABLED:
                self.target = 0.0
            self._ramp(self.target)

    def _turn_potentiometer(self, stw1: int) -> float:
        """Raise or lower the setpoint of the motor potentiometer and return it, rad/s (PD-057, PD-058)."""
        step = bool(stw1 & _RAISE) - bool(stw1 & _LOWER)
        if step:
            turned = self.potentiometer + step * self._potentiometer_step
            self.potentiometer = min(max(turned, self._low), self._high)
        return self.potentiometer
