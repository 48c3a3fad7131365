"""Keys of a bench file that describe an encoder: resolution and range, and how it is coupled to a machine.

The tables of encoders, of second encoders and the configurations of the emulators take them over from here.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, Literal, NamedTuple

from annotated_types import Ge, Le, Unit
from typing_extensions import override

from emulators.checked_fields import NotNegative, Positive


@dataclass(frozen=True, kw_only=True)
class RotaryKeys:
    """Resolution and range of a rotary encoder."""

    steps_per_revolution: Annotated[int, Ge(4), Le(2**31), Unit("steps/rev")] = 8192
    """Single-turn resolution (6501h)."""
    revolutions: Annotated[int, Ge(1), Le(65_535)] = 4096
    """Distinguishable revolutions of an encoder that knows or counts them (6502h); with CiA 406 at most
    2147483648 steps together.
    """

    def turns_of(self, kind: str) -> int:
        """Return the revolutions that the PROFIdrive format of a type tells apart; 0 = it is incremental."""
        return {"multi_turn": self.revolutions, "single_turn": 1}.get(kind, 0)


@dataclass(frozen=True, kw_only=True)
class LinearKeys:
    """Resolution and range of a linear encoder."""

    measuring_step_um: Positive = 1.0
    """Measuring step of a linear encoder (6501h); distance of two lines of a PROFIdrive one (P979[2]); in
    steps of 0.001.
    """
    length_mm: Positive = 2000.0
    """Length of the scale, or period of a cyclic code."""

    @property
    def measuring_step_nm(self) -> int:
        """Measuring step, or distance of two lines, nm."""
        return round(self.measuring_step_um * 1000.0)

    @property
    def periods(self) -> int:
        """Number of lines of the scale."""
        return round(self.length_mm * 1e6 / max(self.measuring_step_nm, 1))


@dataclass(frozen=True, kw_only=True)
class RotaryWarningKeys:
    """Warning of a rotary CiA 406 encoder."""

    max_speed_rpm: Positive | None = None
    """Speed from which on it warns (6505h bit 0)."""


@dataclass(frozen=True, kw_only=True)
class LinearWarningKeys:
    """Warning of a linear CiA 406 encoder."""

    max_speed_mm_s: Positive | None = None
    """Speed from which on a linear encoder warns (6505h bit 0)."""


class Coupling(NamedTuple):
    """How an encoder is coupled to what it measures, in rad and m."""

    ratio: float
    """Encoder coordinate per coordinate of the shaft or the load."""
    offset: float
    """Encoder coordinate where the machine is at zero."""
    backlash: float
    """Play of the coupling."""


@dataclass(frozen=True, kw_only=True)
class MountingKeys(ABC):
    """Where an encoder sits, with its gear."""

    mounting: Literal["motor", "load"] = "motor"
    """The motor shaft, or the load behind gear and screw; a linear encoder needs `load`."""
    gear_numerator: Annotated[int, Ge(1)] = 1
    """Revolutions of the encoder ..."""
    gear_denominator: Annotated[int, Ge(1)] = 1
    """... per so many revolutions of what it sits on."""
    reversed: bool = False
    """Mounted the other way round."""

    @abstractmethod
    def coupling(self, lead_mm: float | None) -> Coupling:
        """Return how the encoder is coupled to a machine, or to a shaft or slide of its own.

        Args:
            lead_mm: Lead of the screw of the machine, mm; None: it has none.

        """

    @property
    def gear_ratio(self) -> float:
        """Revolutions of the encoder per revolution of what it sits on, with sign."""
        return self.gear_numerator / self.gear_denominator * (-1.0 if self.reversed else 1.0)


@dataclass(frozen=True, kw_only=True)
class RotaryMountingKeys(MountingKeys):
    """How a rotary encoder is coupled to what it measures."""

    mm_per_revolution: Positive | None = None
    """Travel of the load per revolution of a rotary encoder with `mounting = "load"`; none: the lead of the
    screw.
    """
    offset_deg: float = 0.0
    """Place of a rotary encoder where the machine is at zero."""
    backlash_deg: NotNegative = 0.0
    """Play of the coupling of a rotary encoder."""

    @override
    def coupling(self, lead_mm: float | None) -> Coupling:
        ratio = self.gear_ratio
        travel_mm = (self.mm_per_revolution or lead_mm) if self.mounting == "load" else None
        if travel_mm is not None:
            ratio *= 2.0 * math.pi * 1000.0 / travel_mm
        return Coupling(ratio, math.radians(self.offset_deg), math.radians(self.backlash_deg))


@dataclass(frozen=True, kw_only=True)
class LinearMountingKeys(MountingKeys, LinearKeys):
    """How a linear encoder is coupled to the load or slide that it measures."""

    offset_mm: float | None = None
    """Place on the scale where the machine is at zero; none: its middle."""
    backlash_mm: NotNegative = 0.0
    """Play of the coupling of a linear one."""

    @override
    def coupling(self, lead_mm: float | None) -> Coupling:
        offset_mm = 0.5 * self.length_mm if self.offset_mm is None else self.offset_mm
        return Coupling(self.gear_ratio, offset_mm / 1000.0, self.backlash_mm / 1000.0)
