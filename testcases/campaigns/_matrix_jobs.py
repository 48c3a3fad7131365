"""Words of a matrix: motion jobs, and the moments of them at which something happens."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import CaseContext
from testcases.campaigns.support import ACCELERATION, JERK, VELOCITY

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
HIGH_VELOCITY: Final = 450.0
"""Velocity that is headed for, so that 300 mm/s are passed on the way up and down, mm/s."""
TRAVEL: Final = 330.0
"""Travel of positioning jobs, mm: they reach 450 mm/s and brake from it."""
CRAWL: Final = 10.0
"""Velocity below which a job is starting or arriving, mm/s."""
_DYNAMICS: Final = {"Acceleration": ACCELERATION, "Deceleration": ACCELERATION, "Jerk": JERK}


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
    sign = direction_of(job)
    velocity = VELOCITY if moment == "constant" else HIGH_VELOCITY
    instance = _start(ctx, job.partition("-")[0], sign, velocity)
    now = _velocity(ctx, sign)
    if moment == "starting":
        ctx.wait_until(lambda: now() >= CRAWL / 2, 5.0, "the axis has started")
    elif moment == "accelerating":
        ctx.wait_until(lambda: now() >= VELOCITY, 5.0, "300 mm/s are passed while accelerating")
    else:
        ctx.wait_until(lambda: now() >= velocity - 1e-6, 5.0, f"{velocity:g} mm/s are reached")
        if moment == "constant":
            ctx.run_for(0.1)
        else:
            instance = _brake(ctx, job.partition("-")[0], instance)
            limit = VELOCITY if moment == "decelerating" else CRAWL
            ctx.wait_until(lambda: now() <= limit, 5.0, f"{limit:g} mm/s are passed while braking")
    return instance


def _velocity(ctx: CaseContext, sign: int) -> Any:
    motion = ctx.axis.motion
    return lambda: motion.gen.v * sign


def _start(ctx: CaseContext, kind: str, sign: int, velocity: float) -> Any:
    axis = ctx.axis
    if kind == "velocity":
        ctx.do(f"MC_MoveVelocity {sign * velocity:g} mm/s")
        return axis.move_velocity(sign * velocity, **_DYNAMICS)
    if kind == "jog":
        ctx.do(f"MC_MoveJog {sign * velocity:g} mm/s")
        return axis.jog(velocity, backward=sign < 0, **_DYNAMICS)
    if kind == "relative":
        ctx.do(f"MC_MoveRelative {sign * TRAVEL:g} mm with {velocity:g} mm/s")
        return axis.move_relative(sign * TRAVEL, Velocity=velocity, **_DYNAMICS)
    ctx.do("MC_Home Mode 0, Position 0")
    ctx.wait_until(axis.home(0.0).done, 2.0, "the axis is homed")
    ctx.do(f"MC_MoveAbsolute {sign * TRAVEL:g} mm with {velocity:g} mm/s")
    return axis.move_absolute(sign * TRAVEL, Velocity=velocity, **_DYNAMICS)


def _brake(ctx: CaseContext, kind: str, instance: Any) -> Any:
    """Let the job brake; positioning jobs do so by themselves."""
    if kind == "velocity":
        ctx.do("MC_MoveVelocity 0 mm/s: the axis brakes")
        return ctx.axis.move_velocity(0.0, **_DYNAMICS)
    if kind == "jog":
        ctx.do("JogForward, JogBackward = FALSE: the axis brakes")
        instance.set(JogForward=False, JogBackward=False)
    return instance
