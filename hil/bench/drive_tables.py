"""Tables within `[drive.NAME]` of a bench file: machine, switches, brake, supply, protection, safety,
encoder, profile.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from annotated_types import Unit
from pydantic import Discriminator, Field, Tag, model_validator

from hil.bench._encoder_tables import (
    Coupling,
    FineBits,
    encoder_format,
    gear_ratio,
    linear_coupling,
    rotary_coupling,
    scale_periods,
)
from hil.bench._table import Finite, NotNegative, Positive, Table, Time_ms

if TYPE_CHECKING:
    from emulators.drive.machine import LinearAxisConfig, SafetyConfig
    from emulators.drive.profidrive.positioner.config import PositionerSettings
    from emulators.drive.profidrive.safety.config import SafeMotionConfig
    from emulators.drive.profidrive.second_encoder import SecondEncoderConfig
    from emulators.encoder.profidrive import EncoderFormat

Voltage = Annotated[float, Field(ge=1.0, le=5000.0)]
Temperature = Annotated[float, Field(ge=-60.0, le=400.0)]
Seconds = Annotated[float, Field(ge=0.01, le=100_000.0)]
Reaction = Literal["sto", "ss1", "ss2"]
SafeTime_ms = Annotated[float, Field(ge=1.0, le=600_000.0)]
Position = Annotated[int, Field(ge=-2_147_482_648, le=2_147_482_647), Unit("LU")]
Length = Annotated[Positive, Unit("LU")]
Velocity = Annotated[Positive, Unit("1000 LU/min")]
Acceleration = Annotated[Positive, Unit("1000 LU/s²")]


class MechanicsTable(Table):
    """`[drive.NAME.mechanics]`: motor, gear, screw and load that the emulated drive moves."""

    lead_screw_mm: Positive = 10.0
    """Travel per revolution of the screw."""
    gear_numerator: Annotated[int, Field(ge=1)] = 1
    """Motor revolutions of the gear."""
    gear_denominator: Annotated[int, Field(ge=1)] = 1
    """Screw revolutions of the gear."""
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
    gravity_n: Finite = 0.0
    """Constant force on the load in positive direction; a hanging load has a negative one."""
    backlash_mm: NotNegative = 0.0
    """Play between nut and slide, from one side to the other: motor and screw move so far without the load;
    not with a stepper motor.
    """
    negative_stop_mm: Finite | None = -600.0
    """Place of the lower end stop."""
    positive_stop_mm: Finite | None = 600.0
    """Place of the upper end stop."""
    start_position_mm: Finite = 0.0
    """Position of the load at the start."""

    @model_validator(mode="after")
    def _friction(self) -> MechanicsTable:
        if self.static_friction_n is not None and self.static_friction_n < self.coulomb_friction_n:
            raise ValueError(
                f"static_friction_n: {self.static_friction_n:g} is less than coulomb_friction_n = "
                f"{self.coulomb_friction_n:g}"
            )
        return self

    def build(self, switches: SwitchTable) -> LinearAxisConfig:
        """Return the machine with switches on its travel."""
        from emulators.drive.machine import LinearAxisConfig

        low, high = self.negative_stop_mm, self.positive_stop_mm
        return LinearAxisConfig(
            lead_screw_m=self.lead_screw_mm / 1000.0,
            gear_ratio=self.gear_numerator / self.gear_denominator,
            motor_inertia_kgm2=self.motor_inertia_kgm2,
            screw_inertia_kgm2=self.screw_inertia_kgm2,
            load_mass_kg=self.load_mass_kg,
            viscous_friction=self.viscous_friction_n_per_m_s,
            coulomb_friction=self.coulomb_friction_n,
            static_friction=self.static_friction_n,
            gravity_force=self.gravity_n,
            stops_m=(None if low is None else low / 1000.0, None if high is None else high / 1000.0),
            position_m=self.start_position_mm / 1000.0,
            switches=switches.build(),
            backlash_m=self.backlash_mm / 1000.0,
        )


class SwitchTable(Table):
    """`[drive.NAME.switches]`: switches on the travel of the load."""

    negative_limit_mm: Finite | None = -550.0
    """Active below this position."""
    positive_limit_mm: Finite | None = 550.0
    """Active above this position."""
    limit_width_mm: Positive | None = None
    """Way on which a limit switch stays actuated, for switches that can be traversed
    (`PositionLimits_HW.Mode` = 1); none: as far as the load can travel.
    """
    normally_closed: bool = False
    """Limit switches open when they are actuated; `MinSwitchLevel` and `MaxSwitchLevel` FALSE go with that.
    What the drive itself does with its inputs (homing in the drive, `limit_cams_on`) takes an active
    input for an actuated switch.
    """
    home_mm: Finite | None = -500.0
    """Active below this position; not together with the next two."""
    home_from_mm: Finite | None = None
    """The home switch is a cam that begins here; alone: active above this position."""
    home_to_mm: Finite | None = None
    """End of the cam; alone: active below this position; above `home_from_mm`."""
    probe1_from_mm: Finite | None = None
    """A workpiece that actuates touch probe 1 begins here; alone: everything above this position."""
    probe1_to_mm: Finite | None = None
    """End of the workpiece; alone: everything below this position; above `probe1_from_mm`."""
    probe2_from_mm: Finite | None = None
    """The same for touch probe 2."""
    probe2_to_mm: Finite | None = None
    """The same for touch probe 2; above `probe2_from_mm`."""
    hysteresis_mm: NotNegative = 0.5
    """Distance between switching on and off; touch probes have none."""
    input_filter_ms: NotNegative = 0.0
    """A limit or home switch counts when it has been stable for this long."""

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

    @model_validator(mode="after")
    def _ranges(self) -> SwitchTable:
        for name, (low, high) in self._cams.items():
            if low is not None and high is not None and not low < high:
                raise ValueError(f"{name}_from_mm: {low:g} is not below {name}_to_mm: {high:g}")
        default = SwitchTable.model_fields["home_mm"].default
        if self.home_mm != default and (self.home_from_mm is not None or self.home_to_mm is not None):
            raise ValueError("home_mm goes without home_from_mm and home_to_mm")
        return self

    def build(self) -> dict[str, Any]:
        """Return the switches by the name of the input."""
        from emulators.drive.machine import SwitchConfig

        hysteresis = self.hysteresis_mm / 1000.0
        width = math.inf if self.limit_width_mm is None else self.limit_width_mm / 1000.0
        limit = partial(SwitchConfig, hysteresis=hysteresis, inverted=self.normally_closed)
        switches = {}
        if self.negative_limit_mm is not None:
            place = self.negative_limit_mm / 1000.0
            switches["negative_limit"] = limit(low=place - width, high=place)
        if self.positive_limit_mm is not None:
            place = self.positive_limit_mm / 1000.0
            switches["positive_limit"] = limit(low=place, high=place + width)
        for name, (low, high) in self._cams.items():
            switches[name] = SwitchConfig(
                low=-math.inf if low is None else low / 1000.0,
                high=math.inf if high is None else high / 1000.0,
                # A probe is made for exactness: it springs back where it was touched.
                hysteresis=hysteresis if name == "home" else 0.0,
            )
        return switches


class HomingTable(Table):
    """`[drive.NAME.homing]`: what manufacturers of drives do differently."""

    offset: Literal["profile", "vendor"] | None = None
    """Position at the home point: -607Ch (`profile`), or +607Ch (`vendor`); none: as the personality has it.
    """
    move: Literal["none", "zero"] = "none"
    """Whether the drive moves to position zero when it has found home."""
    hard_stop_methods: dict[
        Literal["-1", "-2", "-3", "-4"],
        Literal["positive", "negative", "positive_index", "negative_index", "unsupported"],
    ] = {}
    """Meaning of methods -1 to -4 where it differs (`{ "-1" = "negative_index" }`): side of the stop, and
    whether the index on the way back is home. Else: -1 `positive_index`, -2 `negative_index`, -3
    `positive`, -4 `negative`.
    """

    def methods(self) -> dict[int, str]:
        """Return the meaning of methods -1 to -4: that of the specification, changed by the bench file."""
        from emulators.drive.cia402 import DriveConfig

        changes = {int(number): name for number, name in self.hard_stop_methods.items()}
        methods = {**DriveConfig().hard_stop_methods, **changes}
        return {number: name for number, name in methods.items() if name != "unsupported"}


class ProfidriveSafetyTable(Table):
    """`[drive.NAME.safety]`: safety functions of a PROFIdrive axis."""

    sto: Literal["inhibit", "fault"] = "inhibit"
    """Safe torque off leads to *Switch on disabled* with warning, or to fault FF80h."""
    ss1_time_ms: SafeTime_ms = 500.0
    """Safe stop 1: from the input to safe torque off."""
    ss1_monitored: bool = True
    """Its ramp is watched (FF81h), and safe torque off follows at standstill; false: by time only."""
    ss1_external: bool = False
    """Safe stop 1 leaves the braking to the controller (SS1E): safe torque off when its time has passed."""
    ss2_time_ms: SafeTime_ms = 500.0
    """Safe stop 2: from its selection to the monitoring of standstill, at the latest."""
    ss2_monitored: bool = True
    """Its ramp is watched as that of safe stop 1 is."""
    ss2_external: bool = False
    """Safe stop 2 leaves the braking to the controller (SS2E)."""
    sos_delay_ms: Time_ms = 100.0
    """Safe operating stop: from its selection to the monitoring."""
    sos_tolerance_mm: Positive = 1.0
    """Distance that the load may move at monitored standstill."""
    sls_limits_mm_s: Annotated[tuple[Positive, ...], Field(min_length=1, max_length=4)] = (250.0,)
    """Safely limited speed: limits of levels 1 to 4 (p9531), at the load."""
    sls_factor_percent: Annotated[float, Field(gt=0.0, le=100.0)] = 80.0
    """Share of the limit that S_V_LIMIT_B tells the controller (p9533)."""
    sls_delay_ms: Time_ms = 100.0
    """From the selection to the monitoring."""
    sls_reaction: Reaction = "ss1"
    """Stop above the limit."""
    sdi_tolerance_mm: Positive = 1.0
    """Safe direction: distance the other way that is tolerated."""
    sdi_delay_ms: Time_ms = 100.0
    """From the selection to the monitoring."""
    sdi_reaction: Reaction = "ss1"
    """Stop beyond it."""
    slp_ranges_mm: Annotated[tuple[tuple[Finite, Finite], ...], Field(max_length=2)] = ()
    """Safely limited position: lower and upper end of ranges 1 and 2 of the load."""
    slp_delay_ms: Time_ms = 100.0
    """From the selection to the monitoring."""
    slp_reaction: Reaction = "ss1"
    """Stop outside of the range."""
    sbt_torque_nm: NotNegative = 0.0
    """Safe brake test (S_STW3B of telegram 701): torque with which the drive pulls at the closed brake; 0 =
    not configured.
    """
    sbt_time_ms: SafeTime_ms = 500.0
    """How long it pulls."""
    sbt_tolerance_mm: Positive = 1.0
    """Distance that the load may move meanwhile."""
    sbc: bool = True
    """With safe torque off the brake closes whatever STW1 bit 12 says."""

    @model_validator(mode="after")
    def _builds(self) -> ProfidriveSafetyTable:
        if self.model_fields_set:
            self.build_motion()
        return self

    def build(self) -> SafetyConfig:
        """Return the configuration of what every drive has."""
        from emulators.drive.machine import SafetyConfig

        return SafetyConfig(sto=self.sto, ss1_time_ms=self.ss1_time_ms, ss1_monitored=self.ss1_monitored)

    def build_motion(self) -> SafeMotionConfig:
        """Return the configuration of the functions of a PROFIdrive axis."""
        from emulators.drive.profidrive.safety.config import SafeMotionConfig

        return SafeMotionConfig(
            ss1_external=self.ss1_external,
            ss2_time_s=self.ss2_time_ms / 1000.0,
            ss2_monitored=self.ss2_monitored,
            ss2_external=self.ss2_external,
            sos_delay_s=self.sos_delay_ms / 1000.0,
            sos_tolerance=self.sos_tolerance_mm / 1000.0,
            sls_limits=tuple(limit / 1000.0 for limit in self.sls_limits_mm_s),
            sls_factor=self.sls_factor_percent / 100.0,
            sls_delay_s=self.sls_delay_ms / 1000.0,
            sls_reaction=self.sls_reaction,
            sdi_tolerance=self.sdi_tolerance_mm / 1000.0,
            sdi_delay_s=self.sdi_delay_ms / 1000.0,
            sdi_reaction=self.sdi_reaction,
            slp_ranges=tuple((low / 1000.0, high / 1000.0) for low, high in self.slp_ranges_mm),
            slp_delay_s=self.slp_delay_ms / 1000.0,
            slp_reaction=self.slp_reaction,
            sbt_torque_Nm=self.sbt_torque_nm,
            sbt_time_s=self.sbt_time_ms / 1000.0,
            sbt_tolerance=self.sbt_tolerance_mm / 1000.0,
            sbc=self.sbc,
        )


class NoSecondEncoder(Table):
    """`[drive.NAME.encoder2]` with `type = "none"`: there is no second encoder."""

    label: ClassVar[str] = 'an encoder2 with type = "none"'

    type: Literal["none"] = "none"
    """`none`: not fitted."""

    def build(self, lead_mm: float) -> None:
        """Return None: there is no second encoder."""


class _SecondEncoderTable(Table):
    """What a second encoder at a PROFIdrive axis has, whatever it measures."""

    type: str
    """`none`: not fitted."""
    mounting: Literal["motor", "load"] = "load"
    """The motor shaft, or the load behind gear and screw; a linear encoder needs `load`."""
    fine_xist1_bits: FineBits | None = None
    """Fine resolution of G2_XIST1 (P979[13]); none: 11, or as many as fit."""
    fine_xist2_bits: FineBits | None = None
    """Fine resolution of G2_XIST2 (P979[14]); none: 9, or as many as fit."""
    zero_mark: Annotated[int, Field(ge=0), Unit("inc")] = 0
    """Place of the zero mark, increments of G2_XIST1."""
    gear_numerator: Annotated[int, Field(ge=1)] = 1
    """Revolutions of the encoder ..."""
    gear_denominator: Annotated[int, Field(ge=1)] = 1
    """... per so many revolutions of what it sits on."""
    reversed: bool = False
    """Mounted the other way round."""

    @model_validator(mode="after")
    def _builds(self) -> _SecondEncoderTable:
        self.build(10.0)
        return self

    @abstractmethod
    def form(self) -> EncoderFormat:
        """Return kind, resolution and formats of the values."""

    @abstractmethod
    def coupling(self, lead_mm: float) -> Coupling:
        """Return how it is coupled to the machine.

        Args:
            lead_mm: Lead of the screw, mm.

        """

    def build(self, lead_mm: float) -> SecondEncoderConfig:
        """Return the configuration of the emulated drive.

        Args:
            lead_mm: Lead of the screw, mm.

        Raises:
            ConfigurationError: Values do not fit together.

        """
        from emulators.drive.profidrive.second_encoder import SecondEncoderConfig

        coupling = self.coupling(lead_mm)
        return SecondEncoderConfig(
            form=self.form(),
            mounting=self.mounting,
            ratio=coupling.ratio,
            offset=coupling.offset,
            backlash=coupling.backlash,
            zero_mark=self.zero_mark,
        )

    @property
    def absolute(self) -> bool:
        """Whether it knows its place after switching on."""
        return not self.type.startswith("incremental")

    @property
    def _ratio(self) -> float:
        return gear_ratio(self.gear_numerator, self.gear_denominator, reversed_direction=self.reversed)

    def taken_over(self, prefix: str) -> dict[str, int | float]:
        """Return the variables that an axis takes over from the encoder, as an offline transfer does
        (CFG-356).
        """
        form = self.form()
        return {
            f"{prefix}.Type": int(form.absolute),
            f"{prefix}.Parameter.FineResolutionXist1": form.shift_xist1,
            f"{prefix}.Parameter.FineResolutionXist2": form.shift_xist2,
            f"{prefix}.System": int(not form.linear),
            f"{prefix}.MountingMode": 0 if self.mounting == "motor" else 1,
        }


class RotarySecondEncoder(_SecondEncoderTable):
    """`[drive.NAME.encoder2]`: a second encoder that turns."""

    label: ClassVar[str] = "a rotary encoder2"

    type: Literal["single_turn", "multi_turn", "incremental_rotary"]
    """`none`: not fitted."""
    steps_per_revolution: Annotated[int, Field(ge=4, le=2**31), Unit("steps/rev")] = 2048
    """Lines or steps (P979[12])."""
    revolutions: Annotated[int, Field(ge=1, le=65_535)] = 4096
    """Distinguishable revolutions of `multi_turn`."""
    mm_per_revolution: Positive | None = None
    """Travel of the load per revolution of a rotary encoder at the load; none: the lead of the screw."""
    offset_deg: Finite = 0.0
    """Place of a rotary encoder where the machine is at zero."""
    backlash_deg: NotNegative = 0.0
    """Play of the coupling of a rotary encoder."""

    def form(self) -> EncoderFormat:
        """Return kind, resolution and formats of the values."""
        turns = {"multi_turn": self.revolutions, "single_turn": 1}.get(self.type, 0)
        return encoder_format(
            self.steps_per_revolution,
            turns,
            fine_xist1=self.fine_xist1_bits,
            fine_xist2=self.fine_xist2_bits,
        )

    def coupling(self, lead_mm: float) -> Coupling:
        """Return how it is coupled to the machine.

        Args:
            lead_mm: Lead of the screw, mm.

        """
        at_load = self.mounting == "load"
        return rotary_coupling(
            self._ratio,
            offset_deg=self.offset_deg,
            backlash_deg=self.backlash_deg,
            mm_per_revolution=(self.mm_per_revolution or lead_mm) if at_load else None,
        )

    def taken_over(self, prefix: str) -> dict[str, int | float]:
        """Return the variables that an axis takes over from the encoder, as an offline transfer does
        (CFG-356).
        """
        return {
            **super().taken_over(prefix),
            f"{prefix}.Parameter.StepsPerRevolution": self.steps_per_revolution,
            f"{prefix}.Parameter.DeterminableRevolutions": self.form().revolutions,
        }


class LinearSecondEncoder(_SecondEncoderTable):
    """`[drive.NAME.encoder2]`: a second encoder that measures the load."""

    label: ClassVar[str] = "a linear encoder2"

    type: Literal["incremental_linear", "absolute_linear"]
    """`none`: not fitted."""
    measuring_step_um: Positive = 20.0
    """Distance of two lines of a scale; in steps of 0.001."""
    length_mm: Positive = 2000.0
    """Length of the scale."""
    offset_mm: Finite | None = None
    """Place on the scale where the machine is at zero; none: its middle."""
    backlash_mm: NotNegative = 0.0
    """Play of the coupling of a linear one."""

    def form(self) -> EncoderFormat:
        """Return kind, resolution and formats of the values."""
        periods, grid_nm = scale_periods(self.measuring_step_um, self.length_mm)
        return encoder_format(
            periods,
            1 if self.absolute else 0,
            grid_nm=grid_nm,
            fine_xist1=self.fine_xist1_bits,
            fine_xist2=self.fine_xist2_bits,
        )

    def coupling(self, lead_mm: float) -> Coupling:  # noqa: ARG002 - a scale measures the load itself
        """Return how it is coupled to the machine.

        Args:
            lead_mm: Lead of the screw, mm.

        """
        return linear_coupling(
            self._ratio,
            length_mm=self.length_mm,
            offset_mm=self.offset_mm,
            backlash_mm=self.backlash_mm,
        )

    def taken_over(self, prefix: str) -> dict[str, int | float]:
        """Return the variables that an axis takes over from the encoder, as an offline transfer does
        (CFG-356).
        """
        return {
            **super().taken_over(prefix),
            f"{prefix}.Parameter.Resolution": self.measuring_step_um / 1000.0,
        }


def _second_encoder(table: Any) -> Any:
    kind = table.get("type", "none") if isinstance(table, dict) else getattr(table, "type", None)
    if kind in ("none", None):
        return kind
    return "linear" if str(kind).endswith("_linear") else "rotary"


SecondEncoderTable = RotarySecondEncoder | LinearSecondEncoder
AnySecondEncoder = Annotated[
    Annotated[NoSecondEncoder, Tag("none")]
    | Annotated[RotarySecondEncoder, Tag("rotary")]
    | Annotated[LinearSecondEncoder, Tag("linear")],
    Discriminator(_second_encoder),
]
"""`[drive.NAME.encoder2]`, chosen by its key `type`."""


class ProfidriveTable(Table):
    """`[drive.NAME.profidrive]`: supplements, references and monitoring of a PROFIdrive axis."""

    torque_telegram: bool = False
    """Telegram 750 follows: additive torque, torque limits, actual torque."""
    safety_telegram: Literal[700, 701] | None = None
    """Telegram 700 or 701 follows: the safety information channel. On CAN a telegram with its supplements
    has at most 16 words.
    """
    reference_speed_rpm: Annotated[float, Field(ge=6.0, le=210_000.0)] = 3000.0
    """Speed that 4000h stands for (p2000)."""
    reference_torque_nm: Annotated[float, Field(ge=0.001, le=1_000_000.0)] = 2.0
    """Torque that 4000h stands for (p2003)."""
    fine_resolution_bits: Annotated[int, Field(ge=0, le=20)] = 11
    """Fine resolution of G1_XIST1 (p0418); `increments_per_revolution` are without it (P979[2])."""
    operating_mode: Literal[1, 3] = 3
    """PNU 930 of the emulated drive: 1 with ramp-function generator, 3 without."""
    ramp_up_s: Annotated[float, Field(ge=0.0, le=1000.0)] = 10.0
    """p1120 of the emulated drive, which acts in operating mode 1; 0 = at once."""
    interpolation: bool = True
    """The emulated drive reaches a setpoint of operating mode 3 linearly within the bus cycle; false: at
    once.
    """
    sign_of_life_tolerance: Annotated[int, Field(ge=0, le=65_535)] = 1
    """Failures of the sign of life that the emulated drive tolerates (PNU 925); 65535 = not monitored."""
    sign_of_life: bool | None = None
    """Whether drive and controller watch each other's counter; none: where the telegram has one, but not on
    live Modbus.
    """
    setpoint_monitoring_ms: Annotated[float, Field(ge=0.0, le=2_000_000.0)] = 100.0
    """The emulated drive trips with F01910 when no telegram comes for this long (p2040); 0 = never."""


class BlockTable(Table):
    """`[[drive.NAME.positioner.block]]`: a traversing block."""

    number: Annotated[int, Field(ge=0, le=63)]
    """Number of the block."""
    task: Literal[
        "absolute",
        "relative",
        "endless positive",
        "endless negative",
        "wait",
        "goto",
        "set output",
        "reset output",
    ] = "absolute"
    """What it does."""
    position: Position = 0
    """Target or way."""
    velocity: Velocity = 600.0
    """Velocity of a motion."""
    acceleration_percent: Annotated[float, Field(ge=1.0, le=100.0)] = 100.0
    """Of `max_acceleration`."""
    deceleration_percent: Annotated[float, Field(ge=1.0, le=100.0)] = 100.0
    """Of `max_deceleration`."""
    continuation: Literal["end", "continue with stop", "continue flying", "continue external"] = "end"
    """What follows: nothing, the next number at rest or in motion, or the next number with the edge of STW1
    bit 13.
    """
    parameter: int = 0
    """Ms of `wait`, block of `goto`, outputs as bits (1 to 3)."""


class PositionerTable(Table):
    """`[drive.NAME.positioner]`: lengths in LU, velocities in 1000 LU/min, accelerations in 1000 LU/s²."""

    lu_per_revolution: Length = 10_000.0
    """Length units per revolution of the motor (p2506); on a screw of 10 mm the default is 1 µm."""
    max_velocity: Velocity = 30_000.0
    """p2571."""
    max_acceleration: Acceleration = 1_000.0
    """p2572."""
    max_deceleration: Acceleration = 1_000.0
    """p2573; also that of a rejected task."""
    software_limits: tuple[Position, Position] = (-2_147_482_648, 2_147_482_647)
    """p2580, p2581."""
    software_limits_on: bool = False
    """They count without POS_STW2 bit 14 (p2582)."""
    limit_cams_on: bool = False
    """The limit switches stop the axis without POS_STW2 bit 15 (p2568)."""
    window: Length = 40.0
    """Positioning window (p2544)."""
    following_tolerance: Length = 1_000.0
    """Following error beyond which the drive trips with F07452 (p2546)."""
    clamping_torque_nm: Positive | None = None
    """Torque limit on the way to a fixed stop, while STW2 bit 8 is 1; none: that of the drive."""
    fixed_stop_tolerance: Length = 1_000.0
    """Following error from which on the stop counts as reached (p2634)."""
    modulo_range: Annotated[NotNegative, Unit("LU")] = 0.0
    """Range of a modulo axis (p2576); 0 = none."""
    jog_velocities: Annotated[tuple[float, float], Unit("1000 LU/min")] = (-300.0, 300.0)
    """Of jog 1 and 2 (p2585, p2586); the sign is the direction; not 0."""
    jog_increments: Annotated[tuple[int, int], Unit("LU")] = (1_000, 1_000)
    """p2587, p2588; 0 or more."""
    reference_position: Position = 0
    """p2599."""
    reference_offset: Position = 0
    """From the zero mark to the reference point (p2600)."""
    search_negative: bool = False
    """Homing looks in negative direction (p2604); POS_STW2 bit 9 turns that round."""
    has_cam: bool = True
    """Homing looks for the home switch first, then for the zero mark (p2607)."""
    cam_velocity: Velocity = 5_000.0
    """p2605."""
    mark_velocity: Velocity = 300.0
    """p2608."""
    approach_velocity: Velocity = 300.0
    """p2611."""
    max_cam_distance: Length = 2_147_482_647.0
    """Way within which homing has to find the cam, and its end (p2606)."""
    max_mark_distance: Length = 20_000.0
    """Way within which it has to find the zero mark (p2609)."""
    position_cams: tuple[Position, Position] = (0, 0)
    """p2547, p2548: POS_ZSW2 bits 8 and 9."""
    block: tuple[BlockTable, ...] = ()
    """Traversing blocks; see the next section."""

    @model_validator(mode="after")
    def _builds(self) -> PositionerTable:
        self.build()
        return self

    def build(self) -> PositionerSettings:
        """Return the settings of the emulated positioner."""
        from emulators.drive.profidrive.positioner.config import (
            BlockTask,
            Continuation,
            PositionerSettings,
            TraversingBlock,
        )

        blocks = tuple(
            (
                row.number,
                TraversingBlock(
                    task=BlockTask(row.task),
                    position=row.position,
                    velocity=row.velocity,
                    acceleration_percent=row.acceleration_percent,
                    deceleration_percent=row.deceleration_percent,
                    continuation=Continuation(row.continuation),
                    parameter=row.parameter,
                ),
            )
            for row in self.block
        )
        plain = self.model_dump(exclude={"block", "clamping_torque_nm"})
        clamping = math.inf if self.clamping_torque_nm is None else self.clamping_torque_nm
        return PositionerSettings(**plain, clamping_torque_Nm=clamping, blocks=blocks)


class AnalogTable(Table):
    """`[drive.NAME.analog]`: what a drive with an analog setpoint has."""

    reference_speed_rpm: Annotated[float, Field(ge=1.0, le=200_000.0)] = 3000.0
    """Speed at 10 V; up to 11.7 V count."""
    enable_input: bool = True
    """There is an enable input; without one the drive follows the voltage as long as it is on."""
    ready_delay_ms: Time_ms = 0.0
    """From the enable to the ready output."""
    stop: Literal["ramp", "coast"] = "ramp"
    """What the drive does when the enable is taken away."""
    ready_falls: Literal["enable", "standstill", "never"] = "enable"
    """When the ready output falls after that."""
    offset_v: Finite = 0.0
    """Voltage that its input sees too much."""
    dead_zone_v: NotNegative = 0.0
    """Voltages up to this count as none."""
    inverted: bool = False
    """A positive voltage turns in negative direction."""


class PtoTable(Table):
    """`[drive.NAME.tm_pto]`: pulse module and stepper motor."""

    variant: Literal["device", "standard"] = "device"
    """Telegram 3 with a setpoint of 16 bits, as the device has it, or of 32 bits."""
    signals: Literal["pulse_direction", "up_down", "ab", "ab_fourfold"] = "pulse_direction"
    """Form of the pulses."""
    reversal_pause_ms: Literal[0, 1, 4, 10] = 0
    """No pulses for this time at a change of direction."""
    reference_speed_rpm: Annotated[float, Field(ge=1.0, le=20_000.0)] = 3000.0
    """Speed that 4000h stands for."""
    use_ed: bool = True
    """Terminal ED enables the power stage; without current the motor is out of step."""
    use_dr: bool = True
    """Terminal DR tells that the power stage is ready."""
    use_rs: bool = False
    """Terminal RS is wired to the home switch."""
    use_mi: bool = False
    """Terminal MI is wired to probe1."""
    input_delay_ms: NotNegative = 0.1
    """Filter of the terminals."""
    strict_parking: bool = False
    """A parking request ends with error 3."""
    watchdog_cycles: Annotated[int, Field(ge=1, le=1000), Unit("cycles")] = 3
    """Bus cycles without a telegram after which the module stops."""
    full_steps: Annotated[int, Field(ge=4, le=10_000), Unit("steps/rev")] = 200
    """Full steps of the motor, a multiple of 4."""
    corner_hz: Positive = 2000.0
    """Full-step frequency above which the torque falls."""
    start_stop_hz: Positive = 500.0
    """Full-step frequency up to which a standing rotor is caught."""
    ready_delay_ms: Time_ms = 0.0
    """From ED to DR."""
