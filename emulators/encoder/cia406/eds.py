"""EDS of the emulated CiA 406 encoders, one for each object table."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Final

from emulators.encoder.cia406._objects import FAMILIES, Family, all_objects, product
from fieldbus.canopen import DeviceEds


def _eds(family: Family) -> DeviceEds:
    name, code = product(family)
    return DeviceEds(
        path=Path(__file__).with_name(f"{family}.eds"),
        objects=partial(all_objects, family),
        product_name=name,
        product_code=code,
    )


EDS: Final[dict[Family, DeviceEds]] = {family: _eds(family) for family in FAMILIES}
