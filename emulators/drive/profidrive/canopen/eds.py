"""EDS of the PROFIdrive axis on CANopen."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from emulators.drive.profidrive.canopen.objects import DEVICE_NAME, PRODUCT_CODE, all_objects
from fieldbus.canopen import DeviceEds

EDS: Final = DeviceEds(
    path=Path(__file__).with_name("profidrive.eds"),
    objects=all_objects,
    product_name=DEVICE_NAME,
    product_code=PRODUCT_CODE,
    description="Emulated servo drive, PROFIdrive",
)
EDS_PATH: Final = EDS.path
"""The file that ships with the product."""
