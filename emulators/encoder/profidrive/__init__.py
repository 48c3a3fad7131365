"""The PROFIdrive face of an encoder: the interface Gx_STW, Gx_ZSW, Gx_XIST1, Gx_XIST2 and its format P979."""

from __future__ import annotations

from emulators.encoder.profidrive._abilities import EncoderAbilities, EncoderState
from emulators.encoder.profidrive.format import EncoderFormat, p979
from emulators.encoder.profidrive.interface import EncoderInterface

__all__ = ["EncoderAbilities", "EncoderFormat", "EncoderInterface", "EncoderState", "p979"]
