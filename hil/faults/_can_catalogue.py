"""The faults of the CAN segment and its nodes, as data."""

from __future__ import annotations

from typing import Final

from hil.faults._parameters import Environment, FaultType, Parameter

_NO_WIRE: Final = "it needs access to the bits of the wire, which a bus adapter does not give"
_NO_NODE: Final = "it needs a seam in the CAN controller of the node, which a bus adapter does not give"
_NO_CABLE: Final = "it needs a hand at the cable"
_BRIDGE: Final = (
    "on a live segment with a bridge, whose sides are the nodes; without one it needs a hand at the cable"
)
_NODE: Final = Parameter("node", "text", "Name of the node on the segment", required=True)
_NODES: Final = Parameter(
    "nodes", "text", "Names of the nodes that are concerned, with commas between; empty: all", default=""
)


def _nowhere_else(reason: str) -> dict[Environment, str]:
    return {"live": reason, "hardware": reason}


CAN_FAULTS: Final[tuple[FaultType, ...]] = (
    FaultType(
        "can.noise",
        "Bits are read inverted at random, with a bit error rate",
        "segment",
        "CAN medium",
        (
            Parameter(
                "bit_error_rate",
                "float",
                "Chance of each bit, drawn from the seeded stream",
                minimum=1e-9,
                maximum=0.05,
                required=True,
            ),
            _NODES,
        ),
        refused=_nowhere_else(_NO_WIRE),
        example={
            "kind": "can.noise",
            "target": "can0",
            "duration_s": 0.1,
            "parameters": {"bit_error_rate": 0.001},
        },
    ),
    FaultType(
        "can.stuck_dominant",
        "The bus stays dominant: CAN_H to supply, or a transceiver that does not let go",
        "segment",
        "CAN medium",
        refused=_nowhere_else(_NO_CABLE),
        example={"kind": "can.stuck_dominant", "duration_s": 0.002},
    ),
    FaultType(
        "can.stuck_recessive",
        "The bus stays recessive: CAN_H and CAN_L shorted",
        "segment",
        "CAN medium",
        refused=_nowhere_else(_NO_CABLE),
        example={"kind": "can.stuck_recessive", "duration_s": 0.05},
    ),
    FaultType(
        "can.cable_break",
        "The cable breaks: the named nodes go on among themselves, and so do the others",
        "segment",
        "CAN medium",
        (Parameter("nodes", "text", "Names of the nodes of one side, with commas between", required=True),),
        remark=_BRIDGE,
        example={
            "kind": "can.cable_break",
            "target": "can0",
            "duration_s": 0.5,
            "parameters": {"nodes": "drive1"},
        },
    ),
    FaultType(
        "can.unplug",
        "The connector of a node is pulled: it runs on, alone on its bus",
        "segment",
        "CAN medium",
        (_NODE,),
        remark=_BRIDGE,
        example={"kind": "can.unplug", "duration_s": 0.5, "parameters": {"node": "drive1"}},
    ),
    FaultType(
        "can.babble",
        "A babbling node sends frame after frame without a pause",
        "segment",
        "CAN medium",
        (
            Parameter(
                "can_id",
                "int",
                "Identifier; a low one keeps everybody else from the bus",
                minimum=0,
                maximum=0x1FFFFFFF,
                default=0x001,
            ),
            Parameter("data", "text", "Payload, hexadecimal, 0 to 8 bytes", default=""),
            Parameter("extended", "bool", "29-bit identifier", default=False),
            Parameter("node", "text", "Name of the sender in the log", default="babbler"),
        ),
        remark="on a live bus in bursts, a millisecond long each, or as many frames as the adapter takes",
        example={"kind": "can.babble", "duration_s": 0.05, "parameters": {"can_id": 0x001}},
    ),
    FaultType(
        "can.load",
        "A foreign node loads the bus with random frames",
        "segment",
        "CAN medium",
        (
            Parameter(
                "load_percent",
                "float",
                "Share of the time that these frames alone occupy the bus",
                "%",
                0.1,
                100.0,
                required=True,
            ),
            Parameter("lowest_id", "int", "Lowest identifier", minimum=0, maximum=0x1FFFFFFF, default=0x6E0),
            Parameter(
                "highest_id", "int", "Highest identifier", minimum=0, maximum=0x1FFFFFFF, default=0x6FF
            ),
            Parameter("shortest", "int", "Least number of data bytes", minimum=0, maximum=8, default=0),
            Parameter("longest", "int", "Greatest number of data bytes", minimum=0, maximum=8, default=8),
            Parameter("extended", "bool", "29-bit identifiers", default=False),
        ),
        remark="on a live bus the load that the frames make at the bit rate of the bench file",
        example={"kind": "can.load", "duration_s": 0.5, "parameters": {"load_percent": 40.0}},
    ),
    FaultType(
        "can.no_ack",
        "Nodes receive without acknowledging",
        "segment",
        "CAN controller",
        (_NODES,),
        refused=_nowhere_else(_NO_NODE),
        example={"kind": "can.no_ack", "duration_s": 0.01},
    ),
    FaultType(
        "can.wrong_bitrate",
        "A node works at another bit rate",
        "segment",
        "CAN controller",
        (_NODE, Parameter("bitrate", "int", "Its bit rate", "bit/s", 1000, 1_000_000, required=True)),
        refused=_nowhere_else(_NO_NODE),
        example={
            "kind": "can.wrong_bitrate",
            "duration_s": 0.05,
            "parameters": {"node": "drive1", "bitrate": 250000},
        },
    ),
    FaultType(
        "can.bus_off",
        "A node goes bus-off at once",
        "segment",
        "CAN controller",
        (
            _NODE,
            Parameter(
                "recovery",
                "text",
                "When it begins to recover: at the removal of the fault, or by itself",
                default="at removal",
                choices=("at removal", "automatic"),
            ),
        ),
        refused=_nowhere_else(_NO_NODE),
        example={"kind": "can.bus_off", "duration_s": 0.1, "parameters": {"node": "drive1"}},
    ),
    FaultType(
        "can.overload",
        "A slow receiver asks for overload frames behind every frame that it receives",
        "segment",
        "CAN controller",
        (_NODE, Parameter("frames", "int", "Overload frames in succession", minimum=1, maximum=2, default=1)),
        refused=_nowhere_else(_NO_NODE),
        example={"kind": "can.overload", "duration_s": 0.1, "parameters": {"node": "drive1", "frames": 2}},
    ),
    FaultType(
        "can.receive_delay",
        "A node gets its frames later",
        "segment",
        "CAN controller",
        (_NODE, Parameter("delay_s", "float", "How much later", "s", 0.000001, 10.0, required=True)),
        refused=_nowhere_else(_NO_NODE),
        example={
            "kind": "can.receive_delay",
            "duration_s": 0.1,
            "parameters": {"node": "drive1", "delay_s": 0.003},
        },
    ),
    FaultType(
        "can.transmit_overrun",
        "The transmit queue of a node is too short: what does not fit is lost",
        "segment",
        "CAN controller",
        (_NODE, Parameter("buffers", "int", "Frames that may wait", minimum=1, maximum=256, default=1)),
        refused=_nowhere_else(_NO_NODE),
        example={"kind": "can.transmit_overrun", "duration_s": 0.1, "parameters": {"node": "drive1"}},
    ),
)
