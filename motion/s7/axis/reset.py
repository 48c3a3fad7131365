"""Acknowledging and restarting a technology object (section 2 of the stopping specification)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from motion.s7.axis.jobs import ERROR_CONFIGURATION, NO_ERROR
from motion.s7.axis.state import AxisState

if TYPE_CHECKING:
    from motion.s7.alarms import AlarmEngine
    from motion.s7.axis.axis import TechnologyAxis

ALARM_CONFIGURATION: Final = 101
_CONFIGURATION: Final = (ALARM_CONFIGURATION, 109)
"""Alarms that stay until the configuration has been put right and the object restarted: as a whole, and of a
limit switch.
"""
ALARM_RESTART_REFUSED: Final = 322
_PULSE_CYCLES: Final = 2
"""Cycles for which STW1.7 is shown at least."""
_DRIVE_TIMEOUT_NS: Final = 200_000_000
"""Time that the drive gets to withdraw its fault before the alarms are acknowledged all the same."""
_RESTART_CYCLES: Final = 5
"""Cycles that the re-initialisation takes."""


def acknowledge_error(alarms: AlarmEngine) -> int:
    """Return the `ErrorID` of an acknowledgement: 16#8015 while alarm 101 or 109 says that the configuration
    is wrong.
    """
    return ERROR_CONFIGURATION if any(map(alarms.is_pending, _CONFIGURATION)) else NO_ERROR


class Reset:
    """One execution of `MC_Reset`; the axis steps it."""

    __slots__ = ("_age", "_axis", "done", "error_id", "restart")

    def __init__(self, axis: TechnologyAxis, *, restart: bool) -> None:
        self._axis = axis
        self._age = 0
        self.restart = restart
        self.done = False
        self.error_id = NO_ERROR
        """Why the instruction ends with an error, once `done`: 16#8015, the configuration is still wrong
        (TA-008, MC-609).
        """
        if restart:
            axis.motion.abort_all()
            axis.set_state(AxisState.RESTARTING)

    def step(self) -> None:
        """Advance by one application cycle."""
        axis = self._axis
        self._age += 1
        if self.restart:
            if self._age >= _RESTART_CYCLES:
                wrong = axis.variables.violations()
                problems = [str(one) for one in wrong] or [str(one) for one in axis.check(start=True)]
                axis.alarms.restart()
                if problems:
                    axis.alarms.raise_alarm(ALARM_CONFIGURATION, text="; ".join(problems))
                else:
                    axis.variables.restart()
                    axis.apply_configuration()
                axis.set_state(AxisState.ALARM_DISABLED if axis.alarms.blocking else AxisState.DISABLED)
                self.error_id = acknowledge_error(axis.alarms.engine)
                self.done = True
            return
        # The drive acknowledges on the rising edge of STW1.7; one low cycle makes sure that there is an edge.
        axis.enabling.acknowledge_drive = self._age > 1
        drive_ready = not axis.port.zsw1 & 0x0008
        if self._age <= _PULSE_CYCLES or (
            not drive_ready and self._age * axis.interpolator_ns < _DRIVE_TIMEOUT_NS
        ):
            return
        axis.enabling.acknowledge_drive = False
        axis.alarms.acknowledge()
        self.error_id = acknowledge_error(axis.alarms.engine)
        self.done = True
