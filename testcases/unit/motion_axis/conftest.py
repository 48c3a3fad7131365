"""A reference axis on a simulated drive: exact numbers, no bus."""

from __future__ import annotations

import pytest

from fieldbus.clock import S
from motion.drives.simulated import SimulatedDrivePort
from motion.s7.axis import PositioningAxis, SpeedAxis, SynchronousAxis
from motion.s7.handles import AxisHandle
from testcases.rigs import ControllerRig

CYCLE = 0.004
ZERO_MARK = 15 * 131072
"""The zero mark of the encoder, increments: 150 mm."""
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
    "DynamicLimits.MaxAcceleration": 200.0,
    "DynamicLimits.MaxDeceleration": 200.0,
    "DynamicLimits.MaxJerk": 2000.0,
    "DynamicDefaults.Acceleration": 100.0,
    "DynamicDefaults.Deceleration": 100.0,
    "DynamicDefaults.Jerk": 1000.0,
    "DynamicDefaults.EmergencyDeceleration": 400.0,
}


class TorquePort(SimulatedDrivePort):
    """A drive that gets everything a telegram can carry, and keeps the torque limits that it was given."""

    def __init__(self) -> None:
        super().__init__(cycle_s=CYCLE)
        self.has_torque_data = self.has_torque_reduction = self.speaks_telegram = True
        self.torque_range = (1.0, -1.0)
        self.torque_share: float | None = None
        self.additive_nm = 0.0
        self.stw1 = 0

    def set_torque_range(self, upper: float, lower: float) -> None:
        self.torque_range = (upper, lower)

    def limit_torque(self, share: float | None) -> None:
        self.torque_share = share

    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        super().write(stw1, speed_rpm, torque_nm)
        self.stw1 = stw1
        self.additive_nm = torque_nm


class Rig(ControllerRig):
    """One axis, its simulated drive and the runtime, sampled every cycle."""

    def __init__(
        self,
        *,
        speed: bool = False,
        variables: dict | None = None,
        port: SimulatedDrivePort | None = None,
        connection: str = "direct",
        cycle_ns: int = 4_000_000,
        ratio: int = 1,
        cpu: str = "S7-1500T",
        synchronous: bool = False,
        leader_variables: dict | None = None,
    ) -> None:
        super().__init__(cycle_ns=cycle_ns)
        self.port = port or SimulatedDrivePort(cycle_s=cycle_ns / S, zero_marks=[ZERO_MARK])
        kind = SynchronousAxis if synchronous else SpeedAxis if speed else PositioningAxis
        start = (SPEED if speed else REFERENCE) | (variables or {})
        axis = kind(
            "axis1",
            self.port,
            cycle_ns=cycle_ns,
            variables=start,
            history=self.history,
            delay_s=cycle_ns / S,
            connection=connection,
            interpolator_ns=ratio * cycle_ns,
            cpu=cpu,
        )
        self.control_axis(axis, interpolator_ns=ratio * cycle_ns)
        if synchronous:
            leader = PositioningAxis(
                "leader",
                SimulatedDrivePort(cycle_s=cycle_ns / S),
                cycle_ns=cycle_ns,
                variables=REFERENCE | {"VirtualAxis.Mode": 1} | (leader_variables or {}),
                history=self.history,
                interpolator_ns=ratio * cycle_ns,
                cpu=cpu,
            )
            self.runtime.add(leader)
            self.leader = AxisHandle(self.runtime, leader)
            axis.leading_objects = (leader,)
            self.runtime.order_axes()
        self.rows: list[tuple[float, ...]] = []
        self.names = [name for name, _ in axis.trace_columns]
        self.runtime.after_cycle.append(lambda: self.rows.append((self.scheduler.now / S, *axis.trace_row())))
        self.runtime.start()

    def leader_at(self, velocity: float) -> None:
        """Let the enabled leading axis move with a constant velocity."""
        if not self.leader.object.states.facts.enabled:
            self.leader_power = self.leader.power()
            self.until(self.leader_power.status)
        if velocity:
            self.until(self.leader.move_velocity(velocity).in_velocity)

    def alarms_of(self, name: str) -> list[int]:
        """Numbers of the alarms that an object has raised so far."""
        return [event.data["number"] for event in self.events("alarm.raised") if event.source == name]

    def feed(self, instance, vectors) -> None:
        """Hand one set of inputs per application cycle to `instance`, before it is called."""
        for vector in vectors:
            instance.set(**vector)
            self.cycles()

    def column(self, name: str) -> list[float]:
        index = self.names.index(name) + 1
        return [row[index] for row in self.rows]

    def times(self) -> list[float]:
        return [row[0] for row in self.rows]

    def enabled(self, *, start_mode: int = 1) -> Rig:
        self.power = self.axis.power(start_mode=start_mode)
        self.until(self.power.status)
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


@pytest.fixture
def rig():
    return Rig()


@pytest.fixture
def make_rig():
    return Rig
