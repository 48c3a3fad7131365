"""The faults of PROFIdrive telegrams, as data: words between the profile and the bus that carries them."""

from __future__ import annotations

from typing import Any, Final

from hil.faults._parameters import FaultType, Parameter

DIRECTIONS: Final = ("actual", "setpoint")
_REMARK: Final = (
    "needs an axis of the bench that leads the drive by a PROFIdrive telegram; what passes on the bus is "
    "true in the "
    "direction from the drive, and disturbed in the direction to it"
)
_SIGNAL: Final = Parameter(
    "signal",
    "text",
    "Name in the telegram, with a bit or without: ZSW1.3, NIST_B, G1_STW; or a word by its number: PZD2, "
    "PZD2.15",
    required=True,
)
_WAY: Final = Parameter(
    "direction",
    "text",
    "actual: from the drive; setpoint: to it. For words by number; a name says it itself",
    default="actual",
    choices=DIRECTIONS,
)
_WHOLE: Final = Parameter(
    "direction", "text", "actual: from the drive; setpoint: to it", default="actual", choices=DIRECTIONS
)
_DRIVE: Final = "drive"


def _kind(
    name: str,
    summary: str,
    parameters: tuple[Parameter, ...],
    example: dict[str, Any],
    *,
    duration_s: float = 0.1,
) -> FaultType:
    return FaultType(
        f"telegram.{name}",
        summary,
        _DRIVE,
        "telegram words",
        parameters,
        remark=_REMARK,
        example={
            "kind": f"telegram.{name}",
            "target": "drive1",
            "duration_s": duration_s,
            "parameters": example,
        },
    )


TELEGRAM_FAULTS: Final[tuple[FaultType, ...]] = (
    _kind(
        "stuck",
        "A signal, a word or a bit stands at a value",
        (
            _SIGNAL,
            _WAY,
            Parameter(
                "value",
                "int",
                "Value; not given: the one of the first telegram that is hit",
                minimum=-(1 << 31),
                maximum=(1 << 32) - 1,
            ),
        ),
        {"signal": "ZSW1.3", "value": 1},
    ),
    _kind(
        "flip",
        "Bits arrive inverted",
        (
            _SIGNAL,
            _WAY,
            Parameter(
                "mask",
                "int",
                "Bits of the signal that are inverted; 0: all",
                minimum=0,
                maximum=0xFFFFFFFF,
                default=0,
            ),
        ),
        {"signal": "STW1.2"},
    ),
    _kind(
        "bits",
        "Bits of a word lie: they are shown as 1 or as 0, whatever they are",
        (
            _SIGNAL,
            _WAY,
            Parameter("set", "int", "Bits shown as 1", minimum=0, maximum=0xFFFFFFFF, default=0),
            Parameter("clear", "int", "Bits shown as 0", minimum=0, maximum=0xFFFFFFFF, default=0),
        ),
        {"signal": "ZSW1", "set": 0x0080, "clear": 0x0100},
    ),
    _kind(
        "swap",
        "Two signals, words or bits of the same length are exchanged",
        (_SIGNAL, Parameter("other", "text", "The other one, of the same direction", required=True), _WAY),
        {"signal": "PZD2", "other": "PZD3", "direction": "setpoint"},
    ),
    _kind(
        "offset",
        "A signal is displaced",
        (
            _SIGNAL,
            _WAY,
            Parameter(
                "percent",
                "float",
                "For normalised signals (N2, N4), of 100 % = 4000h; they end at their limits",
                "%",
                -400.0,
                400.0,
                default=0.0,
            ),
            Parameter(
                "counts",
                "int",
                "For all others; it wraps as the signal does",
                minimum=-(1 << 31),
                maximum=(1 << 31) - 1,
                default=0,
            ),
        ),
        {"signal": "NIST_B", "percent": 5.0},
    ),
    _kind(
        "scale",
        "A signal has a wrong scale",
        (
            _SIGNAL,
            _WAY,
            Parameter(
                "factor",
                "float",
                "By which it is multiplied; it ends at its limits",
                minimum=-100.0,
                maximum=100.0,
                required=True,
            ),
        ),
        {"signal": "NSOLL_B", "factor": 0.5},
    ),
    _kind(
        "freeze",
        "Stale data: the telegram repeats what it was when the fault came",
        (
            _WHOLE,
            Parameter(
                "sign_of_life",
                "text",
                "What its sign of life does",
                default="stands",
                choices=("stands", "counts"),
            ),
        ),
        {"direction": "actual", "sign_of_life": "counts"},
    ),
    _kind(
        "late",
        "Telegrams are late by a number of cycles: for so long nothing comes, then all in order",
        (_WHOLE, Parameter("cycles", "int", "How many", "bus cycles", 1, 1000, required=True)),
        {"cycles": 2},
    ),
    _kind(
        "lost",
        "No telegram is handed over: the provider's status is bad",
        (_WHOLE,),
        {"direction": "setpoint"},
    ),
    _kind(
        "length",
        "The telegram has a wrong length",
        (
            _WHOLE,
            Parameter(
                "words", "int", "Words too many, or (negative) too few", "words", -32, 32, required=True
            ),
        ),
        {"words": -1},
    ),
    _kind(
        "sign_of_life",
        "The sign of life (bits 12..15 of STW2 or ZSW2) stands still, jumps, or is 0",
        (
            _WHOLE,
            Parameter("how", "text", "What it does", default="freeze", choices=("freeze", "jump", "zero")),
            Parameter(
                "step", "int", "jump: by how much, in its range 1..15", minimum=1, maximum=14, default=5
            ),
        ),
        {"direction": "actual", "how": "freeze"},
    ),
    _kind(
        "control_lost",
        "The drive requests no control (ZSW1.9 = 0), or the controller gives it away (STW1.10 = 0)",
        (_WHOLE,),
        {"direction": "actual"},
    ),
)
"""Kinds; `count` says how many telegrams are hit."""
