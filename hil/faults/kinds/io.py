"""Faults of I/O stations, of the terminals of drives, and of pulse modules."""

from __future__ import annotations

from functools import partial
from typing import Final

from fieldbus.profidrive.words import ENCODER_ERRORS
from hil.faults import seams
from hil.faults._kind import (
    Action,
    Custom,
    Family,
    FaultType,
    Held,
    Injection,
    Once,
    SupplyCut,
    bouncing,
    check_intervals,
    override_action,
    toggled,
)
from hil.faults._overrides import Override
from hil.faults._parameters import Environment, Parameter


def _find_station(injection: Injection) -> seams.IoStation:
    """Return the station that is meant; without a name the first one."""
    bench = injection.bench
    if not seams.offers(bench, seams.BenchWithStations) or not bench.station_names:
        injection.refuse("this bench has no I/O station")
    station: seams.IoStation = bench.station(injection.target or None)
    injection.check_environment(station)
    return station


def _held(injection: Injection, kind: str, value: float) -> tuple[str, Override[float]]:
    """Return the name of the station, and the override of a channel; all kinds that hold channels
    share it.
    """
    station, number = _find_station(injection), injection.values.integer("number")
    station.check_channel(kind, number)
    return station.name, injection.override(
        (station.name, "stuck", kind, number),
        value,
        lambda values: station.hold(kind, number, values[-1]),
        lambda: station.hold(kind, number, None),
    )


def _stick(injection: Injection) -> Action:
    values = injection.values
    return override_action(*_held(injection, values.text("channel"), values.number("value")))


def _bounce(injection: Injection) -> Action:
    final = injection.values.flag("level")
    target, channel = _held(injection, "input", 0.0)
    return bouncing(injection, target, channel, final)


def _break_wire(injection: Injection) -> Action:
    station, values = _find_station(injection), injection.values
    kind, number = values.text("channel"), values.integer("number")
    station.check_channel(kind, number)
    override = injection.override(
        (station.name, "wire", kind, number),
        True,
        lambda _: station.break_wire(kind, number, True),
        lambda: station.break_wire(kind, number, False),
    )
    return override_action(station.name, override)


def _swap(injection: Injection) -> Action:
    station, values = _find_station(injection), injection.values
    kind, pair = values.text("channel"), (values.integer("number"), values.integer("other"))
    for number in pair:
        station.check_channel(kind, number)
    override = injection.override(
        (station.name, "wires", kind),
        pair,
        lambda pairs: station.rewire(kind, pairs),
        lambda: station.rewire(kind, ()),
        effective=tuple,
    )
    return override_action(station.name, override)


def _disturb(injection: Injection) -> Action:
    station, values = _find_station(injection), injection.values
    kind, number = values.text("channel"), values.integer("number")
    station.check_channel(kind, number)

    def disturb(offset: float = 0.0, gain: float = 1.0, noise: float = 0.0) -> None:
        station.disturb(kind, number, offset=offset, gain=gain, noise=noise)

    override = injection.override(
        (station.name, "disturbance", kind, number),
        (values.number("offset_V"), values.number("gain"), values.number("noise_V")),
        lambda settings: disturb(*settings[-1]),
        disturb,
    )
    return override_action(station.name, override)


# -- kinds -----------------------------------------------------------------------------------------------

_REFUSED: Final[dict[Environment, str]] = {
    "hardware": "there is no seam at a physical one; it would need switched I/O between station and machine",
}
_TERMINAL_REFUSED: Final[dict[Environment, str]] = {"hardware": _REFUSED["hardware"]}
_KINDS: Final = ("input", "output", "analog_input", "analog_output", "counter")
_CHANNEL: Final = Parameter("channel", "text", "Kind of channel", default="input", choices=_KINDS)
_NUMBER: Final = Parameter(
    "number", "int", "Number of the channel, from 0 on", minimum=0, maximum=511, default=0
)
_station_kind: Final = partial(FaultType, target="station", refused=_REFUSED)
_drive_kind: Final = partial(FaultType, target="drive", refused=_TERMINAL_REFUSED)

FAMILY: Final = Family(
    kinds=(
        _station_kind(
            "io.stuck",
            "A channel is stuck at a value, whatever comes or is written",
            Custom(_stick),
            seam="I/O channel",
            parameters=(
                _CHANNEL,
                _NUMBER,
                Parameter(
                    "value",
                    "float",
                    "Level 0 or 1, or V; a counter stands still",
                    minimum=-1000.0,
                    maximum=1000.0,
                    default=0.0,
                ),
            ),
            example={"target": "io", "parameters": {"channel": "output", "number": 0, "value": 1.0}},
            fuzzed=False,
        ),
        _station_kind(
            "io.wire_break",
            "The wire of a channel is broken: level 0, 0 V, or a count that stands still",
            Custom(_break_wire),
            seam="I/O channel",
            parameters=(
                _CHANNEL,
                _NUMBER,
            ),
            example={"target": "io", "parameters": {"channel": "counter"}},
            fuzzed=False,
        ),
        _station_kind(
            "io.bounce",
            "A digital input bounces, with intervals from the seeded stream, and stays at its last level",
            Custom(_bounce),
            seam="I/O channel",
            parameters=(
                _NUMBER,
                Parameter("pulses", "int", "Number of pulses", minimum=1, maximum=1000, default=5),
                Parameter(
                    "shortest_s",
                    "float",
                    "Shortest interval between edges",
                    unit="s",
                    minimum=1e-05,
                    maximum=1.0,
                    default=0.0002,
                ),
                Parameter(
                    "longest_s",
                    "float",
                    "Longest interval between edges",
                    unit="s",
                    minimum=1e-05,
                    maximum=1.0,
                    default=0.003,
                ),
                Parameter(
                    "level", "bool", "Level after bouncing, held until the fault is removed", default=True
                ),
            ),
            example={"target": "io", "parameters": {"number": 2, "pulses": 8}},
            check_values=check_intervals,
            fuzzed=False,
        ),
        _station_kind(
            "io.swapped",
            "The wires of two channels of a kind are exchanged",
            Custom(_swap),
            seam="I/O channel",
            parameters=(
                _CHANNEL,
                _NUMBER,
                Parameter(
                    "other", "int", "Number of the other channel", minimum=0, maximum=511, required=True
                ),
            ),
            example={"target": "io", "parameters": {"number": 1, "other": 2}},
            fuzzed=False,
        ),
        _station_kind(
            "io.analog",
            "An analog channel is wrong: offset, gain, noise from the seeded stream",
            Custom(_disturb),
            seam="I/O channel",
            parameters=(
                Parameter(
                    "channel",
                    "text",
                    "Kind of channel",
                    default="analog_output",
                    choices=("analog_input", "analog_output"),
                ),
                _NUMBER,
                Parameter("offset_V", "float", "Offset", unit="V", minimum=-20.0, maximum=20.0, default=0.0),
                Parameter("gain", "float", "Gain", minimum=-10.0, maximum=10.0, default=1.0),
                Parameter(
                    "noise_V",
                    "float",
                    "Largest deviation either way",
                    unit="V",
                    minimum=0.0,
                    maximum=20.0,
                    default=0.0,
                ),
            ),
            example={"target": "io", "parameters": {"offset_V": 0.1}},
            fuzzed=False,
        ),
        _station_kind(
            "io.power_off",
            (
                "A station is without supply: it does not answer, its outputs are off; it starts again at"
                " the end"
            ),
            SupplyCut(find=_find_station),
            seam="I/O station",
            example={"target": "io", "duration_s": 0.5},
            fuzzed=False,
        ),
        _drive_kind(
            "terminal.ready_stuck",
            (
                "The ready signal of a drive has a level, whatever the drive does: analog drives, power "
                "stages of stepper motors"
            ),
            Held(
                seams.HasReadySignal,
                lambda drive, p: drive.force_ready(p.flag("level")),
                lambda drive, _: drive.force_ready(None),
            ),
            seam="drive internals",
            parameters=(Parameter("level", "bool", "Level", default=False),),
            example={"target": "drive1", "duration_s": 0.2},
            fuzzed=False,
        ),
        _drive_kind(
            "pto.output_short",
            "Short circuit at an output of the pulse module: both channels stop, drive and encoder error",
            Held(
                seams.HasPulseOutputs,
                lambda drive, p: drive.short_outputs(True, p.integer("channel")),
                lambda drive, p: drive.short_outputs(False, p.integer("channel")),
                per=("channel",),
            ),
            seam="pulse module",
            parameters=(
                Parameter(
                    "channel",
                    "int",
                    "Channel with the short circuit; the motor is at channel 0",
                    minimum=0,
                    maximum=1,
                    default=0,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.2},
            fuzzed=False,
        ),
        _drive_kind(
            "pto.supply_off",
            "The load supply of the outputs is missing: no pulses, no valid encoder value",
            toggled(seams.HasLoadSupply, lambda drive, active: drive.disconnect_load_supply(active)),
            seam="pulse module",
            example={"target": "drive1", "duration_s": 0.2},
            fuzzed=False,
        ),
        _drive_kind(
            "pto.module_fault",
            "The pulse module is pulled out of its station: its input data are 0",
            toggled(seams.IsPluggedIn, lambda drive, active: drive.unplug_module(active)),
            seam="pulse module",
            example={"target": "drive1", "duration_s": 0.2},
            fuzzed=False,
        ),
        _drive_kind(
            "pto.encoder_error",
            "The encoder feedback reports an error, as soon as its cause can act",
            Held(
                seams.HasEncoderFeedback,
                lambda drive, p: drive.report_encoder_error(p.integer("code"), True),
                lambda drive, p: drive.report_encoder_error(p.integer("code"), False),
                per=("code",),
            ),
            seam="pulse module",
            parameters=(
                Parameter(
                    "code",
                    "int",
                    "Code in G1_XIST2",
                    minimum=min(ENCODER_ERRORS),
                    maximum=max(ENCODER_ERRORS),
                    default=1,
                ),
            ),
            example={"target": "drive1", "duration_s": 0.2, "parameters": {"code": 1}},
            fuzzed=False,
        ),
        _drive_kind(
            "pto.step_loss",
            "The shaft of the stepper motor slips by whole electrical periods of four full steps",
            Once(seams.HasStepperMotor, lambda drive, p: drive.lose_steps(p.integer("periods"))),
            seam="mechanics",
            parameters=(
                Parameter(
                    "periods",
                    "int",
                    "Periods by which it lags behind; negative: ahead",
                    minimum=-10000,
                    maximum=10000,
                    default=1,
                ),
            ),
            lasting=False,
            example={"target": "drive1", "parameters": {"periods": 5}},
            fuzzed=False,
        ),
    ),
)
