"""`hil emulate`: the drives of a bench on a live bus."""

from __future__ import annotations

import math
import os
import signal
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import ConfigurationError
from hil._commands.terminal import console
from hil._interrupt import note
from hil.bench import BenchFile
from hil.bench.drive_config import AnalogDriveTable, ProfidriveModbusTable
from hil.bench.segment_config import RESERVED_OPTIONS, CanTable, RtuTable, TcpTable
from hil.campaign import load_bench_file
from hil.errors import CannotRunError
from hil.faults import Injector, fault_from_text

if TYPE_CHECKING:
    from fieldbus.history import Event
    from hil.bench.config import BenchConfig
    from hil.bench.device_config import DeviceTable
    from hil.bench.drive_config import CanDriveTable
    from hil.bench.drive_host import DriveHost
    from hil.bench.encoder_config import EncoderTable

_BOOT_TIMEOUT_S: Final = 10.0
_SLICE_S: Final = 0.2
"""How long the scheduler runs until it is asked again: a signal does not wake it."""

_OWN_FRAMES: Final = (
    'programs with python-can join by interface="hil_multicast"; by "udp_multicast" they hear their own '
    "frames, which a CANopen master takes for those of others"
)
_LAST_PORT: Final = 65535
_TOLD: Final = (
    "drive.nmt",
    "drive.state",
    "drive.fault",
    "drive.fault_cleared",
    "drive.connection_lost",
    "drive.communication_lost",
    "fault.applied",
    "fault.removed",
    "can.status",
    "adapter.state",
    "adapter.overrun",
    "encoder.alarm",
    "encoder.warning",
    "encoder.error",
    "encoder.preset",
)
"""Events that are printed."""


@dataclass(frozen=True)
class Place:
    """Where the drives go, as the user says it; empty is for not said."""

    interface: str = ""
    channel: str = ""
    options: tuple[str, ...] = ()
    """KEY=VALUE each."""
    host: str = ""
    """Address at which drives with Modbus TCP are served."""
    port: int = 0
    """TCP port of the first of them; the next ones follow."""

    @property
    def said(self) -> bool:
        """Whether any of it is."""
        return bool(self.interface or self.channel or self.options)


def emulate_bench(
    reference: str,
    place: Place,
    *,
    adapter: str = "",
    link: str = "",
    faults: Sequence[str] = (),
    seed: int,
    duration_s: float,
) -> int:
    """Run the emulated drives until Ctrl-C, SIGTERM or the end of `duration_s`; returns the exit code.

    What is of interest goes to standard error, a line each; the line that begins with "ready" comes when the
    drives are on the bus.

    Args:
        reference: Bench file or embedded name; a live bench or a virtual one.
        place: The bus for all segments; without one that of a live bench file, else SocketCAN vcan0.
        adapter: "slcan": an emulated serial-line adapter is on the bus too, and the bus, if none is
            named, exists in this process only.
        link: Symbolic link to make to the adapter's device file, or to that of the first drive on a
            Modbus line; one that is there already is replaced.
        faults: Faults as of `hil.faults.fault_from_text`, armed when the drives are on the bus.
        seed: Seed of the drives' random streams.
        duration_s: 0: until the end is asked for.

    Raises:
        CannotRunError: The bench has no emulated drive, or drives that cannot share one bus; or no
            pseudo-terminal or link can be made.
        ConfigurationError: The bench file, an option, a fault or the duration is wrong.
        UnsupportedFaultError: A fault is not possible here; the message says why.
        BusError: The bus cannot be opened.

    """
    if not 0.0 <= duration_s < math.inf:
        raise ConfigurationError("--for", duration_s, "a number of seconds, 0 or more")
    if adapter not in ("", "slcan"):
        raise ConfigurationError("--adapter", adapter, "slcan")
    wanted = [fault_from_text(text, where="--fault") for text in faults]
    config = _served_at(config_of(reference), place)
    emulated = {name: config.devices[name] for name in config.emulated_names}
    if not emulated:
        raise CannotRunError(f"the bench {config.bench.name!r} has no emulated drive")
    on_can = {name: one for name, one in config.nodes.items() if name in emulated}
    if not on_can and (place.said or adapter):
        raise ConfigurationError(
            "--adapter" if adapter else "--interface", adapter or place.interface, "for drives on CAN only"
        )
    servers = {name: one for name, one in emulated.items() if not isinstance(one, AnalogDriveTable)}
    lines = [
        name
        for name, one in (*servers.items(), *config.station.items())
        if isinstance(config.segment[one.segment], RtuTable)
    ]
    if link and not adapter and not lines:
        raise ConfigurationError(
            "--link", link, "a path, together with --adapter or a drive on a Modbus line"
        )
    opening = _opening(place, live=config.bench.kind == "live", adapter=adapter)
    if opening is not None:
        _check_nodes(on_can, f"{opening['interface']} {opening['channel']}")
    ended = False

    def end(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - signature of a signal handler
        nonlocal ended
        ended = True
        note()

    handlers = {number: signal.signal(number, end) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        from hil.bench.drive_host import DriveHost
        from hil.bench.hosted import HostedBench

        host = DriveHost(config, place=opening, seed=seed, record=False)
        with ExitStack() as stack:
            stack.callback(host.close)
            device = _bring_adapter(host, config, link, stack) if adapter else ""
            if link and not adapter:
                _make_link(link, str(host.places[lines[0]]), stack)
            host.run_until(lambda: ended or host.booted, _BOOT_TIMEOUT_S)
            out = console()
            for name, section in emulated.items():
                out.print(_presentation(config, host, opening, name, section), markup=False, soft_wrap=True)
                for text in _notes_on_eds(host, name):
                    out.print(f"  EDS of {name}: {text}", style="dim", markup=False, soft_wrap=True)
            for name, station in config.station.items():
                where = _modbus_place(host, name, station.unit)
                out.print(f"{name}: I/O station, {where}", markup=False, soft_wrap=True)
            buses = [side.bus for one in host.segments.values() for side in one.sides]
            if any(str(bus.channel_info).startswith("udp_multicast") for bus in buses):
                out.print(_OWN_FRAMES, style="dim", markup=False, soft_wrap=True)
            if device:
                out.print(f"adapter: {adapter} on {device}", markup=False, soft_wrap=True)
            injector = Injector(HostedBench(config, host, seed=seed))
            stack.callback(host.history.listen(_tell))
            for fault in wanted:
                injector.arm(fault)
            out.print("ready; end with Ctrl-C", style="dim", markup=False)
            left_s = duration_s or math.inf
            while left_s > 0.0 and not ended:
                host.run_until(lambda: ended, min(left_s, _SLICE_S))
                left_s -= _SLICE_S
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    return 0


def _notes_on_eds(host: DriveHost, name: str) -> tuple[str, ...]:
    """Return what the EDS of a device says otherwise than the standards, and how it was taken."""
    from emulators.drive.cia402 import CiA402Drive
    from emulators.encoder.cia406 import CiA406Encoder

    part = host.devices.find(name)
    return part.node.notes if isinstance(part, (CiA402Drive, CiA406Encoder)) else ()


def _served_at(config: BenchConfig, place: Place) -> BenchConfig:
    """Return the bench file with its emulated drives on Modbus TCP at the place that was asked for.

    Raises:
        ConfigurationError: There is no such drive, or there are not so many ports.

    """
    if not place.host and not place.port:
        return config
    drives = dict(config.drive)
    names = [
        name
        for name, drive in drives.items()
        if isinstance(drive, ProfidriveModbusTable)
        and drive.device == "emulated"
        and isinstance(config.segment[drive.segment], TcpTable)
    ]
    names += [
        name for name, one in config.station.items() if isinstance(config.segment[one.segment], TcpTable)
    ]
    stations = dict(config.station)
    if not names:
        option, value = ("--port", place.port) if place.port else ("--host", place.host)
        raise ConfigurationError(option, value, "for drives on Modbus TCP only")
    if place.port and place.port + len(names) - 1 > _LAST_PORT:
        raise ConfigurationError("--port", place.port, f"at most {_LAST_PORT - len(names) + 1}")
    for number, name in enumerate(names):
        changes: dict[str, object] = {"host": place.host} if place.host else {}
        if place.port:
            changes["port"] = place.port + number
        if name in stations:
            stations[name] = stations[name].model_copy(update=changes)
        else:
            drives[name] = drives[name].model_copy(update=changes)
    return config.model_copy(update={"drive": drives, "station": stations})


def _presentation(
    config: BenchConfig, host: DriveHost, opening: Mapping[str, Any] | None, name: str, section: Any
) -> str:
    """Return what a device is and where."""
    segment = config.segment[section.segment]
    if isinstance(segment, CanTable):
        opened = opening or segment.opening_for_drives()
        where = f"{opened['interface']} {opened['channel']}"
        if opened["interface"] == "udp_multicast":
            where = host.segments[section.segment].sides[0].bus.channel_info
        return f"{name}: {section.profile}, node {section.node_id}, on {where}"
    if isinstance(section, AnalogDriveTable):
        return f"{name}: {section.profile}, at {section.station(name, config.station)}"
    return f"{name}: {section.profile}, {_modbus_place(host, name, section.unit, any_unit=True)}"


def _modbus_place(host: DriveHost, name: str, unit: int, *, any_unit: bool = False) -> str:
    """Return unit and place of a server."""
    place = host.places[name]
    if isinstance(place, str):
        return f"unit {unit}, Modbus RTU on {place}"
    host_name = f"[{place[0]}]" if ":" in place[0] else place[0]
    shown = "any unit" if any_unit else f"unit {unit}"
    return f"{shown}, Modbus TCP on {host_name}:{place[1]}"


def _opening(place: Place, *, live: bool, adapter: str) -> dict[str, Any] | None:
    """Return the arguments that open the one bus for all segments; None: every segment has its own.

    Raises:
        ConfigurationError: An option is no KEY=VALUE, or there is no interface for it.

    """
    options: dict[str, Any] = {}
    for text in place.options:
        key, sign, value = text.partition("=")
        if not sign or not key.isidentifier() or key in RESERVED_OPTIONS:
            raise ConfigurationError(
                "--option", text, "KEY=VALUE with the name of an option of the interface"
            )
        options[key] = _value(value)
    if not place.interface and not place.channel:
        if options:
            raise ConfigurationError("--option", place.options[0], "together with --interface or --channel")
        if adapter:
            return {"interface": "virtual", "channel": f"adapter of {os.getpid()}"}
        if live:
            return None
    return {"interface": place.interface or "socketcan", "channel": place.channel or "vcan0", **options}


def _value(text: str) -> bool | int | float | str:
    """Return an option's value as TOML would: true, false, a number, or else text."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def _bring_adapter(host: DriveHost, config: BenchConfig, link: str, stack: ExitStack) -> str:
    """Put an adapter on the bus and return its device file, or the link to it.

    Raises:
        CannotRunError: No pseudo-terminal is left, or the link cannot be made.

    """
    from emulators.adapter import SlcanDevice

    name, segment = next(iter(host.segments.items()))
    try:
        table = config.segment[name]
        assert isinstance(table, CanTable)  # drives on Modbus take no adapter
        device = SlcanDevice(segment, bitrate=table.bitrate, history=host.history)
        stack.callback(device.close)
    except OSError as error:
        raise CannotRunError(f"--adapter: {error.strerror or error}") from error
    if link:
        _make_link(link, device.path, stack)
    return link or device.path


def _make_link(link: str, target: str, stack: ExitStack) -> None:
    """Make a symbolic link for as long as the drives are there.

    Raises:
        CannotRunError: It cannot be made.

    """
    path = Path(link)
    try:
        if path.is_symlink():
            path.unlink()
        path.symlink_to(target)
    except OSError as error:
        raise CannotRunError(f"--link {link}: {error.strerror or error}") from error
    stack.callback(path.unlink, missing_ok=True)


def config_of(reference: str) -> BenchConfig:
    """Return the description of the bench.

    Raises:
        CannotRunError: It has none that could be read: it is somebody's Python object.

    """
    bench_file = load_bench_file(reference)
    if not isinstance(bench_file, BenchFile):
        raise CannotRunError(
            f"the bench {bench_file.name!r} is no bench file: its drives cannot be emulated alone"
        )
    return bench_file.config


def _check_nodes(drives: Mapping[str, CanDriveTable | EncoderTable | DeviceTable], where: str) -> None:
    """Refuse devices of different segments that would have the same node-ID on the one bus."""
    owners: dict[int, str] = {}
    for name, section in drives.items():
        other = owners.setdefault(section.node_id, name)
        if other != name:
            raise CannotRunError(
                f"{other} and {name} are both node {section.node_id}: on different segments of the bench "
                f"they may be, "
                f"but {where} is one bus"
            )


def _tell(event: Event) -> None:
    if event.kind not in _TOLD:
        return
    data = dict(event.data)
    code = data.get("code")
    if isinstance(code, int):
        data["code"] = f"{code:04X}h"
    change = f"{data.pop('from')} -> {data.pop('to')}" if "from" in data else ""
    rest = ", ".join(f"{key} {value}" for key, value in data.items() if value not in ("", None))
    text = ", ".join(part for part in (change, rest) if part)
    sys.stderr.write(f"{event.time_ns * 1e-9:10.3f} s  {event.source}  {event.kind}  {text}\n")
