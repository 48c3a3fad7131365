"""Faults of encoders: of the motor encoder of a drive, and of encoders that are devices of their own
(C402-312).
"""

from __future__ import annotations

from typing import Final

from hil.faults._parameters import FaultType, Parameter

ALARM_BITS: Final = {"position_error": 0, **{f"manufacturer_{bit}": bit for bit in range(12, 16)}}
"""Alarms by name: bits of 6503h."""
WARNING_BITS: Final = {
    "frequency_exceeded": 0,
    "light_control_reserve": 1,
    "cpu_watchdog": 2,
    "operating_time_limit": 3,
    "battery_charge": 4,
    "reference_point_not_reached": 5,
    **{f"manufacturer_{bit}": bit for bit in range(12, 16)},
}
"""Warnings by name: bits of 6505h."""

_NO_HAND: Final = (
    "a physical encoder has no seam for this; it would need a test adapter between encoder and bus"
)

ANY_ENCODER: Final[tuple[FaultType, ...]] = (
    FaultType(
        "encoder.freeze",
        "The reported position no longer changes",
        "encoder",
        "encoder",
        refused={"hardware": _NO_HAND},
        example={"kind": "encoder.freeze", "target": "drive1", "duration_s": 0.1},
    ),
    FaultType(
        "encoder.jump",
        "The reported position jumps and stays displaced",
        "encoder",
        "encoder",
        (
            Parameter(
                "increments", "int", "Displacement, signed", "increments", -(2**31), 2**31 - 1, required=True
            ),
        ),
        lasting=False,
        refused={"hardware": _NO_HAND},
        example={"kind": "encoder.jump", "target": "drive1", "parameters": {"increments": 20000}},
    ),
    FaultType(
        "encoder.noise",
        "Every sample is disturbed by a random number of steps, from the seeded stream",
        "encoder",
        "encoder",
        (
            Parameter(
                "increments", "int", "Largest disturbance, either way", "increments", 1, 2**20, required=True
            ),
        ),
        refused={"hardware": _NO_HAND},
        example={
            "kind": "encoder.noise",
            "target": "drive1",
            "duration_s": 0.5,
            "parameters": {"increments": 8},
        },
    ),
    FaultType(
        "encoder.reverse",
        "The encoder counts the other way round, from the present position on",
        "encoder",
        "encoder",
        refused={"hardware": _NO_HAND},
        remark="a drive that controls with it runs away",
        example={"kind": "encoder.reverse", "target": "encoder1", "duration_s": 0.2},
    ),
    FaultType(
        "encoder.step_loss",
        "One of so many steps of the motion is not counted, and stays missing",
        "encoder",
        "encoder",
        (Parameter("every", "int", "Steps of which one is lost", "increments", 2, 2**31 - 1, default=1000),),
        refused={"hardware": _NO_HAND},
        example={
            "kind": "encoder.step_loss",
            "target": "encoder1",
            "duration_s": 1.0,
            "parameters": {"every": 100},
        },
    ),
    FaultType(
        "encoder.index_missing",
        "The index of the encoder does not come",
        "encoder",
        "encoder",
        refused={"hardware": _NO_HAND},
        example={"kind": "encoder.index_missing", "target": "drive1"},
    ),
)
"""Kinds that hit the encoder of a drive as well as one that is a device of its own."""

PROFIDRIVE_ENCODER: Final[tuple[FaultType, ...]] = (
    FaultType(
        "encoder.error",
        "An encoder with a PROFIdrive interface shows an error (Gx_ZSW bit 15, code in Gx_XIST2)",
        "encoder",
        "encoder words",
        (Parameter("code", "int", "Code", minimum=0x0001, maximum=0x1001, required=True),),
        refused={"hardware": _NO_HAND},
        remark="0003h to 0008h and 000Ah come when the controller asks for what they abort",
        example={
            "kind": "encoder.error",
            "target": "drive1",
            "duration_s": 0.5,
            "parameters": {"code": 0x0001},
        },
    ),
)
"""Kinds that need an encoder with a PROFIdrive interface: that of an axis, its second one, or a device of its
own.
"""

OWN_DEVICE: Final[tuple[FaultType, ...]] = (
    FaultType(
        "encoder.preset",
        "Somebody writes a preset, whatever moves",
        "encoder",
        "encoder device",
        (
            Parameter(
                "value", "int", "Preset, taken into the range of 6002h", "steps", 0, 2**31 - 1, default=0
            ),
        ),
        lasting=False,
        refused={"hardware": _NO_HAND},
        remark="over the bus a controller can do the same to a physical encoder",
        example={"kind": "encoder.preset", "target": "encoder1", "parameters": {"value": 1000}},
    ),
    FaultType(
        "encoder.overflow",
        "The position is placed just before an end of its range, so that the next motion wraps it",
        "encoder",
        "encoder device",
        (
            Parameter("margin", "int", "Distance to that end", "steps", 1, 2**31 - 1, default=10),
            Parameter("end", "text", "Which end of the range", choices=("upper", "lower"), default="upper"),
        ),
        lasting=False,
        refused={"hardware": _NO_HAND},
        example={"kind": "encoder.overflow", "target": "encoder1", "parameters": {"margin": 5}},
    ),
    FaultType(
        "encoder.alarm",
        "The encoder reports that its position cannot be relied on, and holds it",
        "encoder",
        "encoder device",
        (Parameter("alarm", "text", "Which alarm", choices=tuple(ALARM_BITS), default="position_error"),),
        refused={"hardware": _NO_HAND},
        example={"kind": "encoder.alarm", "target": "encoder1", "duration_s": 0.5},
    ),
    FaultType(
        "encoder.warning",
        "The encoder warns; its position is good",
        "encoder",
        "encoder device",
        (Parameter("warning", "text", "Which warning", choices=tuple(WARNING_BITS), required=True),),
        refused={"hardware": _NO_HAND},
        example={
            "kind": "encoder.warning",
            "target": "encoder1",
            "parameters": {"warning": "battery_charge"},
        },
    ),
    FaultType(
        "encoder.cycle",
        "TPDO1 is sent with a wrong cycle time",
        "encoder",
        "CANopen service",
        (Parameter("period_ms", "int", "Wrong cycle time; 0: never by time", "ms", 0, 65535, required=True),),
        refused={"hardware": _NO_HAND},
        example={
            "kind": "encoder.cycle",
            "target": "encoder1",
            "duration_s": 0.5,
            "parameters": {"period_ms": 40},
        },
    ),
    FaultType(
        "encoder.clock_drift",
        "The clock of the encoder runs fast or slow: its cycle, heartbeats, measured speeds",
        "encoder",
        "clock of the node",
        (
            Parameter(
                "drift_ppm",
                "float",
                "By how much it is fast; negative: slow",
                "ppm",
                -100000.0,
                100000.0,
                required=True,
            ),
        ),
        refused={"hardware": _NO_HAND},
        remark="at the end it is as fast as the others again, but not set",
        example={
            "kind": "encoder.clock_drift",
            "target": "encoder1",
            "duration_s": 0.5,
            "parameters": {"drift_ppm": -500.0},
        },
    ),
    FaultType(
        "encoder.power_off",
        "The encoder vanishes from the bus without a word; it boots again at the end",
        "encoder",
        "CANopen node",
        refused={"hardware": _NO_HAND},
        example={"kind": "encoder.power_off", "target": "encoder1", "duration_s": 0.5},
    ),
    FaultType(
        "encoder.heartbeat_loss",
        "The encoder goes on working but sends no heartbeat",
        "encoder",
        "CANopen service",
        refused={"hardware": _NO_HAND},
        remark="frame.drop of the heartbeat does the same to a physical encoder",
        example={"kind": "encoder.heartbeat_loss", "target": "encoder1", "duration_s": 1.0},
    ),
)
"""Kinds that need an encoder with a node of its own."""

OWN_DEVICE_NAMES: Final = frozenset(entry.name for entry in OWN_DEVICE)
NOT_FUZZED: Final = OWN_DEVICE_NAMES | {
    "encoder.error",
    "encoder.noise",
    "encoder.reverse",
    "encoder.step_loss",
}
"""Kinds that a fuzz search leaves out: programs move axes, and nothing controls with an encoder of its own
yet.
"""
