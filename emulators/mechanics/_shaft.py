"""A shaft or slide that is moved from outside at a given speed, for whatever measures it."""

from __future__ import annotations

from collections.abc import Iterable

from emulators.mechanics._checks import checked
from fieldbus.clock import S, Scheduler, seconds_to_ns
from fieldbus.errors import ConfigurationError


class DrivenShaft:
    """Moves as commanded, without inertia: constant speed, linear ramps, or a list of them.

    Position and velocity are calculated on demand; otherwise the shaft costs nothing.

    Args:
        scheduler: Time of the bench.
        position: Start position, rad (m for a slide).

    """

    def __init__(self, scheduler: Scheduler, *, position: float = 0.0) -> None:
        self._scheduler = scheduler
        self._start_ns = scheduler.now
        self._start_position = checked("position", position)
        self._start_velocity = 0.0
        self._profile: tuple[tuple[int, float], ...] = ()
        self._index = 0
        self._repeat = False

    @property
    def position(self) -> float:
        """Present position, rad or m."""
        return self._now()[0]

    @property
    def velocity(self) -> float:
        """Present velocity, rad/s or m/s."""
        return self._now()[1]

    def turn(self, speed: float, *, ramp_s: float = 0.0) -> None:
        """Reach `speed` (rad/s or m/s) linearly within `ramp_s` (>= 0) and keep it.

        Raises:
            ConfigurationError: A value is not finite or a time negative.

        """
        self.follow([(ramp_s, speed)])

    def follow(self, profile: Iterable[tuple[float, float]], *, repeat: bool = False) -> None:
        """Go through a list of (duration in s, speed at its end), then keep the last speed or begin again.

        The speed changes linearly within each duration; a duration of 0 is a step.

        Raises:
            ConfigurationError: A value is not finite, a time negative, or a repeated list takes no time.

        """
        listed = list(profile)
        steps = tuple(
            (seconds_to_ns(checked("duration", duration, minimum=0.0)), checked("speed", speed))
            for duration, speed in listed
        )
        if repeat and not sum(duration for duration, _ in steps):
            raise ConfigurationError("profile", listed, "a repeated profile that takes some time")
        position, velocity = self._now()
        self._start_ns = self._scheduler.now
        self._start_position, self._start_velocity = position, velocity
        self._profile, self._index, self._repeat = steps, 0, repeat

    def place(self, position: float) -> None:
        """Put the shaft at rest at `position`, rad or m."""
        self._profile, self._index = (), 0
        self._start_ns = self._scheduler.now
        self._start_position, self._start_velocity = checked("position", position), 0.0

    def _now(self) -> tuple[float, float]:
        elapsed_ns = self._scheduler.now - self._start_ns
        while self._index < len(self._profile):
            duration_ns, target = self._profile[self._index]
            if elapsed_ns < duration_ns:
                slope = (target - self._start_velocity) / duration_ns * S
                time_s = elapsed_ns / S
                velocity = self._start_velocity + slope * time_s
                return (
                    self._start_position + 0.5 * (self._start_velocity + velocity) * time_s,
                    velocity,
                )
            self._start_position += 0.5 * (self._start_velocity + target) * duration_ns / S
            self._start_velocity = target
            self._start_ns += duration_ns
            elapsed_ns -= duration_ns
            self._index += 1
            if self._repeat and self._index == len(self._profile):
                self._index = 0
        return self._start_position + self._start_velocity * elapsed_ns / S, self._start_velocity
