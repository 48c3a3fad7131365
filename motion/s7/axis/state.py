"""States of a technology object and what each of them means for enable, control
and jobs (STP-446 to STP-461).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import TYPE_CHECKING, Final

from motion.drives.port import STW1_IDLE

if TYPE_CHECKING:
    from fieldbus.history import History
    from motion.kernel.servo_axis import ServoAxis


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

ENABLED: Final = CONTROLLED | frozenset((S.DISABLING_QUICK, S.DISABLING_COAST))
"""States with StatusWord.X0 and `MC_Power.Status` TRUE."""

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

    def __init__(self, state: AxisState) -> None:
        self.enabled = state in ENABLED
        self.controlled = state in CONTROLLED
        self.drive_expected = state in DRIVE_EXPECTED_ON
        self.drive_ramp = state in DRIVE_RAMP
        self.quiet = state in QUIET


_RESTARTING: Final = AxisState.RESTARTING
FACTS: Final = tuple(StateFacts(state) for state in AxisState)
"""Facts by the number of the state."""


class AxisStates:
    """The enable/stop state of one axis, what it means, and its record in the history.

    Args:
        name: Name of the axis.
        history: Event log, or None.
        servo: The axis in the kernel, which needs to know whether it is controlled.

    """

    def __init__(self, name: str, history: History | None, servo: ServoAxis) -> None:
        self._name = name
        self._history = history
        self._servo = servo
        self.state = AxisState.DISABLED
        self.facts = FACTS[AxisState.DISABLED]
        """What the state means."""
        self.power_status_shown = False
        """Status as the history knows it (`power.status`)."""
        self.on_restart: Callable[[bool], object] | None = None
        """Called with True when the object begins to be initialised, with False when that has ended."""

    def enter(self, state: AxisState) -> None:
        """Change the state and record it."""
        old = self.state
        if state is old:
            return
        self.state = state
        self.facts = facts = FACTS[state]
        self._servo.controlled = facts.controlled
        if self.on_restart is not None and (state is _RESTARTING or old is _RESTARTING):
            self.on_restart(state is _RESTARTING)
        history = self._history
        if history is not None:
            history.emit(self._name, "axis.state", **{"from": old.name, "to": state.name})
        status = facts.enabled
        if status is not self.power_status_shown:
            self.power_status_shown = status
            if history is not None:
                history.emit(self._name, "power.status", value=status)


class DriveCommand:
    """Control word 1 of an axis, and what is to become of its enable."""

    def __init__(self) -> None:
        self.enable = False
        """Level of `MC_Power.Enable` as last called."""
        self.stw1 = STW1_IDLE
        self.switching_off = False
        """The ramp of the axis has ended and the drive is being switched off."""
        self.acknowledge = False
        """Set STW1.7 in the next telegrams (`MC_Reset`)."""
        self.disable_pending = False
        """`Enable` has fallen during the present ramp, which ends with the
        drive off even if it rises again.
        """

    @property
    def will_disable(self) -> bool:
        """Whether the ramp in progress ends with the drive switched off:
        `Enable` is FALSE, or has been since.
        """
        return self.switching_off or self.disable_pending or not self.enable

    def switch_off(self) -> None:
        """Withdraw ON after a ramp of the axis; the state is left when the
        drive is off (STP-289, STP-290).
        """
        self.switching_off = True
        self.stw1 = STW1_IDLE
