"""Every job of a positioning axis, as a running one and as a new one, in numbers of the axis under test."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from hil.campaign import CaseContext
from testcases.campaigns._instruction_outputs import Outputs, Watched
from testcases.campaigns.own_axis import Own, own
from testcases.campaigns.support import drive_name

_PASSIVE: Final = {"passive-2": 2, "passive-8": 8, "passive-10": 10}
_ACTIVE: Final = {"homing-3": 3, "homing-5": 5}


class Stage:
    """An axis that jobs are started on, one pair of them after the other, and the way back to where it began.

    Args:
        ctx: The case, its axis enabled.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self.ctx = ctx
        self.axis = ctx.axis
        self.values: Own = own(ctx)
        self.outputs = Outputs(ctx)
        self.sign = 1
        """Direction of the running job."""
        self._machine = f"{drive_name(ctx)}.position"
        self._off_the_mark()
        self._begun = self._at()

    # -- the axis ------------------------------------------------------------------------------------------

    @property
    def setpoint(self) -> float:
        """Position setpoint."""
        return float(self.axis.var("Position"))

    @property
    def velocity(self) -> float:
        """Velocity setpoint, position units per second."""
        return float(self.axis.var("Velocity")) * self.values.golden.velocity_unit

    def _off_the_mark(self) -> None:
        """Leave the place where the axis was switched on, which is a zero mark of many an encoder."""
        move = self.outputs.watch(self.axis.move_relative(self.values.way(0.0731), **self._quick()))
        self.outputs.until(move, "done", 5.0, "the axis stands beside the mark")
        self.outputs.release()

    def _at(self) -> float:
        return float(self.ctx.trace()[self._machine].values[-1])

    def given(self, share: float) -> float:
        """Return a share of the greatest velocity, as instructions want it."""
        return self.values.given(self.values.speed(share))

    def dynamics(self, name: str) -> dict[str, float]:
        """Return dynamic inputs without a limit of the jerk, so that nothing takes longer than it has to."""
        return self.values.dynamics(name).without_jerk().inputs

    def back(self) -> None:
        """End whatever runs, bring the machine back to where it began, and make that position 0 again."""
        if self.axis.var("StatusWord.X1"):
            self.ctx.run_for(0.5)
            self.ctx.wait_until(self.axis.reset().done, 5.0, "the alarm is acknowledged")
            self.ctx.wait_until(self.axis.power_instance.status, 5.0, "the axis is enabled again")
        stop = self.outputs.watch(self.axis.stop(0))
        self.outputs.until(stop, "done", 5.0, "MC_Stop has ended what ran")
        self.outputs.release()
        machine_m = self.values.golden.machine_m
        self.home(round((self._at() - self._begun) / machine_m, 9))
        move = self.outputs.watch(self.axis.move_absolute(0.0, Velocity=self.given(0.71), **self._quick()))
        self.outputs.until(move, "done", 8.0, "the axis is back")
        self.outputs.release()

    def _quick(self) -> dict[str, float]:
        limits = self.values.golden
        return {
            "Acceleration": 0.83 * limits.maximum_acceleration,
            "Deceleration": 0.81 * limits.maximum_deceleration,
            "Jerk": 0.0,
        }

    def home(self, position: float) -> None:
        """Give the present place a position."""
        job = self.outputs.watch(self.axis.home(position))
        self.outputs.until(job, "done", 2.0, "the position is set")
        self.outputs.release()

    # -- running jobs --------------------------------------------------------------------------------------

    def run(self, job: str, calls: int) -> Watched:
        """Start a job and let it run for so many calls of the program."""
        if job in {"halt", "halt-basic", "stop"}:
            watched = self._braking(job)
        elif job == "halt-superimposed":
            watched = self._halting_superimposed()
        elif job.endswith("-waiting"):
            first = self.start("relative", 0.9, "first")
            self.outputs.calls(2)
            del first
            watched = self.outputs.watch(self.start(f"{job.partition('-')[0]}-buffered", 0.3, "running"))
        else:
            watched = self.outputs.watch(self.start(job, 0.9, "running"))
        self.outputs.calls(calls)
        return watched

    def new(self, job: str) -> Watched:
        """Start a job on top of a running one: other values, the other direction."""
        if job == "disable":
            self.axis.power(False, stop_mode=2)
            return Watched(self.axis.power_instance)
        return self.outputs.watch(self.start(job, -0.13, "new"))

    def start(self, job: str, way: float, name: str) -> Any:
        """Start a job with a way, a share of what the axis travels in a second; another name gives it other
        dynamic values.
        """
        axis, share = self.axis, 0.37 if name == "running" else 0.52
        distance = self.sign * self.values.way(way)
        velocity = self.given(share)
        signed = np.copysign(velocity, distance)
        kind, _, buffered = job.partition("-")
        dynamics: dict[str, Any] = self.dynamics(name)
        if job in _PASSIVE:
            return axis.home(distance, mode=_PASSIVE[job])
        if job in _ACTIVE:
            return axis.home(distance, mode=_ACTIVE[job])
        if kind in {"absolute", "relative"}:
            move = axis.move_absolute if kind == "absolute" else axis.move_relative
            if buffered:
                dynamics["BufferMode"] = 1
            return move(distance, Velocity=velocity, **dynamics)
        makers: dict[str, Callable[[], Any]] = {
            "velocity": lambda: axis.move_velocity(signed, **dynamics),
            "jog": lambda: axis.jog(velocity, backward=bool(distance < 0.0), **dynamics),
            "halt": lambda: axis.halt(**self._braking_inputs()),
            "halt-basic": lambda: axis.halt(Mode=1, **self._braking_inputs()),
            "stop": lambda: axis.stop(0),
            "superimposed": lambda: axis.move_superimposed(
                0.4 * distance, VelocityDiff=self.given(0.23), **dynamics
            ),
            "halt-superimposed": axis.halt_superimposed,
            "motion-in-superimposed": lambda: axis.motion_in_superimposed(0.0),
            "motion-in-velocity": lambda: self._motion_in("velocity", signed),
            "motion-in-position": lambda: self._motion_in("position", signed),
            "cancel-homing": lambda: axis.home(mode=9),
            "position-set": lambda: axis.home(self.setpoint, mode=11),
            "position-shifted": lambda: axis.home(0.0, mode=12),
            "reset": axis.reset,
            "parameter": lambda: axis.write_parameter(1000, bool(axis.var("PositionLimits_HW.Active"))),
        }
        return makers[job]()

    def _motion_in(self, kind: str, wanted: float) -> Any:
        """Lead the axis from the velocity that it has to another one, with a steady acceleration."""
        values, seconds = self.values, self.values.call_s
        unit = values.golden.velocity_unit
        step = 0.35 * values.golden.maximum_acceleration * seconds
        position, velocity = self.setpoint + self.velocity * seconds, self.velocity
        job: Any
        if kind == "velocity":
            job = self.axis.motion_in_velocity(velocity / unit)
        else:
            job = self.axis.motion_in_position(position, Velocity=velocity / unit)

        def lead() -> None:
            nonlocal position, velocity
            velocity += min(max(wanted * unit - velocity, -step), step)
            position += velocity * seconds
            if kind == "velocity":
                job.set(Velocity=velocity / unit)
            else:
                job.set(Position=position, Velocity=velocity / unit)

        self.outputs.feed(lead)
        return job

    def _braking_inputs(self) -> dict[str, float]:
        return {"Deceleration": 0.11 * self.values.golden.maximum_deceleration, "Jerk": 0.0}

    def _braking(self, job: str) -> Watched:
        """Let there be something to brake, so slowly that it lasts."""
        self.travel(0.6)
        axis, inputs = self.axis, self._braking_inputs()
        if job == "stop":
            return self.outputs.watch(axis.stop(3, **inputs))
        return self.outputs.watch(axis.halt(Mode=int(job == "halt-basic"), **inputs))

    def travel(self, share: float) -> Watched:
        """Let the axis move with a share of its greatest velocity."""
        velocity = self.sign * self.given(share)
        job = self.outputs.watch(self.axis.move_velocity(velocity, **self._quick()))
        self.outputs.until(job, "success", 3.0, "the velocity is reached")
        return job

    def _halting_superimposed(self) -> Watched:
        quick = self._quick()
        self.axis.move_superimposed(self.sign * self.values.way(0.9), VelocityDiff=self.given(0.4), **quick)
        self.ctx.run_for(self.values.speed(0.4) / quick["Acceleration"] + 0.02)
        return self.outputs.watch(self.axis.halt_superimposed(**self._braking_inputs()))


def stage(ctx: CaseContext) -> Stage:
    """Return the axis of a case, enabled and homed at 0, with its jobs."""
    axis = ctx.axis
    ctx.do("MC_Power, MC_Home Mode 0")
    ctx.wait_until(axis.power().status, 5.0, "the axis is enabled")
    made = Stage(ctx)
    made.home(0.0)
    return made
