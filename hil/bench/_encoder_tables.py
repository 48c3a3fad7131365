"""What encoders of their own and second encoders of drives have in common: coupling to the machine, and
PROFIdrive formats.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

from pydantic import Field

if TYPE_CHECKING:
    from emulators.encoder.profidrive import EncoderFormat

FineBits = Annotated[int, Field(ge=0, le=31)]
_FINEST_1: Final = 11
_FINEST_2: Final = 9


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
    """Return the coupling of a linear encoder; without an offset the machine is at zero in the middle of the
    scale.
    """
    offset = 0.5 * length_mm if offset_mm is None else offset_mm
    return Coupling(ratio, offset / 1000.0, backlash_mm / 1000.0)


def scale_periods(measuring_step_um: float, length_mm: float) -> tuple[int, int]:
    """Return the number of periods of a scale, and their distance in nm."""
    grid_nm = round(measuring_step_um * 1000.0)
    return round(length_mm * 1e6 / max(grid_nm, 1)), grid_nm


def encoder_format(
    periods: int,
    turns: int,
    *,
    grid_nm: int = 0,
    fine_xist1: int | None = None,
    fine_xist2: int | None = None,
    wide: bool = False,
    counter_bits: int = 32,
) -> EncoderFormat:
    """Return the format of a PROFIdrive encoder; an absolute encoder loads G1_XIST1 with its value (PD-172).

    Args:
        periods: Periods per revolution, or of the scale.
        turns: Revolutions that an absolute encoder tells apart, 1 for a scale; 0: it is incremental.
        grid_nm: Distance of the periods of a scale, nm; 0: it is rotary.
        fine_xist1: Fine resolution of G1_XIST1, bits; None: 11, or as many as fit.
        fine_xist2: Fine resolution of G1_XIST2, bits; None: 9, or as many as fit.
        wide: There is a counter of 64 bits.
        counter_bits: Width of G1_XIST1.

    Raises:
        ConfigurationError: Resolution, range and fine bits do not fit together.

    """
    from emulators.encoder.profidrive import EncoderFormat

    width = max(periods - 1, 0).bit_length()
    first = max(0, min(_FINEST_1, 31 - width)) if fine_xist1 is None else fine_xist1
    steps = max(periods * turns - 1, 0).bit_length()
    second = max(0, min(_FINEST_2, 32 - steps)) if fine_xist2 is None else fine_xist2
    return EncoderFormat(
        periods=periods,
        interpolation_bits=first,
        shift_xist1=first,
        shift_xist2=second,
        revolutions=turns,
        grid_nm=grid_nm,
        load_absolute=turns > 0,
        wide=wide,
        counter_bits=counter_bits,
    )
