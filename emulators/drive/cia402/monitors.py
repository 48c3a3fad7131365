"""What the drive watches of its motion: following error, blocked motor."""

from __future__ import annotations

from collections.abc import Callable

from emulators.drive.cia402.axis import UNLIMITED
from emulators.drive.cia402.config import DriveConfig
from emulators.drive.cia402.faults.codes import BLOCKED, FOLLOWING_ERROR
from emulators.drive.cia402.function import DriveFunction
from emulators.drive.protection import WindowTimer


class Monitors:
    """What is watched in every control cycle.

    Args:
        config: What a following error does, and how long a blocked motor is tolerated.
        function: Modes.
        raise_fault: Raises a fault of the drive.

    """

    def __init__(
        self, config: DriveConfig, function: DriveFunction, raise_fault: Callable[[int], None]
    ) -> None:
        self._trips = config.following_error == "fault"
        self._function = function
        self._axis = function.axis
        self._core = function.axis.core
        self._raise_fault = raise_fault
        self._following = WindowTimer()
        self._blocked = WindowTimer(config.blocked_time_ms / 1000.0)

    def reset(self) -> None:
        """Start again."""
        self._following.reset()
        self._blocked.reset()

    def update(self, dt_s: float) -> None:
        """Watch for `dt_s`; faults go to the drive."""
        core = self._core
        if not core.enabled:
            self._following.reset()
            self._blocked.reset()
            return
        mode = self._function.mode
        if mode.position_controlled and core.controls_position:
            values = self._axis.values
            window = values[0x606500]
            exceeded = False
            if window != UNLIMITED:
                self._following.time_s = values[0x606600] * 1e-3
                exceeded = self._following.update(abs(self._axis.following_error) > window, dt_s)
            if exceeded is not mode.following_error:
                mode.following_error = exceeded
                if exceeded and self._trips:
                    self._raise_fault(FOLLOWING_ERROR)
        elif mode.following_error:
            mode.following_error = False
        if self._blocked.time_s and self._blocked.update(core.torque_limited and core.standing, dt_s):
            self._raise_fault(BLOCKED)
