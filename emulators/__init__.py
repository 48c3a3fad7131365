"""The emulated devices: mechanics, encoders, drives.

A device is a composition: mechanics, motor and servo core, encoder, profile face, transport. Nothing here
knows the controller (`motion`); the two sides meet on the wire.
"""

import fieldbus  # noqa: F401 - puts the compiled core in place, if there is one
