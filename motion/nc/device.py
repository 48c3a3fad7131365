"""What stands between an axis and its hardware: a drive or an encoder behind a port, or nothing (simulation
axis).
"""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING, Final, Protocol

from fieldbus.profidrive.words import STW1
from motion.drives.port import STW1_IDLE, STW1_OPERATE, ZSW1

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from motion.drives.encoder import EncoderPort
    from motion.drives.mark import MarkSearch
    from motion.drives.port import DrivePort
    from motion.kernel.cell import Cell


HARDWARE_SYNC: Final = 1
"""Reference mode of the zero mark: index of its text in `enc.reference_mode`."""
VELOCITY: Final = 0
"""Interface: the drive gets velocities, the NC controls the position."""
POSITION: Final = 1
"""Interface: the drive gets positions and controls them itself."""
TORQUE: Final = 2
"""Interface: the drive gets torques, the NC controls position and velocity."""
TWO_SPEED: Final = 3
"""Interface: the drive gets the 12 byte of the two-speed interface."""
INTERFACES: Final = {"velocity": VELOCITY, "position": POSITION, "torque": TORQUE}
"""Interfaces of a continuous axis by name."""


class DriveOutputs:
    """What an axis gives to its device in a cycle; the interface of the device says what of it counts."""

    __slots__ = ("acceleration", "enable", "gain", "image", "position", "reset", "torque", "velocity")

    def __init__(self) -> None:
        self.enable = False
        self.reset = False
        """Acknowledge the fault of the drive."""
        self.velocity = 0.0
        """Position unit/s, with the sign of the motor."""
        self.position = 0
        """Increments of the encoder, signed 32 bit, wraps."""
        self.gain = 0.0
        """Gain of the position control for a drive that gets it (dynamic servo control), 1/s."""
        self.torque = 0.0
        """`nDataOut4`."""
        self.acceleration = 0.0
        """`nDataOut3`."""
        self.image = b""
        """Two-speed interface, 12 byte."""


class Device(Protocol):
    """Hardware of an axis as the axis sees it."""

    raw: int
    """Count of the encoder."""
    valid: bool
    """The data of the drive are valid in this cycle (`nState4`, NC-427)."""
    encoder_valid: bool
    """The data of the encoder are valid in this cycle."""
    operating: bool
    """The drive executes setpoints."""
    ready: bool
    """The drive can be enabled, or is."""
    fault: bool
    """The drive reports an error."""
    encoder_fault: bool
    life_lost: bool
    """The drive does not count its sign of life on."""
    torque: float
    """Actual torque as the device sends it (`nDataIn3`)."""
    lag: int
    """Following error as the drive sends it, increments (`nDataIn1` of the drive)."""
    digital_inputs: int
    """`nState8`: eight inputs for homing sensors."""
    direct_inputs: int
    """Inputs E1 and E2 of a terminal: bits 0 and 1 (NC-330)."""
    fast_stop: bool
    """Bit 7 of `nState4` of the drive (NC-113)."""
    restarts: int
    """Counts the starts of an incremental encoder: its count lost its reference."""
    input_age: float
    """Time since the encoder took its value, by its time stamp, s (`nDcInputTime`)."""
    output_lead: float
    """Time until the drive takes its setpoint over, by its time stamp, s (`nDcOutputTime`)."""
    mute: bool
    """The drive has no way to report a fault: one that does not follow its enable counts as faulty in a
    reset."""

    @property
    def simulated(self) -> bool:
        """There is no hardware."""

    @property
    def signed(self) -> bool:
        """The encoder counts around zero."""

    @property
    def interface(self) -> int:
        """What the drive takes: `VELOCITY`, `POSITION`, `TORQUE`, `TWO_SPEED`."""

    @property
    def words(self) -> Mapping[str, int]:
        """Objects of the connection by name, `6041h` or `ZSW1`, as last received and sent."""

    def read(self) -> None:
        """Take over the inputs of this cycle."""

    def write(self, outputs: DriveOutputs) -> None:
        """Send the outputs of this cycle."""

    def search(self, mode: int) -> MarkSearch | None:
        """Return the search for the sync event of a reference mode; None: the device has none (NC-321)."""


class _Values:
    """Inputs of a device that says nothing."""

    def __init__(self) -> None:
        self.raw = 0
        self.valid = False
        self.encoder_valid = False
        self.operating = False
        self.ready = False
        self.fault = False
        self.encoder_fault = False
        self.life_lost = False
        self.torque = 0.0
        self.lag = 0
        self.digital_inputs = 0
        self.direct_inputs = 0
        self.fast_stop = False
        self.restarts = 0
        self.input_age = 0.0
        self.output_lead = 0.0
        self.mute = False


class PortDevice(_Values):
    """A drive behind a port of any bus.

    Args:
        port: The port.
        rpm_per_unit: Motor speed for one position unit per second, rpm.
        interface: `VELOCITY`, `POSITION` or `TORQUE`; the port has to take it.
        torque_per_nm: `nDataIn3` for a newton metre.
        fast_stop_input: Bit of the inputs of the port that is linked to bit 7 of `nState4`; 0: none.
        direct_inputs: The terminal has the inputs E1 and E2, which are the two low inputs (MDP 703, 733).

    """

    simulated = False
    signed = True

    def __init__(
        self,
        port: DrivePort,
        *,
        rpm_per_unit: float,
        interface: int = VELOCITY,
        torque_per_nm: float = 0.0,
        fast_stop_input: int = 0,
        direct_inputs: bool = False,
    ) -> None:
        super().__init__()
        self.port = port
        self.mute = port.analog
        self.interface = interface
        self._rpm_per_unit = rpm_per_unit
        self._on = False
        """The drive is ready for OFF1 to be withdrawn."""
        self._torque_per_nm = torque_per_nm
        self._fast_stop_input = fast_stop_input
        self._direct = 0x3 if direct_inputs else 0
        self.invalid_cycles = 0
        """A fault: as many cycles from the next one on are shown as invalid (`WcState`, NC-763)."""

    @property
    def words(self) -> Mapping[str, int]:
        """Objects of the connection by name, as last received and sent."""
        return self.port.process_words()

    def read(self) -> None:
        """Take over the inputs of this cycle."""
        port = self.port
        port.read()
        word = port.zsw1
        valid = port.link_ok and word & ZSW1.CONTROL_REQUESTED != 0
        if self.invalid_cycles:
            self.invalid_cycles -= 1
            valid = False
        self.valid = self.encoder_valid = valid
        self.life_lost = port.sign_lost
        if not valid:
            # The last valid values count (NC-427).
            self.ready = False
            return
        self._on = word & 0x0001 != 0
        self.fault = fault = word & 0x0008 != 0
        self.operating = word & 0x0004 != 0
        self.ready = not fault
        self.encoder_fault = port.sensor_fault
        self.torque = port.actual_torque_nm * self._torque_per_nm
        inputs = port.inputs
        if self._direct:
            self.direct_inputs = inputs & 0x3
            inputs &= ~0x3
        self.digital_inputs = inputs
        if self._fast_stop_input:
            self.fast_stop = port.inputs & self._fast_stop_input != 0
        self.raw = port.encoder_increments
        self.lag = port.following_error
        self.restarts = port.encoder_restarts

    def write(self, outputs: DriveOutputs) -> None:
        """Send control word and setpoint."""
        port = self.port
        # A drive that inhibits switching on, or went off by itself, wants to see OFF1 withdrawn first.
        off = not self._on or (outputs.reset and not self.operating)
        word: int = STW1_OPERATE if outputs.enable and not off else STW1_IDLE
        if outputs.reset:
            word |= STW1.ACKNOWLEDGE
        interface = self.interface
        if interface == VELOCITY:
            port.write(word, outputs.velocity * self._rpm_per_unit)
        elif interface == POSITION:
            if port.dsc:
                deviation = (outputs.position - self.raw + 0x80000000 & 0xFFFFFFFF) - 0x80000000
                port.control_position(float(deviation), outputs.gain)
                port.write(word, outputs.velocity * self._rpm_per_unit)
            else:
                port.write_position(word, outputs.position)
        elif interface == TORQUE:
            port.write_torque(word, round(outputs.torque))
        else:
            port.write_image(word, outputs.image)

    def search(self, mode: int) -> MarkSearch | None:
        """Return the search for the zero mark, or for an edge of the latch input where the port has one."""
        port = self.port
        if mode == HARDWARE_SYNC:
            return port.mark
        return port.probes[0][mode - HARDWARE_SYNC - 1] if port.probes else None


class EncoderDevice(_Values):
    """An encoder with a connection of its own, for an encoder axis.

    Args:
        port: Its port.

    """

    simulated = False
    signed = True
    interface = VELOCITY

    def __init__(self, port: EncoderPort) -> None:
        super().__init__()
        self.port = port
        self.signed = not port.absolute_from_zero

    @property
    def words(self) -> Mapping[str, int]:
        """Words of its telegram by name."""
        return self.port.telegram_view()

    def read(self) -> None:
        """Take over the inputs of this cycle."""
        port = self.port
        port.read()
        self.valid = self.encoder_valid = port.link_ok
        self.life_lost = port.sign_lost
        self.encoder_fault = port.sensor_fault
        if port.link_ok:
            self.raw = port.encoder_increments
            self.restarts = port.encoder_restarts

    def write(self, outputs: DriveOutputs) -> None:
        """Send nothing: there is no drive."""

    def search(self, mode: int) -> MarkSearch | None:
        """Return the search for the zero mark."""
        return self.port.mark if mode == HARDWARE_SYNC else None


class SimulatedDevice(_Values):
    """Simulation encoder and drive: the set position of the cycle before comes back, with noise (NC-063).

    Args:
        scaling: Returns position units per increment.
        noise_level: Amplitude of the noise, position unit (NC-258).
        noise: Returns a number from -1 to 1; None: a repeatable sequence.

    """

    simulated = True
    signed = True
    interface = VELOCITY

    def __init__(
        self,
        *,
        scaling: Callable[[], float],
        noise_level: Cell[float],
        noise: Callable[[], float] | None = None,
    ) -> None:
        super().__init__()
        self._scaling = scaling
        self._noise_level = noise_level
        self._noise = noise or _noise()
        self._position = 0.0
        self.offset = 0.0
        """Added to the position, for tests of the monitoring (NC-064), position unit."""
        self.valid = self.encoder_valid = self.ready = True

    @property
    def words(self) -> Mapping[str, int]:
        """Nothing: there is no connection."""
        return {}

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

    def write(self, outputs: DriveOutputs) -> None:
        """Take over the enable."""
        self.operating = outputs.enable
        if outputs.reset:
            self.fault = False

    def search(self, mode: int) -> MarkSearch | None:  # noqa: ARG002 - the interface of a device
        """Return None: there is no mark."""
        return None


def _noise() -> Callable[[], float]:
    source = Random(1)  # noqa: S311 - noise of a simulation, the same in every run

    def draw() -> float:
        return source.uniform(-1.0, 1.0)

    return draw
