"""Motion to a position that is reached with a velocity, with limited velocity, acceleration, deceleration and
jerk, from any state of motion.

The motion changes to a peak velocity, keeps it where the limit of velocity is reached, and changes to the end
velocity; the peak velocity is found by root finding.
"""

from __future__ import annotations

from motion.setpoint.limits import check_dynamics
from motion.setpoint.profile import Profile, RawPhase, travel
from motion.setpoint.root import find_root
from motion.setpoint.velocity import velocity_phases


def plan_meeting(
    distance: float,
    velocity: float,
    present_acceleration: float,
    end_velocity: float,
    *,
    max_velocity: float,
    acceleration: float,
    deceleration: float,
    jerk: float,
) -> Profile:
    """Plan the motion over `distance` that ends with `end_velocity` and without acceleration, in the shortest
    time (SYN-123).

    Args:
        distance: Way to the end, position unit, signed.
        velocity: Present velocity, position unit/s.
        present_acceleration: Present acceleration, position unit/s2; without a jerk limit it has no effect.
        end_velocity: Velocity at the end, position unit/s; it may be above `max_velocity`.
        max_velocity: Limit of the magnitude of the velocity on the way, position unit/s, above 0.
        acceleration: Limit of the growth of the magnitude of the velocity, position unit/s2, above 0.
        deceleration: Limit of the reduction of the magnitude of the velocity, position unit/s2, above 0.
        jerk: Limit of the change of acceleration, position unit/s3; 0.0 for none.

    Raises:
        ConfigurationError: A limit is not positive or a value is not finite.

    """
    check_dynamics(
        acceleration, deceleration, jerk, position=distance, velocity=velocity, present=present_acceleration
    )
    a = present_acceleration if jerk > 0.0 else 0.0
    phases = velocity_phases(velocity, a, end_velocity, acceleration, deceleration, jerk)
    rest = distance - travel(phases)
    if abs(rest) > 1e-12 * (abs(distance) + abs(distance - rest)):
        sign = 1.0 if rest > 0.0 else -1.0
        found = _phases(
            sign * distance, sign * velocity, sign * a, sign * end_velocity,
            max_velocity, acceleration, deceleration, jerk,
        )  # fmt: skip
        phases = found if sign > 0.0 else [(t, -v, -a, -j) for t, v, a, j in found]
    return Profile(phases, end_velocity=end_velocity, distance=distance)


def _phases(  # noqa: PLR0917 - the numbers of one plan, passed on as they are
    distance: float,
    v: float,
    a: float,
    end: float,
    top: float,
    acceleration: float,
    deceleration: float,
    jerk: float,
) -> list[RawPhase]:
    """Return the phases where the change of velocity alone does not lead as far as `distance`."""

    def through(peak: float) -> list[RawPhase]:
        first = velocity_phases(v, a, peak, acceleration, deceleration, jerk)
        return first + velocity_phases(peak, 0.0, end, acceleration, deceleration, jerk)

    def excess(peak: float) -> float:
        return travel(through(peak)) - distance

    settled = v + 0.5 * a * abs(a) / jerk if jerk > 0.0 else v
    # A peak below zero would lead back: between it and zero the axis loses way.
    low = max(settled, end, 0.0)
    high = max(top, low)
    at_low, at_high = excess(low), excess(high)
    if at_high <= 0.0:
        cruise = [(-at_high / high, high, 0.0, 0.0)]
        return (
            velocity_phases(v, a, high, acceleration, deceleration, jerk)
            + cruise
            + velocity_phases(high, 0.0, end, acceleration, deceleration, jerk)
        )
    if at_low >= 0.0:
        # A present acceleration that leads to the end velocity gets lost on the way over `low`: there is a
        # peak between the two, since the end velocity itself is the change alone.
        low, at_low, high, at_high = end, excess(end), low, at_low
        if at_low >= 0.0:
            return through(end)
    peak, missed = find_root(excess, low, high, at_low, at_high, 2e-16 * (abs(distance) + abs(at_low)))
    phases = velocity_phases(v, a, peak, acceleration, deceleration, jerk)
    if missed < 0.0 < peak:
        phases.append((-missed / peak, peak, 0.0, 0.0))
    return phases + velocity_phases(peak, 0.0, end, acceleration, deceleration, jerk)
