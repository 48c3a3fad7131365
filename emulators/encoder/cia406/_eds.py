"""EDS files of the emulated encoders: text from the object tables, and loading for a node.

`python -m emulators.encoder.cia406.eds` rewrites the files beside this module; `--check` says whether they
are up to date.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from emulators.encoder.cia406._objects import FAMILIES, Family, all_objects, product
from fieldbus.canopen import eds_text as writer
from fieldbus.canopen.eds import shared_dictionary

if TYPE_CHECKING:
    import canopen


def eds_path(family: Family) -> Path:
    """Return the EDS file that ships with the product."""
    return Path(__file__).with_name(f"{family}.eds")


def eds_text(family: Family) -> str:
    """Return the EDS of an object table (CiA 306)."""
    name, code = product(family)
    return writer.eds_text(
        all_objects(family),
        writer.EdsInfo(
            file_name=f"{family}.eds",
            description=name,
            product_name=name,
            product_number=code,
            comment="Generated from the object table of the emulated encoder; do not edit.",
        ),
    )


def encoder_dictionary(source: Family | Path) -> canopen.ObjectDictionary:
    """Return the object dictionary of an EDS file, or of one of those that ship with the product.

    The result is shared between encoders, and read anew when the file has changed: nobody may change it.

    Raises:
        ConfigurationError: The file is no EDS.

    """
    return shared_dictionary(source if isinstance(source, Path) else eds_path(source))


def main(arguments: Sequence[str]) -> int:
    """Write the EDS files, or check them with `--check`; returns the exit status."""
    return max(writer.write_or_check(eds_path(family), eds_text(family), arguments) for family in FAMILIES)
