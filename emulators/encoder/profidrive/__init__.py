"""The PROFIdrive face of an encoder: interface Gx_STW, Gx_ZSW, Gx_XIST1, Gx_XIST2, format P979, and a device
with them.

The device is `emulators.encoder.profidrive.device.ProfidriveEncoder`; the interface alone is what a drive
builds in.
"""

from __future__ import annotations

from emulators.encoder.profidrive._abilities import EncoderAbilities, EncoderState
from emulators.encoder.profidrive.format import EncoderFormat, p979
from emulators.encoder.profidrive.interface import EncoderInterface

__all__ = ["EncoderAbilities", "EncoderFormat", "EncoderInterface", "EncoderState", "p979"]
