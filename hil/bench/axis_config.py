"""`[axis.NAME]` and `[external_encoder.NAME]` of a bench file: technology objects of the controller."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, PlainValidator, WithJsonSchema

from hil.bench._table import Table


def second_of(drive: str) -> str:
    """Return the name of the second encoder of a drive."""
    return f"{drive}.encoder2"


def _start_value(value: object) -> object:
    """Return a start value as it is; a text is refused, whatever it says."""
    if not isinstance(value, bool | int | float):
        raise ValueError("allowed: a number, true or false")  # noqa: TRY004 - it becomes a message about the file
    return value


StartValue = Annotated[
    bool | int | float, PlainValidator(_start_value), WithJsonSchema({"type": ["number", "boolean"]})
]
HomingInput = Literal["home", "negative_limit", "positive_limit"]


class AxisTable(Table):
    """`[axis.NAME]`: a technology object."""

    type: Literal["positioning", "speed", "synchronous"] = "positioning"
    """Technology object."""
    drive: str
    """Name of the drive that the axis moves; each drive once."""
    inputs: str | None = None
    """Station at which the limit and home switches of the drive count for this axis; none: those at the
    drive, or at the station of an analog drive; the name of a station.
    """
    inputs_update: Literal["servo", "program"] = "servo"
    """When the axis takes its limit switches over: in every cycle (`PIP OB Servo`), or with every call of
    the program (`program_cycles`), as an ordinary process image.
    """
    homing_input: HomingInput = "home"
    """Switch that is reference cam or homing mark in `ActiveHoming.Mode` and `PassiveHoming.Mode` 1 and 2; a
    limit switch for homing on it.
    """
    encoders: Annotated[tuple[str, ...], Field(max_length=4)] | None = None
    """Where `Sensor[1]`, `Sensor[2]`, ... come from: the name of the drive for its own encoder,
    `NAME.encoder2` for its second one in the telegram, or names of encoders; without the key the drive,
    with both of its encoders where telegram 6 or 106 carries them to an S7-1500T.
    """
    connection: Literal["direct", "data_block"] = "direct"
    """`data_block`: a program of the test stands between telegram and axis ([Axes](axis-configuration.md));
    PROFIdrive only.
    """
    enable_timeout_s: Annotated[float, Field(gt=0.0, le=3600.0)] | None = None
    """Longest time from the beginning of the enable sequence to operation, then alarm 421; none: `MC_Power`
    waits without limit.
    """
    ramp_times: dict[str, float] = {}
    """Ramps as times in place of accelerations ([Axes](axis-configuration.md))."""
    variables: dict[str, StartValue] = {}
    """Start values of the technology object, by original path."""


class ExternalEncoderTable(Table):
    """`[external_encoder.NAME]`: a technology object that reads an encoder and moves nothing."""

    encoder: str
    """Name of the encoder, on a segment where the bench is the controller."""
    drive: str | None = None
    """One of its switches is wired to the digital input of this object too: reference cam or homing mark of
    a passive homing; the name of a drive with an axis.
    """
    homing_input: HomingInput = "home"
    """That switch."""
    variables: dict[str, StartValue] = {}
    """Start values of the technology object, by original path."""
