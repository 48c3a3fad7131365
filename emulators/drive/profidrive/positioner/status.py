"""Status words of the basic positioner (PD-068 to PD-075, PD-090, PD-091)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from emulators.drive.profidrive.positioner.terms import Mode, Words
from fieldbus.profidrive.formats import N2_ONE
from fieldbus.profidrive.words import POS_STW1, POS_ZSW1, POS_ZSW2, ZSW1

if TYPE_CHECKING:
    from emulators.drive.profidrive.positioner.positioner import Positioner


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


def zsw1(axis: Positioner, velocity: float, last_velocity: float) -> int:
    """Return the bits of ZSW1 that position mode has in its own way; demand velocities of now and of the last
    cycle.
    """
    word = 0 if axis.off_course else _IN_TOLERANCE
    if axis.target_reached or (axis.settings.rest_is_reached and axis.rests):
        word |= _REACHED
    if axis.homed:
        word |= _HOMED
    if axis.acknowledged:
        word |= _ACKNOWLEDGED
    if axis.core.standing:
        word |= _STANDS
    change = abs(velocity) - abs(last_velocity)
    if change > 1e-9:
        word |= _FASTER
    elif change < -1e-9:
        word |= _SLOWER
    return word


def pos_zsw1(axis: Positioner, *, minus_cam: bool, plus_cam: bool) -> int:
    """Return POS_ZSW1."""
    mode = axis.mode
    word = _MODES[mode]
    if mode is Mode.BLOCK:
        word |= axis.blocks.active
    if minus_cam:
        word |= _MINUS
    if plus_cam:
        word |= _PLUS
    if axis.referencing:
        word |= _HOMING
    if axis.homing.passing:
        word |= _PASSING
    return word


def pos_zsw2(axis: Positioner, words: Words, velocity: float) -> int:
    """Return POS_ZSW2."""
    settings = axis.settings
    word = axis.blocks.outputs * _OUTPUT_1
    if axis.tracking:
        word |= _TRACKING
    wanted = axis.wanted
    if wanted is not None:
        if wanted.velocity * max(0, words.override) > settings.max_velocity * N2_ONE:
            word |= _LIMITED
        if not axis.target_reached:
            word |= _ACTIVE
    if velocity > 0.0:
        word |= _FORWARD
    elif velocity < 0.0:
        word |= _BACKWARD
    else:
        word |= _SETPOINT_STANDS
    if axis.limited(words):
        low, high = settings.software_limits
        demand = axis.demand
        if demand <= low + 0.5:
            word |= _LIMIT_MINUS
        if demand >= high - 0.5:
            word |= _LIMIT_PLUS
    position = axis.position
    first, second = settings.position_cams
    if position <= first:
        word |= _CAM_1
    if position <= second:
        word |= _CAM_2
    stop = axis.fixed_stop
    if stop.active:
        word |= _TO_STOP
        if stop.reached:
            word |= _AT_STOP | _CLAMPED if axis.core.torque_limited else _AT_STOP
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
