"""Emulated drives of a bench file, the dictionary they share, and the words for their frames."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fieldbus.clock import MS, US
from fieldbus.node_clock import NodeClock
from hil.bench._profidrive_encoder import second_encoder_config
from hil.bench.io_devices import build_analog_drive, build_stepper

if TYPE_CHECKING:
    import canopen
    from numpy.random import Generator

    from emulators.drive.analog import AnalogDrive
    from emulators.drive.cia402 import CiA402Drive, DriveConfig
    from emulators.drive.profidrive import ProfidriveCanDrive, ProfidriveConfig
    from emulators.drive.profidrive.modbus import ProfidriveModbusDrive
    from emulators.drive.stepper_can import StepperCanDrive
    from fieldbus.canopen.decode import FrameDecoder
    from fieldbus.clock import Scheduler
    from fieldbus.history import History
    from fieldbus.profidrive import Layout
    from hil.bench.config import BenchConfig
    from hil.bench.device_config import DeviceSection
    from hil.bench.drive_config import DriveSection
    from hil.bench.drive_ports import CanPort
    from hil.bench.encoder_config import EncoderSection
    from hil.bench.signal_words import SignalWords


_RECEIVE_WORDS: Final = 0x5800
"""Object of the first free process data word to a PROFIdrive axis (PD-341)."""
_SEND_WORDS: Final = 0x5810
"""And of the first one from it."""
_PEAK_TORQUE: Final = 3.0
"""Torque limit of an emulated PROFIdrive axis as a multiple of the rated torque."""


def object_dictionary(eds: str | None = None) -> canopen.ObjectDictionary:
    """Return the object dictionary of an EDS, by default of the servo drive's; shared, read-only."""
    from fieldbus.canopen.eds import shared_dictionary

    path = files("emulators.drive.cia402") / "servo.eds"
    return shared_dictionary(str(path) if eds is None else eds, node_id=1)


def dictionary_of(section: DriveSection | DeviceSection) -> canopen.ObjectDictionary:
    """Return the object dictionary of a drive or device of the bench file; treat it as read-only."""
    if getattr(section, "profile", "") in ("profidrive", "tm_pto", "tm41"):
        from emulators.drive.profidrive import profidrive_dictionary

        return profidrive_dictionary()
    return object_dictionary(section.eds)


def _machine(section: DriveSection) -> dict[str, Any]:
    """Return what a drive of any profile has: machine, motor, encoder, brake, supply, heat, safety inputs."""
    from emulators.drive.machine import (
        BrakeConfig,
        EncoderConfig,
        LinearAxisConfig,
        SwitchConfig,
    )
    from emulators.drive.tuning import ServoTuning

    mechanics, travel = section.mechanics, section.switches
    hysteresis = travel.hysteresis_mm / 1000.0
    switches = {}
    width = math.inf if travel.limit_width_mm is None else travel.limit_width_mm / 1000.0
    limit = partial(SwitchConfig, hysteresis=hysteresis, inverted=travel.normally_closed)
    if travel.negative_limit_mm is not None:
        place = travel.negative_limit_mm / 1000.0
        switches["negative_limit"] = limit(low=place - width, high=place)
    if travel.positive_limit_mm is not None:
        place = travel.positive_limit_mm / 1000.0
        switches["positive_limit"] = limit(low=place, high=place + width)
    for switch in ("home", "probe1", "probe2"):
        low, high = getattr(travel, f"{switch}_from_mm"), getattr(travel, f"{switch}_to_mm")
        if low is None and high is None:
            if switch != "home" or travel.home_mm is None:
                continue
            high = travel.home_mm
        switches[switch] = SwitchConfig(
            low=-math.inf if low is None else low / 1000.0,
            high=math.inf if high is None else high / 1000.0,
            # A probe is made for exactness: it springs back where it was touched.
            hysteresis=hysteresis if switch == "home" else 0.0,
        )
    stops = (mechanics.negative_stop_mm, mechanics.positive_stop_mm)
    return {
        "tuning": ServoTuning(
            velocity_time_constant_s=section.velocity_time_constant_ms / 1000.0,
            velocity_integral_time_s=section.velocity_time_constant_ms / 100.0,
            torque_feedforward=section.torque_precontrol,
        ),
        "mechanics": LinearAxisConfig(
            lead_screw_m=mechanics.lead_screw_mm / 1000.0,
            gear_ratio=mechanics.gear_numerator / mechanics.gear_denominator,
            motor_inertia_kgm2=mechanics.motor_inertia_kgm2,
            screw_inertia_kgm2=mechanics.screw_inertia_kgm2,
            load_mass_kg=mechanics.load_mass_kg,
            viscous_friction=mechanics.viscous_friction_n_per_m_s,
            coulomb_friction=mechanics.coulomb_friction_n,
            static_friction=mechanics.static_friction_n,
            gravity_force=mechanics.gravity_n,
            stops_m=(
                None if stops[0] is None else stops[0] / 1000.0,
                None if stops[1] is None else stops[1] / 1000.0,
            ),
            position_m=mechanics.start_position_mm / 1000.0,
            switches=switches,
            backlash_m=mechanics.backlash_mm / 1000.0,
        ),
        "encoder": EncoderConfig(
            kind=section.encoder,
            counts_per_revolution=section.increments_per_revolution,
            zero_mark_counts=section.index_increments,
        ),
        "brake": BrakeConfig(
            torque_Nm=section.brake.torque_nm,
            opening_time_s=section.brake.opening_time_ms / 1000.0,
            closing_time_s=section.brake.closing_time_ms / 1000.0,
        ),
        "supply": section.supply.build(),
        "thermal": section.thermal.build(),
        "thermal_time_constant_s": section.thermal.i2t_time_constant_s,
        "safety": section.safety.build(),
        "input_filter_s": travel.input_filter_ms / 1000.0,
        "rated_torque_Nm": section.rated_torque_nm,
        "power_on_delay_s": section.power_on_delay_ms / 1000.0,
        "blocked_time_s": section.blocked_time_ms / 1000.0,
    }


def drive_config(config: BenchConfig, name: str) -> DriveConfig:
    """Return the configuration of the emulated drive that `drive.NAME` describes."""
    from emulators.drive.cia402 import DriveConfig
    from emulators.drive.cia402.personality import load_personality

    section = config.drive[name]
    speed = round(section.max_speed_rpm * 1000)
    drive = DriveConfig(
        node_id=section.node_id,
        servo_period_ns=config.bench.servo_period_us * US,
        control_period_ns=max(1 * MS, config.bench.servo_period_us * US),
        **_machine(section),
        home_offset=section.homing.offset,
        homing_move=section.homing.move,
        hard_stop_methods=_hard_stop_methods(section.homing.hard_stop_methods),
        following_error_reaction=section.following_error,
        csv_interpolation=section.csv_interpolation,
        boot_time_s=section.boot_time_ms / 1000.0,
        # The axis watches the limit switches; a drive that stopped by itself would fight its ramp.
        limit_switch_reaction="none",
        sync_loss_reaction=section.sync_loss,
        sync_jitter=section.sync_jitter_percent / 100.0,
        missing_setpoints=section.missing_setpoints,
        eds=None if section.eds is None else Path(section.eds),
        storage=None if section.storage is None else Path(section.storage),
        # Velocities are in 10^-3 rpm (60A9h); so are the defaults, for controllers that leave them as they
        # are.
        objects={
            (0x607F, 0): speed,
            (0x6080, 0): round(section.max_speed_rpm),
            (0x60A9, 0): 0xFDB44700,
            (0x6081, 0): speed // 3,
            (0x6083, 0): round(speed / section.off1_ramp_s),
            (0x6084, 0): round(speed / section.off1_ramp_s),
            (0x6085, 0): round(speed / section.off3_ramp_s),
            (0x6099, 1): speed // 15,
            (0x6099, 2): speed // 150,
            (0x609A, 0): round(speed / section.off1_ramp_s),
            (0x60C2, 1): config.bench.cycle_ms,
            (0x60C2, 2): -3,
            (0x60C5, 0): 60_000_000,
            (0x60C6, 0): 60_000_000,
            (0x6092, 1): section.increments_per_revolution,
            (0x6092, 2): 1,
        },
    )
    drive = load_personality(section.personality).apply(drive)
    if "offset" in section.homing.model_fields_set:
        drive = replace(drive, home_offset=section.homing.offset)  # what the bench file says itself wins
    return drive


def profidrive_config(config: BenchConfig, name: str) -> ProfidriveConfig:
    """Return the configuration of the emulated PROFIdrive axis that `drive.NAME` describes, without its
    bus.
    """
    from emulators.drive.profidrive import DriveSettings, ProfidriveConfig
    from emulators.drive.profidrive.config import finest_xist2

    section = config.drive[name]
    own = section.profidrive
    limit = _PEAK_TORQUE * section.rated_torque_nm
    parts = _machine(section)
    return ProfidriveConfig(
        telegram=section.telegram,
        torque_telegram=own.torque_telegram,
        safety_telegram=own.safety_telegram,
        safe_motion=section.safety.build_motion(),
        encoder2=second_encoder_config(section.encoder2, section.mechanics.lead_screw_mm),
        cycle_ns=config.bench.cycle_ms * MS,
        servo_period_ns=config.bench.servo_period_us * US,
        control_period_ns=max(1 * MS, config.bench.servo_period_us * US),
        settings=DriveSettings(
            operating_mode=2 if section.positions else own.operating_mode,
            reference_speed_rpm=own.reference_speed_rpm,
            reference_torque_Nm=own.reference_torque_nm,
            max_speed_rpm=section.max_speed_rpm,
            ramp_up_s=own.ramp_up_s,
            ramp_down_s=section.off1_ramp_s,
            quick_stop_s=section.off3_ramp_s,
            torque_limits_Nm=(limit, limit),
            sign_of_life_tolerance=own.sign_of_life_tolerance,
            setpoint_monitoring_s=own.setpoint_monitoring_ms / 1000.0,
        ),
        fine_xist1=own.fine_resolution_bits,
        fine_xist2=finest_xist2(parts["encoder"]),
        interpolation=own.interpolation,
        isochronous=config.counts_life(section),
        positioner=section.positioner.build(),
        **parts,
    )


def _hard_stop_methods(changes: Mapping[str, str]) -> dict[int, str]:
    """Return the meaning of methods -1 to -4: that of the specification, changed by the bench file."""
    from emulators.drive.cia402 import DriveConfig

    methods = {**DriveConfig().hard_stop_methods, **{int(number): name for number, name in changes.items()}}
    return {number: name for number, name in methods.items() if name != "unsupported"}


def build_drive(
    scheduler: Scheduler,
    segments: Mapping[str, Any],
    config: BenchConfig,
    name: str,
    *,
    history: History,
    rng: Generator,
) -> CiA402Drive | ProfidriveCanDrive | ProfidriveModbusDrive | AnalogDrive | StepperCanDrive:
    """Return the emulated drive `name`, still switched off; one on Modbus hangs on no bus yet."""
    section = config.drive[name]
    scheduler = NodeClock(scheduler, lambda: rng.spawn(1)[0])
    if section.profile == "analog":
        return build_analog_drive(scheduler, config, name, _machine(section), history=history, rng=rng)
    if section.profile in ("tm_pto", "tm41"):
        mechanics = _machine(section)["mechanics"]
        return build_stepper(scheduler, segments[section.segment], config, name, mechanics, history=history)
    if config.segment[section.segment].on_modbus:
        return _modbus_drive(scheduler, config, name, history=history, rng=rng)
    if section.profile == "profidrive":
        from emulators.drive.profidrive import ProfidriveCanDrive, ProfidriveNodeConfig

        node = ProfidriveNodeConfig(
            node_id=section.node_id,
            drive=profidrive_config(config, name),
            boot_time_s=section.boot_time_ms / 1000.0,
            storage=None if section.storage is None else Path(section.storage),
        )
        return ProfidriveCanDrive(
            scheduler, segments[section.segment], node, name=name, history=history, rng=rng
        )
    from emulators.drive.cia402 import CiA402Drive

    return CiA402Drive(
        scheduler, segments[section.segment], drive_config(config, name), name=name, history=history, rng=rng
    )


def _modbus_drive(
    scheduler: Scheduler, config: BenchConfig, name: str, *, history: History, rng: Generator
) -> ProfidriveModbusDrive:
    from emulators.drive.profidrive.modbus import ProfidriveModbusConfig, ProfidriveModbusDrive

    section = config.drive[name]
    own = section.profidrive
    modbus = ProfidriveModbusConfig(
        unit=max(section.unit, 1),  # over TCP it answers every unit
        registers=section.map,
        drive=profidrive_config(config, name),
        setpoint_monitoring_s=own.setpoint_monitoring_ms / 1000.0,
        processing_ns=round(section.processing_ms * MS),
        boot_time_s=section.boot_time_ms / 1000.0,
    )
    return ProfidriveModbusDrive(scheduler, modbus, name=name, history=history, rng=rng)


def build_decoder(
    config: BenchConfig, ports: Mapping[str, CanPort], *, segment: str | None = None
) -> FrameDecoder:
    """Return a decoder that knows names, dictionary and commissioned mapping of every node, of one segment or
    of all.
    """
    from fieldbus.canopen.decode import FrameDecoder
    from hil.bench.encoders import encoder_dictionary

    def here(section: DriveSection | DeviceSection | EncoderSection) -> bool:
        on_can = not config.segment[section.segment].on_modbus
        return on_can and (segment is None or section.segment == segment)

    every: dict[str, DriveSection | DeviceSection] = {**config.drive, **config.device}
    made_of_eds = {name: section for name, section in every.items() if here(section)}
    names = {section.node_id: name for name, section in made_of_eds.items()}
    dictionaries = {section.node_id: dictionary_of(section) for section in made_of_eds.values()}
    for name, encoder in config.encoder.items():
        if here(encoder):
            names[encoder.node_id] = name
            dictionaries[encoder.node_id] = encoder_dictionary(encoder.type, encoder.profile)
    decoder = FrameDecoder({**names, 127: "controller"}, dictionaries)
    for name, port in ports.items():
        if name in made_of_eds:
            decoder.set_mapping(
                port.node_id, {(index, sub): value for index, sub, value in port.parameters()}
            )
    for name, section in config.drive.items():
        if here(section) and section.profile == "profidrive":
            telegram = getattr(ports.get(name), "telegram", None) or section.words()[0]
            for first, layout in ((_RECEIVE_WORDS, telegram.setpoint), (_SEND_WORDS, telegram.actual)):
                words = signal_words(section, layout)
                decoder.set_words(section.node_id, first, layout.words, words.describe)
    return decoder


def signal_words(section: DriveSection, layout: Layout) -> SignalWords:
    """Return the words for one direction of the telegram of a drive of the bench file."""
    from hil.bench.signal_words import SignalWords

    own = section.profidrive
    return SignalWords(
        layout, reference_speed_rpm=own.reference_speed_rpm, reference_torque_nm=own.reference_torque_nm
    )
