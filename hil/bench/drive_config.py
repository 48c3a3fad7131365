"""`[drive.NAME]` of a bench file: one model per profile, each of which builds its
drive and the controller's port.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal

from pydantic import (
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
    WrapValidator,
    field_validator,
    model_validator,
)

from emulators.drive.analog_config import AnalogConfig, AnalogSettings
from emulators.drive.homing_config import HomingConfig
from emulators.drive.keys import (
    BootKeys,
    Cia402Keys,
    EncoderKind,
    Increments,
    IndexIncrements,
    ModbusKeys,
    MountingIncrements,
    Off3Keys,
    PowerKeys,
    PullOutTorqueKeys,
    SpeedKeys,
    SpeedLoopKeys,
    TorqueKeys,
)
from emulators.drive.machine import BrakeConfig, EncoderConfig, LinearAxisConfig, SafetyConfig, SwitchesConfig
from emulators.drive.positioner_config import PositionerSettings
from emulators.drive.profidrive_settings import ProfidriveSettings
from emulators.drive.pto_settings import PtoSettings
from emulators.drive.safety_config import SafeMotionConfig
from emulators.drive.supply_config import SupplyConfig
from emulators.drive.thermal_config import ThermalConfig
from emulators.drive.tuning import ServoTuning
from emulators.drive.two_speed_config import CONTACTORS, INVERTER, TERMINALS, TwoSpeedConfig, TwoSpeedSettings
from fieldbus.errors import ConfigurationError
from fieldbus.node_clock import NodeClock
from fieldbus.profidrive.errors import TelegramError
from hil.bench._table import NodeId, Port, RampTime, Table, Word, refused_by_part
from hil.bench.drive_tables import (
    AnySecondEncoder,
    NoSecondEncoder,
    SecondEncoderTable,
)
from hil.bench.pdo_config import PdoTable
from hil.bench.segment_config import CanTable

if TYPE_CHECKING:
    import canopen

    from emulators.drive.analog import AnalogDrive
    from emulators.drive.cia402 import CiA402Drive, DriveConfig
    from emulators.drive.cia402.vendor_eds import VendorEds
    from emulators.drive.profidrive import ProfidriveCanDrive, ProfidriveConfig
    from emulators.drive.profidrive.modbus import ProfidriveModbusDrive
    from emulators.drive.stepper import StepperDriveConfig
    from emulators.drive.stepper_can import StepperCanDrive
    from emulators.drive.two_speed import TwoSpeedDrive
    from fieldbus.modbus import MapFile, ProcessDataRegisters
    from fieldbus.profidrive import Telegram
    from hil.bench._port_site import PortSite
    from hil.bench._site import DeviceSite
    from hil.bench.axis_config import AxisTable
    from hil.bench.bench_config import BenchTable
    from hil.bench.io_config import StationTable
    from hil.bench.segment_config import ModbusTable, RtuTable, SegmentTable, TcpTable
    from motion.drives.analog import AnalogPort
    from motion.drives.cia402 import Cia402Port
    from motion.drives.cia402_plan import Answers, DrivePlan
    from motion.drives.profidrive import TelegramConfig
    from motion.drives.profidrive_can import ProfidriveCanPort
    from motion.drives.profidrive_modbus import ProfidriveModbusPort
    from motion.drives.two_speed import TwoSpeedPort

SWITCHES: Final = ("negative_limit", "positive_limit", "home", "probe1", "probe2")
"""Terminals of every drive with a machine that a digital input of a station can be wired to."""
WITHOUT_SETPOINTS: Final = (7, 9, 20, 110, 111)
"""Telegrams without a speed setpoint for an axis."""
POSITIONING: Final = (7, 9, 110, 111)
"""Telegrams of the basic positioner."""
WITH_G2: Final = (4, 6, 103, 106)
"""Telegrams with a second encoder."""
_WITH_XERR: Final = (5, 6, 105, 106)
"""Telegrams with XERR and KPC."""
_PDO_LENGTH: Final = 16
"""Free process data words of a node in a direction."""
_MAX_TORQUE_PERMILLE: Final = 3000
"""6072h of an emulated CiA 402 drive without an EDS."""
_PEAK_TORQUE: Final = 3.0
"""Torque limit of an emulated PROFIdrive axis as a multiple of the rated torque."""
_AT_SIGNAL_OUTPUT: Final[Mapping[str, tuple[bool | float, bool | float]]] = {
    "FollowingError.EnableMonitoring": (False, True),
    "PositionLimits_HW.Active": (False, False),
    "Sensor[1].Backlash.Enable": (False, False),
    "PositionControl.Kpc": (100.0, 100.0),
    "DynamicAxisModel.VelocityTimeConstant": (0.0, 0.0),
}
"""Variables of an axis at an encoder-signal output: required value and default (CFG-413, CFG-414)."""
_HEAD_AND_TAIL: Final = {"write": (9, 8), "read": (8, 5), "exchange": (13, 5)}
"""Characters of request and response in addition to the registers, on a serial line (MODB-011)."""
_RECORD_BYTES: Final = 14
"""Registers of a request for one parameter, with the header of data record 47."""


class _DriveTable(Table, SpeedKeys, frozen=True):
    """What a drive of any profile has."""

    bus: ClassVar[Literal["can", "modbus", "station"]] = "can"
    """How the controller reaches it."""
    terminals: ClassVar[Mapping[str, Sequence[str]]] = {}
    """Terminals that can be wired to channels of a station, by the key of the channels."""

    profile: str
    """Profile of the drive; [I/O stations, analog drives and pulse modules](io.md) describes the last three.
    """
    device: Literal["emulated", "physical"] = "emulated"
    """`physical`: it is on the bus, the bench does not bring it; live benches only."""
    segment: str
    """Name of the segment at which the drive is connected."""
    optional: bool = False
    """The bench is ready without this drive; the drive is taken in when it comes,
    and its axis can be used then.
    """
    increments_per_revolution: Increments = EncoderConfig.counts_per_revolution

    @property
    def second_encoder(self) -> SecondEncoderTable | None:
        """Second encoder of the drive; None: there is none."""
        return None

    @property
    def machine(self) -> LinearAxisConfig | None:
        """What the drive moves; None: nothing."""
        return None

    @property
    def encoder_value(self) -> bool:
        """Whether a positioning axis gets its position from the drive."""
        return True

    @property
    def interfaces(self) -> tuple[str, ...]:
        """What an axis of an NC may give to the drive."""
        return ("velocity",)

    @property
    def reference_speed_rpm(self) -> float:
        """Speed of a setpoint of 100 %, rpm."""
        return self.max_speed_rpm

    @property
    def reference_torque_nm(self) -> float:
        """Torque of a setpoint of 100 %, Nm."""
        return 2.0

    @property
    def fine_resolution_bits(self) -> int:
        """Bits of the actual position on top of `increments_per_revolution`."""
        return 0

    def taken_over(self) -> dict[str, float]:
        """Return the variables that an axis takes over from the drive, as an
        offline transfer does (CFG-356).
        """
        return {
            "Actor.DriveParameter.ReferenceSpeed": self.reference_speed_rpm,
            "Actor.DriveParameter.ReferenceTorque": self.reference_torque_nm,
        }

    def check_bench(self, where: str, bench: BenchTable) -> None:
        """Check the drive against `[bench]`.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """

    def check_segment(self, where: str, segment: SegmentTable) -> None:
        """Check that the drive can be connected to a segment.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        if segment.on_modbus:
            raise ValueError(
                f'{where}.profile: "{self.profile}" is not spoken on {self.segment!r}, which is of kind = '
                f'"{segment.kind}"; allowed: profile = "profidrive"'
            )

    def check_axis(self, where: str, axis: AxisTable) -> None:
        """Check the axis that the drive moves.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        if axis.connection == "data_block":
            raise ValueError(
                f"{where}.connection: 'data_block' holds a telegram; profile of {axis.drive!r} is "
                f"{self.profile}"
            )
        if axis.variables.get("PositionControl.EnableDSC"):
            self._refuse_dsc(where)

    def _refuse_dsc(self, where: str) -> None:
        raise ValueError(
            f"{where}.variables: PositionControl.EnableDSC needs a drive with XERR and KPC: "
            'profile = "profidrive" with telegram 5, 6, 105 or 106'
        )


class _NodeTable(_DriveTable, BootKeys, frozen=True):
    """What a drive on CANopen has."""

    node_id: NodeId
    """CANopen node-ID, each once per segment; 127 is the controller."""
    heartbeat_ms: Annotated[int, Field(ge=0, le=60000)] = 100
    """Heartbeat of drive and controller; 0 = none."""
    consumer_heartbeat_ms: Annotated[int, Field(ge=1, le=65535)] = 250
    """After this time either side reports the heartbeat of the other as lost."""
    guard_time_ms: Annotated[int, Field(ge=0, le=65535)] = 0
    """Period of node guarding, for a drive without heartbeat (`heartbeat_ms = 0`); 0 = none."""
    life_time_factor: Annotated[int, Field(ge=1, le=255)] = 3
    """Guard times without an answer, or a question, after which either side reports the other as lost."""
    commission: bool = False
    """Whether the controller may set a physical drive up at every start: PDOs and parameters. Otherwise it
    writes nothing into it, compares, and the bench does not start if something differs; `hil commission`
    shows what that is, and sets the drive up once with `--write`. An emulated drive is always set up.
    """
    vendor_id: Word | None = None
    """Expected 1018h:1; without the key any is accepted. Likewise the next three."""
    product_code: Word | None = None
    """Expected 1018h:2."""
    revision: Word | None = None
    """Expected 1018h:3."""
    serial: Word | None = None
    """Expected 1018h:4."""

    @model_validator(mode="after")
    def _one_watch(self) -> _NodeTable:
        if self.guard_time_ms and self.heartbeat_ms:
            raise ValueError(
                f"guard_time_ms: {self.guard_time_ms} needs heartbeat_ms = 0; a node has one of the two"
            )
        return self

    def port_arguments(self, bench: BenchTable) -> dict[str, Any]:
        """Return what every port to a drive on CANopen is made of."""
        return {
            "cycle_ns": bench.cycle_ns,
            "absolute_encoder": False,
            "grace_cycles": bench.grace_cycles,
            "optional": self.optional,
            "node_id": self.node_id,
            "heartbeat_ms": self.heartbeat_ms,
            "consumer_heartbeat_ms": self.consumer_heartbeat_ms,
            "guard_time_ms": self.guard_time_ms,
            "life_time_factor": self.life_time_factor,
            "vendor_id": self.vendor_id,
            "product_code": self.product_code,
            "revision": self.revision,
            "serial": self.serial,
            "store": self.device == "emulated",
            "commission": self.commission or self.device == "emulated",
        }


class _StoringNodeTable(_NodeTable, frozen=True):
    """What a drive on CANopen has that can store its parameters."""

    storage: str | None = None
    """File in which the emulated drive keeps its stored parameters (1010h, LSS) from one run to the next,
    relative to the bench file.
    """
    store_parameters: bool | None = None
    """Whether the controller has the drive keep its parameters (1010h:1); without the key an emulated drive
    does, and a physical one is left alone. A drive that keeps nothing is configured again whenever it
    comes back.
    """

    def port_arguments(self, bench: BenchTable) -> dict[str, Any]:
        """Return what every port to a drive on CANopen is made of."""
        arguments = super().port_arguments(bench)
        if self.store_parameters is not None:
            arguments["store"] = self.store_parameters
        return arguments

    @property
    def storage_path(self) -> Path | None:
        """File of the stored parameters."""
        return None if self.storage is None else Path(self.storage)


class _ServoTable(_DriveTable, TorqueKeys, Off3Keys, SpeedLoopKeys, frozen=True):
    """What a servo drive of any profile has: motor, encoder, machine, brake and speed loop."""

    terminals: ClassVar[Mapping[str, Sequence[str]]] = {"digital_inputs": SWITCHES, "counters": ("encoder",)}

    encoder: EncoderKind = EncoderConfig.kind
    index_increments: IndexIncrements = EncoderConfig.zero_mark_counts
    mounting_increments: MountingIncrements = EncoderConfig.mounting_counts
    mechanics: LinearAxisConfig = LinearAxisConfig()
    switches: SwitchesConfig = SwitchesConfig()
    brake: BrakeConfig = BrakeConfig()

    @model_validator(mode="after")
    def _index_within_revolution(self) -> _ServoTable:
        if self.index_increments >= self.increments_per_revolution:
            raise ValueError(
                f"index_increments: {self.index_increments} is not below increments_per_revolution = "
                f"{self.increments_per_revolution}"
            )
        if self.mounting_increments and self.encoder == "incremental":
            raise ValueError(
                f'mounting_increments: {self.mounting_increments} needs encoder = "absolute"; an incremental '
                "one counts from zero at power-on"
            )
        return self

    @property
    def machine(self) -> LinearAxisConfig:
        """What the drive moves."""
        return self.mechanics

    @property
    def reference_torque_nm(self) -> float:
        """Torque of a setpoint of 100 %, Nm."""
        return self.rated_torque_nm

    def check_bench(self, where: str, bench: BenchTable) -> None:
        """Check the drive against `[bench]`.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        if self.velocity_time_constant_ms * 1000.0 < 3 * bench.servo_period_us:
            raise ValueError(
                f"{where}.velocity_time_constant_ms: {self.velocity_time_constant_ms:g} is less than three "
                "servo "
                f"periods ({3 * bench.servo_period_us / 1000:g} ms)"
            )

    def servo_parts(self) -> dict[str, Any]:
        """Return what an emulated servo drive of any profile is built of."""
        return {
            "tuning": ServoTuning(
                velocity_time_constant_ms=self.velocity_time_constant_ms,
                velocity_integral_time_s=self.velocity_time_constant_ms / 100.0,
                torque_precontrol=self.torque_precontrol,
            ),
            "mechanics": self.mechanics,
            "switches": self.switches,
            "encoder": EncoderConfig(
                kind=self.encoder,
                counts_per_revolution=self.increments_per_revolution,
                zero_mark_counts=self.index_increments,
                mounting_counts=self.mounting_increments,
            ),
            "brake": self.brake,
            "rated_torque_nm": self.rated_torque_nm,
        }


class _PoweredServoTable(_ServoTable, PowerKeys, frozen=True):
    """What a servo drive on a bus has: power stage with DC link and protection."""

    off1_ramp_s: RampTime = 1.0
    """From maximum speed to zero with OFF1 (p1121, 6084h); at a CiA 402 drive the slope has to fit into
    6084h.
    """
    supply: SupplyConfig = SupplyConfig()
    thermal: ThermalConfig = ThermalConfig()

    def powered_parts(self) -> dict[str, Any]:
        """Return what an emulated servo drive on a bus is built of."""
        return {
            **self.servo_parts(),
            "supply": self.supply,
            "thermal": self.thermal,
            "power_on_delay_ms": self.power_on_delay_ms,
            "blocked_time_ms": self.blocked_time_ms,
        }


class Cia402DriveTable(_PoweredServoTable, _StoringNodeTable, Cia402Keys, frozen=True):
    """`[drive.NAME]` with `profile = "cia402"`: a servo drive with the profile CiA 402."""

    label: ClassVar[str] = 'a drive with profile = "cia402"'

    profile: Literal["cia402"] = "cia402"
    personality: str = "standard"
    """How the emulated drive differs from the profile: a name of `hil personalities`, or a file `*.toml`,
    relative to the bench file.
    """
    eds: str | None = None
    """EDS or DCF that the emulated drive presents on the bus, relative to the bench
    file; none: that of the product.
    """
    mode: Literal["auto", "csv", "csp", "ip", "pv"] = "auto"
    """Mode in which the controller moves a drive with an EDS; `auto`: the first of csv, csp, ip and pv that
    6502h has and the PDOs can carry. Without an EDS it is csv.
    """
    pdo: PdoTable = PdoTable()
    homing: HomingConfig = HomingConfig()
    cyclic_timer_ms: Annotated[int, Field(ge=0, le=65535)] = 0
    """Default of the event timers of TPDO1 and TPDO2 (1800h:5, 1801h:5): how often they come at least, unless
    SYNC triggers them; 0: only when something changes.
    """
    safety: SafetyConfig = SafetyConfig()

    @model_validator(mode="after")
    def _as_the_eds_says(self) -> Cia402DriveTable:
        """Take what the bench file does not say from the EDS; the keys stay unwritten."""
        vendor = self._vendor_eds()
        if vendor is not None:
            for key, value in vendor.bench_keys():
                if key not in self.model_fields_set:
                    self.__dict__[key] = value
            vendor.objects(self._of_vendor(), frozenset(self.model_fields_set))  # checks limits
        if self.pdo.mapped:
            self._check_mapping()
        return self

    def _check_mapping(self) -> None:
        """Check that the wanted mapping goes with one of the interfaces of an axis.

        Raises:
            ConfigurationError: Why it does not go with a velocity.

        """
        first: ConfigurationError | None = None
        for interface in self.interfaces:
            try:
                self.plan(interface)
            except ConfigurationError as error:
                first = first or error
            else:
                return
        if first is not None:
            raise first

    @property
    def interfaces(self) -> tuple[str, ...]:
        """What an axis of an NC may give to the drive."""
        return ("velocity", "position", "torque")

    @property
    def torque_limit_nm(self) -> float:
        """Greatest torque of the emulated drive by its limits (6072h, 6073h) and the rated torque, Nm."""
        vendor = self._vendor_eds()
        permille = None if vendor is None else vendor.max_torque_permille
        rated_nm = self.rated_torque_nm
        if vendor is not None and "rated_torque_nm" not in self.model_fields_set:
            rated_nm = vendor.rated_torque_nm or rated_nm
        return rated_nm * (_MAX_TORQUE_PERMILLE if permille is None else permille) / 1000.0

    def _vendor_eds(self) -> VendorEds | None:
        """Return the EDS; None without one, or if it cannot be read, which building the drive says."""
        from emulators.drive.cia402.vendor_eds import VendorEds

        if self.eds is None:
            return None
        try:
            return VendorEds(self.eds, increments_per_revolution=self.increments_per_revolution)
        except ConfigurationError:
            return None

    def _of_vendor(self, cycle_ms: int = 1) -> dict[str, float]:
        """Return the keys that an EDS may say."""
        return {
            "cycle_ms": cycle_ms,
            "max_speed_rpm": self.max_speed_rpm,
            "off1_ramp_s": self.off1_ramp_s,
            "off3_ramp_s": self.off3_ramp_s,
            "rated_torque_nm": self.rated_torque_nm,
            "increments_per_revolution": self.increments_per_revolution,
        }

    @field_validator("personality")
    @classmethod
    def _known_personality(cls, value: str, info: ValidationInfo) -> str:
        from emulators.drive.cia402.personality import load_personality

        if value == "standard":
            return value
        if value.endswith(".toml"):
            value = str((((info.context or {}).get("folder") or Path()) / value).resolve())
        load_personality(value)
        return value

    @model_validator(mode="after")
    def _slopes_fit(self) -> Cia402DriveTable:
        fastest = self.max_speed_rpm * 1000.0 / 0xFFFFFFFF
        for key, ramp_s in (("off1_ramp_s", self.off1_ramp_s), ("off3_ramp_s", self.off3_ramp_s)):
            if ramp_s < fastest:
                raise ValueError(
                    f"{key}: {ramp_s:g} s from {self.max_speed_rpm:g} rpm is steeper than 6084h and 6085h "
                    "can "
                    f"say (10^-3 rpm/s, 32 bits); at least {fastest:.3g} s"
                )
        return self

    def config(self, bench: BenchTable) -> DriveConfig:
        """Return the configuration of the emulated drive."""
        from emulators.drive.cia402 import DriveConfig
        from emulators.drive.cia402.personality import load_personality

        vendor = self._vendor_eds()
        timer = self.cyclic_timer_ms
        drive = DriveConfig(
            node_id=self.node_id,
            servo_period_ns=bench.servo_period_ns,
            control_period_ns=bench.control_period_ns,
            **self.powered_parts(),
            safety=self.safety,
            homing=self.homing,
            following_error=self.following_error,
            csv_interpolation=self.csv_interpolation,
            boot_time_ms=self.boot_time_ms,
            # The axis watches the limit switches; a drive that stopped by itself would fight its ramp.
            limit_switch_reaction="none",
            sync_loss=self.sync_loss,
            sync_jitter_percent=self.sync_jitter_percent,
            missing_setpoints=self.missing_setpoints,
            eds=None if self.eds is None else Path(self.eds),
            storage=self.storage_path,
            objects={
                **(
                    self._objects(bench)
                    if vendor is None
                    else vendor.objects(self._of_vendor(bench.cycle_ms), frozenset(self.model_fields_set))
                ),
                **({(0x1800, 5): timer, (0x1801, 5): timer} if timer else {}),
            },
        )
        if vendor is not None and vendor.rated_current_A is not None:
            drive = replace(drive, rated_current_A=vendor.rated_current_A)
        return load_personality(self.personality).apply(drive)

    def _objects(self, bench: BenchTable) -> dict[tuple[int, int], int]:
        """Return the defaults of the drive of the product.

        Velocities are in 10^-3 rpm (60A9h); so are the defaults, for controllers that leave them as they are.
        """
        speed = round(self.max_speed_rpm * 1000)
        return {
            (0x607F, 0): speed,
            (0x6080, 0): round(self.max_speed_rpm),
            (0x60A9, 0): 0xFDB44700,
            (0x6081, 0): speed // 3,
            (0x6083, 0): round(speed / self.off1_ramp_s),
            (0x6084, 0): round(speed / self.off1_ramp_s),
            (0x6085, 0): round(speed / self.off3_ramp_s),
            (0x6099, 1): speed // 15,
            (0x6099, 2): speed // 150,
            (0x609A, 0): round(speed / self.off1_ramp_s),
            (0x60C2, 1): bench.cycle_ms,
            (0x60C2, 2): -3,
            (0x60C5, 0): 60_000_000,
            (0x60C6, 0): 60_000_000,
            (0x6092, 1): self.increments_per_revolution,
            (0x6092, 2): 1,
        }

    def build(self, site: DeviceSite) -> CiA402Drive:
        """Return the emulated drive, still switched off."""
        from emulators.drive.cia402 import CiA402Drive

        return CiA402Drive(
            _own_clock(site),
            site.segments[self.segment],
            self.config(site.bench),
            name=site.name,
            history=site.history,
            rng=site.rng,
        )

    def plan(self, interface: str = "velocity", answers: Answers | None = None) -> DrivePlan:
        """Return how the controller uses the drive.

        Args:
            interface: What its axis gives to it: `velocity`, `position`, `torque`.
            answers: What the drive has shown on the bus; None: nothing yet.

        Raises:
            ConfigurationError: The EDS cannot be read, or allows no mode that the controller can command; or
                the wanted mapping is not possible.

        """
        from emulators.drive.cia402.vendor_eds import VendorEds
        from motion.drives.cia402_plan import FOLLOWING_ERROR, STANDARD, plan_drive

        by_velocity = interface == "velocity"
        if self._vendor_eds() is None and answers is None and not self.pdo.mapped and by_velocity:
            return STANDARD
        vendor = VendorEds(
            self.eds or servo_eds(),
            increments_per_revolution=self.increments_per_revolution,
            shown=answers.values if answers is not None else None,
        )
        entries = vendor.entries(self.node_id)
        if answers is not None:
            answers.apply(entries)
        return plan_drive(
            entries,
            node_id=self.node_id,
            mode=self.mode if by_velocity else {"position": "csp", "torque": "cst"}[interface],
            velocity_unit_rpm=vendor.velocity_unit_rpm,
            increments_per_unit=vendor.increments_per_unit,
            mapped=self.pdo.mapped,
            also=(FOLLOWING_ERROR,) if interface == "position" else (),
        )

    def dictionary(self) -> canopen.ObjectDictionary:
        """Return the object dictionary of the drive, shared and read-only."""
        from fieldbus.canopen.eds import shared_dictionary

        return shared_dictionary(servo_eds() if self.eds is None else self.eds, node_id=1)

    def build_port(self, site: PortSite) -> Cia402Port:
        """Return the controller's port to the drive."""
        from motion.drives.cia402 import Cia402Port, Cia402PortConfig

        arguments = {**self.port_arguments(site.bench), "absolute_encoder": self.encoder == "absolute"}
        plan = self.plan(site.interface)
        config = Cia402PortConfig(
            rated_torque_nm=self.rated_torque_nm,
            increments_per_revolution=self.increments_per_revolution,
            off1_deceleration_rpm_s=self.max_speed_rpm / self.off1_ramp_s,
            off3_deceleration_rpm_s=self.max_speed_rpm / self.off3_ramp_s,
            plan=plan,
            plan_again=partial(self.plan, site.interface),
            **arguments,
        )
        return Cia402Port(site.masters[self.segment], config, name=site.name, history=site.history)


class _ProfidriveTable(_PoweredServoTable, frozen=True):
    """What a PROFIdrive axis on any bus has."""

    profile: Literal["profidrive"]
    telegram: Literal[1, 2, 3, 4, 5, 6, 7, 9, 20, 102, 103, 105, 106, 110, 111] = 3
    """Telegram of the drive; a positioning axis needs one with encoder value, from 3 on; 7, 9, 20, 110 and
    111 are for drives without an axis, which a test leads (`bench.telegram()`).
    """
    safety: SafeMotionConfig = SafeMotionConfig()
    encoder2: AnySecondEncoder = NoSecondEncoder()
    profidrive: ProfidriveSettings = ProfidriveSettings()
    positioner: PositionerSettings | None = None

    @property
    def interfaces(self) -> tuple[str, ...]:
        """What an axis of an NC may give to the drive."""
        return ("velocity", "position") if self.telegram in {5, 6, 105, 106} else ("velocity",)

    @property
    def fine_resolution_bits(self) -> int:
        """Bits of the actual position on top of `increments_per_revolution`."""
        return self.profidrive.fine_resolution_bits

    @model_validator(mode="after")
    def _telegram_fits(self) -> _ProfidriveTable:
        if self.profidrive.sign_of_life and self.telegram in (1, 7, 20):
            raise ValueError(f"profidrive.sign_of_life: telegram {self.telegram} has none; allowed: false")
        if self.positioner is not None and not self.positions:
            raise ValueError(
                f"positioner: telegram {self.telegram} leads the speed; a positioner goes with 7, 9, 110 "
                "and 111"
            )
        try:
            self.named_telegram()
        except TelegramError as error:
            raise ValueError(f"profidrive: {error}") from None
        bits = self.profidrive.fine_resolution_bits
        if self.increments_per_revolution << bits > 1 << 31:
            raise ValueError(
                f"increments_per_revolution: {self.increments_per_revolution} with {bits} bits of fine "
                "resolution "
                f"exceed the 32 bits of G1_XIST1; at most {(1 << 31) >> bits}"
            )
        if self.encoder == "absolute" and self.increments_per_revolution > 1 << 20:
            raise ValueError(
                f"increments_per_revolution: {self.increments_per_revolution} times 4096 revolutions exceed "
                "the "
                f"32 bits of G1_XIST2; at most {1 << 20}"
            )
        return self

    @property
    def positions(self) -> bool:
        """Whether the telegram is one of the positioner."""
        return self.telegram in POSITIONING

    @property
    def second_encoder(self) -> SecondEncoderTable | None:
        """Second encoder of the drive; None: there is none."""
        return None if isinstance(self.encoder2, NoSecondEncoder) else self.encoder2

    @property
    def encoder_value(self) -> bool:
        """Whether a positioning axis gets its position from the drive."""
        return self.telegram not in (1, 2)

    @property
    def reference_speed_rpm(self) -> float:
        """Speed of a setpoint of 100 %, rpm."""
        return self.profidrive.reference_speed_rpm

    @property
    def reference_torque_nm(self) -> float:
        """Torque of a setpoint of 100 %, Nm."""
        return self.profidrive.reference_torque_nm

    @property
    def torque_limit_nm(self) -> float:
        """p1520 and -p1521 of the emulated drive, Nm; MOMRED takes a share of them away (PD-037)."""
        return _PEAK_TORQUE * self.rated_torque_nm

    def counts_life(self, *, live: bool) -> bool:  # noqa: ARG002 - of a drive on Modbus
        """Return whether drive and controller watch each other's sign of life.

        Args:
            live: The bench is live.

        """
        if self.profidrive.sign_of_life is not None:
            return self.profidrive.sign_of_life
        return self.telegram not in (1, *WITHOUT_SETPOINTS)

    def named_telegram(self) -> tuple[Telegram, str]:
        """Return the telegram with its supplements, and its name."""
        from fieldbus.profidrive import telegram

        chosen = telegram(self.telegram)
        names = [str(self.telegram)]
        if self.profidrive.torque_telegram:
            chosen, names = chosen.with_supplement(), [*names, "750"]
        if self.profidrive.safety_telegram is not None:
            chosen = chosen.with_supplement(self.profidrive.safety_telegram)
            names.append(str(self.profidrive.safety_telegram))
        return chosen, " with ".join(names)

    def check_axis(self, where: str, axis: AxisTable) -> None:
        """Check the axis that the drive moves.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        if self.telegram in WITHOUT_SETPOINTS:
            raise ValueError(
                f"{where}.drive: telegram {self.telegram} of {axis.drive!r} has no setpoints for an axis"
            )
        if axis.variables.get("PositionControl.EnableDSC") and self.telegram not in _WITH_XERR:
            self._refuse_dsc(where)

    def config(self, bench: BenchTable) -> ProfidriveConfig:
        """Return the configuration of the emulated drive, without its bus."""
        from emulators.drive.profidrive import DriveSettings, ProfidriveConfig
        from emulators.drive.profidrive.config import finest_xist2

        own = self.profidrive
        parts = self.powered_parts()
        if self.positioner is not None:
            parts["positioner"] = self.positioner
        return ProfidriveConfig(
            telegram=self.telegram,
            torque_telegram=own.torque_telegram,
            safety_telegram=own.safety_telegram,
            safety=self.safety,
            encoder2=self.second_encoder,
            cycle_ns=bench.cycle_ns,
            servo_period_ns=bench.servo_period_ns,
            control_period_ns=bench.control_period_ns,
            settings=DriveSettings(
                operating_mode=2 if self.positions else own.operating_mode,
                reference_speed_rpm=own.reference_speed_rpm,
                reference_torque_nm=own.reference_torque_nm,
                max_speed_rpm=self.max_speed_rpm,
                ramp_up_s=own.ramp_up_s,
                ramp_down_s=self.off1_ramp_s,
                quick_stop_s=self.off3_ramp_s,
                torque_limits_Nm=(self.torque_limit_nm, self.torque_limit_nm),
                sign_of_life_tolerance=own.sign_of_life_tolerance,
                setpoint_monitoring_ms=own.setpoint_monitoring_ms,
            ),
            fine_resolution_bits=own.fine_resolution_bits,
            fine_xist2=finest_xist2(parts["encoder"]),
            interpolation=own.interpolation,
            isochronous=self.counts_life(live=bench.live),
            **parts,
        )

    def _telegram_config(self, bench: BenchTable) -> TelegramConfig:
        from motion.drives.profidrive import TelegramConfig

        own = self.profidrive
        return TelegramConfig(
            telegram=self.telegram,
            torque_telegram=own.torque_telegram,
            safety_telegram=own.safety_telegram,
            reference_speed_rpm=own.reference_speed_rpm,
            reference_torque_nm=own.reference_torque_nm,
            sign_of_life=self.counts_life(live=bench.live),
            isochronous=self.bus == "can",
        )


class ProfidriveCanTable(_ProfidriveTable, _StoringNodeTable, frozen=True):
    """`[drive.NAME]` with `profile = "profidrive"` and a `node_id`: a PROFIdrive axis on CAN."""

    label: ClassVar[str] = 'a drive with profile = "profidrive" and node_id (on CAN)'

    @model_validator(mode="after")
    def _fits_into_pdos(self) -> ProfidriveCanTable:
        telegram, name = self.named_telegram()
        count = telegram.actual.words
        if count > _PDO_LENGTH:
            raise ValueError(
                f"telegram: {name} has {count} words; at most {_PDO_LENGTH} on CAN (5810h to 581Fh)"
            )
        if count > 12 and self.node_id > 0x5F:
            raise ValueError(f"node_id: {self.node_id} with telegram {name}; at most 95")
        return self

    def check_segment(self, where: str, segment: SegmentTable) -> None:
        """Check that the drive can be connected to a segment.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        if segment.on_modbus:
            raise ValueError(
                f'{where}.node_id: a drive on a segment of kind = "{segment.kind}" has none; it has a `unit`'
            )

    def build(self, site: DeviceSite) -> ProfidriveCanDrive:
        """Return the emulated drive, still switched off."""
        from emulators.drive.profidrive import ProfidriveCanDrive, ProfidriveNodeConfig

        node = ProfidriveNodeConfig(
            node_id=self.node_id,
            drive=self.config(site.bench),
            boot_time_ms=self.boot_time_ms,
            storage=self.storage_path,
        )
        return ProfidriveCanDrive(
            _own_clock(site),
            site.segments[self.segment],
            node,
            name=site.name,
            history=site.history,
            rng=site.rng,
        )

    def dictionary(self) -> canopen.ObjectDictionary:
        """Return the object dictionary of the drive, shared and read-only."""
        return _profidrive_dictionary()

    def build_port(self, site: PortSite) -> ProfidriveCanPort:
        """Return the controller's port to the drive."""
        from motion.drives.profidrive_can import ProfidriveCanConfig, ProfidriveCanPort

        arguments = {**self.port_arguments(site.bench), "absolute_encoder": self.encoder == "absolute"}
        config = ProfidriveCanConfig(words=self._telegram_config(site.bench), **arguments)
        return ProfidriveCanPort(site.masters[self.segment], config, name=site.name, history=site.history)


class ProfidriveModbusTable(_ProfidriveTable, ModbusKeys, BootKeys, frozen=True):
    """`[drive.NAME]` with `profile = "profidrive"` and no `node_id`: a PROFIdrive axis on Modbus."""

    label: ClassVar[str] = 'a drive with profile = "profidrive" without node_id (on Modbus)'
    bus: ClassVar[Literal["can", "modbus", "station"]] = "modbus"

    host: str | None = None
    """Host of this drive on a live network; none: as the segment says."""
    port: Port | None = None
    """TCP port of this drive on a live network; none: that of the segment."""

    def counts_life(self, *, live: bool) -> bool:
        """Return whether drive and controller watch each other's sign of life.

        Over Modbus the counters keep step only in virtual time: on a live bench nothing keeps both sides to
        one clock.

        Args:
            live: The bench is live.

        """
        if self.profidrive.sign_of_life is None and live:
            return False
        return super().counts_life(live=live)

    def check_segment(self, where: str, segment: SegmentTable) -> None:
        """Check that the drive can be connected to a segment.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        if isinstance(segment, CanTable):
            raise ValueError(  # noqa: TRY004 - it becomes a message about the file
                f"{where}.node_id: the key is missing; {self.segment!r} is a CAN segment"
            )
        units = segment.units
        if self.unit not in units:
            raise ValueError(f"{where}.unit: {self.unit} is not allowed; allowed: {units[0]}..{units[-1]}")
        try:
            self.registers()
        except ConfigurationError as error:
            raise ValueError(f"{where}.map: {error}") from None

    def check_axis(self, where: str, axis: AxisTable) -> None:
        """Check the axis that the drive moves.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        super().check_axis(where, axis)
        if axis.variables.get("PositionControl.EnableDSC"):
            raise ValueError(
                f"{where}.variables: PositionControl.EnableDSC needs the clock of the bus (PD-198), and "
                f"{axis.drive!r} is on Modbus, which has none"
            )
        if axis.variables.get("PositionLimits_HW.Active") and self.registers().inputs is None:
            raise ValueError(
                f"{where}.variables: PositionLimits_HW.Active needs the limit switches, and the map of "
                f"{axis.drive!r} ({self.map}) shows no digital inputs (r0722)"
            )

    def map_file(self) -> MapFile:
        """Return the register map."""
        from fieldbus.modbus import load_map

        return load_map(self.map)

    def registers(self) -> ProcessDataRegisters:
        """Return the requests for the telegram.

        Raises:
            ConfigurationError: The map cannot be used, or does not carry the telegram.

        """
        from fieldbus.modbus import process_data

        telegram, name = self.named_telegram()
        return process_data(self.map_file(), telegram, name=f"telegram {name}")

    def address(self, segment: TcpTable) -> tuple[str, int]:
        """Return host and port on a live network."""
        return self.host or segment.host, segment.port if self.port is None else self.port

    def combines(self, segment: ModbusTable) -> bool:
        """Return whether one request writes and reads: on a serial line, where the map allows it, because it
        takes less time.
        """
        return segment.kind == "modbus_rtu" and self.registers().combined

    def cycle_time_ns(self, line: RtuTable) -> int:
        """Return for how long drive and controller keep a serial line busy in one bus cycle, ns."""
        registers = self.registers()
        out, back = 2 * registers.words_out, 2 * registers.words_in
        parts = [("exchange", out, back)] if self.combines(line) else [("write", out, 0), ("read", 0, back)]
        # One more request per cycle: inputs, the number of a fault, or a part of an access to a parameter.
        more = [("read", 0, 2)] if registers.fault_number is not None else []
        more += [("read", 0, 2 * registers.inputs[1])] if registers.inputs is not None else []
        more += [("write", _RECORD_BYTES, 0)] if registers.parameters is not None else []
        if more:
            parts.append(max(more, key=lambda part: sum(_HEAD_AND_TAIL[part[0]]) + part[1] + part[2]))
        form = line.serial_format()
        characters = sum(sum(_HEAD_AND_TAIL[kind]) + asked + answered for kind, asked, answered in parts)
        pauses = len(parts) * (2 * form.t35_ns + round(self.processing_ms * 1e6))
        return form.duration_ns(characters) + pauses

    def build(self, site: DeviceSite) -> ProfidriveModbusDrive:
        """Return the emulated drive, still switched off and on no bus."""
        from emulators.drive.profidrive.modbus import ProfidriveModbusDrive
        from emulators.drive.profidrive.modbus_config import ProfidriveModbusConfig

        config = ProfidriveModbusConfig(
            unit=max(self.unit, 1),  # over TCP it answers every unit
            map=self.map,
            drive=self.config(site.bench),
            setpoint_monitoring_ms=self.profidrive.setpoint_monitoring_ms,
            processing_ms=self.processing_ms,
            boot_time_ms=self.boot_time_ms,
        )
        return ProfidriveModbusDrive(
            _own_clock(site), config, name=site.name, history=site.history, rng=site.rng
        )

    def build_port(self, site: PortSite) -> ProfidriveModbusPort:
        """Return the controller's port to the drive."""
        from motion.drives.profidrive_modbus import ProfidriveModbusConfig, ProfidriveModbusPort

        segment = site.modbus[self.segment]
        config = ProfidriveModbusConfig(
            cycle_ns=site.bench.cycle_ns,
            absolute_encoder=self.encoder == "absolute",
            grace_cycles=site.bench.grace_cycles,
            optional=self.optional,
            unit=self.unit,
            registers=self.registers(),
            words=self._telegram_config(site.bench),
            monitoring_ms=round(self.profidrive.setpoint_monitoring_ms),
            combined=self.combines(segment.table),
            request_ns=segment.request_ns(),
        )
        port = ProfidriveModbusPort(
            site.scheduler, segment.client(site.name), config, name=site.name, history=site.history
        )
        segment.watch(port)
        return port


class AnalogDriveTable(_ServoTable, frozen=True):
    """`[drive.NAME]` with `profile = "analog"`: a drive with an analog setpoint, wired to an I/O station."""

    label: ClassVar[str] = 'a drive with profile = "analog"'
    bus: ClassVar[Literal["can", "modbus", "station"]] = "station"
    terminals: ClassVar[Mapping[str, Sequence[str]]] = {
        "digital_inputs": (*SWITCHES, "ready"),
        "digital_outputs": ("enable",),
        "analog_outputs": ("setpoint",),
        "counters": ("encoder",),
    }

    profile: Literal["analog"]
    encoder: Literal["incremental"] = "incremental"
    """Its increments go to a counter of the station."""
    analog: AnalogSettings = AnalogSettings()

    @property
    def reference_speed_rpm(self) -> float:
        """Speed of a setpoint of 100 %, rpm."""
        return self.analog.reference_speed_rpm

    def check_bench(self, where: str, bench: BenchTable) -> None:
        """Check the drive against `[bench]`.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        super().check_bench(where, bench)
        if self.device == "physical":
            raise ValueError(
                f'{where}.device: "physical" is not for an analog drive, whose station is emulated'
            )

    def check_segment(self, where: str, segment: SegmentTable) -> None:
        """Its station is on the bus."""

    def station(self, name: str, stations: Mapping[str, StationTable]) -> str | None:
        """Return the name of the station that the setpoint of the drive `name`
        comes from; None: there is none.
        """
        for place, station in stations.items():
            if f"{name}.setpoint" in station.analog_outputs:
                return place
        return None

    def wired_variables(self, name: str, stations: Mapping[str, StationTable]) -> dict[str, bool | int]:
        """Return the variables of an axis that follow from the wires of its drive."""
        station = stations[self.station(name, stations) or ""]
        return {
            "Actor.Type": 0,
            "Actor.Interface.EnableDriveOutput": station.wire("digital_outputs", f"{name}.enable")
            is not None,
            "Actor.Interface.DriveReadyInput": station.wire("digital_inputs", f"{name}.ready") is not None,
        }

    def config(self, bench: BenchTable) -> AnalogConfig:
        """Return the configuration of the emulated drive."""
        return AnalogConfig(
            **self.servo_parts(),
            servo_period_ns=bench.servo_period_ns,
            analog=self.analog,
            max_speed_rpm=self.max_speed_rpm,
            off3_ramp_s=self.off3_ramp_s,
        )

    def build(self, site: DeviceSite) -> AnalogDrive:
        """Return the emulated drive, still switched off."""
        from emulators.drive.analog import AnalogDrive

        return AnalogDrive(
            _own_clock(site), self.config(site.bench), name=site.name, history=site.history, rng=site.rng
        )

    def build_port(self, site: PortSite) -> AnalogPort:
        """Return the controller's port to the drive, by the wires of its station."""
        from motion.drives.analog import AnalogPort, AnalogPortConfig

        name = site.name
        place = self.station(name, site.stations) or ""
        station = site.stations[place]
        enable = station.wire("digital_outputs", f"{name}.enable")
        ready = station.wire("digital_inputs", f"{name}.ready")
        config = AnalogPortConfig(
            cycle_ns=site.bench.cycle_ns,
            grace_cycles=site.bench.grace_cycles,
            optional=self.optional,
            reference_speed_rpm=float(
                site.variables.get("Actor.DriveParameter.ReferenceSpeed", self.analog.reference_speed_rpm)
            ),
            setpoint=station.analog_outputs.index(f"{name}.setpoint"),
            enable=enable if site.variables.get("Actor.Interface.EnableDriveOutput", True) else None,
            ready=ready if site.variables.get("Actor.Interface.DriveReadyInput", True) else None,
            counter=station.wire("counters", f"{name}.encoder"),
        )
        return AnalogPort(site.links[place], config, name=name, history=site.history)


class _PulseTable(_NodeTable, frozen=True):
    """What both kinds of pulse modules have."""

    @abstractmethod
    def stepper_config(self, servo_period_ns: int) -> StepperDriveConfig:
        """Return module, motor and machine.

        Raises:
            ConfigurationError: The values do not fit together.

        """

    @model_validator(mode="after")
    def _module_fits(self) -> _PulseTable:
        self.stepper_config(250_000)
        return self

    def build(self, site: DeviceSite) -> StepperCanDrive:
        """Return the emulated module with its motor, still switched off."""
        from emulators.drive.stepper_can import StepperCanDrive
        from emulators.drive.stepper_can_config import StepperNodeConfig

        node = StepperNodeConfig(
            node_id=self.node_id,
            drive=self.stepper_config(site.bench.servo_period_ns),
            cycle_ns=site.bench.cycle_ns,
            boot_time_ms=self.boot_time_ms,
        )
        return StepperCanDrive(
            _own_clock(site), site.segments[self.segment], node, name=site.name, history=site.history
        )

    def dictionary(self) -> canopen.ObjectDictionary:
        """Return the object dictionary of the module, shared and read-only."""
        return _profidrive_dictionary()

    def build_port(self, site: PortSite) -> ProfidriveCanPort:
        """Return the controller's port to the module."""
        from motion.drives.profidrive_can import ProfidriveCanConfig
        from motion.drives.tm_pto import pto_words, pulse_module_port

        words = pto_words(variant=self.telegram_variant, reference_speed_rpm=self.reference_speed_rpm)
        config = ProfidriveCanConfig(words=words, **self.port_arguments(site.bench))
        return pulse_module_port(site.masters[self.segment], config, name=site.name, history=site.history)

    @property
    def telegram_variant(self) -> Literal["device", "standard"]:
        """Telegram 3 with a setpoint of 16 bits, or the standard one with 32 bits."""
        return "standard"


class PulseDriveTable(_PulseTable, PullOutTorqueKeys, frozen=True):
    """`[drive.NAME]` with `profile = "tm_pto"`: a pulse module with a stepper motor."""

    label: ClassVar[str] = 'a drive with profile = "tm_pto"'
    terminals: ClassVar[Mapping[str, Sequence[str]]] = {"digital_inputs": SWITCHES}

    profile: Literal["tm_pto"]
    off1_ramp_s: RampTime = 1.0
    """Ramp stop time of the module, which also limits every other change of the speed."""
    off3_ramp_s: RampTime = 0.5
    """Quick stop time of the module."""
    mechanics: LinearAxisConfig = LinearAxisConfig()
    switches: SwitchesConfig = SwitchesConfig()
    tm_pto: PtoSettings = PtoSettings()

    @model_validator(mode="after")
    def _no_play(self) -> PulseDriveTable:
        if self.mechanics.backlash_mm:
            raise ValueError(
                f"mechanics.backlash_mm: {self.mechanics.backlash_mm:g} is not allowed; allowed: 0, a "
                "stepper "
                "motor moves its load without play"
            )
        return self

    @property
    def machine(self) -> LinearAxisConfig:
        """What the drive moves."""
        return self.mechanics

    @property
    def reference_speed_rpm(self) -> float:
        """Speed of a setpoint of 100 %, rpm."""
        return self.tm_pto.reference_speed_rpm

    @property
    def reference_torque_nm(self) -> float:
        """Torque of a setpoint of 100 %, Nm."""
        return self.rated_torque_nm

    @property
    def telegram_variant(self) -> Literal["device", "standard"]:
        """Telegram 3 with a setpoint of 16 bits, or the standard one with 32 bits."""
        return self.tm_pto.variant

    def stepper_config(self, servo_period_ns: int) -> StepperDriveConfig:
        """Return module, motor and machine.

        Raises:
            ConfigurationError: The values do not fit together.

        """
        from emulators.drive.stepper import StepperDriveConfig
        from emulators.io.tm_pto import PtoConfig

        channel = PtoConfig(
            settings=self.tm_pto,
            increments=self.increments_per_revolution,
            maximum_speed=self.max_speed_rpm,
            ramp_stop_ms=max(1, round(self.off1_ramp_s * 1000.0)),
            quick_stop_ms=max(1, round(self.off3_ramp_s * 1000.0)),
        )
        return StepperDriveConfig(
            channel=channel,
            mechanics=self.mechanics,
            switches=self.switches,
            rated_torque_nm=self.rated_torque_nm,
            servo_period_ns=servo_period_ns,
        )


class SignalOutputTable(_PulseTable, frozen=True):
    """`[drive.NAME]` with `profile = "tm41"`: an encoder-signal output."""

    label: ClassVar[str] = 'a drive with profile = "tm41"'
    terminals: ClassVar[Mapping[str, Sequence[str]]] = {"counters": ("encoder",)}

    profile: Literal["tm41"]

    def check_axis(self, where: str, axis: AxisTable) -> None:
        """Check the axis that the drive moves.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        super().check_axis(where, axis)
        for path, (needed, usual) in _AT_SIGNAL_OUTPUT.items():
            if axis.variables.get(path, usual) != needed:
                raise ValueError(
                    f"{where}.variables: {path} has to be {str(needed).lower()} at an encoder-signal output "
                    f"({axis.drive!r}, CFG-413, CFG-414)"
                )

    def stepper_config(self, servo_period_ns: int) -> StepperDriveConfig:
        """Return the module, which has no motor and no machine.

        Raises:
            ConfigurationError: The tracks cannot carry so many edges.

        """
        from emulators.drive.stepper import signal_output_config

        return signal_output_config(
            self.increments_per_revolution, self.max_speed_rpm, servo_period_ns=servo_period_ns
        )


def servo_eds() -> str:
    """Return the path of the EDS of the emulated servo drive."""
    from importlib.resources import files

    return str(files("emulators.drive.cia402") / "servo.eds")


def _profidrive_dictionary() -> canopen.ObjectDictionary:
    from emulators.drive.profidrive import EDS

    return EDS.dictionary()


def _own_clock(site: DeviceSite) -> NodeClock:
    return NodeClock(site.scheduler, lambda: site.rng.spawn(1)[0])


def _choice(table: Any) -> Any:
    """Return the tag of the model: the profile, and whether a PROFIdrive axis has a CANopen node."""
    if isinstance(table, _DriveTable):
        on_can = isinstance(table, ProfidriveCanTable)
        profile: Any = table.profile
    elif isinstance(table, dict):
        profile, on_can = table.get("profile", "cia402"), "node_id" in table
    else:
        return None
    return f"profidrive on {'CAN' if on_can else 'Modbus'}" if profile == "profidrive" else profile


class TwoSpeedDriveTable(_ServoTable, frozen=True):
    """`[drive.NAME]` with `profile = "two_speed"`: a motor with two speeds, wired to an I/O station."""

    label: ClassVar[str] = 'a drive with profile = "two_speed"'
    bus: ClassVar[Literal["can", "modbus", "station"]] = "station"
    terminals: ClassVar[Mapping[str, Sequence[str]]] = {
        "digital_inputs": SWITCHES,
        "digital_outputs": tuple(dict.fromkeys((*CONTACTORS, *INVERTER))),
        "counters": ("encoder",),
    }

    profile: Literal["two_speed"]
    encoder: Literal["incremental"] = "incremental"
    """Its increments go to a counter of the station."""
    two_speed: TwoSpeedSettings = TwoSpeedSettings()

    @property
    def reference_speed_rpm(self) -> float:
        """Fast speed, rpm."""
        return self.two_speed.fast_rpm

    @property
    def interfaces(self) -> tuple[str, ...]:
        """What an axis of an NC may give to the drive."""
        return ("velocity",)

    def check_bench(self, where: str, bench: BenchTable) -> None:
        """Check the drive against `[bench]`.

        Raises:
            ValueError: With the place, the value and what is allowed.

        """
        super().check_bench(where, bench)
        if bench.live:
            raise ValueError(
                f'{where}.profile: "two_speed" is emulated on virtual benches; set bench.kind = "virtual"'
            )

    def check_segment(self, where: str, segment: SegmentTable) -> None:
        """Its station is on the bus."""

    def check_axis(self, where: str, axis: AxisTable) -> None:
        """Refuse a technology object: it needs a drive that takes speeds.

        Raises:
            ValueError: Always.

        """
        raise ValueError(
            f'{where}.drive: {axis.drive!r} has two speeds; an axis with controller = "nc" moves it'
        )

    def station(self, name: str, stations: Mapping[str, StationTable]) -> str | None:
        """Return the name of the station that switches the drive `name`; None: there is none."""
        wanted = {f"{name}.{terminal}" for terminal in TERMINALS[self.two_speed.control]}
        return next((place for place, one in stations.items() if wanted <= set(one.digital_outputs)), None)

    def check_wires(self, where: str, name: str, stations: Mapping[str, StationTable]) -> None:
        """Check that every terminal is wired to one station.

        Raises:
            ValueError: With what is missing.

        """
        place = self.station(name, stations)
        if place is None:
            wanted = ", ".join(f'"{name}.{one}"' for one in TERMINALS[self.two_speed.control])
            raise ValueError(f"{where}: no station has all of its terminals as digital_outputs: {wanted}")
        if f"{name}.encoder" not in stations[place].counters:
            raise ValueError(
                f'{where}: its encoder is missing at station.{place}: counters = ["{name}.encoder"]'
            )

    def config(self, bench: BenchTable) -> TwoSpeedConfig:
        """Return the configuration of the emulated drive."""
        parts = self.servo_parts()
        del parts["brake"]
        return TwoSpeedConfig(
            **parts,
            servo_period_ns=bench.servo_period_ns,
            two_speed=self.two_speed,
            max_speed_rpm=self.max_speed_rpm,
        )

    def build(self, site: DeviceSite) -> TwoSpeedDrive:
        """Return the emulated drive, still switched off."""
        from emulators.drive.two_speed import TwoSpeedDrive

        return TwoSpeedDrive(
            _own_clock(site), self.config(site.bench), name=site.name, history=site.history, rng=site.rng
        )

    def build_port(self, site: PortSite) -> TwoSpeedPort:
        """Return the controller's port to the drive, by the wires of its station."""
        from motion.drives.two_speed import TwoSpeedPort, TwoSpeedPortConfig

        name = site.name
        place = self.station(name, site.stations) or ""
        station = site.stations[place]
        config = TwoSpeedPortConfig(
            cycle_ns=site.bench.cycle_ns,
            grace_cycles=site.bench.grace_cycles,
            optional=self.optional,
            outputs={
                terminal: station.digital_outputs.index(f"{name}.{terminal}")
                for terminal in TERMINALS[self.two_speed.control]
            },
            counter=station.wire("counters", f"{name}.encoder"),
        )
        return TwoSpeedPort(site.links[place], config, name=name, history=site.history)


DriveTable = (
    Cia402DriveTable
    | ProfidriveCanTable
    | ProfidriveModbusTable
    | AnalogDriveTable
    | TwoSpeedDriveTable
    | PulseDriveTable
    | SignalOutputTable
)
CanDriveTable = Cia402DriveTable | ProfidriveCanTable | PulseDriveTable | SignalOutputTable
WITH_SWITCHES: Final = (
    Cia402DriveTable,
    ProfidriveCanTable,
    ProfidriveModbusTable,
    AnalogDriveTable,
    TwoSpeedDriveTable,
    PulseDriveTable,
)
"""Drives with a machine and switches on its travel."""
WITH_RAMPS: Final = (Cia402DriveTable, ProfidriveCanTable, ProfidriveModbusTable, PulseDriveTable)
"""Drives with a ramp for OFF1 and one for OFF3."""
AnyDrive = Annotated[
    Annotated[Cia402DriveTable, Tag("cia402")]
    | Annotated[ProfidriveCanTable, Tag("profidrive on CAN")]
    | Annotated[ProfidriveModbusTable, Tag("profidrive on Modbus")]
    | Annotated[AnalogDriveTable, Tag("analog")]
    | Annotated[TwoSpeedDriveTable, Tag("two_speed")]
    | Annotated[PulseDriveTable, Tag("tm_pto")]
    | Annotated[SignalOutputTable, Tag("tm41")],
    Discriminator(_choice),
    WrapValidator(refused_by_part),
]
"""`[drive.NAME]`, chosen by its key `profile`."""
