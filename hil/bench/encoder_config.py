"""`[encoder.NAME]` of a bench file: its model and its checks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from hil.bench._profidrive_encoder import TYPES, EncoderTelegramSection

if TYPE_CHECKING:
    from hil.bench.config import BenchConfig
    from hil.bench.drive_config import DriveSection

_LINEAR: Final = (
    "incremental_linear",
    "incremental_linear_counting",
    "absolute_linear",
    "cyclic_linear",
    "multi_sensor",
)
_ROTARY_KEYS: Final = (
    "steps_per_revolution",
    "revolutions",
    "mm_per_revolution",
    "offset_deg",
    "backlash_deg",
    "max_speed_rpm",
)
_LINEAR_KEYS: Final = ("measuring_step_um", "length_mm", "offset_mm", "backlash_mm", "max_speed_mm_s")

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ShaftSection(_Model):
    """`[encoder.NAME.shaft]`: how the encoder's own shaft or slide moves; a test may move it otherwise."""

    speed_rpm: Finite = 0.0
    """Constant speed of a shaft, rpm."""
    speed_mm_s: Finite = 0.0
    """Constant speed of a slide, mm/s."""
    profile: tuple[tuple[NotNegative, Finite], ...] | None = None
    """Pairs of a duration in s and the speed at its end, rpm or mm/s, one after the other; instead of a
    constant speed.
    """
    repeat: bool = False
    """The profile begins again at its end."""


class EncoderSection(_Model):
    """`[encoder.NAME]`: an encoder as a device of its own on a segment."""

    profile: Literal["cia406", "profidrive"] = "cia406"
    device: Literal["emulated", "physical"] = "emulated"
    segment: str
    node_id: Annotated[int, Field(ge=1, le=126)]
    type: Literal[
        "single_turn",
        "multi_turn",
        "single_turn_counting",
        "incremental_rotary",
        "incremental_rotary_counting",
        "incremental_linear",
        "incremental_linear_counting",
        "absolute_linear",
        "cyclic_linear",
        "multi_sensor",
    ] = "multi_turn"
    """Device type, high word of 1000h."""
    on: str | None = None
    """Drive on whose machine it sits; None: on a shaft of its own."""
    mounting: Literal["motor", "load"] = "motor"
    """Side of the machine: the motor shaft, or the load. A linear encoder measures the load."""
    steps_per_revolution: Annotated[int, Field(ge=4, le=2**31)] = 8192
    revolutions: Annotated[int, Field(ge=1, le=65535)] = 4096
    measuring_step_um: Positive = 1.0
    """Step of a linear encoder, micrometres, in thousandths of it."""
    length_mm: Positive = 2000.0
    """Length of the scale, or period of a cyclic code, mm."""
    gear_numerator: Annotated[int, Field(ge=1)] = 1
    """Revolutions of the encoder ..."""
    gear_denominator: Annotated[int, Field(ge=1)] = 1
    """... per revolutions of the shaft."""
    mm_per_revolution: Positive | None = None
    """Travel of the load per revolution of a rotary encoder at the load; None: the lead of the screw."""
    reversed: bool = False
    """Mounted the other way round."""
    offset_deg: Finite = 0.0
    """Place of a rotary encoder where the machine is at zero, degrees of the encoder."""
    offset_mm: Finite | None = None
    """Place on the scale where the machine is at zero, mm; None: the middle of the scale."""
    backlash_deg: NotNegative = 0.0
    backlash_mm: NotNegative = 0.0
    max_speed_rpm: Positive | None = None
    max_speed_mm_s: Positive | None = None
    cyclic_timer_ms: Annotated[int, Field(ge=0, le=65535)] = 0
    heartbeat_ms: Annotated[int, Field(ge=0, le=60000)] = 100
    profidrive: EncoderTelegramSection = EncoderTelegramSection()
    shaft: ShaftSection = ShaftSection()

    @property
    def linear(self) -> bool:
        """Whether it measures a length."""
        return self.type in _LINEAR


def check_encoders(config: BenchConfig) -> None:
    """Check what encoders say of other tables, and of keys that do not belong to their type.

    Raises:
        ValueError: With the place, the value and what is allowed.

    """
    owners: dict[tuple[str, int], str] = {
        (drive.segment, drive.node_id): f"drive.{name}" for name, drive in config.drive.items()
    }
    for name, encoder in config.encoder.items():
        where = f"encoder.{name}"
        if "." in name or not name.strip():
            raise ValueError(f"encoder.{name!r}: a name is not empty and has no dot; signals are NAME.COLUMN")
        for kind, names in (("segment", config.segment), ("drive", config.drive), ("axis", config.axis)):
            if name in names:
                raise ValueError(f"{where}: a {kind} has this name already; signals are told apart by it")
        if encoder.segment not in config.segment:
            raise ValueError(
                f"{where}.segment: {encoder.segment!r} is not a segment; there are: "
                f"{', '.join(config.segment)}"
            )
        owner = owners.setdefault((encoder.segment, encoder.node_id), where)
        if owner != where:
            raise ValueError(f"{where}.node_id: {encoder.node_id} is already taken by {owner}")
        if encoder.device == "physical" and config.bench.kind == "virtual":
            raise ValueError(
                f'{where}: a virtual bench cannot hold a physical encoder; set bench.kind = "live"'
            )
        _check_profile(where, encoder)
        _check_keys(where, encoder)
        _check_place(where, encoder, config.drive)
        if encoder.device == "emulated":
            _check_range(where, encoder)


def _check_profile(where: str, encoder: EncoderSection) -> None:
    if encoder.profile == "cia406":
        if encoder.profidrive.model_fields_set:
            raise ValueError(
                f'{where}.profidrive: an encoder with profile = "cia406" has none; set profile = "profidrive"'
            )
        return
    if encoder.type not in TYPES:
        raise ValueError(
            f"{where}.type: {encoder.type!r} has no PROFIdrive interface; allowed: {', '.join(TYPES)}"
        )
    for key in ("cyclic_timer_ms", "max_speed_rpm", "max_speed_mm_s"):
        if key in encoder.model_fields_set:
            raise ValueError(f'{where}.{key}: an encoder with profile = "profidrive" has none')


def _check_keys(where: str, encoder: EncoderSection) -> None:
    kind = "linear" if encoder.linear else "rotary"
    for key in _ROTARY_KEYS if encoder.linear else _LINEAR_KEYS:
        if key in encoder.model_fields_set:
            raise ValueError(f"{where}.{key}: {encoder.type} is a {kind} encoder and has no such thing")
    shaft = encoder.shaft
    wrong = "speed_rpm" if encoder.linear else "speed_mm_s"
    if wrong in shaft.model_fields_set:
        raise ValueError(f"{where}.shaft.{wrong}: {encoder.type} is a {kind} encoder and has no such thing")
    if shaft.profile is not None and shaft.model_fields_set & {"speed_rpm", "speed_mm_s"}:
        raise ValueError(f"{where}.shaft.profile: give either a profile or a constant speed")
    if shaft.repeat and not sum(duration for duration, _ in shaft.profile or ()):
        raise ValueError(f"{where}.shaft.repeat: true needs a profile that takes some time")


def _check_place(where: str, encoder: EncoderSection, drives: Mapping[str, DriveSection]) -> None:
    if encoder.on is None:
        if "mounting" in encoder.model_fields_set:
            raise ValueError(f"{where}.mounting: {encoder.mounting!r} needs the drive (`on`) that it sits on")
        return
    drive = drives.get(encoder.on)
    if drive is None:
        raise ValueError(f"{where}.on: {encoder.on!r} is not a drive; there are: {', '.join(drives)}")
    if "shaft" in encoder.model_fields_set:
        raise ValueError(f"{where}.shaft: the encoder sits on {encoder.on} and has no shaft of its own")
    if encoder.device == "emulated" and drive.device == "physical":
        raise ValueError(f"{where}.on: {encoder.on!r} is physical; an emulated encoder cannot sit on it")
    if encoder.linear and encoder.mounting != "load":
        raise ValueError(
            f"{where}.mounting: {encoder.mounting!r} is not allowed; a linear encoder measures the load"
        )
    if encoder.mm_per_revolution is not None and encoder.mounting != "load":
        raise ValueError(f'{where}.mm_per_revolution: only with mounting = "load"')


def _check_range(where: str, encoder: EncoderSection) -> None:
    from fieldbus.errors import ConfigurationError
    from hil.bench._profidrive_encoder import profidrive_encoder_config
    from hil.bench.encoders import encoder_config

    try:
        if encoder.profile == "profidrive":
            profidrive_encoder_config(encoder, 1)
        else:
            encoder_config(encoder)
    except ConfigurationError as error:
        raise ValueError(f"{where}: {error}") from None


def encoder_names(config: Any) -> tuple[str, ...]:
    """Return the names of the emulated encoders of a bench file."""
    return tuple(name for name, section in config.encoder.items() if section.device == "emulated")
