"""EDS of the PROFIdrive encoder on CANopen."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from emulators.encoder.profidrive._objects import DEVICE_NAME, PRODUCT_CODE, all_objects
from fieldbus.canopen import DeviceEds

EDS: Final = DeviceEds(
    path=Path(__file__).with_name("encoder.eds"),
    objects=all_objects,
    product_name=DEVICE_NAME,
    product_code=PRODUCT_CODE,
    description="Emulated encoder, PROFIdrive",
)
