"""Configuration of an emulated CiA 406 encoder."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Final

from annotated_types import Ge, Le, Lt

from emulators.checked_fields import NotNegative, Positive, check_fields
from emulators.encoder.cia406._objects import SENSORS
from emulators.encoder.keys import LinearKeys, LinearWarningKeys, RotaryKeys, RotaryWarningKeys
from fieldbus.cia406 import EncoderType
from fieldbus.errors import ConfigurationError

NM_PER_M: Final = 1_000_000_000
_RPM: Final = 2.0 * math.pi / 60.0
_LARGEST_RANGE: Final = 1 << 31
"""Steps: 6004h is a signed number of 32 bits."""


@dataclass(frozen=True, kw_only=True)
class EncoderDeviceConfig(RotaryKeys, RotaryWarningKeys, LinearKeys, LinearWarningKeys):
    """An emulated encoder; `kind` says whether the keys of a rotary or of a linear one count.

    Args:
        node_id: CANopen node-ID, 1..127.
        kind: Device type, high word of 1000h (C406-001).
        sensor_places_m: Places of the sensors of a multi-sensor device along the scale, m.
        zero_mark: Place of the reference mark within the revolution or the scale, 0 to below 1 of it.
        serial_number: 650Bh and 1018h:4.
        operating_time_h: Operating hours at the start of the bench.
        operating_time_limit_h: Hours from which on warning bit 3 is set; None = never.
        warning_emcy: Warnings send an EMCY too (C406-050: not unless configured).
        boot_time_s: From power-on or reset to the boot-up frame, s.
        eds: EDS file to present on the bus; None = that of this encoder.
        objects: Values that replace defaults of the EDS, by (index, sub-index).

    Raises:
        ConfigurationError: A value is outside its range.

    """

    node_id: Annotated[int, Ge(1), Le(127)] = 1
    kind: EncoderType = EncoderType.MULTI_TURN
    sensor_places_m: tuple[float, ...] = (0.0, 0.1)
    zero_mark: Annotated[float, Ge(0.0), Lt(1.0)] = 0.0
    serial_number: Annotated[int, Ge(0), Le(0xFFFFFFFF)] = 1
    operating_time_h: NotNegative = 0.0
    operating_time_limit_h: Positive | None = None
    warning_emcy: bool = False
    boot_time_s: NotNegative = 0.0
    eds: Path | None = None
    objects: Mapping[tuple[int, int], int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        check_fields(self, "encoder")
        if self.measuring_step_nm < 1:
            raise ConfigurationError("measuring_step_um", self.measuring_step_um, ">= 0.001")
        if self.kind is EncoderType.MULTI_SENSOR and len(self.sensor_places_m) != SENSORS:
            raise ConfigurationError("sensor_places_m", self.sensor_places_m, f"{SENSORS} places")
        if self.kind.linear:
            if not 4 <= self.scale_steps <= _LARGEST_RANGE:
                raise ConfigurationError(
                    "length_mm",
                    self.length_mm,
                    f"4 to {_LARGEST_RANGE} steps of {self.measuring_step_nm} nm each",
                )
        elif self.raw_range > _LARGEST_RANGE:
            raise ConfigurationError(
                "revolutions", self.revolutions, f"at most {_LARGEST_RANGE} steps together; 6004h has 32 bits"
            )

    @property
    def scale_steps(self) -> int:
        """Measuring steps of the scale of a linear encoder, or of the period of its code."""
        return round(self.length_mm / 1000.0 * NM_PER_M / self.measuring_step_nm)

    @property
    def max_speed(self) -> float | None:
        """Speed from which on warning bit 0 is set, rad/s (m/s linear); None = never."""
        if self.kind.linear:
            return None if self.max_speed_mm_s is None else self.max_speed_mm_s / 1000.0
        return None if self.max_speed_rpm is None else self.max_speed_rpm * _RPM

    @property
    def turns(self) -> int:
        """Distinguishable revolutions (6502h): 1 for encoders that neither know nor count them."""
        counting = (
            EncoderType.MULTI_TURN,
            EncoderType.SINGLE_TURN_COUNTING,
            EncoderType.INCREMENTAL_ROTARY_COUNTING,
        )
        return self.revolutions if self.kind in counting else 1

    @property
    def raw_range(self) -> int:
        """Values of the raw position 600Ch: it lies in 0..raw_range - 1."""
        if self.kind is EncoderType.INCREMENTAL_LINEAR_COUNTING:
            return _LARGEST_RANGE  # it counts on beyond the end of the scale
        if self.kind.linear:
            return self.scale_steps
        return self.steps_per_revolution * self.turns
