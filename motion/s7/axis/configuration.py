"""Which configurations of a technology object fit together, and what is adjusted instead (CFG sections 4 to
18, alarms 101, 110).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

from fieldbus.errors import ConfigurationError
from motion.kernel.mechanics import CYCLIC_ABSOLUTE, EXTERNAL, LOAD_SIDE, MOTOR_SIDE
from motion.s7.compatibility import LEVELS
from motion.s7.units import ANGLES, HIGH_RESOLUTION, LENGTHS, VELOCITIES

if TYPE_CHECKING:
    from motion.s7.variables import VariableStore

ENCODER_TELEGRAMS: Final = (81, 83)
"""Telegrams of an encoder with a connection of its own (CFG-197, CFG-198)."""
DRIVE_WITH_ENCODER: Final = (3, 4, 5, 6, 102, 103, 105, 106)
"""Telegrams with setpoint and encoder value (CFG-196)."""
DRIVE_TELEGRAMS: Final = (1, 2, *DRIVE_WITH_ENCODER)
"""Telegrams of the setpoint (CFG-195, CFG-197)."""
DSC_TELEGRAMS: Final = (5, 6, 105, 106)

DIGITAL_OVERRUN: Final = 2.0
"""Most of the setpoint as a multiple of the reference value, with a telegram (CFG-246)."""
ANALOG_OVERRUN: Final = 1.17
"""The same with an analog output (CFG-396)."""


_LARGEST_COUNT: Final = 1 << 32
"""Values of Gx_XIST1."""
_ANALOG: Final = 0
_ROTARY: Final = 1
_LINEAR_MOTOR: Final = 1
_LINEAR_SYSTEM: Final = 0
_HIGH_RESOLUTION_LIMIT: Final = 1.0e9
_POSITIONS: Final = (
    "PositionLimits_SW.MinPosition",
    "PositionLimits_SW.MaxPosition",
    "Modulo.StartValue",
    "Modulo.Length",
    "Homing.HomePosition",
)
_DYNAMICS: Final = tuple(
    f"{group}.{name}"
    for group, names in (
        ("DynamicLimits", ("MaxVelocity", "MaxAcceleration", "MaxDeceleration")),
        ("DynamicDefaults", ("Velocity", "Acceleration", "Deceleration", "EmergencyDeceleration")),
    )
    for name in names
)


class Problem(NamedTuple):
    """A variable whose value does not fit the others."""

    path: str
    value: object
    allowed: str
    """What is allowed, and because of which other variable."""

    def error(self, others: Sequence[Problem] = ()) -> ConfigurationError:
        """Return it as an exception, which names the `others` too."""
        more = "".join(
            f"; and {one.path}: {one.value} is not allowed; allowed: {one.allowed}" for one in others
        )
        return ConfigurationError(self.path, self.value, self.allowed + more)

    def __str__(self) -> str:
        return f"{self.path} = {self.value}; allowed: {self.allowed}"


class Abilities(NamedTuple):
    """What the connection of a technology object can do."""

    dsc: bool = False
    """The drive takes XERR and KPC, and its motor encoder is the first of the object."""
    interfaces: tuple[int, ...] = ()
    """For every encoder in turn, which encoder of its telegram it is."""
    velocities: tuple[bool, ...] = ()
    """For every encoder in turn, whether its telegram has `NIST_B`."""
    simulated: bool = False
    """Nothing of the connection is used: the axis is virtual or simulated."""
    analog: bool = False
    """The setpoint is an analog output (CFG-178)."""


_SHOWN: Final = re.compile(r"(?!StatusSensor.*\.(Adjusted|AbsEncoderOffset)$)(Status|Error|Warning|\w+$)")
"""Variables that show what an object does; those that are retentive of an encoder can be given."""


def given_values(variables: Mapping[str, object]) -> dict[str, object]:
    """Return start values with the units of a rotary object, degrees, where nothing else is given (CFG-069).

    Raises:
        ConfigurationError: One of the variables is no configuration (VAR-009).

    """
    for path, value in variables.items():
        if _SHOWN.match(path):
            raise ConfigurationError(path, value, "no value: it shows what the object does")
    if variables.get("Properties.MotionType") != _ROTARY:
        return dict(variables)
    return {"Units.LengthUnit": 1005, "Units.VelocityUnit": 1521, **variables}


def check_telegrams(object_type: str, drive: int | None, encoders: tuple[int, ...] = ()) -> Problem | None:
    """Say what stands against telegrams for a type of technology object (CFG-195 to CFG-203).

    Args:
        object_type: `SpeedAxis`, `PositioningAxis`, `SynchronousAxis` or `ExternalEncoder`.
        drive: Telegram of the drive; None without one.
        encoders: Telegrams of encoders with a connection of their own, in the order of the object.

    """
    for number in encoders:
        if number not in ENCODER_TELEGRAMS:
            return Problem("encoder telegram", number, _numbers(ENCODER_TELEGRAMS))
    if object_type == "ExternalEncoder":
        if drive is not None:
            return Problem("drive telegram", drive, "none: an external encoder has no drive (CFG-176)")
        if len(encoders) != 1:
            return Problem("encoder telegrams", encoders, "one of " + _numbers(ENCODER_TELEGRAMS))
        return None
    if drive not in DRIVE_TELEGRAMS:
        return Problem("drive telegram", drive, _numbers(DRIVE_TELEGRAMS))
    if object_type == "SpeedAxis":
        if encoders:
            return Problem("encoder telegrams", encoders, "none: a speed axis has no encoder (CFG-174)")
    elif not encoders and drive not in DRIVE_WITH_ENCODER:
        return Problem(
            "drive telegram",
            drive,
            f"{_numbers(DRIVE_WITH_ENCODER)}, or an encoder with telegram {_numbers(ENCODER_TELEGRAMS)} "
            f"next to it (CFG-201)",
        )
    return None


def encoders_of_telegram(drive: int, cpu: str = "S7-1500T") -> int:
    """Return how many encoders of a drive telegram are connected by themselves (CFG-281 to CFG-283)."""
    if drive not in DRIVE_WITH_ENCODER:
        return 0
    return 2 if drive in (6, 106) and LEVELS[cpu].encoders > 1 else 1


def _numbers(numbers: tuple[int, ...]) -> str:
    return ", ".join(map(str, numbers))


_LONG_TIME_S: Final = 0.1
"""T_i, T_o or T_DC above which it is doubted, s (CFG-269)."""


def check_configuration(
    store: VariableStore, abilities: Abilities, *, cpu: str = "S7-1500T", start: bool = False
) -> list[Problem]:
    """Return everything that does not fit together; empty for a consistent configuration.

    Args:
        store: Variables of the technology object.
        abilities: What the connection can do.
        cpu: One of `motion.s7.compatibility.LEVELS`.
        start: Look at the start values, which take effect with a restart, and not at the present values.

    """
    return list(_Check(store, abilities, cpu, start=start).problems())


def doubts(store: VariableStore) -> list[Problem]:
    """Return what is permitted, but hardly meant: a flat emergency ramp (STP-126),
    communication times in ms (CFG-269).
    """
    found = []
    emergency = store.read("DynamicDefaults.EmergencyDeceleration")
    maximum = store.read("DynamicLimits.MaxDeceleration")
    if emergency < maximum:
        found.append(
            Problem(
                "DynamicDefaults.EmergencyDeceleration",
                emergency,
                f"at least DynamicLimits.MaxDeceleration = {maximum:g}, or the axis stops behind its limit "
                f"switch (STP-126)",
            )
        )
    for number in (1010, 1011, 1012):
        time = store.parameter(number)
        if time.cell.value > _LONG_TIME_S:
            allowed = f"at most {_LONG_TIME_S:g} s, or a time in ms has been given (CFG-269)"
            found.append(Problem(f"parameter {number} {time.path}", time.cell.value, allowed))
    return found


class _Check:
    def __init__(self, store: VariableStore, abilities: Abilities, cpu: str, *, start: bool) -> None:
        self.kind = store.object_type
        self.read = store.start_value if start else store.read
        self.can = abilities
        self.cpu = cpu

    def problems(self) -> Iterator[Problem]:
        if self.cpu not in LEVELS:
            yield Problem("cpu", self.cpu, ", ".join(LEVELS))
            return
        axis = self.kind != "ExternalEncoder"
        if axis:
            yield from self._reference()
        if self.kind == "SpeedAxis":
            return
        yield from self._units()
        for number, prefix in enumerate(self._prefixes(), start=1):
            yield from self._sensor(prefix, number)
            if axis:
                yield from self._mounting(prefix)
            velocities = self.can.velocities
            if (
                not self.can.simulated
                and self.read(f"{prefix}.ActualVelocityMode") == 1
                and not (number <= len(velocities) and velocities[number - 1])
            ):
                yield Problem(
                    f"{prefix}.ActualVelocityMode", 1, "0: its connection brings no actual speed (CFG-336)"
                )
        if axis:
            yield from self._axis()

    def _reference(self) -> Iterator[Problem]:
        if not self.can.simulated and (self.read("Actor.Type") == _ANALOG) is not self.can.analog:
            wanted, way = (_ANALOG, "an analog output") if self.can.analog else (1, "a telegram")
            yield Problem(
                "Actor.Type", self.read("Actor.Type"), f"{wanted}: the drive is connected by {way} (CFG-178)"
            )
        linear = self.kind != "SpeedAxis" and self.read("Actor.MotorType") == _LINEAR_MOTOR
        path = (
            "Actor.LinearMotorDriveParameter.ReferenceVelocity"
            if linear
            else "Actor.DriveParameter.ReferenceSpeed"
        )
        if self.read(path) <= 0.0:
            yield Problem(path, self.read(path), "above 0: setpoints are shares of it (VAR-130)")

    def _prefixes(self) -> list[str]:
        if self.kind == "ExternalEncoder":
            return ["Sensor"]
        return [f"Sensor[{n}]" for n in range(1, 5) if self.read(f"Sensor[{n}].Existent")]

    def _units(self) -> Iterator[Problem]:
        read = self.read
        length, velocity = int(self.read("Units.LengthUnit")), int(self.read("Units.VelocityUnit"))
        rotary = read("Properties.MotionType") == _ROTARY
        if (length in ANGLES) is not rotary:
            word, units = ("rotary", ANGLES) if rotary else ("linear", LENGTHS)
            yield Problem(
                "Units.LengthUnit",
                length,
                f"{_numbers(tuple(units))}: Properties.MotionType = {int(rotary)} is a {word} object "
                f"(CFG-068, CFG-069)",
            )
        elif (VELOCITIES[velocity][0] in ANGLES) is not rotary:
            fitting = tuple(code for code, (way, _) in VELOCITIES.items() if (way in ANGLES) is rotary)
            word = "an angle" if rotary else "a length"
            yield Problem(
                "Units.VelocityUnit",
                velocity,
                f"{_numbers(fitting)}: Units.LengthUnit = {length} is {word} (CFG-078 to CFG-080)",
            )
        if length in HIGH_RESOLUTION or velocity in HIGH_RESOLUTION:
            axis = self.kind != "ExternalEncoder"
            paths = (*_POSITIONS, *_DYNAMICS) if axis else ("Modulo.StartValue", "Modulo.Length")
            for path in paths:
                if abs(read(path)) > _HIGH_RESOLUTION_LIMIT:
                    yield Problem(path, read(path), "up to 1e+09 with six decimals (CFG-090, CFG-091)")

    def _sensor(self, prefix: str, number: int) -> Iterator[Problem]:
        read = self.read
        if read(f"{prefix}.System") == _LINEAR_SYSTEM and read("Properties.MotionType") == _ROTARY:
            yield Problem(
                f"{prefix}.System",
                0,
                "1: a linear encoder cannot measure a rotary object (Properties.MotionType = 1)",
            )
        if (
            read(f"{prefix}.Type") == CYCLIC_ABSOLUTE
            and read(f"{prefix}.Parameter.DeterminableRevolutions") == 0
        ):
            yield Problem(
                f"{prefix}.Parameter.DeterminableRevolutions",
                0,
                f"1 or more: {prefix}.Type = 2 counts measuring ranges (CFG-292, CFG-299)",
            )
        steps = int(self.read(f"{prefix}.Parameter.StepsPerRevolution"))
        fine = int(self.read(f"{prefix}.Parameter.FineResolutionXist1"))
        if read(f"{prefix}.System") != _LINEAR_SYSTEM and steps << fine > _LARGEST_COUNT:
            yield Problem(
                f"{prefix}.Parameter.FineResolutionXist1",
                fine,
                f"at most {(_LARGEST_COUNT // steps).bit_length() - 1}: with "
                f"{prefix}.Parameter.StepsPerRevolution = {steps} "
                "a revolution has more counts than G1_XIST1 can tell apart (CFG-618)",
            )
        interfaces = self.can.interfaces
        place = interfaces[number - 1] if number <= len(interfaces) else 1
        if read(f"{prefix}.Interface.Number") != place and not self.can.simulated:
            yield Problem(
                f"{prefix}.Interface.Number",
                read(f"{prefix}.Interface.Number"),
                f"{place}: which encoder of its telegram the connection is (CFG-285)",
            )

    def _mounting(self, prefix: str) -> Iterator[Problem]:
        read = self.read
        mounting = read(f"{prefix}.MountingMode")
        linear_system = read(f"{prefix}.System") == _LINEAR_SYSTEM
        path = f"{prefix}.MountingMode"
        linear_motor = read("Actor.MotorType") == _LINEAR_MOTOR
        if linear_motor:
            wanted = MOTOR_SIDE if linear_system else EXTERNAL
            if mounting != wanted:
                yield Problem(
                    path,
                    mounting,
                    f"{wanted}: Actor.MotorType = 1 with {prefix}.System = {int(not linear_system)} "
                    f"(CFG-523)",
                )
        elif linear_system and mounting == MOTOR_SIDE:
            yield Problem(
                path,
                mounting,
                f"{LOAD_SIDE} or {EXTERNAL}: a linear encoder ({prefix}.System = 0) does not sit on a motor "
                f"shaft (CFG-513)",
            )
        if read(f"{prefix}.Backlash.Enable") and (linear_motor or mounting != MOTOR_SIDE):
            yield Problem(
                f"{prefix}.Backlash.Enable",
                True,
                f"FALSE: compensation needs a standard motor and {path} = 0 (CFG-522)",
            )

    def _axis(self) -> Iterator[Problem]:
        read, can = self.read, self.can
        if read("Actor.MotorType") == _LINEAR_MOTOR and read("Properties.MotionType") == _ROTARY:
            yield Problem(
                "Actor.MotorType",
                1,
                "0: a rotary axis (Properties.MotionType = 1) has a standard motor (CFG-069)",
            )
        most = LEVELS[self.cpu].leading_interfaces
        output = "CrossPlcSynchronousOperation.Interface[{}].EnableLeadingValueOutput"
        beyond = next((n for n in range(most + 1, 33) if read(output.format(n))), 0)
        if beyond:
            yield Problem(
                output.format(beyond), True, f"FALSE: cpu = {self.cpu} has {most} outputs (SYN-071)"
            )
        existing = [n for n in range(1, 5) if read(f"Sensor[{n}].Existent")]
        if not existing:
            yield Problem("Sensor[1].Existent", False, "TRUE: a positioning axis needs an encoder (CFG-012)")
        if len(existing) > LEVELS[self.cpu].encoders:
            yield Problem(
                f"Sensor[{existing[1]}].Existent", True, f"FALSE: cpu = {self.cpu} has one encoder (CFG-177)"
            )
        for number in existing:
            if number > max(1, len(can.interfaces)):
                yield Problem(
                    f"Sensor[{number}].Existent",
                    True,
                    f"FALSE: the axis is connected to {len(can.interfaces)} encoder(s) (CFG-175)",
                )
        initial = read("PositionControl.InitialOperativeSensor")
        if initial not in existing:
            yield Problem(
                "PositionControl.InitialOperativeSensor",
                initial,
                f"{_numbers(tuple(existing))}: the encoders that exist",
            )
        elif initial != 1 and can.simulated:
            yield Problem(
                "PositionControl.InitialOperativeSensor",
                initial,
                "1: a simulated axis is controlled with its first encoder (CFG-159)",
            )
        if read("PositionControl.EnableDSC") and not can.simulated:
            if not can.dsc:
                yield Problem(
                    "PositionControl.EnableDSC", True, "FALSE: the drive takes no XERR and KPC (CFG-221)"
                )
            elif initial != 1:
                yield Problem(
                    "PositionControl.InitialOperativeSensor",
                    initial,
                    "1: with PositionControl.EnableDSC the motor encoder controls (CFG-221)",
                )
        tolerance, deviation = (
            read("Clamping.PositionTolerance"),
            read("Clamping.FollowingErrorDeviation"),
        )
        if tolerance >= deviation:
            yield Problem(
                "Clamping.PositionTolerance",
                tolerance,
                f"below Clamping.FollowingErrorDeviation = {deviation:g} (STP-164)",
            )
        if read("PositionControl.Kv") <= 0.0:
            yield Problem("PositionControl.Kv", read("PositionControl.Kv"), "above 0 1/s (VAR-178)")


class SetpointRange(NamedTuple):
    """How the output of an axis is normalised, and where it ends."""

    reference: float
    """What 100 % of the setpoint means: rpm, of a linear motor m/min."""
    maximum: float
    """Limit of the setpoint in the same unit."""
    adjusted: str
    """Text of warning 110 where the configured limit is more than the connection can say; else empty."""
    torque: float
    """Reference torque, Nm, or force, N."""


def setpoint_range(store: VariableStore) -> SetpointRange:
    """Return normalisation and limit of the speed setpoint (CFG-247, CFG-629, VAR-131)."""
    read = store.read
    if store.object_type != "SpeedAxis" and read("Actor.MotorType") == _LINEAR_MOTOR:
        place = "Actor.LinearMotorDriveParameter."
        reference_name, maximum_name, torque_name = "ReferenceVelocity", "MaxVelocity", "ReferenceForce"
    else:
        place = "Actor.DriveParameter."
        reference_name, maximum_name, torque_name = "ReferenceSpeed", "MaxSpeed", "ReferenceTorque"
    reference, maximum = read(place + reference_name), read(place + maximum_name)
    most = reference * (ANALOG_OVERRUN if read("Actor.Type") == _ANALOG else DIGITAL_OVERRUN)
    adjusted = ""
    if maximum > most:
        adjusted = (
            f"{place}{maximum_name} = {maximum:g} works as {most:g}, because {reference_name} = {reference:g}"
        )
        maximum = most
    return SetpointRange(reference, maximum, adjusted, store.bind(place + torque_name).value)
