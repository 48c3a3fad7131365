"""Profile objects 6000h..67FFh (C402-175 to C402-278) and the manufacturer's diagnostics from 2000h on.

Defaults in user units hold for the default units: velocity in rpm, acceleration in rpm/s. 6502h and 60E3h
name what this drive does and no more.
"""

from __future__ import annotations

from typing import Final

from emulators.drive.cia402.homing_methods import supported_methods
from emulators.drive.cia402.objects.communication import DEVICE_TYPE
from emulators.drive.cia402.objects.protection import protection_objects
from emulators.drive.homing_config import HomingConfig
from fieldbus.canopen.object_table import (
    I8,
    I16,
    I32,
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

SUPPORTED_MODES: Final = 0x3EF
"""6502h: all modes of the profile but cstca."""
SUPPORTED_HOMING: Final = tuple(supported_methods(HomingConfig()))
"""60E3h of a drive with the hard-stop methods of the specification."""
_LOWEST: Final = -0x80000000
_HIGHEST: Final = 0x7FFFFFFF
_OFF: Final = 0xFFFFFFFF
_ACCELERATION: Final = 6000
"""100 revolutions per second squared, in rpm/s."""


def profile_objects() -> tuple[ObjectRow, ...]:
    """Return the rows from 2000h on."""
    return (
        *_manufacturer(),
        *protection_objects(),
        *_control(),
        *_velocity_mode(),
        *_values(),
        *_profiles(),
        *_cyclic(),
        *_device(),
    )


def _manufacturer() -> tuple[ObjectRow, ...]:
    return (
        record(
            0x2000,
            "Synchronisation diagnostics",
            Item("Lost SYNC messages", U32, "ro", "T"),
            Item("Missing set-points", U32, "ro", "T"),
        ),
        record(
            0x2010,
            "Homing parameters",
            Item("Hard stop torque threshold", U16, "rw", "R", 500),
            Item("Hard stop detection time", U16, "rw", "R", 50),
            Item("Hard stop retraction distance", U32, "rw", "R"),
            Item("Homing time-out", U32, "rw", "R", 60_000),
            Item("Homing search distance", U32, "rw", "R"),
        ),
    )


def _control() -> tuple[ObjectRow, ...]:
    return (
        var(0x6007, "Abort connection option code", I16, "rw", "-", 1),
        var(0x603F, "Error code", U16, "ro", "T"),
        var(0x6040, "Controlword", U16, "rw", "RT", volatile=True),
        var(0x6041, "Statusword", U16, "ro", "T", None),
        var(0x605A, "Quick stop option code", I16, "rw", "-", 2),
        var(0x605B, "Shutdown option code", I16, "rw", "-", 0),
        var(0x605C, "Disable operation option code", I16, "rw", "-", 1),
        var(0x605D, "Halt option code", I16, "rw", "-", 1),
        var(0x605E, "Fault reaction option code", I16, "rw", "-", 2),
        var(0x6060, "Modes of operation", I8, "rw", "RT"),
        var(0x6061, "Modes of operation display", I8, "ro", "T"),
    )


def _velocity_mode() -> tuple[ObjectRow, ...]:
    speed_and_time = (Item("Delta speed", U32, "rw", "R", 3000), Item("Delta time", U16, "rw", "R", 1))
    return (
        var(0x6042, "vl target velocity", I16, "rw", "RT", volatile=True),
        var(0x6043, "vl velocity demand", I16, "ro", "T", None),
        var(0x6044, "vl velocity actual value", I16, "ro", "T", None),
        array(0x6046, "vl velocity min max amount", ("Minimum", "Maximum"), U32, "rw", "R", (0, 3000)),
        array(
            0x6047,
            "vl velocity min max",
            ("Minimum positive", "Maximum positive", "Minimum negative", "Maximum negative"),
            U32,
            "rw",
            "R",
            (0, 3000, 0, 3000),
        ),
        record(0x6048, "vl velocity acceleration", *speed_and_time),
        record(0x6049, "vl velocity deceleration", *speed_and_time),
        record(0x604A, "vl velocity quick stop", *speed_and_time),
        array(0x604B, "vl set-point factor", ("Numerator", "Denominator"), I16, "rw", "R", (1, 1)),
        array(0x604C, "vl dimension factor", ("Numerator", "Denominator"), I32, "rw", "R", (1, 1)),
        var(0x604D, "vl pole number", U8, "rw", "R", 4),
        var(0x604E, "vl velocity reference", U32, "rw", "R", 3000),
        var(0x604F, "vl ramp function time", U32, "rw", "R", 1000),
        var(0x6050, "vl slow down time", U32, "rw", "R", 1000),
        var(0x6051, "vl quick stop time", U32, "rw", "R", 1000),
        var(0x6052, "vl nominal percentage", I16, "rw", "RT", volatile=True),
        var(0x6053, "vl percentage demand", I16, "ro", "T"),
        var(0x6054, "vl actual percentage", I16, "ro", "T"),
        var(0x6055, "vl manipulated percentage", I16, "ro", "T"),
    )


def _values() -> tuple[ObjectRow, ...]:
    return (
        var(0x6062, "Position demand value", I32, "ro", "T", None),
        var(0x6063, "Position actual internal value", I32, "ro", "T", None),
        var(0x6064, "Position actual value", I32, "ro", "T", None),
        var(0x6065, "Following error window", U32, "rw", "R", _OFF),
        var(0x6066, "Following error time out", U16, "rw", "R"),
        var(0x6067, "Position window", U32, "rw", "R", _OFF),
        var(0x6068, "Position window time", U16, "rw", "R"),
        var(0x6069, "Velocity sensor actual value", I32, "ro", "T", None),
        var(0x606A, "Sensor selection code", I16, "rw", "R"),
        var(0x606B, "Velocity demand value", I32, "ro", "T", None),
        var(0x606C, "Velocity actual value", I32, "ro", "T", None),
        var(0x606D, "Velocity window", U16, "rw", "R"),
        var(0x606E, "Velocity window time", U16, "rw", "R"),
        var(0x606F, "Velocity threshold", U16, "rw", "R"),
        var(0x6070, "Velocity threshold time", U16, "rw", "R"),
        var(0x6071, "Target torque", I16, "rw", "RT", volatile=True),
        var(0x6072, "Max torque", U16, "rw", "R", 3000),
        var(0x6073, "Max current", U16, "rw", "R", 3000),
        var(0x6074, "Torque demand", I16, "ro", "T", None),
        var(0x6075, "Motor rated current", U32, "rw", "-", 5000),
        var(0x6076, "Motor rated torque", U32, "rw", "-", 2000),
        var(0x6077, "Torque actual value", I16, "ro", "T", None),
        var(0x6078, "Current actual value", I16, "ro", "T", None),
        var(0x6079, "DC link circuit voltage", U32, "ro", "T", 560000),
    )


def _profiles() -> tuple[ObjectRow, ...]:
    speed = "rw", "R"
    ratio = ("Numerator", "Denominator")
    return (
        var(0x607A, "Target position", I32, "rw", "RT", volatile=True),
        array(0x607B, "Position range limit", ("Minimum", "Maximum"), I32, *speed, (_LOWEST, _HIGHEST)),
        var(0x607C, "Home offset", I32, *speed),
        array(0x607D, "Software position limit", ("Minimum", "Maximum"), I32, *speed, (_LOWEST, _HIGHEST)),
        var(0x607E, "Polarity", U8, *speed),
        var(0x607F, "Max profile velocity", U32, *speed, 3000),
        var(0x6080, "Max motor speed", U32, *speed, 3000),
        var(0x6081, "Profile velocity", U32, *speed, 1000),
        var(0x6082, "End velocity", U32, *speed),
        var(0x6083, "Profile acceleration", U32, *speed, _ACCELERATION),
        var(0x6084, "Profile deceleration", U32, *speed, _ACCELERATION),
        var(0x6085, "Quick stop deceleration", U32, *speed, 4 * _ACCELERATION),
        var(0x6086, "Motion profile type", I16, *speed),
        var(0x6087, "Torque slope", U32, *speed, 100000),
        var(0x6088, "Torque profile type", I16, *speed),
        var(0x6089, "Position notation index", I8),
        var(0x608A, "Position dimension index", U8),
        var(0x608B, "Velocity notation index", I8),
        var(0x608C, "Velocity dimension index", U8),
        var(0x608D, "Acceleration notation index", I8),
        var(0x608E, "Acceleration dimension index", U8),
        array(
            0x608F,
            "Position encoder resolution",
            ("Increments", "Motor revolutions"),
            U32,
            *speed,
            (131072, 1),
        ),
        array(
            0x6090,
            "Velocity encoder resolution",
            ("Increments per second", "Motor revolutions"),
            U32,
            *speed,
            (131072, 1),
        ),
        array(0x6091, "Gear ratio", ("Motor revolutions", "Shaft revolutions"), U32, *speed, (1, 1)),
        array(0x6092, "Feed constant", ("Feed", "Shaft revolutions"), U32, *speed, (10000, 1)),
        array(0x6093, "Position factor", ratio, U32, *speed, (1, 1)),
        array(0x6094, "Velocity encoder factor", ratio, U32, *speed, (1, 1)),
        array(0x6096, "Velocity factor", ratio, U32, *speed, (1, 1)),
        array(0x6097, "Acceleration factor", ratio, U32, *speed, (1, 1)),
        var(0x6098, "Homing method", I8, *speed),
        array(0x6099, "Homing speeds", ("Search for switch", "Search for zero"), U32, *speed, (200, 20)),
        var(0x609A, "Homing acceleration", U32, *speed, _ACCELERATION),
        var(0x60A3, "Profile jerk use", U8, *speed, 1),
        array(0x60A4, "Profile jerk", ("Profile jerk 1", "Profile jerk 2"), U32, *speed),
        var(0x60A8, "SI unit position", U32),
        var(0x60A9, "SI unit velocity", U32, "rw", "-", 0x00B44700),
    )


def _cyclic() -> tuple[ObjectRow, ...]:
    return (
        var(0x60B0, "Position offset", I32, "rw", "RT", volatile=True),
        var(0x60B1, "Velocity offset", I32, "rw", "RT", volatile=True),
        var(0x60B2, "Torque offset", I16, "rw", "RT", volatile=True),
        var(0x60B8, "Touch probe function", U16, "rw", "RT", volatile=True),
        var(0x60B9, "Touch probe status", U16, "ro", "T"),
        var(0x60BA, "Touch probe 1 positive edge", I32, "ro", "T"),
        var(0x60BB, "Touch probe 1 negative edge", I32, "ro", "T"),
        var(0x60BC, "Touch probe 2 positive edge", I32, "ro", "T"),
        var(0x60BD, "Touch probe 2 negative edge", I32, "ro", "T"),
        var(0x60C0, "Interpolation sub mode select", I16, "rw", "R"),
        array(
            0x60C1,
            "Interpolation data record",
            ("Set-point 1",),
            I32,
            "rw",
            "RT",
            volatile=True,
        ),
        record(
            0x60C2,
            "Interpolation time period",
            Item("Interpolation time units", U8, "rw", "R", 1),
            Item("Interpolation time index", I8, "rw", "R", -3),
        ),
        record(
            0x60C4,
            "Interpolation data configuration",
            Item("Maximum buffer size", U32, "ro", "-", 16),
            Item("Actual buffer size", U32, "rw", "R", 1),
            Item("Buffer organisation", U8, "rw", "R", 0),
            Item("Buffer position", U16, "rw", "R", 0),
            Item("Size of data record", U8, "wo", "R", 1),
            Item("Buffer clear", U8, "wo", "R", 0),
        ),
        var(0x60C5, "Max acceleration", U32, "rw", "R", 10 * _ACCELERATION),
        var(0x60C6, "Max deceleration", U32, "rw", "R", 10 * _ACCELERATION),
        var(0x60C8, "Velocity lower limit", I32, "rw", "RT", _LOWEST),
        var(0x60C9, "Velocity upper limit", I32, "rw", "RT", _HIGHEST),
        array(
            0x60D0,
            "Touch probe source",
            ("Touch probe 1 source", "Touch probe 2 source"),
            I16,
            "rw",
            "R",
            (1, 2),
        ),
        *(
            var(index, f"Touch probe {probe} {edge} edge {what}", kind, "ro", "T")
            for first, what, kind in ((0x60D1, "time stamp", U32), (0x60D5, "counter", U16))
            for index, probe, edge in (
                (first, 1, "positive"),
                (first + 1, 1, "negative"),
                (first + 2, 2, "positive"),
                (first + 3, 2, "negative"),
            )
        ),
        var(0x60E0, "Positive torque limit value", U16, "rw", "RT", 3000),
        var(0x60E1, "Negative torque limit value", U16, "rw", "RT", 3000),
        array(
            0x60E3,
            "Supported homing methods",
            tuple(f"Supported homing method {n}" for n in range(1, len(SUPPORTED_HOMING) + 1)),
            I8,
            "ro",
            "-",
            SUPPORTED_HOMING,
        ),
        array(
            0x60E4, "Additional position actual value", ("1st additional position",), I32, "ro", "T", (None,)
        ),
        array(
            0x60E5, "Additional velocity actual value", ("1st additional velocity",), I32, "ro", "T", (None,)
        ),
        var(0x60F2, "Positioning option code", U16, "rw", "R"),
        var(0x60F4, "Following error actual value", I32, "ro", "T", None),
        var(0x60F8, "Max slippage", I32, "rw", "R"),
        var(0x60FA, "Control effort", I32, "ro", "T", None),
        var(0x60FC, "Position demand internal value", I32, "ro", "T", None),
        var(0x60FD, "Digital inputs", U32, "ro", "T", None),
        array(0x60FE, "Digital outputs", ("Physical outputs", "Bit mask"), U32, "rw", "R"),
        var(0x60FF, "Target velocity", I32, "rw", "RT", volatile=True),
    )


def _device() -> tuple[ObjectRow, ...]:
    return (
        var(0x6402, "Motor type", U16, "rw", "-", 10),
        var(0x6403, "Motor catalogue number", STRING, "rw", "-", ""),
        var(0x6404, "Motor manufacturer", STRING, "rw", "-", ""),
        record(0x6410, "Motor data", Item("Rated speed", U32, "rw", "-", 3000)),
        var(0x6502, "Supported drive modes", U32, "ro", "T", SUPPORTED_MODES),
        var(0x6503, "Drive catalogue number", STRING, "ro", "-", "emulated"),
        var(0x6504, "Drive manufacturer", STRING, "ro", "-", "motion-hil"),
        var(0x6505, "http drive catalogue address", STRING, "ro", "-", ""),
        record(0x6510, "Drive data", Item("Servo period", U32, "ro", "-", 250)),
        var(0x67FE, "Version number", U32, "ro", "-", 0x00040000),
        var(0x67FF, "Single device type", U32, "ro", "-", DEVICE_TYPE),
    )
