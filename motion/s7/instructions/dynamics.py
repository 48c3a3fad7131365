"""Dynamic-value inputs: given value, default or error (MC-086 to MC-092)."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any, Final

from motion.s7.axis.jobs import (
    ERROR_ACCELERATION,
    ERROR_DECELERATION,
    ERROR_JERK,
    ERROR_VELOCITY,
    NO_ERROR,
    Job,
)

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis


POSITION_LIMIT: Final = 1e12
"""Greatest magnitude of a position, distance or dynamic value; the range of the variables (MC-600)."""

_SMALLEST: Final = 1e-12
"""Smallest dynamic value other than 0; less cannot be planned with."""


def is_whole(value: object) -> bool:
    """Return whether an input can be a mode or a number of something: of a
    type that tables can be asked for.
    """
    return isinstance(value, int)


def is_number(value: object, limit: float = POSITION_LIMIT) -> bool:
    """Return whether an input is a finite number of at most the magnitude `limit`."""
    if isinstance(value, bool | str):
        return False
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return False
    return isfinite(number) and abs(number) <= limit


def _value(axis: TechnologyAxis, given: float, default: str, *, zero: bool) -> float | None:
    """Return the resolved value, or None where it is not allowed."""
    if not is_number(given):
        return None
    value = float(given)
    if value < 0.0:
        value = float(axis.variables.read(f"DynamicDefaults.{default}"))
    return value if is_dynamic(value, zero=zero) else None


def is_dynamic(value: float, *, zero: bool = False) -> bool:
    """Return whether a motion can be planned with a velocity, an acceleration, a deceleration or, where 0 is
    none, a jerk.
    """
    return value >= _SMALLEST or (value == 0.0 and zero)


def resolve(
    instance: Any,
    job: Job,
    *,
    velocity: bool,
    acceleration: bool = True,
    velocity_input: str = "Velocity",
) -> int:
    """Resolve the velocity (where it has a default), `Acceleration`, `Deceleration` and `Jerk` into `job`.

    Inputs are in the units of the axis, those of the job in the units of the runtime (CFG-072, CFG-081).

    Returns:
        The ErrorID of the first input that is not allowed, 0 when all are.

    """
    axis = instance.axis
    factors = axis.variables.factors
    if velocity:
        value = _value(axis, getattr(instance, velocity_input), "Velocity", zero=False)
        if value is None:
            return ERROR_VELOCITY
        job.velocity = value * factors.velocity
    if acceleration:
        value = _value(axis, instance.Acceleration, "Acceleration", zero=False)
        if value is None:
            return ERROR_ACCELERATION
        job.acceleration = value * factors.acceleration
    value = _value(axis, instance.Deceleration, "Deceleration", zero=False)
    if value is None:
        return ERROR_DECELERATION
    job.deceleration = value * factors.acceleration
    value = _value(axis, instance.Jerk, "Jerk", zero=True)
    if value is None:
        return ERROR_JERK
    job.jerk = value * factors.acceleration
    return NO_ERROR
