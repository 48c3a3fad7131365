"""Status words of a technology object (VAR-028 to VAR-061)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.drives.port import STW1
from motion.s7.axis.jobs import JobClass
from motion.s7.axis.state import AxisState

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

# Names of the module, because in every cycle an attribute of an enumeration would cost more than what is done
# with it.
_RESTARTING: Final = AxisState.RESTARTING
_POSITIONING: Final = JobClass.POSITIONING
_VELOCITY: Final = JobClass.VELOCITY
_NO_OFF2: Final = int(STW1.NO_OFF2)
_MOTION_IN: Final = JobClass.MOTION_IN

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
MOVE_SUPERIMPOSED: Final = 1 << 23
AXIS_SIMULATION: Final = 1 << 25
TORQUE_LIMITING_COMMAND: Final = 1 << 26
IN_LIMITATION: Final = 1 << 27
NON_POSITION_CONTROLLED: Final = 1 << 28
IN_CLAMPING: Final = 1 << 30
MOTION_IN: Final = 1 << 31

STOP: Final = 1 << 0
PASSING_BACKLASH: Final = 1 << 2
MOTION_IN_SUPERIMPOSED: Final = 1 << 6
HALT_SUPERIMPOSED: Final = 1 << 7


def status_word(axis: TechnologyAxis) -> int:
    """Return `StatusWord` for the present cycle."""
    facts = axis.facts
    motion = axis.motion
    word = ENABLE if facts.enabled else 0
    if axis.alarms.engine.error_word:
        word |= ERROR
    if axis.variables.online_start_values_changed:
        word |= ONLINE_START_VALUES_CHANGED
    if axis.master is not None:
        word |= CONTROL_PANEL
    elif facts.quiet:
        word |= DONE
    elif axis.state is _RESTARTING:
        word |= RESTART_ACTIVE
    job = motion.job
    if job is not None and job.busy:
        cls = job.job_class
        if cls is _POSITIONING:
            word |= POSITIONING_COMMAND
        elif cls is _VELOCITY:
            word |= JOG_COMMAND if job.instruction == "MC_MoveJog" else VELOCITY_COMMAND
        elif cls is _MOTION_IN:
            word |= MOTION_IN
    if facts.controlled and not axis.enabling.switching_off:
        gen = motion.total
        acceleration = gen.a
        if acceleration == 0.0:
            word |= CONSTANT_VELOCITY
        elif acceleration * gen.v > 0.0 or (gen.v == 0.0 and not gen.done):
            word |= ACCELERATING
        else:
            word |= DECELERATING
    elif axis.at_rest:
        word |= CONSTANT_VELOCITY
    elif facts.drive_ramp and axis.enabling.stw1 & _NO_OFF2:
        word |= DECELERATING  # on a ramp of the drive; an axis that coasts does not show it (STP-336)
    torque = axis.torque
    if torque.limiting or torque.range_nm is not None:
        if torque.limiting:
            word |= TORQUE_LIMITING_COMMAND
        if torque.in_limitation:
            word |= IN_LIMITATION
        if torque.clamped:
            word |= IN_CLAMPING
    if axis.simulated:
        word |= AXIS_SIMULATION
    if axis.has_position:
        if axis.homed:
            word |= HOMING_DONE
        if axis.homings and any(homing.busy for homing in axis.homings):
            word |= HOMING_COMMAND
        if axis.monitoring.standstill:
            word |= STANDSTILL
        limits = axis.limits
        if limits.software_min:
            word |= SW_LIMIT_MIN
        if limits.software_max:
            word |= SW_LIMIT_MAX
        if limits.negative.active:
            word |= HW_LIMIT_MIN
        if limits.positive.active:
            word |= HW_LIMIT_MAX
        if not motion.position_controlled:
            word |= NON_POSITION_CONTROLLED
    if motion.superimposed is not None:
        job = motion.superimposed.job
        if job is None or job.instruction == "MC_MoveSuperimposed":
            word |= MOVE_SUPERIMPOSED
    return word


def status_word2(axis: TechnologyAxis) -> int:
    """Return `StatusWord2`: `MC_Stop` holds the axis, a backlash is passed, a superimposed motion is given or
    brakes.
    """
    motion = axis.motion
    job = motion.job
    word = STOP if job is not None and job.job_class is JobClass.STOP else 0
    for backlash in axis.backlashes:
        if backlash.passing and backlash.feedback is axis.feedback:
            word |= PASSING_BACKLASH
    moving = motion.superimposed
    if moving is not None and moving.job is not None:
        if moving.given:
            word |= MOTION_IN_SUPERIMPOSED
        elif moving.job.instruction == "MC_HaltSuperimposed":
            word |= HALT_SUPERIMPOSED
    return word
