"""What a bench file says of drives on Modbus: the checks, and the requests that carry a drive's telegram."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from fieldbus.modbus import MapFile, ProcessDataRegisters
    from hil.bench.config import BenchConfig
    from hil.bench.drive_config import DriveSection
    from hil.bench.segment_config import SegmentSection

CAN_KEYS: Final = (
    "node_id", "storage", "heartbeat_ms", "consumer_heartbeat_ms", "guard_time_ms", "life_time_factor",
    "vendor_id", "product_code", "revision", "serial", "store_parameters",
)  # fmt: skip
"""Keys of a drive that a drive on Modbus does not have."""
MODBUS_KEYS: Final = ("unit", "map", "host", "port", "processing_ms")
"""Keys of a drive that a drive on CAN does not have."""

_UNITS: Final = {"modbus_tcp": (0, 255), "modbus_rtu": (1, 247)}
_HEAD_AND_TAIL: Final = {"write": (9, 8), "read": (8, 5), "exchange": (13, 5)}
"""Characters of request and response beside the registers, on a serial line (MODB-011)."""
_RECORD_BYTES: Final = 14
"""Registers of a request for one parameter, with the header of data record 47."""


def map_file(drive: DriveSection) -> MapFile:
    """Return the register map of a drive on Modbus."""
    from fieldbus.modbus import load_map

    return load_map(drive.map)


def registers_of(drive: DriveSection) -> ProcessDataRegisters:
    """Return the requests for the telegram of a drive on Modbus.

    Raises:
        ConfigurationError: The map cannot be used, or does not carry the telegram.

    """
    from fieldbus.modbus import process_data

    words, name = drive.words()
    return process_data(map_file(drive), words, name=f"telegram {name}")


def address_of(drive: DriveSection, segment: SegmentSection) -> tuple[str, int]:
    """Return host and port of a drive on a live network."""
    return drive.host or segment.host, segment.port if drive.port is None else drive.port


def combines(drive: DriveSection, segment: SegmentSection) -> bool:
    """Say whether one request writes and reads: on a serial line, where the map allows it, because it takes
    less time.
    """
    return segment.kind == "modbus_rtu" and registers_of(drive).combined


def check_modbus(config: BenchConfig) -> None:
    """Check what stands on Modbus segments, and what of Modbus stands elsewhere.

    Raises:
        ValueError: With the place, the value and what is allowed.

    """
    others: dict[str, dict[str, Any]] = {"encoder": config.encoder, "device": config.device}
    for table, sections in others.items():
        for name, section in sections.items():
            segment = config.segment.get(section.segment)
            if segment is not None and segment.on_modbus:
                raise ValueError(
                    f'{table}.{name}.segment: {section.segment!r} is of kind = "{segment.kind}"; needs one '
                    f'of kind = "can"'
                )
    owners: dict[tuple[Any, ...], str] = {}
    for name, drive in config.drive.items():
        segment = config.segment[drive.segment]
        where = f"drive.{name}"
        if drive.profile == "analog":
            continue  # its station is on the bus
        if segment.on_modbus:
            _check_drive(where, drive, segment)
            _check_place(where, drive, segment, owners, live=config.bench.kind == "live")
        else:
            _check_can_drive(where, drive)
    for name, axis in config.axis.items():
        drive = config.drive[axis.drive]
        if drive.profile != "analog" and config.segment[drive.segment].on_modbus:
            _check_axis(f"axis.{name}.variables", axis.variables, axis.drive, drive)
    for name, segment in config.segment.items():
        if segment.kind == "modbus_rtu":
            _check_line(config, name, segment)


def _check_can_drive(where: str, drive: DriveSection) -> None:
    if not drive.node_id:
        given = "node_id" in drive.model_fields_set
        text = "0 is not allowed; allowed: 1..126" if given else "the key is missing"
        raise ValueError(f"{where}.node_id: {text}")
    for key in MODBUS_KEYS:
        if drive.differs(key):
            raise ValueError(f'{where}.{key}: a drive on a segment of kind = "can" has none')
    if drive.profile == "profidrive":
        try:
            drive.check_on_can()
        except ValueError as error:
            raise ValueError(f"{where}.{error}") from None


def _check_drive(where: str, drive: DriveSection, segment: SegmentSection) -> None:
    if drive.profile != "profidrive":
        raise ValueError(
            f'{where}.profile: "{drive.profile}" is not spoken on {drive.segment!r}, which is of kind = '
            f'"{segment.kind}"; '
            'allowed: profile = "profidrive"'
        )
    for key in CAN_KEYS:
        if drive.differs(key):
            raise ValueError(f'{where}.{key}: a drive on a segment of kind = "{segment.kind}" has none')
    low, high = _UNITS[segment.kind]
    if not low <= drive.unit <= high:
        raise ValueError(f"{where}.unit: {drive.unit} is not allowed; allowed: {low}..{high}")
    try:
        registers_of(drive)
    except ConfigurationError as error:
        raise ValueError(f"{where}.map: {error}") from None


def _check_place(
    where: str,
    drive: DriveSection,
    segment: SegmentSection,
    owners: dict[tuple[Any, ...], str],
    *,
    live: bool,
) -> None:
    if segment.kind == "modbus_rtu" or not live:
        for key in ("host", "port"):
            if drive.differs(key):
                raise ValueError(f"{where}.{key}: only a drive on a live network has one")
    if segment.kind == "modbus_rtu":
        place: tuple[Any, ...] = (drive.segment, drive.unit)
        text = f"unit: {drive.unit}"
        if live and drive.device == "physical" and segment.path is None:
            raise ValueError(f"segment.{drive.segment}.path: the key is missing; {where} is a physical drive")
        if live and drive.device == "emulated" and segment.path is not None:
            raise ValueError(
                f"segment.{drive.segment}.path: {where} is emulated: it comes with a pseudo-terminal of "
                f"its own; "
                'leave the key out, or set device = "physical"'
            )
    elif live:
        host, port = address_of(drive, segment)
        if port == 0:
            if drive.device == "physical":
                raise ValueError(f"{where}.port: the key is missing; it is a physical drive")
            return
        place, text = (host, port), f"port: {host}:{port}"
    else:
        return
    other = owners.setdefault(place, where)
    if other != where:
        raise ValueError(f"{where}.{text} is already taken by {other}")


def _check_axis(where: str, variables: dict[str, Any], name: str, drive: DriveSection) -> None:
    if variables.get("PositionControl.EnableDSC"):
        raise ValueError(
            f"{where}: PositionControl.EnableDSC needs the clock of the bus (PD-198), and {name!r} is on "
            f"Modbus, which has none"
        )
    if variables.get("PositionLimits_HW.Active") and registers_of(drive).inputs is None:
        raise ValueError(
            f"{where}: PositionLimits_HW.Active needs the limit switches, and the map of {name!r} "
            f"({drive.map}) shows no "
            "digital inputs (r0722)"
        )


def cycle_time_ns(drive: DriveSection, segment: SegmentSection) -> int:
    """Return for how long a drive and its controller keep a serial line busy in one bus cycle, ns."""
    registers = registers_of(drive)
    out, back = 2 * registers.words_out, 2 * registers.words_in
    parts = [("exchange", out, back)] if combines(drive, segment) else [("write", out, 0), ("read", 0, back)]
    # One more request per cycle: inputs, the number of a fault, or a part of an access to a parameter.
    more = [("read", 0, 2)] if registers.fault_number is not None else []
    more += [("read", 0, 2 * registers.inputs[1])] if registers.inputs is not None else []
    more += [("write", _RECORD_BYTES, 0)] if registers.parameters is not None else []
    if more:
        parts.append(max(more, key=lambda part: sum(_HEAD_AND_TAIL[part[0]]) + part[1] + part[2]))
    line = segment.serial_format()
    characters = sum(sum(_HEAD_AND_TAIL[kind]) + asked + answered for kind, asked, answered in parts)
    pauses = len(parts) * (2 * line.t35_ns + round(drive.processing_ms * 1e6))
    return line.duration_ns(characters) + pauses


def _check_line(config: BenchConfig, name: str, segment: SegmentSection) -> None:
    """Refuse a line on which the requests of a cycle take longer than the cycle."""
    led = {axis.drive for axis in config.axis.values()}
    drives = [
        one
        for key, one in config.drive.items()
        if one.segment == name and key in led and one.profile != "analog"
    ]
    needed_ms = sum(cycle_time_ns(drive, segment) for drive in drives) / 1e6
    if needed_ms > config.bench.cycle_ms:
        raise ValueError(
            f"segment.{name}.baud: at {segment.baud} the requests of every bus cycle take {needed_ms:.1f} "
            f"ms, longer than "
            f"bench.cycle_ms = {config.bench.cycle_ms}"
        )


def anchor_map(section: dict[str, Any], folder: Path) -> None:
    """Make the name of a register map that is a file relative to the folder of the bench file."""
    value = section.get("map")
    if isinstance(value, str) and value.endswith(".toml"):
        section["map"] = str(folder / value)
