"""Dynamic values of a motion: where they come from, and what a planner accepts."""

from __future__ import annotations

from math import isfinite
from typing import NamedTuple

from fieldbus.errors import ConfigurationError


class Resolved(NamedTuple):
    """Outcome of `resolve`."""

    value: float
    """Value to move with."""
    limited: bool
    """Whether the limit took the place of the value (warning 501, 502 or 503)."""


def resolve(value: float, default: float, limit: float) -> Resolved:
    """Return the effective dynamic value of a job: `min(value or default, limit)` (STP-082, STP-084; MC-093).

    Args:
        value: Input of the instruction; below 0.0 the dynamic default takes its place.
        default: Dynamic default of the technology object.
        limit: Dynamic limit of the technology object.

    """
    chosen = default if value < 0.0 else value
    return Resolved(limit, True) if chosen > limit else Resolved(chosen, False)


def check_positive(name: str, value: float) -> None:
    """Refuse a value that is not a finite number above 0.

    Raises:
        ConfigurationError: `value` is zero, negative, infinite or not a number.

    """
    if not (value > 0.0 and isfinite(value)):
        raise ConfigurationError(name, value, "a finite number above 0")


def check_dynamics(
    acceleration: float,
    deceleration: float,
    jerk: float,
    *,
    position: float,
    velocity: float,
    present: float,
) -> None:
    """Refuse limits or a state that no motion can be planned from.

    Args:
        acceleration: Limit of the growth of the magnitude of the velocity.
        deceleration: Limit of the reduction of the magnitude of the velocity.
        jerk: Limit of the change of acceleration; 0.0 for none.
        position: Present position or any other finite number.
        velocity: Present velocity.
        present: Present acceleration.

    Raises:
        ConfigurationError: Names the first value that cannot be used.

    """
    # One comparison decides the normal case: sums of finite numbers are finite, of others they are not.
    if (
        acceleration > 0.0
        and deceleration > 0.0
        and jerk >= 0.0
        and isfinite(acceleration + deceleration + jerk + position + velocity + present)
    ):
        return
    check_positive("acceleration", acceleration)
    check_positive("deceleration", deceleration)
    if not (jerk >= 0.0 and isfinite(jerk)):
        raise ConfigurationError("jerk", jerk, "a finite number, 0 (no jerk limit) or above")
    for name, value in (("position", position), ("velocity", velocity), ("present acceleration", present)):
        if not isfinite(value):
            raise ConfigurationError(name, value, "a finite number")
