"""The machine behind an emulated drive: travel, inertias, friction, end stops, switches, encoder and brake,
as configuration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal

from annotated_types import Ge, Le

from emulators.checked_fields import BENCH_FILE_TABLE, check_fields
from emulators.drive.brake import HoldingBrake
from emulators.encoder import AbsoluteEncoder, IncrementalEncoder, RotaryEncoder
from emulators.mechanics import AxisMechanics, LinearAxisMechanics, RotaryAxisMechanics, SwitchModel
from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    import numpy as np

INPUT_BITS: Final[Mapping[str, int]] = {
    "negative_limit": 0,
    "positive_limit": 1,
    "home": 2,
    "probe1": 16,
    "probe2": 17,
}
"""Inputs of a drive that a switch can be wired to, with their bits in 60FDh (C402-168)."""
PROBE_INPUTS: Final = ("probe1", "probe2")
"""Inputs that are always there: something that touches is not always part of the machine."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchConfig:
    """A switch on the travel.

    Args:
        low: Lower end of the actuated range, m or rad; -inf = everything below `high`.
        high: Upper end of the actuated range, m or rad; inf = everything above `low`.
        hysteresis: m or rad, >= 0.
        inverted: The signal is the opposite of the actuation.

    """

    low: float = -math.inf
    high: float = math.inf
    hysteresis: float = 0.0
    inverted: bool = False

    def __post_init__(self) -> None:
        self.build()

    def build(self) -> SwitchModel:
        """Return a new switch."""
        return SwitchModel(low=self.low, high=self.high, hysteresis=self.hysteresis, inverted=self.inverted)


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearAxisConfig:
    """Motor, gear and lead screw with a slide; see `emulators.mechanics.LinearAxisMechanics` for the units.

    Args:
        lead_screw_m: Travel per screw revolution, m.
        gear_ratio: Motor revolutions per screw revolution.
        motor_inertia_kgm2: kg m^2.
        screw_inertia_kgm2: kg m^2.
        load_mass_kg: kg.
        viscous_friction: N per m/s.
        coulomb_friction: N.
        static_friction: N; None = as `coulomb_friction`.
        gravity_force: N.
        stops_m: Lower and upper end stop, m; None = none on that side.
        stop_stiffness: N/m.
        stop_damping: Ns/m.
        position_m: Start position, m.
        switches: Switches by input name: `negative_limit`, `positive_limit`, `home`, `probe1`, `probe2`.
        backlash_m: Play between nut and slide, m.

    """

    lead_screw_m: float = 0.010
    gear_ratio: float = 1.0
    motor_inertia_kgm2: float = 2.0e-4
    screw_inertia_kgm2: float = 0.5e-4
    load_mass_kg: float = 40.0
    viscous_friction: float = 30.0
    coulomb_friction: float = 30.0
    static_friction: float | None = None
    gravity_force: float = 0.0
    stops_m: tuple[float | None, float | None] = (-0.6, 0.6)
    stop_stiffness: float = 1e7
    stop_damping: float = 2e4
    position_m: float = 0.0
    switches: Mapping[str, SwitchConfig] = field(default_factory=dict)
    backlash_m: float = 0.0

    def __post_init__(self) -> None:
        self.build()

    @property
    def load_at_motor_kgm2(self) -> float:
        """Moment of inertia of screw and slide as the motor sees it, kg m²."""
        slide = self.load_mass_kg * (self.lead_screw_m / math.tau) ** 2
        return (self.screw_inertia_kgm2 + slide) / self.gear_ratio**2

    def build(self) -> tuple[AxisMechanics, dict[str, SwitchModel]]:
        """Return a new plant and its switches by input name."""
        switches = _built_switches(self.switches)
        mechanics = LinearAxisMechanics(
            lead_screw_m=self.lead_screw_m,
            gear_ratio=self.gear_ratio,
            motor_inertia_kgm2=self.motor_inertia_kgm2,
            screw_inertia_kgm2=self.screw_inertia_kgm2,
            load_mass_kg=self.load_mass_kg,
            viscous_friction=self.viscous_friction,
            coulomb_friction=self.coulomb_friction,
            static_friction=self.static_friction,
            gravity_force=self.gravity_force,
            lower_stop_m=self.stops_m[0],
            upper_stop_m=self.stops_m[1],
            stop_stiffness=self.stop_stiffness,
            stop_damping=self.stop_damping,
            position_m=self.position_m,
            switches=switches.values(),
            backlash_m=self.backlash_m,
        )
        return mechanics, switches


@dataclass(frozen=True, slots=True, kw_only=True)
class RotaryAxisConfig:
    """Motor and gear with a turning load; see `emulators.mechanics.RotaryAxisMechanics` for the units.

    Args:
        gear_ratio: Motor revolutions per load revolution.
        motor_inertia_kgm2: kg m^2.
        load_inertia_kgm2: kg m^2.
        viscous_friction: Nm per rad/s.
        coulomb_friction: Nm.
        static_friction: Nm; None = as `coulomb_friction`.
        load_torque: Nm.
        stops_rad: Lower and upper end stop, rad; None = none on that side.
        position_rad: Start position, rad.
        switches: Switches by input name.
        backlash_rad: Play between gear and load, rad.

    """

    gear_ratio: float = 1.0
    motor_inertia_kgm2: float = 2.0e-4
    load_inertia_kgm2: float = 2.0e-4
    viscous_friction: float = 1e-4
    coulomb_friction: float = 0.05
    static_friction: float | None = None
    load_torque: float = 0.0
    stops_rad: tuple[float | None, float | None] = (None, None)
    position_rad: float = 0.0
    switches: Mapping[str, SwitchConfig] = field(default_factory=dict)
    backlash_rad: float = 0.0

    def __post_init__(self) -> None:
        self.build()

    @property
    def load_at_motor_kgm2(self) -> float:
        """Moment of inertia of the load as the motor sees it, kg m²."""
        return self.load_inertia_kgm2 / self.gear_ratio**2

    def build(self) -> tuple[AxisMechanics, dict[str, SwitchModel]]:
        """Return a new plant and its switches by input name."""
        switches = _built_switches(self.switches)
        mechanics = RotaryAxisMechanics(
            gear_ratio=self.gear_ratio,
            motor_inertia_kgm2=self.motor_inertia_kgm2,
            load_inertia_kgm2=self.load_inertia_kgm2,
            viscous_friction=self.viscous_friction,
            coulomb_friction=self.coulomb_friction,
            static_friction=self.static_friction,
            load_torque=self.load_torque,
            lower_stop_rad=self.stops_rad[0],
            upper_stop_rad=self.stops_rad[1],
            position_rad=self.position_rad,
            switches=switches.values(),
            backlash_rad=self.backlash_rad,
        )
        return mechanics, switches


def _built_switches(switches: Mapping[str, SwitchConfig]) -> dict[str, SwitchModel]:
    """Return new switches by input name, in the order of the inputs."""
    for name in switches:
        if name not in INPUT_BITS:
            raise ConfigurationError("switches", name, ", ".join(INPUT_BITS))
    return {
        name: switches[name].build() if name in switches else SwitchModel.unreached()
        for name in INPUT_BITS
        if name in switches or name in PROBE_INPUTS
    }


def check_number(where: str, value: float, *, positive: bool = False) -> None:
    """Check a quantity of a configuration.

    Raises:
        ConfigurationError: It is negative (0, if it has to be positive) or not finite.

    """
    if not math.isfinite(value) or value < 0.0 or (positive and value == 0.0):
        raise ConfigurationError(where, value, "a finite number " + ("> 0" if positive else ">= 0"))


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderConfig:
    """Motor encoder.

    Args:
        kind: `incremental` loses its position at power-off, `absolute` keeps it.
        counts_per_revolution: Increments per revolution.
        turns: Distinguishable revolutions of an absolute encoder.
        zero_mark_counts: Place of the zero mark, increments.
        reversed_direction: Counts down in positive direction.
        interpolated: The control loop sees fractions of an increment.

    """

    kind: Literal["incremental", "absolute"] = "incremental"
    counts_per_revolution: int = 131072
    turns: int = 4096
    zero_mark_counts: int = 0
    reversed_direction: bool = False
    interpolated: bool = True

    def __post_init__(self) -> None:
        if self.kind not in ("incremental", "absolute"):
            raise ConfigurationError("encoder kind", self.kind, "incremental, absolute")
        self.build(None)

    def build(self, rng: np.random.Generator | None) -> RotaryEncoder:
        """Return a new encoder."""
        if self.kind == "absolute":
            return AbsoluteEncoder(
                turns=self.turns,
                counts_per_revolution=self.counts_per_revolution,
                reversed_direction=self.reversed_direction,
                zero_mark_counts=self.zero_mark_counts,
                interpolated=self.interpolated,
                rng=rng,
            )
        return IncrementalEncoder(
            counts_per_revolution=self.counts_per_revolution,
            reversed_direction=self.reversed_direction,
            zero_mark_counts=self.zero_mark_counts,
            interpolated=self.interpolated,
            rng=rng,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class BrakeConfig:
    """`[drive.NAME.brake]`: holding brake of the motor.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    torque_nm: Annotated[float, Ge(0.0), Le(100_000.0)] = 0.0
    """Holding torque at the motor shaft; 0 = there is no brake."""
    opening_time_ms: Annotated[float, Ge(0.0), Le(5000.0)] = 0.0
    """From the command to the released shaft; setpoints pass only after it."""
    closing_time_ms: Annotated[float, Ge(0.0), Le(5000.0)] = 0.0
    """From the command to the full torque; the motor holds the axis for so long."""

    def __post_init__(self) -> None:
        check_fields(self, "brake")

    def build(self, mechanics: AxisMechanics) -> HoldingBrake:
        """Return the brake, which acts on `mechanics`."""
        return HoldingBrake(
            mechanics,
            torque_Nm=self.torque_nm,
            opening_time_s=self.opening_time_ms / 1000.0,
            closing_time_s=self.closing_time_ms / 1000.0,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SafetyConfig:
    """`[drive.NAME.safety]`: safety inputs of the drive (C402-030, C402-168).

    Raises:
        ConfigurationError: A value is out of its range.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    sto: Literal["inhibit", "fault"] = "inhibit"
    """Safe torque off leads to *Switch on disabled* with warning, or to a fault (FF80h, F30600)."""
    ss1_time_ms: Annotated[float, Ge(1.0), Le(600_000.0)] = 500.0
    """Safe stop 1: from the input to safe torque off."""
    ss1_monitored: bool = True
    """The ramp of safe stop 1 is watched (fault FF81h, F01600), and safe torque off follows at standstill;
    false: by time only.
    """
    interlock: Literal["none", "inhibit", "quick_stop", "fault"] = "none"
    """Input 60FDh bit 3: not wired; or what opening it does: torque off, quick stop, fault 9000h."""

    def __post_init__(self) -> None:
        check_fields(self, "safety")

    @property
    def ss1_time_s(self) -> float:
        """Time of safe stop 1, s."""
        return self.ss1_time_ms / 1000.0
