"""Ratios between motor, encoders and axis."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import ceil, log2
from typing import Final

INCREMENTAL: Final = 0
ABSOLUTE: Final = 1
CYCLIC_ABSOLUTE: Final = 2
"""Kinds of encoder: the count knows no place, one place, one place within a range that is passed often."""

MOTOR_SIDE: Final = 0
LOAD_SIDE: Final = 1
EXTERNAL: Final = 2
"""Where an encoder is mounted: on the motor shaft, on the load, anywhere else."""

_FULL_BITS: Final = 32


def decimal(value: float) -> Fraction:
    """Return a number as it has been written, not as the nearest binary one."""
    return Fraction(repr(float(value)))


@dataclass(frozen=True, kw_only=True)
class EncoderData:
    """One encoder as it is configured.

    Args:
        kind: `INCREMENTAL`, `ABSOLUTE`, `CYCLIC_ABSOLUTE`.
        linear: It counts lines of a scale, not steps of a revolution.
        inverse: Its count falls while the axis moves in positive direction.
        mounting: `MOTOR_SIDE`, `LOAD_SIDE`, `EXTERNAL`.
        gear: Load revolutions per revolution of the encoder (measuring gear).
        steps: Steps per revolution.
        resolution: Distance of two lines of a linear encoder, position unit.
        distance: Way per revolution of an external encoder, position unit.
        fine_bits: Fine resolution of the count, bits.
        revolutions: Revolutions that an absolute encoder tells apart; 0 for none.
        full_width: The count has 32 bits, whatever steps and revolutions need (CFG-308, CFG-309).
        velocity_from_drive: The velocity is that of the telegram, not the difference of positions (CFG-336).
        reference: What 100 % of that velocity means, rpm, of a linear encoder m/min.
        unit_mm: Size of the position unit, mm; used for a linear encoder.

    """

    kind: int
    linear: bool
    inverse: bool
    mounting: int
    gear: Fraction
    steps: int
    resolution: float
    distance: float
    fine_bits: int
    revolutions: int
    full_width: bool
    velocity_from_drive: bool
    reference: float
    unit_mm: float


@dataclass(frozen=True)
class EncoderScale:
    """What an encoder means to the axis: two of them are equal where positions mean the same with both."""

    kind: int
    """`INCREMENTAL`, `ABSOLUTE`, `CYCLIC_ABSOLUTE`."""
    fine: int
    """Raw increments per encoder increment."""
    exact_increment: Fraction
    """Position units per raw increment as a ratio, by the decimal numbers of the configuration."""
    increment: float
    """Position units per raw increment, signed by the encoder direction."""
    bits: int
    """Width of the count, 1 to 32."""
    range_counts: int
    """Measuring range of an absolute encoder in raw increments; 0 without one (CFG-299)."""
    velocity_from_drive: bool
    """Whether the velocity is that of the telegram, not the difference of positions (CFG-336)."""
    reference: float
    """What 100 % of that velocity means, rpm, of a linear encoder m/min."""
    unit_per_rpm: float
    """Position units per second at 1 rpm (linear motor or encoder: 1 m/min)
    of the velocity of the telegram.
    """

    @classmethod
    def of(
        cls, data: EncoderData, *, load_gear: Fraction, travel: float, motor_unit_per_rpm: float | None
    ) -> EncoderScale:
        """Return the scale of an encoder.

        Args:
            data: Its configuration.
            load_gear: Motor revolutions per load revolution.
            travel: Position units per revolution of the load.
            motor_unit_per_rpm: Position units per second at 1 rpm of the motor, where the velocity of the
                telegram is one of the motor; None = it is one of the encoder (CFG-340).

        """
        fine = 1 << data.fine_bits
        sign = -1.0 if data.inverse else 1.0
        if data.linear:
            # The distance of two lines is one of the load, whatever gears there are before it (CFG-511,
            # CFG-529).
            per_step = decimal(data.resolution) * data.gear
        elif data.mounting == MOTOR_SIDE:
            per_step = data.gear / load_gear * decimal(travel) / data.steps
        elif data.mounting == LOAD_SIDE:
            per_step = data.gear * decimal(travel) / data.steps
        else:
            per_step = data.gear * decimal(data.distance) / data.steps
        exact = int(sign) * per_step / fine
        increment = float(exact)
        bits = _FULL_BITS
        if not data.full_width:
            positions = max(2, data.steps * max(1, data.revolutions))
            bits = min(bits, (fine - 1).bit_length() + ceil(log2(positions)))
        if motor_unit_per_rpm is not None:
            rate = motor_unit_per_rpm
        elif data.linear:
            rate = sign * float(data.gear) * 1000.0 / 60.0 / data.unit_mm
        else:
            rate = increment * data.steps * fine / 60.0
        return cls(
            kind=data.kind,
            fine=fine,
            exact_increment=exact,
            increment=increment,
            bits=bits,
            range_counts=data.steps * fine * data.revolutions,
            velocity_from_drive=data.velocity_from_drive,
            reference=data.reference,
            unit_per_rpm=rate,
        )


@dataclass(frozen=True)
class Mechanics:
    """Ratios of one axis or encoder."""

    rpm_per_unit: float
    """Motor speed in rpm (linear motor: m/min) per velocity unit of the axis,
    signed by the drive direction.
    """
    travel: float = 1.0
    """Position units per revolution of the load; 1.0 of an axis without positions."""
    sensors: tuple[EncoderScale, ...] = ()
    """Its encoders, in their order."""

    @property
    def increment(self) -> float:
        """Position units per raw increment of the first encoder; 0.0 without one."""
        return self.sensors[0].increment if self.sensors else 0.0
