"""Safe brake test of a PROFIdrive axis: the drive pulls at its closed brake and watches whether the load
moves (CFG-454 to CFG-456).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from emulators.drive.core import ServoCore
from emulators.drive.profidrive.process_data import ProcessData
from emulators.drive.profidrive.safety.state import SafetyState
from emulators.drive.profidrive.statemachine import AxisState, GeneralStateMachine
from emulators.drive.safety_config import SafeMotionConfig
from emulators.events import Emit
from emulators.mechanics import AxisMechanics
from fieldbus.clock import Scheduler, seconds_to_ns

SELECT, START, NEGATIVE = 0x0001, 0x0002, 0x0008
"""Bits of S_STW3B."""
SELECTED, ACTIVE, GOOD, COMPLETED = 0x0001, 0x0008, 0x0010, 0x0020
"""Bits of S_ZSW3B."""
_RAMP_S: Final = 0.1
"""Time in which the test torque is reached, and taken back."""
_NOTHING_NM: Final = 1e-3


class BrakeTest:
    """The test, controlled by S_STW3B of telegram 701. It needs an axis in
    operation that stands, and a brake.

    Args:
        scheduler: Clock of the drive.
        config: Torque, time and tolerance of the test.
        core: Servo core.
        mechanics: Machine.
        machine: General state machine.
        data: Setpoints of the telegram; S_STW3B is among them.
        state: Shows that the test moves the axis.
        settle_brake: Closes the brake while the test runs, and releases it.
        emit: Writes the result into the log.

    """

    def __init__(
        self,
        scheduler: Scheduler,
        config: SafeMotionConfig,
        *,
        core: ServoCore,
        mechanics: AxisMechanics,
        machine: GeneralStateMachine,
        data: ProcessData,
        state: SafetyState,
        settle_brake: Callable[[], None],
        emit: Emit,
    ) -> None:
        self._scheduler = scheduler
        self._torque_Nm = config.sbt_torque_nm
        self._pull_ns = seconds_to_ns(_RAMP_S + config.sbt_time_ms / 1000.0)
        self._tolerance = config.sbt_tolerance_mm / 1000.0
        self._core = core
        self._mechanics = mechanics
        self._machine = machine
        self._data = data
        self._state = state
        self._settle_brake = settle_brake
        self._emit = emit
        self._stw_at = data.place("S_STW3B")
        self._before = 0
        self._place = 0.0
        self._pulled_ns = -1
        self._result = 0
        self.word = 0
        """Bits of S_ZSW3B."""

    @property
    def wired(self) -> bool:
        """Whether the telegram has the control word of the test."""
        return self._stw_at >= 0

    def step(self) -> None:
        """Evaluate S_STW3B, and continue with the test; once per bus cycle."""
        stw = self._data.row[self._stw_at] & 0xFFFF
        before, self._before = self._before, stw
        if not stw & SELECT:
            if self._state.testing_brake:
                self._end()
            self.word = 0
            return
        self.word |= SELECTED
        if self._state.testing_brake:
            self._go_on()
        elif stw & START and not before & START:
            self._begin()

    def _begin(self) -> None:
        core = self._core
        self.word = SELECTED
        torque = self._torque_Nm
        if not (torque and core.brake.fitted and self._machine.state is AxisState.S4 and core.standing):
            return
        self._state.testing_brake = True
        self.word |= ACTIVE
        self._pulled_ns = -1
        self._result = 0
        self._place = core.position
        core.command_velocity(0.0, 1)
        self._settle_brake()

    def _go_on(self) -> None:
        core = self._core
        ramp = max(1, math.ceil(_RAMP_S / core.period_s))
        if self._machine.state is not AxisState.S4:
            self._end()  # the stop of the drive continues by itself
        elif self._result:
            if abs(core.torque_demand) < _NOTHING_NM:
                self._end()
        elif abs((core.position - self._place) * self._mechanics.ratio) > self._tolerance:
            self._result = COMPLETED
            core.command_torque(0.0)
        elif self._pulled_ns < 0:
            if core.brake.closed:
                self._pulled_ns = self._scheduler.now
                sign = -1.0 if self._before & NEGATIVE else 1.0
                core.command_torque(sign * self._torque_Nm, ramp)
        elif self._scheduler.now - self._pulled_ns >= self._pull_ns:
            self._result = GOOD | COMPLETED
            core.command_torque(0.0, ramp)

    def _end(self) -> None:
        self._state.testing_brake = False
        self.word = SELECTED | self._result
        if self._machine.state is AxisState.S4:
            self._core.command_velocity(0.0, 1)
        self._settle_brake()
        if self._result:
            self._emit("drive.brake_test", good=bool(self._result & GOOD))

    def restart(self) -> None:
        """Begin as after power-on."""
        self._state.testing_brake = False
        self._before = self.word = 0
