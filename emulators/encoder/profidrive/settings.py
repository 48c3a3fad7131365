"""Settings of a PROFIdrive encoder: its telegram, and how its values are formed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from annotated_types import Ge, Le, Unit

from emulators.checked_fields import BENCH_FILE_TABLE, Positive, check_fields
from emulators.encoder.profidrive.format import EncoderFormat, FineBits, fitted_format


@dataclass(frozen=True, kw_only=True)
class ProfidriveEncoderSettings:
    """`[encoder.NAME.profidrive]`: the telegram of a PROFIdrive encoder, and how its values are formed.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    telegram: Literal[81, 82, 83, 84] = 81
    """82 and 83 bring the speed too, 84 the speed and a counter of 64 bits."""
    sign_of_life: bool = True
    """It works isochronously: both sides watch the counter of the other."""
    sign_of_life_tolerance: Annotated[int, Ge(0), Le(65_535)] = 1
    """Failures that the emulated encoder tolerates (PNU 925); 65535 = not monitored."""
    fine_xist1_bits: FineBits | None = None
    """Fine resolution of G1_XIST1 (P979[3]); none: 11, or as many as fit."""
    fine_xist2_bits: FineBits | None = None
    """Fine resolution of G1_XIST2 (P979[4]); none: 9, or as many as fit."""
    counter_bits: Annotated[int, Ge(8), Le(32)] = 32
    """Width of G1_XIST1; a controller has to know of less than 32 (`BehaviorGx_XIST1` = 0)."""
    reference_speed: Annotated[Positive, Unit("rpm or mm/s")] = 3000.0
    """What 4000h (4000 0000h) of the speed stands for."""
    zero_mark: Annotated[int, Ge(0), Unit("inc")] = 0
    """Place of the zero mark, increments of G1_XIST1."""

    def __post_init__(self) -> None:
        check_fields(self, "profidrive encoder")

    def form(self, periods: int, turns: int, *, grid_nm: int = 0) -> EncoderFormat:
        """Return resolution, range and formats of the values.

        Args:
            periods: Periods per revolution, or of the scale.
            turns: Revolutions that an absolute encoder tells apart, 1 for a scale; 0: it is incremental.
            grid_nm: Distance of the periods of a scale, nm; 0: it is rotary.

        Raises:
            ConfigurationError: Resolution, range and fine bits do not fit together.

        """
        return fitted_format(
            periods,
            turns,
            grid_nm=grid_nm,
            fine_xist1=self.fine_xist1_bits,
            fine_xist2=self.fine_xist2_bits,
            wide=self.telegram == 84,
            counter_bits=self.counter_bits,
        )
