"""Cases of `motion_in`: what is superimposed on what, and how that ends."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import job_output, value_at
from testcases.campaigns._motion_in import (
    EXACT,
    Program,
    at_rest,
    ends_with,
    trapezoid,
)
from testcases.campaigns.support import axis_name, enable, settle_s

CASES: Final = Campaign("motion in", tags=("motion-in", "overriding"), bench="reference")

_DYNAMICS: Final = {"Acceleration": 400.0, "Deceleration": 400.0, "Jerk": 0.0}
_BASICS: Final = ("nothing", "positioning", "velocity", "jog", "motion-in-velocity", "motion-in-position")


@CASES.product(
    "superimposed-on/{basic}",
    parameters={"basic": _BASICS},
    title="MC_MotionInSuperimposed on {basic}",
    tags=("superimposed",),
    requirements=(
        "MIN-014",
        "MIN-016",
        "MIN-030",
        "MIN-033",
        "MIN-034",
        "MIN-035",
        "MIN-036",
        "MIN-038",
        "MIN-040",
    ),
)
def superimposed_on(ctx: CaseContext, basic: str) -> None:
    """The distance comes on top, is shown, does not touch the basic motion, and stays when Enable falls."""
    axis, name = ctx.axis, axis_name(ctx)
    enable(ctx)
    start = float(axis.var("Position"))
    slow = {"Velocity": 20.0, **_DYNAMICS}
    below: Any = None
    if basic == "positioning":
        below = axis.move_relative(20.0, **slow)
    elif basic == "velocity":
        below = axis.move_velocity(20.0, **_DYNAMICS)
    elif basic == "jog":
        below = axis.jog(20.0, **_DYNAMICS)
    elif basic == "motion-in-velocity":
        below = axis.motion_in_velocity(20.0)
    elif basic == "motion-in-position":
        below = axis.motion_in_position(start)
    ctx.run_for(0.2)
    since = ctx.now_s
    profile = trapezoid(-2.5, 10.0, 100.0)

    def vector(time_s: float) -> dict[str, float]:
        distance, velocity, acceleration = profile(time_s)
        return {"Distance": distance, "VelocityDiff": velocity, "AccelerationDiff": acceleration}

    program = Program(ctx, vector)
    ctx.do("MC_MotionInSuperimposed, a trapezoid to -2.5 mm")
    top = program.lead(axis.motion_in_superimposed(0.0))
    ctx.run_for(0.6)
    ctx.measure("StatusWord2.X6", float(axis.var("StatusWord2.X6")), low=1.0, requirements=("MIN-014",))
    ctx.measure(
        "SuperimposedDistance",
        axis.var("StatusPositioning.SuperimposedDistance"),
        "mm",
        low=-2.5 - EXACT,
        high=-2.5 + EXACT,
        requirements=("MIN-016", "MIN-034"),
    )
    ctx.measure(
        "FunctionState",
        axis.var("StatusMotionIn.FunctionState"),
        high=2.0 if basic == "motion-in-position" else 1.0 if basic == "motion-in-velocity" else 0.0,
    )
    if basic not in ("nothing", "motion-in-position"):
        ctx.expect(value_at(f"{name}.velocity_setpoint", ctx.now_s, 20.0, tolerance=EXACT).covers("MIN-033"))
    lowest = ctx.trace()[f"{name}.velocity_setpoint"].between(since, ctx.now_s)
    resting = 0.0 if basic in ("nothing", "motion-in-position") else 20.0
    ctx.measure(
        "lowest velocity of the sum",
        float(min(lowest.values)),
        "mm/s",
        low=resting - 10.0 - EXACT,
        high=resting - 10.0 + EXACT,
        requirements=("MIN-033",),
    )
    ctx.run_for(0.6)
    if basic == "positioning":
        ctx.measure("the basic motion is done", float(below.Done), low=1.0, requirements=("MIN-036",))
    elif below is not None:
        ctx.measure("the basic motion is busy", float(below.Busy), low=1.0)
    ctx.measure("Busy", float(top.Busy), low=1.0, requirements=("MIN-036",))
    before = float(axis.var("Position"))
    ctx.do("Enable = FALSE")
    program.end()
    top.set(Enable=False)
    ctx.run_for(0.2)
    moved = resting * 0.2 if basic != "positioning" else 0.0
    ctx.expect(
        job_output(top.name, "Done", since=since),
        value_at(
            f"{name}.position_setpoint", ctx.now_s, before + moved, tolerance=0.2 * (resting > 0.0) + 1e-3
        )
        .named("the distance stays")
        .covers("MIN-040"),
    )
    if basic == "jog":
        below.set(JogForward=False)
    elif basic == "velocity":
        axis.halt()
    elif below is not None and basic.startswith("motion-in"):
        below.set(Enable=False)
    ctx.run_for(0.5 + settle_s(ctx))
    expected = {"nothing": start - 2.5, "positioning": start + 17.5, "motion-in-position": start - 2.5}.get(
        basic
    )
    at_rest(ctx, since=since, place=expected)


@CASES.case("superimposed-without-position-control", tags=("superimposed",), requirements=("MIN-031",))
def superimposed_without_position_control(ctx: CaseContext) -> None:
    """A basic motion in speed control: 16#8071, and it goes on."""
    enable(ctx)
    below = ctx.axis.motion_in_velocity(20.0, PositionControlled=False)
    ctx.run_for(0.3)
    since = ctx.now_s
    top = ctx.axis.motion_in_superimposed(1.0)
    ctx.run_for(0.1)
    ctx.expect(ends_with(ctx, top, "Error", since=since, error_id=0x8071).covers("MIN-031"))
    ctx.measure("the basic motion is busy", float(below.Busy), low=1.0)
    below.set(Enable=False)
    ctx.run_for(0.3 + settle_s(ctx))
    at_rest(ctx, since=since)


@CASES.product(
    "superimposed-halted/{by}",
    parameters={
        "by": ("halt-superimposed", "halt", "halt-basic", "move-superimposed", "motion-in-superimposed")
    },
    title="MC_MotionInSuperimposed is met by {by}",
    tags=("superimposed",),
    requirements=("MIN-041", "MIN-042", "MIN-049"),
)
def superimposed_halted(ctx: CaseContext, by: str) -> None:
    """MC_HaltSuperimposed and other superimposed jobs take it alone, MC_Halt Mode 0 everything, Mode 1 the
    basic motion only.
    """
    axis = ctx.axis
    enable(ctx)
    below = axis.move_velocity(40.0, **_DYNAMICS)
    ctx.run_for(0.2)
    profile = trapezoid(10_000.0, 20.0, 100.0)
    program = Program(
        ctx,
        lambda time_s: dict(
            zip(("Distance", "VelocityDiff", "AccelerationDiff"), profile(time_s), strict=True)
        ),
    )
    top = program.lead(axis.motion_in_superimposed(0.0))
    ctx.run_for(0.4)
    since = ctx.now_s
    ctx.do(by)
    taker: Any = {
        "halt-superimposed": axis.halt_superimposed,
        "halt": axis.halt,
        "halt-basic": lambda: axis.halt(Mode=1),
        "move-superimposed": lambda: axis.move_superimposed(5.0),
        "motion-in-superimposed": lambda: axis.motion_in_superimposed(0.0),
    }[by]()
    ctx.run_for(0.6 + settle_s(ctx))
    goes_on = by == "halt-basic"
    if goes_on:
        ctx.measure("Busy", float(top.Busy), low=1.0, requirements=("MIN-042",))
    else:
        ctx.expect(ends_with(ctx, top, "CommandAborted", since=since).covers("MIN-041", "MIN-042", "MIN-049"))
    if by in ("halt", "halt-basic"):
        ctx.expect(ends_with(ctx, below, "CommandAborted", since=since).covers("MIN-042"))
    else:
        ctx.measure("the basic motion is busy", float(below.Busy), low=1.0, requirements=("MIN-049",))
        axis.halt()
    program.end()
    for one in (top, taker):
        if hasattr(one, "Enable"):
            one.set(Enable=False)
    ctx.run_for(0.8 + settle_s(ctx))
    at_rest(ctx, since=since)
