"""What one axis costs the controller in one cycle: inputs, monitoring, setpoint,
control, outputs, its instructions.

No bus and no drive take part: the port of the axis returns its own setpoint as actual
value, and nothing is recorded.
"""

from __future__ import annotations

import gc
import statistics
import time
from collections.abc import Callable
from typing import Any, Final, TypeVar

from typing_extensions import override

from fieldbus.clock import VirtualScheduler
from hil._commands._measurements import Figure
from hil.errors import CannotRunError
from motion.drives.port import STW1_OPERATE, DrivePort
from motion.kernel.cams import Point
from motion.s7.axis import PositioningAxis, SynchronousAxis, TechnologyAxis
from motion.s7.cams import Cam
from motion.s7.instructions import (
    MC_CamIn,
    MC_GearIn,
    MC_Home,
    MC_InterpolateCam,
    MC_MoveAbsolute,
    MC_MoveVelocity,
    MC_Power,
)
from motion.s7.instructions.base import Instruction
from motion.s7.runtime import Runtime

_Job = TypeVar("_Job", bound=Instruction)
_Axis = TypeVar("_Axis", bound=PositioningAxis | SynchronousAxis)
CYCLE_NS: Final = 1_000_000
STATES: Final = ("standstill", "velocity", "positioning")
FOLLOWERS: Final = ("gearing", "camming")
"""What `RunningFollowers` do."""
AXES: Final = 4

_STEPS: Final = 131072
_VELOCITY: Final = 300.0
_VARIABLES: Final = {
    "Mechanics.LeadScrew": 10.0,
    "Sensor[1].Parameter.StepsPerRevolution": _STEPS,
    "Sensor[1].Parameter.FineResolutionXist1": 0,
    "DynamicLimits.MaxAcceleration": 10000.0,
    "DynamicLimits.MaxDeceleration": 10000.0,
    "DynamicDefaults.Acceleration": 2000.0,
    "DynamicDefaults.Deceleration": 2000.0,
    "DynamicDefaults.Jerk": 20000.0,
    "PositionControl.Kv": 20.0,
}


class EchoPort(DrivePort):
    """A drive that turns with the setpoint at once, and costs next to nothing."""

    def __init__(self, cycle_s: float) -> None:
        super().__init__()
        self._angle = 0.0
        self._increments_per_rpm = cycle_s / 60.0 * _STEPS
        self.link_ok = True
        self.zsw1 = 0x0231

    @override
    def read(self) -> None:
        self._angle += self.actual_speed_rpm * self._increments_per_rpm
        self.encoder_increments = int(self._angle)

    @override
    def write(self, stw1: int, speed_rpm: float, torque_nm: float = 0.0) -> None:
        self.actual_speed_rpm = speed_rpm
        self.zsw1 = 0x0237 if stw1 == STW1_OPERATE else 0x0231


class RunningAxes:
    """A controller with axes in one state of motion; `run` is what is timed.

    Args:
        state: One of `STATES`.
        count: Number of axes.

    Raises:
        CannotRunError: The axes do not come into that state.

    """

    def __init__(self, state: str, count: int = 1) -> None:
        self.runtime = Runtime(VirtualScheduler(), cycle_ns=CYCLE_NS)
        self.axes: list[PositioningAxis] = []
        self._moves: list[MC_MoveAbsolute] = []
        for number in range(1, count + 1):
            port = EchoPort(CYCLE_NS * 1e-9)
            axis = PositioningAxis(f"axis{number}", port, cycle_ns=CYCLE_NS, variables=_VARIABLES)
            self.axes.append(axis)
            self.runtime.add(axis)
            self._call(MC_Power(axis, Enable=True, StartMode=1))
        self.run(50)
        self._each(MC_Home, Execute=True)
        self.run(20)
        if state == "velocity":
            self._each(MC_MoveVelocity, Execute=True, Velocity=_VELOCITY)
        elif state == "positioning":
            self._moves = self._each(MC_MoveAbsolute, Velocity=_VELOCITY)
        self.run(1000)
        if not all(axis.states.facts.enabled and axis.homed for axis in self.axes):
            raise CannotRunError("the axes of the benchmark could not be enabled")
        if (state != "standstill") is not any(axis.actual_velocity for axis in self.axes):
            raise CannotRunError(f"the axes of the benchmark are not in the state {state}")

    def _call(self, instance: _Job) -> _Job:
        self.runtime.call(instance)
        return instance

    def _each(self, instruction: Callable[..., _Job], **inputs: float) -> list[_Job]:
        return [self._call(instruction(axis, **inputs)) for axis in self.axes]

    def run(self, cycles: int) -> None:
        """Let `cycles` application cycles pass; positionings that have ended
        begin again in the other direction.
        """
        cycle = self.runtime.task.cycle
        if not self._moves:
            for _ in range(cycles):
                cycle()
            return
        moves = self._moves
        for number in range(cycles):
            if number % 8 == 0:
                for move in moves:
                    if move.Execute and move.Done:
                        move.Execute = False
                    elif not move.Execute:
                        move.Position = 0.0 if move.Position else 100.0
                        move.Execute = True
            cycle()


class RunningFollowers:
    """A controller with a leading axis at constant velocity and axes that follow it; `run` is what is timed.

    Args:
        kind: One of `FOLLOWERS`.
        count: Number of followers.

    Raises:
        CannotRunError: They do not follow.

    """

    def __init__(self, kind: str, count: int) -> None:
        self.runtime = Runtime(VirtualScheduler(), cycle_ns=CYCLE_NS)
        leader = self._axis(PositioningAxis, "leader")
        followers = [self._axis(SynchronousAxis, f"follower{number}") for number in range(count)]
        for follower in followers:
            follower.leading_objects = (leader,)
        self.axes: tuple[TechnologyAxis, ...] = (leader, *followers)
        """The leading one first."""
        for axis in self.axes:
            self._call(MC_Power(axis, Enable=True, StartMode=1))
        self.run(50)
        for axis in self.axes:
            self._call(MC_Home(axis, Execute=True))
        cam = Cam("cam", points=[Point(0.0, 0.0), Point(50.0, 20.0), Point(100.0, 0.0)])
        self.runtime.add_cam(cam)
        self._call(MC_InterpolateCam(cam, Execute=True))
        self.run(20)
        self._call(MC_MoveVelocity(leader, Execute=True, Velocity=_VELOCITY))
        jobs: list[MC_GearIn | MC_CamIn] = []
        how: dict[str, Any] = {"Master": leader, "Execute": True}
        if kind == "camming":
            how |= {"Cam": cam, "SyncProfileReference": 2, "ApplicationMode": 1}
        for follower in followers:
            job = MC_CamIn(follower, **how) if kind == "camming" else MC_GearIn(follower, **how)
            jobs.append(self._call(job))
        self.run(1000)
        if not all(job.InGear if isinstance(job, MC_GearIn) else job.InSync for job in jobs):
            raise CannotRunError("the followers of the benchmark do not follow")

    def _axis(self, made: type[_Axis], name: str) -> _Axis:
        axis = made(name, EchoPort(CYCLE_NS * 1e-9), cycle_ns=CYCLE_NS, variables=_VARIABLES)
        self.runtime.add(axis)
        return axis

    def _call(self, instance: _Job) -> _Job:
        self.runtime.call(instance)
        return instance

    def run(self, cycles: int) -> None:
        """Let `cycles` application cycles pass."""
        cycle = self.runtime.task.cycle
        for _ in range(cycles):
            cycle()


def follower_cycles(cycles: int = 1500, rounds: int = 7) -> list[Figure]:
    """Return microseconds per following axis and cycle, and how many times that of a positioning axis it is:
    in each round the leading axis alone, with followers, and positioning axes take turns.
    """
    positioning, alone = RunningAxes("positioning", AXES), RunningAxes("velocity", 1)
    following = {kind: RunningFollowers(kind, AXES) for kind in FOLLOWERS}
    costs: dict[str, list[float]] = {kind: [] for kind in ("positioning", *FOLLOWERS)}

    def timed(run: Callable[[int], None]) -> float:
        started = time.process_time()
        run(cycles)
        return (time.process_time() - started) / cycles

    gc.collect()
    for _ in range(rounds):
        leading = timed(alone.run)
        costs["positioning"].append(timed(positioning.run) / AXES)
        for kind, running in following.items():
            costs[kind].append((timed(running.run) - leading) / AXES)
    figures = []
    for kind in FOLLOWERS:
        cost = statistics.median(costs[kind])
        share = statistics.median(
            one / other for one, other in zip(costs[kind], costs["positioning"], strict=True)
        )
        figures.append(Figure(f"axis_cycle_{kind}", cost * 1e6, "us/axis"))
        figures.append(Figure(f"axis_cycle_{kind}_to_positioning", share, "times"))
    return figures


def axis_cycles(cycles: int = 4000, rounds: int = 7) -> list[Figure]:
    """Return microseconds per axis and cycle: one axis in each state, and several positioning."""
    figures = []
    cases = [(state, 1) for state in STATES] + [("positioning", AXES)]
    for state, count in cases:
        running = RunningAxes(state, count)
        times = []
        gc.collect()
        for _ in range(rounds):
            started = time.perf_counter()
            running.run(cycles // count)
            times.append((time.perf_counter() - started) / (cycles // count * count))
        name = f"axis_cycle_{state}" if count == 1 else f"axis_cycle_{count}axes_{state}"
        figures.append(Figure(name, statistics.median(times) * 1e6, "us/axis"))
    return figures
