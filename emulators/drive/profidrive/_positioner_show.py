"""Status words of the basic positioner (PD-068 to PD-075, PD-090, PD-091)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from emulators.drive.profidrive._positioner_terms import Mode, Words
from fieldbus.profidrive.formats import N2_ONE
from fieldbus.profidrive.words import POS_STW1, POS_ZSW1, POS_ZSW2, ZSW1

if TYPE_CHECKING:
    from emulators.drive.profidrive.positioner import Positioner


def zsw1(axis: Positioner, velocity: float, last_velocity: float) -> int:
    """Return the bits of ZSW1 that position mode has in its own way; demand velocities of now and of the last cycle."""
    change = abs(velocity) - abs(last_velocity)
    return _bits(
        (ZSW1.DEVIATION_IN_TOLERANCE, not axis.off_course),
        (ZSW1.TARGET_REACHED, axis.target_reached or (axis.settings.rest_is_reached and axis.rests)),
        (ZSW1.HOME_POSITION_SET, axis.homed),
        (ZSW1.TASK_ACKNOWLEDGED, axis.acknowledged),
        (ZSW1.STANDSTILL, axis.core.standing),
        (ZSW1.ACCELERATING, change > 1e-9),
        (ZSW1.DECELERATING, change < -1e-9),
    )


def pos_zsw1(axis: Positioner, *, minus_cam: bool, plus_cam: bool) -> int:
    """Return POS_ZSW1."""
    mode = axis.mode
    return (axis.blocks.active if mode is Mode.BLOCK else 0) | _bits(
        (POS_ZSW1.MINUS_CAM, minus_cam),
        (POS_ZSW1.PLUS_CAM, plus_cam),
        (POS_ZSW1.JOG, mode is Mode.JOG),
        (POS_ZSW1.HOMING, mode is Mode.HOMING or axis.referencing),
        (POS_ZSW1.FLYING_HOMING, axis.homing.passing),
        (POS_ZSW1.BLOCKS, mode is Mode.BLOCK),
        (POS_ZSW1.SETUP, mode is Mode.SETUP),
        (POS_ZSW1.MDI, mode is Mode.MDI),
    )


def pos_zsw2(axis: Positioner, words: Words, velocity: float) -> int:
    """Return POS_ZSW2."""
    settings = axis.settings
    wanted = axis.wanted
    position = axis.position
    low, high = settings.software_limits
    limited = axis.limited(words)
    override = max(0, words.override) / N2_ONE
    return (axis.blocks.outputs * int(POS_ZSW2.OUTPUT_1)) | _bits(
        (POS_ZSW2.TRACKING, axis.tracking),
        (
            POS_ZSW2.VELOCITY_LIMITED,
            wanted is not None and wanted.velocity * override > settings.max_velocity,
        ),
        (POS_ZSW2.SETPOINT_STANDS, velocity == 0.0),
        (POS_ZSW2.FORWARD, velocity > 0.0),
        (POS_ZSW2.BACKWARD, velocity < 0.0),
        (POS_ZSW2.SOFTWARE_LIMIT_MINUS, limited and axis.demand <= low + 0.5),
        (POS_ZSW2.SOFTWARE_LIMIT_PLUS, limited and axis.demand >= high - 0.5),
        (POS_ZSW2.CAM_1, position <= settings.position_cams[0]),
        (POS_ZSW2.CAM_2, position <= settings.position_cams[1]),
        (POS_ZSW2.FIXED_STOP_REACHED, axis.fixed_stop.reached),
        (POS_ZSW2.CLAMPING_TORQUE_REACHED, axis.fixed_stop.reached and axis.core.torque_limited),
        (POS_ZSW2.TRAVEL_TO_FIXED_STOP, axis.fixed_stop.active),
        (POS_ZSW2.COMMAND_ACTIVE, wanted is not None and not axis.target_reached),
    )


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
