"""What stands between an axis and its hardware: a drive behind a port, or nothing (simulation axis)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Protocol

from fieldbus.profidrive.words import STW1
from motion.drives.port import STW1_IDLE, STW1_OPERATE, ZSW1

if TYPE_CHECKING:
    from collections.abc import Callable

    from motion.drives.mark import MarkSearch
    from motion.drives.port import DrivePort
    from motion.kernel.cell import Cell


HARDWARE_SYNC: Final = 1
"""Reference mode of the zero mark: index of its text in `enc.reference_mode`."""


class Device(Protocol):
    """Hardware of an axis as the axis sees it."""

    raw: int
    """Count of the encoder."""
    valid: bool
    """The data of this cycle are valid (`nState4` of encoder and drive, NC-427)."""
    operating: bool
    """The drive executes setpoints."""
    ready: bool
    """The drive can be enabled, or is."""
    fault: bool
    """The drive reports an error."""
    encoder_fault: bool
    torque: float
    """Actual torque as the device sends it."""
    digital_inputs: int
    """`nState8`: eight inputs for homing sensors."""
    fast_stop: bool
    """Bit 7 of `nState4` of the drive (NC-113)."""
    restarts: int
    """Counts the starts of an incremental encoder: its count lost its reference."""

    @property
    def simulated(self) -> bool:
        """There is no hardware."""

    @property
    def signed(self) -> bool:
        """The encoder counts around zero."""

    def read(self) -> None:
        """Take over the inputs of this cycle."""

    def write(self, velocity: float, *, enable: bool, reset: bool) -> None:
        """Send the outputs of this cycle; `velocity` in position units/s."""

    def search(self, mode: int) -> MarkSearch | None:
        """Return the search for the sync event of a reference mode; None: the device has none (NC-321)."""


class PortDevice:
    """A drive behind a port of any bus.

    Args:
        port: The port.
        rpm_per_unit: Motor speed for one position unit per second, rpm.

    """

    simulated = False
    signed = True

    def __init__(self, port: DrivePort, *, rpm_per_unit: float) -> None:
        self.port = port
        self._rpm_per_unit = rpm_per_unit
        self.raw = 0
        self.valid = False
        self.operating = False
        self.ready = False
        self.fault = False
        self.encoder_fault = False
        self.torque = 0.0
        self.digital_inputs = 0
        self.fast_stop = False
        self.restarts = 0

    def read(self) -> None:
        """Take over the inputs of this cycle."""
        port = self.port
        port.read()
        word = port.zsw1
        self.valid = port.link_ok and word & ZSW1.CONTROL_REQUESTED != 0
        self.fault = word & 0x0008 != 0
        self.operating = word & 0x0004 != 0
        self.ready = self.valid and not self.fault
        self.encoder_fault = port.sensor_fault
        self.torque = port.actual_torque_nm
        self.digital_inputs = port.inputs
        if self.valid:
            self.raw = port.encoder_increments
            self.restarts = port.encoder_restarts

    def write(self, velocity: float, *, enable: bool, reset: bool) -> None:
        """Send control word and speed."""
        # A drive that inhibits switching on wants to see OFF1 withdrawn first.
        word: int = STW1_OPERATE if enable and self.port.zsw1 & 0x0001 else STW1_IDLE
        if reset:
            word |= STW1.ACKNOWLEDGE
        self.port.write(word, velocity * self._rpm_per_unit)

    def search(self, mode: int) -> MarkSearch | None:
        """Return the search for the zero mark; latches are not wired."""
        return self.port.mark if mode == HARDWARE_SYNC else None


class SimulatedDevice:
    """Simulation encoder and drive: the set position of the cycle before comes back, with noise (NC-063).

    Args:
        scaling: Returns position units per increment.
        noise_level: Amplitude of the noise, position unit (NC-258).
        noise: Returns a number from -1 to 1.

    """

    simulated = True
    signed = True

    def __init__(
        self, *, scaling: Callable[[], float], noise_level: Cell[float], noise: Callable[[], float]
    ) -> None:
        self._scaling = scaling
        self._noise_level = noise_level
        self._noise = noise
        self._position = 0.0
        self.offset = 0.0
        """Added to the position, for tests of the monitoring (NC-064), position unit."""
        self.raw = 0
        self.valid = True
        self.operating = False
        self.ready = True
        self.fault = False
        self.encoder_fault = False
        self.torque = 0.0
        self.digital_inputs = 0
        self.fast_stop = False
        self.restarts = 0

    def follow(self, way: float) -> None:
        """Move by the way of the set position of this cycle; the next `read` shows it."""
        self._position += way

    def read(self) -> None:
        """Show the set position of the last cycle."""
        position = self._position + self.offset
        level = self._noise_level.value
        if level:
            position += level * self._noise()
        self.raw = round(position / self._scaling())

    def write(self, velocity: float, *, enable: bool, reset: bool) -> None:  # noqa: ARG002 - the interface of a device
        """Take over the enable."""
        self.operating = enable
        if reset:
            self.fault = False

    def search(self, mode: int) -> MarkSearch | None:  # noqa: ARG002 - the interface of a device
        """Return None: there is no mark."""
        return None
