"""Golden numbers of an axis of the bench: its limits, and the ramp times of its drive."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fieldbus.clock import S
from fieldbus.errors import ConfigurationError
from hil.bench.drive_config import WITH_RAMPS, AnalogDriveTable
from hil.expect.golden import ReferenceAxis

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
    section = config.drive[drive]
    if isinstance(section, WITH_RAMPS):
        off1_s, off3_s = section.off1_ramp_s, section.off3_ramp_s
    elif isinstance(section, AnalogDriveTable):
        off1_s = off3_s = section.off3_ramp_s  # it has one ramp
    else:
        raise ConfigurationError(
            "bench.golden", axis.name, f"an axis whose drive has ramps; {drive} has none"
        )

    def read(path: str) -> float:
        return float(axis.var(path))

    velocity = read("DynamicDefaults.Velocity")
    return ReferenceAxis(
        maximum_velocity=read("DynamicLimits.MaxVelocity"),
        maximum_deceleration=read("DynamicLimits.MaxDeceleration"),
        maximum_jerk=read("DynamicLimits.MaxJerk"),
        emergency_deceleration=read("DynamicDefaults.EmergencyDeceleration"),
        default_velocity=velocity,
        default_deceleration=read("DynamicDefaults.Deceleration"),
        default_jerk=read("DynamicDefaults.Jerk"),
        lead_mm=60.0 / axis.object.mechanics.rpm_per_unit,
        maximum_speed_rpm=section.max_speed_rpm,
        off1_time_s=off1_s,
        off3_time_s=off3_s,
        cycle_s=cycle_ns / S,
        start_velocity=velocity,
    )
