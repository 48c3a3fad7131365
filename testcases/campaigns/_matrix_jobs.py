"""Words of a matrix: motion jobs, and the moments of them at which something happens."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import CaseContext
from testcases.campaigns.own_axis import Dynamics, Own, own

JOBS: Final = {
    "velocity": "MC_MoveVelocity",
    "velocity-backward": "MC_MoveVelocity backwards",
    "absolute": "MC_MoveAbsolute",
    "relative": "MC_MoveRelative",
    "relative-backward": "MC_MoveRelative backwards",
    "jog": "MC_MoveJog",
    "jog-backward": "MC_MoveJog backwards",
}
MOMENTS: Final = {
    "starting": "as it starts",
    "accelerating": "while it accelerates",
    "constant": "at constant velocity",
    "decelerating": "while it decelerates",
    "arriving": "as it arrives",
    "standstill": "at standstill",
}
_CRAWL_SHARE: Final = 0.02
"""Velocity below which a job is starting or arriving, as a share of the maximum velocity."""


def direction_of(job: str) -> int:
    """Return in which direction a job travels."""
    return -1 if job.endswith("-backward") else 1


def bring(ctx: CaseContext, job: str, moment: str) -> Any:
    """Start a job and let it come to a moment; returns its instance, None at standstill, where none has been
    started.
    """
    if moment == "standstill":
        ctx.run_for(0.1)
        return None
    sign, values = direction_of(job), own(ctx)
    crawl = values.speed(_CRAWL_SHARE)
    velocity = values.velocity if moment == "constant" else values.fast
    instance = _start(ctx, job.partition("-")[0], sign, velocity)
    now = _velocity(ctx, sign)
    if moment == "starting":
        ctx.wait_until(lambda: now() >= crawl / 2, 5.0, "the axis has started")
    elif moment == "accelerating":
        ctx.wait_until(
            lambda: now() >= values.velocity,
            5.0,
            f"{values.words(values.velocity)} are passed while accelerating",
        )
    else:
        reached = velocity * (1.0 - 1e-9)
        ctx.wait_until(lambda: now() >= reached, 5.0, f"{values.words(velocity)} are reached")
        if moment == "constant":
            ctx.run_for(0.1)
        else:
            instance = _brake(ctx, job.partition("-")[0], instance)
            limit = values.velocity if moment == "decelerating" else crawl
            ctx.wait_until(lambda: now() <= limit, 5.0, f"{values.words(limit)} are passed while braking")
    return instance


def _velocity(ctx: CaseContext, sign: int) -> Any:
    motion = ctx.axis.motion
    return lambda: motion.gen.v * sign


def _travel(values: Own) -> float:
    """Return a travel on which the highest velocity is reached, shortly before the axis brakes."""
    job = values.dynamics()
    accelerating = Dynamics(0.0, job.acceleration, job.jerk).stop(values.fast).distance
    return accelerating + job.stop(values.fast).distance + values.way(0.02)


def _start(ctx: CaseContext, kind: str, sign: int, velocity: float) -> Any:
    axis, values = ctx.axis, own(ctx)
    inputs, travel = values.dynamics().inputs, _travel(values)
    with_velocity = {"Velocity": values.given(velocity), **inputs}
    if kind == "velocity":
        ctx.do(f"MC_MoveVelocity {values.words(sign * velocity)}")
        return axis.move_velocity(values.given(sign * velocity), **inputs)
    if kind == "jog":
        ctx.do(f"MC_MoveJog {values.words(sign * velocity)}")
        return axis.jog(values.given(velocity), backward=sign < 0, **inputs)
    if kind == "relative":
        ctx.do(f"MC_MoveRelative {sign * travel:.5g} {values.unit} with {values.words(velocity)}")
        return axis.move_relative(sign * travel, **with_velocity)
    ctx.do("MC_Home Mode 0, Position 0")
    ctx.wait_until(axis.home(0.0).done, 2.0, "the axis is homed")
    ctx.do(f"MC_MoveAbsolute {sign * travel:.5g} {values.unit} with {values.words(velocity)}")
    return axis.move_absolute(sign * travel, **with_velocity)


def _brake(ctx: CaseContext, kind: str, instance: Any) -> Any:
    """Let the job brake; positioning jobs do so by themselves."""
    if kind == "velocity":
        ctx.do("MC_MoveVelocity 0: the axis brakes")
        return ctx.axis.move_velocity(0.0, **own(ctx).dynamics().inputs)
    if kind == "jog":
        ctx.do("JogForward, JogBackward = FALSE: the axis brakes")
        instance.set(JogForward=False, JogBackward=False)
    return instance
