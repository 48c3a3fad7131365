"""Velocity mode of the frequency converter profile (C402-033 to C402-035, C402-074, C402-096)."""

from __future__ import annotations

from typing import Final

from typing_extensions import override

from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.modes._base import ModeOfOperation
from emulators.drive.cia402.statemachine import StopOption
from emulators.drive.core import RPM

FULL: Final = 16383
"""100 % of 604Eh in 6052h to 6055h."""
_ENABLE_RAMP: Final = 0x10
_UNLOCK_RAMP: Final = 0x20
_REFERENCE_RAMP: Final = 0x40


class Velocity(ModeOfOperation):
    """vl: 6042h, times 604Bh and 604Ch in rpm, limited by 6047h, reached with the ramps 6048h and 6049h.

    Bit 4 of the control word = 0 brakes as a halt does, bit 5 = 0 keeps the output of the ramp, bit 6 = 0
    puts zero on its input. All three have to be 1 for the target to count. The target 0 is standstill, also
    with a minimum speed.
    """

    number = 2
    position_controlled = False
    tells_arrival = False

    def __init__(self, axis: ProfileAxis) -> None:
        super().__init__(axis)
        self._command: tuple[float, float, float] | None = None
        self._word = 0

    @override
    def enter(self) -> None:
        self._command = None
        self._word = self.axis.control_word
        self.cycle()

    def control(self, word: int, _changed: int) -> None:
        """Take the bits of the ramp; they count in the next control cycle."""
        self._word = word

    @override
    def cycle(self) -> None:
        axis = self.axis
        word = self._word
        acceleration = ramp_slope(axis, 0x6048, 0x60C5)
        deceleration = ramp_slope(axis, 0x6049, 0x60C6)
        self.limited = False
        if not word & _ENABLE_RAMP:
            target = 0.0
            deceleration = self.stop_slope(axis.halt_option)
        elif not word & _UNLOCK_RAMP:
            target = axis.core.precontrol_velocity
        elif not word & _REFERENCE_RAMP:
            target = 0.0
        else:
            target = self._target()
        command = (target, acceleration, deceleration)
        if command != self._command:
            self._command = command
            axis.core.ramp(target, acceleration, deceleration=deceleration)

    @override
    def stopped(self) -> None:
        """Bits 10, 12 and 13 are reserved."""
        self.status = 0

    @override
    def stop_slope(self, option: StopOption) -> float:
        """6049h and 604Ah (C402-074)."""
        if option == StopOption.SLOW_DOWN:
            return ramp_slope(self.axis, 0x6049, 0x60C6)
        if option == StopOption.QUICK_STOP:
            return ramp_slope(self.axis, 0x604A, 0x60C6)
        return super().stop_slope(option)

    def _target(self) -> float:
        """Return the input of the ramp, rad/s."""
        axis = self.axis
        values = axis.values
        speed = values[0x604200] * scale(axis)
        # 6047h: amounts for positive and negative speeds of the user.
        lowest, highest = (0x604701, 0x604702) if speed >= 0.0 else (0x604703, 0x604704)
        amount = abs(speed)
        if amount:
            amount = max(amount, values[lowest])
        amount = min(amount, values[highest])
        self.limited = amount != abs(speed)
        wanted = (amount if speed >= 0.0 else -amount) * RPM * axis.units.velocity_sign
        allowed = axis.allowed_velocity(wanted)
        if allowed != wanted:
            self.limited = True
        return allowed


def scale(axis: ProfileAxis) -> float:
    """Return what one unit of 6042h to 6044h is, rpm (604Bh and 604Ch)."""
    values = axis.values
    return (
        (values[0x604B01] or 1) / (values[0x604B02] or 1) * (values[0x604C01] or 1) / (values[0x604C02] or 1)
    )


def ramp_slope(axis: ProfileAxis, index: int, limit_index: int) -> float:
    """Return a ramp of delta speed (rpm) per delta time (s) within its limit object, rad/s^2; 0 stands for
    the limit.
    """
    values = axis.values
    speed, time = values[index << 8 | 1], values[index << 8 | 2]
    limit = values[limit_index << 8] * axis.units.acceleration or float("inf")
    return (min(speed / time * RPM, limit) if speed and time else limit) * axis.ramp_scale


def in_units(axis: ProfileAxis, velocity: float) -> int:
    """Return a velocity (rad/s) as 6043h and 6044h show it."""
    return _within(velocity / RPM / scale(axis) * axis.units.velocity_sign)


def percentage(axis: ProfileAxis, velocity: float) -> int:
    """Return a velocity (rad/s) as 6053h to 6055h show it: 16383 is 604Eh."""
    reference = axis.values[0x604E00]
    return _within(velocity / RPM * FULL / reference * axis.units.velocity_sign) if reference else 0


def _within(value: float) -> int:
    return min(max(round(value), -0x8000), 0x7FFF)
