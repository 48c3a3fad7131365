"""Cases of `monitoring`: the permitted following error, its warning level, and what makes it too small."""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, no_alarm, state_at, value_at
from hil.record import event
from testcases.campaigns._loop import (
    UNHURRIED,
    WIDE,
    Run,
    alarm_after,
    begin,
    cycle_s,
    disabled_with,
    permitted,
    quiet,
    travel,
    write,
)
from testcases.campaigns.support import axis_name

CASES: Final = Campaign("monitoring", tags=("monitoring",), bench="reference")

LEVEL: Final = 0.9
"""Warning level of the bench files."""


GAIN: Final = 20.0


def lag(ctx: CaseContext, velocity: float) -> float:
    """Travel without precontrol, so that the following error is v / Kv for good; returns its amount, mm."""
    begin(ctx, None, {"PositionControl.Kv": GAIN, "PositionControl.Kpc": 0.0}, WIDE)
    travel(ctx, velocity)
    ctx.run_for(0.35)
    return abs(velocity) / GAIN


def permit(ctx: CaseContext, amount: float, velocity: float) -> float:
    """Scale both limits so that `amount` is permitted at a velocity; returns the instant, s."""
    scale = amount / float(np.interp(abs(velocity), (50.0, 500.0), (2.0, 10.0)))
    write(ctx, {"FollowingError.MinValue": 2.0 * scale, "FollowingError.MaxValue": 10.0 * scale})
    return ctx.now_s


@CASES.product(
    "share/{share}/{velocity}",
    parameters={"share": (80, 95, 110), "velocity": (30, 100, -300, 450)},
    title="{share} % of the permitted following error at {velocity} mm/s",
    tags=("following-error",),
    requirements=("MON-038", "MON-039", "MON-040", "MON-041", "MON-055", "MON-056"),
)
def share_of_the_limit(ctx: CaseContext, share: int, velocity: int) -> None:
    """0.8 of the permitted following error is nothing, 0.95 a warning without a reaction, 1.1 is 521 in the
    next cycle.
    """
    axis = axis_name(ctx)
    error = lag(ctx, velocity)
    since = permit(ctx, error / share * 100.0, velocity)
    ctx.run_for(0.25 + abs(velocity) / 1000.0 if share > 100 else 0.1)
    if share > 100:
        alarm_after(ctx, 521, 0.0, since=since, requirements=("MON-038", "MON-040"))
        disabled_with(ctx, 521, 11, None)
        return
    if share > 90:
        alarm_after(ctx, 522, 0.0, since=since, reaction=0, requirements=("MON-041",))
    ctx.expect(
        no_alarm(axis=axis, besides=(522,) if share > 90 else ()).covers("MON-040"),
        state_at(axis, ctx.now_s, "MOTION").covers("MON-041"),
        value_at(f"{axis}.following_error", ctx.now_s, velocity / GAIN, tolerance=0.01 * error).covers(
            "MON-035"
        ),
    )


@CASES.product(
    "warning-level/{level}",
    parameters={"level": (40, 70, 100)},
    title="warning level {level} %",
    tags=("following-error",),
    requirements=("MON-008", "MON-041", "MON-042"),
)
def warning_level(ctx: CaseContext, level: int) -> None:
    """At 0.55 of what is permitted: a warning, once, where the level is below that; acknowledged, it comes
    again.
    """
    axis = axis_name(ctx)
    error = lag(ctx, 100.0)
    write(ctx, {"FollowingError.WarningLevel": float(level)})
    permit(ctx, error / 0.55, 100.0)
    ctx.run_for(0.1)
    ctx.wait_until(ctx.axis.reset().done, 1.0, "the warning is acknowledged")
    ctx.run_for(0.1)
    raised = sum(
        1 for one in ctx.trace().select(source=axis, kind="alarm.raised") if one.data["number"] == 522
    )
    expected = 2 if level == 40 else 0
    ctx.measure("warnings 522", raised, low=expected, high=expected, requirements=("MON-041", "MON-042"))
    ctx.expect(no_alarm(axis=axis, besides=(522,)), state_at(axis, ctx.now_s, "MOTION"))


@CASES.product(
    "braking/{error}",
    parameters={"error": (3, -4, 6)},
    title="{error} mm of following error while braking",
    tags=("following-error",),
    requirements=("MON-038", "MON-046"),
)
def braking(ctx: CaseContext, error: int) -> None:
    """A following error that is permitted at 300 mm/s is too large when the setpoint has braked to where it
    is not any more.
    """
    axis = axis_name(ctx)
    begin(ctx, None, {"PositionControl.Kv": 0.001, "FollowingError.WarningLevel": 100.0}, UNHURRIED)
    travel(ctx, 300.0)
    # Too little or too much precontrol makes the error, which then stays: there is hardly any gain.
    write(ctx, {"PositionControl.Kpc": 90.0 if error > 0 else 110.0})
    ctx.run_for(abs(error) / 30.0)
    write(ctx, {"PositionControl.Kpc": 100.0})
    ctx.run_for(0.05)
    before = ctx.now_s
    made = float(Run(ctx).following_error[-1])
    ctx.measure("following error before braking", made, "mm", low=error - 0.3, high=error + 0.3)
    ctx.do("MC_Halt with 500 mm/s²")
    ctx.axis.halt(Deceleration=500.0, Jerk=0.0)
    ctx.run_for(0.8)
    ctx.expect(
        no_alarm(until=before, axis=axis), alarm(521, reaction=4, since=before, axis=axis).covers("MON-046")
    )
    run = Run(ctx, before)
    raised = run.instant(event("alarm.raised", axis, number=521))
    limit = float(np.interp(abs(made), (2.0, 10.0), (50.0, 500.0)))
    if raised is not None and raised > before:
        row = int(np.flatnonzero(run.time < raised - 1e-6)[-1])
        slack = 3 * 500.0 * cycle_s(ctx) + 1.0
        ctx.measure(
            "velocity setpoint at 521",
            float(run.velocity_setpoint[row]),
            "mm/s",
            low=limit - slack,
            high=limit + slack,
            requirements=("MON-046",),
        )


@CASES.product(
    "gain/{kv}/{velocity}",
    parameters=[
        {"kv": kv, "velocity": velocity}
        for kv, velocity in ((60, 100), (37, 100), (20, 100), (40, -300), (12, 40))
    ],
    title="gain {kv}/s without precontrol at {velocity} mm/s",
    tags=("following-error",),
    requirements=("MON-035", "MON-038", "MON-040", "MON-041", "CTL-039"),
)
def gain(ctx: CaseContext, kv: int, velocity: int) -> None:
    """Too low a gain makes a following error of v / Kv: warning and alarm come when the formula says so, or
    not at all.
    """
    axis = axis_name(ctx)
    begin(ctx, None, {"PositionControl.Kv": float(kv), "PositionControl.Kpc": 0.0})
    ctx.do(f"MC_MoveVelocity {velocity} mm/s")
    ctx.axis.move_velocity(velocity, Acceleration=1000.0, Jerk=0.0)
    ctx.run_for(0.8)
    run = Run(ctx)
    allowed = np.interp(abs(run.velocity_setpoint), (50.0, 500.0), (2.0, 10.0))
    error = abs(run.following_error)
    expected_521, expected_522 = (
        run.first(error > allowed),
        run.first((error >= LEVEL * allowed) & (error > 0.0)),
    )
    raised = {number: run.instant(event("alarm.raised", axis, number=number)) for number in (521, 522)}
    for number, expected in ((521, expected_521), (522, expected_522)):
        found = raised[number]
        agrees = (found is None) == (expected is None)
        ctx.measure(
            f"{number} as the formula says", float(agrees), low=1.0, requirements=("MON-038", "MON-041")
        )
        if found is not None and expected is not None:
            ctx.measure(
                f"instant of {number} against the formula",
                abs(found - expected),
                "s",
                high=cycle_s(ctx) + 1e-6,
            )
    steady = abs(velocity) / kv
    if steady > 1.05 * permitted(ctx, velocity):
        ctx.expect(alarm(521, reaction=4, axis=axis).covers("MON-035", "MON-040"))
    else:
        ctx.expect(
            value_at(
                f"{axis}.following_error", ctx.now_s, velocity / kv, tolerance=0.01 * steady + 0.02
            ).covers("MON-035"),
            no_alarm(axis=axis, besides=(522,)).covers("MON-040"),
        )


FILTERS: Final = {
    "low-pass": ((1, 0.02, 0.0, 0.0), 0.02),
    "two-low-passes": ((1, 0.01, 0.015, 0.0), 0.025),
    "average": ((2, 0.04, 0.0, 0.0), 0.02),
    "dead-time": ((2, 0.0, 0.0, 0.024), 0.024),
}
"""Mode and times of the dynamic filter, and its delay, s."""


@CASES.product(
    "filter/{kind}/{delay}",
    parameters={"kind": list(FILTERS), "delay": ("compensated", "uncompensated")},
    title="dynamic filter ({kind}), its delay {delay}",
    tags=("following-error", "filter"),
    requirements=("MON-009", "MON-037", "CTL-084", "CTL-074", "CTL-077"),
)
def delay_of_a_filter(ctx: CaseContext, kind: str, delay: str) -> None:
    """At 100 mm/s a filter adds 100 times its delay to the following error: beyond 1.5 mm it is 521, unless
    the axis compensates the delay.
    """
    axis = axis_name(ctx)
    (mode, t1, t2, tt), delay_s = FILTERS[kind]
    prefix = "SetpointFilter.DynamicFilter."
    begin(
        ctx,
        {f"{prefix}Mode": mode},
        {
            f"{prefix}T1": t1,
            f"{prefix}T2": t2,
            f"{prefix}Tt": tt,
            "FollowingError.MinValue": 1.5,
            "FollowingError.MaxValue": 1.5,
            "FollowingError.AdditionalSetpointDelayTime": delay_s if delay == "compensated" else 0.0,
        },
    )
    ctx.do("MC_MoveVelocity 100 mm/s")
    ctx.axis.move_velocity(100.0, Acceleration=1000.0, Jerk=0.0)
    ctx.run_for(0.6)
    if delay == "compensated":
        quiet(ctx, requirements=("MON-037", "MON-009"))
        ctx.expect(
            value_at(f"{axis}.following_error", ctx.now_s, 0.0, tolerance=0.05).covers("CTL-074", "CTL-077")
        )
        ctx.measure("largest following error", float(abs(Run(ctx).following_error).max()), "mm", high=0.4)
        return
    ctx.expect(alarm(521, reaction=4, axis=axis).covers("MON-037"))
    run = Run(ctx)
    raised = run.instant(event("alarm.raised", axis, number=521))
    if raised is not None:
        before = run.following_error[run.time < raised - 1e-6]
        ctx.measure("following error before 521", float(before.max()), "mm", low=1.0, high=1.5 + 1e-6)


@CASES.product(
    "changed/{variable}",
    parameters={"variable": ("MinValue", "MaxValue", "MinVelocity")},
    title="FollowingError.{variable} changed while moving",
    tags=("following-error",),
    requirements=("MON-005", "MON-006", "MON-007", "MON-038"),
)
def changed(ctx: CaseContext, variable: str) -> None:
    """A limit that falls below the present following error while the axis moves acts in the next cycle."""
    begin(
        ctx,
        None,
        {"PositionControl.Kv": 50.0, "PositionControl.Kpc": 0.0, "FollowingError.WarningLevel": 100.0},
    )
    write(ctx, {"FollowingError.MinValue": 3.0, "FollowingError.MaxValue": 12.0})
    job = travel(ctx, 200.0)
    ctx.run_for(0.3)
    # 4 mm of following error at 200 mm/s, where 6 mm are permitted.
    write(
        ctx,
        {f"FollowingError.{variable}": {"MinValue": 0.1, "MaxValue": 4.5, "MinVelocity": 190.0}[variable]},
    )
    written = ctx.now_s
    limit = permitted(ctx, 200.0)
    ctx.run_for(0.01)
    ctx.run_for(0.5)
    if limit < 3.9:
        alarm_after(ctx, 521, 0.0, since=written, requirements=("MON-038",))
        disabled_with(ctx, 521, 11, job)
    else:
        quiet(ctx, requirements=("MON-038",))
