"""What the technology data block shows of a running axis, under the original paths (VAR section 8)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from motion.drives.port import ZSW1
from motion.kernel.cams import ScaledCurve
from motion.kernel.simulation import VirtualControl
from motion.kernel.synchronous import FunctionCoupling
from motion.s7.axis.technology_object import Live, in_its_units, live_alarms, live_leading_value

if TYPE_CHECKING:
    from motion.kernel.feedback import Feedback
    from motion.kernel.leading_value import LeadingValue
    from motion.kernel.servo_axis import ServoAxis
    from motion.kernel.synchronous import Coupling
    from motion.s7.alarms import AlarmEngine
    from motion.s7.axis.motion import MotionControl
    from motion.s7.axis.torque import TorqueControl
    from motion.s7.variables import VariableStore


IN_SIMULATION: Final = 1 << 3
"""Bit of `StatusSynchronizedMotion.StatusWord`: the synchronous operation is simulated (SYN-045)."""
ADDITIVE_COMMAND: Final = 1 << 4
"""Bit of `StatusSynchronizedMotion.StatusWord`: an additive leading value is given (SYN-046)."""
_ROUNDING: Final = 1.0 + 1e-9


@dataclass(frozen=True, kw_only=True)
class Shown:
    """The parts of an axis whose values its data block shows.

    Args:
        variables: Its variables.
        engine: Its pending alarms.
        servo: The axis in the kernel.
        states: State of the servo.
        motion: Its jobs.
        torque: Its torque functions.
        status_word: Returns `StatusWord`.
        status_word2: Returns `StatusWord2`.
        execution_s: Returns `StatusPositioning.SetpointExecutionTime`, s.
        leading_value: Returns what followers get.
        follows: Whether it is a synchronous axis.
        leader_number: Returns the number of the data block of the leading object in use, 0 for none.

    """

    variables: VariableStore
    engine: AlarmEngine
    servo: ServoAxis
    motion: MotionControl
    torque: TorqueControl
    status_word: Callable[[], int]
    status_word2: Callable[[], int]
    execution_s: Callable[[], float]
    leading_value: Callable[[], LeadingValue]
    follows: bool
    leader_number: Callable[[], int]


def live_variables(shown: Shown) -> Live:
    """Return a reader for every variable that the runtime does not keep in the store."""
    servo, motion, torque = shown.servo, shown.motion, shown.torque
    live: Live = {
        "Velocity": lambda: servo.total.v if servo.controlled else servo.actual_velocity,
        "Acceleration": lambda: servo.total.a if servo.controlled else _actual_acceleration(servo),
        "ActualSpeed": lambda: _actual_speed(shown),
        "VelocitySetpoint": lambda: (
            0.0 if servo.virtual else servo.speed_output_rpm / servo.mechanics.rpm_per_unit
        ),
        "StatusDrive.InOperation": lambda: servo.in_operation,
        "StatusDrive.CommunicationOK": lambda: servo.communication_ok,
        "StatusDrive.Error": lambda: bool(servo.port.zsw1 & ZSW1.FAULT),
        "StatusWord": shown.status_word,
        "StatusWord2": shown.status_word2,
        "StatusTorqueData.CommandAdditiveTorqueActive": lambda: int(torque.additive is not None),
        "StatusTorqueData.CommandTorqueRangeActive": lambda: int(torque.limits.range_nm is not None),
        "StatusMotionIn.FunctionState": lambda: motion.motion_in_state,
        "StatusMotionIn.StatusWord": lambda: int(motion.motion_in_exceeds),
    }
    live |= live_alarms(shown.engine) | _torque(shown)
    if servo.has_position:
        live |= _position(shown)
        for number in range(1, len(servo.sensors) + 1):
            live |= _sensor(servo, number)
    if shown.follows:
        live |= _synchronous(shown)
    return in_its_units(live, shown.variables)


def _torque(shown: Shown) -> Live:
    """Return the torques of a standard motor, or the forces of a linear one (VAR-118, VAR-119)."""
    servo, torque, read = shown.servo, shown.torque, shown.variables.read

    def linear() -> bool:
        return servo.has_position and bool(read("Actor.MotorType") == 1)

    live: Live = {
        "StatusTorqueData.ActualTorque": lambda: 0.0 if linear() else servo.port.actual_torque_nm,
    }
    if servo.has_position:
        live |= {
            "StatusTorqueData.ActualForce": lambda: servo.port.actual_torque_nm if linear() else 0.0,
            "StatusTorqueData.TotalTorqueAdditive": lambda: 0.0 if linear() else torque.total_additive_nm,
            "StatusTorqueData.TotalForceAdditive": lambda: torque.total_additive_nm if linear() else 0.0,
        }
    return live


def _actual_speed(shown: Shown) -> float:
    """Return `ActualSpeed`: 0.0 for a virtual axis, an analog drive and a linear motor (VAR-123, CFG-143)."""
    servo, read = shown.servo, shown.variables.read
    if servo.virtual or read("Actor.Type") == 0 or (servo.has_position and read("Actor.MotorType") == 1):
        return 0.0
    return servo.port.actual_speed_rpm


def _actual_acceleration(servo: ServoAxis) -> float:
    """Return the change of the actual velocity in the last cycle, of a virtual axis its setpoint; 0.0 without
    an encoder.
    """
    controller = servo.controller
    if isinstance(controller, VirtualControl):  # an axis without positions, too
        return controller.actual_acceleration
    feedback = servo.feedback
    return (feedback.velocity - feedback.last_velocity) / servo.cycle_s


def _position(shown: Shown) -> Live:
    servo, motion = shown.servo, shown.motion

    def target() -> float:
        return motion.destination or 0.0

    def without_position() -> bool:
        """Return whether setpoints are velocities alone (SYN-172)."""
        return servo.controlled and not servo.position_controlled

    def filtered() -> float:
        dynamic_filter = servo.controller.filter
        return servo.modulo.wrap(servo.total.s if dynamic_filter is None else dynamic_filter.position)

    return live_leading_value(shown.leading_value, lambda: servo.modulo) | {
        "StatusPositioning.SetpointExecutionTime": shown.execution_s,
        "Position": lambda: 0.0 if without_position() else servo.modulo.wrap(servo.total.s),
        "ModuloCycle": lambda: 0 if without_position() else servo.modulo.cycle(servo.total.s),
        "ActualPosition": lambda: servo.feedback.place(servo.modulo)[1],
        "ActualModuloCycle": lambda: servo.feedback.place(servo.modulo)[0],
        "ActualVelocity": lambda: servo.feedback.velocity,
        "ActualAcceleration": lambda: _actual_acceleration(servo),
        "OperativeSensor": lambda: servo.operative_sensor,
        "StatusPositioning.SuperimposedDistance": lambda: motion.superimposed_distance,
        "StatusPositioning.FollowingError": lambda: servo.controller.following_error,
        "StatusPositioning.TargetPosition": lambda: servo.modulo.wrap(target()),
        "StatusPositioning.TargetPositionModuloCycle": lambda: servo.modulo.cycle(target()),
        "StatusPositioning.Distance": lambda: target() - servo.total.s,
        "StatusServo.ControlDifference": lambda: servo.controller.control_difference,
        "StatusServo.BalancedPosition": lambda: (
            0.0 if servo.virtual else servo.modulo.wrap(servo.controller.balanced_position)
        ),
        "StatusServo.PositionAfterDynamicFilter": filtered,
    }


def _synchronous(shown: Shown) -> Live:
    """Return `StatusSynchronizedMotion` (SYN-034 to SYN-046)."""
    motion, read = shown.motion, shown.variables.bind
    names = ("MaxVelocity", "MaxAcceleration", "MaxDeceleration")
    velocity, acceleration, deceleration = (read(f"DynamicLimits.{name}") for name in names)

    def exceeded() -> int:
        additive = ADDITIVE_COMMAND if motion.additive.owner is not None else 0
        if motion.simulated is not None:
            return additive | IN_SIMULATION
        if motion.synchronous_job is None:
            return additive
        gen = motion.gen
        braking = gen.a * gen.v < 0.0
        return additive | int(
            (abs(gen.v) > velocity.value * _ROUNDING)
            | (not braking and abs(gen.a) > acceleration.value * _ROUNDING) << 1
            | (braking and abs(gen.a) > deceleration.value * _ROUNDING) << 2
        )

    def coupling() -> Coupling | None:
        job = motion.following_job
        return None if job is None else job.coupling

    def camming() -> FunctionCoupling | None:
        job = motion.following_job
        one = None if job is None or not job.cam_number else job.coupling
        return one if isinstance(one, FunctionCoupling) else None

    def curve() -> ScaledCurve | None:
        cam = camming()
        return cam.function if cam is not None and isinstance(cam.function, ScaledCurve) else None

    def slave_offset() -> float:
        return 0.0 if (cam := camming()) is None else cam.shown_offsets[1]

    prefix = "StatusSynchronizedMotion."
    return {
        f"{prefix}FunctionState": lambda: 0 if (job := motion.following_job) is None else job.function,
        f"{prefix}WaitingFunctionState": lambda: motion.waiting_function,
        f"{prefix}ActualCam": lambda: 0 if (job := motion.following_job) is None else job.cam_number,
        f"{prefix}ActualMaster": shown.leader_number,
        f"{prefix}StatusWord": exceeded,
        f"{prefix}EffectiveLeadingValue.Position": lambda: (
            0.0 if (one := coupling()) is None else one.leading.effective_position
        ),
        f"{prefix}EffectiveLeadingValue.Velocity": lambda: (
            0.0 if (one := coupling()) is None else one.leading.effective_velocity
        ),
        f"{prefix}EffectiveLeadingValue.Acceleration": lambda: (
            0.0 if (one := coupling()) is None else one.leading.effective_acceleration
        ),
        f"{prefix}PhaseShift": lambda: (
            0.0 if (one := coupling()) is None or one.leading.phase is None else one.leading.phase.value
        ),
        f"{prefix}FunctionLeadingValue.Position": lambda: (
            0.0 if (one := coupling()) is None else one.leading.position
        ),
        f"{prefix}MasterOffset": lambda: 0.0 if (cam := camming()) is None else cam.shown_offsets[0],
        f"{prefix}SlaveOffset": slave_offset,
        f"{prefix}MasterScaling": lambda: 0.0 if (cam := curve()) is None else cam.master_scaling,
        f"{prefix}SlaveScaling": lambda: 0.0 if (cam := curve()) is None else cam.slave_scaling,
        f"{prefix}Offset": lambda: (
            slave_offset()
            + (0.0 if (one := motion.following_job) is None or one.offset is None else one.offset.value)
        ),
        f"{prefix}FunctionFollowingValue.Position": lambda: (
            0.0 if (one := coupling()) is None else one.s - slave_offset()
        ),
        f"{prefix}FunctionFollowingValue.Velocity": lambda: 0.0 if (one := coupling()) is None else one.v,
        f"{prefix}FunctionFollowingValue.Acceleration": lambda: 0.0 if (one := coupling()) is None else one.a,
    }


def _sensor(servo: ServoAxis, number: int) -> Live:
    prefix = f"StatusSensor[{number}]."

    def sensor() -> Feedback:
        return servo.sensors[number - 1]

    return {
        f"{prefix}State": lambda: sensor().state,
        f"{prefix}Position": lambda: sensor().place(servo.modulo)[1],
        f"{prefix}ModuloCycle": lambda: sensor().place(servo.modulo)[0],
        f"{prefix}Velocity": lambda: sensor().velocity,
        f"{prefix}CommunicationOK": lambda: sensor().source.link_ok,
        f"{prefix}Error": lambda: sensor().source.sensor_fault,
        f"{prefix}Control": lambda: servo.operative_sensor == number,
    }
