"""What the technology data block shows of a running axis, under the original paths (VAR section 8)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from motion.axis.status import status_word, status_word2
from motion.drives.port import ZSW1

if TYPE_CHECKING:
    from motion.axis.axis import TechnologyAxis
    from motion.axis.feedback import Feedback

Live = dict[str, Callable[[], Any]]


def live_variables(axis: TechnologyAxis) -> Live:
    """Return a reader for every variable that the runtime does not keep in the store."""
    engine = axis.alarms.engine
    motion = axis.motion
    live: Live = {
        "Velocity": lambda: motion.total.v,
        "Acceleration": lambda: motion.total.a,
        "ActualSpeed": lambda: _actual_speed(axis),
        "VelocitySetpoint": lambda: (
            0.0 if axis.virtual else axis.speed_output_rpm / axis.mechanics.rpm_per_unit
        ),
        "StatusDrive.InOperation": lambda: axis.in_operation,
        "StatusDrive.CommunicationOK": lambda: axis.communication_ok,
        "StatusDrive.Error": lambda: bool(axis.port.zsw1 & ZSW1.FAULT),
        "StatusWord": lambda: status_word(axis),
        "StatusWord2": lambda: status_word2(axis),
        "ErrorWord": lambda: engine.error_word,
        "WarningWord": lambda: engine.warning_word,
        "ErrorDetail.Number": lambda: engine.number,
        "ErrorDetail.Reaction": lambda: engine.reaction,
        "StatusTorqueData.ActualTorque": lambda: axis.port.actual_torque_nm,
        "StatusTorqueData.CommandAdditiveTorqueActive": lambda: int(axis.torque.additive is not None),
        "StatusTorqueData.CommandTorqueRangeActive": lambda: int(axis.torque.range_nm is not None),
    }
    if axis.has_position:
        live |= _position(axis)
        for number in range(1, len(axis.sensors) + 1):
            live |= _sensor(axis, number)
    return live


def _actual_speed(axis: TechnologyAxis) -> float:
    """Return `ActualSpeed`: 0.0 for a virtual axis, an analog drive and a linear motor (VAR-123, CFG-143)."""
    read = axis.variables.read
    if axis.virtual or read("Actor.Type") == 0 or (axis.has_position and read("Actor.MotorType") == 1):
        return 0.0
    return axis.port.actual_speed_rpm


def _position(axis: TechnologyAxis) -> Live:
    motion = axis.motion

    def target() -> float:
        return motion.destination or 0.0

    def actual_acceleration() -> float:
        feedback = axis.feedback
        if axis.virtual:
            return motion.total.a
        return (feedback.velocity - feedback.last_velocity) / axis.cycle_s

    return {
        "Position": lambda: axis.modulo.wrap(motion.total.s),
        "ModuloCycle": lambda: axis.modulo.cycle(motion.total.s),
        "ActualPosition": lambda: axis.modulo.wrap(axis.feedback.position),
        "ActualModuloCycle": lambda: axis.modulo.cycle(axis.feedback.position),
        "ActualVelocity": lambda: axis.feedback.velocity,
        "ActualAcceleration": actual_acceleration,
        "OperativeSensor": lambda: axis.operative_sensor,
        "StatusTorqueData.TotalTorqueAdditive": lambda: axis.torque.total_additive_nm,
        "StatusPositioning.SuperimposedDistance": lambda: motion.superimposed_distance,
        "StatusPositioning.FollowingError": lambda: axis.controller.following_error,
        "StatusPositioning.TargetPosition": lambda: axis.modulo.wrap(target()),
        "StatusPositioning.TargetPositionModuloCycle": lambda: axis.modulo.cycle(target()),
        "StatusPositioning.Distance": lambda: target() - motion.total.s,
        "StatusServo.ControlDifference": lambda: axis.controller.control_difference,
        "StatusServo.BalancedPosition": lambda: (
            0.0 if axis.virtual else axis.modulo.wrap(axis.controller.balanced_position)
        ),
        "StatusServo.PositionAfterDynamicFilter": lambda: axis.modulo.wrap(motion.total.s),
    }


def _sensor(axis: TechnologyAxis, number: int) -> Live:
    prefix = f"StatusSensor[{number}]."

    def sensor() -> Feedback:
        return axis.sensors[number - 1]

    return {
        f"{prefix}State": lambda: sensor().state,
        f"{prefix}Position": lambda: axis.modulo.wrap(sensor().position),
        f"{prefix}ModuloCycle": lambda: axis.modulo.cycle(sensor().position),
        f"{prefix}Velocity": lambda: sensor().velocity,
        f"{prefix}CommunicationOK": lambda: sensor().source.link_ok,
        f"{prefix}Error": lambda: sensor().source.sensor_fault,
        f"{prefix}Control": lambda: axis.operative_sensor == number,
    }


def unit_names(axis: TechnologyAxis) -> tuple[tuple[str, str], ...]:
    """Return the columns of the trace in the units of the axis."""
    unit = axis.variables.unit("Position")
    names = {"mm": unit, "mm/s": f"{unit}/s", "mm/s2": f"{unit}/s2"}
    return tuple((name, names.get(token, token)) for name, token in axis.trace_columns)
