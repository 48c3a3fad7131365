"""`[axis.NAME]` and `[external_encoder.NAME]` of a bench file: technology objects of the controller."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    PlainValidator,
    Tag,
    ValidationError,
    WithJsonSchema,
    model_validator,
)

from fieldbus.toml_text import number_hint
from hil.bench._table import Table, sentence
from hil.bench.nc_axis_config import NcAxisTable
from motion.s7.variables import elements, refused_values, variables_of

OBJECTS: Final[Mapping[str, str]] = {
    "positioning": "PositioningAxis",
    "speed": "SpeedAxis",
    "synchronous": "SynchronousAxis",
}
"""Technology object of a `type` of axis."""


def second_of(drive: str) -> str:
    """Return the name of the second encoder of a drive."""
    return f"{drive}.encoder2"


def _start_value(value: object) -> object:
    """Return a start value as it is; a text is refused, whatever it says."""
    if not isinstance(value, bool | int | float):
        text = f"allowed: a number, true or false{number_hint(value)}"
        raise ValueError(text)  # noqa: TRY004 - it becomes a message about the file
    return value


StartValue = Annotated[
    bool | int | float, PlainValidator(_start_value), WithJsonSchema({"type": ["number", "boolean"]})
]


def _paths(table: object) -> object:
    """Return the table of variables as it is; a path that is a table of its own has not been quoted."""
    if isinstance(table, Mapping):
        unquoted = [
            sentence(f'quote the path: "{path}" = {_toml(value)}', (key,), below)
            for key, below in table.items()
            if isinstance(below, Mapping)
            for path, value in _leaves(str(key), below)
        ]
        if unquoted:
            raise ValidationError.from_exception_data("variables", unquoted)
    return table


def _leaves(path: str, table: Mapping[object, object]) -> Iterator[tuple[str, object]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _leaves(f"{path}.{key}", value)
        else:
            yield f"{path}.{key}", value


def _toml(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else repr(value)


StartValues = Annotated[dict[str, StartValue], BeforeValidator(_paths)]


def check_variables(kind: str, variables: Mapping[str, object]) -> None:
    """Check start values against the variables of a technology object.

    Args:
        kind: Its type.
        variables: Values by path.

    Raises:
        ValidationError: With every variable that there is not, or that cannot have its value.

    """
    problems = []
    refused = {error.where: error for error in refused_values(kind, variables)}
    if kind == "SpeedAxis":
        of_positions = _paths_of("PositioningAxis") - _paths_of(kind)
        wrong = [path for path in refused if path in of_positions]
        for path in wrong:
            del refused[path]
        if wrong:
            text = f"a speed axis has no {', '.join(wrong)}: these are variables of axes with a position"
            problems.append(sentence(text, ("variables",), None))
    problems += [
        sentence(str(error).removeprefix(f"{path}: "), ("variables", path), error.value)
        for path, error in refused.items()
    ]
    if problems:
        raise ValidationError.from_exception_data(kind, problems)


def _paths_of(kind: str) -> set[str]:
    return {path for variable in variables_of(kind) for path in elements(variable)}


HomingInput = Literal["home", "negative_limit", "positive_limit"]


Coupling = Literal["setpoint", "actual", "delayed"]


class AxisTable(Table, frozen=True):
    """`[axis.NAME]`: a technology object."""

    label: ClassVar[str] = 'an axis with controller = "s7"'

    controller: Literal["s7"] = "s7"
    """Make of the controller: `s7` for technology objects, `nc` for an axis of an NC
    ([NC axes](nc-axis.md)).
    """
    type: Literal["positioning", "speed", "synchronous"] = "positioning"
    """Technology object."""
    drive: str = ""
    """Name of the drive that the axis moves; each drive once; a virtual axis (`"VirtualAxis.Mode" = 1`) may
    have none.
    """
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
    plc: str | None = None
    """Controller that has the axis, of `[controller.NAME]`; none: that of `[bench]`."""
    leading: tuple[str, ...] = ()
    """Axes, external encoders and proxies that this axis may follow, by name; for `type = "synchronous"`. An
    object that is not named cannot lead it (alarm 601).
    """
    coupling: dict[str, Coupling] = {}
    """How values of the axes in `leading` are taken, by name: the setpoint, the extrapolated `actual` value
    (S7-1500T), or the setpoint `delayed` by `CrossPlcSynchronousOperation.LocalLeadingValueDelayTime`;
    without an entry the setpoint. An external encoder has an actual value only.
    """
    hold_tolerance: Annotated[float, Field(ge=0.0, le=1e12)] = 0.0
    """Way back of a leading value that counts as none while the axis synchronises, or leaves it over a
    distance, leading axis unit; a longer one is alarm 608. From technology version V9.0 on.
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
    variables: StartValues = {}
    """Start values of the technology object, by original path."""

    @model_validator(mode="after")
    def _has_what_it_says(self) -> AxisTable:
        if not self.drive:
            self._does_without_a_drive()
        if self.type == "speed" and self.encoders is not None:
            raise ValueError("encoders: a speed axis has no encoder (CFG-174)")
        if self.leading and self.type != "synchronous":
            raise ValueError(
                f'leading: only an axis of type = "synchronous" follows others, and this one is {self.type!r}'
            )
        if self.hold_tolerance and self.type != "synchronous":
            raise ValueError(
                f'hold_tolerance: only an axis of type = "synchronous" follows others, and this one is '
                f"{self.type!r}"
            )
        check_variables(OBJECTS[self.type], self.variables)
        return self

    def _does_without_a_drive(self) -> None:
        """Refuse keys that mean nothing without a drive.

        Raises:
            ValueError: The axis is no virtual one, or says something of a drive.

        """
        if self.variables.get("VirtualAxis.Mode") != 1:
            raise ValueError(
                'drive: missing; only a virtual axis has none: "VirtualAxis.Mode" = 1 among its variables'
            )
        for key in ("inputs", "encoders", "enable_timeout_s"):
            if getattr(self, key) is not None:
                raise ValueError(f"{key}: an axis without a drive has none")
        if self.connection != "direct":
            raise ValueError("connection: an axis without a drive has none")


def _controller_of(table: Any) -> Any:
    """Return the tag of the model: the make of the controller."""
    if isinstance(table, AxisTable | NcAxisTable):
        return table.controller
    return table.get("controller", "s7") if isinstance(table, dict) else None


AnyAxis = Annotated[
    Annotated[AxisTable, Tag("s7")] | Annotated[NcAxisTable, Tag("nc")], Discriminator(_controller_of)
]
"""`[axis.NAME]`, chosen by its key `controller`."""


class ExternalEncoderTable(Table, frozen=True):
    """`[external_encoder.NAME]`: a technology object that reads an encoder and moves nothing."""

    encoder: str
    """Name of the encoder, on a segment where the bench is the controller."""
    drive: str | None = None
    """One of its switches is wired to the digital input of this object too: reference cam or homing mark of
    a passive homing; the name of a drive with an axis.
    """
    homing_input: HomingInput = "home"
    """That switch."""
    variables: StartValues = {}
    """Start values of the technology object, by original path."""

    @model_validator(mode="after")
    def _known_variables(self) -> ExternalEncoderTable:
        check_variables("ExternalEncoder", self.variables)
        return self
