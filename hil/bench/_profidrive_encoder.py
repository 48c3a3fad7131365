"""PROFIdrive encoders of a bench file: `[encoder.NAME.profidrive]`, `[drive.NAME.encoder2]`, and what they
are made of.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import Field, model_validator

from hil.bench._drive_sections import Finite, NotNegative, Positive, Section, _checked

if TYPE_CHECKING:
    from emulators.drive.profidrive.second_encoder import SecondEncoderConfig
    from emulators.encoder.profidrive import EncoderFormat
    from emulators.encoder.profidrive.can import ProfidriveEncoderNodeConfig
    from hil.bench.encoder_config import EncoderSection

FineBits = Annotated[int, Field(ge=0, le=31)]
TYPES: Final = (
    "single_turn",
    "multi_turn",
    "incremental_rotary",
    "incremental_linear",
    "absolute_linear",
)
"""Types of `[encoder.NAME]` that have a PROFIdrive interface."""
_FINEST_1, _FINEST_2 = 11, 9


class EncoderTelegramSection(Section):
    """`[encoder.NAME.profidrive]`: the telegram of a PROFIdrive encoder, and how its values are formed."""

    telegram: Literal[81, 82, 83, 84] = 81
    sign_of_life: bool = True
    """It works isochronously: both sides watch the counter of the other."""
    sign_of_life_tolerance: Annotated[int, Field(ge=0, le=65_535)] = 1
    """PNU 925 of the emulated encoder; 65535 = not monitored."""
    fine_xist1_bits: FineBits | None = None
    """Fine resolution of G1_XIST1 (P979[3]); None: 11, or as many as fit."""
    fine_xist2_bits: FineBits | None = None
    """Fine resolution of G1_XIST2 (P979[4]); None: 9, or as many as fit."""
    counter_bits: Annotated[int, Field(ge=8, le=32)] = 32
    """Width of G1_XIST1; simple counters have less than 32."""
    reference_speed: Positive = 3000.0
    """What 4000h of NIST_A and NIST_B stands for, rpm, linear mm/s."""
    zero_mark: Annotated[int, Field(ge=0)] = 0
    """Place of the zero mark, increments of G1_XIST1."""


class Encoder2Section(Section):
    """`[drive.NAME.encoder2]`: a second encoder at a PROFIdrive axis, for telegrams 4, 6, 103 and 106."""

    type: Literal[
        "none", "single_turn", "multi_turn", "incremental_rotary", "incremental_linear", "absolute_linear"
    ] = "none"
    mounting: Literal["motor", "load"] = "load"
    steps_per_revolution: Annotated[int, Field(ge=4, le=2**31)] = 2048
    revolutions: Annotated[int, Field(ge=1, le=65_535)] = 4096
    measuring_step_um: Positive = 20.0
    """Distance of two lines of a scale, micrometres."""
    length_mm: Positive = 2000.0
    fine_xist1_bits: FineBits | None = None
    fine_xist2_bits: FineBits | None = None
    zero_mark: Annotated[int, Field(ge=0)] = 0
    gear_numerator: Annotated[int, Field(ge=1)] = 1
    gear_denominator: Annotated[int, Field(ge=1)] = 1
    mm_per_revolution: Positive | None = None
    """Travel of the load per revolution of a rotary encoder at the load; None: the lead of the screw."""
    reversed: bool = False
    offset_deg: Finite = 0.0
    offset_mm: Finite | None = None
    """Place on the scale where the machine is at zero, mm; None: the middle of the scale."""
    backlash_deg: NotNegative = 0.0
    backlash_mm: NotNegative = 0.0

    @model_validator(mode="after")
    def _fits(self) -> Encoder2Section:
        if self.type != "none":
            _checked(lambda: second_encoder_config(self, 10.0))
        return self

    @property
    def linear(self) -> bool:
        """Whether it measures a length."""
        return self.type.endswith("_linear")


def coupling(section: Any, lead_mm: float | None) -> tuple[float, float, float]:
    """Return ratio, offset and play of an encoder's coupling, rad and m.

    Args:
        section: Section with the keys that say how the encoder is coupled to a machine.
        lead_mm: Lead of the screw for a rotary encoder at the load; None: at a motor shaft or a shaft of
            its own.

    """
    ratio = section.gear_numerator / section.gear_denominator * (-1.0 if section.reversed else 1.0)
    if section.linear:
        offset_mm = 0.5 * section.length_mm if section.offset_mm is None else section.offset_mm
        return ratio, offset_mm / 1000.0, section.backlash_mm / 1000.0
    if lead_mm is not None:
        ratio *= 2.0 * math.pi * 1000.0 / (section.mm_per_revolution or lead_mm)
    return ratio, math.radians(section.offset_deg), math.radians(section.backlash_deg)


def encoder_format(
    section: Any,
    fine_xist1: int | None,
    fine_xist2: int | None,
    *,
    wide: bool = False,
    counter_bits: int = 32,
) -> EncoderFormat:
    """Return the format of a section's type and resolution; an absolute encoder loads G1_XIST1 with its value
    (PD-172).

    Raises:
        ConfigurationError: Resolution, range and fine bits do not fit together.

    """
    from emulators.encoder.profidrive import EncoderFormat

    grid_nm = round(section.measuring_step_um * 1000.0) if section.linear else 0
    periods = (
        round(section.length_mm * 1e6 / max(grid_nm, 1)) if section.linear else section.steps_per_revolution
    )
    turns = {"multi_turn": section.revolutions, "single_turn": 1, "absolute_linear": 1}.get(section.type, 0)
    width = max(periods - 1, 0).bit_length()
    first = max(0, min(_FINEST_1, 31 - width)) if fine_xist1 is None else fine_xist1
    steps = max(periods * turns - 1, 0).bit_length()
    second = max(0, min(_FINEST_2, 32 - steps)) if fine_xist2 is None else fine_xist2
    return EncoderFormat(
        periods=periods,
        interpolation_bits=first,
        shift_xist1=first,
        shift_xist2=second,
        revolutions=turns,
        grid_nm=grid_nm,
        load_absolute=turns > 0,
        wide=wide,
        counter_bits=counter_bits,
    )


def second_encoder_config(section: Encoder2Section, lead_mm: float) -> SecondEncoderConfig | None:
    """Return the configuration of a drive's second encoder; None: there is none.

    Raises:
        ConfigurationError: Values do not fit together.

    """
    if section.type == "none":
        return None
    from emulators.drive.profidrive.second_encoder import SecondEncoderConfig

    ratio, offset, backlash = coupling(section, lead_mm if section.mounting == "load" else None)
    return SecondEncoderConfig(
        form=encoder_format(section, section.fine_xist1_bits, section.fine_xist2_bits),
        mounting=section.mounting,
        ratio=ratio,
        offset=offset,
        backlash=backlash,
        zero_mark=section.zero_mark,
    )


def profidrive_encoder_config(section: EncoderSection, cycle_ns: int) -> ProfidriveEncoderNodeConfig:
    """Return the configuration of the emulated PROFIdrive encoder that a section describes.

    Raises:
        ConfigurationError: Values do not fit together.

    """
    from emulators.encoder.profidrive.can import ProfidriveEncoderNodeConfig
    from emulators.encoder.profidrive.device import ProfidriveEncoderConfig
    from emulators.encoder.profidrive.model import encoder_model

    own = section.profidrive
    form = encoder_format(
        section,
        own.fine_xist1_bits,
        own.fine_xist2_bits,
        wide=own.telegram == 84,
        counter_bits=own.counter_bits,
    )
    encoder_model(form, zero_mark=own.zero_mark)
    return ProfidriveEncoderNodeConfig(
        node_id=section.node_id,
        encoder=ProfidriveEncoderConfig(
            form=form,
            telegram=own.telegram,
            zero_mark=own.zero_mark,
            reference_speed=own.reference_speed,
            isochronous=own.sign_of_life,
            tolerance=own.sign_of_life_tolerance,
        ),
        cycle_ns=cycle_ns,
        heartbeat_ms=section.heartbeat_ms,
    )
