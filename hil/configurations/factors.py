"""The factors of a configuration: in what machines differ, and which differences do not go together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

CONFIGURATION: Final = "configuration:"
"""What the reference of a bench begins with that is a configuration."""

Row = Mapping[str, str]
"""A value for every factor; while configurations are being combined, for some of them."""


@dataclass(frozen=True)
class Factor:
    """In what machines differ.

    Args:
        name: Key of `needs` and of a row.
        meaning: What it is.
        values: Values with what each means; the first is that of the reference bench.

    """

    name: str
    meaning: str
    values: Mapping[str, str]


_ALL: Final = (
    Factor("profile", "profile of the drive", {"cia402": "CiA 402", "profidrive": "PROFIdrive"}),
    Factor(
        "bus",
        "bus of the drive",
        {"can": "CAN", "modbus-tcp": "Modbus TCP", "modbus-rtu": "Modbus RTU on a serial line"},
    ),
    Factor(
        "telegram",
        "PROFIdrive telegram",
        {
            "none": "none, CiA 402",
            "3": "telegram 3",
            "5": "telegram 5",
            "102": "telegram 102",
            "103": "telegram 103, with a second encoder",
            "105": "telegram 105",
            "106": "telegram 106, with a second encoder",
        },
    ),
    Factor(
        "neighbours",
        "what else there is",
        {
            "none": "the axis is alone",
            "twin": "a second axis with the same profile on the same segment or line",
            "mixed": "two more axes on CAN, one with CiA 402 and one with PROFIdrive",
            "positioner": "a drive with telegram 111 on CAN that no axis moves",
        },
    ),
    Factor(
        "cycle",
        "bus cycle",
        {"4ms": "4 ms", "2ms": "2 ms", "8ms": "8 ms", "line": "as long as the serial line needs"},
    ),
    Factor(
        "interpolator",
        "cycle of the interpolator",
        {"1": "the bus cycle", "2": "two bus cycles", "3": "three bus cycles"},
    ),
    Factor("program", "call of the user program", {"1": "every cycle", "2": "every second cycle"}),
    Factor("servo", "servo cycle of the drive", {"250us": "250 us", "200us": "200 us", "500us": "500 us"}),
    Factor(
        "motion",
        "kind of axis",
        {
            "linear": "linear",
            "rotary": "rotary",
            "rotary-modulo": "rotary with modulo range",
            "linear-modulo": "linear with modulo range",
        },
    ),
    Factor(
        "unit",
        "measuring unit",
        {"mm": "mm", "m": "m", "um": "um", "in": "in", "deg": "deg", "rad": "rad"},
    ),
    Factor("time", "time in the unit of the velocity", {"second": "per second", "minute": "per minute"}),
    Factor(
        "direction",
        "direction of motor and encoder",
        {"normal": "as the load", "reversed": "against the load, turned round in the axis"},
    ),
    Factor(
        "gear",
        "gear between motor and load",
        {"direct": "none", "reduced": "reduction", "fraction": "ratio without a short decimal number"},
    ),
    Factor(
        "feedback",
        "where the encoder of the axis sits",
        {
            "motor": "on the motor, in the telegram of the drive",
            "load": "on the load, with a CANopen node of its own",
            "second": "on the load, second encoder of the drive's telegram",
            "both": "on the motor, and a second one on the load with a CANopen node of its own",
        },
    ),
    Factor(
        "encoder",
        "kind of encoder",
        {"incremental": "incremental", "absolute": "absolute", "cyclic": "cyclic absolute"},
    ),
    Factor(
        "resolution",
        "increments",
        {
            "usual": "as the reference bench",
            "coarse": "few, no power of two",
            "finest": "so many that the count of 32 bits overflows on the way, or nearly",
        },
    ),
    Factor(
        "mounting",
        "value of the absolute encoder at zero",
        {"centre": "in the middle of its range", "overflow": "at the end of its range"},
    ),
    Factor("software-limits", "software limit switches", {"off": "off", "on": "on"}),
    Factor(
        "switches",
        "hardware limit switches",
        {"closing": "make contacts", "opening": "break contacts", "none": "none"},
    ),
    Factor("filter", "filter of the inputs", {"0": "none", "7ms": "7 ms", "21ms": "21 ms"}),
    Factor(
        "braking",
        "deceleration against acceleration",
        {"harder": "brakes harder than it accelerates", "softer": "brakes softer than it accelerates"},
    ),
    Factor("jerk", "jerk of the defaults", {"limited": "limited", "none": "not limited"}),
    Factor(
        "load",
        "load and friction",
        {"usual": "light, little friction", "friction": "high friction", "heavy": "heavy"},
    ),
    Factor(
        "play",
        "play between motor and load",
        {"none": "none", "some": "some, not compensated", "compensated": "some, compensated"},
    ),
    Factor(
        "precontrol",
        "velocity precontrol",
        {"full": "100 %", "part": "part of it", "none": "none"},
    ),
    Factor("dsc", "dynamic servo control", {"off": "off", "on": "in the drive"}),
    Factor("reserve", "speed of the drive", {"none": "that of the axis", "some": "more than the axis uses"}),
    Factor("cpu", "controller", {"S7-1500T": "S7-1500T", "S7-1500": "S7-1500"}),
)

FACTORS: Final[Mapping[str, Factor]] = {factor.name: factor for factor in _ALL}
"""All factors by name, those that others depend on first."""

USUAL: Final[Row] = {factor.name: next(iter(factor.values)) for factor in _ALL}
"""The values of the reference bench."""

LENGTHS: Final = ("mm", "m", "um", "in")
"""Units of linear axes."""


def differing(row: Row) -> str:
    """Return the values that differ from those of the reference bench, in a line."""
    words = (f"{name} {value}" for name, value in row.items() if value != USUAL[name])
    return ", ".join(words) or "as the reference bench"


def objection(row: Row) -> str:
    """Return why there is no such machine, as far as the row is known; empty: there is."""
    for parts, reason in _EXCLUDED:
        if all(row.get(name) in values for name, values in parts.items()):
            return reason
    return ""


def _others(name: str, *values: str) -> frozenset[str]:
    return frozenset(FACTORS[name].values) - frozenset(values)


def _only(name: str, *values: str) -> frozenset[str]:
    unknown = frozenset(values) - frozenset(FACTORS[name].values)
    if unknown:
        raise ValueError(f"{name} has no {', '.join(unknown)}")
    return frozenset(values)


def _rule(reason: str, **parts: frozenset[str]) -> tuple[Mapping[str, frozenset[str]], str]:
    return {name.replace("_", "-"): values for name, values in parts.items()}, reason


_WITH_DSC: Final = ("5", "105", "106")
_TWO_ENCODERS: Final = ("103", "106")

_EXCLUDED: Final = (
    _rule("CiA 402 is spoken on CAN", profile=_only("profile", "cia402"), bus=_others("bus", "can")),
    _rule(
        "CiA 402 has no telegram",
        profile=_only("profile", "cia402"),
        telegram=_others("telegram", "none"),
    ),
    _rule(
        "PROFIdrive needs a telegram",
        profile=_only("profile", "profidrive"),
        telegram=_only("telegram", "none"),
    ),
    _rule(
        "the register map has no space for it",
        bus=_others("bus", "can"),
        telegram=_only("telegram", *_TWO_ENCODERS),
    ),
    _rule("the line needs its time", bus=_only("bus", "modbus-rtu"), cycle=_others("cycle", "line")),
    _rule("only a line needs this time", bus=_others("bus", "modbus-rtu"), cycle=_only("cycle", "line")),
    _rule(
        "an interpolator has 32 ms at most",
        cycle=_only("cycle", "line"),
        interpolator=_others("interpolator", "1"),
    ),
    _rule(
        "a linear axis measures lengths",
        motion=_only("motion", "linear", "linear-modulo"),
        unit=_others("unit", *LENGTHS),
    ),
    _rule(
        "a rotary axis measures angles",
        motion=_only("motion", "rotary", "rotary-modulo"),
        unit=_only("unit", *LENGTHS),
    ),
    _rule(
        "an encoder of its own is a CANopen node",
        feedback=_only("feedback", "load", "both"),
        bus=_others("bus", "can"),
    ),
    _rule(
        "only telegrams 103 and 106 carry a second encoder",
        feedback=_only("feedback", "second"),
        telegram=_others("telegram", *_TWO_ENCODERS),
    ),
    _rule(
        "this encoder is incremental or absolute",
        feedback=_only("feedback", "load", "second"),
        encoder=_only("encoder", "cyclic"),
    ),
    _rule(
        "an incremental encoder counts from zero",
        mounting=_only("mounting", "overflow"),
        encoder=_only("encoder", "incremental"),
    ),
    _rule(
        "only the encoder of the motor is mounted so",
        mounting=_only("mounting", "overflow"),
        feedback=_only("feedback", "load", "second"),
    ),
    _rule(
        "a modulo axis has no end",
        motion=_only("motion", "rotary-modulo", "linear-modulo"),
        switches=_others("switches", "none"),
    ),
    _rule(
        "a modulo axis has no end",
        motion=_only("motion", "rotary-modulo", "linear-modulo"),
        software_limits=_only("software-limits", "on"),
    ),
    _rule("no switch, no filter", switches=_only("switches", "none"), filter=_others("filter", "0")),
    _rule(
        "only telegrams 5, 6, 105 and 106 carry XERR and KPC",
        dsc=_only("dsc", "on"),
        telegram=_others("telegram", *_WITH_DSC),
    ),
    _rule("dynamic servo control needs the clock of CAN", dsc=_only("dsc", "on"), bus=_others("bus", "can")),
    _rule(
        "dynamic servo control takes the encoder of the motor",
        dsc=_only("dsc", "on"),
        feedback=_only("feedback", "load", "second"),
    ),
    _rule(
        "without precontrol an axis on a line is behind by half a second",
        precontrol=_only("precontrol", "none"),
        bus=_only("bus", "modbus-rtu"),
    ),
    _rule(
        "a control loop around play does not come to rest",
        play=_only("play", "some"),
        feedback=_others("feedback", "motor"),
    ),
    _rule(
        "play is compensated where an encoder on the load shows it",
        play=_only("play", "compensated"),
        feedback=_others("feedback", "both"),
    ),
    _rule(
        "only an S7-1500T has two encoders",
        feedback=_only("feedback", "both"),
        cpu=_others("cpu", "S7-1500T"),
    ),
)
"""What cannot exist, and why."""
