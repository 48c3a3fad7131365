"""Settings of the emulated devices: every field at the borders of its range, values that have to fit
together, personalities of drives from files.

The range of a field is that of its annotation, which is also the one in the bench file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory
from types import UnionType
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Lt

from emulators.drive.analog_config import AnalogConfig, AnalogSettings
from emulators.drive.brake import HoldingBrake
from emulators.drive.cia402.config import DriveConfig
from emulators.drive.cia402.personality import load_personality, personality_names
from emulators.drive.cia402.quirks import EmcyCode, Quirks
from emulators.drive.core import ServoCore
from emulators.drive.homing_config import HomingConfig
from emulators.drive.machine import (
    BrakeConfig,
    EncoderConfig,
    LinearAxisConfig,
    RotaryAxisConfig,
    SafetyConfig,
    SwitchesConfig,
)
from emulators.drive.positioner_config import PositionerSettings, TraversingBlock
from emulators.drive.profidrive.canopen.config import ProfidriveNodeConfig
from emulators.drive.profidrive.config import DriveSettings, ProfidriveConfig
from emulators.drive.profidrive.modbus_config import ProfidriveModbusConfig
from emulators.drive.profidrive_settings import ProfidriveSettings
from emulators.drive.pto_settings import PtoSettings
from emulators.drive.safety_config import SafeMotionConfig
from emulators.drive.second_encoder_config import LinearSecondEncoder, RotarySecondEncoder
from emulators.drive.stepper_can_config import StepperNodeConfig
from emulators.drive.supply_config import SupplyConfig
from emulators.drive.thermal_config import ThermalConfig
from emulators.drive.tuning import ServoTuning
from emulators.drive.two_speed_config import TwoSpeedConfig, TwoSpeedSettings
from emulators.encoder.cia406.config import EncoderDeviceConfig
from emulators.encoder.profidrive import EncoderFormat
from emulators.encoder.profidrive.settings import ProfidriveEncoderSettings
from emulators.io.tm_pto.config import PtoConfig
from emulators.mechanics import AxisMechanics, SwitchModel
from fieldbus.errors import ConfigurationError
from hil.campaign import Campaign, CaseContext
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign(
    "device settings", controller="", tags=("drive",), bench="testcases.campaigns.can_bus:BENCH"
)
KINDS: Final[tuple[tuple[type[Any], dict[str, Any]], ...]] = (
    *((kind, {}) for kind in (AnalogConfig, AnalogSettings, BrakeConfig, DriveConfig, HomingConfig)),
    *((kind, {}) for kind in (LinearAxisConfig, PositionerSettings, ProfidriveConfig, ProfidriveNodeConfig)),
    *((kind, {}) for kind in (ProfidriveModbusConfig, ProfidriveSettings, PtoSettings, SafeMotionConfig)),
    *((kind, {}) for kind in (SafetyConfig, StepperNodeConfig, SupplyConfig, SwitchesConfig, ThermalConfig)),
    *((kind, {}) for kind in (ServoTuning, TwoSpeedConfig, TwoSpeedSettings, EncoderDeviceConfig)),
    (ProfidriveEncoderSettings, {}),
    (RotarySecondEncoder, {"type": "multi_turn"}),
    (LinearSecondEncoder, {"type": "incremental_linear", "mounting": "load"}),
    (TraversingBlock, {"number": 1}),
)
"""Configurations, and what they need besides."""


def _marks(hint: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return the type behind annotations and options, and the annotations."""
    marks: tuple[Any, ...] = ()
    while True:
        if get_origin(hint) is Annotated:
            hint, *more = get_args(hint)
            marks = (*more, *marks)
        elif get_origin(hint) in (Union, UnionType) and type(None) in get_args(hint):
            (hint, *_) = (one for one in get_args(hint) if one is not type(None))
        else:
            return hint, marks


def _tries(hint: Any) -> Iterator[tuple[Any, bool]]:
    """Yield values on and beyond the borders of a field, and whether they are in its range."""
    kind, marks = _marks(hint)
    if get_origin(kind) is Literal:
        yield from ((choice, True) for choice in get_args(kind))
        yield "something else", False
        return
    if kind not in (int, float):
        return
    step: Callable[[float, float], float] = math.nextafter if kind is float else _next_int
    for mark in marks:
        if isinstance(mark, Ge):
            yield mark.ge, True
            yield step(mark.ge, -math.inf), False
        elif isinstance(mark, Le):
            yield mark.le, True
            yield step(mark.le, math.inf), False
        elif isinstance(mark, Gt):
            yield mark.gt, False
            yield step(mark.gt, math.inf), True
        elif isinstance(mark, Lt):
            yield mark.lt, False
            yield step(mark.lt, -math.inf), True
    if kind is float and marks:
        yield math.nan, False
        yield math.inf, False


def _next_int(value: float, towards: float) -> int:
    return int(value) + (1 if towards > value else -1)


def refused(make: Callable[..., Any], **values: Any) -> str:
    """Return what is said about a configuration; empty: it is taken."""
    try:
        make(**values)
    except ConfigurationError as error:
        return f"{error.where}: {error.allowed}"
    return ""


@CAMPAIGN.case("ranges")
def ranges(ctx: CaseContext) -> None:
    """The border of a range is taken, what lies beyond is refused under the name of its field."""
    wrong: list[str] = []
    count = 0
    for kind, needed in KINDS:
        hints = get_type_hints(kind, include_extras=True)
        for one in fields(kind):
            for value, fits in _tries(hints[one.name]):
                said = refused(kind, **{**needed, one.name: value})
                count += 1
                # What does not fit to other fields is another matter, and says so.
                if f" {one.name}: a finite number" in said if fits else not said:
                    wrong.append(f"{kind.__name__}.{one.name} = {value!r}: {said or 'taken'}")
    equal(ctx, f"values that are judged wrongly: {'; '.join(wrong[:5])}", len(wrong), 0)
    equal(ctx, "there are many", count > 400, 1)


def _block(**values: Any) -> TraversingBlock:
    return TraversingBlock(**{"number": 1, **values})


def _core(period_s: float) -> ServoCore:
    mechanics = LinearAxisConfig().build()
    return ServoCore(mechanics=mechanics, encoder=EncoderConfig().build(None), period_s=period_s)


def _brake(**values: float) -> HoldingBrake:
    return HoldingBrake(LinearAxisConfig().build(), **values)


def _slip(share: float) -> None:
    _brake(torque_Nm=1.0).set_torque_share(share)


ROWS: Final[tuple[tuple[Callable[..., Any], dict[str, Any], str], ...]] = (
    # DC link: undervoltage < nominal <= chopper off < chopper on <= overvoltage
    (SupplyConfig, {"undervoltage_v": 559.0}, ""),
    (SupplyConfig, {"undervoltage_v": 560.0}, "DC link"),
    (SupplyConfig, {"overvoltage_v": 720.0}, ""),
    (SupplyConfig, {"overvoltage_v": 719.0}, "chopper"),
    (SupplyConfig, {"overvoltage_v": 560.0}, "DC link"),
    (SupplyConfig, {"chopper_off_v": 560.0}, ""),
    (SupplyConfig, {"chopper_off_v": 559.0}, "chopper"),
    (SupplyConfig, {"chopper_off_v": 719.9}, ""),
    (SupplyConfig, {"chopper_off_v": 720.0}, "chopper"),
    # temperatures
    (ThermalConfig, {"ambient_c": 84.9}, ""),
    (ThermalConfig, {"ambient_c": 85.0}, "stage temperatures"),
    (ThermalConfig, {"motor_warning_c": 139.9}, ""),
    (ThermalConfig, {"motor_warning_c": 140.0}, "motor temperatures"),
    (ThermalConfig, {"motor_warning_c": 25.0}, "motor temperatures"),
    (ThermalConfig, {"stage_fault_c": 85.0}, "stage temperatures"),
    # safety
    (SafeMotionConfig, {"slp_ranges_mm": ((-1.0, 1.0),)}, ""),
    (SafeMotionConfig, {"slp_ranges_mm": ((1.0, 1.0),)}, "slp_ranges_mm"),
    (SafeMotionConfig, {"slp_ranges_mm": ((-1.0, 1.0), (2.0, 1.0))}, "slp_ranges_mm"),
    (SafeMotionConfig, {"slp_ranges_mm": ((-1.0, 1.0),) * 3}, "slp_ranges_mm"),
    (SafeMotionConfig, {"sls_limits_mm_s": (1.0,) * 4}, ""),
    (SafeMotionConfig, {"sls_limits_mm_s": (1.0,) * 5}, "sls_limits_mm_s"),
    (SafeMotionConfig, {"sls_limits_mm_s": ()}, "sls_limits_mm_s"),
    (SafeMotionConfig, {"sls_limits_mm_s": (1.0, 0.0)}, "sls_limits_mm_s"),
    # gains
    (ServoTuning, {"velocity_integral_time_s": 0.0}, ""),
    (ServoTuning, {"velocity_integral_time_s": -0.001}, "velocity_integral_time_s"),
    (ServoTuning, {"position_gain": -0.1}, "position_gain"),
    (ServoTuning, {"position_gain": 0.0}, ""),
    (ServoTuning, {"current_time_constant_s": -0.1}, "current_time_constant_s"),
    (ServoTuning, {"current_time_constant_s": math.nan}, "current_time_constant_s"),
    (ServoTuning, {"standstill_speed_rpm": 0.0}, "standstill_speed_rpm"),
    (ServoTuning, {"standstill_time_s": 0.0}, ""),
    (ServoTuning, {"standstill_timeout_s": 0.0}, "standstill_timeout_s"),
    (ServoTuning, {"velocity_feedforward": 1.0}, ""),
    (ServoTuning, {"velocity_feedforward": 0.0}, ""),
    (ServoTuning, {"velocity_feedforward": 1.01}, "velocity_feedforward"),
    (ServoTuning, {"velocity_feedforward": -0.01}, "velocity_feedforward"),
    (ServoTuning, {"inertia_kgm2": 1e-9}, ""),
    (ServoTuning, {"inertia_kgm2": 0.0}, "inertia_kgm2"),
    (_core, {"period_s": 0.0006}, ""),
    (_core, {"period_s": 0.00067}, "period_s"),
    (_core, {"period_s": 0.0}, "period_s"),
    # machine
    (LinearAxisConfig, {"coulomb_friction_n": 10.0, "static_friction_n": 10.0}, ""),
    (LinearAxisConfig, {"coulomb_friction_n": 10.0, "static_friction_n": 9.9}, "static_friction_n"),
    (LinearAxisConfig, {"negative_stop_mm": 599.9}, ""),
    (LinearAxisConfig, {"negative_stop_mm": 600.0}, "positive_stop_mm"),
    (LinearAxisConfig, {"negative_stop_mm": None}, ""),
    (SwitchesConfig, {"home_from_mm": 1.0, "home_to_mm": 1.5}, ""),
    (SwitchesConfig, {"home_from_mm": 1.0, "home_to_mm": 1.0}, "home_from_mm"),
    (SwitchesConfig, {"probe2_from_mm": 2.0, "probe2_to_mm": 1.0}, "probe2_from_mm"),
    (SwitchesConfig, {"home_mm": 5.0, "home_to_mm": 7.0}, "home_mm"),
    (EncoderConfig, {"kind": "sine"}, "encoder kind"),
    (_brake, {"torque_Nm": 0.0}, ""),
    (_brake, {"torque_Nm": -0.1}, "brake torque_Nm"),
    (_brake, {"opening_time_s": -0.1}, "brake opening_time_s"),
    (_brake, {"closing_time_s": -0.1}, "brake closing_time_s"),
    (_slip, {"share": 0.0}, ""),
    (_slip, {"share": 1.0}, ""),
    (_slip, {"share": 1.01}, "brake slip share"),
    (_slip, {"share": -0.01}, "brake slip share"),
    (SwitchModel, {"low": 1.0, "high": 1.1}, ""),
    (SwitchModel, {"low": 1.0, "high": 1.0}, "switch range"),
    (SwitchModel, {}, "switch range"),
    (SwitchModel, {"low": 1.0, "hysteresis": 0.0}, ""),
    (SwitchModel, {"low": 1.0, "hysteresis": -1.0}, "switch hysteresis"),
    (SwitchModel, {"low": 1.0, "hysteresis": math.inf}, "switch hysteresis"),
    # CiA 402
    (DriveConfig, {"node_id": 1}, ""),
    (DriveConfig, {"node_id": 127}, ""),
    (DriveConfig, {"node_id": 0}, "node_id"),
    (DriveConfig, {"node_id": 128}, "node_id"),
    (DriveConfig, {"servo_period_ns": 0}, "servo_period_ns"),
    (DriveConfig, {"servo_period_ns": 300_000}, "servo_period_ns"),
    (DriveConfig, {"rated_current_A": 0.0}, "rated_current_A"),
    (DriveConfig, {"self_test_s": 0.0}, ""),
    (DriveConfig, {"self_test_s": -0.1}, "self_test_s"),
    (HomingConfig, {"hard_stop_methods": {"-1": "negative"}}, ""),
    (HomingConfig, {"hard_stop_methods": {"-5": "negative"}}, "homing hard_stop_methods"),
    (HomingConfig, {"hard_stop_methods": {"-1": "sideways"}}, "homing hard_stop_methods -1"),
    (Quirks, {"auto_reset_s": 3600.0}, ""),
    (Quirks, {"auto_reset_s": 3600.1}, "auto_reset_s"),
    (Quirks, {"auto_reset_s": -0.1}, "auto_reset_s"),
    (Quirks, {"falls_back_without_power_s": math.nan}, "falls_back_without_power_s"),
    (Quirks, {"auto_reset_attempts": 1}, ""),
    (Quirks, {"auto_reset_attempts": 1000}, ""),
    (Quirks, {"auto_reset_attempts": 0}, "auto_reset_attempts"),
    (Quirks, {"auto_reset_attempts": 1001}, "auto_reset_attempts"),
    (Quirks, {"status_homed": 0xC100}, ""),
    (Quirks, {"status_homed": 0x0200}, "status_homed"),
    (Quirks, {"status_homing_refused": 0x1_0000}, "status_homing_refused"),
    (EmcyCode, {"code": 1}, ""),
    (EmcyCode, {"code": 0xFFFF, "register": 0xFF, "data": bytes(5)}, ""),
    (EmcyCode, {"code": 0}, "emcy code"),
    (EmcyCode, {"code": 0x1_0000}, "emcy code"),
    (EmcyCode, {"code": 1, "register": 0x100}, "emcy register"),
    (EmcyCode, {"code": 1, "register": -1}, "emcy register"),
    (EmcyCode, {"code": 1, "data": bytes(6)}, "emcy data"),
    # PROFIdrive
    (ProfidriveConfig, {"telegram": 8}, "telegram"),
    (ProfidriveConfig, {"telegram": 7}, "operating_mode (PNU 930)"),
    (ProfidriveConfig, {"telegram": 7, "settings": DriveSettings(operating_mode=2)}, ""),
    (ProfidriveConfig, {"telegram": 1, "settings": DriveSettings(operating_mode=2)}, "operating_mode"),
    (ProfidriveConfig, {"data_sets": (DriveSettings(),) * 31}, ""),
    (ProfidriveConfig, {"data_sets": (DriveSettings(),) * 32}, "data_sets"),
    (ProfidriveConfig, {"data_sets": (DriveSettings(operating_mode=2),)}, "operating_mode"),
    (ProfidriveConfig, {"servo_period_ns": 0}, "servo_period_ns"),
    (ProfidriveConfig, {"servo_period_ns": 300_000}, "servo_period_ns"),
    (ProfidriveConfig, {"cycle_ns": 1_100_000}, "cycle_ns"),
    (ProfidriveConfig, {"cycle_ns": 0}, "cycle_ns"),
    (ProfidriveConfig, {"encoder": EncoderConfig(counts_per_revolution=1 << 20)}, ""),
    (ProfidriveConfig, {"encoder": EncoderConfig(counts_per_revolution=(1 << 20) + 1)}, "encoder"),
    (ProfidriveConfig, {"telegram": 1, "isochronous": True}, "isochronous"),
    (ProfidriveConfig, {"telegram": 1, "isochronous": False}, ""),
    (DriveSettings, {"operating_mode": 4}, "operating_mode (PNU 930)"),
    (DriveSettings, {"operating_mode": 0}, "operating_mode (PNU 930)"),
    *(
        (DriveSettings, {name: 0.0}, name)
        for name in ("reference_speed_rpm", "reference_torque_nm", "max_speed_rpm", "motor_potentiometer_s")
    ),
    *(
        row
        for name in ("ramp_up_s", "ramp_down_s", "quick_stop_s", "momred_evaluation_percent")
        for row in ((DriveSettings, {name: 0.0}, ""), (DriveSettings, {name: -0.1}, name))
    ),
    *(
        row
        for name in ("setpoint_monitoring_ms", "comparison_speed_rpm", "deviation_rpm", "deviation_time_s")
        for row in ((DriveSettings, {name: 0.0}, ""), (DriveSettings, {name: math.nan}, name))
    ),
    *(
        (DriveSettings, {name: -1.0}, name)
        for name in ("speed_threshold_2_rpm", "speed_threshold_3_rpm", "torque_threshold_percent")
    ),
    (DriveSettings, {"variable_threshold": -1.0}, "variable_threshold"),
    (DriveSettings, {"dsc_encoder": 2}, ""),
    (DriveSettings, {"dsc_encoder": 3}, "dsc_encoder"),
    (DriveSettings, {"dsc_encoder": 0}, "dsc_encoder"),
    (DriveSettings, {"dsc_factor": -1.5}, ""),
    (DriveSettings, {"dsc_factor": math.inf}, "dsc_factor"),
    (DriveSettings, {"variable_signal": "power"}, "variable_signal"),
    (DriveSettings, {"torque_limits_Nm": (6.0, -0.1)}, "torque_limits_Nm"),
    (DriveSettings, {"speed_limits_rpm": (-1.0, 6.0)}, "speed_limits_rpm"),
    (DriveSettings, {"quick_rounding_s": (0.0, math.nan)}, "quick_rounding_s"),
    (DriveSettings, {"torque_limits_percent": (150.0, None)}, ""),
    (DriveSettings, {"torque_limits_percent": (150.0, 151.0)}, "torque_limits_percent"),
    (DriveSettings, {"jog_rpm": (0.0, math.inf)}, "jog_rpm"),
    (DriveSettings, {"sign_of_life_tolerance": 65_535}, ""),
    (DriveSettings, {"sign_of_life_tolerance": 65_536}, "sign_of_life_tolerance"),
    (DriveSettings, {"sign_of_life_tolerance": -1}, "sign_of_life_tolerance"),
    (ProfidriveModbusConfig, {"unit": 1}, ""),
    (ProfidriveModbusConfig, {"unit": 247}, ""),
    (ProfidriveModbusConfig, {"unit": 0}, "unit"),
    (ProfidriveModbusConfig, {"unit": 248}, "unit"),
    # positioner
    (PositionerSettings, {"software_limits": (-1, 0)}, ""),
    (PositionerSettings, {"software_limits": (0, 0)}, "software_limits"),
    (PositionerSettings, {"jog_velocities": (0.0, 1.0)}, "jog_velocities"),
    (PositionerSettings, {"block": (_block(), _block(number=2))}, ""),
    (PositionerSettings, {"block": (_block(), _block())}, "block"),
    (_block, {"task": "wait", "parameter": 1_000_000}, ""),
    (_block, {"task": "wait", "parameter": 1_000_001}, "block parameter of wait"),
    (_block, {"task": "wait", "parameter": -1}, "block parameter of wait"),
    (_block, {"task": "goto", "parameter": 63}, ""),
    (_block, {"task": "goto", "parameter": 64}, "block parameter of goto"),
    (_block, {"task": "set output", "parameter": 0}, "block parameter of set output"),
    (_block, {"task": "reset output", "parameter": 4}, "block parameter of reset output"),
    (_block, {"task": "absolute", "parameter": 4}, ""),
    (_block, {"task": "endless positive", "continuation": "continue external"}, ""),
    (_block, {"task": "endless positive", "continuation": "continue flying"}, "block continuation"),
    (_block, {"task": "endless negative", "continuation": "continue with stop"}, "block continuation"),
    # others
    (TwoSpeedSettings, {"slow_rpm": 10.0, "fast_rpm": 10.1}, ""),
    (TwoSpeedSettings, {"slow_rpm": 10.0, "fast_rpm": 10.0}, "two-speed drive"),
    (TwoSpeedConfig, {"servo_period_ns": 0}, "two-speed drive servo_period_ns"),
    (AnalogConfig, {"servo_period_ns": 0}, "analog drive servo_period_ns"),
    (AnalogConfig, {"peak_torque": 0.0}, "analog drive peak_torque"),
    (AnalogSettings, {"characteristic": ((0.0, 0.0), (1.0, 1.0))}, ""),
    (AnalogSettings, {"characteristic": ((0.0, 0.0),)}, "analog drive"),
    (AnalogSettings, {"characteristic": ((0.0, 0.0), (0.0, 1.0))}, "analog drive"),
    (StepperNodeConfig, {"cycle_ns": 0}, "cycle_ns"),
    (PtoSettings, {"input_delay_ms": 0.3}, "input_delay_ms"),
    (LinearSecondEncoder, {"type": "incremental_linear", "mounting": "motor"}, "encoder2 mounting"),
    (EncoderDeviceConfig, {"measuring_step_um": 0.001}, ""),
    (EncoderDeviceConfig, {"measuring_step_um": 0.0004}, "measuring_step_um"),
    (EncoderFormat, {"periods": 8, "load_absolute": True, "revolutions": 0}, "load_absolute"),
    (EncoderFormat, {"periods": 8, "load_absolute": True, "revolutions": 2}, ""),
    (
        EncoderFormat,
        {"periods": 8, "load_absolute": True, "revolutions": 2, "start_value": 1},
        "start_value",
    ),
    (EncoderFormat, {"periods": 8, "revolutions": 2, "grid_nm": 100}, "encoder format"),
    (EncoderFormat, {"periods": 1 << 16, "revolutions": 1 << 7, "shift_xist2": 9}, ""),
    (EncoderFormat, {"periods": 1 << 16, "revolutions": 1 << 8, "shift_xist2": 9}, "encoder format"),
    (RotaryAxisConfig, {}, ""),
    (PtoConfig, {}, ""),
    (AxisMechanics, {"ratio": 0.0, "inertia": 1.0}, "ratio"),
    (AxisMechanics, {"ratio": -2.0, "inertia": 1.0}, ""),
    (AxisMechanics, {"ratio": 1.0, "inertia": 0.0}, "inertia"),
)
"""What is made, with what, and what it is refused for; empty: it is taken."""


@CAMPAIGN.case("together")
def together(ctx: CaseContext) -> None:
    """Values that contradict each other are refused, on the border they are taken."""
    for make, values, where in ROWS:
        name = getattr(make, "__name__", "")
        said = refused(make, **values)
        fits = where in said if where else not said
        equal(ctx, f"{name}({values}) says {said!r}, to be about {where!r}", fits, 1)


# -- personalities from files -------------------------------------------------------------------------------

HEAD: Final = 'name = "own-drive"\nsummary = "a drive"\n'
GOOD: Final = (
    HEAD
    + """
[quirks]
auto_reset_s = 1
status_homed = 0x4000
single_setpoint = true
[drive]
home_offset = "vendor"
[objects]
"1800:2" = 7
"605A:0" = 6
[refusals]
"6098:0" = 0x08000022
[emcy.2310]
code = 0x1234
register = 3
data = "0102"
[sources]
"quirks.status_homed" = "manual, page 7"
emcy = "manual, page 9"
"""
)
FILES: Final[tuple[tuple[str, str], ...]] = (
    (HEAD, ""),
    (GOOD, ""),
    ('name = "own-drive"\n', "summary"),
    ('summary = "a drive"\n', "name"),
    ('name = ""\nsummary = "x"', "name"),
    ('name = "Own Drive"\nsummary = "x"', "name"),
    ('name = "own--drive"\nsummary = "x"', "name"),
    (HEAD + "colour = 1", "colour"),
    (HEAD + "objects = 1", "objects"),
    (HEAD + "[quirks]\nunknown = 1", "quirks.unknown"),
    (HEAD + "[quirks]\nsingle_setpoint = 1", "quirks.single_setpoint"),
    (HEAD + "[quirks]\nauto_reset_s = true", "quirks.auto_reset_s"),
    (HEAD + '[quirks]\nauto_reset_s = "1"', "quirks.auto_reset_s"),
    (HEAD + "[quirks]\nauto_reset_attempts = 1.5", "quirks.auto_reset_attempts"),
    (HEAD + "[quirks]\nauto_reset_attempts = 0", "quirks.auto_reset_attempts"),
    (HEAD + "[drive]\nunknown = 1", "drive.unknown"),
    (HEAD + "[drive]\nhome_offset = 1", "drive.home_offset"),
    (HEAD + '[objects]\n"18002" = 1', "objects"),
    (HEAD + '[objects]\n"1800:2" = "1"', "objects.1800:2"),
    (HEAD + '[objects]\n"1800:2" = true', "objects.1800:2"),
    (HEAD + '[refusals]\n"6098:0" = 0x05000000', ""),
    (HEAD + '[refusals]\n"6098:0" = 0x04FFFFFF', "refusals.6098:0"),
    (HEAD + '[refusals]\n"6098:0" = 0x08FFFFFF', ""),
    (HEAD + '[refusals]\n"6098:0" = 0x09000000', "refusals.6098:0"),
    (HEAD + "[emcy.23]\ncode = 1", "emcy.23"),
    (HEAD + "[emcy.0000]\ncode = 1", "emcy.0000"),
    (HEAD + "[emcy.2310]\nname = 1", "emcy.2310"),
    (HEAD + '[emcy.2310]\ncode = "1"', "emcy.2310"),
    (HEAD + "[emcy.2310]\nregister = 256", "emcy.2310: emcy register"),
    (HEAD + '[emcy.2310]\ndata = "x"', "emcy.2310.data"),
    (HEAD + "[quirks]\nstatus_homed = 0x100\n[sources]\nquirks = 1", "sources.quirks"),
    (HEAD + '[sources]\nobjects = "page 1"', "sources"),
)
"""Content of a file, and what it is refused for; empty: it is taken."""


@CAMPAIGN.case("personalities")
def personalities(ctx: CaseContext) -> None:
    """A file says what is wrong with it under its name and key; what it says goes before the profile, and
    what a bench says of objects and home offset before the file.
    """
    with TemporaryDirectory() as folder:
        path = Path(folder) / "own.toml"
        for text, where in FILES:
            path.write_text(text, encoding="utf-8")
            said = refused(load_personality, reference=path)
            fits = said.startswith(f"own.toml: {where}") if where else not said
            equal(ctx, f"{text!r} says {said!r}, to be about {where!r}", fits, 1)
        path.write_text(GOOD, encoding="utf-8")
        own = load_personality(path)
        path.write_bytes(b"\xff")
        equal(ctx, "no text", "personality" in refused(load_personality, reference=path), 1)
        path.write_text("name = ", encoding="utf-8")
        equal(ctx, "no TOML", bool(refused(load_personality, reference=path)), 1)
        missing = Path(folder) / "none.toml"
        equal(ctx, "no file", "personality" in refused(load_personality, reference=missing), 1)
    equal(ctx, "no such personality", "personality" in refused(load_personality, reference="none"), 1)
    emcy = own.emcy[0x2310]
    for what, found, wanted in (
        ("names", (own.name, own.summary), ("own-drive", "a drive")),
        ("quirks", own.quirks, Quirks(auto_reset_s=1, status_homed=0x4000, single_setpoint=True)),
        ("objects", own.objects, {(0x1800, 2): 7, (0x605A, 0): 6}),
        ("refusals", own.refusals, {(0x6098, 0): 0x08000022}),
        ("EMCY", (emcy.code, emcy.register, emcy.data), (0x1234, 3, b"\1\2")),
        ("shown in the status word", own.quirks.shown_in_status, True),
        ("sources", dict(own.sources), {"quirks.status_homed": "manual, page 7", "emcy": "manual, page 9"}),
        (
            "deviations",
            set(own.deviations),
            {f"quirks.{name}" for name in ("auto_reset_s", "status_homed", "single_setpoint")}
            | {"drive.home_offset", "objects", "refusals", "emcy"},
        ),
    ):
        equal(ctx, f"{what}: {found} is {wanted}", found == wanted, 1)
    plain = own.apply(DriveConfig())
    told = own.apply(
        DriveConfig(objects={(0x605A, 0): 2, (0x6085, 0): 9}, homing=HomingConfig(offset="profile"))
    )
    for what, found, wanted in (
        ("objects of the file", dict(plain.objects), {(0x1800, 2): 7, (0x605A, 0): 6}),
        ("objects of the bench", dict(told.objects), {(0x1800, 2): 7, (0x605A, 0): 2, (0x6085, 0): 9}),
        ("home offset of the file", plain.homing.offset, "vendor"),
        ("home offset of the bench", told.homing.offset, "profile"),
        ("personality", (plain.personality, plain.quirks), ("own-drive", own.quirks)),
        ("what it refuses", dict(plain.refusals), {(0x6098, 0): 0x08000022}),
    ):
        equal(ctx, f"{what}: {found} is {wanted}", found == wanted, 1)
    for name in personality_names():
        shipped = load_personality(name)
        undocumented = [one for one in shipped.deviations if one not in shipped.sources]
        equal(ctx, f"{name}: deviations without a source", len(undocumented), 0)
