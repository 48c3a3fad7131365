"""Checks of the numbers that a plant is made of."""

from __future__ import annotations

import math

from fieldbus.errors import ConfigurationError


def checked(where: str, value: float, *, minimum: float | None = None, positive: bool = False) -> float:
    """Return a finite number in its range, or raise ConfigurationError."""
    if not math.isfinite(value) or (positive and value <= 0.0) or (minimum is not None and value < minimum):
        allowed = (
            "a finite number > 0"
            if positive
            else "a finite number" + (f" >= {minimum:g}" if minimum is not None else "")
        )
        raise ConfigurationError(where, value, allowed)
    return float(value)


def checked_share(value: float) -> float:
    """Return a share of the inertia that leaves something on both sides."""
    share = checked("motor_share", value, positive=True)
    if share >= 1.0:
        raise ConfigurationError("motor_share", value, "above 0, below 1")
    return share
