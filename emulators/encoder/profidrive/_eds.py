"""EDS of the PROFIdrive encoder on CANopen: text from the object table, and loading for a node.

`python -m emulators.encoder.profidrive.eds` rewrites `encoder.eds` beside this module; `--check` says whether
it is up to date.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from emulators.encoder.profidrive._objects import DEVICE_NAME, PRODUCT_CODE, all_objects
from fieldbus.canopen import eds_text as writer
from fieldbus.canopen.eds import shared_dictionary

if TYPE_CHECKING:
    import canopen

EDS_PATH: Final = Path(__file__).with_name("encoder.eds")
"""The file that ships with the product."""

_INFO: Final = writer.EdsInfo(
    file_name="encoder.eds",
    description="Emulated encoder, PROFIdrive",
    product_name=DEVICE_NAME,
    product_number=PRODUCT_CODE,
    comment="Generated from the object table of the emulated encoder; do not edit.",
)


def eds_text() -> str:
    """Return the EDS of the object table (CiA 306)."""
    return writer.eds_text(all_objects(), _INFO)


def profidrive_encoder_dictionary() -> canopen.ObjectDictionary:
    """Return the object dictionary of the EDS; it is shared between encoders: nobody may change it."""
    return shared_dictionary(EDS_PATH)


def main(arguments: list[str]) -> int:
    """Write the EDS file, or check it with `--check`; returns the exit status."""
    return writer.write_or_check(EDS_PATH, eds_text(), arguments)
