"""EDS of the emulated drive: text from the object table, and loading for a node.

`python -m emulators.drive.cia402.eds` rewrites `servo.eds` beside this module; `--check` says whether it is
up to date.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final

from emulators.drive.cia402.objects.table import all_objects
from fieldbus.canopen import eds_text as writer
from fieldbus.canopen.eds import shared_dictionary

if TYPE_CHECKING:
    import canopen

EDS_PATH: Final = Path(__file__).with_name("servo.eds")
"""The file that ships with the product."""

_INFO: Final = writer.EdsInfo(
    file_name="servo.eds",
    description="Emulated servo drive, CiA 402",
    product_name="Emulated servo drive CiA 402",
    product_number=0x402,
    comment="Generated from the object table of the emulated drive; do not edit.",
)


def eds_text() -> str:
    """Return the EDS of the object table (CiA 306)."""
    return writer.eds_text(all_objects(), _INFO)


def drive_dictionary(path: Path | None = None) -> canopen.ObjectDictionary:
    """Return the object dictionary of an EDS file, by default that of this drive.

    The result is shared between drives, and read anew when the file has changed: nobody may change it.

    Raises:
        ConfigurationError: The file is no EDS.

    """
    return shared_dictionary(EDS_PATH if path is None else path)


def main(arguments: list[str]) -> int:
    """Write the EDS file, or check it with `--check`; returns the exit status."""
    return writer.write_or_check(EDS_PATH, eds_text(), arguments)
