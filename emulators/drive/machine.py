"""The machine behind an emulated drive: travel, inertias, friction, end stops, switches, encoder and brake,
as configuration.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal

from annotated_types import Ge, Le

from emulators.checked_fields import BENCH_FILE_TABLE, NotNegative, Positive, check_fields
from emulators.drive.brake import HoldingBrake
from emulators.drive.keys import EncoderKind, IndexIncrements, MountingIncrements
from emulators.encoder import AbsoluteEncoder, IncrementalEncoder, RotaryEncoder
from emulators.input_filter import INPUT_FILTER_MS
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
_HOME_MM: Final = -500.0
SafeTime_ms = Annotated[float, Ge(1.0), Le(600_000.0)]


@dataclass(frozen=True, kw_only=True)
class SwitchesConfig:
    """`[drive.NAME.switches]`: switches on the travel of the load.

    Raises:
        ConfigurationError: A value is out of its range, or a cam ends before it begins.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    negative_limit_mm: float | None = -550.0
    """Active below this position."""
    positive_limit_mm: float | None = 550.0
    """Active above this position."""
    limit_width_mm: Positive | None = None
    """Way on which a limit switch stays actuated, for switches that can be traversed
    (`PositionLimits_HW.Mode` = 1); none: as far as the load can travel.
    """
    normally_closed: bool = False
    """Limit switches open when they are actuated. `MinSwitchLevel` and `MaxSwitchLevel` of the axis follow.
    What the drive itself does with its inputs (homing in the drive, `limit_cams_on`) takes an active
    input for an actuated switch.
    """
    home_mm: float | None = _HOME_MM
    """Active below this position; not together with the next two."""
    home_from_mm: float | None = None
    """The home switch is a cam that begins here; alone: active above this position."""
    home_to_mm: float | None = None
    """End of the cam; alone: active below this position; above `home_from_mm`."""
    probe1_from_mm: float | None = None
    """A workpiece that actuates touch probe 1 begins here; alone: everything above this position."""
    probe1_to_mm: float | None = None
    """End of the workpiece; alone: everything below this position; above `probe1_from_mm`."""
    probe2_from_mm: float | None = None
    """The same for touch probe 2."""
    probe2_to_mm: float | None = None
    """The same for touch probe 2; above `probe2_from_mm`."""
    hysteresis_mm: NotNegative = 0.5
    """Distance between switching on and off; touch probes have none."""
    input_filter_ms: NotNegative = INPUT_FILTER_MS
    """A limit or home switch counts when it has been stable for this long."""
    negative_limit_filter_ms: NotNegative | None = None
    """The same for the negative limit switch alone; none: `input_filter_ms`."""
    positive_limit_filter_ms: NotNegative | None = None
    """The same for the positive limit switch."""
    home_filter_ms: NotNegative | None = None
    """The same for the home switch."""

    def __post_init__(self) -> None:
        check_fields(self, "switches")
        for name, (low, high) in self._cams.items():
            if low is not None and high is not None and not low < high:
                raise ConfigurationError(f"{name}_from_mm", low, f"less than {name}_to_mm = {high:g}")
        if self.home_mm not in (None, _HOME_MM) and (
            self.home_from_mm is not None or self.home_to_mm is not None
        ):
            raise ConfigurationError("home_mm", self.home_mm, "left out with home_from_mm or home_to_mm")

    @property
    def _cams(self) -> dict[str, tuple[float | None, float | None]]:
        """Range in which a switch is actuated, mm, of home switch and touch probes that are there."""
        home = (self.home_from_mm, self.home_to_mm)
        cams = {
            "home": (None, self.home_mm) if home == (None, None) else home,
            "probe1": (self.probe1_from_mm, self.probe1_to_mm),
            "probe2": (self.probe2_from_mm, self.probe2_to_mm),
        }
        return {name: cam for name, cam in cams.items() if cam != (None, None)}

    def filter_s(self, name: str) -> float:
        """Return the time for which an input has to be stable, s; 0 for a probe.

        Args:
            name: Input, one of `INPUT_BITS`.

        """
        if name in PROBE_INPUTS:
            return 0.0
        own = {
            "negative_limit": self.negative_limit_filter_ms,
            "positive_limit": self.positive_limit_filter_ms,
            "home": self.home_filter_ms,
        }[name]
        return (self.input_filter_ms if own is None else own) / 1000.0

    def build(self) -> dict[str, SwitchModel]:
        """Return new switches by input name, in the order of the inputs; probes are always there."""
        hysteresis = self.hysteresis_mm / 1000.0
        width = math.inf if self.limit_width_mm is None else self.limit_width_mm / 1000.0
        limit = partial(SwitchModel, hysteresis=hysteresis, inverted=self.normally_closed)
        switches: dict[str, SwitchModel] = {}
        if self.negative_limit_mm is not None:
            place = self.negative_limit_mm / 1000.0
            switches["negative_limit"] = limit(low=place - width, high=place)
        if self.positive_limit_mm is not None:
            place = self.positive_limit_mm / 1000.0
            switches["positive_limit"] = limit(low=place, high=place + width)
        for name, (low, high) in self._cams.items():
            switches[name] = SwitchModel(
                low=-math.inf if low is None else low / 1000.0,
                high=math.inf if high is None else high / 1000.0,
                # A probe is made for exactness: it springs back where it was touched.
                hysteresis=hysteresis if name == "home" else 0.0,
            )
        for name in PROBE_INPUTS:
            switches.setdefault(name, SwitchModel.unreached())
        return switches


NO_SWITCHES: Final = SwitchesConfig(negative_limit_mm=None, positive_limit_mm=None, home_mm=None)
"""A travel without switches; something may touch the probes."""


@dataclass(frozen=True, kw_only=True)
class LinearAxisConfig:
    """`[drive.NAME.mechanics]`: motor, gear, screw and load that the emulated drive moves.

    Raises:
        ConfigurationError: A value is out of its range, or values do not fit together.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    lead_screw_mm: Positive = 10.0
    """Travel per revolution of the screw."""
    gear_numerator: Annotated[int, Ge(1)] = 1
    """Motor revolutions of the gear."""
    gear_denominator: Annotated[int, Ge(1)] = 1
    """Screw revolutions of the gear."""
    reversed: bool = False
    """The load goes backwards while the motor turns forwards: a left-handed screw, a motor mounted the other
    way round. `Actor.InverseDirection` and `Sensor[1].InverseDirection` of the axis turn it round again.
    """
    load_mass_kg: NotNegative = 40.0
    """Mass of the load."""
    motor_inertia_kgm2: Positive = 2.0e-4
    """Inertia of the motor."""
    screw_inertia_kgm2: NotNegative = 0.5e-4
    """Inertia of the screw."""
    viscous_friction_n_per_m_s: NotNegative = 30.0
    """Viscous friction."""
    coulomb_friction_n: NotNegative = 30.0
    """Sliding friction."""
    static_friction_n: NotNegative | None = None
    """Breakaway force at standstill; none: as the sliding friction; at least `coulomb_friction_n`."""
    gravity_n: float = 0.0
    """Constant force on the load in positive direction; a hanging load has a negative one."""
    backlash_mm: NotNegative = 0.0
    """Play between nut and slide, from one side to the other: motor and screw move so far without the load;
    not with a stepper motor.
    """
    negative_stop_mm: float | None = -600.0
    """Place of the lower end stop."""
    positive_stop_mm: float | None = 600.0
    """Place of the upper end stop; above `negative_stop_mm`."""
    stop_stiffness_n_per_m: Positive = 1e7
    """Spring of an end stop."""
    stop_damping_n_per_m_s: NotNegative = 2e4
    """Damper of an end stop."""
    start_position_mm: float = 0.0
    """Position of the load at the start."""

    def __post_init__(self) -> None:
        check_fields(self, "mechanics")
        if self.static_friction_n is not None and self.static_friction_n < self.coulomb_friction_n:
            raise ConfigurationError(
                "static_friction_n",
                self.static_friction_n,
                f"at least coulomb_friction_n = {self.coulomb_friction_n:g}",
            )
        low, high = self.negative_stop_mm, self.positive_stop_mm
        if low is not None and high is not None and not low < high:
            raise ConfigurationError("positive_stop_mm", high, f"above negative_stop_mm = {low:g}")

    @property
    def gear_ratio(self) -> float:
        """Motor revolutions per screw revolution."""
        return self.gear_numerator / self.gear_denominator

    @property
    def load_at_motor_kgm2(self) -> float:
        """Moment of inertia of screw and slide as the motor sees it, kg m²."""
        slide = self.load_mass_kg * (self.lead_screw_mm / 1000.0 / math.tau) ** 2
        return (self.screw_inertia_kgm2 + slide) / self.gear_ratio**2

    def build(self, switches: Iterable[SwitchModel] = ()) -> AxisMechanics:
        """Return a new plant, with switches on its travel."""
        low, high = self.negative_stop_mm, self.positive_stop_mm
        return LinearAxisMechanics(
            lead_screw_m=self.lead_screw_mm / 1000.0,
            gear_ratio=self.gear_ratio,
            motor_inertia_kgm2=self.motor_inertia_kgm2,
            screw_inertia_kgm2=self.screw_inertia_kgm2,
            load_mass_kg=self.load_mass_kg,
            viscous_friction=self.viscous_friction_n_per_m_s,
            coulomb_friction=self.coulomb_friction_n,
            static_friction=self.static_friction_n,
            gravity_force=self.gravity_n,
            lower_stop_m=None if low is None else low / 1000.0,
            upper_stop_m=None if high is None else high / 1000.0,
            stop_stiffness=self.stop_stiffness_n_per_m,
            stop_damping=self.stop_damping_n_per_m_s,
            position_m=self.start_position_mm / 1000.0,
            switches=switches,
            backlash_m=self.backlash_mm / 1000.0,
            reversed_direction=self.reversed,
        )


@dataclass(frozen=True, kw_only=True)
class RotaryAxisConfig:
    """Motor and gear with a turning load, without switches; units as in `RotaryAxisMechanics`.

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
        backlash_rad: Play between gear and load, rad.
        reversed: The load turns backwards while the motor turns forwards.

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
    backlash_rad: float = 0.0
    reversed: bool = False

    def __post_init__(self) -> None:
        self.build()

    @property
    def load_at_motor_kgm2(self) -> float:
        """Moment of inertia of the load as the motor sees it, kg m²."""
        return self.load_inertia_kgm2 / self.gear_ratio**2

    def build(self, switches: Iterable[SwitchModel] = ()) -> AxisMechanics:
        """Return a new plant, with switches on its travel."""
        return RotaryAxisMechanics(
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
            switches=switches,
            backlash_rad=self.backlash_rad,
            reversed_direction=self.reversed,
        )


def build_machine(
    mechanics: LinearAxisConfig | RotaryAxisConfig, switches: SwitchesConfig
) -> tuple[AxisMechanics, dict[str, SwitchModel]]:
    """Return a new plant and its switches by input name; a turning load has none but the probes.

    Args:
        mechanics: Motor, gear and load.
        switches: Switches on the travel of a linear axis.

    """
    fitted = (switches if isinstance(mechanics, LinearAxisConfig) else NO_SWITCHES).build()
    return mechanics.build(fitted.values()), fitted


def check_number(where: str, value: float, *, positive: bool = False) -> None:
    """Check a quantity of a configuration.

    Raises:
        ConfigurationError: It is negative (0, if it has to be positive) or not finite.

    """
    if not math.isfinite(value) or value < 0.0 or (positive and value == 0.0):
        raise ConfigurationError(where, value, "a finite number " + ("> 0" if positive else ">= 0"))


@dataclass(frozen=True, kw_only=True)
class EncoderConfig:
    """Motor encoder.

    Args:
        kind: `incremental` loses its position at power-off, `absolute` keeps it.
        counts_per_revolution: Increments per revolution.
        turns: Distinguishable revolutions of an absolute encoder.
        zero_mark_counts: Place of the zero mark, increments.
        mounting_counts: Value of an absolute encoder where the shaft is at zero, increments.
        reversed_direction: Counts down in positive direction.
        interpolated: The control loop sees fractions of an increment.

    """

    kind: EncoderKind = "incremental"
    counts_per_revolution: int = 131072
    turns: int = 4096
    zero_mark_counts: IndexIncrements = 0
    mounting_counts: MountingIncrements = 0
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
                mounting_offset=self.mounting_counts,
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


@dataclass(frozen=True, kw_only=True)
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


@dataclass(frozen=True, kw_only=True)
class SafeStopConfig:
    """Safe torque off and safe stop 1 of a drive of any profile.

    Raises:
        ConfigurationError: A value is out of its range.

    """

    __pydantic_config__: ClassVar = BENCH_FILE_TABLE

    sto: Literal["inhibit", "fault"] = "inhibit"
    """Safe torque off leads to *Switch on disabled* with warning, or to a fault (FF80h, F30600)."""
    ss1_time_ms: SafeTime_ms = 500.0
    """Safe stop 1: from the input to safe torque off."""
    ss1_monitored: bool = True
    """The ramp of safe stop 1 is watched (fault FF81h, F01600), and safe torque off follows at standstill;
    false: by time only.
    """

    def __post_init__(self) -> None:
        check_fields(self, "safety")

    @property
    def ss1_time_s(self) -> float:
        """Time of safe stop 1, s."""
        return self.ss1_time_ms / 1000.0


@dataclass(frozen=True, kw_only=True)
class SafetyConfig(SafeStopConfig):
    """`[drive.NAME.safety]`: safety inputs of a CiA 402 drive (C402-030, C402-168).

    Raises:
        ConfigurationError: A value is out of its range.

    """

    interlock: Literal["none", "inhibit", "quick_stop", "fault"] = "none"
    """Input 60FDh bit 3: not wired; or what opening it does: torque off, quick stop, fault 9000h."""
