"""Where a body was between two steps, and when it passed a place: the velocity
changes linearly within a step.
"""

from __future__ import annotations

import math


def position_within(
    start: float, start_velocity: float, end: float, duration: float, elapsed: float
) -> float:
    """Return the position `elapsed` after the beginning of a step from `start` to `end`.

    Args:
        start: Position at the beginning, any unit.
        start_velocity: Velocity at the beginning, unit per s.
        end: Position at the end.
        duration: Duration of the step, s, > 0.
        elapsed: s, 0..duration.

    """
    share = elapsed / duration
    way = start_velocity * duration
    return start + (way + (end - start - way) * share) * share


def passing_time(start: float, end: float, end_velocity: float, duration: float, place: float) -> float:
    """Return how long after the beginning of a step the body passed `place`, s, 0..duration.

    Args:
        start: Position at the beginning, any unit.
        end: Position at the end.
        end_velocity: Velocity at the end, unit per s.
        duration: Duration of the step, s, > 0.
        place: Position between `start` and `end`.

    """
    distance = place - start
    if distance == 0.0:
        return 0.0
    way = 2.0 * (end - start) - end_velocity * duration  # at the velocity of the beginning
    bend = end - start - way
    root = math.sqrt(max(0.0, way * way + 4.0 * bend * distance))
    divisor = way + math.copysign(root, distance)
    share = 2.0 * distance / divisor if divisor else 1.0
    return min(max(share, 0.0), 1.0) * duration
