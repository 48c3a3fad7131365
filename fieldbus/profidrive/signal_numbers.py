"""Numbers of the standard signals, as PNU 915, 916 and 923 show them."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from fieldbus.profidrive.telegrams import SIGNALS, Layout

SIGNAL_NUMBERS: Final = MappingProxyType(
    {
        "STW1": 1, "ZSW1": 2, "STW2": 3, "ZSW2": 4, "NSOLL_A": 5, "NIST_A": 6, "NSOLL_B": 7, "NIST_B": 8,
        "G1_STW": 9, "G1_ZSW": 10, "G1_XIST1": 11, "G1_XIST2": 12, "G2_STW": 13, "G2_ZSW": 14, "G2_XIST1": 15,
        "G2_XIST2": 16, "XERR": 25, "KPC": 26, "XIST_A": 28, "SATZANW": 32, "AKTSATZ": 33, "MDI_TARPOS": 34,
        "MDI_VELOCITY": 35, "MDI_ACC": 36, "MDI_DEC": 37, "MDI_MOD": 38, "G1_XIST3": 39, "NIST_A_GLATT": 51,
        "IAIST_GLATT": 52, "MIST_GLATT": 53, "PIST_GLATT": 54, "STW2_ENC": 80, "ZSW2_ENC": 81, "MOMRED": 101,
        "MELDW": 102, "OVERRIDE": 205,
    }
)  # fmt: skip
"""Those of the profile, and the manufacturer's from 100 on. A signal that is not here has none: 0."""

_WORDS: Final = {"int32": 2, "n4": 2, "int64": 4}


def signal_numbers(layout: Layout) -> tuple[int, ...]:
    """Return the signal number of each word of one direction of a telegram; a
    double word has its number twice.
    """
    numbers: list[int] = []
    for name in layout.names:
        numbers += [SIGNAL_NUMBERS.get(name, 0)] * _WORDS.get(SIGNALS[name], 1)
    return tuple(numbers)
