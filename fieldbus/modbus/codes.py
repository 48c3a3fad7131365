"""Function codes, exception codes and the limits of quantities (MODB-012 to MODB-031)."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType
from typing import Final


class Function(IntEnum):
    """Function codes that are served here."""

    READ_COILS = 1
    READ_DISCRETE_INPUTS = 2
    READ_HOLDING_REGISTERS = 3
    READ_INPUT_REGISTERS = 4
    WRITE_SINGLE_COIL = 5
    WRITE_SINGLE_REGISTER = 6
    DIAGNOSTICS = 8
    WRITE_MULTIPLE_COILS = 15
    WRITE_MULTIPLE_REGISTERS = 16
    MASK_WRITE_REGISTER = 22
    READ_WRITE_MULTIPLE_REGISTERS = 23
    ENCAPSULATED_INTERFACE = 43


class ExceptionCode(IntEnum):
    """Exception codes of a response."""

    ILLEGAL_FUNCTION = 0x01
    ILLEGAL_DATA_ADDRESS = 0x02
    ILLEGAL_DATA_VALUE = 0x03
    SERVER_DEVICE_FAILURE = 0x04
    ACKNOWLEDGE = 0x05
    SERVER_DEVICE_BUSY = 0x06
    NEGATIVE_ACKNOWLEDGE = 0x07
    MEMORY_PARITY_ERROR = 0x08
    GATEWAY_PATH_UNAVAILABLE = 0x0A
    GATEWAY_TARGET_FAILED = 0x0B


class Diagnostic(IntEnum):
    """Sub-functions of function 08 that are served (MODB-016)."""

    QUERY_DATA = 0
    RESTART_COMMUNICATIONS = 1
    DIAGNOSTIC_REGISTER = 2
    LISTEN_ONLY = 4
    CLEAR_COUNTERS = 10
    BUS_MESSAGES = 11
    BUS_ERRORS = 12
    EXCEPTIONS = 13
    SERVER_MESSAGES = 14
    NO_RESPONSES = 15
    NEGATIVE_ACKNOWLEDGES = 16
    BUSY = 17
    CHARACTER_OVERRUNS = 18


READ_DEVICE_IDENTIFICATION: Final = 14
"""MEI type of function 43 (MODB-021)."""

LIMITS: Final[Mapping[int, int]] = MappingProxyType(
    {
        Function.READ_COILS: 2000,
        Function.READ_DISCRETE_INPUTS: 2000,
        Function.READ_HOLDING_REGISTERS: 125,
        Function.READ_INPUT_REGISTERS: 125,
        Function.WRITE_MULTIPLE_COILS: 1968,
        Function.WRITE_MULTIPLE_REGISTERS: 123,
        Function.READ_WRITE_MULTIPLE_REGISTERS: 125,
    }
)
"""Largest quantity per function; of function 23 the quantity that is read."""

MOST_WRITTEN_WHEN_READING: Final = 121
"""Largest quantity that function 23 writes (MODB-020)."""

WRITING: Final = frozenset(
    {
        Function.WRITE_SINGLE_COIL,
        Function.WRITE_SINGLE_REGISTER,
        Function.WRITE_MULTIPLE_COILS,
        Function.WRITE_MULTIPLE_REGISTERS,
    }
)
"""Functions that are carried out when they come as a broadcast (MODB-035)."""

LONGEST_PDU: Final = 253
BROADCAST: Final = 0
"""Unit of a broadcast on a serial line (MODB-007)."""
EXCEPTION_BIT: Final = 0x80

_TEXTS: Final = {
    0x01: "illegal function",
    0x02: "illegal data address",
    0x03: "illegal data value",
    0x04: "server device failure",
    0x05: "acknowledge",
    0x06: "server device busy",
    0x07: "negative acknowledge",
    0x08: "memory parity error",
    0x0A: "gateway path unavailable",
    0x0B: "gateway target failed to respond",
}


def exception_text(code: int) -> str:
    """Return an exception code in words, `02h illegal data address`."""
    return f"{code:02X}h {_TEXTS.get(code, 'unknown exception')}"


def function_text(code: int) -> str:
    """Return a function code in words, `03 read holding registers`."""
    try:
        name = Function(code).name.lower().replace("_", " ")
    except ValueError:
        name = "unknown function"
    return f"{code:02d} {name}"
