"""What the cases of `motion_in` share: a user program that computes setpoints, and how its vectors are found
again in the trace.
"""

from __future__ import annotations

from collections.abc import Callable
from math import copysign, inf, sqrt
from typing import Any, Final

from hil.campaign import CaseContext
from hil.expect import Expectation, job_output, no_alarm, status_word_bit, value_at
from testcases.campaigns.support import axis_name, drive_name, enable, settle_s

SIGN: Final = {"forward": 1.0, "backward": -1.0}
SPEED: Final = 200.0
"""Velocity of the cases, mm/s."""
ACCELERATION: Final = 800.0
"""What the drive of every bench can follow, mm/s2."""
AT_MAXIMUM: Final = 504
"""Warning: the speed setpoint would exceed what the drive can."""
FAULT_SPEED: Final = 150.0
"""Velocity at which something fails, mm/s."""
EXACT: Final = 1e-6
"""Deviation of a setpoint from the vector that was given, mm and mm/s: a multiple of the rounding of floating
point.
"""

Vector = Callable[[float], dict[str, float]]
"""Inputs of an instance by the time since its program has begun, s."""


class Program:
    """The user program in front of one instance: gives a vector with every call, and remembers what it gave.

    Args:
        ctx: Context of the case.
        vector: What is given; the instance is called at once afterwards.

    """

    def __init__(self, ctx: CaseContext, vector: Vector) -> None:
        self._bench = ctx.bench
        self._vector = vector
        self._job: Any = None
        self._since = 0.0
        self.given: list[tuple[float, dict[str, float]]] = []
        """Bench time in s and inputs of every call."""
        ctx.bench.runtime.call(self)  # before the instance, which is made afterwards

    def lead(self, job: Any) -> Any:
        """Give vectors to `job` from the next call of the program on; returns it."""
        self._job = job
        self._since = self._bench.now_s
        return job

    def end(self) -> None:
        """Give nothing more: what was given last stays."""
        self._bench.runtime.uncall(self)

    def __call__(self) -> None:
        job = self._job
        if job is None or not job.Enable:
            return
        now = float(self._bench.now_s)
        vector = self._vector(now - self._since)
        job.set(**vector)
        self.given.append((now, vector))

    def deviation(self, ctx: CaseContext, signal: str, name: str) -> float:
        """Return the greatest distance of a recorded setpoint from the input `name` of the application cycle
        before.
        """
        cycle = ctx.bench.interpolator_ns * 1e-9
        recorded = ctx.trace()[f"{axis_name(ctx)}.{signal}"]
        end = float(recorded.time_s[-1])
        return max(
            abs(recorded.at(time_s + cycle) - vector[name])
            for time_s, vector in self.given
            if time_s + cycle <= end
        )


def trapezoid(
    distance: float, velocity: float, acceleration: float
) -> Callable[[float], tuple[float, float, float]]:
    """Return position, velocity and acceleration by time of a motion from 0 to `distance`, as a program
    computes it.
    """
    way = abs(distance)
    top = min(velocity, sqrt(way * acceleration))
    ramp_s = top / acceleration
    travel_s = way / top + ramp_s
    sign = copysign(1.0, distance)

    def at(time_s: float) -> tuple[float, float, float]:
        if time_s <= 0.0:
            return 0.0, 0.0, 0.0
        if time_s < ramp_s:
            return sign * 0.5 * acceleration * time_s**2, sign * acceleration * time_s, sign * acceleration
        rest = travel_s - time_s
        if rest <= 0.0:
            return distance, 0.0, 0.0
        if rest < ramp_s:
            return (
                distance - sign * 0.5 * acceleration * rest**2,
                sign * acceleration * rest,
                -sign * acceleration,
            )
        return sign * top * (time_s - 0.5 * ramp_s), sign * top, 0.0

    return at


def ramp_to(velocity: float, acceleration: float = ACCELERATION) -> Vector:
    """Return the vector of a velocity that is ramped up and then kept, with the acceleration that belongs to
    it.
    """
    ramp_s = abs(velocity) / acceleration

    def at(time_s: float) -> dict[str, float]:
        if time_s < ramp_s:
            change = copysign(acceleration, velocity)
            return {"Velocity": change * time_s, "Acceleration": change}
        return {"Velocity": velocity, "Acceleration": 0.0}

    return at


def restart_with(ctx: CaseContext, **values: object) -> None:
    """Put start values into force: `FollowingError__EnableMonitoring=False`."""
    for name, value in values.items():
        path = name.replace("__", ".")
        ctx.axis.variables.write_start(path, value)
        ctx.do(f"start value {path} = {value}")
    ctx.do("MC_Reset Restart = TRUE")
    ctx.wait_until(ctx.axis.reset(restart=True).done, 5.0, "the axis is restarted")


def watch(ctx: CaseContext, *, watched: bool) -> None:
    """Watch the following error, or not at all, which lets the drive go to its own limits (MIN-007); before
    the axis is enabled.
    """
    restart_with(ctx, FollowingError__EnableMonitoring=watched)
    if watched:
        permit(ctx, 10.0)  # on the way to where the case begins


def permit(ctx: CaseContext, error_mm: float) -> None:
    """Permit so much following error at any velocity."""
    ctx.axis.write("FollowingError.MinValue", error_mm)
    ctx.axis.write("FollowingError.MaxValue", error_mm)


def under_way(ctx: CaseContext, velocity: float = SPEED) -> tuple[Any, Program]:
    """Enable the axis and travel by `MC_MotionInVelocity`; returns the instance and its program."""
    enable(ctx)
    program = Program(ctx, ramp_to(velocity))
    ctx.do(f"MC_MotionInVelocity, ramped up to {velocity:g} mm/s by the program")
    job = program.lead(ctx.axis.motion_in_velocity(0.0))
    ctx.run_for(abs(velocity) / ACCELERATION + 0.1 + settle_s(ctx))
    return job, program


def moving_position(ctx: CaseContext, velocity: float = SPEED) -> tuple[Any, Program]:
    """Enable the axis and travel by `MC_MotionInPosition`; returns the instance and its program."""
    enable(ctx)
    start = float(ctx.axis.var("Position"))
    sign = copysign(1.0, velocity)
    profile = trapezoid(sign * 10_000.0, abs(velocity), ACCELERATION)

    def vector(time_s: float) -> dict[str, float]:
        position, speed, acceleration = profile(time_s)
        return {"Position": start + position, "Velocity": speed, "Acceleration": acceleration}

    program = Program(ctx, vector)
    ctx.do(f"MC_MotionInPosition, ramped up to {velocity:g} mm/s by the program")
    job = program.lead(ctx.axis.motion_in_position(start))
    ctx.run_for(abs(velocity) / ACCELERATION + 0.1 + settle_s(ctx))
    return job, program


def superimposed(ctx: CaseContext, velocity: float) -> tuple[Any, Program]:
    enable(ctx)
    profile = trapezoid(10_000.0, velocity, 800.0)
    names = ("Distance", "VelocityDiff", "AccelerationDiff")
    program = Program(ctx, lambda time_s: dict(zip(names, profile(time_s), strict=True)))
    ctx.do(f"MC_MotionInSuperimposed, ramped up to {velocity:g} mm/s by the program")
    job = program.lead(ctx.axis.motion_in_superimposed(0.0))
    ctx.run_for(velocity / 800.0 + 0.1 + settle_s(ctx))
    return job, program


MODES: Final[dict[str, Callable[[CaseContext, float], tuple[Any, Program]]]] = {
    "velocity": under_way,
    "position": moving_position,
    "superimposed": superimposed,
}


def takes_part(ctx: CaseContext, *, at: float, state: int) -> None:
    """Expect `FunctionState` and the command bit of the basic MotionIn jobs, now."""
    ctx.measure(
        "StatusMotionIn.FunctionState", ctx.axis.var("StatusMotionIn.FunctionState"), low=state, high=state
    )
    ctx.expect(status_word_bit(31, state != 0, at=at, axis=axis_name(ctx)).covers("MIN-013"))


def ends_with(ctx: CaseContext, job: Any, output: str, *, since: float, error_id: int = 0) -> Expectation:
    """Expect an output of an instance to rise, and the outputs of the instance to say so now."""
    shown = (job.Busy, job.CommandAborted, job.Error, job.ErrorID)
    wanted = (False, output == "CommandAborted", output == "Error", error_id)
    ctx.measure(f"outputs of {job.name}", float(shown == wanted), low=1.0)
    if error_id:
        return job_output(job.name, output, since=since, error_id=error_id)
    return job_output(job.name, output, since=since)


def at_rest(
    ctx: CaseContext, *, since: float, place: float | None = None, besides: tuple[int, ...] = ()
) -> None:
    """Expect the axis at rest without an alarm but `besides`, at `place` if it is given, mm."""
    axis = axis_name(ctx)
    ctx.expect(
        no_alarm(since=since, axis=axis, besides=besides),
        value_at(f"{axis}.velocity_setpoint", ctx.now_s, 0.0, tolerance=EXACT),
        value_at(f"{drive_name(ctx)}.velocity", ctx.now_s, 0.0, tolerance=0.002),
    )
    if place is not None:
        ctx.expect(value_at(f"{axis}.actual_position", ctx.now_s, place, tolerance=0.1))


def largest_error(ctx: CaseContext, *, since: float, until: float = inf) -> float:
    """Return the greatest following error of an interval, mm."""
    part = ctx.trace()[f"{axis_name(ctx)}.following_error"].between(since, until)
    return float(abs(part.values).max(initial=0.0))
