"""Command that writes the EDS files of the emulated encoders: `python -m emulators.encoder.cia406.eds
[--check]`.
"""

from __future__ import annotations

import sys

from emulators.encoder.cia406._eds import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
