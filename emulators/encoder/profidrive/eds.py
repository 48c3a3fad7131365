"""Command that writes the EDS of the PROFIdrive encoder: `python -m emulators.encoder.profidrive.eds
[--check]`.
"""

from __future__ import annotations

import sys

from emulators.encoder.profidrive._eds import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
