"""A drive whose speed follows its setpoint with a lag of first order, exact for setpoints that change
linearly within a cycle.
"""

from __future__ import annotations

from math import exp, tau

from motion.drives.simulated import DriveStage, SimulatedDrivePort


class LaggingDrivePort(SimulatedDrivePort):
    """See the module; `lag_s` is the time constant of the speed loop, `load_rpm` a speed by which a load
    turns the motor back.
    """

    def __init__(self, *, cycle_s: float, lag_s: float, load_rpm: float = 0.0, **options) -> None:
        super().__init__(cycle_s=cycle_s, **options)
        self.lag_s = lag_s
        self.load_rpm = load_rpm
        self._command = 0.0
        self._turning = 0.0

    def _move(self) -> None:
        if self.stage is not DriveStage.S4 or self.lag_s <= 0.0:
            super()._move()
            self._command = self._turning = self._speed
            return
        cycle, lag = self._cycle, self.lag_s
        before, self._command = self._command, self._setpoint
        slope = (self._command - before) / cycle
        rest = self._turning - before + slope * lag
        decay = exp(-cycle / lag)
        way = before * cycle + 0.5 * slope * cycle * cycle - slope * lag * cycle + rest * lag * (1.0 - decay)
        self._turning = self._command - slope * lag + rest * decay
        self._speed = self._turning - self.load_rpm
        self._angle += (way - self.load_rpm * cycle) / 60.0 * tau
