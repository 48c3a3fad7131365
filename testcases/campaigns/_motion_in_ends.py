"""Cases of `motion_in`: vectors that are no numbers, and Enable that falls at speed."""

from __future__ import annotations

from math import inf, nan
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, job_output, state_at, status_word_bit, value_at
from testcases.campaigns._motion_in import (
    ACCELERATION,
    EXACT,
    Program,
    at_rest,
    ends_with,
    moving_position,
    permit,
    trapezoid,
    under_way,
    watch,
)
from testcases.campaigns.support import axis_name, enable, settle_s

CASES: Final = Campaign("motion in", tags=("motion-in",), bench="reference")

_BEYOND: Final = 1.1e12
"""More than any position or velocity that an input takes (MC-090)."""

_WRONG: Final[dict[str, dict[str, int]]] = {
    "velocity": {"Velocity": 0x8003, "Acceleration": 0x8004},
    "position": {"Position": 0x8009, "Velocity": 0x8003, "Acceleration": 0x8004},
    "superimposed": {"Distance": 0x8008, "VelocityDiff": 0x8003, "AccelerationDiff": 0x8004},
}
_VALUES: Final = {"nan": nan, "inf": inf, "minus-inf": -inf, "beyond": _BEYOND}


def _start(ctx: CaseContext, mode: str, **inputs: Any) -> Any:
    if mode == "velocity":
        return ctx.axis.motion_in_velocity(inputs.pop("Velocity", 0.0), **inputs)
    if mode == "position":
        return ctx.axis.motion_in_position(inputs.pop("Position", float(ctx.axis.var("Position"))), **inputs)
    return ctx.axis.motion_in_superimposed(inputs.pop("Distance", 0.0), **inputs)


@CASES.product(
    "wrong/{mode}/{name}/{value}",
    parameters=[
        {"mode": mode, "name": name, "value": value}
        for mode, names in _WRONG.items()
        for name, value in zip(names, ("nan", "inf", "beyond"), strict=False)
    ],
    title="MC_MotionIn ({mode}): {name} is {value}",
    requirements=("MC-076", "MC-085"),
)
def wrong(ctx: CaseContext, mode: str, name: str, value: str) -> None:
    """No number: rejected at the start; given later it ends the job as a falling Enable; a new edge with good
    values works again.
    """
    enable(ctx)
    since = ctx.now_s
    place = float(ctx.axis.var("Position"))
    error_id = _WRONG[mode][name]
    ctx.do(f"MC_MotionIn with {name} = {value} from the beginning")
    first = _start(ctx, mode, **{name: _VALUES[value]})
    ctx.run_for(0.05)
    ctx.expect(ends_with(ctx, first, "Error", since=since, error_id=error_id))
    ctx.do("MC_MotionIn with good values")
    job = _start(ctx, mode)
    ctx.run_for(0.1)
    ctx.measure("Busy", float(job.Busy), low=1.0)
    good = getattr(job, name)
    ctx.do(f"{name} = {value} while it runs")
    later = ctx.now_s
    job.set(**{name: _VALUES[value]})
    ctx.run_for(0.1)
    ctx.expect(ends_with(ctx, job, "Error", since=later, error_id=error_id))
    ctx.do("good values again, without an edge of Enable: nothing; with one: it runs")
    job.set(**{name: good})
    ctx.run_for(0.05)
    ctx.measure("Error without a new edge", float(job.Error), low=1.0)
    job.set(Enable=False)
    ctx.run_for(0.02)
    job.set(Enable=True)
    ctx.run_for(0.05)
    ctx.measure("Busy after a new edge", float(job.Busy and not job.Error), low=1.0)
    job.set(Enable=False)
    ctx.run_for(0.1 + settle_s(ctx))
    at_rest(ctx, since=since, place=place)


@CASES.product(
    "released/{mode}/{monitoring}",
    parameters={"mode": ("velocity", "position", "superimposed"), "monitoring": ("watched", "unwatched")},
    title="Enable falls at speed ({mode}, {monitoring})",
    requirements=("MIN-026", "MIN-027", "MIN-028", "MIN-040"),
)
def released(ctx: CaseContext, mode: str, monitoring: str) -> None:
    """The setpoint is zero in the next cycle, without a ramp; its place stays; the drive brakes at its own
    limit, or 521 comes.
    """
    axis, name = ctx.axis, axis_name(ctx)
    watched = monitoring == "watched"
    watch(ctx, watched=watched)
    speed = 450.0
    if mode == "velocity":
        job, program = under_way(ctx, speed)
    elif mode == "position":
        job, program = moving_position(ctx, speed)
    else:
        enable(ctx)
        profile = trapezoid(10_000.0, speed, ACCELERATION)

        def vector(time_s: float) -> dict[str, float]:
            distance, velocity, acceleration = profile(time_s)
            return {"Distance": distance, "VelocityDiff": velocity, "AccelerationDiff": acceleration}

        program = Program(ctx, vector)
        job = program.lead(axis.motion_in_superimposed(0.0))
        ctx.run_for(speed / ACCELERATION + 0.1 + settle_s(ctx))
    permit(ctx, 0.6)
    ctx.run_for(0.02)
    since = ctx.now_s
    ctx.do("Enable = FALSE")
    program.end()
    job.set(Enable=False)
    cycle = ctx.bench.interpolator_ns * 1e-9
    ctx.run_for(3 * cycle)
    place = float(axis.var("Position"))
    ctx.expect(
        value_at(f"{name}.velocity_setpoint", since + 2 * cycle, 0.0, tolerance=EXACT).covers(
            "MIN-026", "MIN-040"
        ),
        value_at(f"{name}.acceleration_setpoint", since + 2 * cycle, 0.0, tolerance=EXACT).covers("MIN-026"),
        job_output(job.name, "Done", since=since),
        status_word_bit(31, False, at=since + 3 * cycle, axis=name).covers("MIN-028"),
    )
    ctx.measure("Busy", float(job.Busy), high=0.0)
    ctx.run_for(0.8 + settle_s(ctx))
    if watched:
        ctx.expect(alarm(521, reaction=4, since=since, axis=name).covers("MIN-027"))
        return
    ctx.expect(
        state_at(name, ctx.now_s, "STANDSTILL"),
        value_at(f"{name}.position_setpoint", ctx.now_s, place, tolerance=EXACT).covers("MIN-027"),
    )
    at_rest(ctx, since=since, place=place)
