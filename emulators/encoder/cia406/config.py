"""Configuration of an emulated CiA 406 encoder."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from emulators.encoder.cia406._objects import SENSORS
from fieldbus.cia406 import EncoderType
from fieldbus.errors import ConfigurationError

NM_PER_M: Final = 1_000_000_000
_LARGEST_RANGE: Final = 1 << 31
"""Steps: 6004h is a signed number of 32 bits."""


@dataclass(frozen=True, kw_only=True)
class EncoderDeviceConfig:
    """An emulated encoder.

    Args:
        node_id: CANopen node-ID, 1..127.
        kind: Device type, high word of 1000h (C406-001).
        steps_per_revolution: 6501h of a rotary encoder, 4..2^31.
        revolutions: 6502h of an encoder that knows or counts its turns, 1..65535; others have one.
        measuring_step_nm: 6501h of a linear encoder, nm (0.001 µm), >= 1.
        length_m: Length of the scale, or of the period of a cyclic code, m.
        sensor_places_m: Places of the sensors of a multi-sensor device along the scale, m.
        max_speed: Speed from which on warning bit 0 is set, rad/s (m/s linear); None = never.
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

    node_id: int = 1
    kind: EncoderType = EncoderType.MULTI_TURN
    steps_per_revolution: int = 8192
    revolutions: int = 4096
    measuring_step_nm: int = 1000
    length_m: float = 1.0
    sensor_places_m: tuple[float, ...] = (0.0, 0.1)
    max_speed: float | None = None
    zero_mark: float = 0.0
    serial_number: int = 1
    operating_time_h: float = 0.0
    operating_time_limit_h: float | None = None
    warning_emcy: bool = False
    boot_time_s: float = 0.0
    eds: Path | None = None
    objects: Mapping[tuple[int, int], int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 1 <= self.node_id <= 127:
            raise ConfigurationError("node_id", self.node_id, "1..127")
        if not 4 <= self.steps_per_revolution <= _LARGEST_RANGE:
            raise ConfigurationError(
                "steps_per_revolution", self.steps_per_revolution, f"4..{_LARGEST_RANGE}"
            )
        if not 1 <= self.revolutions <= 0xFFFF:
            raise ConfigurationError("revolutions", self.revolutions, "1..65535")
        if self.measuring_step_nm < 1:
            raise ConfigurationError("measuring_step_nm", self.measuring_step_nm, ">= 1")
        for name in ("length_m", "max_speed", "operating_time_limit_h"):
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise ConfigurationError(name, value, "a finite number > 0")
        for name in ("operating_time_h", "boot_time_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise ConfigurationError(name, value, "a finite number >= 0")
        if not 0.0 <= self.zero_mark < 1.0:
            raise ConfigurationError("zero_mark", self.zero_mark, "0 to below 1")
        if not 0 <= self.serial_number <= 0xFFFFFFFF:
            raise ConfigurationError("serial_number", self.serial_number, "0..4294967295")
        if self.kind is EncoderType.MULTI_SENSOR and len(self.sensor_places_m) != SENSORS:
            raise ConfigurationError("sensor_places_m", self.sensor_places_m, f"{SENSORS} places")
        if self.kind.linear:
            if not 4 <= self.scale_steps <= _LARGEST_RANGE:
                raise ConfigurationError(
                    "length_m",
                    self.length_m,
                    f"4 to {_LARGEST_RANGE} steps of {self.measuring_step_nm} nm each",
                )
        elif self.raw_range > _LARGEST_RANGE:
            raise ConfigurationError(
                "revolutions", self.revolutions, f"at most {_LARGEST_RANGE} steps together; 6004h has 32 bits"
            )

    @property
    def scale_steps(self) -> int:
        """Measuring steps of the scale of a linear encoder, or of the period of its code."""
        return round(self.length_m * NM_PER_M / self.measuring_step_nm)

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
