"""Profile velocity mode (C402-097, C402-157 to C402-159)."""

from __future__ import annotations

from collections.abc import Callable

from typing_extensions import override

from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.modes._base import BIT_10, BIT_12, BIT_13, ModeOfOperation
from emulators.drive.protection import WindowTimer


class ProfileVelocity(ModeOfOperation):
    """pv: the drive ramps to 60FFh with 6083h and 6084h; changes count at once."""

    number = 3
    position_controlled = False

    def __init__(self, axis: ProfileAxis) -> None:
        super().__init__(axis)
        self._command: tuple[float, float, float] | None = None
        self._within = WindowTimer()
        self._standing = WindowTimer()
        self.on_slippage: Callable[[], None] | None = None
        """Called when bit 13 comes, if slippage is a fault."""

    @override
    def enter(self) -> None:
        self._command = None
        self._within.reset()
        self._standing.reset()
        self.cycle()

    @override
    def cycle(self) -> None:
        axis = self.axis
        values = axis.values
        wanted = values[0x60FF00] * axis.units.velocity * axis.units.velocity_sign
        target = axis.allowed_velocity(wanted)
        self.limited = target != wanted
        command = (target, axis.acceleration(0x6083, 0x60C5), axis.acceleration(0x6084, 0x60C6))
        if command != self._command:
            self._command = command
            axis.core.ramp(target, command[1], deceleration=command[2])
        self._judge()

    @override
    def stopped(self) -> None:
        self._judge()
        self.status = (self.status & ~BIT_10) | (0 if self.axis.core.stopping else BIT_10)

    @override
    def waiting(self) -> None:
        """The target is reached only if it is standstill."""
        self._judge()

    def resume(self) -> None:
        """Ramp to the target again (C402-076)."""
        self.enter()

    def _judge(self) -> None:
        axis = self.axis
        values = axis.values
        actual = axis.actual_velocity
        dt = axis.control_period_s
        self._within.time_s = values[0x606E00] * 1e-3
        self._standing.time_s = values[0x607000] * 1e-3
        status = 0
        if self._within.update(abs(actual - values[0x60FF00]) <= values[0x606D00], dt):
            status |= BIT_10
        # Bit 12 goes to 0 only after the speed has been above the threshold for the time of 6070h.
        if not self._standing.update(abs(actual) > values[0x606F00], dt):
            status |= BIT_12
        slippage = values[0x60F800]
        if slippage > 0 and abs(axis.demand_velocity - actual) > slippage:
            status |= BIT_13
            if not self.status & BIT_13 and self.on_slippage is not None:
                self.on_slippage()
        self.status = status
