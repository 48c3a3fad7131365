"""States of a technology object and what each of them means for enable, control and jobs (STP-446 to
STP-461).
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final


class AxisState(IntEnum):
    """Enable/stop state of an axis."""

    DISABLED = 0
    ENABLING = 1
    ENABLE_RAMP = 2
    STANDSTILL = 3
    MOTION = 4
    HALTING = 5
    STOPPING = 6
    STOP_HOLD = 7
    ALARM_RAMP = 8
    ALARM_STANDSTILL = 9
    ALARM_DRIVE_STOP = 10
    ALARM_DISABLED = 11
    DISABLING_RAMP = 12
    DISABLING_QUICK = 13
    DISABLING_COAST = 14
    TRACKING = 15
    RESTARTING = 16


S = AxisState

ACCEPTS_MOTION: Final = frozenset((S.ENABLE_RAMP, S.STANDSTILL, S.MOTION, S.HALTING))
"""States in which a motion job is accepted."""

ACCEPTS_STOP: Final = ACCEPTS_MOTION | frozenset((S.STOPPING, S.STOP_HOLD, S.ALARM_RAMP))
"""States in which `MC_Stop` can take effect."""

ENABLED: Final = frozenset(
    (
        S.ENABLE_RAMP,
        S.STANDSTILL,
        S.MOTION,
        S.HALTING,
        S.STOPPING,
        S.STOP_HOLD,
        S.ALARM_RAMP,
        S.ALARM_STANDSTILL,
        S.DISABLING_RAMP,
        S.DISABLING_QUICK,
        S.DISABLING_COAST,
    )
)
"""States with StatusWord.X0 and `MC_Power.Status` TRUE."""

CONTROLLED: Final = frozenset(
    (
        S.ENABLE_RAMP,
        S.STANDSTILL,
        S.MOTION,
        S.HALTING,
        S.STOPPING,
        S.STOP_HOLD,
        S.ALARM_RAMP,
        S.ALARM_STANDSTILL,
        S.DISABLING_RAMP,
    )
)
"""States in which the axis makes the setpoints and its controller is closed."""

DRIVE_EXPECTED_ON: Final = CONTROLLED | frozenset((S.TRACKING,))
"""States in which a drive that drops out by itself is a fault (alarm 421)."""

DISABLING: Final = frozenset((S.DISABLING_RAMP, S.DISABLING_QUICK, S.DISABLING_COAST))
"""States between the falling edge of `MC_Power.Enable` and the drive being off."""

QUIET: Final = frozenset((
    S.DISABLED, S.ENABLING, S.STANDSTILL, S.STOP_HOLD, S.ALARM_STANDSTILL, S.ALARM_DISABLED,
))  # fmt: skip
"""States in which no motion job is being executed (StatusWord.X6)."""

DRIVE_RAMP: Final = frozenset((S.DISABLING_QUICK, S.ALARM_DRIVE_STOP, S.TRACKING))
"""States in which the drive brakes on a ramp of its own."""


class StateFacts:
    """What the cycle asks about a state, as plain attributes: hashing an enumeration member is slow."""

    __slots__ = ("controlled", "drive_expected", "drive_ramp", "enabled", "quiet")

    def __init__(self, state: AxisState) -> None:
        self.enabled = state in ENABLED
        self.controlled = state in CONTROLLED
        self.drive_expected = state in DRIVE_EXPECTED_ON
        self.drive_ramp = state in DRIVE_RAMP
        self.quiet = state in QUIET


FACTS: Final = tuple(StateFacts(state) for state in AxisState)
"""Facts by the number of the state."""
