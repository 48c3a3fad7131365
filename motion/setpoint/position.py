"""Point-to-point motion with limited velocity, acceleration, deceleration and jerk, from any state of motion.

The motion changes to a peak velocity, keeps it where the limit of velocity is reached, and brakes to the
target. Where the axis cannot stop before the target, it brakes, comes to the peak velocity of the way back
and stops there; that is the same problem seen in the mirror. All phases are closed forms of the velocity
profile; one number, the peak velocity, is found by root finding. Where even no acceleration at all would lead
beyond the target although full braking would not reach it, the number sought is the time for which a present
deceleration is relaxed.
"""

from __future__ import annotations

from math import sqrt

from motion.setpoint.limits import check_dynamics, check_positive
from motion.setpoint.profile import Profile, RawPhase, travel
from motion.setpoint.root import find_root
from motion.setpoint.stopping import stop_distance
from motion.setpoint.velocity import velocity_phases

_NOTHING = 1e-30
"""Ways, velocities and accelerations up to this one count as none: their
products would leave the number range.
"""


def plan_position(
    position: float,
    velocity: float,
    present_acceleration: float,
    target: float,
    *,
    max_velocity: float,
    acceleration: float,
    deceleration: float,
    jerk: float,
) -> Profile:
    """Plan the motion from the present state to `target`; it ends exactly there with v = a = 0.

    A start velocity above `max_velocity` is reduced to it with `deceleration`. `acceleration` and
    `deceleration` have the meaning of `plan_velocity`. The profile is relative to `position`.

    Args:
        position: Present position, position unit.
        velocity: Present velocity, position unit/s.
        present_acceleration: Present acceleration, position unit/s2; without a jerk limit it has no effect.
        target: Position to reach.
        max_velocity: Limit of the magnitude of the velocity, position unit/s, above 0; not used where
            braking at once ends at the target.
        acceleration: Limit of the growth of the magnitude of the velocity, position unit/s2, above 0.
        deceleration: Limit of the reduction of the magnitude of the velocity, position unit/s2, above 0.
        jerk: Limit of the change of acceleration, position unit/s3; 0.0 for none.

    Raises:
        ConfigurationError: A limit is not positive or a value is not finite.

    """
    distance = target - position
    check_dynamics(
        acceleration, deceleration, jerk, position=distance, velocity=velocity, present=present_acceleration
    )
    v = velocity if abs(velocity) > _NOTHING else 0.0
    a = present_acceleration if jerk > 0.0 and abs(present_acceleration) > _NOTHING else 0.0
    way = stop_distance(v, a, deceleration, jerk)
    # What the rounding of positions and of the way to standstill cannot tell from the target is the target.
    if abs(distance - way) <= 1e-12 * abs(way) + 4e-16 * (abs(position) + abs(target)) + _NOTHING:
        phases = velocity_phases(v, a, 0.0, acceleration, deceleration, jerk)
        return Profile(phases, end_velocity=0.0, distance=distance)
    check_positive("max_velocity", max_velocity)
    if distance > way:
        phases = _phases(distance, v, a, max_velocity, acceleration, deceleration, jerk)
    else:
        mirrored = _phases(-distance, -v, -a, max_velocity, acceleration, deceleration, jerk)
        phases = [(t, -v, -a, -j) for t, v, a, j in mirrored]
    return Profile(phases, end_velocity=0.0, distance=distance)


def _phases(  # noqa: PLR0917 - the numbers of one plan, passed on as they are
    distance: float, v: float, a: float, top: float, acceleration: float, deceleration: float, jerk: float
) -> list[RawPhase]:
    """Return the phases to a target that lies beyond the point where the axis
    could stop (in positive direction).
    """
    if jerk == 0.0:
        return _phases_without_jerk(distance, v, top, acceleration, deceleration)
    settled = v + 0.5 * a * abs(a) / jerk  # velocity after nothing but taking the acceleration to zero
    lowest = min(max(settled, 0.0), top)
    approach = velocity_phases(v, a, lowest, acceleration, deceleration, jerk)
    rest = distance - travel(approach) - stop_distance(lowest, 0.0, deceleration, jerk)
    if rest < 0.0:
        return _relaxed(distance, approach, acceleration, deceleration, jerk)
    if lowest < top:
        fastest = velocity_phases(v, a, top, acceleration, deceleration, jerk)
        excess = travel(fastest) + stop_distance(top, 0.0, deceleration, jerk) - distance
        if excess > 0.0:

            def miss(peak: float) -> float:
                phases = velocity_phases(v, a, peak, acceleration, deceleration, jerk)
                return travel(phases) + stop_distance(peak, 0.0, deceleration, jerk) - distance

            noise = 2e-16 * (abs(distance) + abs(rest))
            peak, missed = find_root(miss, lowest, top, -rest, excess, noise)
            phases = velocity_phases(v, a, peak, acceleration, deceleration, jerk)
            if missed < -noise:  # one step of the peak velocity is worth more than the rounding of the way
                phases.append((-missed / peak, peak, 0.0, 0.0))
            return phases + velocity_phases(peak, 0.0, 0.0, acceleration, deceleration, jerk)
        approach = fastest
        rest = -excess
    approach.append((rest / top, top, 0.0, 0.0))
    return approach + velocity_phases(top, 0.0, 0.0, acceleration, deceleration, jerk)


def _relaxed(
    distance: float, approach: list[RawPhase], acceleration: float, deceleration: float, jerk: float
) -> list[RawPhase]:
    """Return the phases that follow `approach`, whose end would be too late for
    braking, until braking must begin.
    """
    *before, (duration, v, a, j) = approach
    if a >= 0.0:  # no deceleration to relax: only rounding tells this from direct braking
        return before + velocity_phases(v, a, 0.0, acceleration, deceleration, jerk)
    start = travel(before) - distance

    def miss(time: float) -> float:
        reached = v + time * (a + 0.5 * j * time)
        way = time * (v + time * (0.5 * a + time * j / 6.0))
        return start + way + stop_distance(reached, min(a + j * time, 0.0), deceleration, jerk)

    low, high = miss(0.0), miss(duration)
    if low >= 0.0 or high <= 0.0:
        time = 0.0 if low >= 0.0 else duration
    else:
        time, _ = find_root(miss, 0.0, duration, low, high, 2e-16 * (abs(distance) + abs(start)))
    if time > 0.0:
        before.append((time, v, a, j))
    reached = v + time * (a + 0.5 * j * time)
    return before + velocity_phases(reached, min(a + j * time, 0.0), 0.0, acceleration, deceleration, jerk)


def _phases_without_jerk(
    distance: float, v: float, top: float, acceleration: float, deceleration: float
) -> list[RawPhase]:
    """Return the phases as `_phases` does, for a trapezoid of velocity."""
    phases: list[RawPhase] = []
    if v < 0.0:
        phases.append((-v / deceleration, v, deceleration, 0.0))
        distance += 0.5 * v * v / deceleration
        v = 0.0
    if v > top:
        phases.append(((v - top) / deceleration, v, -deceleration, 0.0))
        rest = distance - 0.5 * v * v / deceleration
        peak = top
    else:
        braking = 0.5 * v * v / deceleration
        square = v * v + (distance - braking) * 2.0 * acceleration * (
            deceleration / (acceleration + deceleration)
        )
        peak = min(top, max(sqrt(max(square, 0.0)), v))
        rest = distance - _trapezoid(v, peak, acceleration, deceleration)
        if rest < 0.0:
            peak = max(v, peak * (1.0 - 4e-16))
            rest = distance - _trapezoid(v, peak, acceleration, deceleration)
        phases.append(((peak - v) / acceleration, v, acceleration, 0.0))
    if rest > 4e-16 * abs(distance):
        phases.append((rest / peak, peak, 0.0, 0.0))
    phases.append((peak / deceleration, peak, -deceleration, 0.0))
    return phases


def _trapezoid(v: float, peak: float, acceleration: float, deceleration: float) -> float:
    """Return the way from velocity `v` to `peak` and from there to standstill."""
    return 0.5 * (peak - v) * ((peak + v) / acceleration) + 0.5 * peak * peak / deceleration
