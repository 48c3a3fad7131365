"""Command that writes the EDS of the emulated drive: `python -m emulators.drive.cia402.eds [--check]`."""

from __future__ import annotations

import sys

from emulators.drive.cia402._eds import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
