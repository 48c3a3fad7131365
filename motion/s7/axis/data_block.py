"""What the technology data block shows of a running axis, under the original paths (VAR section 8)."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from motion.drives.port import ZSW1
from motion.kernel.leading_value import live_leading_value
from motion.s7.axis.status import status_word, status_word2

if TYPE_CHECKING:
    from motion.kernel.feedback import Feedback
    from motion.s7.axis.axis import TechnologyAxis
    from motion.s7.variables import VariableStore

Live = dict[str, Callable[[], Any]]


def live_variables(axis: TechnologyAxis) -> Live:
    """Return a reader for every variable that the runtime does not keep in the store."""
    engine = axis.alarms.engine
    motion = axis.motion
    live: Live = {
        "Velocity": lambda: motion.total.v if axis.facts.controlled else axis.actual_velocity,
        "Acceleration": lambda: motion.total.a if axis.facts.controlled else _actual_acceleration(axis),
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
        "StatusTorqueData.CommandAdditiveTorqueActive": lambda: int(axis.torque.additive is not None),
        "StatusTorqueData.CommandTorqueRangeActive": lambda: int(axis.torque.range_nm is not None),
        "StatusMotionIn.FunctionState": lambda: axis.motion.motion_in_state,
        "StatusMotionIn.StatusWord": lambda: int(axis.motion.motion_in_exceeds),
    }
    live |= _torque(axis)
    if axis.has_position:
        live |= _position(axis)
        for number in range(1, len(axis.sensors) + 1):
            live |= _sensor(axis, number)
    return in_its_units(live, axis.variables)


def frozen(live: Live) -> Live:
    """Return readers of what `live` says now, for the time in which the object is being initialised
    (VAR-228).
    """
    return {path: partial(_kept, reader()) for path, reader in live.items()}


def _kept(value: Any) -> Any:
    return value


def in_its_units(live: Live, store: VariableStore) -> Live:
    """Return the readers of what the object has, in its units in place of those of the runtime (CFG-072)."""
    known = set(store.paths())
    found = {}
    for path, reader in live.items():
        if path in known:
            factor = store.factors.of(store.describe(path).unit)
            found[path] = reader if factor == 1.0 else partial(_converted, reader, factor)
    return found


def _converted(reader: Callable[[], float], factor: float) -> float:
    return reader() / factor


def _torque(axis: TechnologyAxis) -> Live:
    """Return the torques of a standard motor, or the forces of a linear one (VAR-118, VAR-119)."""

    def linear() -> bool:
        return axis.has_position and bool(axis.variables.read("Actor.MotorType") == 1)

    live: Live = {
        "StatusTorqueData.ActualTorque": lambda: 0.0 if linear() else axis.port.actual_torque_nm,
    }
    if axis.has_position:
        live |= {
            "StatusTorqueData.ActualForce": lambda: axis.port.actual_torque_nm if linear() else 0.0,
            "StatusTorqueData.TotalTorqueAdditive": lambda: (
                0.0 if linear() else axis.torque.total_additive_nm
            ),
            "StatusTorqueData.TotalForceAdditive": lambda: axis.torque.total_additive_nm if linear() else 0.0,
        }
    return live


def _actual_speed(axis: TechnologyAxis) -> float:
    """Return `ActualSpeed`: 0.0 for a virtual axis, an analog drive and a linear motor (VAR-123, CFG-143)."""
    read = axis.variables.read
    if axis.virtual or read("Actor.Type") == 0 or (axis.has_position and read("Actor.MotorType") == 1):
        return 0.0
    return axis.port.actual_speed_rpm


def _actual_acceleration(axis: TechnologyAxis) -> float:
    """Return the change of the actual velocity in the last cycle; 0.0 without an encoder."""
    if not axis.has_position or axis.virtual:
        return 0.0
    feedback = axis.feedback
    return (feedback.velocity - feedback.last_velocity) / axis.cycle_s


def _position(axis: TechnologyAxis) -> Live:
    motion = axis.motion

    def target() -> float:
        return motion.destination or 0.0

    def filtered() -> float:
        dynamic_filter = axis.controller.filter
        return axis.modulo.wrap(motion.total.s if dynamic_filter is None else dynamic_filter.position)

    def given_acceleration() -> float:
        dynamic_filter = axis.controller.filter
        return motion.total.a if dynamic_filter is None else dynamic_filter.acceleration

    return live_leading_value(lambda: axis.leading_value, lambda: axis.modulo) | {
        "StatusPositioning.SetpointExecutionTime": axis.setpoint_execution_s,
        "Position": lambda: axis.modulo.wrap(motion.total.s),
        "ModuloCycle": lambda: axis.modulo.cycle(motion.total.s),
        "ActualPosition": lambda: axis.feedback.place(axis.modulo)[1],
        "ActualModuloCycle": lambda: axis.feedback.place(axis.modulo)[0],
        "ActualVelocity": lambda: axis.feedback.velocity,
        "ActualAcceleration": lambda: given_acceleration() if axis.virtual else _actual_acceleration(axis),
        "OperativeSensor": lambda: axis.operative_sensor,
        "StatusPositioning.SuperimposedDistance": lambda: motion.superimposed_distance,
        "StatusPositioning.FollowingError": lambda: axis.controller.following_error,
        "StatusPositioning.TargetPosition": lambda: axis.modulo.wrap(target()),
        "StatusPositioning.TargetPositionModuloCycle": lambda: axis.modulo.cycle(target()),
        "StatusPositioning.Distance": lambda: target() - motion.total.s,
        "StatusServo.ControlDifference": lambda: axis.controller.control_difference,
        "StatusServo.BalancedPosition": lambda: (
            0.0 if axis.virtual else axis.modulo.wrap(axis.controller.balanced_position)
        ),
        "StatusServo.PositionAfterDynamicFilter": filtered,
    }


def _sensor(axis: TechnologyAxis, number: int) -> Live:
    prefix = f"StatusSensor[{number}]."

    def sensor() -> Feedback:
        return axis.sensors[number - 1]

    return {
        f"{prefix}State": lambda: sensor().state,
        f"{prefix}Position": lambda: sensor().place(axis.modulo)[1],
        f"{prefix}ModuloCycle": lambda: sensor().place(axis.modulo)[0],
        f"{prefix}Velocity": lambda: sensor().velocity,
        f"{prefix}CommunicationOK": lambda: sensor().source.link_ok,
        f"{prefix}Error": lambda: sensor().source.sensor_fault,
        f"{prefix}Control": lambda: axis.operative_sensor == number,
    }


def unit_names(axis: TechnologyAxis) -> tuple[tuple[str, str], ...]:
    """Return the columns of the trace: velocities in position units per second, whatever the velocity unit of
    the axis is.
    """
    unit = axis.variables.unit("Position")
    names = {"mm": unit, "mm/s": f"{unit}/s", "mm/s2": f"{unit}/s2"}
    if axis.variables.read("Actor.MotorType") == 1:
        names |= {"rpm": "m/min", "Nm": "N"}
    return tuple((name, names.get(token, token)) for name, token in axis.trace_columns)
