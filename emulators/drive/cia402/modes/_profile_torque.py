"""Profile torque mode (C402-074, C402-098)."""

from __future__ import annotations

import math

from typing_extensions import override

from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.modes._base import BIT_10, ModeOfOperation
from emulators.drive.cia402.statemachine import StopOption
from emulators.drive.ramp import STEEPNESS, RampShape, ramp_height


class ProfileTorque(ModeOfOperation):
    """tq: 6071h, reached along a line or an S whose steepest slope is 6087h, within torque and speed limits.

    Quick stop, halt and the other stops with the options 1 and 2 take the torque to zero with 6087h; the axis
    then coasts.
    """

    number = 4
    position_controlled = False

    def __init__(self, axis: ProfileAxis) -> None:
        super().__init__(axis)
        self._start = self._target = 0.0
        self._elapsed = self._length = 0
        self._shape = RampShape.LINEAR
        self._slope = 0.0

    def enter(self) -> None:
        """Begin with the present torque (C402-089)."""
        core = self.axis.core
        torque = core.torque_demand
        core.command_torque(torque)
        self._begin(torque, torque)
        self.cycle()

    @override
    def cycle(self) -> None:
        axis = self.axis
        units = axis.units
        values = axis.values
        wanted = values[0x607100] * units.torque * units.torque_sign
        target = axis.core.limited_torque(wanted)
        if (target > 0.0 and axis.blocked_positive) or (target < 0.0 and axis.blocked_negative):
            target = 0.0
        self.limited = target != wanted
        if (
            target != self._target
            or values[0x608700] * units.torque != self._slope
            or (values[0x608800] == RampShape.SIN2) is not (self._shape is RampShape.SIN2)
        ):
            self._begin(axis.core.commanded_torque, target)
        arrived = self._elapsed >= self._length
        if not arrived:
            steps = min(axis.control_steps, self._length - self._elapsed)
            self._elapsed += steps
            share = ramp_height(self._shape, self._elapsed / self._length)
            axis.core.command_torque(self._start + (self._target - self._start) * share, steps)
        self.status = BIT_10 if arrived and not self.limited else 0

    @override
    def stop(self, option: StopOption) -> None:
        if option <= StopOption.QUICK_STOP:
            self.axis.core.stop_torque(self.axis.values[0x608700] * self.axis.units.torque)
        else:
            super().stop(option)

    @override
    def stopped(self) -> None:
        """Bit 10 when the torque is zero and the axis stands."""
        core = self.axis.core
        self.status = BIT_10 if core.standing and not core.stopping else 0

    @override
    def waiting(self) -> None:
        """No torque is reached yet."""
        self.status = 0

    def _begin(self, start: float, target: float) -> None:
        """Plan the way from one torque to another; a slope of zero stands for none."""
        axis = self.axis
        self._start = start
        self._target = target
        self._elapsed = 0
        self._shape = RampShape.SIN2 if axis.values[0x608800] == RampShape.SIN2 else RampShape.LINEAR
        self._slope = slope = axis.values[0x608700] * axis.units.torque
        time = abs(target - start) * STEEPNESS[self._shape] / slope if slope else 0.0
        self._length = max(1, math.ceil(time / axis.core.period_s - 1e-6)) if target != start else 0
