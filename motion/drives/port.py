"""What an axis asks of its drive, whatever bus and profile carry it.

The axis always speaks PROFIdrive control and status words, because the stopping behaviour is specified in
their terms (STP-258 to STP-290); a port of another profile translates (STP-541 to STP-547).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, Final

from typing_extensions import override

from fieldbus.profidrive.words import STW1, ZSW1

if TYPE_CHECKING:
    from motion.drives.mark import MarkSearch

__all__ = [
    "INPUT_HOME",
    "INPUT_NEGATIVE_LIMIT",
    "INPUT_POSITIVE_LIMIT",
    "STW1",
    "STW1_ALL_OFF",
    "STW1_IDLE",
    "STW1_OFF2_OFF1",
    "STW1_OFF3",
    "STW1_OFF3_OFF1",
    "STW1_OPERATE",
    "SWITCHES",
    "ZSW1",
    "DrivePort",
]


STW1_IDLE: Final = 0x047E
"""Disabled object, no alarm: the drive rests ready to switch on (STP-287)."""
STW1_OPERATE: Final = 0x047F
"""Drive on, setpoints effective."""
STW1_OFF3: Final = 0x047B
"""OFF3 alone withdrawn (STP-315, STP-366)."""
STW1_OFF3_OFF1: Final = 0x047A
"""OFF3 and OFF1 withdrawn (STP-365)."""
STW1_OFF2_OFF1: Final = 0x047C
"""OFF2 and OFF1 withdrawn: coast (STP-336, STP-364)."""
STW1_ALL_OFF: Final = 0x0478
"""OFF1, OFF2 and OFF3 withdrawn (STP-319, STP-366)."""

INPUT_NEGATIVE_LIMIT: Final = 0x1
INPUT_POSITIVE_LIMIT: Final = 0x2
INPUT_HOME: Final = 0x4
SWITCHES: Final = {
    "negative_limit": INPUT_NEGATIVE_LIMIT,
    "positive_limit": INPUT_POSITIVE_LIMIT,
    "home": INPUT_HOME,
}
"""Bits of `DrivePort.inputs` by the name of the switch."""


class DrivePort:
    """Cyclic coupling of one axis to one drive.

    `read` refreshes the attributes from what the bus has brought; `write` sends the outputs of this cycle.
    """

    __slots__ = (
        "absolute_encoder",
        "actual_speed_rpm",
        "actual_torque_nm",
        "brings_speed",
        "drive_fault_code",
        "dsc",
        "encoder_increments",
        "encoder_restarts",
        "following_error",
        "has_parameters",
        "has_torque_data",
        "has_torque_reduction",
        "inputs",
        "interface_number",
        "link_ok",
        "mark",
        "probes",
        "sensor_code",
        "sensor_fault",
        "sign_lost",
        "simulated",
        "speaks_telegram",
        "stw2",
        "telegram_number",
        "torque_limit_reached",
        "zsw1",
    )

    reports_stop: ClassVar[bool] = True
    """The status word shows when a stop that the drive makes by itself has
    ended; False: the axis has to look.
    """
    absolute_from_zero: ClassVar[bool] = False
    """An absolute value lies between 0 and the measuring range, as in Gx_XIST2; False: it has a sign."""
    analog: ClassVar[bool] = False
    """The setpoint is an analog output and no telegram (`Actor.Type`)."""

    def __init__(self) -> None:
        self.zsw1 = 0
        """Last status word 1; 0 while there is no link."""
        self.mark: MarkSearch | None = None
        """Search for the zero mark of the encoder; None: the device has none."""
        self.probes: tuple[tuple[MarkSearch, MarkSearch], ...] = ()
        """Searches for the rising and the falling edge of every probe input of the drive."""
        self.link_ok = False
        """Cyclic data arrive (says nothing of drive faults)."""
        self.encoder_increments = 0
        """Raw encoder count, signed 32 bit, wraps."""
        self.encoder_restarts = 0
        """Counts the times at which the encoder began again (power cycle of the drive); an incremental count
        lost its reference.
        """
        self.following_error = 0
        """Following error of the drive, raw increments, where it controls the position and sends it."""
        self.absolute_encoder = False
        self.sensor_fault = False
        """The drive reports its encoder as faulty."""
        self.sign_lost = False
        """Data arrive, but the device does not count its sign of life on: that is why `link_ok` is FALSE."""
        self.sensor_code = 0
        """Its code for that (G1_XIST2), 0 when there is none."""
        self.actual_speed_rpm = 0.0
        self.brings_speed = True
        """`actual_speed_rpm` comes from the drive."""
        self.actual_torque_nm = 0.0
        self.inputs = 0
        """Digital inputs at the drive: bit 0 negative limit, 1 positive limit, 2 home switch; 1 = active."""
        self.dsc = False
        """The drive can control the position itself, with what `control_position` gives (dynamic servo
        control, CFG-194).
        """
        self.drive_fault_code = 0
        """Fault code of the drive, 0 when none."""
        self.speaks_telegram = False
        """The drive gets control words 1 and 2 as they are, so that their free bits mean something to it."""
        self.stw2 = 0
        """Bits 0 to 11 of control word 2 for the next `write`, where the telegram has it."""
        self.has_torque_data = False
        """Additive torque and torque range reach the drive (telegram 750)."""
        self.has_torque_reduction = False
        """A torque limit reaches the drive, and it says whether that is reached
        (telegrams 102, 103, 105, 106).
        """
        self.torque_limit_reached = False
        """The drive works at the threshold of its torque limit (MELDW bit 1 = 0)."""
        self.has_parameters = False
        """`read_parameter` works: the bus has an acyclic access to the parameters of a PROFIdrive device."""
        self.interface_number = 1
        """Its encoder is the first one of the telegram (`Sensor[n].Interface.Number`)."""
        self.telegram_number = 0
        """Number of the PROFIdrive telegram; 0 without one."""
        self.simulated = False
        """There is no drive: setpoints become actual values by themselves."""

    @abstractmethod
    def read(self) -> None:
        """Take over the inputs that have arrived since the last cycle."""

    def probe_level(self, number: int) -> bool | None:  # noqa: ARG002 - the interface of a port
        """Return whether probe input 1 or 2 is active; None: the connection does not say it."""
        return None

    def fault_text(self) -> str:
        """Return the fault of the drive in words: `drive fault 2310h`; without a code while none has come."""
        return f"drive fault {self.drive_fault_code:04X}h" if self.drive_fault_code else "drive fault"

    def telegram_view(self) -> dict[str, int]:
        """Return the words of the telegram by signal name, as last sent and
        last received (DIA-100, DIA-101).
        """
        return {"ZSW1": self.zsw1}

    def process_words(self) -> dict[str, int]:
        """Return the objects of the connection, as last sent and last received, by the names of its profile:
        `6041h`, `ZSW1`.
        """
        return self.telegram_view()

    def write_position(self, stw1: int, position: int) -> None:
        """Send control word 1 and a position, which the drive controls; only a drive in such a mode takes it.

        Args:
            stw1: Control word 1.
            position: Raw increments of the encoder, signed 32 bit, wraps.

        """
        raise NotImplementedError

    def write_image(self, stw1: int, image: bytes) -> None:
        """Send control word 1 and the 12 byte of the two-speed interface, to a drive that takes them."""
        raise NotImplementedError

    def write_torque(self, stw1: int, permille: int) -> None:
        """Send control word 1 and a torque, permille of the rated one, to a drive that takes torques."""
        raise NotImplementedError

    def control_position(self, deviation_increments: float, gain_per_s: float) -> None:
        """Give position deviation and gain of the next `write`, where `dsc`; without it the drive controls
        the speed alone.

        Args:
            deviation_increments: Setpoint minus actual position, raw increments of the encoder.
            gain_per_s: 1/s.

        """
        raise NotImplementedError

    def set_torque_range(self, upper: float, lower: float) -> None:
        """Limit the torque, shares of the reference torque; where `has_torque_data`."""
        raise NotImplementedError

    def limit_torque(self, share: float | None) -> None:
        """Limit the torque in both directions to a share of the reference torque, 0..1, or
        not; where `has_torque_reduction`.
        """
        raise NotImplementedError

    def set_reference(self, speed_rpm: float, torque_nm: float) -> None:
        """Take over what 100 % of setpoints and actual values mean, where the connection carries shares
        (CFG-273, CFG-275).

        Args:
            speed_rpm: Reference speed, rpm; of a linear motor m/min.
            torque_nm: Reference torque, Nm; of a linear motor the force, N.

        """

    def read_parameter(self, number: int, index: int, answer: Callable[[float | None, str], object]) -> None:
        """Begin to read a parameter of the drive, where `has_parameters`; nothing waits.

        Args:
            number: PROFIdrive number, 922 for p0922.
            index: Element of an array; 0 without one.
            answer: Called once, later: the value, or None and the reason why there is none.

        """
        raise NotImplementedError

    def switch_outputs(self, on: bool) -> None:
        """Switch the process outputs of the controller on or off; off, all words of the drive are 0, whatever
        `write` says.
        """

    @abstractmethod
    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        """Send control word 1, speed setpoint (rpm at the motor) and additive torque (Nm)."""


class NoDrivePort(DrivePort):
    """In place of the connection of an axis that has no drive: a virtual one."""

    __slots__ = ()

    delay_ns: ClassVar[int] = 0
    """Time from a setpoint to its actual value: there is none, ns."""

    @override
    def read(self) -> None:
        pass  # nothing arrives

    @override
    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        pass  # nobody is there to get it

    @override
    def set_torque_range(self, upper: float, lower: float) -> None:
        pass

    @override
    def limit_torque(self, share: float | None) -> None:
        pass
