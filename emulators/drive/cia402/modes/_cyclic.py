"""Cyclic synchronous modes: position, velocity, torque (C402-100 to C402-104)."""

from __future__ import annotations

from typing_extensions import override

from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.modes._base import BIT_12, BIT_13, ModeOfOperation
from emulators.drive.cia402.modes._position_follower import PositionFollower


class _CyclicMode(ModeOfOperation):
    """A setpoint with every SYNC; without SYNC the setpoint is taken in every control cycle."""

    cyclic = True
    tells_arrival = False

    def __init__(self, axis: ProfileAxis) -> None:
        super().__init__(axis)
        self._started = False

    @property
    @override
    def torque_offset(self) -> float:
        """60B2h."""
        units = self.axis.units
        return float(self.axis.values[0x60B200] * units.torque * units.torque_sign)

    @override
    def enter(self) -> None:
        self.missed = 0
        self._started = False
        self.axis.fresh = False

    @override
    def sync(self) -> None:
        axis = self.axis
        if axis.fresh:
            axis.fresh = False
            self.missed = 0
            self._started = True
        elif axis.supervised and self._started:
            # Monitoring begins with the first setpoint. Velocity and torque stay as they are; a position
            # continues with its velocity for one more period (C402-104).
            self.missed += 1
            axis.missing_count += 1
            return
        self._apply(axis.period_steps)

    @override
    def cycle(self) -> None:
        axis = self.axis
        if not axis.synchronised:
            self._apply(axis.control_steps)
        self.status = 0 if self.limited else BIT_12
        if self.following_error:
            self.status |= BIT_13

    @override
    def stopped(self) -> None:
        self.status = 0

    def _apply(self, steps: int) -> None:
        """Take the setpoint to be reached within a number of servo steps."""
        raise NotImplementedError


class CyclicVelocity(_CyclicMode):
    """csv: 60FFh + 60B1h, reached linearly within 60C2h."""

    number = 9
    position_controlled = False
    target_key = 0x60FF00

    def __init__(self, axis: ProfileAxis) -> None:
        super().__init__(axis)
        self._last: int | None = None

    @override
    def enter(self) -> None:
        super().enter()
        core = self.axis.core
        core.command_velocity(core.precontrol_velocity, 1)
        self._last = None

    def _apply(self, steps: int) -> None:
        axis = self.axis
        values = axis.values
        core = axis.core
        target = values[0x60FF00] + values[0x60B100]
        offset = values[0x60B200]
        if offset or core.torque_offset:
            core.torque_offset = offset * axis.units.torque * axis.units.torque_sign
        if target == self._last and not core.interpolating:
            return
        units = axis.units
        wanted = target * units.velocity * units.velocity_sign
        velocity = axis.allowed_velocity(wanted)
        self.limited = velocity != wanted
        # A value that is held back is looked at again: the limit may go.
        self._last = None if velocity != wanted else target
        core.command_velocity(velocity, steps if axis.config.csv_interpolation else 1)


class CyclicTorque(_CyclicMode):
    """cst: 6071h + 60B2h within torque and speed limits."""

    number = 10
    position_controlled = False
    target_key = 0x607100

    @property
    @override
    def torque_offset(self) -> float:
        """60B2h is part of the command here."""
        return 0.0

    def enter(self) -> None:
        """Begin with the present torque (C402-089)."""
        super().enter()
        self.axis.core.command_torque(self.axis.core.torque_demand)

    def _apply(self, _steps: int) -> None:
        axis = self.axis
        values = axis.values
        torque = (values[0x607100] + values[0x60B200]) * axis.units.torque * axis.units.torque_sign
        blocked = (torque > 0.0 and axis.blocked_positive) or (torque < 0.0 and axis.blocked_negative)
        self.limited = blocked
        axis.core.command_torque(0.0 if blocked else torque)


class CyclicPosition(_CyclicMode):
    """csp: 607Ah + 60B0h, reached linearly within 60C2h.

    It starts with the present velocity, for at most one period, so that a controller that continues as the
    axis moves makes no jump.
    """

    number = 8
    target_key = 0x607A00

    def __init__(self, axis: ProfileAxis) -> None:
        super().__init__(axis)
        self._follower = PositionFollower(axis)
        self._unprimed = axis.config.quirks.csp_jumps_unprimed

    def enter(self) -> None:
        """Go on with the present velocity until the first setpoint comes."""
        super().enter()
        axis = self.axis
        core = axis.core
        follower = self._follower
        if not axis.primed:
            follower.restart(0.0)
            self.rest()
            return
        velocity = core.velocity if core.controls_torque else core.precontrol_velocity
        follower.restart(velocity)
        steps = axis.period_steps
        core.command_position(
            core.position_ahead + velocity * steps * core.period_s, steps, precontrol=velocity
        )

    def _apply(self, steps: int) -> None:
        axis = self.axis
        if not axis.primed and not self._unprimed:
            # There has been no target since power-on: stay where `enter` holds.
            self._follower.velocity = axis.core.precontrol_velocity
            return
        values = axis.values
        self.limited = self._follower.go_to(values[0x607A00] + values[0x60B000], steps)
