"""Configuration of an emulated CiA 402 drive with its machine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Literal

from emulators.checked_fields import check_fields
from emulators.drive.cia402.faults.rules import COASTING_FAULTS
from emulators.drive.cia402.quirks import EmcyCode, Quirks
from emulators.drive.core import ServoTuning
from emulators.drive.homing_config import HomingConfig
from emulators.drive.keys import BootKeys, Cia402Keys, PowerKeys, TorqueKeys
from emulators.drive.machine import (
    BrakeConfig,
    EncoderConfig,
    LinearAxisConfig,
    RotaryAxisConfig,
    SafetyConfig,
    SwitchesConfig,
    check_number,
)
from emulators.drive.supply_config import SupplyConfig
from emulators.drive.thermal_config import ThermalConfig
from fieldbus.clock import MS, US
from fieldbus.errors import ConfigurationError

_SWITCHES: Final = SwitchesConfig()


@dataclass(frozen=True, kw_only=True)
class DriveConfig(TorqueKeys, PowerKeys, BootKeys, Cia402Keys):
    """An emulated drive.

    Args:
        node_id: CANopen node-ID, 1..127.
        servo_period_ns: Servo step, ns; a divisor of `control_period_ns`.
        control_period_ns: Cycle of modes, monitoring and status word, ns (C402-173).
        mechanics: The machine.
        switches: Switches on the travel of a linear axis.
        encoder: The motor encoder.
        brake: The holding brake.
        tuning: Gains of the cascade.
        rated_current_A: What 1000 permille of 6078h are, A.
        supply: DC link and mains.
        thermal: Temperatures and overload.
        safety: Safety inputs.
        self_test_s: From the boot-up frame to Switch on disabled, s; Not ready to switch on is visible
            for so long.
        limit_switch_reaction: `stop` with 6085h, `fault` 8612h, or `none`: the
            controller watches alone (C402-161).
        slippage_reaction: pv: `status` bit 13 only, or `fault` 8400h as well (C402-159).
        homing: Options of homing in the drive.
        coasting_faults: EMCY codes after which the drive cannot brake.
        eds: EDS file to present on the bus; None = that of this drive.
        storage: File in which stored parameters outlive the process; None = they do not.
        objects: Values that replace defaults of the EDS, by (index, sub-index).
        refusals: SDO abort codes of entries that take no value, by (index, sub-index).
        personality: Name of the manufacturer personality that has been applied.
        quirks: Where the drive differs from the profile.
        emcy: What is sent instead of an EMCY code of the profile.

    """

    node_id: int = 1
    servo_period_ns: int = 250 * US
    control_period_ns: int = 1 * MS
    mechanics: LinearAxisConfig | RotaryAxisConfig = field(default_factory=LinearAxisConfig)
    switches: SwitchesConfig = field(default_factory=SwitchesConfig)
    encoder: EncoderConfig = field(default_factory=EncoderConfig)
    brake: BrakeConfig = field(default_factory=BrakeConfig)
    tuning: ServoTuning = field(default_factory=ServoTuning)
    rated_current_A: float = 5.0
    supply: SupplyConfig = field(default_factory=SupplyConfig)
    thermal: ThermalConfig = field(default_factory=ThermalConfig)
    safety: SafetyConfig = field(default_factory=SafetyConfig)
    self_test_s: float = 0.0
    limit_switch_reaction: Literal["stop", "fault", "none"] = "stop"
    slippage_reaction: Literal["fault", "status"] = "status"
    homing: HomingConfig = field(default_factory=HomingConfig)
    coasting_faults: frozenset[int] = COASTING_FAULTS
    eds: Path | None = None
    storage: Path | None = None
    objects: Mapping[tuple[int, int], int] = field(default_factory=dict)
    refusals: Mapping[tuple[int, int], int] = field(default_factory=dict)
    personality: str = "standard"
    quirks: Quirks = field(default_factory=Quirks)
    emcy: Mapping[int, EmcyCode] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 1 <= self.node_id <= 127:
            raise ConfigurationError("node_id", self.node_id, "1..127")
        if self.servo_period_ns <= 0 or self.control_period_ns % self.servo_period_ns:
            raise ConfigurationError(
                "servo_period_ns",
                self.servo_period_ns,
                f"a divisor of control_period_ns = {self.control_period_ns}",
            )
        check_number("rated_current_A", self.rated_current_A, positive=True)
        check_number("self_test_s", self.self_test_s)
        check_fields(self, "drive")

    @classmethod
    def reference(
        cls,
        *,
        node_id: int = 1,
        sync_period_ms: int = 4,
        max_speed_rpm: int = 3000,
        ramp_down_s: float = 1.0,
        quick_stop_s: float = 0.5,
        switches: SwitchesConfig = _SWITCHES,
        start_position_mm: float = 0.0,
    ) -> DriveConfig:
        """Return the reference axis of the worked numbers (STP-008 to STP-014).

        Lead screw 10 mm, travel +-600 mm between stops, limit switches at +-550 mm, 2 Nm rated and 6 Nm peak
        torque, total inertia 3.5e-4 kg m^2 at the motor (4000 mm/s2 take 0.94 Nm), encoder 131072 increments
        per revolution. Position unit = increment, velocity unit = 10^-3 rpm, acceleration unit = 10^-3 rpm/s.

        Args:
            node_id: CANopen node-ID.
            sync_period_ms: SYNC period for which 60C2h is set, ms.
            max_speed_rpm: p1082: speed to which the ramp times refer, rpm; also 607Fh and 6080h.
            ramp_down_s: p1121 (OFF1): time from `max_speed_rpm` to zero, s; becomes 6084h and 6083h.
            quick_stop_s: p1135 (OFF3), s; becomes 6085h.
            switches: Switches on the travel.
            start_position_mm: Start position of the slide, mm.

        """
        check_number("ramp_down_s", ramp_down_s, positive=True)
        check_number("quick_stop_s", quick_stop_s, positive=True)
        if not 1 <= sync_period_ms <= 255:
            raise ConfigurationError("sync_period_ms", sync_period_ms, "1..255")
        speed = max_speed_rpm * 1000
        slow_down = round(speed / ramp_down_s)
        return cls(
            node_id=node_id,
            mechanics=LinearAxisConfig(start_position_mm=start_position_mm),
            switches=switches,
            objects={
                (0x605B, 0): 1,
                (0x607F, 0): speed,
                (0x6080, 0): max_speed_rpm,
                (0x6081, 0): speed // 3,
                (0x6083, 0): slow_down,
                (0x6084, 0): slow_down,
                (0x6085, 0): round(speed / quick_stop_s),
                (0x6092, 1): 131072,
                (0x6092, 2): 1,
                (0x6099, 1): 200_000,
                (0x6099, 2): 20_000,
                (0x609A, 0): slow_down,
                (0x60A9, 0): 0xFDB44700,
                (0x60C2, 1): sync_period_ms,
                (0x60C2, 2): -3,
                (0x60C5, 0): 60_000_000,
                (0x60C6, 0): 60_000_000,
            },
        )

    def with_objects(self, objects: Mapping[tuple[int, int], int]) -> DriveConfig:
        """Return a copy with further object values."""
        return replace(self, objects={**self.objects, **objects})
