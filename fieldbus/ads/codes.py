"""Numbers of ADS: commands, index groups, data types, transmission modes, error codes, states.

From the public description of the protocol (Beckhoff Information System, "ADS/AMS specification").
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import Final, NamedTuple

TCP_PORT: Final = 48898
"""TCP port of AMS/TCP."""
PLC_PORT: Final = 851
"""AMS port of the first PLC."""
NC_PORT: Final = 501
"""AMS port of the SAF task of the NC."""
SYSTEM_PORT: Final = 10_000
"""AMS port of the system service."""


class Command(IntEnum):
    """Command of a frame."""

    READ_DEVICE_INFO = 1
    READ = 2
    WRITE = 3
    READ_STATE = 4
    WRITE_CONTROL = 5
    ADD_NOTIFICATION = 6
    DELETE_NOTIFICATION = 7
    NOTIFICATION = 8
    READ_WRITE = 9


class Group(IntEnum):
    """Index groups that every ADS device has."""

    PLC_DATA = 0x4040
    SYMBOL_HANDLE_BY_NAME = 0xF003
    SYMBOL_VALUE_BY_NAME = 0xF004
    SYMBOL_VALUE_BY_HANDLE = 0xF005
    SYMBOL_RELEASE_HANDLE = 0xF006
    SYMBOL_INFO_BY_NAME = 0xF007
    SYMBOL_VERSION = 0xF008
    SYMBOL_INFO_BY_NAME_EX = 0xF009
    SYMBOL_UPLOAD = 0xF00B
    SYMBOL_UPLOAD_INFO = 0xF00C
    DATA_TYPE_UPLOAD = 0xF00E
    SYMBOL_UPLOAD_INFO_2 = 0xF00F
    DATA_TYPE_INFO_BY_NAME_EX = 0xF011
    SUM_READ = 0xF080
    SUM_WRITE = 0xF081
    SUM_READ_WRITE = 0xF082
    SUM_READ_EX = 0xF083
    SUM_READ_EX_2 = 0xF084
    SUM_ADD_NOTIFICATION = 0xF085
    SUM_DELETE_NOTIFICATION = 0xF086
    DEVICE_DATA = 0xF100


class AdsError(IntEnum):
    """Error codes of answers; the first ones are those of the router."""

    NONE = 0
    PORT_NOT_FOUND = 0x6
    MACHINE_NOT_FOUND = 0x7
    UNKNOWN_COMMAND = 0x8
    SERVICE_NOT_SUPPORTED = 0x701
    INVALID_GROUP = 0x702
    INVALID_OFFSET = 0x703
    INVALID_ACCESS = 0x704
    INVALID_SIZE = 0x705
    INVALID_DATA = 0x706
    NO_MEMORY = 0x70A
    SYMBOL_NOT_FOUND = 0x710
    INVALID_STATE = 0x712
    MODE_NOT_SUPPORTED = 0x713
    NOTIFICATION_HANDLE_INVALID = 0x714
    NO_MORE_HANDLES = 0x716


class AdsState(IntEnum):
    """State of an ADS device."""

    RESET = 2
    RUN = 5
    STOP = 6


class TransMode(IntEnum):
    """When a notification is sent."""

    CYCLIC = 3
    ON_CHANGE = 4


class DataType(NamedTuple):
    """A type of a value on the wire."""

    number: int
    """`ADST_...`."""
    format: str
    """Of `struct`, without the byte order."""


TYPES: Final[Mapping[str, DataType]] = {
    "BOOL": DataType(33, "?"),
    "BYTE": DataType(17, "B"),
    "USINT": DataType(17, "B"),
    "UINT": DataType(18, "H"),
    "WORD": DataType(18, "H"),
    "INT": DataType(2, "h"),
    "DINT": DataType(3, "i"),
    "UDINT": DataType(19, "I"),
    "DWORD": DataType(19, "I"),
    "LREAL": DataType(5, "d"),
}
"""Types of IEC 61131-3 that symbols have."""
BIG: Final = 65
"""Number of the type of a structure."""
TEXT: Final = 30
"""Number of the type of a text."""
