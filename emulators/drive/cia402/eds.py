"""EDS of the emulated CiA 402 drive."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from emulators.drive.cia402.objects.table import all_objects
from fieldbus.canopen import DeviceEds

EDS: Final = DeviceEds(
    path=Path(__file__).with_name("servo.eds"),
    objects=all_objects,
    product_name="Emulated servo drive CiA 402",
    product_code=0x402,
    description="Emulated servo drive, CiA 402",
)
EDS_PATH: Final = EDS.path
"""The file that ships with the product."""
