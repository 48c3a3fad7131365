"""`[axis.NAME]` with `controller = "nc"`: an axis of an NC controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal, Protocol

from pydantic import Field, PlainValidator, ValidationError, WithJsonSchema, model_validator

from fieldbus.errors import ConfigurationError
from fieldbus.toml_text import number_hint
from hil.bench._table import Table, sentence
from motion.nc.parameters import ParameterSet, check_parameter, known_key

if TYPE_CHECKING:
    from emulators.drive.machine import LinearAxisConfig


class MovingDrive(Protocol):
    """What an axis takes over from its drive."""

    @property
    def profile(self) -> str:
        """Its profile."""

    @property
    def machine(self) -> LinearAxisConfig | None:
        """What it moves."""

    @property
    def increments_per_revolution(self) -> int:
        """Increments of the encoder."""

    @property
    def fine_resolution_bits(self) -> int:
        """Bits on top of them."""

    @property
    def max_speed_rpm(self) -> float:
        """Highest speed, rpm."""

    @property
    def reference_torque_nm(self) -> float:
        """Torque of 100 %, Nm."""


def _value(value: object) -> object:
    if not isinstance(value, bool | int | float | str):
        text = f"allowed: a number, a text, true or false{number_hint(value)}"
        raise ValueError(text)  # noqa: TRY004 - it becomes a message about the file
    return value


ParameterValue = Annotated[
    bool | int | float | str,
    PlainValidator(_value),
    WithJsonSchema({"type": ["number", "boolean", "string"]}),
]


_DRIVE_TYPES: Final = {"analog": "KL4XXX", "two_speed": "TWOSPEED"}
"""`drv.type` by profile of the drive; every other one takes velocities of its own unit."""


class NcAxisTable(Table, frozen=True):
    """`[axis.NAME]` with `controller = "nc"`: an axis of an NC controller."""

    label: ClassVar[str] = 'an axis with controller = "nc"'

    controller: Literal["nc"]
    """Make of the controller."""
    drive: str = ""
    """Name of the drive that the axis moves; each drive once. Without drive and `encoder` it is a simulation
    axis.
    """
    encoder: str | None = None
    """Name of an encoder, in place of a drive: the axis is an encoder axis."""
    interface: Literal["velocity", "position", "torque"] = "velocity"
    """What the drive gets: a CiA 402 drive works in csv, csp or cst, a PROFIdrive drive with `position` by
    dynamic servo control.
    """
    fast_stop_input: Literal["negative_limit", "positive_limit", "home"] | None = None
    """Input of the drive that is linked to the signal of the fast axis stop
    (`axis.fast_axis_stop_signal_type`); none: no input.
    """
    comment: str = ""
    """Free text."""
    feed: Annotated[float, Field(gt=0.0)] | None = None
    """Way of a motor revolution, position unit; none: the lead screw of the machine of the drive."""
    parameters: dict[str, ParameterValue] = {}
    """Parameters of axis, encoder (`enc.`), drive (`drv.`), controller (`ctrl.`) and task (`task.`) by key,
    in quotes ([NC axes](nc-axis.md)); the others follow from the drive, or have their defaults.
    """

    @model_validator(mode="after")
    def _one_device(self) -> NcAxisTable:
        if self.drive and self.encoder is not None:
            raise ValueError("encoder: an axis has a drive or an encoder of its own; remove one of both")
        if not self.drive:
            for key, wanted in (("interface", "velocity"), ("fast_stop_input", None)):
                if getattr(self, key) != wanted:
                    raise ValueError(f"{key}: {getattr(self, key)!r} needs a drive")
        return self

    @model_validator(mode="after")
    def _known_parameters(self) -> NcAxisTable:
        problems = []
        for key, value in self.parameters.items():
            try:
                check_parameter(key, value, of_task=False)
            except ConfigurationError as error:
                text = str(error).removeprefix(f"{known_key_or(key)}: ")
                problems.append(sentence(text, ("parameters", key), value))
        if problems:
            raise ValidationError.from_exception_data("NcAxisTable", problems)
        return self

    def feed_of(self, drive: MovingDrive) -> float:
        """Return the way of a motor revolution, position unit."""
        machine = drive.machine
        return self.feed or (10.0 if machine is None else machine.lead_screw_mm)

    def start_values(self, drive: MovingDrive | None) -> dict[str, bool | int | float | str]:
        """Return the parameters of the axis: what it says, and otherwise what follows from the drive."""
        given: Mapping[str, bool | int | float | str] = {
            known_key(key): value for key, value in self.parameters.items()
        }
        if drive is None:
            return {
                **({} if self.encoder is None else {"enc.type": "Hardware encoder"}),
                "enc.encoder_mask": 0xFFFFFFFF,
                **given,
            }
        counts = drive.increments_per_revolution << drive.fine_resolution_bits
        feed = self.feed_of(drive)
        values: dict[str, bool | int | float | str] = {
            "axis.axis_type": "CANopen DS402/Profile MDP 742 (e.g. EtherCAT CoE Drive)",
            "enc.type": "Hardware encoder",
            "enc.scaling_numerator": feed,
            "enc.scaling_denominator": float(counts),
            "enc.encoder_mask": 0xFFFFFFFF,
            "enc.encoder_sub_mask": counts - 1,
            "drv.type": _DRIVE_TYPES.get(drive.profile, "DS402_MDP742"),
        }
        values["axis.reference_velocity"] = drive.max_speed_rpm / 60.0 * feed
        values["axis.maximum_velocity"] = values["axis.reference_velocity"]
        if drive.profile == "two_speed":
            values["ctrl.type"] = "Two speed controller"
        if self.interface == "torque":
            # Percent of the rated torque in the NC, permille at the drive.
            values["drv.output_scaling_torque"] = 10.0
            values["drv.input_scaling_torque"] = 0.1
            values["ctrl.type"] = "Position P and velocity PID controller (Torque)"
        if "axis.reference_velocity" in given:
            values["axis.maximum_velocity"] = given["axis.reference_velocity"]
        return {**values, **given}

    def parameters_of(self, drive: MovingDrive | None) -> ParameterSet:
        """Return the parameters with their start values.

        Raises:
            ConfigurationError: They do not fit together.

        """
        return ParameterSet(self.start_values(drive))


def known_key_or(key: str) -> str:
    """Return the key of the catalogue for a key or an alias, or the key itself where there is none."""
    try:
        return known_key(key)
    except ConfigurationError:
        return key
