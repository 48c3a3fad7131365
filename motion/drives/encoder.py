"""What an axis or an external encoder asks of an encoder with a connection of its own, whatever bus and
profile carry it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar

if TYPE_CHECKING:
    from motion.drives.mark import MarkSearch


class EncoderPort(ABC):
    """Cyclic coupling to one encoder; `read` refreshes the attributes from what the bus has brought."""

    absolute_from_zero: ClassVar[bool] = True
    """An absolute value lies between 0 and the measuring range; False: it has a sign."""

    def __init__(self) -> None:
        self.mark: MarkSearch | None = None
        """Search for the zero mark of the encoder; None: the device has none."""
        self.link_ok = False
        """Cyclic data arrive."""
        self.sign_lost = False
        """Data arrive, but the device does not count its sign of life on, so `link_ok` is FALSE."""
        self.sensor_fault = False
        """The encoder reports that its value cannot be relied on."""
        self.encoder_increments = 0
        """Raw encoder count, signed 32 bit, wraps."""
        self.encoder_restarts = 0
        """Counts the times at which the encoder began again."""
        self.absolute_encoder = False
        self.actual_speed_rpm = 0.0
        """Speed of the encoder, where `brings_speed`, rpm; of a linear one m/min."""
        self.probes: tuple[tuple[MarkSearch, MarkSearch], ...] = ()
        """Searches for the rising and the falling edge of every probe input of the encoder."""
        self.brings_speed = False
        self.interface_number = 1
        """Which encoder of its telegram it is (`Sensor[n].Interface.Number`)."""
        self.has_parameters = False
        """The parameters of the device can be read by number."""
        self.telegram_number = 0
        """Number of the PROFIdrive telegram; 0 without one."""

    def set_reference(self, speed: float) -> None:  # noqa: B027 - a connection without shares has nothing to do
        """Take over what 100 % of the actual speed means, rpm, of a linear encoder m/min (CFG-340)."""

    def probe_level(self, number: int) -> bool | None:  # noqa: ARG002 - the interface of a port
        """Return whether probe input 1 or 2 is active; None: the connection does not say it."""
        return None

    @abstractmethod
    def read(self) -> None:
        """Take over the inputs that have arrived since the last cycle."""

    def telegram_view(self) -> dict[str, int]:
        """Return the words of its own telegram by signal name; empty without one (DIA-101, DIA-102)."""
        return {}

    def read_parameter(self, number: int, index: int, answer: Callable[[float | None, str], object]) -> None:
        """Begin to read a parameter of the encoder; the arguments as in `DrivePort.read_parameter`."""
        raise NotImplementedError
