"""Golden numbers of an axis of the bench: its limits, and the ramp times of its drive."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fieldbus.clock import S
from fieldbus.errors import ConfigurationError
from hil.bench.drive_config import WITH_RAMPS, AnalogDriveTable
from hil.expect.golden import ReferenceAxis
from motion.s7.units import velocity_factor

if TYPE_CHECKING:
    from hil.bench.config import BenchConfig
    from motion.s7.handles import AxisHandle


def axis_numbers(config: BenchConfig, axis: AxisHandle, cycle_ns: int) -> ReferenceAxis:
    """Return the numbers from which ramps of an axis follow by formula.

    Args:
        config: The bench file.
        axis: The axis; its variables have the values of the bench file, and of the program since.
        cycle_ns: Bus cycle, ns.

    Raises:
        ConfigurationError: The drive of the axis has no ramps of its own.

    """
    drive = config.axis[axis.name].drive
    section = config.drive.get(drive)
    if isinstance(section, WITH_RAMPS):
        off1_s, off3_s = section.off1_ramp_s, section.off3_ramp_s
    elif isinstance(section, AnalogDriveTable):
        off1_s = off3_s = section.off3_ramp_s  # it has one ramp
    else:
        raise ConfigurationError(
            "bench.golden", axis.name, f"an axis whose drive has ramps; {drive or 'it'} has none"
        )

    def read(path: str) -> float:
        # In position units and s, whatever the unit of velocity is.
        return float(axis.variables.bind(path).value)

    velocity = read("DynamicDefaults.Velocity")
    lead = abs(60.0 / axis.object.mechanics.rpm_per_unit)
    machine = section.machine
    return ReferenceAxis(
        maximum_velocity=read("DynamicLimits.MaxVelocity"),
        maximum_acceleration=read("DynamicLimits.MaxAcceleration"),
        maximum_deceleration=read("DynamicLimits.MaxDeceleration"),
        maximum_jerk=read("DynamicLimits.MaxJerk"),
        emergency_deceleration=read("DynamicDefaults.EmergencyDeceleration"),
        default_velocity=velocity,
        default_acceleration=read("DynamicDefaults.Acceleration"),
        default_deceleration=read("DynamicDefaults.Deceleration"),
        default_jerk=read("DynamicDefaults.Jerk"),
        lead_mm=lead,
        maximum_speed_rpm=section.max_speed_rpm,
        off1_time_s=off1_s,
        off3_time_s=off3_s,
        cycle_s=cycle_ns / S,
        start_velocity=velocity,
        velocity_unit=_velocity_unit(axis),
        machine_m=0.0 if machine is None else machine.lead_screw_mm / 1000.0 / machine.gear_ratio / lead,
    )


def _velocity_unit(axis: AxisHandle) -> float:
    read = axis.variables.read
    if axis.variables.object_type == "SpeedAxis":
        return 1.0
    return velocity_factor(int(read("Units.VelocityUnit")), int(read("Units.LengthUnit")))
