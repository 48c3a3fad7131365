"""Manufacturer objects 2100h to 2109h: warnings, heat, supply, fault history, safety (C402-041, C402-160)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from emulators.drive.cia402.config import DriveConfig
from emulators.drive.cia402.faults.log import CAPACITY, FaultLog
from emulators.drive.cia402.protection import Protection
from emulators.drive.cia402.safety import SafetyFunctions
from fieldbus.canopen.abort import AbortCode, SdoAbort
from fieldbus.canopen.object_table import (
    I16,
    STRING,
    U8,
    U16,
    U32,
    Item,
    ObjectRow,
    array,
    record,
    var,
)


def protection_objects() -> tuple[ObjectRow, ...]:
    """Return the rows."""
    names = tuple(f"Fault {number}" for number in range(1, CAPACITY + 1))
    return (
        var(0x2100, "Warnings", U32, "ro", "T"),
        record(
            0x2101,
            "Temperatures",
            Item("Motor, 0.1 degC", I16, "ro", "T"),
            Item("Power stage, 0.1 degC", I16, "ro", "T"),
        ),
        record(
            0x2102,
            "Utilisation",
            Item("Motor i2t, permille", U16, "ro", "T"),
            Item("Power stage i2t, permille", U16, "ro", "T"),
            Item("Brake resistor, permille", U16, "ro", "T"),
            Item("Torque limit, permille of rated torque", U16, "ro", "T", 0xFFFF),
        ),
        record(
            0x2103,
            "Supply",
            Item("Mains: bit 0 missing, bit 1 phase missing", U8, "ro", "T"),
            Item("Power in the brake resistor, W", U32, "ro", "T"),
        ),
        array(0x2104, "Fault history", names, U32, "ro", "-"),
        array(0x2105, "Fault history, operating time in ms", names, U32, "ro", "-"),
        var(0x2106, "Operating time, ms", U32, "ro", "T"),
        var(0x2107, "Clear fault history", U8, "wo", "-", volatile=True),
        var(0x2108, "Safety functions", U8, "ro", "T"),
        var(0x2109, "Personality", STRING, "ro", "-", "standard"),
    )


def protection_readers(
    config: DriveConfig, protection: Protection, safety: SafetyFunctions, log: FaultLog
) -> dict[int, Callable[[], int | str]]:
    """Return what is read live, by key."""
    link = protection.dc_link
    rated = config.rated_torque_nm
    readers: dict[int, Callable[[], int | str]] = {
        0x210101: lambda: round(protection.motor.temperature_C * 10.0),
        0x210102: lambda: round(protection.stage.temperature_C * 10.0),
        0x210201: lambda: _permille(protection.motor_overload.utilisation),
        0x210202: lambda: _permille(protection.stage_overload.utilisation),
        0x210203: lambda: _permille(link.chopper_load),
        0x210204: lambda: 0xFFFF if not protection.derated else _permille(protection.cap_Nm / rated),
        0x210301: lambda: (not link.mains_on) | link.phase_missing << 1,
        0x210302: lambda: round(link.chopper_power_W),
        0x210600: lambda: log.operating_ms & 0xFFFFFFFF,
        0x210800: lambda: safety.bits,
        0x210900: lambda: config.personality,
    }
    for number in range(CAPACITY):
        readers[0x210400 | number + 1] = partial(log.packed, number)
        readers[0x210500 | number + 1] = partial(log.time_ms, number)
    return readers


def clear_history(log: FaultLog, value: int) -> None:
    """Take 2107h: 1 clears the fault history.

    Raises:
        SdoAbort: 06090030h, another value.

    """
    if value != 1:
        raise SdoAbort(AbortCode.VALUE)
    log.clear()


def _permille(share: float) -> int:
    return min(round(share * 1000.0), 0xFFFE)
