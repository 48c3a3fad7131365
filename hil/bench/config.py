"""The bench file: its model, its checks and its messages.

A bench file is TOML. Every mistake is reported with the file, the key, the value and what is allowed.
"""

from __future__ import annotations

import hashlib
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import (
    Field,
    PlainValidator,
    ValidationError,
    model_validator,
)

from fieldbus.errors import ConfigurationError
from hil.bench._drive_sections import NotNegative, Section
from hil.bench.axis_config import check_axis_encoders, check_external_encoders
from hil.bench.device_config import DeviceSection, anchor_files, check_devices, eds_files
from hil.bench.drive_config import DriveSection
from hil.bench.encoder_config import EncoderSection, check_encoders
from hil.bench.io_config import StationSection, check_io
from hil.bench.modbus_config import check_modbus
from hil.bench.segment_config import SegmentSection, check_segment

WORD_TELEGRAMS: Final = (7, 9, 20, 110, 111)
"""Telegrams that no axis uses."""

EMBEDDED: Final = (
    "reference",
    "speed",
    "fast",
    "live",
    "profidrive",
    "profidrive_tcp",
    "profidrive_rtu",
    "analog",
    "stepper",
)
"""Benches that ship with the product, usable by name."""


def _start_value(value: object) -> object:
    """Return a start value as it is: a text is none, whatever it says."""
    if not isinstance(value, bool | int | float):
        raise ValueError("allowed: a number, true or false")  # noqa: TRY004 - it becomes a message about the file
    return value


StartValue = Annotated[bool | int | float, PlainValidator(_start_value)]


class BenchSection(Section):
    """`[bench]`: what is common to everything."""

    name: str = Field(min_length=1)
    kind: Literal["virtual", "live"] = "virtual"
    cycle_ms: Annotated[int, Field(ge=1, le=255)] = 4
    """Bus cycle, cycle of `MC_Servo` and SYNC period, ms."""
    interpolator_ms: Annotated[int, Field(ge=1, le=255)] | None = None
    """Cycle of `MC_Interpolator`, ms: a multiple of the bus cycle, at most 32 where it is another one; None =
    the same.
    """
    servo_priority: Annotated[int, Field(ge=17, le=26)] = 26
    """Priority of `MC_Servo` with the blocks of the user; above that of the interpolator."""
    interpolator_priority: Annotated[int, Field(ge=16, le=25)] = 24
    """Priority of `MC_Interpolator` with the block of the user."""
    servo_period_us: Annotated[int, Field(ge=50, le=5000)] = 250
    """Control cycle of the emulated drives, microseconds; a divisor of the bus cycle."""

    cpu: Literal["S7-1500", "S7-1500T", "S7-1200 G2"] = "S7-1500T"
    """Controller whose technology objects the axes are, with its instructions and their parameters
    (`motion.s7.compatibility`).
    """
    program_cycles: Annotated[int, Field(ge=1, le=1000)] = 1
    """Application cycles from one call of the user program, so of every instruction instance, to the next."""
    grace_cycles: Annotated[int, Field(ge=1, le=1000)] = 3
    """Cycles without actual values after which an axis reports its drive as lost (alarm 431)."""
    memory_card: str | None = None
    """Folder that is the controller's memory card, relative to the bench file; None = there is none."""

    @model_validator(mode="after")
    def _divides(self) -> BenchSection:
        if self.cycle_ms * 1000 % self.servo_period_us:
            raise ValueError("servo_period_us must divide the bus cycle")
        if self.interpolator_ms not in (None, self.cycle_ms):
            if self.interpolator_ms % self.cycle_ms:
                raise ValueError(f"interpolator_ms must be a multiple of cycle_ms = {self.cycle_ms}")
            if self.interpolator_ms > 32:
                raise ValueError("interpolator_ms must be 32 at most, where it is not cycle_ms")
        if self.servo_priority <= self.interpolator_priority:
            raise ValueError(
                f"servo_priority must be above interpolator_priority = {self.interpolator_priority}"
            )
        return self


class ToleranceSection(Section):
    """`[tolerance]`: how far a measurement on this bench may lie from the specification's number."""

    cycles: NotNegative = 2.0
    """Cycles on times; distances get the travel of that time."""
    time_s: NotNegative = 0.0
    """Seconds on top of times (scheduling noise of a live bench)."""
    distance_mm: NotNegative = 0.0
    """Millimetres on top of distances."""
    lateness_s: NotNegative | None = None
    """Lateness of a live bench up to which a failed case counts as failed, s; None = `time_s`."""


class AxisSection(Section):
    """`[axis.NAME]`: a technology object."""

    type: Literal["positioning", "speed", "synchronous"] = "positioning"
    drive: str
    inputs: str | None = None
    """Station to which the switches of the drive are wired that count for this axis; None = those at the
    drive.
    """
    inputs_update: Literal["servo", "program"] = "servo"
    """When limit switches are read: in every servo cycle (`PIP OB Servo`), or with the process image of the
    program.
    """
    homing_input: Literal["home", "negative_limit", "positive_limit"] = "home"
    """Switch that is reference cam or homing mark (`DigitalInputAddress`)."""
    encoders: tuple[str, ...] | None = Field(default=None, max_length=4)
    """Where `Sensor[1]`, `Sensor[2]`, ... come from: the name of the drive for its own encoder, or encoders;
    None: the drive.
    """
    connection: Literal["direct", "data_block"] = "direct"
    """`data_block`: a program of the test stands between telegram and axis."""
    enable_timeout_s: float | None = Field(default=None, gt=0.0, le=3600.0)
    """Longest time in which the drive has to come into operation, s; None = no limit."""
    ramp_times: dict[str, float] = {}
    """Ramps as times in s, in place of the accelerations that follow from them."""
    variables: dict[str, StartValue] = {}
    """Start values by their original path; checked against the variable table when the bench is built."""


class ExternalEncoderSection(Section):
    """`[external_encoder.NAME]`: a technology object that reads an encoder."""

    encoder: str
    drive: str | None = None
    """Drive of an axis, one of whose switches is wired to this object's digital input as well; None: it has
    none.
    """
    homing_input: Literal["home", "negative_limit", "positive_limit"] = "home"
    """That switch: reference cam or homing mark (`DigitalInputAddress`)."""
    variables: dict[str, StartValue] = {}
    """Start values by their original path; checked against the variable table when the bench is built."""


class BenchConfig(Section):
    """A whole bench file."""

    bench: BenchSection
    tolerance: ToleranceSection = ToleranceSection()
    segment: dict[str, SegmentSection] = Field(min_length=1)
    drive: dict[str, DriveSection] = {}
    encoder: dict[str, EncoderSection] = {}
    device: dict[str, DeviceSection] = {}
    station: dict[str, StationSection] = {}
    axis: dict[str, AxisSection] = {}
    external_encoder: dict[str, ExternalEncoderSection] = {}

    @property
    def emulated_names(self) -> tuple[str, ...]:
        """Drives, encoders and other devices that the bench brings."""
        devices: dict[str, DriveSection | EncoderSection | DeviceSection] = {
            **self.drive,
            **self.encoder,
            **self.device,
        }
        return tuple(name for name, section in devices.items() if section.device == "emulated")

    def counts_life(self, drive: DriveSection) -> bool:
        """Whether a PROFIdrive axis and its controller watch each other's sign of life.

        Over Modbus the counters keep step only in virtual time: on a live bench nothing keeps both sides to
        one clock.
        """
        if drive.profidrive.sign_of_life is not None:
            return drive.profidrive.sign_of_life
        live_modbus = self.bench.kind == "live" and self.segment[drive.segment].on_modbus
        return drive.telegram not in (1, *WORD_TELEGRAMS) and not live_modbus

    def leads(self, segment: str) -> bool:
        """Whether the bench is the controller on a segment: it moves an axis there, or nobody else can be
        there.
        """
        if any(self.drive[axis.drive].segment == segment for axis in self.axis.values()):
            return True
        return self.bench.kind == "virtual" and any(one.segment == segment for one in self.encoder.values())

    @model_validator(mode="after")
    def _references(self) -> BenchConfig:
        if not self.drive and not self.encoder and not self.device:
            raise ValueError(
                "there is neither a drive nor an encoder nor a device; a bench needs at least one"
            )
        taken: dict[str, str] = {}
        for kind, names in (
            ("segment", self.segment),
            ("drive", self.drive),
            ("axis", self.axis),
            ("external_encoder", self.external_encoder),
        ):
            for name in names:
                if "." in name or not name.strip():
                    raise ValueError(
                        f"{kind}.{name!r}: a name is not empty and has no dot; signals are NAME.COLUMN"
                    )
                if name in taken:
                    raise ValueError(
                        f"{kind}.{name}: a {taken[name]} has this name already; signals are told apart by it"
                    )
                taken[name] = kind
        nodes: dict[tuple[str, int], str] = {}
        for name, drive in self.drive.items():
            if drive.segment not in self.segment:
                raise ValueError(
                    f"drive.{name}.segment: {drive.segment!r} is not a segment; there are: "
                    f"{', '.join(self.segment)}"
                )
            key = (drive.segment, drive.node_id)
            if drive.node_id and key in nodes:
                raise ValueError(
                    f"drive.{name}.node_id: {drive.node_id} is already taken by drive.{nodes[key]}"
                )
            nodes[key] = name
            if drive.velocity_time_constant_ms * 1000.0 < 3 * self.bench.servo_period_us:
                raise ValueError(
                    f"drive.{name}.velocity_time_constant_ms: {drive.velocity_time_constant_ms:g} is less "
                    f"than three servo "
                    f"periods ({3 * self.bench.servo_period_us / 1000:g} ms)"
                )
            if drive.guard_time_ms and drive.heartbeat_ms:
                raise ValueError(
                    f"drive.{name}.guard_time_ms: {drive.guard_time_ms} needs heartbeat_ms = 0; a node has "
                    f"one of the two"
                )
        used: dict[str, str] = {}
        for name, axis in self.axis.items():
            if axis.drive not in self.drive:
                raise ValueError(
                    f"axis.{name}.drive: {axis.drive!r} is not a drive; there are: {', '.join(self.drive)}"
                )
            if axis.drive in used:
                raise ValueError(
                    f"axis.{name}.drive: {axis.drive!r} already belongs to axis.{used[axis.drive]}"
                )
            used[axis.drive] = name
            drive = self.drive[axis.drive]
            check_axis_encoders(name, axis, self)
            if drive.profile == "profidrive" and drive.telegram in WORD_TELEGRAMS:
                raise ValueError(
                    f"axis.{name}.drive: telegram {drive.telegram} of {axis.drive!r} has no setpoints for "
                    f"an axis"
                )
            with_dsc = drive.profile == "profidrive" and drive.telegram in (5, 6, 105, 106)
            if axis.variables.get("PositionControl.EnableDSC") and not with_dsc:
                raise ValueError(
                    f"axis.{name}.variables: PositionControl.EnableDSC needs a drive with XERR and KPC: "
                    'profile = "profidrive" with telegram 5, 6, 105 or 106'
                )
        for name, segment in self.segment.items():
            check_segment(name, segment, live=self.bench.kind == "live")
        check_io(self)
        check_modbus(self)
        if self.bench.kind == "virtual" and any(d.device == "physical" for d in self.drive.values()):
            raise ValueError('a virtual bench cannot hold a physical drive; set bench.kind = "live"')
        check_encoders(self)
        check_external_encoders(self)
        check_devices(self)
        return self


def _message(source: str, data: dict[str, Any], error: ValidationError) -> str:
    lines = []
    for problem in error.errors():
        path = ".".join(str(part) for part in problem["loc"])
        where = f"{source}: {path}" if path else source
        text = problem["msg"].removeprefix("Value error, ")
        context = problem.get("ctx", {})
        if problem["type"] == "extra_forbidden":
            allowed = ", ".join(_known_keys(problem["loc"]))
            lines.append(f"{where}: unknown key; allowed: {allowed}")
        elif problem["type"] == "missing":
            lines.append(f"{where}: the key is missing")
        elif "expected" in context:
            lines.append(f"{where}: {problem['input']!r} is not allowed; allowed: {context['expected']}")
        elif path:
            lines.append(f"{where}: {problem['input']!r} is not allowed; {text}")
        else:
            lines.append(f"{where}: {text}")
    del data
    return "\n".join(lines)


def _known_keys(location: tuple[int | str, ...]) -> list[str]:
    model: Any = BenchConfig
    for part in location[:-1]:
        field = model.model_fields.get(part) if hasattr(model, "model_fields") else None
        if field is None:
            continue
        annotation = field.annotation
        arguments: tuple[Any, ...] = getattr(annotation, "__args__", ())
        model = arguments[1] if getattr(annotation, "__origin__", None) is dict else annotation
        if arguments and model is annotation:  # a table that may be absent
            model = next(one for one in arguments if one is not type(None))
    return list(getattr(model, "model_fields", {}))


class BenchFileError(ConfigurationError):
    """The bench file cannot be used; the message lists every problem with file, key, value and what is
    allowed.
    """

    def __init__(self, source: str, message: str) -> None:
        super(ConfigurationError, self).__init__(message)
        self.where = source
        self.value = None
        self.allowed = ""


def parse(text: str, source: str) -> BenchConfig:
    """Return the validated content of a bench file.

    Args:
        text: The file's content.
        source: Its name, for messages.

    Raises:
        BenchFileError: It is no TOML, or a value is wrong.

    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BenchFileError(source, f"{source}: this is not valid TOML: {error}") from None
    folder = Path(source).parent if source not in EMBEDDED else None
    anchor_files(data, Path(source).parent)
    try:
        return BenchConfig.model_validate(data, context={"folder": folder})
    except ValidationError as error:
        raise BenchFileError(source, _message(source, data, error)) from None


def read(path: str | Path | None) -> tuple[str, str]:
    """Return (source name, text) of a bench file, an embedded bench by name, or the reference bench for None.

    Raises:
        BenchFileError: There is no such file or embedded bench.

    """
    name = "reference" if path is None or path == "" else str(path)
    if name in EMBEDDED:
        return name, (files("hil.bench") / "data" / f"{name}.toml").read_text(encoding="utf-8")
    file = Path(name)
    try:
        return name, file.read_text(encoding="utf-8")
    except OSError as error:
        raise BenchFileError(
            name, f"{name}: cannot be read ({error.strerror}); embedded benches are: {', '.join(EMBEDDED)}"
        ) from None
    except UnicodeDecodeError:
        raise BenchFileError(name, f"{name}: this is not UTF-8 text") from None


def digest(text: str, config: BenchConfig | None = None) -> str:
    """Return the SHA-256 of a bench file's text, hexadecimal; of the EDS files that it names, too."""
    total = hashlib.sha256(text.encode())
    for path in [] if config is None else eds_files(config):
        total.update(path.read_bytes())
    return total.hexdigest()
