"""The catalogue: faults of switches and mechanics, and those of the motor encoder that need a drive."""

from __future__ import annotations

from typing import Final

from hil.faults._parameters import FaultType, Parameter

_INPUTS: Final = ("negative_limit", "positive_limit", "home", "probe1", "probe2")
_NO_HAND: Final = (
    "a physical drive has no seam for this; it would need switched I/O or a test adapter on the machine"
)

MACHINE_FAULTS: Final[tuple[FaultType, ...]] = (
    FaultType(
        "switch.press",
        "A limit switch, the home switch or a probe is actuated",
        "switch",
        "switch",
        (Parameter("input", "text", "Which switch", required=True, choices=_INPUTS),),
        refused={"hardware": _NO_HAND},
        example={"kind": "switch.press", "target": "drive1", "parameters": {"input": "positive_limit"}},
    ),
    FaultType(
        "switch.stuck",
        "A switch no longer follows the mechanics",
        "switch",
        "switch",
        (
            Parameter("input", "text", "Which switch", required=True, choices=_INPUTS),
            Parameter("state", "bool", "State that it is stuck in", default=False),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "switch.stuck", "target": "drive1", "parameters": {"input": "home", "state": False}},
    ),
    FaultType(
        "switch.bounce",
        "A switch bounces, with intervals from the seeded stream, and ends actuated or free",
        "switch",
        "switch",
        (
            Parameter("input", "text", "Which switch", required=True, choices=_INPUTS),
            Parameter("pulses", "int", "Number of pulses", minimum=1, maximum=1000, default=5),
            Parameter(
                "shortest_s", "float", "Shortest interval between edges", "s", 0.00001, 1.0, default=0.0002
            ),
            Parameter(
                "longest_s", "float", "Longest interval between edges", "s", 0.00001, 1.0, default=0.003
            ),
            Parameter("state", "bool", "State after bouncing, held until the fault is removed", default=True),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "switch.bounce", "target": "drive1", "parameters": {"input": "home", "pulses": 8}},
    ),
    FaultType(
        "switch.inverted",
        "A switch reports the opposite of what the load does, as one that is wired the wrong way",
        "switch",
        "switch",
        (Parameter("input", "text", "Which switch", required=True, choices=_INPUTS),),
        refused={"hardware": _NO_HAND},
        example={"kind": "switch.inverted", "target": "drive1", "parameters": {"input": "home"}},
    ),
    FaultType(
        "switch.swapped",
        "The wires of the two limit switches are exchanged",
        "switch",
        "switch",
        refused={"hardware": _NO_HAND},
        example={"kind": "switch.swapped", "target": "drive1"},
    ),
    FaultType(
        "probe.pulse",
        "A touch probe input is actuated for a moment, at any time between two cycles",
        "switch",
        "switch",
        (
            Parameter("input", "text", "Which probe", required=True, choices=("probe1", "probe2")),
            Parameter("width_s", "float", "How long", "s", 0.000001, 10.0, default=0.001),
        ),
        lasting=False,
        refused={"hardware": _NO_HAND},
        remark="on a live bench the width is that of the pipe to the drive process",
        example={
            "kind": "probe.pulse",
            "target": "drive1",
            "parameters": {"input": "probe1", "width_s": 0.0005},
        },
    ),
    FaultType(
        "mechanics.jam",
        "The load is blocked where it stands",
        "mechanics",
        "mechanics",
        refused={"hardware": _NO_HAND},
        example={"kind": "mechanics.jam", "target": "drive1", "duration_s": 0.2},
    ),
    FaultType(
        "mechanics.load_step",
        "An external force acts on the load",
        "mechanics",
        "mechanics",
        (Parameter("force_N", "float", "Force along the axis, signed", "N", -1e6, 1e6, required=True),),
        refused={"hardware": _NO_HAND},
        example={
            "kind": "mechanics.load_step",
            "target": "drive1",
            "duration_s": 0.5,
            "parameters": {"force_N": 400.0},
        },
    ),
    FaultType(
        "mechanics.friction",
        "Dry friction at the load grows: a guide or bearing goes bad",
        "mechanics",
        "mechanics",
        (
            Parameter(
                "force_N",
                "float",
                "Friction that is added; Nm on a rotary axis",
                "N",
                0.0,
                1e6,
                required=True,
            ),
        ),
        refused={"hardware": _NO_HAND},
        example={
            "kind": "mechanics.friction",
            "target": "drive1",
            "duration_s": 0.5,
            "parameters": {"force_N": 250.0},
        },
    ),
    FaultType(
        "mechanics.slip",
        "The coupling slips: the load is displaced, and the motor encoder sees nothing of it",
        "mechanics",
        "mechanics",
        (
            Parameter(
                "revolutions",
                "float",
                "Revolutions of the motor by which the load slips, signed",
                "rev",
                -1000.0,
                1000.0,
                required=True,
            ),
        ),
        lasting=False,
        refused={"hardware": _NO_HAND},
        example={"kind": "mechanics.slip", "target": "drive1", "parameters": {"revolutions": -0.5}},
    ),
    FaultType(
        "mechanics.backlash",
        "Play between motor and load grows: an encoder at the motor sees nothing of it, one at the load does",
        "mechanics",
        "mechanics",
        (
            Parameter(
                "backlash_mm",
                "float",
                "Play that is added, from one side to the other",
                "mm",
                0.0,
                100.0,
                required=True,
            ),
            Parameter(
                "growth_s",
                "float",
                "Time within which it grows, evenly; 0: at once",
                "s",
                0.0,
                36000.0,
                default=0.0,
            ),
        ),
        refused={"hardware": _NO_HAND},
        remark="mended, the load is drawn to where the motor is",
        example={
            "kind": "mechanics.backlash",
            "target": "drive1",
            "duration_s": 0.5,
            "parameters": {"backlash_mm": 0.5},
        },
    ),
    FaultType(
        "mechanics.coupling_break",
        "The coupling breaks for good: the motor turns alone, the load coasts or falls",
        "mechanics",
        "mechanics",
        (
            Parameter(
                "motor_share",
                "float",
                "Share of the whole inertia that stays with the motor",
                minimum=0.01,
                maximum=0.99,
                default=0.3,
            ),
        ),
        lasting=False,
        refused={"hardware": _NO_HAND},
        example={"kind": "mechanics.coupling_break", "target": "drive1", "parameters": {"motor_share": 0.3}},
    ),
)
"""Kinds at the machine."""

MOTOR_ENCODER_FAULTS: Final[tuple[FaultType, ...]] = (
    FaultType(
        "encoder.drift",
        "The reported position drifts away and stays displaced at the end",
        "encoder",
        "encoder",
        (
            Parameter(
                "increments_per_s",
                "float",
                "Speed of the drift, signed",
                "increments/s",
                -1e9,
                1e9,
                required=True,
            ),
        ),
        refused={"hardware": _NO_HAND},
        example={
            "kind": "encoder.drift",
            "target": "drive1",
            "duration_s": 1.0,
            "parameters": {"increments_per_s": 5000.0},
        },
    ),
    FaultType(
        "encoder.scale",
        "The encoder counts too much or too little of the motion, and stays displaced at the end",
        "encoder",
        "encoder",
        (Parameter("factor", "float", "What it counts of an increment", "", 0.01, 100.0, required=True),),
        refused={"hardware": _NO_HAND},
        remark="every loop believes it: there is no following error, and the load goes elsewhere",
        example={"kind": "encoder.scale", "target": "drive1", "parameters": {"factor": 0.9}},
    ),
    FaultType(
        "encoder.wire_break",
        "The signal of the encoder is lost; the drive notices and coasts with 7305h, absolute 7320h",
        "encoder",
        "encoder",
        refused={"hardware": _NO_HAND},
        remark="an incremental encoder has lost its reference afterwards",
        example={"kind": "encoder.wire_break", "target": "drive1", "duration_s": 0.5},
    ),
)
"""Kinds at the motor encoder that need its drive."""
