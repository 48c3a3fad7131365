"""Status words of a technology object (VAR-028 to VAR-061)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.drives.port import STW1
from motion.s7.axis.jobs import JobClass, JobState
from motion.s7.axis.state import AxisState

if TYPE_CHECKING:
    from motion.kernel.servo_axis import ServoAxis
    from motion.s7.alarms import AlarmEngine
    from motion.s7.axis.homing.direct import Homing
    from motion.s7.axis.motion import MotionControl
    from motion.s7.axis.position_parts import PositionParts
    from motion.s7.axis.state import AxisStates, DriveCommand
    from motion.s7.axis.torque import TorqueControl
    from motion.s7.variables import VariableStore

# Names of the module, because in every cycle an attribute of an enumeration would cost more than what is done
# with it.
_RESTARTING: Final = AxisState.RESTARTING
_POSITIONING: Final = JobClass.POSITIONING
_VELOCITY: Final = JobClass.VELOCITY
_STOP: Final = JobClass.STOP
_NO_OFF2: Final = int(STW1.NO_OFF2)
_MOTION_IN: Final = JobClass.MOTION_IN
_DESYNCHRONISE: Final = JobClass.DESYNCHRONISE
_ACTIVE: Final = JobState.ACTIVE

ENABLE: Final = 1 << 0
ERROR: Final = 1 << 1
RESTART_ACTIVE: Final = 1 << 2
ONLINE_START_VALUES_CHANGED: Final = 1 << 3
CONTROL_PANEL: Final = 1 << 4
HOMING_DONE: Final = 1 << 5
DONE: Final = 1 << 6
STANDSTILL: Final = 1 << 7
POSITIONING_COMMAND: Final = 1 << 8
JOG_COMMAND: Final = 1 << 9
VELOCITY_COMMAND: Final = 1 << 10
HOMING_COMMAND: Final = 1 << 11
CONSTANT_VELOCITY: Final = 1 << 12
ACCELERATING: Final = 1 << 13
DECELERATING: Final = 1 << 14
SW_LIMIT_MIN: Final = 1 << 15
SW_LIMIT_MAX: Final = 1 << 16
HW_LIMIT_MIN: Final = 1 << 17
HW_LIMIT_MAX: Final = 1 << 18
SYNCHRONIZING: Final = 1 << 21
SYNCHRONOUS: Final = 1 << 22
PHASING_COMMAND: Final = 1 << 24
MOVE_SUPERIMPOSED: Final = 1 << 23
AXIS_SIMULATION: Final = 1 << 25
TORQUE_LIMITING_COMMAND: Final = 1 << 26
IN_LIMITATION: Final = 1 << 27
NON_POSITION_CONTROLLED: Final = 1 << 28
IN_CLAMPING: Final = 1 << 30
MOTION_IN: Final = 1 << 31

STOP: Final = 1 << 0
DESYNCHRONIZING: Final = 1 << 1
PASSING_BACKLASH: Final = 1 << 2
PHASING_COMMAND_WAITING: Final = 1 << 3
OFFSET_COMMAND: Final = 1 << 4
OFFSET_COMMAND_WAITING: Final = 1 << 5
MOTION_IN_SUPERIMPOSED: Final = 1 << 6
HALT_SUPERIMPOSED: Final = 1 << 7


class StatusWords:
    """The status words of one axis.

    Args:
        variables: Its variables.
        engine: Its pending alarms.
        servo: The axis in the kernel.
        states: State of the axis.
        command: Its control word.
        motion: Its jobs.
        torque: Its torque functions.
        homings: Active and passive homing under way.
        position: Its monitoring and limits of travel; None without positions.

    """

    def __init__(
        self,
        variables: VariableStore,
        engine: AlarmEngine,
        *,
        servo: ServoAxis,
        states: AxisStates,
        command: DriveCommand,
        motion: MotionControl,
        torque: TorqueControl,
        homings: list[Homing],
        position: PositionParts | None,
    ) -> None:
        self._variables = variables
        self._engine = engine
        self._servo = servo
        self._states = states
        self._command = command
        self._motion = motion
        self._torque = torque
        self._torque_limits = torque.limits
        self._homings = homings
        self._position = position

    def word(self, master: object | None) -> int:
        """Return `StatusWord` for the present cycle; `master`: the control panel that has the axis."""
        states = self._states
        servo = self._servo
        facts = states.facts
        word = ENABLE if facts.enabled else 0
        if self._engine.error_word:
            word |= ERROR
        if self._variables.online_start_values_changed:
            word |= ONLINE_START_VALUES_CHANGED
        if master is not None:
            word |= CONTROL_PANEL
        elif facts.quiet:
            word |= DONE
        elif states.state is _RESTARTING:
            word |= RESTART_ACTIVE
        job = self._motion.job
        if job is not None and job.state <= _ACTIVE:
            cls = job.job_class
            if cls is _POSITIONING:
                word |= POSITIONING_COMMAND
            elif cls is _VELOCITY:
                word |= JOG_COMMAND if job.instruction == "MC_MoveJog" else VELOCITY_COMMAND
            elif cls is _MOTION_IN:
                word |= MOTION_IN
            elif job.coupling is not None and cls is not _DESYNCHRONISE:
                word |= SYNCHRONOUS if job.synchronous else SYNCHRONIZING
        shifts = self._motion.shifts
        if shifts.job is not None and shifts.phases and not shifts.waits:
            word |= PHASING_COMMAND
        if facts.controlled and not self._command.switching_off:
            gen = servo.total
            acceleration = gen.a
            if acceleration == 0.0:
                word |= CONSTANT_VELOCITY
            elif acceleration * gen.v > 0.0 or (gen.v == 0.0 and not gen.done):
                word |= ACCELERATING
            else:
                word |= DECELERATING
        elif servo.at_rest:
            word |= CONSTANT_VELOCITY
        elif facts.drive_ramp and self._command.stw1 & _NO_OFF2:
            word |= DECELERATING  # on a ramp of the drive; an axis that coasts does not show it (STP-336)
        torque = self._torque_limits
        if torque.limiting or torque.range_nm is not None:
            if torque.limiting:
                word |= TORQUE_LIMITING_COMMAND
            if self._torque.in_limitation:
                word |= IN_LIMITATION
            if torque.clamped:
                word |= IN_CLAMPING
        if servo.simulated:
            word |= AXIS_SIMULATION
        position = self._position
        if position is not None:
            if servo.homed:
                word |= HOMING_DONE
            if self._homings and any(homing.busy for homing in self._homings):
                word |= HOMING_COMMAND
            if position.monitoring.standstill:
                word |= STANDSTILL
            software, hardware = position.software, position.hardware
            if software.software_min:
                word |= SW_LIMIT_MIN
            if software.software_max:
                word |= SW_LIMIT_MAX
            if hardware.negative.active:
                word |= HW_LIMIT_MIN
            if hardware.positive.active:
                word |= HW_LIMIT_MAX
            if not servo.position_controlled:
                word |= NON_POSITION_CONTROLLED
        if servo.superimposed is not None:
            job = self._motion.superimposed_job
            if job is None or job.instruction == "MC_MoveSuperimposed":
                word |= MOVE_SUPERIMPOSED
        return word

    def word2(self) -> int:
        """Return `StatusWord2`: `MC_Stop` holds the axis, a leading value is left, a backlash is passed, a
        superimposed motion is given or brakes.
        """
        motion = self._motion
        servo = self._servo
        job = motion.job
        word = 0
        if job is not None:
            cls = job.job_class
            word = STOP if cls is _STOP else DESYNCHRONIZING if cls is _DESYNCHRONISE else 0
        for backlash in servo.backlashes:
            if backlash.passing and backlash.feedback is servo.feedback:
                word |= PASSING_BACKLASH
        shifts = motion.shifts
        if shifts.job is not None:
            if not shifts.phases:
                word |= OFFSET_COMMAND_WAITING if shifts.waits else OFFSET_COMMAND
            elif shifts.waits:
                word |= PHASING_COMMAND_WAITING
        moving = servo.superimposed
        if moving is not None and motion.superimposed_job is not None:
            if moving.given:
                word |= MOTION_IN_SUPERIMPOSED
            elif motion.superimposed_job.instruction == "MC_HaltSuperimposed":
                word |= HALT_SUPERIMPOSED
        return word
