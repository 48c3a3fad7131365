"""The catalogue of faults, as data."""

from __future__ import annotations

import difflib
from typing import Final

from fieldbus.can.bitstream import FIELDS
from fieldbus.errors import ConfigurationError
from hil.faults._can_catalogue import CAN_FAULTS
from hil.faults._catalogue_drive import DRIVE_FAULTS
from hil.faults._catalogue_machine import MACHINE_FAULTS, MOTOR_ENCODER_FAULTS
from hil.faults._catalogue_safety import SAFETY_FAULTS
from hil.faults._controller_catalogue import CONTROLLER_FAULTS
from hil.faults._encoder_kinds import ANY_ENCODER, OWN_DEVICE, PROFIDRIVE_ENCODER
from hil.faults._io_catalogue import IO_FAULTS
from hil.faults._modbus_catalogue import MODBUS_FAULTS
from hil.faults._parameters import FaultType, Parameter
from hil.faults._telegram_catalogue import TELEGRAM_FAULTS

_SELECTION: Final = (
    Parameter(
        "drive",
        "text",
        "Drive, encoder or device of the segment whose identifiers `message` names; empty: the default drive",
        default="",
    ),
    Parameter(
        "message",
        "text",
        "A message of it: rpdo1, tpdo1, sync, emcy, heartbeat, sdo_rx, sdo_tx, ...; empty: use can_id",
        default="",
    ),
    Parameter(
        "can_id",
        "int",
        "Identifier to hit; without it and without a message every frame is hit",
        minimum=0,
        maximum=0x1FFFFFFF,
    ),
    Parameter(
        "mask",
        "int",
        "Bits of the identifier that are compared",
        minimum=0,
        maximum=0x1FFFFFFF,
        default=0x1FFFFFFF,
    ),
    Parameter("sender", "text", "Only frames of this node; empty: of every node", default=""),
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

_LOCAL: Final = (
    "on a live bus only frames that a local port sends or receives, or that pass a bridge, can be touched"
)
_NO_WIRE: Final = "bit errors need access to the bits of the wire, which a bus adapter does not give"
_NO_RACE: Final = "a bus adapter cannot start a frame in the very bit in which another node starts"

CATALOGUE: Final[tuple[FaultType, ...]] = (
    FaultType(
        "frame.drop",
        "Frames never reach the wire; their sender believes they were sent",
        "segment",
        "CAN medium",
        _SELECTION,
        remark=_LOCAL,
        example={"kind": "frame.drop", "target": "can0", "count": 3, "parameters": {"message": "tpdo1"}},
    ),
    FaultType(
        "frame.delay",
        "Frames reach the wire later",
        "segment",
        "CAN medium",
        (*_SELECTION, Parameter("delay_s", "float", "How much later", "s", 0.000001, 10.0, required=True)),
        remark=_LOCAL,
        example={
            "kind": "frame.delay",
            "duration_s": 0.1,
            "parameters": {"message": "rpdo1", "delay_s": 0.006},
        },
    ),
    FaultType(
        "frame.jitter",
        "Frames reach the wire later by a random time: a clock that jitters, of SYNC for example",
        "segment",
        "CAN medium",
        (
            *_SELECTION,
            Parameter(
                "jitter_s",
                "float",
                "Longest delay; each is drawn evenly from 0 to it, from the seeded stream",
                "s",
                0.000001,
                10.0,
                required=True,
            ),
        ),
        remark=_LOCAL,
        example={
            "kind": "frame.jitter",
            "duration_s": 0.5,
            "parameters": {"message": "sync", "jitter_s": 0.0005},
        },
    ),
    FaultType(
        "frame.drift",
        "Frames come later and later: the clock of their sender is slow against the others",
        "segment",
        "CAN medium",
        (
            *_SELECTION,
            Parameter(
                "drift_ppm",
                "float",
                "By how much it is slow, from the first frame that is hit on",
                "ppm",
                0.1,
                100000.0,
                required=True,
            ),
        ),
        remark=_LOCAL,
        example={
            "kind": "frame.drift",
            "duration_s": 2.0,
            "parameters": {"message": "sync", "drift_ppm": 500.0},
        },
    ),
    FaultType(
        "frame.corrupt",
        "A bit error at a place of the frame; kind of error and counters follow from the place",
        "segment",
        "CAN medium",
        (
            *_SELECTION,
            Parameter(
                "attempts",
                "int",
                "Transmission attempts in a row that are hit",
                minimum=1,
                maximum=255,
                default=1,
            ),
            Parameter(
                "field", "text", "Field that is hit; stuff: a stuff bit", default="crc", choices=FIELDS
            ),
            Parameter(
                "bit",
                "int",
                "Number of the bit in the field, MSB first; negative: from its end",
                minimum=-64,
                maximum=63,
                default=-1,
            ),
            Parameter(
                "nodes",
                "text",
                "Names of the nodes that read the bit wrongly, with commas between; empty: all",
                default="",
            ),
        ),
        refused={"live": _NO_WIRE, "hardware": _NO_WIRE},
        example={"kind": "frame.corrupt", "count": 5, "parameters": {"message": "tpdo1", "attempts": 2}},
    ),
    FaultType(
        "frame.duplicate",
        "Frames are sent more than once",
        "segment",
        "CAN medium",
        (*_SELECTION, Parameter("copies", "int", "Additional copies", minimum=1, maximum=16, default=1)),
        remark=_LOCAL,
        example={"kind": "frame.duplicate", "count": 1, "parameters": {"message": "rpdo1"}},
    ),
    FaultType(
        "frame.replace",
        "The payload is exchanged before the frame reaches the wire",
        "segment",
        "CAN medium",
        (*_SELECTION, Parameter("data", "text", "New payload, hexadecimal, 0 to 8 bytes", required=True)),
        remark=_LOCAL,
        example={
            "kind": "frame.replace",
            "count": 1,
            "parameters": {"message": "tpdo1", "data": "3702 00000000"},
        },
    ),
    FaultType(
        "frame.length",
        "Frames are cut off, or padded with zeros, before they reach the wire",
        "segment",
        "CAN medium",
        (*_SELECTION, Parameter("length", "int", "Bytes that are left", minimum=0, maximum=8, required=True)),
        remark=_LOCAL,
        example={"kind": "frame.length", "count": 1, "parameters": {"message": "tpdo1", "length": 3}},
    ),
    FaultType(
        "frame.inject",
        "A foreign node sends a frame, once or over and over (flooding)",
        "segment",
        "CAN medium",
        (
            Parameter("can_id", "int", "Identifier", minimum=0, maximum=0x1FFFFFFF, required=True),
            Parameter("data", "text", "Payload, hexadecimal, 0 to 8 bytes", default=""),
            Parameter("extended", "bool", "29-bit identifier", default=False),
            Parameter(
                "period_s",
                "float",
                "Distance of repetitions; count says how many",
                "s",
                0.00005,
                3600.0,
                default=0.001,
            ),
        ),
        example={"kind": "frame.inject", "count": 100, "parameters": {"can_id": 0, "data": "8001"}},
    ),
    FaultType(
        "frame.lose_arbitration",
        "Rivals start together with the frame and win the arbitration",
        "segment",
        "CAN medium",
        (
            *_SELECTION,
            Parameter("rivals", "int", "Frames that win in a row", minimum=1, maximum=10_000, default=1),
            Parameter("rival_id", "int", "Identifier of the rivals", minimum=0, maximum=0x7FF, default=0x001),
        ),
        refused={"live": _NO_RACE, "hardware": _NO_RACE},
        example={
            "kind": "frame.lose_arbitration",
            "count": 5,
            "parameters": {"message": "tpdo1", "rivals": 20},
        },
    ),
    FaultType(
        "frame.collide",
        "A second node sends the same identifier with other content at the same time",
        "segment",
        "CAN medium",
        (
            *_SELECTION,
            Parameter("data", "text", "Payload of the other, hexadecimal; empty: the inverse", default=""),
        ),
        refused={"live": _NO_RACE, "hardware": _NO_RACE},
        example={"kind": "frame.collide", "count": 1, "parameters": {"message": "tpdo1"}},
    ),
    *CAN_FAULTS,
    *DRIVE_FAULTS,
    *SAFETY_FAULTS,
    *TELEGRAM_FAULTS,
    *MODBUS_FAULTS,
    *MACHINE_FAULTS,
    *ANY_ENCODER,
    *MOTOR_ENCODER_FAULTS,
    *PROFIDRIVE_ENCODER,
    *OWN_DEVICE,
    *IO_FAULTS,
    *CONTROLLER_FAULTS,
    FaultType(
        "axis.alarm",
        "The controller raises a technology alarm by itself",
        "axis",
        "alarm engine of the axis",
        (
            Parameter("number", "int", "Number of the alarm", minimum=101, maximum=999, required=True),
            Parameter(
                "reaction", "int", "Reaction 0..5; not given: the one of the alarm", minimum=0, maximum=5
            ),
            Parameter(
                "persistent",
                "bool",
                "The cause stays until the fault is removed: acknowledging does not help",
                default=False,
            ),
        ),
        example={"kind": "axis.alarm", "target": "axis1", "parameters": {"number": 521, "reaction": 4}},
    ),
)

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
