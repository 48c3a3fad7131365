"""Number formats of PROFIdrive words (PD-033 to PD-044): normalised values, reductions, gains."""

from __future__ import annotations

from enum import IntEnum
from typing import Final

N2_ONE: Final = 0x4000
"""100 % of the reference quantity as N2 (PD-033)."""
N4_ONE: Final = 0x4000_0000
"""100 % of the reference quantity as N4 (PD-034)."""
KPC_PER_SECOND: Final = 1000
"""KPC is in 0.001 1/s (PD-042)."""
KPC_MAX: Final = 4_000_000
"""Largest KPC, 4000 1/s."""

_N2_LOW, _N2_HIGH = -0x8000, 0x7FFF
_N4_LOW, _N4_HIGH = -0x8000_0000, 0x7FFF_FFFF


def to_n2(fraction: float) -> int:
    """Return a fraction of the reference quantity (1.0 = 100 %) as N2, held at -200 % and just below +200 %.

    Not-a-number gives 0, so that a failed calculation never turns a motor.
    """
    return _held(fraction, N2_ONE, _N2_LOW, _N2_HIGH)


def to_n4(fraction: float) -> int:
    """Return a fraction of the reference quantity as N4, held at the ends of the range (PD-034, CFG-246)."""
    scaled = fraction * N4_ONE
    if _N4_LOW < scaled < _N4_HIGH:
        return int(scaled + 0.5) if scaled >= 0.0 else -int(0.5 - scaled)
    return _held(fraction, N4_ONE, _N4_LOW, _N4_HIGH)


def to_int32(value: float) -> int:
    """Return a quantity in its own unit, rounded and held within 32 bits; not-a-number gives 0."""
    return _held(value, 1, _N4_LOW, _N4_HIGH)


def from_n2(value: int) -> float:
    """Return N2 as a fraction of the reference quantity, -2.0 to just below 2.0."""
    return value / N2_ONE


def from_n4(value: int) -> float:
    """Return N4 as a fraction of the reference quantity, -2.0 to just below 2.0."""
    return value / N4_ONE


def _held(fraction: float, one: int, low: int, high: int) -> int:
    if fraction != fraction:  # noqa: PLR0124 - not-a-number
        return 0
    scaled = fraction * one
    if scaled >= high:
        return high
    if scaled <= low:
        return low
    return int(scaled + 0.5) if scaled >= 0.0 else -int(0.5 - scaled)


def torque_factor(momred: int, evaluation_percent: float = 100.0) -> float:
    """Return what MOMRED leaves of the torque limits, 0..1 (PD-037).

    Args:
        momred: Word of the telegram; 4000h is a reduction by the whole `evaluation_percent`. Negative
            words reduce nothing.
        evaluation_percent: p1544, 0 or more.

    """
    return min(1.0, max(0.0, 1.0 - max(0, momred) / N2_ONE * evaluation_percent / 100.0))


def to_kpc(gain_per_s: float) -> int:
    """Return a gain of the position controller (1/s) as KPC, held at 0 and 4000 1/s (PD-042)."""
    return min(KPC_MAX, max(0, round(gain_per_s * KPC_PER_SECOND))) if gain_per_s == gain_per_s else 0  # noqa: PLR0124


class TypeCode(IntEnum):
    """Data types of parameter values (PD-044)."""

    BOOLEAN = 1
    INTEGER8 = 2
    INTEGER16 = 3
    INTEGER32 = 4
    UNSIGNED8 = 5
    UNSIGNED16 = 6
    UNSIGNED32 = 7
    FLOAT32 = 8
    VISIBLE_STRING = 9
    OCTET_STRING = 10
    TIME_OF_DAY = 12
    TIME_DIFFERENCE = 13
    FLOAT64 = 15
    DATE = 50
    TIME_OF_DAY_WITHOUT_DATE = 52
    TIME_DIFFERENCE_WITH_DATE = 53
    TIME_DIFFERENCE_WITHOUT_DATE = 54
    INTEGER64 = 55
    UNSIGNED64 = 56
    N2 = 113
    N4 = 114
    V2 = 115
    L2 = 116
    R2 = 117
    T2 = 118
    T4 = 119
    D2 = 120
    E2 = 121
    C4 = 122
    X2 = 123
    X4 = 124
