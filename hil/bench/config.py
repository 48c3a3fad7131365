"""A whole bench file: its tables, what they say of each other, and its messages.

A bench file is TOML. Every mistake is reported with the file, the key, the value and what is allowed.
"""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from pydantic import Field, ValidationError, model_validator

from fieldbus.errors import ConfigurationError
from hil.bench._messages import messages
from hil.bench._table import Table
from hil.bench.axis_config import AxisTable, ExternalEncoderTable, second_of
from hil.bench.bench_config import BenchTable, ToleranceTable
from hil.bench.device_config import DeviceTable
from hil.bench.drive_config import (
    WITH_G2,
    WITH_SWITCHES,
    AnalogDriveTable,
    AnyDrive,
    CanDriveTable,
    Cia402DriveTable,
    DriveTable,
    ProfidriveCanTable,
    ProfidriveModbusTable,
)
from hil.bench.drive_tables import second_encoder_variables
from hil.bench.encoder_config import AnyEncoder, EncoderTable
from hil.bench.io_config import LIMITS, StationTable
from hil.bench.segment_config import AnySegment, RtuTable, TcpTable
from motion.s7.axis.configuration import encoders_of_telegram
from motion.s7.compatibility import LEVELS

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

SWITCH_LEVELS: Final = ("PositionLimits_HW.MinSwitchLevel", "PositionLimits_HW.MaxSwitchLevel")
"""Variables with the level of an actuated limit switch."""
_MOST_STEPS: Final = 1 << 23
"""Greatest `StepsPerRevolution` of an encoder of an axis."""
_ANCHORED: Final = {"drive": ("eds", "storage", "map"), "device": ("eds", "storage")}
"""Keys of tables by name that may be files relative to the bench file."""


class BenchConfig(Table, frozen=True):
    """A whole bench file."""

    bench: BenchTable
    """What is common to the whole bench."""
    tolerance: ToleranceTable = ToleranceTable()
    """How far a measurement on this bench may lie from the number of the specification."""
    segment: dict[str, AnySegment] = Field(min_length=1)
    """Segments by name: CAN, Modbus TCP, Modbus RTU."""
    drive: dict[str, AnyDrive] = {}
    """Drives by name."""
    encoder: dict[str, AnyEncoder] = {}
    """Encoders that are CANopen devices of their own, by name."""
    device: dict[str, DeviceTable] = {}
    """Emulated CANopen devices of any kind, by name."""
    station: dict[str, StationTable] = {}
    """Emulated I/O stations on Modbus, by name."""
    axis: dict[str, AxisTable] = {}
    """Axes by name: technology objects that move a drive."""
    external_encoder: dict[str, ExternalEncoderTable] = {}
    """External encoders by name: technology objects that read an encoder."""

    @property
    def devices(self) -> dict[str, DriveTable | EncoderTable | DeviceTable]:
        """Drives, encoders and other devices by name."""
        return {**self.drive, **self.encoder, **self.device}

    @property
    def nodes(self) -> dict[str, CanDriveTable | EncoderTable | DeviceTable]:
        """Drives, encoders and other devices with a CANopen node, by name."""
        drives = {name: drive for name, drive in self.drive.items() if isinstance(drive, CanDriveTable)}
        return {**drives, **self.encoder, **self.device}

    @property
    def emulated_names(self) -> tuple[str, ...]:
        """Drives, encoders and other devices that the bench brings."""
        return tuple(name for name, table in self.devices.items() if table.device == "emulated")

    @property
    def emulated_encoders(self) -> tuple[str, ...]:
        """Encoders that the bench brings."""
        return tuple(name for name, table in self.encoder.items() if table.device == "emulated")

    @property
    def used_encoders(self) -> set[str]:
        """Encoders that an axis or an external encoder reads."""
        used = {one.encoder for one in self.external_encoder.values()}
        used.update(name for axis in self.axis.values() for name in axis.encoders or ())
        return used

    def leads(self, segment: str) -> bool:
        """Whether the bench is the controller on a segment: it moves an axis
        there, or nobody else can be there.
        """
        if any(self.drive[axis.drive].segment == segment for axis in self.axis.values()):
            return True
        return not self.bench.live and any(one.segment == segment for one in self.encoder.values())

    def lead_mm(self, encoder: EncoderTable) -> float | None:
        """Return the lead of the screw of the machine that an encoder sits on, mm; None: it sits on none."""
        drive = None if encoder.on is None else self.drive[encoder.on]
        return None if drive is None or drive.machine is None else drive.machine.lead_screw_mm

    def encoders_of_axis(self, name: str) -> tuple[str, ...] | None:
        """Return where the encoders of an axis come from: as it says, or both of telegram 6 and 106
        (CFG-282); None: the drive.
        """
        axis = self.axis[name]
        if axis.encoders is not None or axis.type == "speed":
            return axis.encoders
        drive = self.drive[axis.drive]
        if not isinstance(drive, (ProfidriveCanTable, ProfidriveModbusTable)) or not drive.second_encoder:
            return None
        both = encoders_of_telegram(drive.telegram, self.bench.cpu) == 2
        return (axis.drive, second_of(axis.drive)) if both else None

    def wired_variables(self, name: str) -> dict[str, bool | int]:
        """Return the variables of an axis that follow from the wires of its analog drive."""
        drive = self.drive[self.axis[name].drive]
        if not isinstance(drive, AnalogDriveTable):
            return {}
        return drive.wired_variables(self.axis[name].drive, self.station)

    def start_values(self, name: str) -> dict[str, Any]:
        """Return the start values of the variables of an axis: what it says, and otherwise what follows from
        drive, encoders, switches and wires.
        """
        axis = self.axis[name]
        drive = self.drive[axis.drive]
        values: dict[str, Any] = dict(drive.taken_over())
        if axis.type != "speed":
            if isinstance(drive, WITH_SWITCHES):
                level = not drive.switches.normally_closed
                values |= dict.fromkeys(SWITCH_LEVELS, level)
            encoders = self.encoders_of_axis(name) or (axis.drive,)
            for number, encoder in enumerate(encoders, start=1):
                values |= self._values_of_encoder(axis, encoder, f"Sensor[{number}]")
        return {**values, **self.wired_variables(name), **axis.variables}

    def _values_of_encoder(self, axis: AxisTable, encoder: str, sensor: str) -> dict[str, Any]:
        """Return the variables that follow from an encoder of an axis."""
        drive = self.drive[axis.drive]
        if encoder == axis.drive:
            steps, fine = (
                f"{sensor}.Parameter.{one}" for one in ("StepsPerRevolution", "FineResolutionXist1")
            )
            given = steps in axis.variables or fine in axis.variables
            # One of the two alone says which share of the other is meant: both keep to the axis then.
            counts, bits = drive.increments_per_revolution, drive.fine_resolution_bits
            while counts > _MOST_STEPS and counts % 2 == 0:
                counts, bits = counts // 2, bits + 1
            return {} if given or counts > _MOST_STEPS else {steps: counts, fine: bits}
        if encoder == second_of(axis.drive):
            second = drive.second_encoder
            return {} if second is None else second_encoder_variables(second, sensor)
        return self.encoder[encoder].taken_over(sensor)

    def inputs_of_axis(self, name: str) -> str | None:
        """Return the station to which the switches of an axis are wired; None: those at its drive count."""
        axis = self.axis[name]
        drive = self.drive[axis.drive]
        if axis.inputs is None and isinstance(drive, AnalogDriveTable):
            return drive.station(axis.drive, self.station)
        return axis.inputs

    # -- checks between tables ------------------------------------------------------------------------------

    @model_validator(mode="after")
    def _fits_together(self) -> BenchConfig:
        if not self.devices:
            raise ValueError(
                "there is neither a drive nor an encoder nor a device; a bench needs at least one"
            )
        self._check_names()
        if self.bench.live and self.station:
            raise ValueError(
                f"station.{next(iter(self.station))}: stations are emulated on virtual benches; "
                'set bench.kind = "virtual"'
            )
        self._check_drives()
        self._check_axes()
        for name, segment in self.segment.items():
            segment.check(f"segment.{name}", live=self.bench.live)
        self._check_stations()
        self._check_modbus()
        if not self.bench.live and any(one.device == "physical" for one in self.drive.values()):
            raise ValueError('a virtual bench cannot hold a physical drive; set bench.kind = "live"')
        self._check_encoders()
        self._check_external_encoders()
        self._check_nodes()
        self._check_files()
        return self

    def _check_names(self) -> None:
        taken: dict[str, str] = {}
        tables: tuple[tuple[str, str, Mapping[str, object]], ...] = (
            ("segment", "a segment", self.segment),
            ("drive", "a drive", self.drive),
            ("axis", "an axis", self.axis),
            ("external_encoder", "an external encoder", self.external_encoder),
            ("encoder", "an encoder", self.encoder),
            ("device", "a device", self.device),
            ("station", "a station", self.station),
        )
        for kind, described, names in tables:
            for name in names:
                if "." in name or not name.strip():
                    raise ValueError(
                        f"{kind}.{name!r}: a name is not empty and has no dot; signals are NAME.COLUMN"
                    )
                if name in taken:
                    raise ValueError(
                        f"{kind}.{name}: {taken[name]} has this name already; signals are distinguished by it"
                    )
                taken[name] = described

    def _check_segment_of(self, where: str, segment: str) -> None:
        if segment not in self.segment:
            raise ValueError(
                f"{where}.segment: {segment!r} is not a segment; there are: {', '.join(self.segment)}"
            )

    def _check_drives(self) -> None:
        for name, drive in self.drive.items():
            where = f"drive.{name}"
            self._check_segment_of(where, drive.segment)
            drive.check_bench(where, self.bench)

    def _check_axes(self) -> None:
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
            self._check_encoders_of_axis(name, axis)
        for name, drive in self.drive.items():
            drive.check_segment(f"drive.{name}", self.segment[drive.segment])
        for name, axis in self.axis.items():
            self.drive[axis.drive].check_axis(f"axis.{name}", axis)

    def _check_encoders_of_axis(self, name: str, axis: AxisTable) -> None:
        """Check the encoders of an axis (CFG-174, CFG-175, CFG-201)."""
        where = f"axis.{name}.encoders"
        drive = self.drive[axis.drive]
        if axis.type == "speed":
            return
        encoders = (axis.drive,) if axis.encoders is None else axis.encoders
        encoders = self.encoders_of_axis(name) or encoders
        if not encoders:
            raise ValueError(f"{where}: a positioning axis needs an encoder")
        if len(set(encoders)) != len(encoders):
            raise ValueError(f"{where}: an encoder is listed twice in {', '.join(encoders)}")
        level = LEVELS[self.bench.cpu]
        if len(encoders) > level.encoders:
            raise ValueError(
                f'{where}: {len(encoders)} encoders need bench.cpu = "S7-1500T"; an {level.name} has one '
                "per axis"
            )
        for one in encoders:
            if one == axis.drive:
                if not drive.encoder_value:
                    raise ValueError(
                        f"axis.{name}.drive: the telegram of {axis.drive!r} has no encoder value for a "
                        "positioning axis; allowed: 3, 4, 5, 6, 102, 103, 105, 106, or `encoders` of its own"
                    )
            elif one == second_of(axis.drive):
                telegram = getattr(drive, "telegram", None)
                if not drive.second_encoder or telegram not in WITH_G2:
                    raise ValueError(
                        f"{where}: {one!r} needs encoder2 of {axis.drive!r} and one of its telegrams "
                        f"{', '.join(map(str, WITH_G2))}"
                    )
            elif one not in self.encoder:
                known = ", ".join((axis.drive, *self.encoder))
                raise ValueError(f"{where}: {one!r} is neither its drive nor an encoder; there are: {known}")
            elif not self.leads(self.encoder[one].segment):
                raise ValueError(
                    f"{where}: {one!r} is on {self.encoder[one].segment!r}, where the bench is not the "
                    "controller"
                )

    def _check_stations(self) -> None:
        wired: dict[str, str] = {}
        for name, station in self.station.items():
            where = f"station.{name}"
            segment = self.segment.get(station.segment)
            if segment is None or not segment.on_modbus:
                names = [key for key, one in self.segment.items() if one.on_modbus]
                raise ValueError(
                    f"{where}.segment: {station.segment!r} is not a segment on Modbus; there are: "
                    f"{', '.join(names) or 'none'}"
                )
            self._check_wires(where, station, wired)
        for name, drive in self.drive.items():
            if isinstance(drive, AnalogDriveTable):
                self._check_analog(name, drive)
        for name, axis in self.axis.items():
            self._check_inputs(f"axis.{name}", axis)

    def _check_wires(self, where: str, station: StationTable, wired: dict[str, str]) -> None:
        for channels, wires in station.wires.items():
            for number, wire in enumerate(wires):
                if not wire:
                    continue
                place = f"{where}.{channels}[{number}]"
                name, _, terminal = wire.partition(".")
                drive = self.drive.get(name)
                if drive is None:
                    raise ValueError(f"{place}: {name!r} is not a drive; there are: {', '.join(self.drive)}")
                allowed = drive.terminals.get(channels, ())
                if terminal not in allowed:
                    text = ", ".join(f"{name}.{one}" for one in allowed) or "nothing of this drive"
                    raise ValueError(f"{place}: {wire!r} is no terminal for it; allowed: {text}")
                owner = wired.setdefault(wire, place)
                if owner != place:
                    raise ValueError(f"{place}: {wire!r} is wired to {owner} already")

    def _check_analog(self, name: str, drive: AnalogDriveTable) -> None:
        where = f"drive.{name}"
        station = drive.station(name, self.station)
        if station is None:
            raise ValueError(
                f"{where}: its setpoint is wired to no station; one needs analog_outputs = "
                f'["{name}.setpoint"]'
            )
        segment = self.station[station].segment
        if drive.segment != segment:
            raise ValueError(
                f"{where}.segment: {drive.segment!r} is not the segment of station.{station}; allowed: "
                f"{segment}"
            )
        for key, other in self.station.items():
            for channels, wires in other.wires.items():
                if key != station and any(wire.startswith(f"{name}.") for wire in wires):
                    raise ValueError(
                        f"station.{key}.{channels}: {name!r} is wired to station.{station}; all its wires "
                        "go there"
                    )

    def _check_inputs(self, where: str, axis: AxisTable) -> None:
        if axis.inputs is not None:
            station = self.station.get(axis.inputs)
            if station is None:
                raise ValueError(
                    f"{where}.inputs: {axis.inputs!r} is not a station; there are: "
                    f"{', '.join(self.station) or 'none'}"
                )
            if not any(f"{axis.drive}.{one}" in station.digital_inputs for one in LIMITS):
                raise ValueError(
                    f"{where}.inputs: no switch of {axis.drive!r} is wired to station.{axis.inputs}; "
                    f"allowed: {', '.join(f'{axis.drive}.{one}' for one in LIMITS)}"
                )
        drive = self.drive[axis.drive]
        if isinstance(drive, AnalogDriveTable) and axis.type != "speed":
            place = self.station[drive.station(axis.drive, self.station) or ""]
            if f"{axis.drive}.encoder" not in place.counters:
                raise ValueError(
                    f"{where}.drive: a positioning axis needs the encoder of {axis.drive!r} at its station: "
                    f'counters = ["{axis.drive}.encoder"]'
                )

    @property
    def _modbus_drives(self) -> Iterator[tuple[str, ProfidriveModbusTable]]:
        for name, drive in self.drive.items():
            if isinstance(drive, ProfidriveModbusTable):
                yield name, drive

    def _check_modbus(self) -> None:
        others: dict[str, Mapping[str, EncoderTable | DeviceTable]] = {
            "encoder": self.encoder,
            "device": self.device,
        }
        for kind, tables in others.items():
            for name, table in tables.items():
                segment = self.segment.get(table.segment)
                if segment is not None and segment.on_modbus:
                    raise ValueError(
                        f'{kind}.{name}.segment: {table.segment!r} is of kind = "{segment.kind}"; '
                        'needs one of kind = "can"'
                    )
        addresses: dict[tuple[str, int], str] = {}
        units: dict[tuple[str, int], str] = {}
        for name, drive in self._modbus_drives:
            segment = self.segment[drive.segment]
            where = f"drive.{name}"
            if isinstance(segment, TcpTable) and self.bench.live:
                self._check_address(where, drive, segment, addresses)
                continue
            for key in ("host", "port"):
                if getattr(drive, key) is not None:
                    raise ValueError(f"{where}.{key}: only a drive on a live network has one")
            if isinstance(segment, RtuTable):
                self._check_line_end(where, drive, segment)
                _take(units, (drive.segment, drive.unit), where, f"unit: {drive.unit}")
        for name, station in self.station.items():
            if isinstance(self.segment[station.segment], RtuTable):
                _take(units, (station.segment, station.unit), f"station.{name}", f"unit: {station.unit}")
        for name, segment in self.segment.items():
            if isinstance(segment, RtuTable):
                self._check_line(name, segment)

    def _check_address(
        self,
        where: str,
        drive: ProfidriveModbusTable,
        segment: TcpTable,
        addresses: dict[tuple[str, int], str],
    ) -> None:
        host, port = drive.address(segment)
        if port:
            _take(addresses, (host, port), where, f"port: {host}:{port}")
        elif drive.device == "physical":
            raise ValueError(f"{where}.port: the key is missing; it is a physical drive")

    def _check_line_end(self, where: str, drive: ProfidriveModbusTable, line: RtuTable) -> None:
        if not self.bench.live:
            return
        if drive.device == "physical" and line.path is None:
            raise ValueError(f"segment.{drive.segment}.path: the key is missing; {where} is a physical drive")
        if drive.device == "emulated" and line.path is not None:
            raise ValueError(
                f"segment.{drive.segment}.path: {where} is emulated: it comes with a pseudo-terminal of its "
                "own; "
                'leave the key out, or set device = "physical"'
            )

    def _check_line(self, name: str, line: RtuTable) -> None:
        """Refuse a line on which the requests of a cycle take longer than the cycle."""
        led = {axis.drive for axis in self.axis.values()}
        drives = [drive for key, drive in self._modbus_drives if drive.segment == name and key in led]
        needed_ms = sum(drive.cycle_time_ns(line) for drive in drives) / 1e6
        if needed_ms > self.bench.cycle_ms:
            raise ValueError(
                f"segment.{name}.baud: at {line.baud} the requests of every bus cycle take {needed_ms:.1f} "
                "ms, "
                f"longer than bench.cycle_ms = {self.bench.cycle_ms}"
            )

    def _check_encoders(self) -> None:
        for name, encoder in self.encoder.items():
            where = f"encoder.{name}"
            self._check_segment_of(where, encoder.segment)
            if encoder.device == "physical" and not self.bench.live:
                raise ValueError(
                    f'{where}: a virtual bench cannot hold a physical encoder; set bench.kind = "live"'
                )
            if encoder.on is None:
                continue
            drive = self.drive.get(encoder.on)
            if drive is None:
                raise ValueError(
                    f"{where}.on: {encoder.on!r} is not a drive; there are: {', '.join(self.drive)}"
                )
            if drive.machine is None:
                raise ValueError(f"{where}.on: {encoder.on!r} moves no machine that an encoder could sit on")
            if encoder.device == "emulated" and drive.device == "physical":
                raise ValueError(
                    f"{where}.on: {encoder.on!r} is physical; an emulated encoder cannot sit on it"
                )

    def _check_external_encoders(self) -> None:
        """Check what external encoders say of encoders (CFG-176)."""
        for name, table in self.external_encoder.items():
            where = f"external_encoder.{name}"
            if table.encoder not in self.encoder:
                known = ", ".join(self.encoder) or "none"
                raise ValueError(f"{where}.encoder: {table.encoder!r} is not an encoder; there are: {known}")
            if not self.leads(self.encoder[table.encoder].segment):
                raise ValueError(
                    f"{where}.encoder: {table.encoder!r} is on a segment where the bench is not the "
                    "controller"
                )
            led = [axis.drive for axis in self.axis.values()]
            if table.drive is not None and table.drive not in led:
                raise ValueError(
                    f"{where}.drive: {table.drive!r} is not the drive of an axis; there are: "
                    f"{', '.join(led) or 'none'}"
                )

    def _check_nodes(self) -> None:
        for name, device in self.device.items():
            self._check_segment_of(f"device.{name}", device.segment)
        owners: dict[tuple[str, int], str] = {}
        for name, table in self.nodes.items():
            kind = "drive" if name in self.drive else "encoder" if name in self.encoder else "device"
            _take(owners, (table.segment, table.node_id), f"{kind}.{name}", f"node_id: {table.node_id}")

    def _check_files(self) -> None:
        owners: dict[str, str] = {}
        for name, drive in self.drive.items():
            if isinstance(drive, (Cia402DriveTable, ProfidriveCanTable)):
                _own_file(owners, f"drive.{name}", drive.storage)
        for name, device in self.device.items():
            _own_file(owners, f"device.{name}", device.storage)

    @property
    def source_files(self) -> list[Path]:
        """EDS files and register maps that the bench is made of, as far as they are there."""
        names = [drive.eds for drive in self.drive.values() if isinstance(drive, Cia402DriveTable)]
        names += [drive.map for _, drive in self._modbus_drives if drive.map.endswith(".toml")]
        names += [device.eds for device in self.device.values()]
        return [Path(name) for name in names if name is not None and Path(name).is_file()]


def _take(owners: dict[tuple[str, int], str], place: tuple[str, int], where: str, text: str) -> None:
    other = owners.setdefault(place, where)
    if other != where:
        raise ValueError(f"{where}.{text} is already taken by {other}")


def _own_file(owners: dict[str, str], where: str, storage: str | None) -> None:
    if storage is not None and owners.setdefault(storage, where) != where:
        raise ValueError(f"{where}.storage: {storage!r} is already the file of {owners[storage]}")


def _anchor_files(data: dict[str, Any], folder: Path) -> None:
    """Make the names of files relative to the folder of the bench file; what is
    no text is left to the checks.
    """
    bench = data.get("bench")
    if isinstance(bench, dict):
        _anchor(bench, "memory_card", folder)
    for kind, keys in _ANCHORED.items():
        tables = data.get(kind)
        for table in tables.values() if isinstance(tables, dict) else ():
            for key in keys if isinstance(table, dict) else ():
                _anchor(table, key, folder)


def _anchor(table: dict[str, Any], key: str, folder: Path) -> None:
    value = table.get(key)
    if isinstance(value, str) and value and (key != "map" or value.endswith(".toml")):
        table[key] = str(folder / value)


class BenchFileError(ConfigurationError):
    """The bench file cannot be used; the message lists every mistake with file,
    key, value and what is allowed.
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
        hint = _unquoted(text, str(error))
        raise BenchFileError(source, f"{source}: this is not valid TOML: {error}{hint}") from None
    folder = Path(source).parent if source not in EMBEDDED else None
    _anchor_files(data, Path(source).parent)
    try:
        return BenchConfig.model_validate(data, context={"folder": folder})
    except ValidationError as error:
        raise BenchFileError(source, messages(BenchConfig, source, error)) from None


def _unquoted(text: str, error: str) -> str:
    """Return the advice to quote the path of a variable with brackets, if that is what cannot be read."""
    line = re.search(r"at line (\d+)", error)
    written = text.splitlines()[int(line[1]) - 1] if line is not None else ""
    path = re.match(r"\s*(\w+\[\d+\][\w.]*)\s*=", written)
    return f'; quote the path: "{path[1]}"' if path is not None else ""


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
    for path in [] if config is None else config.source_files:
        total.update(path.read_bytes())
    return total.hexdigest()
