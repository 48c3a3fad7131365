"""A reference axis on a simulated drive: exact numbers, no bus."""

from __future__ import annotations

import pytest

from fieldbus.clock import S, VirtualScheduler
from fieldbus.history import History
from motion.axis import PositioningAxis, SpeedAxis
from motion.drives.simulated import SimulatedDrivePort
from motion.runtime import AxisHandle, Runtime

CYCLE = 0.004
REFERENCE = {
    "Mechanics.LeadScrew": 10.0,
    "Sensor[1].Parameter.StepsPerRevolution": 131072,
    "Sensor[1].Parameter.FineResolutionXist1": 0,
    "DynamicLimits.MaxVelocity": 500.0,
    "DynamicLimits.Velocity": 500.0,
    "DynamicLimits.MaxAcceleration": 2000.0,
    "DynamicLimits.MaxDeceleration": 2000.0,
    "DynamicLimits.MaxJerk": 20000.0,
    "DynamicDefaults.Velocity": 100.0,
    "DynamicDefaults.Acceleration": 1000.0,
    "DynamicDefaults.Deceleration": 1000.0,
    "DynamicDefaults.Jerk": 10000.0,
    "DynamicDefaults.EmergencyDeceleration": 4000.0,
    "PositionControl.Kv": 20.0,
    "PositioningMonitoring.Window": 0.1,
    "FollowingError.MinValue": 2.0,
    "FollowingError.MaxValue": 10.0,
    "StandstillSignal.VelocityThreshold": 2.0,
    "PositionLimits_HW.MinSwitchLevel": True,
    "PositionLimits_HW.MaxSwitchLevel": True,
}
SPEED = {
    "DynamicLimits.MaxVelocity": 3000.0,
    "DynamicLimits.Velocity": 3000.0,
    "DynamicLimits.MaxAcceleration": 12000.0,
    "DynamicLimits.MaxDeceleration": 12000.0,
    "DynamicLimits.MaxJerk": 120000.0,
    "DynamicDefaults.Acceleration": 6000.0,
    "DynamicDefaults.Deceleration": 6000.0,
    "DynamicDefaults.Jerk": 60000.0,
    "DynamicDefaults.EmergencyDeceleration": 24000.0,
}


class Rig:
    """One axis, its simulated drive and the runtime, sampled every cycle."""

    def __init__(self, *, speed: bool = False, variables: dict | None = None) -> None:
        self.scheduler = VirtualScheduler()
        self.history = History(self.scheduler)
        self.port = SimulatedDrivePort(cycle_s=CYCLE)
        kind = SpeedAxis if speed else PositioningAxis
        start = (SPEED if speed else REFERENCE) | (variables or {})
        axis = kind(
            "axis1", self.port, cycle_ns=4_000_000, variables=start, history=self.history, delay_s=CYCLE
        )
        self.runtime = Runtime(self.scheduler, cycle_ns=4_000_000, history=self.history)
        self.runtime.add(axis)
        self.axis = AxisHandle(self.runtime, axis)
        self.rows: list[tuple[float, ...]] = []
        self.names = [name for name, _ in axis.trace_columns]
        self.runtime.after_cycle.append(lambda: self.rows.append((self.scheduler.now / S, *axis.trace_row())))
        self.runtime.start()

    def run(self, seconds: float) -> None:
        self.scheduler.run_for(round(seconds * S))

    def until(self, predicate, timeout: float = 5.0) -> None:
        assert self.scheduler.run_until(predicate, round(timeout * S)), (
            "the condition did not come true in time"
        )

    def cycles(self, number: int = 1) -> None:
        self.scheduler.run_for(4_000_000 * number)

    def column(self, name: str) -> list[float]:
        index = self.names.index(name) + 1
        return [row[index] for row in self.rows]

    def times(self) -> list[float]:
        return [row[0] for row in self.rows]

    def enabled(self, *, start_mode: int = 1) -> Rig:
        power = self.axis.power(start_mode=start_mode)
        self.until(power.status)
        return self

    def travelling(self, velocity: float = 300.0, **inputs) -> Rig:
        """Enabled and at constant velocity, as every stop test of the specification starts."""
        self.enabled()
        self.job = self.axis.move_velocity(velocity, Deceleration=1000.0, Jerk=10000.0, **inputs)
        self.until(self.job.in_velocity)
        self.run(0.1)
        return self

    def stop_of_setpoint(self, since: float) -> tuple[float, float]:
        """Return (duration in s, travel in mm) of the setpoint from its last full velocity to zero."""
        rows = [row for row in self.rows if row[0] >= since]
        s, v = self.names.index("position_setpoint") + 1, self.names.index("velocity_setpoint") + 1
        first = next(i for i, row in enumerate(rows) if abs(row[v]) < abs(rows[0][v]) - 1e-9) - 1
        last = next(i for i, row in enumerate(rows) if row[v] == 0.0)
        return rows[last][0] - rows[first][0], abs(rows[last][s] - rows[first][s])

    def events(self, kind: str):
        return list(self.history.select(kind=kind))


@pytest.fixture
def rig():
    return Rig()


@pytest.fixture
def make_rig():
    return Rig
