"""The catalogue: faults of I/O stations, of the terminals of drives, and of pulse modules."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from fieldbus.profidrive.words import ENCODER_ERRORS
from hil.faults._parameters import Environment, FaultType, Parameter

_NO_HAND: Final = "there is no seam at a physical one; it would need switched I/O between station and machine"
_REFUSED: Final[Mapping[Environment, str]] = {
    "live": "stations are emulated on virtual benches only",
    "hardware": _NO_HAND,
}
_KINDS: Final = ("input", "output", "analog_input", "analog_output", "counter")
_CHANNEL: Final = Parameter("channel", "text", "Kind of channel", default="input", choices=_KINDS)
_NUMBER: Final = Parameter(
    "number", "int", "Number of the channel, from 0 on", minimum=0, maximum=511, default=0
)

IO_FAULTS: Final[tuple[FaultType, ...]] = (
    FaultType(
        "io.stuck",
        "A channel stands at a value, whatever comes or is written",
        "station",
        "I/O channel",
        (
            _CHANNEL,
            _NUMBER,
            Parameter(
                "value",
                "float",
                "Level 0 or 1, or V; a counter stands where it is",
                minimum=-1000.0,
                maximum=1000.0,
                default=0.0,
            ),
        ),
        refused=_REFUSED,
        example={
            "kind": "io.stuck",
            "target": "io",
            "parameters": {"channel": "output", "number": 0, "value": 1.0},
        },
    ),
    FaultType(
        "io.wire_break",
        "The wire of a channel is broken: level 0, 0 V, or a count that stands",
        "station",
        "I/O channel",
        (_CHANNEL, _NUMBER),
        refused=_REFUSED,
        example={"kind": "io.wire_break", "target": "io", "parameters": {"channel": "counter"}},
    ),
    FaultType(
        "io.bounce",
        "A digital input bounces, with intervals from the seeded stream, and stays at its last level",
        "station",
        "I/O channel",
        (
            _NUMBER,
            Parameter("pulses", "int", "Number of pulses", minimum=1, maximum=1000, default=5),
            Parameter(
                "shortest_s", "float", "Shortest interval between edges", "s", 0.00001, 1.0, default=0.0002
            ),
            Parameter(
                "longest_s", "float", "Longest interval between edges", "s", 0.00001, 1.0, default=0.003
            ),
            Parameter("level", "bool", "Level after bouncing, held until the fault is removed", default=True),
        ),
        refused=_REFUSED,
        example={"kind": "io.bounce", "target": "io", "parameters": {"number": 2, "pulses": 8}},
    ),
    FaultType(
        "io.swapped",
        "The wires of two channels of a kind are exchanged",
        "station",
        "I/O channel",
        (
            _CHANNEL,
            _NUMBER,
            Parameter("other", "int", "Number of the other channel", minimum=0, maximum=511, required=True),
        ),
        refused=_REFUSED,
        example={"kind": "io.swapped", "target": "io", "parameters": {"number": 1, "other": 2}},
    ),
    FaultType(
        "io.analog",
        "An analog channel is wrong: offset, gain, noise from the seeded stream",
        "station",
        "I/O channel",
        (
            Parameter(
                "channel",
                "text",
                "Kind of channel",
                default="analog_output",
                choices=("analog_input", "analog_output"),
            ),
            _NUMBER,
            Parameter("offset_V", "float", "Offset", "V", -20.0, 20.0, default=0.0),
            Parameter("gain", "float", "Gain", minimum=-10.0, maximum=10.0, default=1.0),
            Parameter("noise_V", "float", "Largest deviation either way", "V", 0.0, 20.0, default=0.0),
        ),
        refused=_REFUSED,
        example={"kind": "io.analog", "target": "io", "parameters": {"offset_V": 0.1}},
    ),
    FaultType(
        "io.power_off",
        "A station is without supply: it does not answer, its outputs are off; it starts anew at the end",
        "station",
        "I/O station",
        refused=_REFUSED,
        example={"kind": "io.power_off", "target": "io", "duration_s": 0.5},
    ),
    FaultType(
        "terminal.ready_stuck",
        "The ready signal of a drive has a level, whatever the drive does: analog drives, power stages of "
        "stepper motors",
        "drive",
        "drive internals",
        (Parameter("level", "bool", "Level", default=False),),
        refused={"hardware": _NO_HAND},
        example={"kind": "terminal.ready_stuck", "target": "drive1", "duration_s": 0.2},
    ),
    FaultType(
        "pto.output_short",
        "Short circuit at an output of the pulse module: both channels stop, drive and encoder error",
        "drive",
        "pulse module",
        (
            Parameter(
                "channel",
                "int",
                "Channel with the short circuit; the motor is at channel 0",
                minimum=0,
                maximum=1,
                default=0,
            ),
        ),
        refused={"hardware": _NO_HAND},
        example={"kind": "pto.output_short", "target": "drive1", "duration_s": 0.2},
    ),
    FaultType(
        "pto.supply_off",
        "The load supply of the outputs is missing: no pulses, no valid encoder value",
        "drive",
        "pulse module",
        refused={"hardware": _NO_HAND},
        example={"kind": "pto.supply_off", "target": "drive1", "duration_s": 0.2},
    ),
    FaultType(
        "pto.module_fault",
        "The pulse module is pulled out of its station: its input data are 0",
        "drive",
        "pulse module",
        refused={"hardware": _NO_HAND},
        example={"kind": "pto.module_fault", "target": "drive1", "duration_s": 0.2},
    ),
    FaultType(
        "pto.encoder_error",
        "The encoder feedback reports an error, as soon as its cause can act",
        "drive",
        "pulse module",
        (
            Parameter(
                "code",
                "int",
                "Code in G1_XIST2",
                minimum=min(ENCODER_ERRORS),
                maximum=max(ENCODER_ERRORS),
                default=1,
            ),
        ),
        refused={"hardware": _NO_HAND},
        example={
            "kind": "pto.encoder_error",
            "target": "drive1",
            "duration_s": 0.2,
            "parameters": {"code": 1},
        },
    ),
    FaultType(
        "pto.step_loss",
        "The shaft of the stepper motor slips by whole electrical periods of four full steps",
        "drive",
        "mechanics",
        (
            Parameter(
                "periods",
                "int",
                "Periods by which it lags behind; negative: ahead",
                minimum=-10_000,
                maximum=10_000,
                default=1,
            ),
        ),
        lasting=False,
        refused={"hardware": _NO_HAND},
        example={"kind": "pto.step_loss", "target": "drive1", "parameters": {"periods": 5}},
    ),
)
"""Kinds of stations, terminals and pulse modules."""

NOT_FUZZED: Final = frozenset(entry.name for entry in IO_FAULTS)
"""Kinds that a fuzz search leaves out: stations lie to the axis, and a stepper motor that slips is not
noticed by anybody.
"""
