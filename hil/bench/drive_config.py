"""`[drive.NAME]` of a bench file with its machine: its model and its checks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field, ValidationInfo, field_validator, model_validator

from hil.bench._drive_sections import (
    CIA402_KEYS,
    BrakeSection,
    Finite,
    NotNegative,
    Positive,
    ProfidriveSection,
    RampTime,
    Section,
    SupplySection,
    ThermalSection,
    Time_ms,
    Word,
    checked_personality,
)
from hil.bench._positioner_section import PositionerSection
from hil.bench._profidrive_encoder import Encoder2Section
from hil.bench._safety_section import SafetySection
from hil.bench.io_config import AnalogSection, PtoSection, check_drive_keys

if TYPE_CHECKING:
    from fieldbus.profidrive import Telegram

_WORDS: Final = 16
"""Free process data words of a node in a direction."""


class SwitchSection(Section):
    """`[drive.NAME.switches]`: switches on the travel, mm at the load."""

    negative_limit_mm: Finite | None = -550.0
    positive_limit_mm: Finite | None = 550.0
    limit_width_mm: Positive | None = None
    """Way on which a limit switch stays actuated; None: as far as the load can travel."""
    normally_closed: bool = False
    """The limit switches open when they are actuated, so that a broken wire looks like an actuated switch."""
    home_mm: Finite | None = -500.0
    """The home switch is active below this position; not together with the two following keys."""
    home_from_mm: Finite | None = None
    """The home switch is active from here to `home_to_mm`; without the other key up to the end of the travel.
    """
    home_to_mm: Finite | None = None
    probe1_from_mm: Finite | None = None
    """The load actuates touch probe 1 from here to `probe1_to_mm`; without the other key up to the end of the
    travel.
    """
    probe1_to_mm: Finite | None = None
    probe2_from_mm: Finite | None = None
    probe2_to_mm: Finite | None = None
    hysteresis_mm: NotNegative = 0.5
    input_filter_ms: NotNegative = 0.0
    """A limit or home switch counts when it has been stable for this long, ms."""

    @model_validator(mode="after")
    def _ranges(self) -> SwitchSection:
        for name in ("home", "probe1", "probe2"):
            low, high = getattr(self, f"{name}_from_mm"), getattr(self, f"{name}_to_mm")
            if low is not None and high is not None and not low < high:
                raise ValueError(f"{name}_from_mm: {low:g} is not below {name}_to_mm: {high:g}")
        if self.differs("home_mm") and (self.home_from_mm is not None or self.home_to_mm is not None):
            raise ValueError("home_mm goes without home_from_mm and home_to_mm")
        return self


class HomingSection(Section):
    """`[drive.NAME.homing]`: what manufacturers of drives do differently."""

    offset: Literal["profile", "vendor"] = "profile"
    """6064h at the home position is -607Ch (`profile`) or +607Ch (`vendor`)."""
    move: Literal["none", "zero"] = "none"
    """Whether the drive moves to position zero when it has found home."""
    hard_stop_methods: dict[
        str, Literal["positive", "negative", "positive_index", "negative_index", "unsupported"]
    ] = {}
    """What methods -1 to -4 do where they differ: side of the stop, and whether the index on the way back
    counts.
    """

    @model_validator(mode="after")
    def _numbers(self) -> HomingSection:
        for number in self.hard_stop_methods:
            if number not in {"-1", "-2", "-3", "-4"}:
                raise ValueError(f"hard_stop_methods: {number!r} is not a method; allowed: -1, -2, -3, -4")
        return self


class MechanicsSection(Section):
    """`[drive.NAME.mechanics]`: what the emulated drive moves."""

    lead_screw_mm: Positive = 10.0
    """Travel per revolution of the screw, mm."""
    gear_numerator: Annotated[int, Field(ge=1)] = 1
    """Motor revolutions of the load gear."""
    gear_denominator: Annotated[int, Field(ge=1)] = 1
    """Load revolutions of the load gear."""
    load_mass_kg: NotNegative = 40.0
    motor_inertia_kgm2: Positive = 2.0e-4
    screw_inertia_kgm2: NotNegative = 0.5e-4
    viscous_friction_n_per_m_s: NotNegative = 30.0
    coulomb_friction_n: NotNegative = 30.0
    static_friction_n: NotNegative | None = None
    """Breakaway force at standstill; None = as the sliding friction."""
    gravity_n: Finite = 0.0
    """Constant force on the load in positive direction, N; a hanging load has a negative one."""
    backlash_mm: NotNegative = 0.0
    """Play between nut and slide, from one side to the other, mm."""
    negative_stop_mm: Finite | None = -600.0
    positive_stop_mm: Finite | None = 600.0
    start_position_mm: Finite = 0.0

    @model_validator(mode="after")
    def _friction(self) -> MechanicsSection:
        if self.static_friction_n is not None and self.static_friction_n < self.coulomb_friction_n:
            raise ValueError(
                f"static_friction_n: {self.static_friction_n:g} is less than coulomb_friction_n = "
                f"{self.coulomb_friction_n:g}"
            )
        return self


class DriveSection(Section):
    """`[drive.NAME]`: a drive."""

    profile: Literal["cia402", "profidrive", "analog", "tm_pto", "tm41"] = "cia402"
    telegram: Literal[1, 2, 3, 4, 5, 6, 7, 9, 20, 102, 103, 105, 106, 110, 111] = 3
    """Telegram of a PROFIdrive drive; 7, 9, 20, 110 and 111 are for drives without an axis."""
    device: Literal["emulated", "physical"] = "emulated"
    """`emulated`: this bench brings it; `physical`: it is on the bus (or brought by somebody else)."""
    segment: str
    node_id: Annotated[int, Field(ge=0, le=126)] = 0
    """CANopen node; 0 = not on CAN."""
    unit: Annotated[int, Field(ge=0, le=255)] = 1
    """Address on Modbus."""
    map: str = "sinamics_g120"
    """Register map on Modbus: the name of a shipped one, or a file `*.toml` beside the bench file."""
    host: str | None = None
    """Host of this drive on a live network; None = that of the segment."""
    port: Annotated[int, Field(ge=0, le=65535)] | None = None
    """TCP port of this drive on a live network; None = that of the segment."""
    processing_ms: Annotated[float, Field(ge=0.0, le=10_000.0)] = 1.0
    """On Modbus: from a request to its response in the emulated drive, ms (p2024[0])."""
    personality: str = "standard"
    """How the emulated drive differs from the profile: a name of `hil personalities`, or a file `*.toml`
    beside the bench file.
    """
    encoder: Literal["incremental", "absolute"] = "incremental"
    increments_per_revolution: Annotated[int, Field(ge=4, le=2**24)] = 131072
    index_increments: Annotated[int, Field(ge=0)] = 0
    """Place of the index (zero mark) within the revolution, increments."""
    max_speed_rpm: Annotated[float, Field(ge=1.0, le=200_000.0)] = 3000.0
    off1_ramp_s: RampTime = 1.0
    """Ramp-down time from maximum speed on OFF1 (p1121), s."""
    off3_ramp_s: RampTime = 0.5
    """Ramp-down time from maximum speed on OFF3 (p1135), s."""
    rated_torque_nm: Annotated[float, Field(ge=0.001, le=1_000_000.0)] = 2.0
    velocity_time_constant_ms: Annotated[float, Field(gt=0.0, le=1000.0)] = 2.0
    """Time constant of the emulated drive's closed speed loop, ms; at least three servo periods."""
    torque_precontrol: bool = True
    """Whether the emulated drive pre-controls the torque of its inertia; without, its speed loop is a
    first-order lag.
    """
    sync_loss: Literal["fault", "warning", "none"] = "fault"
    """What the emulated drive does when SYNC stays away."""
    sync_jitter_percent: Annotated[float, Field(ge=0.0, le=50.0)] = 0.0
    """Deviation of SYNC from the bus cycle from which on the emulated drive does the same; 0 = not watched.
    """
    missing_setpoints: Annotated[int, Field(ge=0, le=1000)] = 2
    """Cycles without a setpoint after which the emulated drive reacts as to a lost connection (6007h); 0 =
    never.
    """
    following_error: Literal["fault", "status"] = "fault"
    """What the emulated drive does when the window of 6065h is exceeded in its own position modes."""
    csv_interpolation: bool = True
    """Whether the emulated drive reaches a csv set-point linearly within the cycle, or at once."""
    power_on_delay_ms: Time_ms = 0.0
    """Time of transition 3 in the emulated drive, ms."""
    boot_time_ms: Time_ms = 0.0
    """From power-on of the emulated drive to its boot-up frame, ms."""
    blocked_time_ms: Annotated[float, Field(ge=0.0, le=60_000.0)] = 0.0
    """Torque limit at standstill for this long is fault 7121h of the emulated drive, ms; 0 = not watched."""
    eds: str | None = None
    """EDS or DCF file of the emulated drive, relative to the bench file; None = that of the product."""
    storage: str | None = None
    """File of the emulated drive's stored parameters, relative to the bench file; None = no file."""
    heartbeat_ms: Annotated[int, Field(ge=0, le=60000)] = 100
    consumer_heartbeat_ms: Annotated[int, Field(ge=1, le=65535)] = 250
    guard_time_ms: Annotated[int, Field(ge=0, le=65535)] = 0
    """Period of node guarding, ms, for a drive without heartbeat; 0 = none."""
    life_time_factor: Annotated[int, Field(ge=1, le=255)] = 3
    vendor_id: Word | None = None
    """Expected identity (1018h:1 to 4); None = any."""
    product_code: Word | None = None
    revision: Word | None = None
    serial: Word | None = None
    optional: bool = False
    """The bench is ready without this drive."""
    store_parameters: bool | None = None
    """Whether the controller has the drive keep its parameters (1010h); None: an emulated one, no physical
    one.
    """
    mechanics: MechanicsSection = MechanicsSection()
    switches: SwitchSection = SwitchSection()
    homing: HomingSection = HomingSection()
    brake: BrakeSection = BrakeSection()
    supply: SupplySection = SupplySection()
    thermal: ThermalSection = ThermalSection()
    safety: SafetySection = SafetySection()
    encoder2: Encoder2Section = Encoder2Section()
    profidrive: ProfidriveSection = ProfidriveSection()
    positioner: PositionerSection = PositionerSection()
    analog: AnalogSection = AnalogSection()
    tm_pto: PtoSection = PtoSection()

    @field_validator("personality")
    @classmethod
    def _personality(cls, value: str, info: ValidationInfo) -> str:
        if value == "standard":
            return value
        return checked_personality(value, (info.context or {}).get("folder"))

    @model_validator(mode="after")
    def _profile(self) -> DriveSection:
        check_drive_keys(self)
        if self.profile in ("analog", "tm_pto", "tm41"):
            return self
        if self.profile == "cia402":
            for key in ("telegram", "profidrive", "encoder2", "positioner"):
                if self.differs(key):
                    raise ValueError(
                        f'{key}: a drive with profile = "cia402" has none; set profile = "profidrive"'
                    )
            beyond = self.safety.beyond
            if beyond is not None:
                raise ValueError(
                    f'safety.{beyond}: a drive with profile = "cia402" has none; set profile = "profidrive"'
                )
            return self
        for key in CIA402_KEYS:
            if self.differs(key):
                raise ValueError(f'{key}: a drive with profile = "profidrive" has none')
        if self.safety.interlock != "none":
            raise ValueError(
                "safety.interlock: an interlock is not fitted to a PROFIdrive axis; allowed: none"
            )
        if self.profidrive.sign_of_life and self.telegram in (1, 7, 20):
            raise ValueError(f"profidrive.sign_of_life: telegram {self.telegram} has none; allowed: false")
        if self.differs("positioner") and not self.positions:
            raise ValueError(
                f"positioner: telegram {self.telegram} leads the speed; a positioner goes with 7, 9, 110 "
                f"and 111"
            )
        bits = self.profidrive.fine_resolution_bits
        if self.increments_per_revolution << bits > 1 << 31:
            raise ValueError(
                f"increments_per_revolution: {self.increments_per_revolution} with {bits} bits of fine "
                f"resolution exceed the "
                f"32 bits of G1_XIST1; at most {(1 << 31) >> bits}"
            )
        if self.encoder == "absolute" and self.increments_per_revolution > 1 << 20:
            raise ValueError(
                f"increments_per_revolution: {self.increments_per_revolution} times 4096 revolutions exceed "
                f"the 32 bits of "
                f"G1_XIST2; at most {1 << 20}"
            )
        return self

    @property
    def positions(self) -> bool:
        """Whether the telegram is one of the positioner."""
        return self.telegram in (7, 9, 110, 111)

    def words(self) -> tuple[Telegram, str]:
        """Return the telegram with its supplements, and its name."""
        from fieldbus.profidrive import telegram

        words = telegram(self.telegram)
        names = [str(self.telegram)]
        if self.profidrive.torque_telegram:
            words, names = words.with_supplement(), [*names, "750"]
        if self.profidrive.safety_telegram is not None:
            words = words.with_supplement(self.profidrive.safety_telegram)
            names.append(str(self.profidrive.safety_telegram))
        return words, " with ".join(names)

    def check_on_can(self) -> None:
        """Check that the telegram of a PROFIdrive axis finds place on PDOs.

        Raises:
            ValueError: With key, value and what is allowed.

        """
        words, name = self.words()
        count = words.actual.words
        if count > _WORDS:
            raise ValueError(f"telegram: {name} has {count} words; at most {_WORDS} on CAN (5810h to 581Fh)")
        if count > 12 and self.node_id > 0x5F:
            raise ValueError(f"node_id: {self.node_id} with telegram {name}; at most 95")

    @model_validator(mode="after")
    def _slopes(self) -> DriveSection:
        if self.profile != "cia402":
            return self
        for key in ("off1_ramp_s", "off3_ramp_s"):
            fastest = self.max_speed_rpm * 1000.0 / 0xFFFFFFFF
            if getattr(self, key) < fastest:
                raise ValueError(
                    f"{key}: {getattr(self, key):g} s from {self.max_speed_rpm:g} rpm is steeper than 6084h "
                    f"and 6085h can "
                    f"say (10^-3 rpm/s, 32 bits); at least {fastest:.3g} s"
                )
        return self

    @model_validator(mode="after")
    def _index(self) -> DriveSection:
        if self.index_increments >= self.increments_per_revolution:
            raise ValueError(
                f"index_increments: {self.index_increments} is not below increments_per_revolution = "
                f"{self.increments_per_revolution}"
            )
        return self
