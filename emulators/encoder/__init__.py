"""Encoders: incremental with zero mark, absolute single-turn and multi-turn, and how they are mounted.

`emulators.encoder.cia406` puts one on the bus as a device of its own.
"""

from __future__ import annotations

from emulators.encoder._encoder import AbsoluteEncoder, IncrementalEncoder, RotaryEncoder, ZeroMarkListener
from emulators.encoder._mounting import Mounting
from emulators.encoder._turn_counting import TurnCountingEncoder

__all__ = [
    "AbsoluteEncoder",
    "IncrementalEncoder",
    "Mounting",
    "RotaryEncoder",
    "TurnCountingEncoder",
    "ZeroMarkListener",
]
