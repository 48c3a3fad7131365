"""Status words of the basic positioner (PD-068 to PD-075, PD-090, PD-091)."""

from __future__ import annotations

from emulators.drive.profidrive.positioner.task import Task
from emulators.drive.profidrive.positioner.terms import Mode, Words
from fieldbus.profidrive.formats import N2_ONE
from fieldbus.profidrive.words import POS_STW1, POS_ZSW1, POS_ZSW2, ZSW1

# Plain integers: an enumeration costs more than the rest of a cycle.
_IN_TOLERANCE, _REACHED, _HOMED = (
    int(ZSW1.DEVIATION_IN_TOLERANCE),
    int(ZSW1.TARGET_REACHED),
    int(ZSW1.HOME_POSITION_SET),
)
_ACKNOWLEDGED, _STANDS = int(ZSW1.TASK_ACKNOWLEDGED), int(ZSW1.STANDSTILL)
_FASTER, _SLOWER = int(ZSW1.ACCELERATING), int(ZSW1.DECELERATING)
_MINUS, _PLUS, _PASSING = int(POS_ZSW1.MINUS_CAM), int(POS_ZSW1.PLUS_CAM), int(POS_ZSW1.FLYING_HOMING)
_HOMING = int(POS_ZSW1.HOMING)
_MODES = {
    Mode.NONE: 0, Mode.JOG: int(POS_ZSW1.JOG), Mode.HOMING: _HOMING, Mode.BLOCK: int(POS_ZSW1.BLOCKS),
    Mode.SETUP: int(POS_ZSW1.SETUP), Mode.MDI: int(POS_ZSW1.MDI),
}  # fmt: skip
_TRACKING, _LIMITED, _SETPOINT_STANDS = (
    int(POS_ZSW2.TRACKING), int(POS_ZSW2.VELOCITY_LIMITED), int(POS_ZSW2.SETPOINT_STANDS),
)  # fmt: skip
_FORWARD, _BACKWARD = int(POS_ZSW2.FORWARD), int(POS_ZSW2.BACKWARD)
_LIMIT_MINUS, _LIMIT_PLUS = int(POS_ZSW2.SOFTWARE_LIMIT_MINUS), int(POS_ZSW2.SOFTWARE_LIMIT_PLUS)
_CAM_1, _CAM_2, _OUTPUT_1 = int(POS_ZSW2.CAM_1), int(POS_ZSW2.CAM_2), int(POS_ZSW2.OUTPUT_1)
_AT_STOP, _CLAMPED = int(POS_ZSW2.FIXED_STOP_REACHED), int(POS_ZSW2.CLAMPING_TORQUE_REACHED)
_TO_STOP, _ACTIVE = int(POS_ZSW2.TRAVEL_TO_FIXED_STOP), int(POS_ZSW2.COMMAND_ACTIVE)


def zsw1(task: Task, velocity: float, last_velocity: float, *, off_course: bool, acknowledged: bool) -> int:
    """Return the bits of ZSW1 that position mode has in its own way.

    Args:
        task: Task of the positioner.
        velocity: Demand velocity of now, rad/s.
        last_velocity: That of the last bus cycle.
        off_course: The following error is beyond its tolerance.
        acknowledged: The edge of the bit that still stands was accepted.

    """
    word = 0 if off_course else _IN_TOLERANCE
    if task.target_reached or (task.settings.rest_is_reached and task.rests):
        word |= _REACHED
    if task.homed:
        word |= _HOMED
    if acknowledged:
        word |= _ACKNOWLEDGED
    if task.core.standing:
        word |= _STANDS
    change = abs(velocity) - abs(last_velocity)
    if change > 1e-9:
        word |= _FASTER
    elif change < -1e-9:
        word |= _SLOWER
    return word


def pos_zsw1(
    mode: Mode, block: int, *, minus_cam: bool, plus_cam: bool, referencing: bool, passing: bool
) -> int:
    """Return POS_ZSW1.

    Args:
        mode: Kind of the task.
        block: Active traversing block.
        minus_cam: The limit switch in negative direction is actuated.
        plus_cam: That in positive direction.
        referencing: The bit that has set the reference point still stands.
        passing: Passive homing waits for its probe.

    """
    word = _MODES[mode]
    if mode is Mode.BLOCK:
        word |= block
    if minus_cam:
        word |= _MINUS
    if plus_cam:
        word |= _PLUS
    if referencing:
        word |= _HOMING
    if passing:
        word |= _PASSING
    return word


def pos_zsw2(
    task: Task, words: Words, velocity: float, *, position: float, outputs: int, tracking: bool, to_stop: bool
) -> int:
    """Return POS_ZSW2.

    Args:
        task: Task of the positioner.
        words: Setpoint words in effect.
        velocity: Demand velocity, rad/s.
        position: Measured position, LU.
        outputs: Direct outputs 1 and 2, as bits.
        tracking: The position demand follows the axis.
        to_stop: The axis travels to a fixed stop.

    """
    settings = task.settings
    word = outputs * _OUTPUT_1
    if tracking:
        word |= _TRACKING
    wanted = task.wanted
    if wanted is not None:
        if wanted.velocity * max(0, words.override) > settings.max_velocity * N2_ONE:
            word |= _LIMITED
        if not task.target_reached:
            word |= _ACTIVE
    if velocity > 0.0:
        word |= _FORWARD
    elif velocity < 0.0:
        word |= _BACKWARD
    else:
        word |= _SETPOINT_STANDS
    if task.limited(words):
        low, high = settings.software_limits
        demand = task.demand
        if demand <= low + 0.5:
            word |= _LIMIT_MINUS
        if demand >= high - 0.5:
            word |= _LIMIT_PLUS
    first, second = settings.position_cams
    if position <= first:
        word |= _CAM_1
    if position <= second:
        word |= _CAM_2
    if to_stop:
        word |= _TO_STOP
        if task.stop_reached:
            word |= _AT_STOP | _CLAMPED if task.core.torque_limited else _AT_STOP
    return word


def pos_stw1_of(satzanw: int, mdi_mod: int) -> int:
    """Return POS_STW1 for SATZANW and MDI_MOD of the telegrams 7, 9 and 110 (PD-086, PD-092)."""
    word = satzanw & 0x7F
    if satzanw & 0x8000:
        word |= POS_STW1.MDI
    return word | _bits(
        (POS_STW1.ABSOLUTE, bool(mdi_mod & 1)),
        (POS_STW1.POSITIVE, bool(mdi_mod & 2)),
        (POS_STW1.NEGATIVE, bool(mdi_mod & 4)),
    )


def _bits(*rows: tuple[int, bool]) -> int:
    return sum(mask for mask, holds in rows if holds)
