"""EDS of the PROFIdrive axis on CANopen: text from the object table, and loading for a node.

`python -m emulators.drive.profidrive.eds` rewrites `profidrive.eds` beside this module; `--check` says
whether it is up to date.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

from emulators.drive.profidrive.canopen.objects import DEVICE_NAME, PRODUCT_CODE, all_objects
from fieldbus.canopen import eds_text as writer
from fieldbus.canopen.eds import shared_dictionary

if TYPE_CHECKING:
    import canopen

EDS_PATH: Final = Path(__file__).with_name("profidrive.eds")
"""The file that ships with the product."""

_INFO: Final = writer.EdsInfo(
    file_name="profidrive.eds",
    description="Emulated servo drive, PROFIdrive",
    product_name=DEVICE_NAME,
    product_number=PRODUCT_CODE,
    comment="Generated from the object table of the emulated drive; do not edit.",
)


def eds_text() -> str:
    """Return the EDS of the object table (CiA 306)."""
    return writer.eds_text(all_objects(), _INFO)


@lru_cache(maxsize=1)
def profidrive_dictionary() -> canopen.ObjectDictionary:
    """Return the object dictionary of the EDS; it is shared between drives: nobody may change it."""
    return shared_dictionary(EDS_PATH)


def main(arguments: list[str]) -> int:
    """Write the EDS file, or check it with `--check`; returns the exit status."""
    return writer.write_or_check(EDS_PATH, eds_text(), arguments)
