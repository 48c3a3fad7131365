"""What a bench may ask of the devices in the drive process, by the name of the method."""

from __future__ import annotations

from typing import Final

from fieldbus.errors import HilError
from hil.bench.device_config import DEVICE_METHODS
from hil.bench.encoders import ENCODER_METHODS
from hil.faults import DRIVE_METHODS

PARAMETER_METHODS: Final = frozenset(("read_parameter", "write_parameter", "request_parameters"))
"""What `RemoteParameters` sends through the pipe."""

STATION_METHODS: Final = frozenset(
    ("power_off", "power_on", "check_channel", "hold", "break_wire", "rewire", "disturb")
)
"""Methods of `IoStation` that faults call."""

REMOTE_METHODS: Final = DRIVE_METHODS | ENCODER_METHODS | DEVICE_METHODS | STATION_METHODS
"""Methods of any device that may be called through the pipe."""


class RemoteError(HilError):
    """The drive process failed or does not answer."""
