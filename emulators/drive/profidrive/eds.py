"""Command that writes the EDS of the PROFIdrive axis: `python -m emulators.drive.profidrive.eds
[--check]`.
"""

from __future__ import annotations

import sys

from emulators.drive.profidrive._eds import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
