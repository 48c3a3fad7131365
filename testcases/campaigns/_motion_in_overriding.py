"""Cases of `motion_in`: who overrides whom, from which state, and what is superimposed on what."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import job_output, never_happens, no_alarm, stays_within, value_at
from hil.record import event
from testcases.campaigns._motion_in import (
    EXACT,
    at_rest,
    ends_with,
    moving_position,
    takes_part,
    under_way,
)
from testcases.campaigns.support import axis_name, drive_name, enable, settle_s

CASES: Final = Campaign("motion in", tags=("motion-in", "overriding"), bench="reference")

_TRAVEL: Final = 80.0
"""Velocity from which jobs take over, mm/s."""
_DYNAMICS: Final = {"Acceleration": 400.0, "Deceleration": 400.0, "Jerk": 0.0}


def _take_over(ctx: CaseContext, by: str) -> Any:
    """Start a job that overrides; positioning ends 60 mm ahead."""
    axis = ctx.axis
    ctx.do(by)
    if by == "halt":
        return axis.halt(Deceleration=100.0, Jerk=0.0)
    if by == "halt-basic":
        return axis.halt(Deceleration=100.0, Jerk=0.0, Mode=1)
    if by == "stop":
        return axis.stop(0)
    if by == "move-absolute":
        return axis.move_absolute(float(axis.var("Position")) + 60.0, Velocity=_TRAVEL, **_DYNAMICS)
    if by == "move-relative":
        return axis.move_relative(60.0, Velocity=_TRAVEL, **_DYNAMICS)
    if by == "move-velocity":
        return axis.move_velocity(0.5 * _TRAVEL, **_DYNAMICS)
    if by == "jog":
        return axis.jog(0.5 * _TRAVEL, **_DYNAMICS)
    if by == "motion-in-velocity":
        return axis.motion_in_velocity(0.5 * _TRAVEL)
    return axis.motion_in_position(float(axis.var("Position")) + _TRAVEL * ctx.bench.interpolator_ns * 1e-9)


_TAKERS: Final = {
    "velocity": (
        "halt",
        "halt-basic",
        "stop",
        "move-absolute",
        "move-relative",
        "move-velocity",
        "jog",
        "motion-in",
    ),
    "position": ("halt", "stop", "move-relative", "motion-in"),
}


@CASES.product(
    "overridden/{job}/{by}",
    parameters=[{"job": job, "by": by} for job, takers in _TAKERS.items() for by in takers],
    title="MC_MotionIn ({job}) is overridden by {by}",
    requirements=("MIN-043", "MIN-044", "MIN-047", "MIN-050"),
)
def overridden(ctx: CaseContext, job: str, by: str) -> None:
    """CommandAborted until Enable falls; the new motion starts from the given state, without a step; a new
    edge takes over again.
    """
    axis, name = ctx.axis, axis_name(ctx)
    axis.home(0.0)
    running, program = (under_way if job == "velocity" else moving_position)(ctx, _TRAVEL)
    program.end()
    other = "position" if job == "velocity" else "velocity"
    since = ctx.now_s
    taker = _take_over(ctx, f"motion-in-{other}" if by == "motion-in" else by)
    cycle = ctx.bench.interpolator_ns * 1e-9
    ctx.run_for(4 * cycle)
    ctx.expect(ends_with(ctx, running, "CommandAborted", since=since).covers("MIN-047"))
    takes_part(ctx, at=ctx.now_s, state={"velocity": 1, "position": 2}[other] if by == "motion-in" else 0)
    if by != "motion-in":
        deceleration = {"halt": 100.0, "halt-basic": 100.0, "stop": 4000.0}.get(by, _DYNAMICS["Acceleration"])
        ctx.expect(
            value_at(
                f"{name}.velocity_setpoint", since + 2 * cycle, _TRAVEL, tolerance=1.1 * deceleration * cycle
            )
            .named("the new motion starts from the given velocity")
            .covers("MIN-044")
        )
    if by in ("halt", "halt-basic"):
        ctx.wait_until(taker.done, 3.0, "the halt is done")
        ctx.expect(
            value_at(
                f"{name}.velocity_setpoint",
                since + 0.5 * _TRAVEL / 100.0,
                0.5 * _TRAVEL,
                tolerance=100.0 * 3 * cycle,
            )
            .named("half of the ramp of 0.8 s")
            .covers("MIN-044"),
            stays_within(f"{name}.velocity_setpoint", high=EXACT, since=since + _TRAVEL / 100.0 + 3 * cycle),
        )
    elif by in ("move-absolute", "move-relative", "stop"):
        ctx.wait_until(taker.done, 3.0, "the job that has taken over is done")
    else:
        ctx.run_for(0.3)
        taker.set(**{"Enable": False} if by == "motion-in" else {"JogForward": False} if by == "jog" else {})
        if by == "move-velocity":
            ctx.wait_until(axis.halt().done, 3.0, "the axis has halted")
    ctx.run_for(0.4 + settle_s(ctx))
    ctx.measure(
        "CommandAborted while Enable is TRUE",
        float(running.CommandAborted),
        low=1.0,
        requirements=("MIN-050",),
    )
    ctx.expect(
        never_happens(event("job.started", name, job=running.name), since=since, until=ctx.now_s).covers(
            "MIN-050"
        )
    )
    if by == "stop":
        taker.set(Execute=False)
        ctx.run_for(0.05)
    at_rest(ctx, since=since)
    if by == "motion-in":
        return
    ctx.do("a new rising edge of Enable")
    running.set(Enable=False)
    ctx.run_for(0.02)
    ctx.measure("CommandAborted without Enable", float(running.CommandAborted), high=0.0)
    ctx.expect(never_happens(event("job.error", name)))
    _restart(ctx, running, job)


def _restart(ctx: CaseContext, running: Any, job: str) -> None:
    """Give a new edge with a vector of rest, and expect it to take over."""
    vector = {"Velocity": 0.0, "Acceleration": 0.0}
    if job == "position":
        vector["Position"] = float(ctx.axis.var("Position"))
    running.set(Enable=True, **vector)
    ctx.run_for(0.05)
    ctx.measure("Busy after the new edge", float(running.Busy), low=1.0, requirements=("MIN-050",))


_ACTIVE: Final = ("positioning", "waiting", "velocity", "jog", "halt", "superimposed", "motion-in")


@CASES.product(
    "overrides/{active}/{job}",
    parameters=[
        *({"active": active, "job": "velocity"} for active in _ACTIVE),
        *({"active": active, "job": "position"} for active in ("positioning", "halt", "superimposed")),
    ],
    title="MC_MotionIn ({job}) overrides {active}",
    requirements=("MIN-006", "MIN-048"),
)
def overrides(ctx: CaseContext, active: str, job: str) -> None:
    """The vector is the setpoint of the next cycle, whatever moved before; what was active or waited is
    aborted.
    """
    axis, name = ctx.axis, axis_name(ctx)
    enable(ctx)
    aborted = _something(ctx, active)
    since = ctx.now_s
    cycle = ctx.bench.interpolator_ns * 1e-9
    place, velocity = float(axis.var("Position")), float(axis.var("Velocity"))
    ctx.do(f"MC_MotionIn ({job}), 5 mm/s less than the axis has")
    given = velocity - 5.0
    if job == "velocity":
        running = axis.motion_in_velocity(given)
    else:
        running = axis.motion_in_position(place + velocity * cycle, Velocity=given)
    ctx.run_for(3 * cycle)
    ctx.expect(
        value_at(f"{name}.velocity_setpoint", since + 2 * cycle, given, tolerance=EXACT).covers("MIN-006"),
        no_alarm(since=since, axis=name),
        *(ends_with(ctx, one, "CommandAborted", since=since).covers("MIN-048") for one in aborted),
    )
    ctx.measure("Busy", float(running.Busy), low=1.0)
    takes_part(ctx, at=ctx.now_s, state=1 if job == "velocity" else 2)
    if job == "position":
        running.set(Position=float(axis.var("Position")), Velocity=0.0)
    ctx.run_for(0.1)
    running.set(Enable=False)
    ctx.run_for(0.4 + settle_s(ctx))
    at_rest(ctx, since=since)


def _something(ctx: CaseContext, active: str) -> list[Any]:
    """Let the axis do something; returns the instances that a basic MotionIn job aborts."""
    axis = ctx.axis
    slow = {"Velocity": 40.0, **_DYNAMICS}
    if active in ("positioning", "waiting", "superimposed"):
        jobs = [axis.move_relative(200.0, **slow)]
        ctx.run_for(0.3)
        if active == "waiting":
            jobs.append(axis.move_relative(10.0, BufferMode=1, **slow))
        elif active == "superimposed":
            jobs.append(axis.move_superimposed(20.0, VelocityDiff=10.0))
        ctx.run_for(0.2)
        return jobs
    if active == "velocity":
        jobs = [axis.move_velocity(40.0, **_DYNAMICS)]
    elif active == "jog":
        jobs = [axis.jog(40.0, **_DYNAMICS)]
    elif active == "motion-in":
        jobs = [axis.motion_in_velocity(10.0)]
    else:
        axis.move_velocity(40.0, **_DYNAMICS)
        ctx.run_for(0.4)
        jobs = [axis.halt(Deceleration=50.0, Jerk=0.0)]
        ctx.run_for(0.2)
        return jobs
    ctx.run_for(0.4)
    return jobs


@CASES.product(
    "not-aborted/{by}",
    parameters={"by": ("superimposed", "waiting", "end-of-passive-homing", "reset")},
    title="MC_MotionInVelocity goes on under {by}",
    requirements=("MIN-047", "MIN-038"),
)
def not_aborted(ctx: CaseContext, by: str) -> None:
    """What is superimposed, what waits, MC_Home Mode 9 and MC_Reset leave it in control."""
    axis, name = ctx.axis, axis_name(ctx)
    running, _ = under_way(ctx, 40.0)
    since = ctx.now_s
    ctx.do(by)
    if by == "superimposed":
        other: Any = axis.move_superimposed(10.0)
    elif by == "waiting":
        other = axis.move_relative(10.0, BufferMode=1)
    elif by == "reset":
        other = axis.reset()
    else:
        other = axis.home(0.0, mode=9)
    ctx.run_for(1.0 + settle_s(ctx))
    ctx.measure("Busy", float(running.Busy), low=1.0)
    waits = by == "waiting"
    ctx.measure("the other has ended", float(other.Done), low=float(not waits), high=float(not waits))
    running.set(Enable=False)
    ctx.run_for(0.8 + settle_s(ctx))
    ctx.expect(
        job_output(running.name, "Done", since=since),
        never_happens(event("job.aborted", name, job=running.name)).covers("MIN-047"),
    )
    ctx.measure("the other has ended at last", float(other.Done), low=1.0)
    at_rest(ctx, since=since)


@CASES.case("locked-by-stop", title="MC_Stop holds the axis", requirements=("MIN-048",))
def locked_by_stop(ctx: CaseContext) -> None:
    """A basic MotionIn job does not abort MC_Stop: it is rejected while Execute is TRUE, and runs
    afterwards.
    """
    running, program = under_way(ctx, _TRAVEL)
    program.end()
    since = ctx.now_s
    stop = ctx.axis.stop(0)
    ctx.wait_until(stop.done, 2.0, "the axis has stopped")
    late = ctx.axis.motion_in_velocity(20.0)
    ctx.run_for(0.1)
    ctx.expect(
        ends_with(ctx, running, "CommandAborted", since=since).covers("MIN-047"),
        ends_with(ctx, late, "Error", since=since, error_id=0x800F).covers("MIN-048"),
    )
    stop.set(Execute=False)
    late.set(Enable=False)
    ctx.run_for(0.1)
    late.set(Enable=True)
    ctx.run_for(0.3)
    ctx.expect(value_at(f"{drive_name(ctx)}.velocity", ctx.now_s, 0.02, tolerance=0.001))
    late.set(Enable=False)
    ctx.run_for(0.3 + settle_s(ctx))
    at_rest(ctx, since=since)


@CASES.product(
    "acceleration-of-nothing/{given}/{jerk}",
    parameters=[
        {"given": 400.0, "jerk": 500.0},
        {"given": 400.0, "jerk": 0.0},
        {"given": 0.0, "jerk": 500.0},
    ],
    title="Acceleration {given} is given at constant velocity, the job that takes over has a jerk of {jerk}",
    requirements=("MIN-024", "MIN-045", "MIN-046"),
)
def acceleration_of_nothing(ctx: CaseContext, given: float, jerk: float) -> None:
    """With jerk the velocity runs away by a²/2j before the job has it; without jerk, or with 0 given, it does
    not.
    """
    name = axis_name(ctx)
    running, program = under_way(ctx, _TRAVEL)
    program.end()
    since = ctx.now_s
    running.set(Acceleration=given)
    ctx.run_for(0.05)
    ctx.do("MC_MoveVelocity with the velocity that the axis has")
    ctx.axis.move_velocity(_TRAVEL, Acceleration=2000.0, Deceleration=2000.0, Jerk=jerk)
    ctx.run_for(1.2)
    highest = _TRAVEL + (given**2 / (2.0 * jerk) if jerk else 0.0)
    cycle = ctx.bench.interpolator_ns * 1e-9
    seen = ctx.trace()[f"{name}.velocity_setpoint"].between(since, ctx.now_s)
    ctx.measure(
        "highest velocity setpoint",
        float(max(seen.values)),
        "mm/s",
        low=highest - given * cycle - EXACT,
        high=highest + given * cycle + EXACT,
        requirements=("MIN-045" if highest > _TRAVEL else "MIN-046",),
    )
    ctx.wait_until(ctx.axis.halt().done, 5.0, "the axis has halted")
    ctx.run_for(0.2 + settle_s(ctx))
    at_rest(ctx, since=since)


@CASES.case(
    "turns",
    title="two programs take the axis from each other",
    requirements=("MIN-047", "MIN-048", "MIN-050"),
)
def turns(ctx: CaseContext) -> None:
    """Two instances whose Enable alternates with every call: always the one with the last edge has the axis,
    and none stays behind.
    """
    axis, name = ctx.axis, axis_name(ctx)
    enable(ctx)
    since = ctx.now_s
    calls = [0]
    pair: list[Any] = []

    def alternate() -> None:
        if len(pair) == 2:
            calls[0] += 1
            for number, one in enumerate(pair):
                one.set(Enable=calls[0] % 2 == number)

    ctx.bench.runtime.call(alternate)
    first = axis.motion_in_velocity(10.0)
    second = axis.motion_in_velocity(-10.0)
    pair.extend((first, second))
    ctx.do("two MC_MotionInVelocity, whose Enable alternates with every call")
    ctx.run_for(100 * ctx.bench.interpolator_ns * 1e-9)
    ctx.bench.runtime.uncall(alternate)
    ctx.expect(
        stays_within(f"{name}.velocity_setpoint", low=-10.0 - EXACT, high=10.0 + EXACT, since=since),
        no_alarm(since=since, axis=name),
        never_happens(event("job.error", name), since=since),
    )
    ctx.measure("instances in control", float(first.Busy + second.Busy), high=1.0)
    first.set(Enable=False)
    second.set(Enable=False)
    ctx.run_for(0.3 + settle_s(ctx))
    ctx.measure("distance", abs(float(axis.var("ActualPosition"))), "mm", high=1.0)
    at_rest(ctx, since=since)
