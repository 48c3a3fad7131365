"""How an encoder counts towards its controller: fine bits, range, start value, and P979, which tells all that
(PD-188 to PD-194).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final

from annotated_types import Ge, Le

from fieldbus.errors import ConfigurationError

STRUCTURE_VERSION: Final = 0x12
"""P979[0] bits 0..7: version 1.2 (PD-188)."""
SUB_INDICES: Final = 5
"""Valid sub-indices per encoder."""
SUB_INDICES_OF_ONE: Final = 10
"""Distance of two encoders in the array (PD-194)."""
ENCODERS_MAX: Final = 3
ELEMENTS: Final = 1 + SUB_INDICES_OF_ONE * ENCODERS_MAX

_LINEAR, _LOADED, _WIDE = 0x1, 0x2, 0x4
_VALIDITY_STATIC, _VALID = 1 << 30, 1 << 31

FineBits = Annotated[int, Ge(0), Le(31)]
_FINEST_1: Final = 11
_FINEST_2: Final = 9


@dataclass(frozen=True, kw_only=True)
class EncoderFormat:
    """Format of Gx_XIST1 and Gx_XIST2.

    The encoder model counts finer than the lines by `interpolation_bits`: `periods << interpolation_bits` of
    its increments are one revolution, or the whole scale of a linear encoder.

    Args:
        periods: Lines or steps per revolution, 1..2^31; linear: grid lines of the scale.
        interpolation_bits: Binary digits that the model counts within a line, 0..31; 2 for a TTL encoder
            that is evaluated fourfold.
        shift_xist1: Fine bits of Gx_XIST1, 0..31.
        shift_xist2: Fine bits of the absolute value in Gx_XIST2, 0..31.
        revolutions: 0 incremental, 1 single-turn or linear absolute, more: multi-turn; 0..65536.
        grid_nm: 0 rotary; else the distance of two grid lines, nm.
        counter_bits: Width of Gx_XIST1, 8..32; narrower than 32 as simple counters have it (PD-171).
        load_absolute: True: Gx_XIST1 begins with the absolute value at power-on
            (PD-172); False: with `start_value`.
        start_value: Gx_XIST1 at power-on, 0..2^counter_bits - 1.
        wide: True: 64-bit value (G1_XIST3) is there.

    Raises:
        ConfigurationError: A value is out of its range, or they do not fit together.

    """

    periods: int = 2048
    interpolation_bits: int = 0
    shift_xist1: int = 11
    shift_xist2: int = 9
    revolutions: int = 0
    grid_nm: int = 0
    counter_bits: int = 32
    load_absolute: bool = False
    start_value: int = 0
    wide: bool = False

    def __post_init__(self) -> None:
        for name, low, high in (
            ("periods", 1, 1 << 31),
            ("interpolation_bits", 0, 31),
            ("shift_xist1", 0, 31),
            ("shift_xist2", 0, 31),
            ("revolutions", 0, 65536),
            ("grid_nm", 0, 0xFFFF_FFFF),
            ("counter_bits", 8, 32),
            ("start_value", 0, (1 << self.counter_bits) - 1),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ConfigurationError(f"encoder format {name}", value, f"{low}..{high}")
        if self.load_absolute and not self.absolute:
            raise ConfigurationError("encoder format load_absolute", True, "False for an incremental encoder")
        if self.load_absolute and self.start_value:
            raise ConfigurationError("encoder format start_value", self.start_value, "0 with load_absolute")
        if self.linear and self.revolutions > 1:
            raise ConfigurationError(
                "encoder format revolutions", self.revolutions, "0 or 1 for a linear encoder"
            )
        if self.absolute and self.steps << self.shift_xist2 > 1 << 32:
            raise ConfigurationError(
                "encoder format shift_xist2",
                self.shift_xist2,
                f"{self.steps} absolute steps shifted into 32 bits",
            )

    @classmethod
    def profile_4_0(cls, *, periods: int, revolutions: int = 1, interpolation_bits: int = 0) -> EncoderFormat:
        """Return the format of encoder profile 4.0: Gx_XIST1 is left-aligned,
        Gx_XIST2 right-aligned (PD-174).

        Raises:
            ConfigurationError: The absolute steps need more than 32 bits, or a value is out of its range.

        """
        total = (periods * max(1, revolutions) - 1).bit_length()
        if total > 32:
            raise ConfigurationError(
                "encoder format revolutions", revolutions, "32 bits for all absolute steps"
            )
        return cls(
            periods=periods,
            interpolation_bits=interpolation_bits,
            revolutions=revolutions,
            shift_xist1=32 - total,
            shift_xist2=0,
            load_absolute=revolutions > 0,
        )

    @classmethod
    def profile_4_1(cls, *, periods: int, revolutions: int = 1, interpolation_bits: int = 0) -> EncoderFormat:
        """Return the format of encoder profile 4.1: both values right-aligned, the counter begins at the
        absolute value (PD-174).

        Raises:
            ConfigurationError: A value is out of its range.

        """
        return cls(
            periods=periods,
            interpolation_bits=interpolation_bits,
            revolutions=revolutions,
            shift_xist1=0,
            shift_xist2=0,
            load_absolute=revolutions > 0,
        )

    @property
    def absolute(self) -> bool:
        """Whether there is an absolute value."""
        return self.revolutions > 0

    @property
    def linear(self) -> bool:
        """Whether a linear scale is measured."""
        return self.grid_nm > 0

    @property
    def counts(self) -> int:
        """Increments of the encoder model in a revolution or in the whole scale."""
        return self.periods << self.interpolation_bits

    @property
    def steps(self) -> int:
        """Absolute steps in all revolutions."""
        return self.periods * self.revolutions

    def sub_indices(self) -> tuple[int, ...]:
        """Return the sub-indices 1 to 10 of P979 for this encoder."""
        kind = _VALID | _VALIDITY_STATIC
        kind |= _LINEAR if self.linear else 0
        kind |= _LOADED if self.load_absolute else 0
        kind |= _WIDE if self.wide else 0
        resolution = self.grid_nm if self.linear else self.periods
        return (kind, resolution, self.shift_xist1, self.shift_xist2, self.revolutions, 0, 0, 0, 0, 0)


def p979(*formats: EncoderFormat) -> tuple[int, ...]:
    """Return the array P979 of a device with up to three encoders, 31 elements (PD-188 to PD-194).

    Raises:
        ConfigurationError: There is no encoder, or more than three.

    """
    if not 1 <= len(formats) <= ENCODERS_MAX:
        raise ConfigurationError("encoders of P979", len(formats), f"1..{ENCODERS_MAX}")
    row = [SUB_INDICES << 12 | len(formats) << 8 | STRUCTURE_VERSION]
    for one in formats:
        row += one.sub_indices()
    return tuple(row + [0] * (ELEMENTS - len(row)))


def fitted_format(
    periods: int,
    turns: int,
    *,
    grid_nm: int = 0,
    fine_xist1: int | None = None,
    fine_xist2: int | None = None,
    wide: bool = False,
    counter_bits: int = 32,
) -> EncoderFormat:
    """Return the format of a PROFIdrive encoder; an absolute encoder loads G1_XIST1 with its value (PD-172).

    Args:
        periods: Periods per revolution, or of the scale.
        turns: Revolutions that an absolute encoder tells apart, 1 for a scale; 0: it is incremental.
        grid_nm: Distance of the periods of a scale, nm; 0: it is rotary.
        fine_xist1: Fine resolution of G1_XIST1, bits; None: 11, or as many as fit.
        fine_xist2: Fine resolution of G1_XIST2, bits; None: 9, or as many as fit.
        wide: There is a counter of 64 bits.
        counter_bits: Width of G1_XIST1.

    Raises:
        ConfigurationError: Resolution, range and fine bits do not fit together.

    """
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
