"""Configuration of the second encoder of a PROFIdrive axis."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le, Unit
from typing_extensions import override

from emulators.checked_fields import BENCH_FILE_TABLE, Positive, check_fields
from emulators.encoder.keys import LinearMountingKeys, MountingKeys, RotaryKeys, RotaryMountingKeys
from emulators.encoder.profidrive import EncoderFormat
from emulators.encoder.profidrive.format import FineBits, fitted_format
from emulators.encoder.profidrive.model import encoder_model
from fieldbus.errors import ConfigurationError


@dataclass(frozen=True, kw_only=True)
class SecondEncoderConfig(MountingKeys):
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

    def __post_init__(self) -> None:
        check_fields(self, "encoder2")
        encoder_model(self.form(), zero_mark=self.zero_mark)

    @abstractmethod
    def form(self) -> EncoderFormat:
        """Return kind, resolution and formats of the values.

        Raises:
            ConfigurationError: Resolution, range and fine bits do not fit together.

        """

    @property
    def absolute(self) -> bool:
        """Whether it knows its place after switching on."""
        return not self.type.startswith("incremental")


@dataclass(frozen=True, kw_only=True)
class RotarySecondEncoder(SecondEncoderConfig, RotaryMountingKeys, RotaryKeys):
    """`[drive.NAME.encoder2]`: a second encoder that turns.

    Raises:
        ConfigurationError: Values do not fit together.

    """

    label: ClassVar[str] = "a rotary encoder2"

    type: Literal["single_turn", "multi_turn", "incremental_rotary"]
    """`none`: not fitted."""
    steps_per_revolution: Annotated[int, Ge(4), Le(2**31), Unit("steps/rev")] = 2048
    """Lines or steps (P979[12])."""

    @override
    def form(self) -> EncoderFormat:
        return fitted_format(
            self.steps_per_revolution,
            self.turns_of(self.type),
            fine_xist1=self.fine_xist1_bits,
            fine_xist2=self.fine_xist2_bits,
        )


@dataclass(frozen=True, kw_only=True)
class LinearSecondEncoder(SecondEncoderConfig, LinearMountingKeys):
    """`[drive.NAME.encoder2]`: a second encoder that measures the load.

    Raises:
        ConfigurationError: Values do not fit together.

    """

    label: ClassVar[str] = "a linear encoder2"

    type: Literal["incremental_linear", "absolute_linear"]
    """`none`: not fitted."""
    measuring_step_um: Positive = 20.0
    """Distance of two lines of a scale; in steps of 0.001."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.mounting != "load":
            raise ConfigurationError("encoder2 mounting", self.mounting, "load for a linear encoder")

    @override
    def form(self) -> EncoderFormat:
        return fitted_format(
            self.periods,
            1 if self.absolute else 0,
            grid_nm=self.measuring_step_nm,
            fine_xist1=self.fine_xist1_bits,
            fine_xist2=self.fine_xist2_bits,
        )
