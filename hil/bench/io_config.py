"""Tables of the bench file for I/O stations, analog drives and pulse modules, and their checks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field

from fieldbus.errors import ConfigurationError
from hil.bench._drive_sections import Finite, NotNegative, Positive, Section, Time_ms

if TYPE_CHECKING:
    from hil.bench.config import BenchConfig
    from hil.bench.drive_config import DriveSection

SWITCHES: Final = ("negative_limit", "positive_limit", "home", "probe1", "probe2")
"""Terminals of every drive that a digital input can be wired to."""
LIMITS: Final = ("negative_limit", "positive_limit", "home")
"""Those that are switches of an axis."""
_TERMINALS: Final = {
    "digital_inputs": (*SWITCHES, "ready"),
    "digital_outputs": ("enable",),
    "analog_outputs": ("setpoint",),
    "counters": ("encoder",),
}
"""What can be wired to a channel of a kind; `ready`, `enable` and `setpoint` are those of an analog drive."""
_ANALOG_ONLY: Final = ("ready", "enable", "setpoint")
_WITHOUT_ANALOG: Final = (
    "telegram",
    "node_id",
    "unit",
    "map",
    "host",
    "port",
    "processing_ms",
    "personality",
    "sync_loss",
    "sync_jitter_percent",
    "missing_setpoints",
    "following_error",
    "csv_interpolation",
    "power_on_delay_ms",
    "boot_time_ms",
    "blocked_time_ms",
    "eds",
    "storage",
    "heartbeat_ms",
    "consumer_heartbeat_ms",
    "guard_time_ms",
    "life_time_factor",
    "vendor_id",
    "product_code",
    "revision",
    "serial",
    "store_parameters",
    "homing",
    "supply",
    "thermal",
    "safety",
    "profidrive",
    "tm_pto",
    "off1_ramp_s",
    "encoder2",
    "positioner",
)
_WITHOUT_PTO: Final = (
    "telegram",
    "unit",
    "map",
    "host",
    "port",
    "processing_ms",
    "personality",
    "encoder",
    "index_increments",
    "velocity_time_constant_ms",
    "torque_precontrol",
    "sync_loss",
    "sync_jitter_percent",
    "missing_setpoints",
    "following_error",
    "csv_interpolation",
    "power_on_delay_ms",
    "blocked_time_ms",
    "eds",
    "storage",
    "store_parameters",
    "homing",
    "brake",
    "supply",
    "thermal",
    "safety",
    "profidrive",
    "analog",
    "encoder2",
    "positioner",
)

_WITHOUT_TM41: Final = (
    *_WITHOUT_PTO, "off1_ramp_s", "off3_ramp_s", "rated_torque_nm", "mechanics", "switches", "tm_pto",
)  # fmt: skip
_AT_TM41: Final = {
    "FollowingError.EnableMonitoring": (False, True),
    "PositionLimits_HW.Active": (False, False),
    "Sensor[1].Backlash.Enable": (False, False),
    "PositionControl.Kpc": (100.0, 100.0),
    "DynamicAxisModel.VelocityTimeConstant": (0.0, 0.0),
}
"""Variables of an axis at an encoder-signal output: what they have to be, and what they are by default
(CFG-413, CFG-414).
"""


class StationSection(Section):
    """`[station.NAME]`: an emulated I/O station on a Modbus segment."""

    segment: str
    unit: Annotated[int, Field(ge=1, le=247)] = 1
    digital_inputs: list[str] = []
    """What is wired to each channel, `DRIVE.TERMINAL`, or nothing."""
    digital_outputs: list[str] = []
    analog_inputs: Annotated[int, Field(ge=0, le=16)] = 0
    """Number of analog inputs, +-10 V; tests bring them their values."""
    analog_outputs: list[str] = []
    counters: list[str] = []
    input_filter_ms: Annotated[float, Field(ge=0.0, le=1000.0)] = 3.0
    watchdog_ms: Annotated[float, Field(ge=0.0, le=60_000.0)] = 100.0
    """Time without a request that writes after which outputs are off; 0 = never."""
    processing_ms: Annotated[float, Field(ge=0.0, le=1000.0)] = 0.2
    """From a request to its response."""

    @property
    def device(self) -> Literal["emulated"]:
        """What a drive's section says with this key."""
        return "emulated"

    def wire(self, kind: str, terminal: str) -> int | None:
        """Return the number of the channel that a terminal is wired to; None: to none."""
        wires: list[str] = getattr(self, kind)
        return wires.index(terminal) if terminal in wires else None


class AnalogSection(Section):
    """`[drive.NAME.analog]`: what a drive with an analog setpoint has."""

    reference_speed_rpm: Annotated[float, Field(ge=1.0, le=200_000.0)] = 3000.0
    """Speed at 10 V."""
    enable_input: bool = True
    ready_delay_ms: Time_ms = 0.0
    stop: Literal["ramp", "coast"] = "ramp"
    """What the drive does without enable; the ramp is `off3_ramp_s`."""
    ready_falls: Literal["enable", "standstill", "never"] = "enable"
    offset_v: Finite = 0.0
    dead_zone_v: NotNegative = 0.0
    inverted: bool = False


class PtoSection(Section):
    """`[drive.NAME.tm_pto]`: pulse module and stepper motor."""

    variant: Literal["device", "standard"] = "device"
    """Telegram 3 with a 16-bit setpoint as the device has it, or the standard one with 32 bits."""
    signals: Literal["pulse_direction", "up_down", "ab", "ab_fourfold"] = "pulse_direction"
    reversal_pause_ms: Literal[0, 1, 4, 10] = 0
    reference_speed_rpm: Annotated[float, Field(ge=1.0, le=20_000.0)] = 3000.0
    use_ed: bool = True
    """Terminal ED enables the power stage."""
    use_dr: bool = True
    """Terminal DR: the power stage is ready."""
    use_rs: bool = False
    """Terminal RS is wired to the home switch."""
    use_mi: bool = False
    """Terminal MI is wired to probe1."""
    input_delay_ms: NotNegative = 0.1
    """One of the delays that the module has; 0.004 = none."""
    strict_parking: bool = False
    watchdog_cycles: Annotated[int, Field(ge=1, le=1000)] = 3
    full_steps: Annotated[int, Field(ge=4, le=10_000)] = 200
    corner_hz: Positive = 2000.0
    start_stop_hz: Positive = 500.0
    ready_delay_ms: Time_ms = 0.0


def check_io(config: BenchConfig) -> None:
    """Check stations, their wires, analog drives and pulse modules.

    Raises:
        ValueError: With the place, the value and what is allowed.

    """
    places: dict[tuple[str, int], str] = {}
    wired: dict[str, str] = {}
    for name, station in config.station.items():
        where = f"station.{name}"
        _check_name(config, name)
        if config.bench.kind == "live":
            raise ValueError(f'{where}: stations are emulated on virtual benches; set bench.kind = "virtual"')
        segment = config.segment.get(station.segment)
        if segment is None or not segment.on_modbus:
            names = [key for key, one in config.segment.items() if one.on_modbus]
            raise ValueError(
                f"{where}.segment: {station.segment!r} is not a segment on Modbus; there are: "
                f"{', '.join(names) or 'none'}"
            )
        if segment.kind == "modbus_rtu":
            owner = places.setdefault((station.segment, station.unit), where)
            if owner != where:
                raise ValueError(f"{where}.unit: {station.unit} is already taken by {owner}")
            for key, drive in config.drive.items():
                if (
                    drive.segment == station.segment
                    and drive.profile == "profidrive"
                    and drive.unit == station.unit
                ):
                    raise ValueError(f"{where}.unit: {station.unit} is already taken by drive.{key}")
        _check_wires(config, where, station, wired)
    for name, drive in config.drive.items():
        if drive.profile == "analog":
            _check_analog(config, name, drive)
    _check_axes(config)


def _check_name(config: BenchConfig, name: str) -> None:
    if "." in name or not name.strip():
        raise ValueError(f"station.{name!r}: a name is not empty and has no dot; signals are NAME.COLUMN")
    for kind in ("segment", "drive", "encoder", "device", "axis"):
        if name in getattr(config, kind):
            raise ValueError(f"station.{name}: a {kind} has this name already; signals are told apart by it")


def _check_wires(config: BenchConfig, where: str, station: StationSection, wired: dict[str, str]) -> None:
    for kind, terminals in _TERMINALS.items():
        for number, wire in enumerate(getattr(station, kind)):
            if not wire:
                continue
            place = f"{where}.{kind}[{number}]"
            name, _, terminal = wire.partition(".")
            drive = config.drive.get(name)
            if drive is None:
                raise ValueError(f"{place}: {name!r} is not a drive; there are: {', '.join(config.drive)}")
            allowed = [one for one in terminals if drive.profile == "analog" or one not in _ANALOG_ONLY]
            if drive.profile == "tm_pto" and "encoder" in allowed:
                allowed.remove("encoder")
            if drive.profile == "tm41":
                allowed = [one for one in allowed if one == "encoder"]
            if terminal not in allowed:
                text = ", ".join(f"{name}.{one}" for one in allowed) or "nothing of this drive"
                raise ValueError(f"{place}: {wire!r} is no terminal for it; allowed: {text}")
            owner = wired.setdefault(wire, place)
            if owner != place:
                raise ValueError(f"{place}: {wire!r} is wired to {owner} already")


def station_of(config: BenchConfig, drive: str) -> str | None:
    """Return the name of the station that the setpoint of an analog drive comes from; None: there is none."""
    for name, station in config.station.items():
        if f"{drive}.setpoint" in station.analog_outputs:
            return name
    return None


def _check_analog(config: BenchConfig, name: str, drive: DriveSection) -> None:
    where = f"drive.{name}"
    if config.bench.kind == "live":
        raise ValueError(
            f'{where}.profile: "analog" is emulated on virtual benches; set bench.kind = "virtual"'
        )
    station = station_of(config, name)
    if station is None:
        raise ValueError(
            f'{where}: its setpoint is wired to no station; one needs analog_outputs = ["{name}.setpoint"]'
        )
    section = config.station[station]
    if drive.segment != section.segment:
        raise ValueError(
            f"{where}.segment: {drive.segment!r} is not the segment of station.{station}; allowed: "
            f"{section.segment}"
        )
    for kind in ("digital_inputs", "digital_outputs", "counters"):
        for key, other in config.station.items():
            if key != station and any(wire.startswith(f"{name}.") for wire in getattr(other, kind)):
                raise ValueError(
                    f"station.{key}.{kind}: {name!r} is wired to station.{station}; all its wires go there"
                )


def _check_axes(config: BenchConfig) -> None:
    for name, axis in config.axis.items():
        drive = config.drive[axis.drive]
        where = f"axis.{name}"
        if axis.inputs is not None:
            station = config.station.get(axis.inputs)
            if station is None:
                raise ValueError(
                    f"{where}.inputs: {axis.inputs!r} is not a station; there are: "
                    f"{', '.join(config.station) or 'none'}"
                )
            if not any(f"{axis.drive}.{one}" in station.digital_inputs for one in LIMITS):
                raise ValueError(
                    f"{where}.inputs: no switch of {axis.drive!r} is wired to station.{axis.inputs}; "
                    f"allowed: {', '.join(f'{axis.drive}.{one}' for one in LIMITS)}"
                )
        if drive.profile == "tm41":
            for path, (needed, usual) in _AT_TM41.items():
                if axis.variables.get(path, usual) != needed:
                    raise ValueError(
                        f"{where}.variables: {path} has to be {str(needed).lower()} at an encoder-signal "
                        f"output "
                        f"({axis.drive!r}, CFG-413, CFG-414)"
                    )
        if drive.profile == "analog" and axis.type != "speed":
            station = config.station[station_of(config, axis.drive) or ""]
            if f"{axis.drive}.encoder" not in station.counters:
                raise ValueError(
                    f"{where}.drive: a positioning axis needs the encoder of {axis.drive!r} at its station: "
                    f'counters = ["{axis.drive}.encoder"]'
                )


def check_drive_keys(drive: DriveSection) -> None:
    """Check the keys of a drive by its profile.

    Raises:
        ValueError: A key is not one of this profile.

    """
    for profile, absent in (("analog", _WITHOUT_ANALOG), ("tm_pto", _WITHOUT_PTO), ("tm41", _WITHOUT_TM41)):
        if drive.profile == profile:
            for key in absent:
                if drive.differs(key):
                    raise ValueError(f'{key}: a drive with profile = "{profile}" has none')
        elif profile != "tm41" and drive.differs(profile):
            raise ValueError(
                f'{profile}: a drive with profile = "{drive.profile}" has none; set profile = "{profile}"'
            )
    if drive.profile == "analog" and drive.encoder == "absolute":
        raise ValueError("encoder: the encoder of an analog drive goes to a counter; allowed: incremental")
    if drive.profile in ("tm_pto", "tm41"):
        if drive.mechanics.backlash_mm:
            raise ValueError(
                f"mechanics.backlash_mm: {drive.mechanics.backlash_mm:g} is not allowed; allowed: 0, a "
                f"stepper motor moves its load without play"
            )
        from hil.bench.io_devices import stepper_config

        try:
            stepper_config(drive, servo_period_us=250)
        except ConfigurationError as error:
            raise ValueError(str(error)) from None
