"""Positions that are reached linearly within a period, as far as the limits allow (C402-100, C402-164)."""

from __future__ import annotations

import math

from emulators.drive.cia402.axis import ProfileAxis


class PositionFollower:
    """Follows commanded positions within software limits, speed limits, 60C5h and 60C6h.

    Args:
        axis: The motor as the profile sees it.

    """

    def __init__(self, axis: ProfileAxis) -> None:
        self._axis = axis
        self.velocity = 0.0
        """Velocity of the present period, rad/s."""
        self._last_target: float | None = None

    def restart(self, velocity: float) -> None:
        """Begin with a velocity, rad/s; there is no target before the next one."""
        self.velocity = velocity
        self._last_target = None

    def go_to(self, wanted: int, steps: int) -> bool:
        """Go on to a position within servo steps; returns whether a limit holds the axis back.

        Args:
            wanted: Position units.
            steps: Servo steps, >= 1.

        """
        axis = self._axis
        values = axis.values
        core = axis.core
        units = axis.units
        allowed = axis.within_software_limits(wanted)
        target = axis.angle_of(allowed)
        start = core.position_command
        if axis.synchronised:
            # A SYNC that comes early or late does not shift the grid on which setpoints are reached.
            shift = core.phase_steps
            if -steps < 2 * shift < steps:
                steps += shift
        duration = steps * core.period_s
        distance = target - start
        velocity = distance / duration
        last = self.velocity
        faster = values[0x60C500] * units.acceleration
        slower = values[0x60C600] * units.acceleration
        high, low = axis.forward_speed, axis.backward_speed
        if faster and slower:
            high = min(high, last + (faster if last >= 0.0 else slower) * duration)
            low = max(low, last - (faster if last <= 0.0 else slower) * duration)
            # Who catches up with a target must be able to brake down to the velocity of the target.
            previous, self._last_target = self._last_target, target
            moving = last if previous is None else (target - previous) / duration
            braking = math.sqrt(2.0 * slower * abs(distance))
            if distance >= 0.0:
                high = min(high, max(moving, 0.0) + braking)
            else:
                low = max(low, min(moving, 0.0) - braking)
        low = max(low, axis.backward_speed) if low <= high else high
        reachable = velocity
        if velocity > high:
            reachable = high
        elif velocity < low:
            reachable = low
        if (reachable > 0.0 and axis.blocked_positive) or (reachable < 0.0 and axis.blocked_negative):
            reachable = 0.0
        self.velocity = reachable
        if reachable != velocity:
            axis.demand_excess = target - (start + reachable * duration)
            target = start + reachable * duration
        else:
            axis.demand_excess = 0.0
        # A velocity offset from the controller takes the place of the drive's own pre-control.
        offset = values[0x60B100]
        core.command_position(
            target,
            steps,
            precontrol=offset * units.velocity * units.velocity_sign if offset else None,
            coast=axis.period_steps,
        )
        torque = values[0x60B200]
        if torque or core.torque_offset:
            core.torque_offset = torque * units.torque * units.torque_sign
        return bool(allowed != wanted or reachable != velocity)
