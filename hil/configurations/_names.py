"""Names of configurations: all values and the seed in a few digits."""

from __future__ import annotations

from typing import Final

from fieldbus.errors import ConfigurationError
from hil.configurations.factors import CONFIGURATION, FACTORS, Row

_DIGITS: Final = "0123456789abcdefghjkmnpqrstvwxyz"
"""Digits that are not mistaken for each other."""


def name_of(row: Row, seed: int) -> str:
    """Return the name of a configuration."""
    number = 0
    for name, factor in FACTORS.items():
        number = number * len(factor.values) + list(factor.values).index(row[name])
    text = ""
    while number:
        number, digit = divmod(number, len(_DIGITS))
        text = _DIGITS[digit] + text
    return f"{text or _DIGITS[0]}.{seed}"


def read_name(reference: str) -> tuple[Row, int]:
    """Return the values and the seed of a configuration.

    Args:
        reference: Its name, with or without `configuration:`.

    Raises:
        ConfigurationError: There is none with this name.

    """
    digits, _, seed = reference.removeprefix(CONFIGURATION).partition(".")
    known = bool(digits) and seed.isdecimal() and all(digit in _DIGITS for digit in digits)
    number = 0
    for digit in digits if known else "":
        number = number * len(_DIGITS) + _DIGITS.index(digit)
    values = {}
    for name, factor in reversed(list(FACTORS.items())):
        number, at = divmod(number, len(factor.values))
        values[name] = list(factor.values)[at]
    if number or not known:
        raise ConfigurationError(
            "configuration",
            reference,
            "a name that `hil run CAMPAIGN --configurations pairwise --list` shows",
        )
    return {name: values[name] for name in FACTORS}, int(seed)
