"""How an encoder is coupled to a machine, in the keys of a bench file: gear, direction, offset, play."""

from __future__ import annotations

import math
from typing import NamedTuple


class Coupling(NamedTuple):
    """How an encoder is coupled to what it measures, in rad and m."""

    ratio: float
    """Encoder coordinate per coordinate of the shaft or the load."""
    offset: float
    """Encoder coordinate where the machine is at zero."""
    backlash: float
    """Play of the coupling."""


def gear_ratio(numerator: int, denominator: int, *, reversed_direction: bool) -> float:
    """Return revolutions of an encoder per revolution of the shaft, with sign."""
    return numerator / denominator * (-1.0 if reversed_direction else 1.0)


def rotary_coupling(
    ratio: float, *, offset_deg: float, backlash_deg: float, mm_per_revolution: float | None
) -> Coupling:
    """Return the coupling of a rotary encoder.

    Args:
        ratio: Revolutions of the encoder per revolution of what it sits on.
        offset_deg: Place where the machine is at zero.
        backlash_deg: Play.
        mm_per_revolution: Travel of the load per revolution; None: it sits on a shaft.

    """
    if mm_per_revolution is not None:
        ratio *= 2.0 * math.pi * 1000.0 / mm_per_revolution
    return Coupling(ratio, math.radians(offset_deg), math.radians(backlash_deg))


def linear_coupling(
    ratio: float, *, length_mm: float, offset_mm: float | None, backlash_mm: float
) -> Coupling:
    """Return the coupling of a linear encoder; without an offset the machine is at
    zero in the middle of the scale.
    """
    offset = 0.5 * length_mm if offset_mm is None else offset_mm
    return Coupling(ratio, offset / 1000.0, backlash_mm / 1000.0)


def scale_periods(measuring_step_um: float, length_mm: float) -> tuple[int, int]:
    """Return the number of periods of a scale, and their distance in nm."""
    grid_nm = round(measuring_step_um * 1000.0)
    return round(length_mm * 1e6 / max(grid_nm, 1)), grid_nm
