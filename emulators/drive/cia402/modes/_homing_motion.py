"""How a homing run moves: speeds and acceleration of its start, the drive's own position profile,
torque-limited pressing.
"""

from __future__ import annotations

from typing import Final

from emulators.drive.cia402.axis import ProfileAxis
from emulators.drive.cia402.modes._base import ModeOfOperation
from emulators.drive.ramp import TRAPEZOID

_FAR_RAD: Final = 1e6
"""A target that is never reached."""
_STEEPEST: Final = 1e9
"""rad/s^2 that stand for "no limit"."""

THRESHOLD: Final = 0x201001
DETECTION_TIME: Final = 0x201002
RETRACTION: Final = 0x201003
TIME_OUT: Final = 0x201004
SEARCH_DISTANCE: Final = 0x201005
"""Keys of the manufacturer's homing parameters (2010h)."""


class HomingMotion(ModeOfOperation):
    """The motions of homing mode; 6099h, 609Ah and 6086h are those of the start of the run."""

    __slots__ = ("_acceleration", "_direction", "_fast_speed", "_form", "_slow", "_slow_speed")

    def __init__(self, axis: ProfileAxis) -> None:
        super().__init__(axis)
        self._direction = 0
        """Where the axis moves: -1, +1, 0 = to rest."""
        self._slow = False
        self._fast_speed = self._slow_speed = 0.0
        self._acceleration = _STEEPEST
        self._form = TRAPEZOID

    def _read_dynamics(self) -> None:
        axis = self.axis
        values = axis.values
        self._fast_speed = min(float(values[0x609901]) * axis.units.velocity, axis.max_speed)
        self._slow_speed = min(float(values[0x609902]) * axis.units.velocity, axis.max_speed)
        self._acceleration = min(axis.acceleration(0x609A, 0x60C5), _STEEPEST)
        self._form = axis.profile_form()

    def _move(self, direction: int) -> None:
        """Move in a direction until told otherwise: fast, or slowly once an edge has been passed
        (C402-133).
        """
        self._direction = direction
        self._go_to(
            self.axis.core.position_command + direction * _FAR_RAD,
            self._slow_speed if self._slow else self._fast_speed,
        )

    def _go_to(self, angle: float, speed: float) -> None:
        """Move to an angle, rad, with a speed > 0, rad/s."""
        self.axis.core.follow_profile().move(
            angle,
            velocity=speed,
            acceleration=self._acceleration,
            deceleration=self._acceleration,
            form=self._form,
        )

    def _press_against(self, direction: int) -> None:
        """Move slowly against a stop, with no more torque than the threshold (C402-131)."""
        axis = self.axis
        axis.torque_cap = axis.values[THRESHOLD] * axis.units.torque
        axis.refresh()
        self._direction = direction
        # Velocity control: a position loop would wind up a following error at the stop.
        axis.core.ramp(direction * self._slow_speed, self._acceleration)

    def _free_torque(self) -> None:
        """End the limit of `_press_against`."""
        if self.axis.torque_cap is not None:
            self.axis.torque_cap = None
            self.axis.refresh()

    def _come_to_rest(self) -> None:
        self._direction = 0
        self.axis.core.stop(self._acceleration, track_position=True)
