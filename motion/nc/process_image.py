"""Process images between NC and device: encoder and drive, inputs and outputs, 40 byte each (section 15.1 to
15.4).

An image is made when somebody asks for it, from what the device has exchanged with its hardware: the
connection itself is that of the drive port.
"""

from __future__ import annotations

from dataclasses import dataclass
from struct import Struct
from typing import TYPE_CHECKING, Final

from motion.nc.device import POSITION, TORQUE, TWO_SPEED

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping

    from motion.nc.axis import NcAxis

SOE: Final = "SoE"
COE: Final = "CoE"
PROFIDRIVE: Final = "PROFIdrive"
MINUS: Final = 0x41
PLUS: Final = 0x42
STAND: Final = 0x80
"""Digital direction of a setpoint (NC-419, NC-420)."""
INPUT_INVALID: Final = 0x01
FAST_STOP: Final = 0x80
"""Bits of `nState4`: bits 0 to 6 are the state of the fieldbus, bit 7 is the fast axis stop (NC-123)."""
_LAYOUT: Final = Struct("<II4B4I4BiI")
_SIGNED: Final = 14
"""Place of the time stamp, which has a sign."""


@dataclass(frozen=True)
class Variable:
    """One variable of a process image.

    Args:
        name: Its name.
        bits: Size of it, 8 or 32.
        meaning: What it is; `reserved` for none.
        soe: Parameters of a SERCOS drive, the first that it has counts.
        coe: Objects of a CiA 402 drive, likewise; `low` and `high` for a byte of it.
        profidrive: Signals of a PROFIdrive telegram, likewise.

    """

    name: str
    bits: int
    meaning: str
    soe: tuple[str, ...] = ()
    coe: tuple[str, ...] = ()
    profidrive: tuple[str, ...] = ()

    def objects(self, protocol: str) -> tuple[str, ...]:
        """Return what it may be linked to, the best one first."""
        return {SOE: self.soe, COE: self.coe, PROFIDRIVE: self.profidrive}[protocol]

    def linked(self, protocol: str, available: Collection[str]) -> str | None:
        """Return what it is linked to on a device; None: it stays 0 (NC-379)."""
        return next((one for one in self.objects(protocol) if one.split(" ")[0] in available), None)


def _reserved(*names: str) -> tuple[Variable, ...]:
    return tuple(Variable(name, 32 if "Data" in name else 8, "reserved") for name in names)


ENCODER_IN: Final = (
    Variable("nDataIn1", 32, "actual position", ("S-0-0051",), ("6064h",), ("G1_XIST1",)),
    Variable("nDataIn2", 32, "latched actual position", profidrive=("G1_XIST2",)),
    Variable("nState1", 8, "state of the encoder and its latch", profidrive=("G1_ZSW low",)),
    Variable("nState2", 8, "further state", profidrive=("G1_ZSW high",)),
    *_reserved("nState3"),
    Variable("nState4", 8, "state of the fieldbus: 0 valid"),
    Variable("nDataIn3", 32, "probe 1, rising edge", ("S-0-0130",), ("60BAh",)),
    Variable("nDataIn4", 32, "probe 1, falling edge", ("S-0-0131",), ("60BBh",)),
    Variable("nDataIn5", 32, "probe 2, rising edge", ("S-0-0132",), ("60BCh",)),
    Variable("nDataIn6", 32, "probe 2, falling edge", ("S-0-0133",), ("60BDh",)),
    Variable("nState5", 8, "probe 1 rising latched, or probe status", ("S-0-0409",), ("60B9h low",)),
    Variable("nState6", 8, "probe 1 falling latched, or probe status", ("S-0-0410",), ("60B9h high",)),
    Variable("nState7", 8, "probe 2 rising latched", ("S-0-0411",)),
    Variable("nState8", 8, "probe 2 falling latched", ("S-0-0412",)),
    Variable("nDcInputTime", 32, "age of the value, ns, for the compensation of dead time"),
    Variable("nDataIn7", 32, "actual velocity", ("S-0-0040",), ("606Ch", "6044h")),
)
"""Device to encoder of the NC (NC-381 to NC-396)."""
ENCODER_OUT: Final = (
    Variable("nDataOut1", 32, "actual position, copied from nDataIn1"),
    Variable("nDataOut2", 32, "control deviation of dynamic servo control", profidrive=("XERR",)),
    Variable("nCtrl1", 8, "latch, encoder reset", profidrive=("G1_STW low",)),
    Variable("nCtrl2", 8, "latch, encoder reset, absolute position", profidrive=("G1_STW high",)),
    *_reserved("nCtrl3", "nCtrl4", "nDataOut3", "nDataOut4", "nDataOut5", "nDataOut6"),
    Variable("nCtrl5", 8, "probe enable", ("S-0-0405 low",), ("60B8h low",)),
    Variable("nCtrl6", 8, "probe enable", ("S-0-0406 low",), ("60B8h high",)),
    *_reserved("nCtrl7", "nCtrl8", "nDataOut7", "nDataOut8"),
)
"""Encoder of the NC to device (NC-397 to NC-403)."""
DRIVE_IN: Final = (
    Variable("nDataIn1", 32, "following error of the drive", ("S-0-0189",), ("60F4h",)),
    *_reserved("nDataIn2"),
    Variable("nState1", 8, "state of the drive", ("S-0-0135 low",), ("6041h low",), ("ZSW1 low",)),
    Variable("nState2", 8, "state of the drive", ("S-0-0135 high",), ("6041h high",), ("ZSW2 low",)),
    *_reserved("nState3"),
    Variable("nState4", 8, "state of the fieldbus: 0 valid; bit 7: fast axis stop"),
    Variable("nDataIn3", 32, "actual torque or force", ("S-0-0084",), ("6077h",)),
    *_reserved("nDataIn4", "nDataIn5", "nDataIn6"),
    Variable("nState5", 8, "mode of operation display", coe=("6061h",)),
    *_reserved("nState6", "nState7"),
    Variable("nState8", 8, "digital inputs 1 to 8"),
    Variable("nDcOutputTime", 32, "time until the output, ns, for the compensation of dead time"),
    *_reserved("nDataIn7"),
)
"""Device to drive of the NC (NC-404 to NC-415)."""
DRIVE_OUT: Final = (
    Variable("nDataOut1", 32, "target position or velocity", ("S-0-0047",), ("607Ah", "6062h"), ("KPC",)),
    Variable("nDataOut2", 32, "target velocity", ("S-0-0036",), ("60FFh", "606Bh", "6042h"), ("NSOLL_B",)),
    Variable("nCtrl1", 8, "control of the drive", ("S-0-0134 low",), ("6040h low",), ("STW1 low",)),
    Variable("nCtrl2", 8, "control, or direction", ("S-0-0134 high",), ("6040h high",), ("STW2 low",)),
    Variable("nCtrl3", 8, "direction of the total output"),
    *_reserved("nCtrl4"),
    Variable("nDataOut3", 32, "target acceleration and torque", ("S-0-0081",), ("60B2h",)),
    Variable("nDataOut4", 32, "torque", ("S-0-0080",), ("6071h", "6074h")),
    Variable("nDataOut5", 32, "upper velocity limit", ("S-0-0485",), ("60C9h",)),
    Variable("nDataOut6", 32, "lower velocity limit", ("S-0-0484",), ("60C8h",)),
    Variable("nCtrl5", 8, "mode of operation", coe=("6060h",)),
    *_reserved("nCtrl6", "nCtrl7", "nCtrl8", "nDataOut7", "nDataOut8"),
)
"""Drive of the NC to device (NC-416 to NC-426)."""


def pack(values: Mapping[str, int], variables: tuple[Variable, ...]) -> bytes:
    """Return an image of 40 byte; a value that is missing is 0."""
    numbers = []
    for number, one in enumerate(variables):
        value = values.get(one.name, 0)
        if number == _SIGNED:
            numbers.append(value)
        else:
            numbers.append(value & (1 << one.bits) - 1)
    return _LAYOUT.pack(*numbers)


def signed(value: int, bits: int) -> int:
    """Return a number of 16 or 32 bits with its sign (NC-380)."""
    return value - (1 << bits) if value >> (bits - 1) & 1 else value


def direction(velocity: float) -> int:
    """Return the digital direction of a velocity (NC-419)."""
    return PLUS if velocity > 0.0 else MINUS if velocity < 0.0 else STAND


class ProcessImage:
    """The process images of an axis as of its last cycle.

    Args:
        axis: The axis.

    """

    def __init__(self, axis: NcAxis) -> None:
        self._axis = axis

    @property
    def protocol(self) -> str | None:
        """Of the device: `CoE` for CiA 402, `PROFIdrive`; None: none that has objects."""
        words = self._axis.device.words
        if "6041h" in words:
            return COE
        return PROFIDRIVE if "ZSW1" in words and "STW1" in words else None

    def links(self, variables: tuple[Variable, ...]) -> dict[str, str]:
        """Return to which object of the device each variable is linked; without those that are not."""
        protocol, words = self.protocol, self._axis.device.words
        if protocol is None:
            return {}
        found = {one.name: one.linked(protocol, words) for one in variables}
        return {name: link for name, link in found.items() if link is not None}

    def _linked(self, variables: tuple[Variable, ...]) -> dict[str, int]:
        words = self._axis.device.words
        values: dict[str, int] = {}
        for name, link in self.links(variables).items():
            place, _, part = link.partition(" ")
            value = words[place]
            values[name] = value >> 8 & 0xFF if part == "high" else value & 0xFF if part == "low" else value
        return values

    def encoder_inputs(self) -> dict[str, int]:
        """Return the variables from the device to the encoder by name."""
        device = self._axis.device
        values = self._linked(ENCODER_IN)
        values["nDataIn1"] = device.raw & 0xFFFFFFFF
        values["nState4"] = 0 if device.encoder_valid else INPUT_INVALID
        values["nDcInputTime"] = round(device.input_age * 1e9)
        return values

    def encoder_outputs(self) -> dict[str, int]:
        """Return the variables from the encoder to the device by name."""
        values = self._linked(ENCODER_OUT)
        values["nDataOut1"] = self._axis.device.raw & 0xFFFFFFFF
        return values

    def drive_inputs(self) -> dict[str, int]:
        """Return the variables from the device to the drive by name."""
        device = self._axis.device
        values = self._linked(DRIVE_IN)
        values["nDataIn1"] = device.lag & 0xFFFFFFFF
        values["nDataIn3"] = round(device.torque) & 0xFFFFFFFF
        values["nState4"] = (0 if device.valid else INPUT_INVALID) | (FAST_STOP if device.fast_stop else 0)
        values["nState8"] = device.digital_inputs & 0xFF
        values["nDcOutputTime"] = round(device.output_lead * 1e9)
        return values

    def drive_outputs(self) -> dict[str, int]:
        """Return the variables from the drive to the device by name."""
        axis = self._axis
        outputs, drive, interface = axis.outputs, axis.drive, axis.device.interface
        values = self._linked(DRIVE_OUT)
        if interface == TWO_SPEED and axis.discrete is not None:
            image = axis.discrete.image
            return {"nCtrl1": image[8], "nCtrl2": image[9]}
        if interface == POSITION:
            values["nDataOut1"] = outputs.position & 0xFFFFFFFF
        elif interface != TORQUE:
            raw = self._velocity(drive.output)
            if axis.universal:
                values["nDataOut1"], values["nDataOut2"] = raw & 0xFFFFFFFF, abs(raw)
            elif "nDataOut2" not in values:
                values["nDataOut1"] = values["nDataOut2"] = raw & 0xFFFFFFFF
        values["nDataOut3"] = round(drive.acceleration) & 0xFFFFFFFF
        values["nDataOut4"] = round(drive.torque) & 0xFFFFFFFF
        highest = round(axis.maximum_velocity / axis.encoder.scaling)
        values["nDataOut5"], values["nDataOut6"] = highest & 0xFFFFFFFF, -highest & 0xFFFFFFFF
        if "nCtrl1" not in values:
            values["nCtrl1"] = outputs.enable | outputs.reset << 1
        if self.protocol is None:
            values["nCtrl2"] = direction(axis.motion.v)
        values["nCtrl3"] = direction(drive.total)
        return values

    def _velocity(self, share: float) -> int:
        """Return a velocity output as the drive type has it: share of full scale, or increments per second
        times its factor.
        """
        axis = self._axis
        drive = axis.drive
        if not drive.digital:
            return round(share * 32767.0)
        return round(share * drive.full * drive.velocity_factor / axis.encoder.scaling)

    def pack_encoder_inputs(self) -> bytes:
        """Return the image from the device to the encoder."""
        return pack(self.encoder_inputs(), ENCODER_IN)

    def pack_encoder_outputs(self) -> bytes:
        """Return the image from the encoder to the device."""
        return pack(self.encoder_outputs(), ENCODER_OUT)

    def pack_drive_inputs(self) -> bytes:
        """Return the image from the device to the drive."""
        return pack(self.drive_inputs(), DRIVE_IN)

    def pack_drive_outputs(self) -> bytes:
        """Return the image from the drive to the device; the 12 byte of a two-speed drive."""
        axis = self._axis
        if axis.device.interface == TWO_SPEED and axis.discrete is not None:
            return axis.discrete.image
        return pack(self.drive_outputs(), DRIVE_OUT)
