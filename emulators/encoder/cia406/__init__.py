"""CiA 406 encoders: `CiA406Encoder` on a CAN segment, mounted on the machine of a
drive or on a shaft of its own.
"""

from __future__ import annotations

from emulators.encoder.cia406._objects import FAMILIES, Family, family_of
from emulators.encoder.cia406.config import EncoderDeviceConfig
from emulators.encoder.cia406.eds import EDS
from emulators.encoder.cia406.encoder import CiA406Encoder
from fieldbus.cia406 import EncoderType

__all__ = [
    "EDS",
    "FAMILIES",
    "CiA406Encoder",
    "EncoderDeviceConfig",
    "EncoderType",
    "Family",
    "family_of",
]
