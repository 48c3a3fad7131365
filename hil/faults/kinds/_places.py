"""Places in a telegram by name, and what a fault makes of the numbers that stand there. Works on frames as
one big number.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Final, NamedTuple

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from fieldbus.profidrive.telegrams import Layout, Telegram

_NAME: Final = re.compile(r"(?P<name>[A-Za-z][A-Za-z0-9_]*)(?:\.(?P<bit>\d+))?")
_WORD: Final = re.compile(r"PZD(\d+)")
_WORD_BITS: Final = 16
_SIGNED: Final = ("n2", "n4", "int32", "int64")
_ONE: Final = {"n2": 0x4000, "n4": 0x4000_0000}

Change = Callable[[int], int]
"""Makes another frame, as a number, of a frame."""


class Place(NamedTuple):
    """Where some bits of a telegram stand."""

    name: str
    """As it was asked for."""
    setpoint: bool
    """To the drive; False: from it."""
    shift: int
    """Bits to the right of it."""
    bits: int
    """How many it has."""
    kind: str
    """Kind of the signal: `word`, `n2`, `n4`, `int32`, `int64`; `bit` for a single one."""

    @property
    def mask(self) -> int:
        """Ones in all bits, at the right."""
        return (1 << self.bits) - 1

    def read(self, frame: int) -> int:
        """Return the bits of a frame."""
        return frame >> self.shift & self.mask

    def write(self, frame: int, value: int) -> int:
        """Return a frame with other bits."""
        return frame & ~(self.mask << self.shift) | (value & self.mask) << self.shift


def find_place(telegram: Telegram, text: str, direction: str, where: str) -> Place:
    """Return the place that a name means.

    Args:
        telegram: Layout of both directions.
        text: `ZSW1.3`, `NIST_B`, `PZD2`, `PZD2.15`.
        direction: `actual` or `setpoint`, for words by their number.
        where: What names it, for the message.

    Raises:
        ConfigurationError: The telegram has no such signal, word or bit.

    """
    match = _NAME.fullmatch(text.strip())
    if match is None:
        raise ConfigurationError(where, text, "a signal, with a bit or without: ZSW1.3, NIST_B, PZD2")
    name = match["name"].upper()
    number = _WORD.fullmatch(name)
    if number is not None:
        setpoint = direction == "setpoint"
        layout = _layout(telegram, setpoint)
        first, bits, kind = 2 * (int(number[1]) - 1), _WORD_BITS, "word"
        if not 0 <= first < layout.length:
            raise ConfigurationError(where, text, f"PZD1 to PZD{layout.words} in this direction")
    else:
        setpoint = name in telegram.setpoint.names
        layout = _layout(telegram, setpoint)
        if name not in layout.names or name == "FREE":
            raise ConfigurationError(
                where,
                text,
                f"{', '.join(telegram.setpoint.names)} to the drive, {', '.join(telegram.actual.names)} "
                f"from it, or PZD1, ...",
            )
        first, bits, kind = _signal(layout, name)
    shift = 8 * (layout.length - first) - bits
    if match["bit"] is None:
        return Place(text, setpoint, shift, bits, kind)
    bit = int(match["bit"])
    if bit >= bits:
        raise ConfigurationError(where, text, f"bits 0 to {bits - 1} of {name}")
    return Place(text, setpoint, shift + bit, 1, "bit")


def _layout(telegram: Telegram, setpoint: bool) -> Layout:
    return telegram.setpoint if setpoint else telegram.actual


def _signal(layout: Layout, name: str) -> tuple[int, int, str]:
    """Return first byte, number of bits and kind of a signal."""
    from fieldbus.profidrive.telegrams import SIGNALS

    kind = SIGNALS[name]
    words = {"word": 1, "n2": 1, "int32": 2, "n4": 2, "int64": 4}[kind]
    return layout.offset(name), _WORD_BITS * words, kind


def stuck(place: Place, value: int | None) -> Change:
    """Let the place stand at a value, or at the first one that is seen."""
    held = value

    def change(frame: int) -> int:
        nonlocal held
        if held is None:
            held = place.read(frame)
        return place.write(frame, held)

    return change


def flipped(place: Place, mask: int) -> Change:
    """Invert the bits of a mask; 0: all of the place."""
    wrong = (mask or place.mask) & place.mask
    return lambda frame: frame ^ wrong << place.shift


def overridden(place: Place, ones: int, zeros: int) -> Change:
    """Show bits as 1, others as 0."""
    return lambda frame: place.write(frame, place.read(frame) & ~zeros | ones)


def swapped(one: Place, other: Place) -> Change:
    """Exchange two places of the same length."""
    return lambda frame: one.write(other.write(frame, one.read(frame)), other.read(frame))


def displaced(place: Place, counts: int) -> Change:
    """Add to the place; normalised signals end at their limits, others wrap."""

    def change(frame: int) -> int:
        value = _number(place, frame) + counts
        return place.write(frame, _bounded(place, value) if place.kind in _ONE else value)

    return change


def scaled(place: Place, factor: float) -> Change:
    """Multiply the place; it ends at its limits."""
    return lambda frame: place.write(frame, _bounded(place, round(_number(place, frame) * factor)))


def percent_of(place: Place, percent: float) -> int:
    """Return a share of the 100 % of a normalised signal, in its counts."""
    return round(percent / 100.0 * _ONE[place.kind])


def normalised(place: Place) -> bool:
    """Whether the place is a signal in percent of a reference value."""
    return place.kind in _ONE


def _number(place: Place, frame: int) -> int:
    """Return the value of the place, with its sign where it has one."""
    value = place.read(frame)
    return value - (1 << place.bits) if place.kind in _SIGNED and value >> (place.bits - 1) else value


def _bounded(place: Place, value: int) -> int:
    half = 1 << (place.bits - 1)
    low, high = (-half, half - 1) if place.kind in _SIGNED else (0, place.mask)
    return min(max(value, low), high)
