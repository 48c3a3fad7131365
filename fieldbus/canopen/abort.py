"""SDO abort codes (CiA 301; C301-077 to C301-107)."""

from __future__ import annotations

from enum import IntEnum
from typing import Final

from fieldbus.errors import HilError


class AbortCode(IntEnum):
    """Why a service data transfer was refused or broken off."""

    TOGGLE = 0x05030000
    TIMEOUT = 0x05040000
    COMMAND = 0x05040001
    BLOCK_SIZE = 0x05040002
    SEQUENCE = 0x05040003
    CRC = 0x05040004
    MEMORY = 0x05040005
    ACCESS = 0x06010000
    WRITE_ONLY = 0x06010001
    READ_ONLY = 0x06010002
    NO_OBJECT = 0x06020000
    NOT_MAPPABLE = 0x06040041
    PDO_LENGTH = 0x06040042
    PARAMETER = 0x06040043
    INTERNAL = 0x06040047
    HARDWARE = 0x06060000
    LENGTH = 0x06070010
    TOO_LONG = 0x06070012
    TOO_SHORT = 0x06070013
    NO_SUB_INDEX = 0x06090011
    VALUE = 0x06090030
    VALUE_HIGH = 0x06090031
    VALUE_LOW = 0x06090032
    MAXIMUM_BELOW_MINIMUM = 0x06090036
    NO_RESOURCE = 0x060A0023
    GENERAL = 0x08000000
    CANNOT_STORE = 0x08000020
    LOCAL_CONTROL = 0x08000021
    DEVICE_STATE = 0x08000022
    NO_DICTIONARY = 0x08000023
    NO_DATA = 0x08000024


ABORT_TEXTS: Final[dict[int, str]] = {
    AbortCode.TOGGLE: "toggle bit not alternated",
    AbortCode.TIMEOUT: "transfer timed out",
    AbortCode.COMMAND: "unknown or unexpected command",
    AbortCode.BLOCK_SIZE: "block size invalid",
    AbortCode.SEQUENCE: "block sequence number invalid",
    AbortCode.CRC: "CRC error",
    AbortCode.MEMORY: "out of memory",
    AbortCode.ACCESS: "access not supported",
    AbortCode.WRITE_ONLY: "write-only",
    AbortCode.READ_ONLY: "read-only",
    AbortCode.NO_OBJECT: "object does not exist",
    AbortCode.NOT_MAPPABLE: "not mappable into this PDO",
    AbortCode.PDO_LENGTH: "mapping exceeds the PDO",
    AbortCode.PARAMETER: "parameters incompatible",
    AbortCode.INTERNAL: "internal incompatibility",
    AbortCode.HARDWARE: "hardware error",
    AbortCode.LENGTH: "length does not match the object",
    AbortCode.TOO_LONG: "too many bytes",
    AbortCode.TOO_SHORT: "too few bytes",
    AbortCode.NO_SUB_INDEX: "sub-index does not exist",
    AbortCode.VALUE: "value not allowed",
    AbortCode.VALUE_HIGH: "value too high",
    AbortCode.VALUE_LOW: "value too low",
    AbortCode.MAXIMUM_BELOW_MINIMUM: "maximum below minimum",
    AbortCode.NO_RESOURCE: "resource not available",
    AbortCode.GENERAL: "general error",
    AbortCode.CANNOT_STORE: "cannot be transferred or stored",
    AbortCode.LOCAL_CONTROL: "refused, local control",
    AbortCode.DEVICE_STATE: "refused in the present device state",
    AbortCode.NO_DICTIONARY: "no object dictionary",
    AbortCode.NO_DATA: "no data available",
}
"""Short text of every abort code, for messages and decoders."""


class SdoAbort(HilError):  # noqa: N818 - "abort" is the service's own name
    """A read or write is refused with an abort code.

    Device code raises it in `on_read` and `on_write` callbacks.

    Args:
        code: Abort code, 32 bits; one of `AbortCode` or a manufacturer's own.

    """

    def __init__(self, code: int) -> None:
        super().__init__(f"{code:08X}h {ABORT_TEXTS.get(code, 'unknown abort code')}")
        self.code = int(code)
