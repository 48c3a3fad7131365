"""The catalogue of faults, as data."""

from __future__ import annotations

import difflib
from typing import Final

from fieldbus.errors import ConfigurationError
from hil.faults._encoder_kinds import ANY_ENCODER, OWN_DEVICE
from hil.faults._parameters import FaultType, Parameter

_SELECTION: Final = (
    Parameter("drive", "text", "Drive whose identifiers `message` names; empty: the default drive", default=""),
    Parameter("message", "text", "Message of that drive: rpdo1, tpdo1, sync, emcy, heartbeat, sdo_rx, sdo_tx, ...; empty: use can_id", default=""),
    Parameter("can_id", "int", "Identifier to hit; without it and without a message every frame is hit", minimum=0, maximum=0x1FFFFFFF),
    Parameter("mask", "int", "Bits of the identifier that are compared", minimum=0, maximum=0x1FFFFFFF, default=0x1FFFFFFF),
    Parameter("sender", "text", "Only frames of this node; empty: of every node", default=""),
    Parameter("first", "int", "First matching frame that is hit, counted from the application", minimum=1, maximum=1_000_000_000, default=1),
    Parameter("every", "int", "Then hit every n-th matching frame", minimum=1, maximum=1_000_000_000, default=1),
    Parameter("probability", "float", "Chance that a frame so chosen is hit, drawn from the seeded stream", minimum=0.0, maximum=1.0, default=1.0),
)  # fmt: skip

_LOCAL: Final = (
    "on a live bus only frames that a local port sends or receives, or that pass a bridge, can be touched"
)
_NO_WIRE: Final = "bit errors need access to the bits of the wire, which a bus adapter does not give"
_INPUTS: Final = ("negative_limit", "positive_limit", "home", "probe1", "probe2")
_NO_HAND: Final = (
    "a physical drive has no seam for this; it would need switched I/O or a test adapter on the machine"
)

CATALOGUE: Final[tuple[FaultType, ...]] = (
    FaultType(
        "frame.drop", "Frames never reach the wire; their sender believes they were sent", "segment", "CAN medium",
        _SELECTION, remark=_LOCAL,
        example={"kind": "frame.drop", "target": "can0", "count": 3, "parameters": {"message": "tpdo1"}},
    ),
    FaultType(
        "frame.delay", "Frames reach the wire later", "segment", "CAN medium",
        (*_SELECTION, Parameter("delay_s", "float", "How much later", "s", 0.000001, 10.0, required=True)), remark=_LOCAL,
        example={"kind": "frame.delay", "duration_s": 0.1, "parameters": {"message": "rpdo1", "delay_s": 0.006}},
    ),
    FaultType(
        "frame.corrupt", "A bit error on the wire: error frame, then repetition by the sender", "segment", "CAN medium",
        (*_SELECTION, Parameter("attempts", "int", "Transmission attempts in a row that fail", minimum=1, maximum=255, default=1)),
        refused={"live": _NO_WIRE, "hardware": _NO_WIRE},
        example={"kind": "frame.corrupt", "count": 5, "parameters": {"can_id": 0x181, "attempts": 2}},
    ),
    FaultType(
        "frame.duplicate", "Frames are sent more than once", "segment", "CAN medium",
        (*_SELECTION, Parameter("copies", "int", "Additional copies", minimum=1, maximum=16, default=1)), remark=_LOCAL,
        example={"kind": "frame.duplicate", "count": 1, "parameters": {"message": "rpdo1"}},
    ),
    FaultType(
        "frame.replace", "The payload is exchanged before the frame reaches the wire", "segment", "CAN medium",
        (*_SELECTION, Parameter("data", "text", "New payload, hexadecimal, 0 to 8 bytes", required=True)), remark=_LOCAL,
        example={"kind": "frame.replace", "count": 1, "parameters": {"message": "tpdo1", "data": "3702 00000000"}},
    ),
    FaultType(
        "frame.inject", "A foreign node sends a frame, once or over and over (flooding)", "segment", "CAN medium",
        (
            Parameter("can_id", "int", "Identifier", minimum=0, maximum=0x1FFFFFFF, required=True),
            Parameter("data", "text", "Payload, hexadecimal, 0 to 8 bytes", default=""),
            Parameter("extended", "bool", "29-bit identifier", default=False),
            Parameter("period_s", "float", "Distance of repetitions; count says how many", "s", 0.00005, 3600.0, default=0.001),
        ),
        example={"kind": "frame.inject", "count": 100, "parameters": {"can_id": 0, "data": "8001"}},
    ),
    FaultType(
        "drive.fault", "The drive trips with an EMCY code", "drive", "drive internals",
        (
            Parameter("code", "int", "EMCY error code", minimum=0x0001, maximum=0xFFFF, required=True),
            Parameter("persistent", "bool", "The cause stays, and refuses a fault reset, until the fault is removed", default=False),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "drive.fault", "target": "drive1", "parameters": {"code": 0x2310}},
    ),
    FaultType(
        "drive.sto", "The safe-torque-off input opens: torque off at once, no fault", "drive", "drive internals",
        refused={"hardware": _NO_HAND}, example={"kind": "drive.sto", "target": "drive1", "duration_s": 0.5},
    ),
    FaultType(
        "drive.power_off", "The node vanishes from the bus without a word; it boots again at the end", "drive", "CANopen node",
        refused={"hardware": _NO_HAND}, example={"kind": "drive.power_off", "target": "drive1", "duration_s": 2.0},
    ),
    FaultType(
        "drive.heartbeat_loss", "The drive goes on working but sends no heartbeat", "drive", "CANopen service",
        refused={"hardware": _NO_HAND}, remark="frame.drop of the heartbeat does the same to a physical drive",
        example={"kind": "drive.heartbeat_loss", "target": "drive1", "duration_s": 1.0},
    ),
    FaultType(
        "switch.press", "A limit switch, the home switch or a probe is actuated", "switch", "switch",
        (Parameter("input", "text", "Which switch", required=True, choices=_INPUTS),),
        refused={"hardware": _NO_HAND},
        example={"kind": "switch.press", "target": "drive1", "parameters": {"input": "positive_limit"}},
    ),
    FaultType(
        "switch.stuck", "A switch no longer follows the mechanics", "switch", "switch",
        (
            Parameter("input", "text", "Which switch", required=True, choices=_INPUTS),
            Parameter("state", "bool", "State that it is stuck in", default=False),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "switch.stuck", "target": "drive1", "parameters": {"input": "home", "state": False}},
    ),
    FaultType(
        "switch.bounce", "A switch bounces, with intervals from the seeded stream, and ends actuated or free", "switch", "switch",
        (
            Parameter("input", "text", "Which switch", required=True, choices=_INPUTS),
            Parameter("pulses", "int", "Number of pulses", minimum=1, maximum=1000, default=5),
            Parameter("shortest_s", "float", "Shortest interval between edges", "s", 0.00001, 1.0, default=0.0002),
            Parameter("longest_s", "float", "Longest interval between edges", "s", 0.00001, 1.0, default=0.003),
            Parameter("state", "bool", "State after bouncing, held until the fault is removed", default=True),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "switch.bounce", "target": "drive1", "parameters": {"input": "home", "pulses": 8}},
    ),
    FaultType(
        "probe.pulse", "A touch probe input is actuated for a moment, at any time between two cycles", "switch", "switch",
        (
            Parameter("input", "text", "Which probe", required=True, choices=("probe1", "probe2")),
            Parameter("width_s", "float", "How long", "s", 0.000001, 10.0, default=0.001),
        ),
        lasting=False, refused={"hardware": _NO_HAND}, remark="on a live bench the width is that of the pipe to the drive process",
        example={"kind": "probe.pulse", "target": "drive1", "trigger": {"when": "at", "time_s": 1.0001234}, "parameters": {"input": "probe1", "width_s": 0.0005}},
    ),
    FaultType(
        "mechanics.jam", "The load is blocked where it stands", "mechanics", "mechanics",
        refused={"hardware": _NO_HAND}, example={"kind": "mechanics.jam", "target": "drive1", "duration_s": 0.2},
    ),
    FaultType(
        "mechanics.load_step", "An external force acts on the load", "mechanics", "mechanics",
        (Parameter("force_N", "float", "Force along the axis, signed", "N", -1e6, 1e6, required=True),),
        refused={"hardware": _NO_HAND},
        example={"kind": "mechanics.load_step", "target": "drive1", "duration_s": 0.5, "parameters": {"force_N": 400.0}},
    ),
    *ANY_ENCODER,
    *OWN_DEVICE,
    FaultType(
        "axis.alarm", "The controller raises a technology alarm by itself", "axis", "alarm engine of the axis",
        (
            Parameter("number", "int", "Number of the alarm", minimum=101, maximum=999, required=True),
            Parameter("reaction", "int", "Reaction 0..5; not given: the one of the alarm", minimum=0, maximum=5),
            Parameter("persistent", "bool", "The cause stays until the fault is removed: acknowledging does not help", default=False),
        ),
        example={"kind": "axis.alarm", "target": "axis1", "parameters": {"number": 521, "reaction": 4}},
    ),
)  # fmt: skip

_BY_NAME: Final = {entry.name: entry for entry in CATALOGUE}


def fault_type(name: str) -> FaultType:
    """Return the catalogue entry of a fault kind.

    Raises:
        ConfigurationError: No such kind; the message proposes near ones.

    """
    entry = _BY_NAME.get(name)
    if entry is None:
        near = difflib.get_close_matches(str(name), _BY_NAME, n=3)
        raise ConfigurationError("fault.kind", name, ", ".join(near) if near else ", ".join(_BY_NAME))
    return entry
