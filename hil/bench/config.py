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
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from fieldbus.errors import ConfigurationError
from hil.bench._drive_sections import (
    CIA402_KEYS,
    BrakeSection,
    ProfidriveSection,
    SafetySection,
    SupplySection,
    ThermalSection,
    Time_ms,
    checked_personality,
)
from hil.bench.device_config import DeviceSection, anchor_files, check_devices, eds_files
from hil.bench.encoder_config import EncoderSection, check_encoders

EMBEDDED: Final = ("reference", "speed", "fast", "live", "profidrive")
"""Benches that ship with the product, usable by name."""


RESERVED_OPTIONS: Final = (
    "interface",
    "channel",
    "name",
    "scheduler",
    "history",
    "keep_log",
    "lossy",
    "bridge",
)
"""What `LiveSegment.open` takes by itself, and is no option of an interface."""


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Word = Annotated[int, Field(ge=0, le=0xFFFFFFFF)]
RampTime = Annotated[float, Field(ge=0.001, le=1000.0)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class BenchSection(_Model):
    """`[bench]`: what is common to everything."""

    name: str = Field(min_length=1)
    kind: Literal["virtual", "live"] = "virtual"
    cycle_ms: Annotated[int, Field(ge=1, le=255)] = 4
    """Bus cycle, application cycle and SYNC period, ms."""
    servo_period_us: Annotated[int, Field(ge=50, le=5000)] = 250
    """Control cycle of the emulated drives, microseconds; a divisor of the bus cycle."""

    grace_cycles: Annotated[int, Field(ge=1, le=1000)] = 3
    """Cycles without actual values after which an axis reports its drive as lost (alarm 431)."""

    @model_validator(mode="after")
    def _divides(self) -> BenchSection:
        if self.cycle_ms * 1000 % self.servo_period_us:
            raise ValueError("servo_period_us must divide the bus cycle")
        return self


class ToleranceSection(_Model):
    """`[tolerance]`: how far a measurement on this bench may lie from the specification's number."""

    cycles: NotNegative = 2.0
    """Cycles on times; distances get the travel of that time."""
    time_s: NotNegative = 0.0
    """Seconds on top of times (scheduling noise of a live bench)."""
    distance_mm: NotNegative = 0.0
    """Millimetres on top of distances."""
    lateness_s: NotNegative | None = None
    """Lateness of a live bench up to which a failed case counts as failed, s; None = `time_s`."""


Option = bool | int | float | str
"""Value of an option that python-can hands to its interface."""


class BridgeSection(_Model):
    """`[segment.NAME.bridge]`: the other side of a live segment that is made of two buses."""

    channel: str
    interface: str | None = None
    """None: that of the segment."""
    options: dict[str, Option] = {}
    gateway: Literal["bench", "kernel"] = "bench"
    """Who passes frames on: the process of the bench, or the kernel (SocketCAN only)."""


class SegmentSection(_Model):
    """`[segment.NAME]`: a CAN segment."""

    bitrate: Literal[10_000, 20_000, 50_000, 125_000, 250_000, 500_000, 800_000, 1_000_000] = 1_000_000
    interface: str | None = None
    """python-can interface of a live bench, for example `socketcan`; None on a virtual bench."""
    channel: str | None = None
    options: dict[str, Option] = {}
    """Further options of the python-can interface."""
    bridge: BridgeSection | None = None
    """The bus with the drives, when the controller is on `channel` and this bench stands between the two."""

    def opening(self) -> dict[str, Any]:
        """Return the arguments that open a live segment."""
        result: dict[str, Any] = {
            "interface": self.interface or "",
            "channel": self.channel or "",
            **self.options,
        }
        if self.bridge is not None:
            own = {} if self.bridge.interface is None else {"interface": self.bridge.interface}
            result["bridge"] = {"channel": self.bridge.channel, **own, **self.bridge.options}
            if self.bridge.gateway == "kernel":
                result["bridge"]["gateway"] = "kernel"
        return result

    def opening_for_drives(self) -> dict[str, Any]:
        """Return the arguments that open the bus on which the drives are: the far side of a bridge."""
        result = self.opening()
        far = result.pop("bridge", None)
        if far is not None:
            far.pop("gateway", None)
        return result if far is None else {"interface": self.interface or "", **far}


class SwitchSection(_Model):
    """`[drive.NAME.switches]`: switches on the travel, mm at the load."""

    negative_limit_mm: Finite | None = -550.0
    positive_limit_mm: Finite | None = 550.0
    home_mm: Finite | None = -500.0
    """The home switch is active below this position; not together with the two following keys."""
    home_from_mm: Finite | None = None
    """The home switch is active from here to `home_to_mm`; without the other key up to the end of the travel."""
    home_to_mm: Finite | None = None
    probe1_from_mm: Finite | None = None
    """The load actuates touch probe 1 from here to `probe1_to_mm`; without the other key up to the end of the travel."""
    probe1_to_mm: Finite | None = None
    probe2_from_mm: Finite | None = None
    probe2_to_mm: Finite | None = None
    hysteresis_mm: NotNegative = 0.5
    input_filter_ms: NotNegative = 0.0
    """A limit or home switch counts when it has been stable for this long, ms."""

    @model_validator(mode="after")
    def _ranges(self) -> SwitchSection:
        for name in ("home", "probe1", "probe2"):
            low, high = getattr(self, f"{name}_from_mm"), getattr(self, f"{name}_to_mm")
            if low is not None and high is not None and not low < high:
                raise ValueError(f"{name}_from_mm: {low:g} is not below {name}_to_mm: {high:g}")
        if "home_mm" in self.model_fields_set and (
            self.home_from_mm is not None or self.home_to_mm is not None
        ):
            raise ValueError("home_mm goes without home_from_mm and home_to_mm")
        return self


class HomingSection(_Model):
    """`[drive.NAME.homing]`: what manufacturers of drives do differently."""

    offset: Literal["profile", "vendor"] = "profile"
    """6064h at the home position is -607Ch (`profile`) or +607Ch (`vendor`)."""
    move: Literal["none", "zero"] = "none"
    """Whether the drive moves to position zero when it has found home."""
    hard_stop_methods: dict[
        str, Literal["positive", "negative", "positive_index", "negative_index", "unsupported"]
    ] = {}
    """What methods -1 to -4 do where they differ: side of the stop, and whether the index on the way back counts."""

    @model_validator(mode="after")
    def _numbers(self) -> HomingSection:
        for number in self.hard_stop_methods:
            if number not in {"-1", "-2", "-3", "-4"}:
                raise ValueError(f"hard_stop_methods: {number!r} is not a method; allowed: -1, -2, -3, -4")
        return self


class MechanicsSection(_Model):
    """`[drive.NAME.mechanics]`: what the emulated drive moves."""

    lead_screw_mm: Positive = 10.0
    """Travel per revolution of the screw, mm."""
    gear_numerator: Annotated[int, Field(ge=1)] = 1
    """Motor revolutions of the load gear."""
    gear_denominator: Annotated[int, Field(ge=1)] = 1
    """Load revolutions of the load gear."""
    load_mass_kg: NotNegative = 40.0
    motor_inertia_kgm2: Positive = 2.0e-4
    screw_inertia_kgm2: NotNegative = 0.5e-4
    viscous_friction_n_per_m_s: NotNegative = 30.0
    coulomb_friction_n: NotNegative = 30.0
    static_friction_n: NotNegative | None = None
    """Breakaway force at standstill; None = as the sliding friction."""
    gravity_n: Finite = 0.0
    """Constant force on the load in positive direction, N; a hanging load has a negative one."""
    negative_stop_mm: Finite | None = -600.0
    positive_stop_mm: Finite | None = 600.0
    start_position_mm: Finite = 0.0

    @model_validator(mode="after")
    def _friction(self) -> MechanicsSection:
        if self.static_friction_n is not None and self.static_friction_n < self.coulomb_friction_n:
            raise ValueError(
                f"static_friction_n: {self.static_friction_n:g} is less than coulomb_friction_n = {self.coulomb_friction_n:g}"
            )
        return self


class DriveSection(_Model):
    """`[drive.NAME]`: a drive."""

    profile: Literal["cia402", "profidrive"] = "cia402"
    telegram: Literal[1, 2, 3, 4, 5, 6, 102, 103, 105, 106] = 3
    """Telegram of a PROFIdrive axis."""
    device: Literal["emulated", "physical"] = "emulated"
    """`emulated`: this bench brings it; `physical`: it is on the bus (or brought by somebody else)."""
    segment: str
    node_id: Annotated[int, Field(ge=1, le=126)]
    personality: str = "standard"
    """How the emulated drive differs from the profile: a name of `hil personalities`, or a file `*.toml` beside the bench file."""
    encoder: Literal["incremental", "absolute"] = "incremental"
    increments_per_revolution: Annotated[int, Field(ge=4, le=2**24)] = 131072
    index_increments: Annotated[int, Field(ge=0)] = 0
    """Place of the index (zero mark) within the revolution, increments."""
    max_speed_rpm: Annotated[float, Field(ge=1.0, le=200_000.0)] = 3000.0
    off1_ramp_s: RampTime = 1.0
    """Ramp-down time from maximum speed on OFF1 (p1121), s."""
    off3_ramp_s: RampTime = 0.5
    """Ramp-down time from maximum speed on OFF3 (p1135), s."""
    rated_torque_nm: Annotated[float, Field(ge=0.001, le=1_000_000.0)] = 2.0
    velocity_time_constant_ms: Annotated[float, Field(gt=0.0, le=1000.0)] = 2.0
    """Time constant of the emulated drive's closed speed loop, ms; at least three servo periods."""
    sync_loss: Literal["fault", "warning", "none"] = "fault"
    """What the emulated drive does when SYNC stays away."""
    sync_jitter_percent: Annotated[float, Field(ge=0.0, le=50.0)] = 0.0
    """Deviation of SYNC from the bus cycle from which on the emulated drive does the same; 0 = not watched."""
    missing_setpoints: Annotated[int, Field(ge=0, le=1000)] = 2
    """Cycles without a setpoint after which the emulated drive reacts as to a lost connection (6007h); 0 = never."""
    following_error: Literal["fault", "status"] = "fault"
    """What the emulated drive does when the window of 6065h is exceeded in its own position modes."""
    csv_interpolation: bool = True
    """Whether the emulated drive reaches a csv set-point linearly within the cycle, or at once."""
    power_on_delay_ms: Time_ms = 0.0
    """Time of transition 3 in the emulated drive, ms."""
    boot_time_ms: Time_ms = 0.0
    """From power-on of the emulated drive to its boot-up frame, ms."""
    blocked_time_ms: Annotated[float, Field(ge=0.0, le=60_000.0)] = 0.0
    """Torque limit at standstill for this long is fault 7121h of the emulated drive, ms; 0 = not watched."""
    eds: str | None = None
    """EDS or DCF file of the emulated drive, relative to the bench file; None = that of the product."""
    storage: str | None = None
    """File of the emulated drive's stored parameters, relative to the bench file; None = no file."""
    heartbeat_ms: Annotated[int, Field(ge=0, le=60000)] = 100
    consumer_heartbeat_ms: Annotated[int, Field(ge=1, le=65535)] = 250
    guard_time_ms: Annotated[int, Field(ge=0, le=65535)] = 0
    """Period of node guarding, ms, for a drive without heartbeat; 0 = none."""
    life_time_factor: Annotated[int, Field(ge=1, le=255)] = 3
    vendor_id: Word | None = None
    """Expected identity (1018h:1 to 4); None = any."""
    product_code: Word | None = None
    revision: Word | None = None
    serial: Word | None = None
    optional: bool = False
    """The bench is ready without this drive."""
    store_parameters: bool | None = None
    """Whether the controller has the drive keep its parameters (1010h); None: an emulated one, no physical one."""
    mechanics: MechanicsSection = MechanicsSection()
    switches: SwitchSection = SwitchSection()
    homing: HomingSection = HomingSection()
    brake: BrakeSection = BrakeSection()
    supply: SupplySection = SupplySection()
    thermal: ThermalSection = ThermalSection()
    safety: SafetySection = SafetySection()
    profidrive: ProfidriveSection = ProfidriveSection()

    @field_validator("personality")
    @classmethod
    def _personality(cls, value: str, info: ValidationInfo) -> str:
        if value == "standard":
            return value
        return checked_personality(value, (info.context or {}).get("folder"))

    def _differs(self, key: str) -> bool:
        """Say whether a key has another value than its default: a file that names all keys is no mistake."""
        return bool(getattr(self, key) != type(self).model_fields[key].default)

    @model_validator(mode="after")
    def _profile(self) -> DriveSection:
        if self.profile == "cia402":
            for key in ("telegram", "profidrive"):
                if self._differs(key):
                    raise ValueError(
                        f'{key}: a drive with profile = "cia402" has none; set profile = "profidrive"'
                    )
            return self
        for key in CIA402_KEYS:
            if self._differs(key):
                raise ValueError(f'{key}: a drive with profile = "profidrive" has none')
        if self.safety.interlock != "none":
            raise ValueError(
                "safety.interlock: an interlock is not fitted to a PROFIdrive axis; allowed: none"
            )
        bits = self.profidrive.fine_resolution_bits
        if self.increments_per_revolution << bits > 1 << 31:
            raise ValueError(
                f"increments_per_revolution: {self.increments_per_revolution} with {bits} bits of fine resolution exceed the "
                f"32 bits of G1_XIST1; at most {(1 << 31) >> bits}"
            )
        if self.encoder == "absolute" and self.increments_per_revolution > 1 << 20:
            raise ValueError(
                f"increments_per_revolution: {self.increments_per_revolution} times 4096 revolutions exceed the 32 bits of "
                f"G1_XIST2; at most {1 << 20}"
            )
        if self.telegram in (4, 6, 103, 106) and self.node_id > 0x5F:
            raise ValueError(f"node_id: {self.node_id} with telegram {self.telegram}; at most 95")
        return self

    @model_validator(mode="after")
    def _slopes(self) -> DriveSection:
        if self.profile != "cia402":
            return self
        for key in ("off1_ramp_s", "off3_ramp_s"):
            fastest = self.max_speed_rpm * 1000.0 / 0xFFFFFFFF
            if getattr(self, key) < fastest:
                raise ValueError(
                    f"{key}: {getattr(self, key):g} s from {self.max_speed_rpm:g} rpm is steeper than 6084h and 6085h can "
                    f"say (10^-3 rpm/s, 32 bits); at least {fastest:.3g} s"
                )
        return self

    @model_validator(mode="after")
    def _index(self) -> DriveSection:
        if self.index_increments >= self.increments_per_revolution:
            raise ValueError(
                f"index_increments: {self.index_increments} is not below increments_per_revolution = "
                f"{self.increments_per_revolution}"
            )
        return self


class AxisSection(_Model):
    """`[axis.NAME]`: a technology object."""

    type: Literal["positioning", "speed"] = "positioning"
    drive: str
    variables: dict[str, bool | int | float] = {}
    """Start values by their original path; checked against the variable table when the bench is built."""


class BenchConfig(_Model):
    """A whole bench file."""

    bench: BenchSection
    tolerance: ToleranceSection = ToleranceSection()
    segment: dict[str, SegmentSection] = Field(min_length=1)
    drive: dict[str, DriveSection] = {}
    encoder: dict[str, EncoderSection] = {}
    device: dict[str, DeviceSection] = {}
    axis: dict[str, AxisSection] = {}

    @property
    def emulated_names(self) -> tuple[str, ...]:
        """Drives, encoders and other devices that the bench brings."""
        devices: dict[str, DriveSection | EncoderSection | DeviceSection] = {
            **self.drive,
            **self.encoder,
            **self.device,
        }
        return tuple(name for name, section in devices.items() if section.device == "emulated")

    def leads(self, segment: str) -> bool:
        """Whether the bench is the controller on a segment: it moves an axis there, or nobody else can be there."""
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
        for kind, names in (("segment", self.segment), ("drive", self.drive), ("axis", self.axis)):
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
                    f"drive.{name}.segment: {drive.segment!r} is not a segment; there are: {', '.join(self.segment)}"
                )
            key = (drive.segment, drive.node_id)
            if key in nodes:
                raise ValueError(
                    f"drive.{name}.node_id: {drive.node_id} is already taken by drive.{nodes[key]}"
                )
            nodes[key] = name
            if drive.velocity_time_constant_ms * 1000.0 < 3 * self.bench.servo_period_us:
                raise ValueError(
                    f"drive.{name}.velocity_time_constant_ms: {drive.velocity_time_constant_ms:g} is less than three servo "
                    f"periods ({3 * self.bench.servo_period_us / 1000:g} ms)"
                )
            if drive.guard_time_ms and drive.heartbeat_ms:
                raise ValueError(
                    f"drive.{name}.guard_time_ms: {drive.guard_time_ms} needs heartbeat_ms = 0; a node has one of the two"
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
            with_dsc = drive.profile == "profidrive" and drive.telegram in (5, 6, 105, 106)
            if axis.variables.get("PositionControl.EnableDSC") and not with_dsc:
                raise ValueError(
                    f"axis.{name}.variables: PositionControl.EnableDSC needs a drive with XERR and KPC: "
                    'profile = "profidrive" with telegram 5, 6, 105 or 106'
                )
            if axis.type == "positioning" and drive.profile == "profidrive" and drive.telegram in (1, 2):
                raise ValueError(
                    f"axis.{name}.drive: telegram {drive.telegram} of {axis.drive!r} has no encoder value for a positioning "
                    "axis; allowed: 3, 4, 5, 6, 102, 103, 105, 106"
                )
        for name, segment in self.segment.items():
            if self.bench.kind == "live" and (segment.interface is None or segment.channel is None):
                raise ValueError(f"segment.{name}: a live bench needs `interface` and `channel`")
            if self.bench.kind == "virtual" and segment.interface is not None:
                raise ValueError(
                    f'segment.{name}.interface: a virtual bench has no interface; set bench.kind = "live"'
                )
            if self.bench.kind == "virtual" and (segment.options or segment.bridge is not None):
                raise ValueError(
                    f'segment.{name}: options and bridge belong to a live bench; set bench.kind = "live"'
                )
            _check_options(name, segment)
        if self.bench.kind == "virtual" and any(d.device == "physical" for d in self.drive.values()):
            raise ValueError('a virtual bench cannot hold a physical drive; set bench.kind = "live"')
        check_encoders(self)
        check_devices(self)
        return self


def _check_options(name: str, segment: SegmentSection) -> None:
    """Refuse options that are keys of their own, and a bridge that leads to where it comes from."""
    far = segment.bridge
    for where, options in (("", segment.options), (".bridge", far.options if far is not None else {})):
        for key in options:
            if key in RESERVED_OPTIONS:
                raise ValueError(f"segment.{name}{where}.options.{key}: this is no option of an interface")
    if far is not None and (far.channel, far.interface or segment.interface, far.options) == (
        segment.channel,
        segment.interface,
        segment.options,
    ):
        raise ValueError(f"segment.{name}.bridge: both sides are {segment.interface} {segment.channel}")
    if far is not None and far.gateway == "kernel":
        kinds = {segment.interface, far.interface or segment.interface}
        if kinds != {"socketcan"}:
            raise ValueError(
                f"segment.{name}.bridge.gateway: the kernel joins interfaces of SocketCAN only, not {', '.join(map(str, kinds))}"
            )


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
    """The bench file cannot be used; the message lists every problem with file, key, value and what is allowed."""

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
