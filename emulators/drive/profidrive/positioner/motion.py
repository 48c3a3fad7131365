"""Motion of the basic positioner: what a task wants, put into the position profile of the servo core."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from emulators.drive.core import ServoCore
from emulators.drive.positioner_config import PositionerSettings

_FAR: Final = 1e12
"""Target of a motion without one, LU."""


class Motion(NamedTuple):
    """A motion as it is wanted; a target that is infinite is a direction."""

    target: float
    velocity: float
    acceleration: float
    deceleration: float
    end_velocity: float = 0.0
    relative: bool = False
    """The way counts, not the place: it is kept when positions get other numbers."""


class ProfileMotion:
    """Positions in LU on the profile of a servo core.

    Args:
        core: The servo core.
        settings: Scaling and limits.

    """

    def __init__(self, core: ServoCore, settings: PositionerSettings) -> None:
        self._core = core
        self._settings = settings
        self.scale = 0.0
        """Size of an LU, rad."""
        self.offset = 0.0
        """Measured angle of position 0, rad."""
        self.clear()
        self.apply(settings)

    def apply(self, settings: PositionerSettings) -> None:
        """Take changed settings over."""
        self._settings = settings
        self.scale = 2.0 * math.pi / settings.lu_per_revolution

    def clear(self) -> None:
        """Forget what was planned; the drive has taken the pulses away."""
        self.planned: Motion | None = None
        """What the profile does."""
        self.halted = False
        """The task is kept, but the axis stands or brakes."""
        self.held = False
        """That is so because of an intermediate stop."""
        self.moving = False
        """The profile is under way."""
        self._braking = 0.0
        """Deceleration with which it brakes, 1000 LU/s2; 0 while it does not."""

    @property
    def position(self) -> float:
        """Measured position, LU (XIST_A)."""
        return (self._core.position - self.offset) / self.scale

    @property
    def demand(self) -> float:
        """Position demand, LU."""
        return (self._core.position_command - self.offset) / self.scale

    @property
    def following_error(self) -> float:
        """Following error, LU; 0 while no position is controlled."""
        return self._core.following_error / self.scale if self._core.controls_position else 0.0

    @property
    def velocity(self) -> float:
        """Measured velocity, 1000 LU/min (VIST_A)."""
        return self._core.velocity / self.scale * 60.0 / 1000.0

    def drive(
        self, wanted: Motion | None, *, override: float, held: bool, limits: tuple[float, float] | None
    ) -> None:
        """Let the profile do what is wanted; plan only when that has changed.

        Args:
            wanted: Motion of the task; None = stand, braking with the maximum deceleration.
            override: Share of the velocity, 0..2.
            held: Stand, but keep the task.
            limits: Software limits in effect, LU.

        """
        settings = self._settings
        self.held = held
        if wanted is None:
            self._brake(settings.max_deceleration)
            return
        velocity = min(wanted.velocity * override, settings.max_velocity)
        self.halted = held or velocity <= 0.0
        if self.halted:
            self._brake(wanted.deceleration)
            return
        target = wanted.target
        if limits is not None:
            target = min(max(target, limits[0]), limits[1])
        end_velocity = min(wanted.end_velocity * override, velocity)
        planned = wanted._replace(
            target=min(max(target, -_FAR), _FAR), velocity=velocity, end_velocity=end_velocity
        )
        profile = self._core.follow_profile()
        angle = planned.target * self.scale + self.offset
        # A stop of the drive in between has reset the profile: then its target is another one.
        if planned != self.planned or profile.target != angle:
            self.planned = planned
            self.moving = True
            self._braking = 0.0
            profile.move(
                angle,
                velocity=self._speed(planned.velocity),
                acceleration=self._slope(planned.acceleration),
                deceleration=self._slope(planned.deceleration),
                end_velocity=self._speed(planned.end_velocity),
            )

    def _brake(self, deceleration: float) -> None:
        """Brake to standstill from the present demand; a stop in progress may become steeper."""
        if not self.moving and self._core.controls_position:
            return
        profile = self._core.follow_profile()
        if not self.moving and profile.velocity == 0.0:
            return  # it has just been enabled at standstill: it holds its place
        if self.planned is not None or not self.moving or deceleration > self._braking:
            self.planned = None
            self.moving = True
            self._braking = deceleration
            slope = self._slope(deceleration)
            speed = profile.velocity
            profile.move(
                profile.position + 0.5 * speed * abs(speed) / slope,
                velocity=max(abs(speed), 1e-6),
                acceleration=slope,
                deceleration=slope,
            )
        elif profile.done:
            self.moving = False
            self._braking = 0.0

    def _speed(self, velocity: float) -> float:
        return velocity * 1000.0 / 60.0 * self.scale

    def _slope(self, acceleration: float) -> float:
        return acceleration * 1000.0 * self.scale

    def stand(self, *, where_it_is: bool) -> None:
        """Let the demand stand: where it is now, or where the axis is."""
        core = self._core
        self.clear()
        core.follow_profile().reset(core.position if where_it_is else core.position_command)

    def track(self) -> None:
        """Let the demand follow the axis: no position is controlled, and the drive itself wants to stand."""
        self.clear()
        self._core.ramp(0.0, self._slope(self._settings.max_deceleration))

    @property
    def settling(self) -> bool:
        """Whether the demand is at the target and the axis is not within the window."""
        planned = self.planned
        if planned is None or self.halted or not self._core.profile.done:
            return False
        return abs(planned.target - self.position) > self._settings.window

    @property
    def displaced(self) -> bool:
        """Whether the demand stands and the axis does not stand there."""
        core = self._core
        if not core.controls_position or not core.profile.done or core.precontrol_velocity:
            return False
        return abs(core.following_error) > self._settings.standstill_window * self.scale

    def arrived(self) -> bool:
        """Whether the demand is at the target and the axis within the window."""
        planned = self.planned
        if planned is None or not self._core.profile.done:
            return False
        return abs(planned.target - self.position) <= self._settings.window
