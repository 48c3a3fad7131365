"""The faults of Modbus networks and lines, as data."""

from __future__ import annotations

from typing import Any, Final

from hil.faults._parameters import Environment, FaultType, Parameter

_NO_LINK: Final = (
    "it needs the bytes of a virtual network or line, which real sockets and ports do not show in time"
)
_REFUSED: Final[dict[Environment, str]] = {"live": _NO_LINK, "hardware": _NO_LINK}
_DRIVE: Final = Parameter(
    "drive", "text", "Only frames to and from this drive or station; empty: all of the segment", default=""
)
_FUNCTION: Final = Parameter(
    "function", "int", "Only this function code; 0: every one", minimum=0, maximum=127, default=0
)
_PICK: Final = (
    Parameter(
        "first",
        "int",
        "First matching frame that is hit, counted from the application",
        minimum=1,
        maximum=1_000_000_000,
        default=1,
    ),
    Parameter(
        "every", "int", "Then hit every n-th matching frame", minimum=1, maximum=1_000_000_000, default=1
    ),
    Parameter(
        "probability",
        "float",
        "Chance that a frame so chosen is hit, drawn from the seeded stream",
        minimum=0.0,
        maximum=1.0,
        default=1.0,
    ),
)
_WAY: Final = Parameter(
    "direction", "text", "Which frames", default="response", choices=("request", "response")
)
_CHOICE: Final = (_DRIVE, _WAY, _FUNCTION, *_PICK)


def _kind(
    name: str, summary: str, parameters: tuple[Parameter, ...], remark: str = "", **example: Any
) -> FaultType:
    count = {"count": example.pop("count")} if "count" in example else {"duration_s": 0.1}
    return FaultType(
        f"modbus.{name}",
        summary,
        "segment",
        "Modbus link",
        parameters,
        refused=_REFUSED,
        remark=remark,
        example={"kind": f"modbus.{name}", **count, "parameters": example},
    )


_LINE: Final = "on a serial line"
_NETWORK: Final = "on a network (TCP)"

MODBUS_FAULTS: Final[tuple[FaultType, ...]] = (
    _kind("crc", "Frames have a wrong CRC", _CHOICE, _LINE, count=3),
    _kind(
        "truncate",
        "Frames are cut off",
        (
            *_CHOICE,
            Parameter(
                "length",
                "int",
                "Bytes that are left, the envelope included",
                minimum=1,
                maximum=260,
                required=True,
            ),
        ),
        count=1,
        length=4,
    ),
    _kind(
        "merge", "A frame is held back and comes with the next one, without a pause between", _CHOICE, count=1
    ),
    _kind(
        "unit",
        "Frames carry a wrong unit",
        (
            *_CHOICE,
            Parameter("unit", "int", "The unit that they carry", minimum=0, maximum=255, required=True),
        ),
        count=3,
        unit=77,
    ),
    _kind(
        "transaction",
        "Frames carry a wrong transaction identifier",
        (*_CHOICE, Parameter("step", "int", "By how much it is wrong", minimum=1, maximum=65535, default=1)),
        _NETWORK,
        count=3,
    ),
    _kind(
        "exception",
        "The drive answers with an exception and does not do what it is asked",
        (
            _DRIVE,
            _FUNCTION,
            *_PICK,
            Parameter("code", "int", "Exception code 01 to 08, 0A, 0B", minimum=1, maximum=11, required=True),
        ),
        code=4,
    ),
    _kind("drop", "Requests do not arrive, or are carried out and not answered", _CHOICE, count=2),
    _kind(
        "delay",
        "Frames come later",
        (*_CHOICE, Parameter("delay_s", "float", "How much later", "s", 0.000001, 60.0, required=True)),
        delay_s=0.002,
    ),
    _kind(
        "corrupt",
        "A register has another content, in a frame that is otherwise right",
        (
            *_CHOICE,
            Parameter(
                "register",
                "int",
                "Number of the register among those of the frame, from 0",
                minimum=0,
                maximum=124,
                default=0,
            ),
            Parameter(
                "mask", "int", "Bits of it that are inverted", minimum=1, maximum=0xFFFF, default=0xFFFF
            ),
        ),
        register=0,
        mask=0x0008,
        function=3,
    ),
    _kind(
        "broadcast",
        "Requests go to everybody (unit 0) in place of the drive: nobody answers",
        (_DRIVE, _FUNCTION, *_PICK),
        _LINE,
        count=3,
    ),
    _kind(
        "noise",
        "Bytes on the line between frames, from the seeded stream",
        (
            Parameter("bytes", "int", "How many at a time", minimum=1, maximum=256, default=3),
            Parameter("period_s", "float", "Mean distance", "s", 0.0001, 60.0, default=0.02),
        ),
        _LINE,
        period_s=0.05,
    ),
    _kind(
        "reset",
        "The connection is reset in place of a frame; the controller connects again",
        _CHOICE,
        _NETWORK,
        count=1,
    ),
    _kind(
        "cut",
        "The cable is cut, and neither side is told; what was sent arrives when it is whole again",
        (_DRIVE,),
        _NETWORK,
    ),
)
"""Kinds; `count` says how many frames are hit."""
