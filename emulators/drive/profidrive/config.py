"""Configuration of an emulated PROFIdrive drive with its machine."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

from annotated_types import Ge, Le

from emulators.checked_fields import check_fields
from emulators.drive.core import ServoTuning
from emulators.drive.keys import PowerKeys, SpeedKeys, TelegramKeys, TorqueKeys
from emulators.drive.machine import (
    BrakeConfig,
    EncoderConfig,
    LinearAxisConfig,
    RotaryAxisConfig,
    SwitchesConfig,
    check_number,
)
from emulators.drive.positioner_config import PositionerSettings
from emulators.drive.profidrive_settings import ProfidriveSettings
from emulators.drive.safety_config import SafeMotionConfig
from emulators.drive.second_encoder_config import SecondEncoderConfig
from emulators.drive.supply_config import SupplyConfig
from emulators.drive.thermal_config import ThermalConfig
from emulators.encoder.profidrive import EncoderFormat
from fieldbus.clock import MS, US
from fieldbus.errors import ConfigurationError
from fieldbus.profidrive import FREE_CONFIGURATION, Telegram, free_telegram, telegram

POSITION_TELEGRAMS = (7, 9, 110, 111, 112)
"""Telegrams of the basic positioner, which go with operating mode 2 (PD-032)."""
AXIS_TELEGRAMS = (1, 2, 3, 4, 5, 6, 20, 102, 103, 105, 106, *POSITION_TELEGRAMS, FREE_CONFIGURATION)
"""Telegrams that the axis takes."""


FIXED_PERCENT = (0.0, 5.0, 10.0, 20.0, 50.0, 100.0, 150.0, 200.0)
"""Amounts of the fixed values of r2902 that a torque limit can be connected to, percent."""


def finest_xist2(encoder: EncoderConfig, finest: int = 9) -> int:
    """Return p0419: as many bits of fine resolution as G1_XIST2 has place for, at most `finest`."""
    steps = encoder.counts_per_revolution * encoder.turns
    return max(0, min(finest, 32 - (steps - 1).bit_length()))


@dataclass(kw_only=True)
class DriveSettings:
    """Parameters of the drive that may change while it works; in the drive's own numbers and units.

    Args:
        operating_mode: PNU 930: 1 full ramp-function generator, 2 positioning, 3 reduced setpoint channel.
        reference_speed_rpm: p2000, what 4000h (4000 0000h) means, rpm.
        reference_torque_nm: p2003, Nm.
        max_speed_rpm: p1082, speed to which the ramp times refer, and limit of the setpoint, rpm.
        ramp_up_s: p1120, from 0 to p1082, s; 0 = at once.
        ramp_down_s: p1121, OFF1, s; 0 = at the torque limit.
        quick_stop_s: p1135, OFF3, s; 0 = at the torque limit.
        speed_limits_rpm: p1083 and -p1086, rpm, both >= 0; p1082 limits too.
        rounding_s: p1130 and p1131, initial and final rounding of the ramps, s.
        rounding_breaks_off: p1134 = 1: a setpoint that turns round in the middle of a ramp breaks its
            slope off.
        quick_rounding_s: p1136 and p1137, of OFF3, s.
        inverted_by_bit: p1113: STW1 bit 11 turns the setpoint round.
        motor_potentiometer: p1035 and p1036: STW1 bits 13 and 14 raise and lower a setpoint that is added.
        motor_potentiometer_s: p1047, its time from 0 to p1082, s.
        jog_rpm: p1058, p1059.
        torque_limits_Nm: p1520 and -p1521, Nm, both >= 0.
        torque_limits_percent: Fixed values to which p1522 and -p1523 are connected, percent of p2003,
            both >= 0; None: p1520, p1521.
        momred_evaluation_percent: p1544.
        sign_of_life_tolerance: PNU 925; 65535 = not monitored.
        setpoint_monitoring_ms: p2040: without process data for so long F01910, ms; 0 = not monitored.
        comparison_speed_rpm: ZSW1 bit 10 from here on.
        deviation_rpm: ZSW1 bit 8: tolerance of the speed, rpm.
        deviation_time_s: ... and for how long it has to be exceeded, s.
        speed_threshold_2_rpm: MELDW bit 3.
        speed_threshold_3_rpm: MELDW bit 2.
        torque_threshold_percent: MELDW bit 1, percent of the torque limit (p2194).
        speed_control_extended: p1409: with bit 0 the additive torque is reached linearly within the bus
            cycle, without it at once.
        dsc_encoder: Encoder whose increments XERR counts, 1 or 2 (p1192).
        dsc_factor: Increments of encoder 1 per increment of encoder 2 (p1193).
        variable_signal: MELDW bit 5 watches `torque`, `speed`, or nothing: `none`.
        variable_threshold: ... and is 1 above this amount, Nm or rpm.

    """

    operating_mode: int = ProfidriveSettings.operating_mode
    reference_speed_rpm: float = ProfidriveSettings.reference_speed_rpm
    reference_torque_nm: float = ProfidriveSettings.reference_torque_nm
    max_speed_rpm: float = SpeedKeys.max_speed_rpm
    ramp_up_s: float = ProfidriveSettings.ramp_up_s
    ramp_down_s: float = 10.0
    quick_stop_s: float = 0.0
    speed_limits_rpm: tuple[float, float] = (210_000.0, 210_000.0)
    rounding_s: tuple[float, float] = (0.0, 0.0)
    rounding_breaks_off: bool = False
    quick_rounding_s: tuple[float, float] = (0.0, 0.0)
    inverted_by_bit: bool = False
    motor_potentiometer: bool = False
    motor_potentiometer_s: float = 10.0
    jog_rpm: tuple[float, float] = (150.0, -150.0)
    torque_limits_Nm: tuple[float, float] = (6.0, 6.0)
    torque_limits_percent: tuple[float | None, float | None] = (None, None)
    momred_evaluation_percent: float = 100.0
    sign_of_life_tolerance: int = ProfidriveSettings.sign_of_life_tolerance
    setpoint_monitoring_ms: float = ProfidriveSettings.setpoint_monitoring_ms
    comparison_speed_rpm: float = 100.0
    deviation_rpm: float = 90.0
    deviation_time_s: float = 0.01
    speed_threshold_2_rpm: float = 900.0
    speed_threshold_3_rpm: float = 5.0
    torque_threshold_percent: float = 90.0
    speed_control_extended: int = 0
    dsc_encoder: int = 1
    dsc_factor: float = 1.0
    variable_signal: Literal["none", "torque", "speed"] = "none"
    variable_threshold: float = 0.0

    def __post_init__(self) -> None:
        if self.operating_mode not in (1, 2, 3):
            raise ConfigurationError("operating_mode (PNU 930)", self.operating_mode, "1, 2, 3")
        for name in ("reference_speed_rpm", "reference_torque_nm", "max_speed_rpm"):
            check_number(name, getattr(self, name), positive=True)
        for name in (
            "ramp_up_s",
            "ramp_down_s",
            "quick_stop_s",
            "momred_evaluation_percent",
            "setpoint_monitoring_ms",
            "comparison_speed_rpm",
            "deviation_rpm",
            "deviation_time_s",
            "speed_threshold_2_rpm",
            "speed_threshold_3_rpm",
            "torque_threshold_percent",
            "variable_threshold",
        ):
            check_number(name, getattr(self, name))
        if self.dsc_encoder not in (1, 2):
            raise ConfigurationError("dsc_encoder (p1192)", self.dsc_encoder, "1, 2")
        if not math.isfinite(self.dsc_factor):
            raise ConfigurationError("dsc_factor (p1193)", self.dsc_factor, "a finite number")
        if self.variable_signal not in ("none", "torque", "speed"):
            raise ConfigurationError("variable_signal", self.variable_signal, "none, torque, speed")
        check_number("motor_potentiometer_s", self.motor_potentiometer_s, positive=True)
        for name in ("torque_limits_Nm", "speed_limits_rpm", "rounding_s", "quick_rounding_s"):
            for value in getattr(self, name):
                check_number(name, value)
        for limit in self.torque_limits_percent:
            if limit is not None and limit not in FIXED_PERCENT:
                allowed = ", ".join(f"{one:g}" for one in FIXED_PERCENT)
                raise ConfigurationError("torque_limits_percent", limit, f"None, {allowed} (r2902)")
        for value in self.jog_rpm:
            if not math.isfinite(value):
                raise ConfigurationError("jog_rpm", value, "a finite number")
        if not 0 <= self.sign_of_life_tolerance <= 65_535:
            raise ConfigurationError(
                "sign_of_life_tolerance (PNU 925)", self.sign_of_life_tolerance, "0..65535"
            )


@dataclass(frozen=True, kw_only=True)
class ProfidriveConfig(TorqueKeys, PowerKeys, TelegramKeys):
    """An emulated PROFIdrive axis; knows no bus.

    Args:
        telegram: Number, one of `AXIS_TELEGRAMS`.
        free_setpoint: Signals of telegram 999, from the controller.
        free_actual: Signals of telegram 999, to the controller.
        isochronous: Operation with clock and sign of life; None = wherever the telegram has one (CFG-190)
            and leads the speed.
        cycle_ns: Bus cycle, ns; a multiple of `servo_period_ns`.
        servo_period_ns: Servo step, ns; a divisor of `control_period_ns`.
        control_period_ns: Cycle of monitoring, ns.
        settings: Start values of the parameters; operating mode 2 goes with the telegrams of the
            positioner and no other.
        positioner: Settings of the positioner.
        mechanics: The machine.
        switches: Switches on the travel of a linear axis.
        encoder: The motor encoder; its counts are those of P979[2], without fine resolution.
        encoder2: The second encoder; None = not fitted: telegrams with G2 show it as parked.
        fine_xist2: p0419, bits.
        brake: The holding brake.
        tuning: Gains of the cascade.
        supply: DC link and mains.
        thermal: Temperatures and overload.
        safety: Safety functions.
        data_sets: Drive data sets 1, 2, ... that STW2 bits 0 to 4 can choose; `settings` is number 0. At
            most 31.
        control_lost: What the drive does when STW1 bit 10 goes in operation: it runs on with the last
            control word, or trips with F07220 (PD-077).
        operation_while_braking: ZSW1 bit 2 stays 1 during OFF1 and OFF3, as some drives show it.

    Raises:
        ConfigurationError: A value is out of range, or values do not fit together.

    """

    telegram: int = 3
    free_setpoint: tuple[str, ...] = ()
    free_actual: tuple[str, ...] = ()
    isochronous: bool | None = None
    cycle_ns: int = 4 * MS
    servo_period_ns: int = 250 * US
    control_period_ns: int = 1 * MS
    settings: DriveSettings = field(default_factory=DriveSettings)
    positioner: PositionerSettings = field(default_factory=PositionerSettings)
    mechanics: LinearAxisConfig | RotaryAxisConfig = field(default_factory=LinearAxisConfig)
    switches: SwitchesConfig = field(default_factory=SwitchesConfig)
    encoder: EncoderConfig = field(default_factory=lambda: EncoderConfig(counts_per_revolution=2048))
    encoder2: SecondEncoderConfig | None = None
    fine_xist2: Annotated[int, Ge(0), Le(20)] = 9
    brake: BrakeConfig = field(default_factory=BrakeConfig)
    tuning: ServoTuning = field(default_factory=ServoTuning)
    supply: SupplyConfig = field(default_factory=SupplyConfig)
    thermal: ThermalConfig = field(default_factory=ThermalConfig)
    safety: SafeMotionConfig = field(default_factory=SafeMotionConfig)
    data_sets: tuple[DriveSettings, ...] = ()
    control_lost: Literal["run_on", "fault"] = "run_on"
    operation_while_braking: bool = False

    def __post_init__(self) -> None:
        check_fields(self, "drive")
        if self.telegram not in AXIS_TELEGRAMS:
            raise ConfigurationError("telegram", self.telegram, ", ".join(map(str, AXIS_TELEGRAMS)))
        if self.telegram != FREE_CONFIGURATION and self.positions is not (
            self.telegram in POSITION_TELEGRAMS
        ):
            raise ConfigurationError(
                "operating_mode (PNU 930)",
                self.settings.operating_mode,
                f"2 with the telegrams {', '.join(map(str, POSITION_TELEGRAMS))}, 1 or 3 with the others",
            )
        if len(self.data_sets) > 31:
            raise ConfigurationError("data_sets", len(self.data_sets), "at most 31")
        for one in self.data_sets:
            if one.operating_mode != self.settings.operating_mode:
                raise ConfigurationError(
                    "operating_mode (PNU 930) of a data set",
                    one.operating_mode,
                    str(self.settings.operating_mode),
                )
        if self.control_lost not in ("run_on", "fault"):
            raise ConfigurationError("control_lost", self.control_lost, "run_on, fault")
        if self.servo_period_ns <= 0 or self.control_period_ns % self.servo_period_ns:
            raise ConfigurationError(
                "servo_period_ns",
                self.servo_period_ns,
                f"a divisor of control_period_ns = {self.control_period_ns}",
            )
        if self.cycle_ns <= 0 or self.cycle_ns % self.servo_period_ns:
            raise ConfigurationError(
                "cycle_ns", self.cycle_ns, f"a multiple of servo_period_ns = {self.servo_period_ns}"
            )
        if self.encoder.counts_per_revolution << self.fine_resolution_bits > 1 << 31:
            raise ConfigurationError(
                "encoder",
                f"{self.encoder.counts_per_revolution} * 2^{self.fine_resolution_bits}",
                "at most 2^31",
            )
        self.encoder_format  # noqa: B018 - raises when the values do not fit together
        if self.isochronous and not self.build_telegram().isochronous:
            raise ConfigurationError(
                "isochronous", f"telegram {self.telegram}", "a telegram with a sign of life"
            )

    def build_telegram(self) -> Telegram:
        """Return the telegram, with its supplement."""
        if self.telegram == FREE_CONFIGURATION:
            chosen = free_telegram(self.free_setpoint, self.free_actual)
        else:
            chosen = telegram(self.telegram)
        if self.torque_telegram:
            chosen = chosen.with_supplement()
        return chosen if self.safety_telegram is None else chosen.with_supplement(self.safety_telegram)

    @property
    def positions(self) -> bool:
        """Whether the setpoints are tasks of the positioner."""
        return self.settings.operating_mode == 2

    @property
    def works_isochronously(self) -> bool:
        """Whether there is a clock and a sign of life."""
        if self.isochronous is None:
            return self.build_telegram().isochronous and not self.positions
        return self.isochronous

    @property
    def encoder_with_fine_resolution(self) -> EncoderConfig:
        """The encoder with the counts of G1_XIST1."""
        return replace(
            self.encoder,
            counts_per_revolution=self.encoder.counts_per_revolution << self.fine_resolution_bits,
            zero_mark_counts=self.encoder.zero_mark_counts << self.fine_resolution_bits,
            mounting_counts=self.encoder.mounting_counts << self.fine_resolution_bits,
        )

    @property
    def encoder_format(self) -> EncoderFormat:
        """Formats of G1_XIST1 and G1_XIST2; an absolute encoder loads G1_XIST1 with its value (PD-172)."""
        absolute = self.encoder.kind == "absolute"
        return EncoderFormat(
            periods=self.encoder.counts_per_revolution,
            interpolation_bits=self.fine_resolution_bits,
            shift_xist1=self.fine_resolution_bits,
            shift_xist2=self.fine_xist2,
            revolutions=self.encoder.turns if absolute else 0,
            load_absolute=absolute,
        )

    @property
    def encoder_formats(self) -> tuple[EncoderFormat, ...]:
        """Formats of all encoders, as P979 tells them."""
        first = self.encoder_format
        return (first,) if self.encoder2 is None else (first, self.encoder2.form())

    @classmethod
    def reference(
        cls,
        *,
        telegram: int = 105,
        cycle_ms: int = 4,
        max_speed_rpm: float = 3000.0,
        ramp_down_s: float = 1.0,
        quick_stop_s: float = 0.5,
        operating_mode: int = 3,
        start_position_mm: float = 0.0,
    ) -> ProfidriveConfig:
        """Return the reference axis of the worked numbers (STP-008 to STP-014), as `DriveConfig.reference` of
        CiA 402 does.

        Args:
            telegram: Number of the telegram.
            cycle_ms: Bus cycle, ms.
            max_speed_rpm: p1082, rpm.
            ramp_down_s: p1120 and p1121, s.
            quick_stop_s: p1135, s.
            operating_mode: PNU 930.
            start_position_mm: Start position of the slide, mm.

        """
        return cls(
            telegram=telegram,
            cycle_ns=cycle_ms * MS,
            settings=DriveSettings(
                operating_mode=operating_mode,
                max_speed_rpm=max_speed_rpm,
                ramp_up_s=ramp_down_s,
                ramp_down_s=ramp_down_s,
                quick_stop_s=quick_stop_s,
            ),
            mechanics=LinearAxisConfig(start_position_mm=start_position_mm),
        )
