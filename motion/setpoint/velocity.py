"""Change of velocity with limited jerk, from any state of motion.

`acceleration` limits the growth and `deceleration` the reduction of the magnitude of the velocity. A reversal
reduces with `deceleration` to zero and grows with `acceleration` from there. With a jerk limit the axis does
not wait at zero: it passes velocity zero with the highest acceleration that both limits and the jerk allow on
either side, at most `min(acceleration, deceleration)`, and the acceleration stays continuous. Without a jerk
limit the acceleration jumps at zero.

Seen over the velocity, the square of the acceleration rises and falls with the slope `2 * jerk` at most; the
fastest change is the one with the largest square everywhere. That makes every phase a closed form.

An acceleration that is present at the start is carried over by the jerk (STP-119 to STP-122): one that leads
away from the target, or beyond it, is first taken to zero; one beyond the limits is brought back to them.
Without a jerk limit it has no effect.
"""

from __future__ import annotations

from math import copysign, sqrt

from motion.setpoint.limits import check_dynamics
from motion.setpoint.profile import Profile, RawPhase


def plan_velocity(
    velocity: float,
    present_acceleration: float,
    target: float,
    *,
    acceleration: float,
    deceleration: float,
    jerk: float,
    abort_acceleration: bool = False,
) -> Profile:
    """Plan the change from the present velocity to `target`; the end is exactly
    `target` without acceleration.

    Args:
        velocity: Present velocity, position unit/s.
        present_acceleration: Present acceleration, position unit/s2.
        target: Velocity to reach, signed.
        acceleration: Limit of the growth of the magnitude of the velocity, position unit/s2, above 0.
        deceleration: Limit of the reduction of the magnitude of the velocity, position unit/s2, above 0.
        jerk: Limit of the change of acceleration, position unit/s3; 0.0 for none.
        abort_acceleration: Set a present acceleration in the direction of motion to zero first (STP-403).

    Raises:
        ConfigurationError: A limit is not positive or a value is not finite.

    """
    check_dynamics(
        acceleration, deceleration, jerk, position=target, velocity=velocity, present=present_acceleration
    )
    if abort_acceleration and present_acceleration * velocity >= 0.0:
        present_acceleration = 0.0
    phases = velocity_phases(velocity, present_acceleration, target, acceleration, deceleration, jerk)
    return Profile(phases, end_velocity=target)


def velocity_phases(  # noqa: PLR0917 - inner loop of the position planner
    v: float, a: float, target: float, acceleration: float, deceleration: float, jerk: float
) -> list[RawPhase]:
    """Return the phases from the state (`v`, `a`) to (`target`, 0); arguments
    as `plan_velocity`, unchecked.
    """
    phases: list[RawPhase] = []
    if jerk == 0.0:
        direction = 1.0 if target > v else -1.0
        if v * direction < 0.0:
            reached = 0.0 if target * direction > 0.0 else target
            phases.append(((reached - v) * direction / deceleration, v, direction * deceleration, 0.0))
            v = reached
        if v != target:
            phases.append(((target - v) * direction / acceleration, v, direction * acceleration, 0.0))
        return phases

    if a != 0.0:
        settled = v + a * abs(a) / (2.0 * jerk)
        if settled >= target if a > 0.0 else settled <= target:
            phases.append((abs(a) / jerk, v, a, -copysign(jerk, a)))
            v = settled
            a = 0.0
    way = target - v
    if way == 0.0:
        return phases
    direction = 1.0
    if way < 0.0:
        direction = -1.0
        way = -way
    reduction = -v * direction  # how much of the change lies before velocity zero
    start = a * direction
    if reduction <= 0.0:
        _leg(phases, v, target, direction, way, start, 0.0, acceleration, jerk)
    elif reduction >= way:
        _leg(phases, v, target, direction, way, start, 0.0, deceleration, jerk)
    else:
        growth = way - reduction
        lowest = min(acceleration, deceleration)
        crossing = min(start * start + 2.0 * jerk * reduction, 2.0 * jerk * growth, lowest * lowest)
        forced = start * start - 2.0 * jerk * reduction  # still left at zero of a start beyond the limits
        crossing = sqrt(max(crossing, forced))
        _leg(phases, v, 0.0, direction, reduction, start, crossing, deceleration, jerk)
        _leg(phases, 0.0, target, direction, growth, crossing, 0.0, acceleration, jerk)
    return phases


def _leg(  # noqa: PLR0917 - inner loop of the position planner
    phases: list[RawPhase],
    v: float,
    target: float,
    direction: float,
    way: float,
    start: float,
    end: float,
    limit: float,
    jerk: float,
) -> None:
    """Append the phases of a change of velocity from `v` by `way` in `direction` to
    `target`, in the shortest time.

    `start` and `end` are accelerations in `direction`, not negative. A start
    beyond the limit falls back to it.
    """
    double = 2.0 * jerk
    top = max(limit, end)
    if start > top:
        fallen = (start * start - top * top) / double
        if fallen >= way:
            phases.append(((start - end) / jerk, v, direction * start, -direction * jerk))
            return
        phases.append(((start - top) / jerk, v, direction * start, -direction * jerk))
        way -= fallen
        v += direction * fallen
        start = peak = top
    else:
        square = jerk * way + 0.5 * (start * start + end * end)
        peak = top if square >= top * top else max(sqrt(square), start, end)
    if peak > start:
        phases.append(((peak - start) / jerk, v, direction * start, direction * jerk))
        risen = (peak * peak - start * start) / double
        v += direction * risen
        way -= risen
    falling = (peak * peak - end * end) / double
    # A rest that the rounding of the squares can make is none.
    if peak == top and way - falling > 1e-15 * (way + peak * peak / double):
        phases.append(((way - falling) / peak, v, direction * peak, 0.0))
    if peak > end:
        phases.append(
            ((peak - end) / jerk, target - direction * falling, direction * peak, -direction * jerk)
        )
