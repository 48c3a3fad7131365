"""Tables of the bench file that describe the inside of an emulated drive."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import UnionType
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator, model_validator

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from emulators.drive import SupplyConfig, ThermalConfig


_SCALARS = {bool: "true or false", int: "a number", float: "a number", str: "a text"}


def _scalars(annotation: Any) -> set[type]:
    """Return which of bool, int, float and str an annotation permits; nothing for a choice of words, which is
    strict by itself.
    """
    if annotation in _SCALARS:
        return {annotation}
    if get_origin(annotation) not in (Union, UnionType, Annotated):
        return set()
    return set().union(*map(_scalars, get_args(annotation)))


class Section(BaseModel):
    """A table: unknown keys are errors, and so is a value of another type, whatever it could be taken for."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    @field_validator("*", mode="before")
    @classmethod
    def _as_written(cls, value: Any, info: ValidationInfo) -> Any:
        kinds = _scalars(cls.model_fields[str(info.field_name)].annotation)
        given = type(value)
        numbers = {int, float}
        if kinds and given in _SCALARS and given not in kinds and not (given in numbers and kinds & numbers):
            raise ValueError(f"allowed: {' or '.join(sorted({_SCALARS[one] for one in kinds}))}")
        return value

    def differs(self, key: str) -> bool:
        """Say whether a key has another value than its default: a file that names all keys is no mistake."""
        return bool(getattr(self, key) != type(self).model_fields[key].default)


Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Word = Annotated[int, Field(ge=0, le=0xFFFFFFFF)]
RampTime = Annotated[float, Field(ge=0.001, le=1000.0)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Time_ms = Annotated[float, Field(ge=0.0, le=5000.0)]
Voltage = Annotated[float, Field(ge=1.0, le=5000.0)]
Temperature = Annotated[float, Field(ge=-60.0, le=400.0)]
Seconds = Annotated[float, Field(ge=0.01, le=100_000.0)]


class BrakeSection(Section):
    """`[drive.NAME.brake]`: holding brake of the motor."""

    torque_nm: Annotated[float, Field(ge=0.0, le=100_000.0)] = 0.0
    """Holding torque at the motor shaft; 0 = there is no brake."""
    opening_time_ms: Time_ms = 0.0
    closing_time_ms: Time_ms = 0.0


class SupplySection(Section):
    """`[drive.NAME.supply]`: DC link of the drive."""

    nominal_v: Voltage = 560.0
    undervoltage_v: Voltage = 400.0
    overvoltage_v: Voltage = 780.0
    capacitance_uf: Annotated[float, Field(ge=1.0, le=1_000_000.0)] = 500.0
    standby_w: Annotated[float, Field(ge=0.0, le=100_000.0)] = 15.0
    chopper_on_v: Voltage = 720.0
    chopper_off_v: Voltage = 700.0
    chopper_ohm: Annotated[float, Field(ge=0.1, le=100_000.0)] = 30.0
    chopper_rated_w: Annotated[float, Field(ge=1.0, le=1_000_000.0)] = 200.0
    phase_loss_time_ms: Annotated[float, Field(ge=0.0, le=60_000.0)] = 500.0

    @model_validator(mode="after")
    def _fits(self) -> SupplySection:
        if self.model_fields_set:
            _checked(self.build)
        return self

    def build(self) -> SupplyConfig:
        """Return the configuration of the emulated drive."""
        from emulators.drive import SupplyConfig

        return SupplyConfig(
            nominal_V=self.nominal_v,
            undervoltage_V=self.undervoltage_v,
            overvoltage_V=self.overvoltage_v,
            capacitance_F=self.capacitance_uf * 1e-6,
            standby_W=self.standby_w,
            chopper_on_V=self.chopper_on_v,
            chopper_off_V=self.chopper_off_v,
            chopper_ohm=self.chopper_ohm,
            chopper_rated_W=self.chopper_rated_w,
            phase_loss_time_s=self.phase_loss_time_ms / 1000.0,
        )


class ThermalSection(Section):
    """`[drive.NAME.thermal]`: heat of motor and power stage."""

    overload: Literal["fault", "limit"] = "fault"
    i2t_time_constant_s: Seconds = 40.0
    stage_overload: Annotated[float, Field(ge=0.1, le=100.0)] = 2.0
    stage_overload_time_s: Seconds = 20.0
    ambient_c: Temperature = 25.0
    motor_rise_k: Annotated[float, Field(ge=0.1, le=1000.0)] = 80.0
    motor_time_constant_s: Seconds = 600.0
    motor_warning_c: Temperature = 120.0
    motor_fault_c: Temperature = 140.0
    motor_loss_w: Annotated[float, Field(ge=0.0, le=1_000_000.0)] = 60.0
    stage_rise_k: Annotated[float, Field(ge=0.1, le=1000.0)] = 35.0
    stage_time_constant_s: Seconds = 120.0
    stage_warning_c: Temperature = 85.0
    stage_fault_c: Temperature = 95.0

    @model_validator(mode="after")
    def _fits(self) -> ThermalSection:
        if self.model_fields_set:
            _checked(self.build)
        return self

    def build(self) -> ThermalConfig:
        """Return the configuration of the emulated drive, without the time constant of i2t."""
        from emulators.drive import ThermalConfig

        return ThermalConfig(
            ambient_C=self.ambient_c,
            motor_rise_K=self.motor_rise_k,
            motor_time_constant_s=self.motor_time_constant_s,
            motor_warning_C=self.motor_warning_c,
            motor_fault_C=self.motor_fault_c,
            motor_loss_W=self.motor_loss_w,
            stage_rise_K=self.stage_rise_k,
            stage_time_constant_s=self.stage_time_constant_s,
            stage_warning_C=self.stage_warning_c,
            stage_fault_C=self.stage_fault_c,
            stage_overload=self.stage_overload,
            stage_overload_time_s=self.stage_overload_time_s,
            overload=self.overload,
        )


class ProfidriveSection(Section):
    """`[drive.NAME.profidrive]`: what a PROFIdrive axis has beside its telegram."""

    torque_telegram: bool = False
    """Telegram 750 follows the telegram: additive torque, torque limits, actual torque."""
    safety_telegram: Literal[700, 701] | None = None
    """Telegram 700 or 701 follows: the safety information channel."""
    reference_speed_rpm: Annotated[float, Field(ge=6.0, le=210_000.0)] = 3000.0
    """p2000: speed that 4000h stands for."""
    reference_torque_nm: Annotated[float, Field(ge=0.001, le=1_000_000.0)] = 2.0
    """p2003."""
    fine_resolution_bits: Annotated[int, Field(ge=0, le=20)] = 11
    """p0418: fine resolution of G1_XIST1."""
    operating_mode: Literal[1, 3] = 3
    """PNU 930 of the emulated drive."""
    ramp_up_s: Annotated[float, Field(ge=0.0, le=1000.0)] = 10.0
    """p1120 of the emulated drive; acts in operating mode 1."""
    interpolation: bool = True
    """Whether the emulated drive reaches a setpoint of operating mode 3 linearly within the bus cycle, or at
    once.
    """
    sign_of_life_tolerance: Annotated[int, Field(ge=0, le=65_535)] = 1
    """PNU 925 of the emulated drive; 65535 = not monitored."""
    sign_of_life: bool | None = None
    """Whether drive and controller watch the counter of the other; None: where the telegram has one, but not
    on live Modbus.
    """
    setpoint_monitoring_ms: Annotated[float, Field(ge=0.0, le=2_000_000.0)] = 100.0
    """p2040 of the emulated drive: without process data for this long F01910; 0 = not monitored."""


CIA402_KEYS = (
    "personality",
    "eds",
    "homing",
    "sync_loss",
    "sync_jitter_percent",
    "missing_setpoints",
    "following_error",
    "csv_interpolation",
)
"""Keys of a drive that a PROFIdrive axis does not have."""


def checked_personality(value: str, folder: Path | None) -> str:
    """Return the name or absolute path of a personality that can be loaded; a relative path starts at
    `folder`.

    Raises:
        ValueError: There is none, or it is not usable; the message says why.

    """
    from emulators.drive.cia402.personality import load_personality

    if value.endswith(".toml"):
        value = str(((folder or Path()) / value).resolve())
    _checked(lambda: load_personality(value))
    return value


def _checked(build: Callable[[], object]) -> None:
    try:
        build()
    except ConfigurationError as error:
        raise ValueError(str(error)) from None
