"""Encoders on the motor shaft: incremental with zero mark, absolute single-turn and multi-turn."""

from __future__ import annotations

from emulators.encoder._encoder import AbsoluteEncoder, IncrementalEncoder, RotaryEncoder, ZeroMarkListener

__all__ = ["AbsoluteEncoder", "IncrementalEncoder", "RotaryEncoder", "ZeroMarkListener"]
