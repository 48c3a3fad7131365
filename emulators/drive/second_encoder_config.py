"""Configuration of the second encoder of a PROFIdrive axis."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le, Unit
from typing_extensions import override

from emulators.checked_fields import BENCH_FILE_TABLE, NotNegative, Positive, check_fields
from emulators.encoder.coupling import Coupling, gear_ratio, linear_coupling, rotary_coupling, scale_periods
from emulators.encoder.profidrive import EncoderFormat
from emulators.encoder.profidrive.format import FineBits, fitted_format
from emulators.encoder.profidrive.model import encoder_model
from fieldbus.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class SecondEncoderConfig(ABC):
    """What a second encoder at a PROFIdrive axis has, whatever it measures.

    Raises:
        ConfigurationError: Values do not fit together.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    type: str
    """`none`: not fitted."""
    mounting: Literal["motor", "load"] = "load"
    """The motor shaft, or the load behind gear and screw; a linear encoder needs `load`."""
    fine_xist1_bits: FineBits | None = None
    """Fine resolution of G2_XIST1 (P979[13]); none: 11, or as many as fit."""
    fine_xist2_bits: FineBits | None = None
    """Fine resolution of G2_XIST2 (P979[14]); none: 9, or as many as fit."""
    zero_mark: Annotated[int, Ge(0), Unit("inc")] = 0
    """Place of the zero mark, increments of G2_XIST1."""
    gear_numerator: Annotated[int, Ge(1)] = 1
    """Revolutions of the encoder ..."""
    gear_denominator: Annotated[int, Ge(1)] = 1
    """... per so many revolutions of what it sits on."""
    reversed: bool = False
    """Mounted the other way round."""

    def __post_init__(self) -> None:
        check_fields(self, "encoder2")
        encoder_model(self.form(), zero_mark=self.zero_mark)

    @abstractmethod
    def form(self) -> EncoderFormat:
        """Return kind, resolution and formats of the values.

        Raises:
            ConfigurationError: Resolution, range and fine bits do not fit together.

        """

    @abstractmethod
    def coupling(self, lead_mm: float | None) -> Coupling:
        """Return how it is coupled to the machine.

        Args:
            lead_mm: Lead of the screw, mm; None: the load turns.

        """

    @property
    def absolute(self) -> bool:
        """Whether it knows its place after switching on."""
        return not self.type.startswith("incremental")

    @property
    def gear_ratio(self) -> float:
        """Revolutions of the encoder per revolution of what it sits on, with sign."""
        return gear_ratio(self.gear_numerator, self.gear_denominator, reversed_direction=self.reversed)


@dataclass(frozen=True, kw_only=True)
class RotarySecondEncoder(SecondEncoderConfig):
    """`[drive.NAME.encoder2]`: a second encoder that turns.

    Raises:
        ConfigurationError: Values do not fit together.

    """

    label: ClassVar[str] = "a rotary encoder2"

    type: Literal["single_turn", "multi_turn", "incremental_rotary"]
    """`none`: not fitted."""
    steps_per_revolution: Annotated[int, Ge(4), Le(2**31), Unit("steps/rev")] = 2048
    """Lines or steps (P979[12])."""
    revolutions: Annotated[int, Ge(1), Le(65_535)] = 4096
    """Distinguishable revolutions of `multi_turn`."""
    mm_per_revolution: Positive | None = None
    """Travel of the load per revolution of a rotary encoder at the load; none: the lead of the screw."""
    offset_deg: float = 0.0
    """Place of a rotary encoder where the machine is at zero."""
    backlash_deg: NotNegative = 0.0
    """Play of the coupling of a rotary encoder."""

    @override
    def form(self) -> EncoderFormat:
        turns = {"multi_turn": self.revolutions, "single_turn": 1}.get(self.type, 0)
        return fitted_format(
            self.steps_per_revolution,
            turns,
            fine_xist1=self.fine_xist1_bits,
            fine_xist2=self.fine_xist2_bits,
        )

    @override
    def coupling(self, lead_mm: float | None) -> Coupling:
        at_load = self.mounting == "load"
        return rotary_coupling(
            self.gear_ratio,
            offset_deg=self.offset_deg,
            backlash_deg=self.backlash_deg,
            mm_per_revolution=(self.mm_per_revolution or lead_mm) if at_load else None,
        )


@dataclass(frozen=True, kw_only=True)
class LinearSecondEncoder(SecondEncoderConfig):
    """`[drive.NAME.encoder2]`: a second encoder that measures the load.

    Raises:
        ConfigurationError: Values do not fit together.

    """

    label: ClassVar[str] = "a linear encoder2"

    type: Literal["incremental_linear", "absolute_linear"]
    """`none`: not fitted."""
    measuring_step_um: Positive = 20.0
    """Distance of two lines of a scale; in steps of 0.001."""
    length_mm: Positive = 2000.0
    """Length of the scale."""
    offset_mm: float | None = None
    """Place on the scale where the machine is at zero; none: its middle."""
    backlash_mm: NotNegative = 0.0
    """Play of the coupling of a linear one."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mounting != "load":
            raise ConfigurationError("encoder2 mounting", self.mounting, "load for a linear encoder")

    @override
    def form(self) -> EncoderFormat:
        periods, grid_nm = scale_periods(self.measuring_step_um, self.length_mm)
        return fitted_format(
            periods,
            1 if self.absolute else 0,
            grid_nm=grid_nm,
            fine_xist1=self.fine_xist1_bits,
            fine_xist2=self.fine_xist2_bits,
        )

    @override
    def coupling(self, lead_mm: float | None) -> Coupling:
        return linear_coupling(
            self.gear_ratio,
            length_mm=self.length_mm,
            offset_mm=self.offset_mm,
            backlash_mm=self.backlash_mm,
        )
