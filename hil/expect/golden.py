"""Golden numbers: how long and how far an axis stops, how long it travels. Formulas only; nothing here knows
the motion runtime.

Units: any consistent set, for example mm, mm/s, mm/s2, mm/s3 and s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from fieldbus.errors import ConfigurationError


@dataclass(frozen=True)
class StopRamp:
    """A braking ramp to standstill."""

    time_s: float
    distance: float
    peak_deceleration: float
    """Greatest magnitude of the deceleration reached."""


def stop_ramp(
    velocity: float, deceleration: float, jerk: float | None = None, *, acceleration: float = 0.0
) -> StopRamp:
    """Return the ramp from `velocity` to standstill.

    Args:
        velocity: Magnitude of the velocity at the start, >= 0.
        deceleration: Magnitude of the greatest deceleration, > 0.
        jerk: Magnitude of the jerk, > 0; None or 0 for no jerk limit.
        acceleration: Acceleration at the start in the direction of travel; with a jerk limit a positive
            one is first taken to zero, while the velocity still rises (STP-325), and a negative one (already
            braking, not harder than `deceleration`) is carried on; without a jerk limit it ends at once.

    Raises:
        ConfigurationError: A magnitude is negative, not finite, or the deceleration is zero.

    """
    if not (math.isfinite(velocity) and velocity >= 0.0):
        raise ConfigurationError("stop_ramp.velocity", velocity, "a finite number >= 0")
    if not (math.isfinite(acceleration) and acceleration >= -deceleration):
        raise ConfigurationError("stop_ramp.acceleration", acceleration, "a finite number >= -deceleration")
    if not (math.isfinite(deceleration) and deceleration > 0):
        raise ConfigurationError("stop_ramp.deceleration", deceleration, "a finite number > 0")
    if jerk is not None and not (math.isfinite(jerk) and jerk >= 0):
        raise ConfigurationError("stop_ramp.jerk", jerk, "a finite number >= 0")
    if not jerk:
        time_s = velocity / deceleration
        return StopRamp(time_s, velocity * time_s / 2, deceleration if velocity else 0.0)
    if acceleration < 0.0:
        # The rest of a ramp that began at a higher velocity: that ramp without its beginning.
        begun_s = -acceleration / jerk
        before = velocity - acceleration * begun_s / 2
        whole = stop_ramp(before, deceleration, jerk)
        return StopRamp(
            whole.time_s - begun_s,
            whole.distance - before * begun_s + jerk * begun_s**3 / 6,
            whole.peak_deceleration,
        )
    lead_s = acceleration / jerk
    lead = velocity * lead_s + acceleration * lead_s**2 / 2 - jerk * lead_s**3 / 6
    top = velocity + acceleration * lead_s / 2
    if top >= deceleration**2 / jerk:
        time_s, peak = top / deceleration + deceleration / jerk, deceleration
    else:
        time_s = 2 * math.sqrt(top / jerk)
        peak = jerk * time_s / 2
    return StopRamp(lead_s + time_s, lead + top * time_s / 2, peak)


def stop_time(velocity: float, deceleration: float, jerk: float | None = None) -> float:
    """Return the time to standstill, s."""
    return stop_ramp(velocity, deceleration, jerk).time_s


def stop_distance(velocity: float, deceleration: float, jerk: float | None = None) -> float:
    """Return the travel to standstill."""
    return stop_ramp(velocity, deceleration, jerk).distance


def travel_time(way: float, velocity: float, acceleration: float, deceleration: float, jerk: float) -> float:
    """Return the time of a motion from rest to rest with jerk-limited ramps, s.

    Where the way is too short for the velocity, the greatest one that it allows is found by bisection.

    Args:
        way: Its length, > 0.
        velocity: Greatest magnitude of the velocity, > 0.
        acceleration: Magnitude of the greatest acceleration, > 0.
        deceleration: Magnitude of the greatest deceleration, > 0.
        jerk: Magnitude of the jerk, > 0.

    Raises:
        ConfigurationError: As of `stop_ramp`.

    """

    def ramps_s(top: float) -> float:
        return stop_time(top, acceleration, jerk) + stop_time(top, deceleration, jerk)

    top = velocity
    if 0.5 * top * ramps_s(top) > way:
        low, high = 0.0, velocity
        for _ in range(60):
            top = 0.5 * (low + high)
            low, high = (top, high) if 0.5 * top * ramps_s(top) < way else (low, top)
    rest = max(way - 0.5 * top * ramps_s(top), 0.0)
    return ramps_s(top) + rest / top


def drive_ramp(velocity: float, maximum_velocity: float, ramp_time_s: float) -> StopRamp:
    """Return the ramp that a drive makes: `ramp_time_s` is the time from
    `maximum_velocity` to zero (OFF1, OFF3).
    """
    if not (math.isfinite(maximum_velocity) and maximum_velocity > 0):
        raise ConfigurationError("drive_ramp.maximum_velocity", maximum_velocity, "a finite number > 0")
    if not (math.isfinite(ramp_time_s) and ramp_time_s > 0):
        raise ConfigurationError("drive_ramp.ramp_time_s", ramp_time_s, "a finite number > 0 s")
    return stop_ramp(velocity, maximum_velocity / ramp_time_s)


def switch_clearance(
    velocity: float,
    deceleration: float,
    *,
    filter_s: float = 0.0,
    cycle_s: float = 0.0,
    detection_s: float = 0.0,
) -> float:
    """Return the way that a hardware limit switch needs in front of the mechanical stop (LIM-029).

    Args:
        velocity: Greatest velocity towards the switch, magnitude, >= 0.
        deceleration: Magnitude of the deceleration without jerk limit, > 0.
        filter_s: Filter time of the digital input, s.
        cycle_s: Position-control cycle, in which a change is noticed at the latest, s.
        detection_s: Further time until the ramp begins: acquisition and output of the values, s.

    Raises:
        ConfigurationError: A magnitude or time is negative or not finite, or the deceleration is zero.

    """
    delay_s = 0.0
    for name, time_s in (("filter_s", filter_s), ("cycle_s", cycle_s), ("detection_s", detection_s)):
        if not (math.isfinite(time_s) and time_s >= 0.0):
            raise ConfigurationError(f"switch_clearance.{name}", time_s, "a time >= 0 s")
        delay_s += time_s
    return velocity * delay_s + stop_ramp(velocity, deceleration).distance


@dataclass(frozen=True)
class ReferenceAxis:
    """Limits and ramp times of an axis and its drive; by default those of the
    worked numbers: linear, lead screw 10 mm, position-controlled.

    `bench.golden("z")` returns those of an axis of one's own. Units: that of the position of the axis, and s.
    """

    maximum_velocity: float = 500.0
    maximum_acceleration: float = 2000.0
    maximum_deceleration: float = 2000.0
    maximum_jerk: float = 20_000.0
    emergency_deceleration: float = 4000.0
    default_velocity: float = 100.0
    default_acceleration: float = 1000.0
    default_deceleration: float = 1000.0
    default_jerk: float = 10_000.0
    lead_mm: float = 10.0
    """Travel per revolution of the motor, position units, whatever the direction."""
    maximum_speed_rpm: float = 3000.0
    off1_time_s: float = 1.0
    """Time from the maximum speed to zero on the ramp-function generator."""
    off3_time_s: float = 0.5
    """Time from the maximum speed to zero at quick stop."""
    cycle_s: float = 0.004
    start_velocity: float = 300.0
    """Velocity at which a ramp begins where none is given."""
    velocity_unit: float = 1.0
    """Position units per second in one unit of velocity: velocities of instructions and variables are in that
    unit (`Units.VelocityUnit`), divide by this.
    """
    machine_m: float = 0.001
    """Travel of the emulated machine per position unit, m: signals of a drive are in m, those of an axis in
    its own unit; 0 where nobody knows.
    """

    @property
    def drive_velocity(self) -> float:
        """Velocity at the maximum speed of the drive, to which its ramp times refer."""
        return self.maximum_speed_rpm * self.lead_mm / 60.0

    def emergency(self, velocity: float | None = None) -> StopRamp:
        """Emergency ramp: StopMode 0, reaction 3, `MC_Stop` mode 0 (STP-008)."""
        return stop_ramp(self._start(velocity), self.emergency_deceleration)

    def maximum(self, velocity: float | None = None) -> StopRamp:
        """Maximum dynamic values: StopMode 2, reaction 2, `MC_Stop` mode 2 (STP-009)."""
        return stop_ramp(self._start(velocity), self.maximum_deceleration, self.maximum_jerk)

    def off3(self, velocity: float | None = None) -> StopRamp:
        """Quick stop of the drive: StopMode 1, reaction 4 with 16#5 or 16#7 (STP-010)."""
        return drive_ramp(self._start(velocity), self.drive_velocity, self.off3_time_s)

    def off1(self, velocity: float | None = None) -> StopRamp:
        """Ramp-function generator of the drive: reaction 4 with 16#1 (STP-011)."""
        return drive_ramp(self._start(velocity), self.drive_velocity, self.off1_time_s)

    def job(
        self, velocity: float | None = None, *, deceleration: float | None = None, jerk: float | None = None
    ) -> StopRamp:
        """Values of a job, limited by the maximum values: reaction 1, `MC_Halt`,
        `MC_Stop` mode 3 (STP-012, STP-013).
        """
        return stop_ramp(
            self._start(velocity),
            min(
                self.default_deceleration if deceleration is None else deceleration, self.maximum_deceleration
            ),
            min(self.default_jerk if jerk is None else jerk, self.maximum_jerk),
        )

    def _start(self, velocity: float | None) -> float:
        return self.start_velocity if velocity is None else abs(velocity)

    @property
    def time_tolerance_s(self) -> float:
        """Allowed deviation of a ramp time: two cycles."""
        return 2 * self.cycle_s

    def distance_tolerance(self, velocity: float | None = None, *, following_error: float = 0.0) -> float:
        """Allowed deviation of a travel: two cycles at the start velocity, plus the
        following error on actual values.
        """
        return self._start(velocity) * 2 * self.cycle_s + abs(following_error)


REFERENCE_AXIS: Final = ReferenceAxis()
