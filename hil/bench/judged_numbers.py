"""Numbers of the bench that judges of a trace need; the recorder keeps them with it (`Trace.constants`).

Those of an axis have the paths of its variables, as far as the object has them; what a user program
assigns later is in the trace as `program.write`. Those of a drive are what the bench file says, not what a
device makes of it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from hil.bench.drive_config import (
    WITH_RAMPS,
    AnalogDriveTable,
    Cia402DriveTable,
    ProfidriveCanTable,
    ProfidriveModbusTable,
)

if TYPE_CHECKING:
    from hil.bench.bench_config import BenchTable
    from hil.bench.drive_config import DriveTable
    from motion.s7.variables import VariableStore

VARIABLES: Final = (
    "Actor.InverseDirection",
    "Actor.RemoveEnableReaction",
    "Actor.Type",
    "Actor.MotorType",
    "DynamicAxisModel.VelocityTimeConstant",
    "DynamicDefaults.Acceleration",
    "DynamicDefaults.Deceleration",
    "DynamicDefaults.EmergencyDeceleration",
    "DynamicDefaults.Jerk",
    "DynamicDefaults.Velocity",
    "DynamicLimits.MaxAcceleration",
    "DynamicLimits.MaxDeceleration",
    "DynamicLimits.MaxJerk",
    "DynamicLimits.MaxVelocity",
    "DynamicLimits.Velocity",
    "FollowingError.AdditionalSetpointDelayTime",
    "FollowingError.EnableMonitoring",
    "FollowingError.MaxValue",
    "FollowingError.MinValue",
    "FollowingError.MinVelocity",
    "FollowingError.WarningLevel",
    "LoadGear.Denominator",
    "LoadGear.Numerator",
    "Mechanics.LeadScrew",
    "Modulo.Enable",
    "Modulo.Length",
    "Modulo.StartValue",
    "Override.Velocity",
    "PositionControl.ControlDifferenceQuantization.Mode",
    "PositionControl.EnableDSC",
    "PositionControl.Kpc",
    "PositionControl.Kv",
    "PositionControl.SmoothingTimeByChangeDifference",
    "PositionLimits_HW.Active",
    "PositionLimits_HW.ApproachBehavior",
    "PositionLimits_HW.MaxSwitchLevel",
    "PositionLimits_HW.MinSwitchLevel",
    "PositionLimits_HW.Mode",
    "PositionLimits_SW.Active",
    "PositionLimits_SW.LimitExceededBehavior",
    "PositionLimits_SW.LimitReachedBehavior",
    "PositionLimits_SW.MaxPosition",
    "PositionLimits_SW.MinPosition",
    "PositioningMonitoring.MinDwellTime",
    "PositioningMonitoring.ToleranceTime",
    "PositioningMonitoring.Window",
    "Properties.MotionType",
    "Sensor[1].ActualVelocityMode",
    "Sensor[1].Backlash.Enable",
    "Sensor[1].Backlash.Size",
    "Sensor[1].DataAdaption",
    "Sensor[1].InverseDirection",
    "Sensor[1].MountingMode",
    "Sensor[1].Parameter.FineResolutionXist1",
    "Sensor[1].Parameter.StepsPerRevolution",
    "Sensor[1].System",
    "Sensor[1].Type",
    "SetpointFilter.DynamicFilter.Mode",
    "Simulation.Mode",
    "StandstillSignal.MinDwellTime",
    "StandstillSignal.VelocityThreshold",
    "TorquePreControl.Mode",
    "VirtualAxis.Mode",
)
"""Variables of an axis, in the units of the runtime."""


def numbers_of_axis(store: VariableStore) -> dict[str, float]:
    """Return the values in force of `VARIABLES`, by path."""
    known = set(store.paths())
    return {path: float(store.bind(path).value) for path in VARIABLES if path in known}


def numbers_of_drive(section: DriveTable, bench: BenchTable) -> dict[str, float]:
    """Return what a bench file says of a drive: rpm, s, Nm, m, increments."""
    numbers: dict[str, float] = {
        "max_speed_rpm": section.max_speed_rpm,
        "increments_per_revolution": section.increments_per_revolution,
        "reference_speed_rpm": section.reference_speed_rpm,
        "reference_torque_nm": section.reference_torque_nm,
        "grace_cycles": bench.grace_cycles,
        "emulated": section.device == "emulated",
        "live": bench.live,
    }
    if isinstance(section, WITH_RAMPS):
        numbers |= {"off1_ramp_s": section.off1_ramp_s, "off3_ramp_s": section.off3_ramp_s}
    if isinstance(section, Cia402DriveTable | ProfidriveCanTable | ProfidriveModbusTable | AnalogDriveTable):
        numbers |= {
            "rated_torque_nm": section.rated_torque_nm,
            "brake_torque_nm": section.brake.torque_nm,
            "brake_opening_s": section.brake.opening_time_ms / 1000.0,
            "brake_closing_s": section.brake.closing_time_ms / 1000.0,
            "velocity_time_constant_s": section.velocity_time_constant_ms / 1000.0,
        }
    if isinstance(section, ProfidriveCanTable | ProfidriveModbusTable):
        # MOMRED scales the drive's own limits: with others than the reference torque the axis is not exact.
        numbers["momred_gain"] = section.torque_limit_nm / section.reference_torque_nm
    if isinstance(section, Cia402DriveTable | ProfidriveCanTable):
        numbers |= {
            f"node.{section.segment}": section.node_id,
            "heartbeat_s": section.heartbeat_ms / 1000.0,
            "consumer_heartbeat_s": section.consumer_heartbeat_ms / 1000.0,
        }
    if isinstance(section, Cia402DriveTable):
        numbers |= {
            "cia402": 1.0,
            "standard": section.personality == "standard",
            "standard_mapping": section.eds is None and not section.pdo.mapped,
            "sync_loss_fault": section.sync_loss == "fault",
            "missing_setpoints": section.missing_setpoints,
            "torque_precontrol": section.torque_precontrol,
            "interpolation": section.csv_interpolation,
        }
    if isinstance(section, ProfidriveCanTable | ProfidriveModbusTable):
        numbers |= {
            "telegram": section.telegram,
            "fine_resolution_bits": section.fine_resolution_bits,
            "operating_mode": section.profidrive.operating_mode,
            "interpolation": section.profidrive.interpolation,
            "sign_of_life_tolerance": section.profidrive.sign_of_life_tolerance,
            "setpoint_monitoring_s": section.profidrive.setpoint_monitoring_ms / 1000.0,
            "sign_of_life": section.counts_life(live=bench.live),
        }
        telegram = section.named_telegram()[0]
        for side, layout in (("setpoint", telegram.setpoint), ("actual", telegram.actual)):
            words = {name: layout.offset(name) // 2 for name in layout.names if name != "FREE"}
            numbers |= {f"{side}.{name}": place for name, place in words.items()}
            numbers[f"{side}.words"] = layout.words
    machine = section.machine
    if machine is not None and section.device == "emulated":
        numbers |= {
            "lead_m": machine.lead_screw_mm / 1000.0,
            "gear_ratio": -machine.gear_ratio if machine.reversed else machine.gear_ratio,
            "backlash_m": machine.backlash_mm / 1000.0,
        }
        if machine.gravity_n:
            numbers["gravity_n"] = machine.gravity_n
        force_per_torque = math.tau * machine.gear_ratio / (machine.lead_screw_mm / 1000.0)
        inertia_kgm2 = machine.motor_inertia_kgm2 + machine.load_at_motor_kgm2
        numbers |= {
            "moved_kg": inertia_kgm2 * force_per_torque**2,
            "coulomb_friction_n": machine.coulomb_friction_n,
            "viscous_friction_n_per_m_s": machine.viscous_friction_n_per_m_s,
        }
        stops_mm = {"negative_stop": machine.negative_stop_mm, "positive_stop": machine.positive_stop_mm}
        numbers |= {side: stop_mm / 1000.0 for side, stop_mm in stops_mm.items() if stop_mm is not None}
    return numbers
