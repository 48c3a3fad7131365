"""Safe brake test of a PROFIdrive axis: the drive pulls at its closed brake and watches whether the load
moves (CFG-454 to CFG-456).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from emulators.drive.profidrive.statemachine import AxisState
from fieldbus.clock import seconds_to_ns

if TYPE_CHECKING:
    from emulators.drive.profidrive.drive import ProfidriveDrive

SELECT, START, NEGATIVE = 0x0001, 0x0002, 0x0008
"""Bits of S_STW3B."""
SELECTED, ACTIVE, GOOD, COMPLETED = 0x0001, 0x0008, 0x0010, 0x0020
"""Bits of S_ZSW3B."""
_RAMP_S: Final = 0.1
"""Time in which the test torque is reached, and taken back."""
_NOTHING_NM: Final = 1e-3


class BrakeTest:
    """The test, controlled by S_STW3B of telegram 701. It needs an axis in operation that stands, and a
    brake.

    Args:
        drive: The drive.

    """

    __slots__ = ("_before", "_drive", "_place", "_pulled_ns", "_result", "_stw_at", "active", "word")

    def __init__(self, drive: ProfidriveDrive) -> None:
        self._drive = drive
        self._stw_at = drive.setpoint_place("S_STW3B")
        self._before = 0
        self._place = 0.0
        self._pulled_ns = -1
        self._result = 0
        self.active = False
        """The drive leads itself: the brake is closed, or closing."""
        self.word = 0
        """Bits of S_ZSW3B."""

    @property
    def wired(self) -> bool:
        """Whether the telegram has the control word of the test."""
        return self._stw_at >= 0

    def step(self) -> None:
        """Evaluate S_STW3B, and go on with the test; once per bus cycle."""
        drive = self._drive
        stw = drive.row[self._stw_at] & 0xFFFF
        before, self._before = self._before, stw
        if not stw & SELECT:
            if self.active:
                self._end()
            self.word = 0
            return
        self.word |= SELECTED
        if self.active:
            self._go_on()
        elif stw & START and not before & START:
            self._begin()

    def _begin(self) -> None:
        drive = self._drive
        core = drive.core
        self.word = SELECTED
        torque = drive.config.safe_motion.sbt_torque_Nm
        if not (torque and core.brake.fitted and drive.state is AxisState.S4 and core.standing):
            return
        self.active = True
        self.word |= ACTIVE
        self._pulled_ns = -1
        self._result = 0
        self._place = core.position
        core.command_velocity(0.0, 1)
        drive.safety.settle_brake()

    def _go_on(self) -> None:
        drive = self._drive
        core = drive.core
        config = drive.config.safe_motion
        ramp = max(1, math.ceil(_RAMP_S / core.period_s))
        if drive.state is not AxisState.S4:
            self._end()  # the stop of the drive goes on by itself
        elif self._result:
            if abs(core.torque_demand) < _NOTHING_NM:
                self._end()
        elif abs((core.position - self._place) * drive.mechanics.ratio) > config.sbt_tolerance:
            self._result = COMPLETED
            core.command_torque(0.0)
        elif self._pulled_ns < 0:
            if core.brake.closed:
                self._pulled_ns = drive.now_ns
                sign = -1.0 if self._before & NEGATIVE else 1.0
                core.command_torque(sign * config.sbt_torque_Nm, ramp)
        elif drive.now_ns - self._pulled_ns >= seconds_to_ns(_RAMP_S + config.sbt_time_s):
            self._result = GOOD | COMPLETED
            core.command_torque(0.0, ramp)

    def _end(self) -> None:
        drive = self._drive
        self.active = False
        self.word = SELECTED | self._result
        if drive.state is AxisState.S4:
            drive.core.command_velocity(0.0, 1)
        drive.safety.settle_brake()
        if self._result:
            drive.emit("drive.brake_test", good=bool(self._result & GOOD))

    def restart(self) -> None:
        """Begin as after power-on."""
        self.active = False
        self._before = self.word = 0
