"""Writes the EDS files of the emulated devices from their object tables.

`python -m emulators.eds` writes them; with `--check` it names those that are not up to date.
"""

from __future__ import annotations

import sys
from typing import Final

from emulators.drive.cia402.eds import EDS as CIA402_DRIVE
from emulators.drive.profidrive.canopen.eds import EDS as PROFIDRIVE_AXIS
from emulators.encoder.cia406.eds import EDS as CIA406_ENCODERS
from emulators.encoder.profidrive.eds import EDS as PROFIDRIVE_ENCODER
from fieldbus.canopen import write_eds_files

EVERY: Final = (CIA402_DRIVE, PROFIDRIVE_AXIS, *CIA406_ENCODERS.values(), PROFIDRIVE_ENCODER)
"""All EDS files that ship with the product."""

if __name__ == "__main__":
    sys.exit(write_eds_files(EVERY, sys.argv[1:]))
