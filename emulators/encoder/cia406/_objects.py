"""The object tables of the emulated encoders: one source for EDS files, dictionaries,
defaults and tests (C402-309).

There are three: rotary encoders, linear encoders, and the linear device with several sensors. What kind of
encoder of a table a device is, its resolution and its range are set by its configuration.
"""

from __future__ import annotations

from typing import Final, Literal

from fieldbus.canopen.communication_objects import PdoDefaults, communication_objects
from fieldbus.canopen.object_table import I16, I32, I64, U8, U16, U32, Item, ObjectRow, array, record, var
from fieldbus.cia406 import OBJECT_NAMES, PROFILE_VERSION, UNSUPPORTED, EncoderType

Family = Literal["rotary", "linear", "multi_sensor"]
FAMILIES: Final[tuple[Family, ...]] = ("rotary", "linear", "multi_sensor")

SENSORS: Final = 2
"""Position channels of the multi-sensor device."""
CAMS: Final = 8
SUPPORTED_ALARMS: Final = 0x0001
"""6504h: position error."""
SUPPORTED_WARNINGS: Final = 0x003F
"""6506h."""

_DEVICES: Final[dict[Family, tuple[EncoderType, str, int]]] = {
    "rotary": (EncoderType.MULTI_TURN, "Emulated rotary encoder CiA 406", 0x406),
    "linear": (EncoderType.ABSOLUTE_LINEAR, "Emulated linear encoder CiA 406", 0x40601),
    "multi_sensor": (EncoderType.MULTI_SENSOR, "Emulated multi-sensor encoder CiA 406", 0x40602),
}
_LOWEST: Final = -0x80000000
_HIGHEST: Final = 0x7FFFFFFF
_CLASS_C3: Final = 3
"""650Eh: scaling, preset, diagnostics, speed, acceleration and jerk."""


def family_of(kind: EncoderType) -> Family:
    """Return the table of an encoder type."""
    if kind is EncoderType.MULTI_SENSOR:
        return "multi_sensor"
    return "linear" if kind.linear else "rotary"


def product(family: Family) -> tuple[str, int]:
    """Return name and product code of a device."""
    return _DEVICES[family][1:]


def channels_of(family: Family) -> int:
    """Return the number of position channels."""
    return SENSORS if family == "multi_sensor" else 1


def all_objects(family: Family) -> tuple[ObjectRow, ...]:
    """Return the whole table in ascending order."""
    kind, name, code = _DEVICES[family]
    position = 0x60200120 if family == "multi_sensor" else 0x60040020
    rows = (
        *communication_objects(
            device_type=kind.device_type,
            device_name=name,
            product_code=code,
            error_classes=("Communication error",),
            tpdos=(
                PdoDefaults(0x180, 254, (position,)),
                PdoDefaults(0x280, 1, (position,)),
                PdoDefaults(0x380, 1, (position, 0x60300110), valid=False),
                PdoDefaults(0x480, 254, (0x63000108, 0x64000108, 0x65030010, 0x65050010), valid=False),
            ),
        ),
        *_position(family),
        *_motion(channels_of(family)),
        *_cams(channels_of(family)),
        *_diagnostics(family),
    )
    return tuple(sorted(rows, key=lambda row: row.index))


def _per_channel(  # noqa: PLR0917 - rows of a table read like the table
    index: int,
    data_type: int,
    access: str,
    pdo: str,
    channels: int,
    default: int = 0,
) -> ObjectRow:
    name = OBJECT_NAMES[index]
    names = tuple(f"{name} channel {number}" for number in range(1, channels + 1))
    return array(index, name, names, data_type, access, pdo, (default,) * channels)


def _named(index: int, data_type: int, access: str = "rw", pdo: str = "-", default: int = 0) -> ObjectRow:
    return var(index, OBJECT_NAMES[index], data_type, access, pdo, default)


def _position(family: Family) -> tuple[ObjectRow, ...]:
    rows = (
        _named(0x6000, U16, default=0x0004),
        _named(0x6002, U32, default=8192 * 4096 if family == "rotary" else 1_000_000),
        _named(0x6003, I32),
        _named(0x6004, I32, "ro", "T"),
        _named(0x6008, I64, "ro", "T"),
        _named(0x6009, I64),
        _named(0x600C, U32, "ro", "T"),
    )
    if family == "rotary":
        return (*rows, _named(0x6001, U32, default=8192))
    steps = record(
        0x6005,
        OBJECT_NAMES[0x6005],
        Item("Position step", U32, "rw", "-", 1000),
        Item("Speed step", U32, "rw", "-", 100),
        Item("Acceleration step", U32, "rw", "-", 1),
        Item("Jerk step", U32, "rw", "-", 1000),
    )
    if family == "linear":
        return (*rows, steps)
    return (
        *rows,
        steps,
        _per_channel(0x6010, I32, "rw", "-", SENSORS),
        _per_channel(0x6020, I32, "ro", "T", SENSORS),
        _per_channel(0x650C, I32, "ro", "-", SENSORS),
    )


def _motion(channels: int) -> tuple[ObjectRow, ...]:
    return (
        _per_channel(0x6030, I16, "ro", "T", channels),
        record(
            0x6031,
            OBJECT_NAMES[0x6031],
            Item("Source", U8, "rw", "-", 0),
            Item("Integration time", U16, "rw", "-", 1),
            Item("Multiplier", U16, "rw", "-", 1),
            Item("Divider", U16, "rw", "-", 1),
        ),
        _per_channel(0x6040, I16, "ro", "T", channels),
        _per_channel(0x6050, I16, "ro", "T", channels),
        var(0x6200, OBJECT_NAMES[0x6200], U16, "rw", "-", 0, volatile=True),
    )


def _cams(channels: int) -> tuple[ObjectRow, ...]:
    return (
        _per_channel(0x6300, U8, "ro", "T", channels),
        _per_channel(0x6301, U8, "rw", "-", channels),
        _per_channel(0x6302, U8, "rw", "-", channels),
        *(_per_channel(0x6310 + cam, I32, "rw", "-", channels) for cam in range(CAMS)),
        *(_per_channel(0x6320 + cam, I32, "rw", "-", channels) for cam in range(CAMS)),
        *(_per_channel(0x6330 + cam, U16, "rw", "-", channels) for cam in range(CAMS)),
        _per_channel(0x6400, U8, "ro", "T", channels),
        _per_channel(0x6401, I32, "rw", "-", channels, _LOWEST),
        _per_channel(0x6402, I32, "rw", "-", channels, _HIGHEST),
    )


def _diagnostics(family: Family) -> tuple[ObjectRow, ...]:
    rotary = family == "rotary"
    turns = (_named(0x6502, U16, "ro", "-", 4096),) if rotary else ()
    return (
        _named(0x6500, U16, "ro", "-", 0x0004),
        _named(0x6501, U32, "ro", "-", 8192 if rotary else 1000),
        *turns,
        _named(0x6503, U16, "ro", "T"),
        _named(0x6504, U16, "ro", "-", SUPPORTED_ALARMS),
        _named(0x6505, U16, "ro", "T"),
        _named(0x6506, U16, "ro", "-", SUPPORTED_WARNINGS),
        _named(0x6507, U32, "ro", "-", 0x0100 << 16 | PROFILE_VERSION),
        _named(0x6508, U32, "ro", "-", 0),
        _named(0x6509, I32, "ro"),
        record(
            0x650A,
            OBJECT_NAMES[0x650A],
            Item("Manufacturer offset value", I32, "ro"),
            Item("Manufacturer minimum position value", I32, "ro"),
            Item("Manufacturer maximum position value", I32, "ro"),
        ),
        _named(0x650B, U32, "ro", "-", UNSUPPORTED),
        _named(0x650D, U8, "ro", "-", 0),
        _named(0x650E, U32, "ro", "-", _CLASS_C3),
    )
