"""The catalogue: safety functions that are selected at a PROFIdrive axis (CFG-443 to CFG-498)."""

from __future__ import annotations

from typing import Final

from hil.faults._parameters import FaultType, Parameter

_NO_HAND: Final = "a physical drive has no seam for this; it would need a safety controller on its inputs"
_REMARK: Final = "a PROFIdrive axis only; the bench file sets it up: [drive.NAME.safety]"

SAFETY_FAULTS: Final[tuple[FaultType, ...]] = (
    FaultType(
        "safety.ss2",
        "Safe stop 2 is selected: quick stop, then monitored standstill under control",
        "drive",
        "drive internals",
        refused={"hardware": _NO_HAND},
        remark=_REMARK,
        example={"kind": "safety.ss2", "target": "drive1", "duration_s": 1.0},
    ),
    FaultType(
        "safety.sos",
        "Safe operating stop is selected: the standstill is monitored after a delay",
        "drive",
        "drive internals",
        refused={"hardware": _NO_HAND},
        remark=_REMARK,
        example={"kind": "safety.sos", "target": "drive1", "duration_s": 1.0},
    ),
    FaultType(
        "safety.sbc",
        "Safe brake control is selected: torque off, and the brake closes",
        "drive",
        "drive internals",
        refused={"hardware": _NO_HAND},
        remark=_REMARK,
        example={"kind": "safety.sbc", "target": "drive1", "duration_s": 1.0},
    ),
    FaultType(
        "safety.sls",
        "Safely limited speed is selected: the drive stops by itself above the limit",
        "drive",
        "drive internals",
        (Parameter("level", "int", "Level with its limit", minimum=1, maximum=4, default=1),),
        refused={"hardware": _NO_HAND},
        remark=_REMARK,
        example={"kind": "safety.sls", "target": "drive1", "duration_s": 2.0, "parameters": {"level": 1}},
    ),
    FaultType(
        "safety.sdi",
        "Safe direction is selected: the drive stops by itself when the load moves the other way",
        "drive",
        "drive internals",
        (
            Parameter(
                "direction", "text", "Permitted direction", choices=("positive", "negative"), required=True
            ),
        ),
        refused={"hardware": _NO_HAND},
        remark=_REMARK,
        example={
            "kind": "safety.sdi",
            "target": "drive1",
            "duration_s": 2.0,
            "parameters": {"direction": "positive"},
        },
    ),
    FaultType(
        "safety.slp",
        "Safely limited position is selected: the drive stops by itself outside of the range",
        "drive",
        "drive internals",
        (Parameter("range", "int", "Range in force", minimum=1, maximum=2, default=1),),
        refused={"hardware": _NO_HAND},
        remark=_REMARK,
        example={"kind": "safety.slp", "target": "drive1", "duration_s": 2.0, "parameters": {"range": 1}},
    ),
    FaultType(
        "safety.acknowledge",
        "The safety messages of the drive are acknowledged safely",
        "drive",
        "drive internals",
        lasting=False,
        refused={"hardware": _NO_HAND},
        remark=_REMARK,
        example={"kind": "safety.acknowledge", "target": "drive1"},
    ),
)
