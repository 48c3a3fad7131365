"""What the tables of a bench file say of each other: names that exist, segments that fit, wires, addresses.

Each check looks at one table and at what it refers to. So the mistakes of all tables are found at once, and a
table with a mistake hides only those of tables that refer to it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from fieldbus.errors import ConfigurationError, located
from hil.bench.axis_config import AxisTable, second_of
from hil.bench.device_config import DeviceTable
from hil.bench.drive_config import (
    WITH_G2,
    AnalogDriveTable,
    Cia402DriveTable,
    ProfidriveCanTable,
    ProfidriveModbusTable,
    TwoSpeedDriveTable,
)
from hil.bench.io_config import LIMITS
from hil.bench.nc_axis_config import NcAxisTable
from hil.bench.segment_config import RtuTable, TcpTable
from motion.s7.compatibility import LEVELS

if TYPE_CHECKING:
    from hil.bench.config import BenchConfig
    from hil.bench.drive_config import DriveTable
    from hil.bench.encoder_config import EncoderTable
    from hil.bench.io_config import StationTable


def disagreements(config: BenchConfig, wrong: Collection[str] = ()) -> list[str]:
    """Return every mistake in what the tables say of each other; if there are any, with those of `contents`.

    Args:
        config: The tables that are right by themselves.
        wrong: Tables that are not, `drive.x_drive`: nothing is said of what refers to them.

    """
    mistakes = _Mistakes(wrong)
    _check_whole(config, mistakes)
    _check_names(config, mistakes)
    known = _References(config, mistakes).resolved()
    _Fitting(known, mistakes).check()
    if mistakes.tables or mistakes.texts:
        _check_contents(known, mistakes)
    return mistakes.texts


def contents(config: BenchConfig) -> list[str]:
    """Return every mistake that shows only when variables of axes are put together and EDS files are read.

    Args:
        config: Tables that agree.

    """
    mistakes = _Mistakes(())
    _check_contents(config, mistakes)
    return mistakes.texts


class _OfWrongTable(Exception):  # noqa: N818 - it is no mistake of its own
    """A table refers to one with a mistake: nothing can be said of it."""


class _Mistakes:
    """Sentences about mistakes, and the tables in which they are."""

    def __init__(self, wrong: Collection[str]) -> None:
        self.texts: list[str] = []
        self.tables = set(wrong)

    def of(self, table: str, check: Callable[[], None]) -> None:
        """Keep what a check of a table refuses; it ends at the first mistake."""
        try:
            check()
        except (ValueError, ConfigurationError) as error:
            self.texts.append(str(error))
            self.tables.add(table)
        except _OfWrongTable:
            self.tables.add(table)


def _tables(config: BenchConfig) -> dict[str, tuple[str, Mapping[str, Any]]]:
    """Return the kinds of tables with names: what one is called, and all of them."""
    return {
        "segment": ("a segment", config.segment),
        "drive": ("a drive", config.drive),
        "axis": ("an axis", config.axis),
        "external_encoder": ("an external encoder", config.external_encoder),
        "encoder": ("an encoder", config.encoder),
        "device": ("a device", config.device),
        "station": ("a station", config.station),
        "cam": ("a cam", config.cam),
        "measuring_input": ("a measuring input", config.measuring_input),
        "proxy": ("a proxy", config.proxy),
        "controller": ("a controller", config.controller),
    }


def _check_whole(config: BenchConfig, mistakes: _Mistakes) -> None:
    kinds = {table.partition(".")[0] for table in mistakes.tables}
    if not config.devices and not config.nc_axes and not kinds & {"drive", "encoder", "device"}:
        mistakes.texts.append(
            "there is neither a drive nor an encoder nor a device; a bench needs at least one"
        )
    if config.cam and not LEVELS[config.bench.cpu].technology:
        mistakes.texts.append(
            f'cam.{next(iter(config.cam))}: an {config.bench.cpu} has no cams; set bench.cpu = "S7-1500T"'
        )
    if not config.bench.live and any(one.device == "physical" for one in config.drive.values()):
        mistakes.texts.append('a virtual bench cannot hold a physical drive; set bench.kind = "live"')


def _check_names(config: BenchConfig, mistakes: _Mistakes) -> None:
    taken: dict[str, str] = {}
    for kind, (described, names) in _tables(config).items():
        for name in names:
            if "." in name or not name.strip():
                mistakes.texts.append(
                    f"{kind}.{name!r}: a name is not empty and has no dot; signals are NAME.COLUMN"
                )
            elif name in taken:
                mistakes.texts.append(
                    f"{kind}.{name}: {taken[name]} has this name already; signals are distinguished by it"
                )
            taken.setdefault(name, described)


class _References:
    """Checks that what a table names exists."""

    def __init__(self, config: BenchConfig, mistakes: _Mistakes) -> None:
        self._config = config
        self._mistakes = mistakes

    def resolved(self) -> BenchConfig:
        """Return the tables all of whose references exist."""
        checks: dict[str, Callable[[str], None]] = {
            "drive": self._drive,
            "encoder": self._encoder,
            "device": self._device,
            "controller": self._controller,
            "proxy": self._proxy,
            "station": self._station,
            "axis": self._axis,
            "external_encoder": self._external_encoder,
            "measuring_input": self._measuring_input,
        }
        for kind, check in checks.items():
            for name in _tables(self._config)[kind][1]:
                self._mistakes.of(f"{kind}.{name}", partial(check, name))
        wrong = self._mistakes.tables
        return self._config.model_copy(
            update={
                kind: {
                    name: table
                    for name, table in _tables(self._config)[kind][1].items()
                    if f"{kind}.{name}" not in wrong
                }
                for kind in checks
            }
        )

    def _refer(self, where: str, kind: str, name: str) -> None:
        """Refuse a name that no table of a kind has."""
        described, tables = _tables(self._config)[kind]
        if f"{kind}.{name}" in self._mistakes.tables:
            raise _OfWrongTable
        if name not in tables:
            left_out = {
                one.removeprefix(f"{kind}.") for one in self._mistakes.tables if one.startswith(f"{kind}.")
            }
            known = ", ".join([*tables, *sorted(left_out - set(tables))]) or "none"
            raise ValueError(f"{where}: {name!r} is not {described}; there are: {known}")

    def _drive(self, name: str) -> None:
        self._refer(f"drive.{name}.segment", "segment", self._config.drive[name].segment)

    def _encoder(self, name: str) -> None:
        table = self._config.encoder[name]
        self._refer(f"encoder.{name}.segment", "segment", table.segment)
        if table.on is not None:
            self._refer(f"encoder.{name}.on", "drive", table.on)

    def _device(self, name: str) -> None:
        self._refer(f"device.{name}.segment", "segment", self._config.device[name].segment)

    def _station(self, name: str) -> None:
        station, segments = self._config.station[name], self._config.segment
        if f"segment.{station.segment}" in self._mistakes.tables:
            raise _OfWrongTable
        segment = segments.get(station.segment)
        if segment is None or not segment.on_modbus:
            names = [key for key, one in segments.items() if one.on_modbus]
            raise ValueError(
                f"station.{name}.segment: {station.segment!r} is not a segment on Modbus; there are: "
                f"{', '.join(names) or 'none'}"
            )
        for channels, wires in station.wires.items():
            for number, wire in enumerate(wires):
                if wire:
                    self._refer(f"station.{name}.{channels}[{number}]", "drive", wire.partition(".")[0])

    def _axis(self, name: str) -> None:
        axis, where = self._config.axis[name], f"axis.{name}"
        if isinstance(axis, NcAxisTable):
            if axis.drive:
                self._refer(f"{where}.drive", "drive", axis.drive)
            if axis.encoder is not None:
                self._refer(f"{where}.encoder", "encoder", axis.encoder)
            return
        if axis.drive:
            self._refer(f"{where}.drive", "drive", axis.drive)
        self._plc(where, axis.plc)
        if axis.inputs is not None:
            self._refer(f"{where}.inputs", "station", axis.inputs)
        self._leading(name, axis)
        for one in axis.encoders or ():
            if f"encoder.{one}" in self._mistakes.tables:
                raise _OfWrongTable
            if one not in (axis.drive, second_of(axis.drive), *self._config.encoder):
                known = ", ".join((axis.drive, *self._config.encoder))
                raise ValueError(
                    f"{where}.encoders: {one!r} is neither its drive nor an encoder; there are: {known}"
                )

    def _leading(self, name: str, axis: AxisTable) -> None:
        where, cpu = f"axis.{name}", self._config.cpu_of(axis.plc)
        if axis.hold_tolerance and LEVELS[cpu].before_v9:
            version = LEVELS[cpu].version
            raise ValueError(f"{where}.hold_tolerance: {cpu} has technology version {version}; it needs V9.0")
        for leader in axis.leading:
            if leader in self._config.proxy:
                self._check_proxy(f"{where}.leading", name, leader, cpu)
                continue
            if leader in self._config.axis and self._config.plc_of(leader) != axis.plc:
                raise ValueError(
                    f"{where}.leading: {leader!r} belongs to another controller, which leads by a "
                    f"[proxy.NAME] with axis = {leader!r}"
                )
            if leader in self._config.external_encoder and leader not in self._config.axis:
                self._check_actual(f"{where}.leading", f"the external encoder {leader!r}", cpu)
                continue
            self._refer(f"{where}.leading", "axis", leader)
            if leader == name:
                raise ValueError(f"{where}.leading: {leader!r} is the axis itself")
            led = self._config.axis[leader]
            if isinstance(led, NcAxisTable):
                text = f"{where}.leading: {leader!r} is an axis of an NC, which leads no other make"
                raise ValueError(text)  # noqa: TRY004 - it becomes a message about the file
            if led.type == "speed":
                raise ValueError(f"{where}.leading: {leader!r} is a speed axis, which has no position")
        for leader, coupling in axis.coupling.items():
            if leader not in axis.leading:
                known = ", ".join(axis.leading) or "none"
                raise ValueError(f"{where}.coupling: {leader!r} is not one of `leading`; there are: {known}")
            if coupling == "actual":
                self._check_actual(f"{where}.coupling.{leader}", "an actual value", cpu)
            elif leader in self._config.external_encoder:
                raise ValueError(
                    f"{where}.coupling.{leader}: {coupling!r} is not possible: an external encoder has no "
                    f"setpoint; allowed is 'actual'"
                )

    def _check_proxy(self, where: str, name: str, proxy: str, cpu: str) -> None:
        if self._config.plc_of(proxy) != self._config.plc_of(name):
            raise ValueError(f"{where}: the proxy {proxy!r} belongs to another controller")
        if not LEVELS[cpu].technology:
            raise ValueError(f"{where}: a proxy leads axes of an S7-1500T only, and the cpu is {cpu!r}")

    def _proxy(self, name: str) -> None:
        proxy, where = self._config.proxy[name], f"proxy.{name}"
        self._plc(where, proxy.plc)
        self._refer(f"{where}.axis", "axis", proxy.axis)
        led = self._config.axis[proxy.axis]
        if not isinstance(led, AxisTable) or led.type == "speed":
            raise ValueError(
                f"{where}.axis: {proxy.axis!r} gives no leading value: it needs positions of an S7"
            )
        if led.plc == proxy.plc:
            raise ValueError(
                f"{where}.axis: {proxy.axis!r} belongs to the same controller; put it into `leading` of the "
                "axes that follow"
            )
        most = LEVELS[self._config.cpu_of(led.plc)].leading_interfaces
        if proxy.interface > most:
            raise ValueError(f"{where}.interface: {proxy.interface}; allowed: 1 to {most}")

    def _plc(self, where: str, plc: str | None) -> None:
        if plc is not None and plc not in self._config.controller:
            known = ", ".join(self._config.controller) or "none"
            raise ValueError(f"{where}.plc: there is no [controller.{plc}]; there are: {known}")

    def _controller(self, name: str) -> None:
        phase = self._config.controller[name].phase_us
        cycle = self._config.bench.cycle_ms * 1000
        if phase is not None and phase >= cycle:
            raise ValueError(f"controller.{name}.phase_us: {phase}; allowed: below the cycle of {cycle} us")

    @staticmethod
    def _check_actual(where: str, what: str, cpu: str) -> None:
        if not LEVELS[cpu].technology:
            raise ValueError(f"{where}: {what} leads axes of an S7-1500T only, and [bench] cpu is {cpu!r}")

    def _measuring_input(self, name: str) -> None:
        of = self._config.measuring_input[name].of
        where = f"measuring_input.{name}.of"
        if of in self._config.external_encoder:
            return
        if f"external_encoder.{of}" in self._mistakes.tables:
            raise _OfWrongTable
        self._refer(where, "axis", of)
        axis = self._config.axis[of]
        if not isinstance(axis, AxisTable) or axis.type == "speed":
            raise ValueError(f"{where}: {of!r} has no positions of an S7 that could be measured")

    def _external_encoder(self, name: str) -> None:
        table, where = self._config.external_encoder[name], f"external_encoder.{name}"
        self._refer(f"{where}.encoder", "encoder", table.encoder)
        if table.drive is None:
            return
        led = self._config.moved_drives
        if table.drive not in led:
            if any(one.startswith("axis.") for one in self._mistakes.tables):
                raise _OfWrongTable
            raise ValueError(
                f"{where}.drive: {table.drive!r} is not the drive of an axis; there are: "
                f"{', '.join(led) or 'none'}"
            )


class _Fitting:
    """Checks that tables fit to those to which they refer."""

    def __init__(self, config: BenchConfig, mistakes: _Mistakes) -> None:
        self._config = config
        self._mistakes = mistakes
        self._driven: dict[str, str] = {}
        self._wired: dict[str, str] = {}
        self._addresses: dict[tuple[str, int], str] = {}
        self._units: dict[tuple[str, int], str] = {}
        self._nodes: dict[tuple[str, int], str] = {}
        self._files: dict[str, str] = {}

    def check(self) -> None:
        """Check every table."""
        config, of = self._config, self._mistakes.of
        for name, segment in config.segment.items():
            of(f"segment.{name}", partial(segment.check, f"segment.{name}", live=config.bench.live))
        for name, station in config.station.items():
            of(f"station.{name}", partial(self._station, f"station.{name}", station))
        for name, drive in config.drive.items():
            of(f"drive.{name}", partial(self._drive, name, drive))
        for name, encoder in config.encoder.items():
            of(f"encoder.{name}", partial(self._encoder, f"encoder.{name}", encoder))
        for name, device in config.device.items():
            of(f"device.{name}", partial(self._no_modbus, f"device.{name}", device.segment))
            of(f"device.{name}", partial(_own_file, self._files, f"device.{name}", device.storage))
        for name, axis in config.axis.items():
            of(f"axis.{name}", partial(self._axis, name, axis))
        for name, table in config.external_encoder.items():
            of(f"external_encoder.{name}", partial(self._external_encoder, name, table.encoder))
        for name, node in config.nodes.items():
            where = config.place_of(name)
            text = f"node_id: {node.node_id}"
            of(where, partial(_take, self._nodes, (node.segment, node.node_id), where, text))
        for name, segment in config.segment.items():
            if isinstance(segment, RtuTable):
                of(f"segment.{name}", partial(self._line, name, segment))

    def _drive(self, name: str, drive: DriveTable) -> None:
        where, config = f"drive.{name}", self._config
        drive.check_bench(where, config.bench)
        drive.check_segment(where, config.segment[drive.segment])
        if isinstance(drive, AnalogDriveTable):
            self._analog(name, drive)
        if isinstance(drive, TwoSpeedDriveTable):
            drive.check_wires(where, name, self._config.station)
        if isinstance(drive, ProfidriveModbusTable):
            self._on_modbus(where, drive)
        if isinstance(drive, (Cia402DriveTable, ProfidriveCanTable)):
            _own_file(self._files, where, drive.storage)

    def _axis(self, name: str, axis: AxisTable | NcAxisTable) -> None:
        where = f"axis.{name}"
        if not axis.drive:
            return
        owner = self._driven.setdefault(axis.drive, name)
        if owner != name:
            raise ValueError(f"{where}.drive: {axis.drive!r} already belongs to axis.{owner}")
        if isinstance(axis, NcAxisTable):
            self._nc_axis(where, axis)
            return
        self._encoders_of_axis(name, axis)
        self._config.drive[axis.drive].check_axis(where, axis)
        self._inputs(where, axis)

    def _nc_axis(self, where: str, axis: NcAxisTable) -> None:
        """Check the drive of an axis of an NC."""
        drive = self._config.drive[axis.drive]
        if not drive.encoder_value:
            raise ValueError(f"{where}.drive: {axis.drive!r} brings no encoder value, which an axis needs")
        if axis.interface not in drive.interfaces:
            raise ValueError(
                f"{where}.interface: {axis.drive!r} takes no {axis.interface}; allowed: "
                f"{', '.join(drive.interfaces)}"
            )

    def _encoders_of_axis(self, name: str, axis: AxisTable) -> None:
        """Check the encoders of an axis (CFG-174, CFG-175, CFG-201)."""
        where, config = f"axis.{name}.encoders", self._config
        drive = config.drive[axis.drive]
        if axis.type == "speed":
            return
        encoders = (axis.drive,) if axis.encoders is None else axis.encoders
        encoders = config.encoders_of_axis(name) or encoders
        if not encoders:
            raise ValueError(f"{where}: a positioning axis needs an encoder")
        if len(set(encoders)) != len(encoders):
            raise ValueError(f"{where}: an encoder is listed twice in {', '.join(encoders)}")
        level = LEVELS[config.cpu_of(axis.plc)]
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
            elif not config.leads(config.encoder[one].segment):
                self._skip_if_an_axis_is_wrong()
                raise ValueError(
                    f"{where}: {one!r} is on {config.encoder[one].segment!r}, where the bench is not the "
                    "controller"
                )

    def _skip_if_an_axis_is_wrong(self) -> None:
        """Say nothing of a segment without an axis if one with a mistake may belong there."""
        if any(one.startswith("axis.") for one in self._mistakes.tables):
            raise _OfWrongTable

    def _inputs(self, where: str, axis: AxisTable) -> None:
        config = self._config
        if axis.inputs is not None:
            station = config.station[axis.inputs]
            if not any(f"{axis.drive}.{one}" in station.digital_inputs for one in LIMITS):
                raise ValueError(
                    f"{where}.inputs: no switch of {axis.drive!r} is wired to station.{axis.inputs}; "
                    f"allowed: {', '.join(f'{axis.drive}.{one}' for one in LIMITS)}"
                )
        drive = config.drive[axis.drive]
        if isinstance(drive, AnalogDriveTable) and axis.type != "speed":
            place = drive.station(axis.drive, config.station)
            if place is not None and f"{axis.drive}.encoder" not in config.station[place].counters:
                raise ValueError(
                    f"{where}.drive: a positioning axis needs the encoder of {axis.drive!r} at its station: "
                    f'counters = ["{axis.drive}.encoder"]'
                )

    def _station(self, where: str, station: StationTable) -> None:
        for channels, wires in station.wires.items():
            for number, wire in enumerate(wires):
                if not wire:
                    continue
                place = f"{where}.{channels}[{number}]"
                name, _, terminal = wire.partition(".")
                allowed = self._config.drive[name].terminals.get(channels, ())
                if terminal not in allowed:
                    text = ", ".join(f"{name}.{one}" for one in allowed) or "nothing of this drive"
                    raise ValueError(f"{place}: {wire!r} is no terminal for it; allowed: {text}")
                owner = self._wired.setdefault(wire, place)
                if owner != place:
                    raise ValueError(f"{place}: {wire!r} is wired to {owner} already")
        segment = self._config.segment[station.segment]
        if isinstance(segment, RtuTable):
            _take(self._units, (station.segment, station.unit), where, f"unit: {station.unit}")
        if isinstance(segment, TcpTable) and self._config.bench.live:
            self._take_address(where, station.address(segment))
        else:
            _refuse_address(where, station, "a station")
        for channels, wires in station.wires.items():
            for number, wire in enumerate(wires):
                drive = self._config.drive.get(wire.partition(".")[0])
                if drive is not None and drive.device == "physical":
                    raise ValueError(
                        f"{where}.{channels}[{number}]: {wire!r} is a terminal of a physical drive; an "
                        "emulated station has emulated drives at its wires"
                    )

    def _analog(self, name: str, drive: AnalogDriveTable) -> None:
        where, config = f"drive.{name}", self._config
        station = drive.station(name, config.station)
        if station is None:
            if any(one.startswith("station.") for one in self._mistakes.tables):
                raise _OfWrongTable
            raise ValueError(
                f"{where}: its setpoint is wired to no station; one needs analog_outputs = "
                f'["{name}.setpoint"]'
            )
        segment = config.station[station].segment
        if drive.segment != segment:
            raise ValueError(
                f"{where}.segment: {drive.segment!r} is not the segment of station.{station}; allowed: "
                f"{segment}"
            )
        for key, other in config.station.items():
            for channels, wires in other.wires.items():
                if key != station and any(wire.startswith(f"{name}.") for wire in wires):
                    raise ValueError(
                        f"station.{key}.{channels}: {name!r} is wired to station.{station}; all its wires "
                        "go there"
                    )

    def _take_address(self, where: str, address: tuple[str, int]) -> bool:
        """Note the address of a server; return whether it has a port of its own."""
        host, port = address
        if port:
            _take(self._addresses, (host, port), where, f"port: {host}:{port}")
        return bool(port)

    def _no_modbus(self, where: str, name: str) -> None:
        segment = self._config.segment[name]
        if segment.on_modbus:
            raise ValueError(
                f'{where}.segment: {name!r} is of kind = "{segment.kind}"; needs one of kind = "can"'
            )

    def _on_modbus(self, where: str, drive: ProfidriveModbusTable) -> None:
        segment = self._config.segment[drive.segment]
        if isinstance(segment, TcpTable) and self._config.bench.live:
            if not self._take_address(where, drive.address(segment)) and drive.device == "physical":
                raise ValueError(f"{where}.port: the key is missing; it is a physical drive")
            return
        _refuse_address(where, drive, "a drive")
        if isinstance(segment, RtuTable):
            self._line_end(where, drive, segment)
            _take(self._units, (drive.segment, drive.unit), where, f"unit: {drive.unit}")

    def _line_end(self, where: str, drive: ProfidriveModbusTable, line: RtuTable) -> None:
        if not self._config.bench.live:
            return
        if drive.device == "physical" and line.path is None:
            raise ValueError(f"segment.{drive.segment}.path: the key is missing; {where} is a physical drive")
        if drive.device == "emulated" and line.path is not None:
            raise ValueError(
                f"segment.{drive.segment}.path: {where} is emulated: it comes with a pseudo-terminal of its "
                'own; leave the key out, or set device = "physical"'
            )

    def _line(self, name: str, line: RtuTable) -> None:
        """Refuse a line on which the requests of a cycle take longer than the cycle."""
        config = self._config
        led = {axis.drive for axis in config.axis.values()}
        drives = [drive for key, drive in config.modbus_drives if drive.segment == name and key in led]
        needed_ms = sum(drive.cycle_time_ns(line) for drive in drives) / 1e6
        if needed_ms > config.bench.cycle_ms:
            raise ValueError(
                f"segment.{name}.baud: at {line.baud} the requests of every bus cycle take {needed_ms:.1f} "
                f"ms, longer than bench.cycle_ms = {config.bench.cycle_ms}"
            )

    def _encoder(self, where: str, encoder: EncoderTable) -> None:
        self._no_modbus(where, encoder.segment)
        if encoder.device == "physical" and not self._config.bench.live:
            raise ValueError(
                f'{where}: a virtual bench cannot hold a physical encoder; set bench.kind = "live"'
            )
        if encoder.on is None:
            return
        drive = self._config.drive[encoder.on]
        if drive.machine is None:
            raise ValueError(f"{where}.on: {encoder.on!r} moves no machine that an encoder could sit on")
        if encoder.device == "emulated" and drive.device == "physical":
            raise ValueError(f"{where}.on: {encoder.on!r} is physical; an emulated encoder cannot sit on it")

    def _external_encoder(self, name: str, encoder: str) -> None:
        """Check what an external encoder says of an encoder (CFG-176)."""
        if not self._config.leads(self._config.encoder[encoder].segment):
            self._skip_if_an_axis_is_wrong()
            raise ValueError(
                f"external_encoder.{name}.encoder: {encoder!r} is on a segment where the bench is not the "
                "controller"
            )


def _check_contents(config: BenchConfig, mistakes: _Mistakes) -> None:
    """Read the EDS files, and put the start values of the axes together."""
    wrong = frozenset(mistakes.tables)
    for name, node in config.nodes.items():
        own_eds = isinstance(node, (Cia402DriveTable, DeviceTable)) and node.eds is not None
        if own_eds and config.place_of(name) not in wrong:
            mistakes.of(config.place_of(name), partial(_read, config.place_of(name), node.dictionary))
    for name, nc_axis in config.nc_axes.items():
        if not {f"axis.{name}", f"drive.{nc_axis.drive}"} & wrong:
            read = partial(nc_axis.parameters_of, config.drive.get(nc_axis.drive))
            mistakes.of(f"axis.{name}", partial(_read, f"axis.{name}", read))
    for name, axis in config.s7_axes.items():
        parts = {f"axis.{name}", f"drive.{axis.drive}", *(f"encoder.{one}" for one in axis.encoders or ())}
        if not parts & wrong:
            mistakes.of(f"axis.{name}", partial(_read, f"axis.{name}", partial(config.variables_of, name)))


def _read(where: str, read: Callable[[], object]) -> None:
    with located(where):
        read()


def _refuse_address(where: str, table: ProfidriveModbusTable | StationTable, what: str) -> None:
    for key in ("host", "port"):
        if getattr(table, key) is not None:
            raise ValueError(f"{where}.{key}: only {what} on a live network has one")


def _take(owners: dict[tuple[str, int], str], place: tuple[str, int], where: str, text: str) -> None:
    other = owners.setdefault(place, where)
    if other != where:
        raise ValueError(f"{where}.{text} is already taken by {other}")


def _own_file(owners: dict[str, str], where: str, storage: str | None) -> None:
    if storage is not None and owners.setdefault(storage, where) != where:
        raise ValueError(f"{where}.storage: {storage!r} is already the file of {owners[storage]}")
