"""Way and time to standstill in closed form, consistent with `plan_velocity` to velocity zero.

Cheap enough for every cycle of the software limit switches.
"""

from __future__ import annotations

from math import sqrt


def stop_distance(velocity: float, present_acceleration: float, deceleration: float, jerk: float) -> float:
    """Return the signed way to standstill, position unit.

    Args:
        velocity: Present velocity, position unit/s.
        present_acceleration: Present acceleration, position unit/s2; without a jerk limit it has no effect.
        deceleration: Limit of the reduction of the magnitude of the velocity, position unit/s2, above 0.
        jerk: Limit of the change of acceleration, position unit/s3; 0.0 for none.

    """
    if jerk == 0.0:
        return velocity * abs(velocity) / (2.0 * deceleration)
    v = velocity
    a = present_acceleration
    sign = 1.0
    if a == 0.0:
        if v < 0.0:
            v = -v
            sign = -1.0
        if v * jerk >= deceleration * deceleration:
            return sign * 0.5 * v * (v / deceleration + deceleration / jerk)
        return sign * v * sqrt(v / jerk)
    change = 0.5 * a * abs(a) / jerk
    if v + change < 0.0:  # standstill is approached from negative velocities
        v, a, change, sign = -v, -a, -change, -1.0
    if a > 0.0:
        # The acceleration falls to zero, then the axis brakes from the velocity reached.
        time = a / jerk
        way = time * (v + time * a / 3.0)
        v += change
    else:
        # Already braking: the rest of a braking that began at a higher velocity without acceleration.
        way = 0.0
        a = -a
        if a > deceleration:
            time = (a - deceleration) / jerk
            way = time * (v + time * (time * jerk / 6.0 - 0.5 * a))
            v -= 0.5 * (a * a - deceleration * deceleration) / jerk
            a = deceleration
        time = a / jerk
        v += 0.5 * a * time
        way -= time * (v - a * time / 6.0)
    if v * jerk >= deceleration * deceleration:
        return sign * (way + 0.5 * v * (v / deceleration + deceleration / jerk))
    return sign * (way + v * sqrt(v / jerk))


def stop_time(velocity: float, present_acceleration: float, deceleration: float, jerk: float) -> float:
    """Return the time to standstill, s; arguments as `stop_distance`."""
    if jerk == 0.0:
        return abs(velocity) / deceleration
    v = velocity
    a = present_acceleration
    change = 0.5 * a * abs(a) / jerk
    if v + change < 0.0:
        v, a, change = -v, -a, -change
    if a >= 0.0:
        time = a / jerk
        v += change
    else:
        time = 0.0
        a = -a
        if a > deceleration:
            time = (a - deceleration) / jerk
            v -= 0.5 * (a * a - deceleration * deceleration) / jerk
            a = deceleration
        v += 0.5 * a * a / jerk
        time -= a / jerk
    if v * jerk >= deceleration * deceleration:
        return time + v / deceleration + deceleration / jerk
    return time + 2.0 * sqrt(v / jerk)
