"""Parts of the kernel, made as the variables of a technology object describe them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from math import tau
from typing import TYPE_CHECKING, Final

from motion.kernel.backlash import Backlash, BacklashSettings
from motion.kernel.leading_value import Extrapolation, LeadingValue
from motion.kernel.mechanics import MOTOR_SIDE, EncoderData, EncoderScale, Mechanics
from motion.kernel.modulo import NO_MODULO, Modulo
from motion.kernel.monitoring import MonitoringLimits
from motion.kernel.position_control import PositionControl, PositionController
from motion.kernel.setpoint_filter import DynamicFilter
from motion.kernel.simulation import SimulatedControl, SimulatedPort, VirtualControl
from motion.kernel.torque_precontrol import TorquePrecontrol
from motion.s7.units import ANGLES, LENGTHS, millimetres, per_revolution

if TYPE_CHECKING:
    from motion.kernel.feedback import Feedback
    from motion.kernel.leading_value import Value
    from motion.s7.variables import VariableStore

_LINEAR_SYSTEM: Final = 0
_ROTARY: Final = 1
_LINEAR_MOTOR: Final = 1


def modulo_of(store: VariableStore) -> Modulo:
    """Return the modulo range by `Modulo.*`."""
    length, start = store.read("Modulo.Length"), store.read("Modulo.StartValue")
    return Modulo(length, start) if store.read("Modulo.Enable") else NO_MODULO


def sensor_prefixes(store: VariableStore) -> list[str]:
    """Return where the variables of the encoders that exist begin; none for a speed axis."""
    if store.object_type == "SpeedAxis":
        return []
    if store.object_type == "ExternalEncoder":
        return ["Sensor"]
    return [f"Sensor[{number}]" for number in range(1, 5) if store.read(f"Sensor[{number}].Existent")]


def _ratio(store: VariableStore, path: str) -> Fraction:
    return Fraction(store.read_int(f"{path}.Numerator"), store.read_int(f"{path}.Denominator"))


def _encoder_data(store: VariableStore, prefix: str) -> EncoderData:
    read, whole = store.read, store.read_int
    parameter = f"{prefix}.Parameter."
    external = store.object_type == "ExternalEncoder"
    linear = read(f"{prefix}.System") == _LINEAR_SYSTEM
    return EncoderData(
        kind=whole(f"{prefix}.Type"),
        linear=linear,
        inverse=store.read_bool(f"{prefix}.InverseDirection"),
        mounting=MOTOR_SIDE if external else whole(f"{prefix}.MountingMode"),
        gear=Fraction(1) if external else _ratio(store, f"{prefix}.MeasuringGear"),
        steps=whole(f"{parameter}StepsPerRevolution"),
        resolution=read(f"{parameter}Resolution"),
        distance=0.0 if external else read(f"{parameter}DistancePerRevolution"),
        fine_bits=whole(f"{parameter}FineResolutionXist1"),
        revolutions=whole(f"{parameter}DeterminableRevolutions"),
        full_width=read(f"{parameter}BehaviorGx_XIST1") != 0,
        velocity_from_drive=read(f"{prefix}.ActualVelocityMode") == 1,
        reference=read(f"{parameter}{'ReferenceVelocity' if linear else 'ReferenceSpeed'}"),
        unit_mm=millimetres(whole("Units.LengthUnit")) if linear else 1.0,
    )


def mechanics_of(store: VariableStore, *, apart: Sequence[bool] = ()) -> Mechanics:
    """Return the ratios of a technology object (CFG section 25).

    Args:
        store: Its variables.
        apart: For every encoder in turn, whether it has a telegram of its own: its velocity is then one
            of the encoder, and not one of the motor (CFG-340).

    """
    read = store.read
    load_gear = _ratio(store, "LoadGear")
    gear = float(load_gear)
    external = store.object_type == "ExternalEncoder"
    direction = -1.0 if not external and read("Actor.InverseDirection") else 1.0
    if store.object_type == "SpeedAxis":
        return Mechanics(gear * direction)
    unit = store.read_int("Units.LengthUnit")
    rotary = read("Properties.MotionType") == _ROTARY
    travel = per_revolution(unit) if rotary else read("Mechanics.LeadScrew")
    linear_motor = not external and read("Actor.MotorType") == _LINEAR_MOTOR
    per_unit = 60.0 * millimetres(unit) / 1000.0 if linear_motor else 60.0 / travel * gear
    rpm_per_unit = per_unit * direction
    scales = []
    for at, prefix in enumerate(sensor_prefixes(store)):
        own = apart[at] if at < len(apart) else external
        scales.append(
            EncoderScale.of(
                _encoder_data(store, prefix),
                load_gear=load_gear,
                travel=travel,
                motor_unit_per_rpm=None if own else 1.0 / rpm_per_unit,
            )
        )
    return Mechanics(rpm_per_unit, travel, tuple(scales))


def leading_value_of(
    store: VariableStore,
    *,
    cycle_s: float,
    acquisition_s: float,
    feedback: Callable[[], Feedback],
    setpoint: Callable[[], Value],
) -> LeadingValue:
    """Return what an object gives to followers, by `Extrapolation.*`; the arguments as in `LeadingValue`."""
    read, bind = store.read, store.bind
    settings = Extrapolation(
        system_defined=read("Extrapolation.Settings.SystemDefinedExtrapolation") == 1,
        differentiates=read("Extrapolation.Settings.ExtrapolatedVelocityMode") == 1,
        delay_s=read("CrossPlcSynchronousOperation.LocalLeadingValueDelayTime"),
        following_s=bind("Extrapolation.FollowingAxisDependentTime"),
        position_t1=bind("Extrapolation.PositionFilter.T1"),
        position_t2=bind("Extrapolation.PositionFilter.T2"),
        velocity_t1=bind("Extrapolation.VelocityFilter.T1"),
        velocity_t2=bind("Extrapolation.VelocityFilter.T2"),
        tolerance=bind("Extrapolation.VelocityTolerance.Range"),
        hysteresis=bind("Extrapolation.Hysteresis.Value"),
    )
    return LeadingValue(
        settings, cycle_s=cycle_s, acquisition_s=acquisition_s, feedback=feedback, setpoint=setpoint
    )


def dynamic_filter_of(
    store: VariableStore, cycle_s: float, *, precontrol: bool = False
) -> DynamicFilter | None:
    """Return the filter that the variables of an axis ask for, None without one (CTL-062).

    Args:
        store: Variables of a positioning axis.
        cycle_s: Servo cycle, s.
        precontrol: Whether torque is precontrolled, which has to be ahead of position and velocity.

    """
    bind = store.bind
    mode = store.read_int("SetpointFilter.DynamicFilter.Mode")
    lead = bind("DynamicAxisModel.CurrentTimeConstant") if precontrol else None
    if not mode and lead is None:
        return None
    prefix = "SetpointFilter.DynamicFilter."
    times = (bind(f"{prefix}T1"), bind(f"{prefix}T2"), bind(f"{prefix}Tt"))
    return DynamicFilter(mode, times, cycle_s=cycle_s, lead=lead)


def torque_precontrol_of(store: VariableStore) -> TorquePrecontrol:
    """Return the torque pre-control of a positioning axis (CFG section 27)."""
    read, bind = store.read, store.bind
    scale, load_inertia = bind("TorquePreControl.Scale"), bind("Actor.LoadInertia")
    unit = store.read_int("Units.LengthUnit")
    if read("Actor.MotorType") == _LINEAR_MOTOR:
        return TorquePrecontrol(
            scale=scale,
            motor=bind("Actor.LinearMotorDriveParameter.MotorMass"),
            load=load_inertia,
            per_motor=LENGTHS[unit],
            per_load=LENGTHS[unit],
        )
    gear = read("LoadGear.Numerator") / read("LoadGear.Denominator")
    if read("Properties.MotionType") == _ROTARY:
        load_rad, load = ANGLES[unit], 1.0
    else:
        load_rad = tau / read("Mechanics.LeadScrew")
        load = (read("Mechanics.LeadScrew") * LENGTHS[unit] / tau) ** 2
    return TorquePrecontrol(
        scale=scale,
        motor=bind("Actor.DriveParameter.MotorInertia"),
        load=load_inertia,
        per_motor=load_rad * gear,
        per_load=load_rad / gear * load,
    )


def backlash_of(store: VariableStore, feedback: Feedback, prefix: str, cycle_s: float) -> Backlash:
    """Return the compensation of the encoder whose variables begin with `prefix`."""
    bind = store.bind
    settings = BacklashSettings(
        enabled=bind(f"{prefix}.Backlash.Enable"),
        size=bind(f"{prefix}.Backlash.Size"),
        velocity=bind(f"{prefix}.Backlash.Velocity"),
        homing_direction=bind(f"{prefix}.Backlash.DirectionAbsoluteHoming"),
    )
    adjusted = store.read(f"Status{prefix}.Adjusted") == 1
    return Backlash(feedback, settings, cycle_s=cycle_s, adjusted=adjusted)


def position_control_of(
    store: VariableStore,
    port: SimulatedPort | None,
    dynamic_filter: DynamicFilter | None,
    *,
    virtual: bool,
    acceleration: Callable[[], float],
    cycle_s: float,
    delay_s: float,
    in_drive: bool,
) -> PositionControl:
    """Return the position control of an axis.

    Args:
        store: Its variables.
        port: Its simulated port; None with a drive.
        dynamic_filter: What the setpoints pass before; None = nothing.
        virtual: It repeats its setpoints.
        acceleration: Returns the acceleration of the setpoints, behind the filter.
        cycle_s: Servo cycle, s.
        delay_s: Transport delay from setpoint to actual value, s.
        in_drive: The drive closes the loop (DSC).

    """
    bind = store.bind
    if port is None:
        return PositionController(
            kv=bind("PositionControl.Kv"),
            kpc=bind("PositionControl.Kpc"),
            time_constant=bind("DynamicAxisModel.VelocityTimeConstant"),
            additional_delay=bind("FollowingError.AdditionalSetpointDelayTime"),
            smoothing=bind("PositionControl.SmoothingTimeByChangeDifference"),
            cycle_s=cycle_s,
            delay_s=delay_s,
            dynamic_filter=dynamic_filter,
            in_drive=in_drive,
        )
    if virtual:
        return VirtualControl(port, cycle_s=cycle_s, acceleration=acceleration, dynamic_filter=dynamic_filter)
    return SimulatedControl(
        port,
        kv=bind("PositionControl.Kv"),
        kpc=bind("PositionControl.Kpc"),
        time_constant=bind("DynamicAxisModel.VelocityTimeConstant"),
        additional=bind("DynamicAxisModel.AdditionalPositionTimeConstant"),
        in_drive=store.read_bool("PositionControl.EnableDSC"),
        cycle_s=cycle_s,
        dynamic_filter=dynamic_filter,
    )


def monitoring_limits_of(store: VariableStore) -> MonitoringLimits:
    """Return what the monitoring of a positioning axis compares with."""
    bind = store.bind
    return MonitoringLimits(
        following_error=bind("FollowingError.EnableMonitoring"),
        min_error=bind("FollowingError.MinValue"),
        max_error=bind("FollowingError.MaxValue"),
        min_velocity=bind("FollowingError.MinVelocity"),
        max_velocity=bind("DynamicLimits.MaxVelocity"),
        warning_level=bind("FollowingError.WarningLevel"),
        tolerance_s=bind("PositioningMonitoring.ToleranceTime"),
        dwell_s=bind("PositioningMonitoring.MinDwellTime"),
        window=bind("PositioningMonitoring.Window"),
        standstill_velocity=bind("StandstillSignal.VelocityThreshold"),
        standstill_dwell_s=bind("StandstillSignal.MinDwellTime"),
    )
