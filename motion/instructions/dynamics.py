"""Dynamic-value inputs: given value, default or error (MC-086 to MC-092)."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, Any

from motion.axis.jobs import ERROR_ACCELERATION, ERROR_DECELERATION, ERROR_JERK, ERROR_VELOCITY, NO_ERROR, Job

if TYPE_CHECKING:
    from motion.axis.axis import TechnologyAxis


def _value(axis: TechnologyAxis, given: float, default: str, *, zero: bool) -> float | None:
    """Return the resolved value, or None where it is not allowed."""
    if not isfinite(given):
        return None
    if given < 0.0:
        given = float(axis.variables.read(f"DynamicDefaults.{default}"))
        return given if given > 0.0 or zero else None
    if given == 0.0 and not zero:
        return None
    return given


def resolve(instance: Any, job: Job, *, velocity: bool, acceleration: bool = True) -> int:
    """Resolve `Velocity` (where it has a default), `Acceleration`, `Deceleration` and `Jerk` into `job`.

    Returns:
        The ErrorID of the first input that is not allowed, 0 when all are.

    """
    axis = instance.axis
    if velocity:
        value = _value(axis, float(instance.Velocity), "Velocity", zero=False)
        if value is None:
            return ERROR_VELOCITY
        job.velocity = value
    if acceleration:
        value = _value(axis, float(instance.Acceleration), "Acceleration", zero=False)
        if value is None:
            return ERROR_ACCELERATION
        job.acceleration = value
    value = _value(axis, float(instance.Deceleration), "Deceleration", zero=False)
    if value is None:
        return ERROR_DECELERATION
    job.deceleration = value
    value = _value(axis, float(instance.Jerk), "Jerk", zero=True)
    if value is None:
        return ERROR_JERK
    job.jerk = value
    return NO_ERROR
