"""Cases of `control`: figures of the position loop in the controller and in the drive, in constant travel and
where values change.
"""

from __future__ import annotations

from math import exp
from typing import Any, Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from hil.expect import no_alarm, value_at
from testcases.campaigns._loop import (
    UNHURRIED,
    WIDE,
    Run,
    begin,
    configure,
    cycle_s,
    position_control_in,
    quiet,
    travel,
    write,
)
from testcases.campaigns.support import axis_name, drive_name, enable

CASES: Final = Campaign("control", tags=("control",), bench="reference")

WHERE: Final = ("controller", "drive")
GAIN: Final = 25.0
TRANSPORT: Final = 2
"""Cycles from a setpoint to the actual value that it makes, on a bus with a clock."""


def loop(ctx: CaseContext, where: str, start: dict[str, Any] | None = None, **now: Any) -> None:
    """Configure where the position is controlled, without limits to the following error, and enable."""
    begin(ctx, position_control_in(ctx, where) | (start or {}), WIDE, UNHURRIED)
    configure(ctx, None, PositionControl__Kv=GAIN, **now)


def shows_error(ctx: CaseContext, expected: float, *, tolerance: float = 0.02) -> None:
    """Expect the following error at this instant, calculated from recorded setpoint and actual position, and
    as it is shown.

    On top of `expected` the axis lags by the share of the substitute time that is balanced, and with the loop
    in the drive by the servo step in which that takes the reference over.
    """
    read = ctx.axis.var
    run = Run(ctx, ctx.now_s - 0.1)
    lag_s = read("DynamicAxisModel.VelocityTimeConstant") * min(1.0, read("PositionControl.Kpc") / 100.0)
    if read("PositionControl.EnableDSC"):
        lag_s += ctx.bench.config.bench.servo_period_us * 1e-6
    expected += float(run.velocity_setpoint[-1]) * lag_s
    own = run.position_setpoint[-1 - TRANSPORT] - run.actual_position[-1]
    additional = float(ctx.axis.var("FollowingError.AdditionalSetpointDelayTime")) * float(
        run.velocity_setpoint[-1]
    )
    margin = tolerance + 0.01 * abs(expected)
    ctx.measure(
        "following error by the recording",
        float(own - additional),
        "mm",
        low=expected - margin,
        high=expected + margin,
    )
    ctx.expect(
        value_at(f"{axis_name(ctx)}.following_error", ctx.now_s, expected, tolerance=margin).covers(
            "MON-035", "MON-033"
        )
    )


@CASES.product(
    "precontrol/{where}/{kpc}/{velocity}",
    parameters={"where": WHERE, "kpc": (0, 50, 100, 120), "velocity": (60, -200)},
    title="{kpc} % of precontrol at {velocity} mm/s, loop in the {where}",
    tags=("travel", "{where}"),
    requirements=("CTL-039", "CTL-038", "CTL-103", "MON-033", "MON-035", "CTL-009"),
)
def precontrol(ctx: CaseContext, where: str, kpc: int, velocity: int) -> None:
    """What precontrol leaves to the controller makes the following error: (1 - Kpc / 100) * v / Kv."""
    loop(ctx, where, PositionControl__Kpc=float(kpc))
    travel(ctx, velocity)
    ctx.run_for(0.35)
    shows_error(ctx, (1.0 - kpc / 100.0) * velocity / GAIN)
    quiet(ctx)


@CASES.product(
    "substitute-time/{where}/{vtc_ms}",
    parameters={"where": WHERE, "vtc_ms": (8, 30)},
    title="substitute time of {vtc_ms} ms for a drive without lag, loop in the {where}",
    tags=("travel", "{where}"),
    requirements=("CTL-015", "CTL-023", "CTL-030", "CTL-041", "CTL-044"),
)
def substitute_time(ctx: CaseContext, where: str, vtc_ms: int) -> None:
    """Balancing delays what the controller wants by the substitute time: the axis lags by v * T_vtc, and no
    more.
    """
    axis = axis_name(ctx)
    loop(ctx, where, DynamicAxisModel__VelocityTimeConstant=vtc_ms / 1000.0)
    travel(ctx, 150.0)
    ctx.run_for(0.35)
    shows_error(ctx, 0.0)
    run = Run(ctx, ctx.now_s - 0.05)
    behind = float(run.position_setpoint[-1] - run.balanced_position[-1])
    ctx.measure(
        "balanced position behind the setpoint",
        behind,
        "mm",
        low=0.149 * vtc_ms,
        high=0.151 * vtc_ms,
        requirements=("CTL-023",),
    )
    before = ctx.now_s
    write(ctx, {"PositionControl.Kpc": 0.0})
    ctx.run_for(0.4)
    shows_error(ctx, 150.0 / GAIN)
    ctx.expect(value_at(f"{axis}.actual_velocity", before, 150.0, tolerance=1.0))
    run = Run(ctx, ctx.now_s - 0.05)
    unbalanced = float(abs(run.position_setpoint - run.balanced_position).max())
    ctx.measure("balancing without precontrol", unbalanced, "mm", high=1e-9, requirements=("CTL-042",))


@CASES.product(
    "gain-changed/{where}/{smoothing_ms}",
    parameters={"where": WHERE, "smoothing_ms": (0, 60)},
    title="gain doubled while moving, smoothed over {smoothing_ms} ms, loop in the {where}",
    tags=("travel", "{where}"),
    requirements=("CTL-007", "CTL-008", "CTL-046"),
)
def gain_changed(ctx: CaseContext, where: str, smoothing_ms: int) -> None:
    """Twice the gain is half the following error; the speed steps by the velocity itself, or goes there
    smoothly.
    """
    loop(
        ctx,
        where,
        PositionControl__Kpc=0.0,
        PositionControl__SmoothingTimeByChangeDifference=smoothing_ms / 1000.0,
    )
    travel(ctx, 80.0)
    ctx.run_for(0.35)
    shows_error(ctx, 80.0 / GAIN)
    since = ctx.now_s
    write(ctx, {"PositionControl.Kv": 2.0 * GAIN})
    ctx.run_for(0.5)
    shows_error(ctx, 40.0 / GAIN)
    peak = float(Run(ctx, since).actual_velocity.max())
    # In the drive the gain acts at once and the reference over a bus cycle, which leaves a part of the step.
    low, high = (125.0, 165.0) if smoothing_ms == 0 else (80.0, 115.0 if where == "drive" else 100.0)
    ctx.measure("greatest velocity on the way", peak, "mm/s", low=low, high=high, requirements=("CTL-007",))
    quiet(ctx)


FILTERS: Final = {
    "low-pass": (1, 0.03, 0.0, 0.0),
    "second-time-alone": (1, 0.0, 0.03, 0.0),
    "two-low-passes": (1, 0.02, 0.012, 0.0),
    "low-pass-and-dead-time": (1, 0.02, 0.0, 0.01),
    "average": (2, 0.048, 0.0, 0.0),
    "two-averages": (2, 0.024, 0.016, 0.0),
    "average-and-dead-time": (2, 0.024, 0.0, 0.014),
    "dead-time": (2, 0.0, 0.0, 0.026),
    "longest-average": (2, 0.5, 0.0, 0.0),
    "longest-dead-time": (1, 0.0, 0.0, 0.5),
    "no-time": (2, 0.0, 0.0, 0.0),
    "off": (0, 0.03, 0.02, 0.01),
}
LONGEST: Final = 16
"""Cycles to which averages and dead time are limited."""


def filter_delay(kind: str, cycle: float) -> float:
    """Return the delay of a filter by the rules of the specification, s (CTL-064 to CTL-079)."""
    mode, t1, t2, tt = FILTERS[kind]
    most = LONGEST * cycle
    if mode == 0:
        return 0.0
    if mode == 1:
        return t1 + t2 + min(tt, most)
    return 0.5 * min(t1, most) + 0.5 * min(t2, most) + min(tt, most)


@CASES.product(
    "filter/{kind}/{where}",
    parameters=[
        {"kind": kind, "where": where}
        for kind in FILTERS
        for where in (WHERE if kind in ("low-pass", "average", "dead-time") else WHERE[:1])
    ],
    title="dynamic filter {kind}, loop in the {where}",
    tags=("filter", "{where}"),
    requirements=(
        "CTL-061",
        "CTL-062",
        "CTL-074",
        "CTL-077",
        "CTL-078",
        "CTL-079",
        "MON-037",
        "CTL-084",
        "CTL-022",
    ),
)
def dynamic_filter(ctx: CaseContext, kind: str, where: str) -> None:
    """Setpoints come later by the delay of the filter, smoothly and never beyond; given as additional delay
    it is no error.
    """
    mode, t1, t2, tt = FILTERS[kind]
    prefix = "SetpointFilter.DynamicFilter."
    start = {f"{prefix}Mode": mode} | ({"PositioningMonitoring.Window": 0.1} if mode else {})
    loop(ctx, where, start)
    write(ctx, {f"{prefix}T1": t1, f"{prefix}T2": t2, f"{prefix}Tt": tt})
    delay = filter_delay(kind, cycle_s(ctx))
    began = ctx.now_s
    travel(ctx, 100.0)
    ctx.run_for(0.4)
    run = Run(ctx, ctx.now_s - 0.02)
    behind = float(run.position_setpoint[-1] - run.filtered_position[-1])
    ctx.measure(
        "filtered position behind the setpoint",
        behind,
        "mm",
        low=100.0 * delay - 0.02,
        high=100.0 * delay + 0.02,
        requirements=("CTL-074", "CTL-077"),
    )
    shows_error(ctx, 100.0 * delay)
    write(ctx, {"FollowingError.AdditionalSetpointDelayTime": delay})
    ctx.run_for(0.02)
    shows_error(ctx, 0.0)
    halt = ctx.axis.halt()
    ctx.wait_until(halt.done, 3.0, "the halt is done")
    ctx.run_for(0.3)
    run = Run(ctx, began)
    beyond = float((run.filtered_position - run.position_setpoint.max()).max())
    ctx.measure("filtered position beyond the setpoint", beyond, "mm", high=1e-6, requirements=("CTL-072",))
    ctx.expect(
        value_at(
            f"{axis_name(ctx)}.filtered_position", ctx.now_s, float(run.position_setpoint[-1]), tolerance=0.01
        ).covers("CTL-061")
    )
    quiet(ctx)


@CASES.product(
    "quantised/{where}/{way_um}",
    parameters={"where": WHERE, "way_um": (30, 70)},
    title="a way of {way_um} um with a quantum of 50 um, loop in the {where}",
    tags=("travel", "{where}"),
    requirements=("CTL-012", "CTL-013", "CTL-047"),
)
def quantised(ctx: CaseContext, where: str, way_um: int) -> None:
    """A deviation inside the quantum moves nothing, one beyond it does, by a whole multiple."""
    mode = "PositionControl.ControlDifferenceQuantization"
    loop(ctx, where, {f"{mode}.Mode": 2, f"{mode}.Value": 0.05}, PositionControl__Kpc=0.0)
    since = ctx.now_s
    job = ctx.axis.move_relative(way_um / 1000.0)
    ctx.wait_until(job.done, 2.0, "the axis is in its window")
    ctx.run_for(0.3)
    run = Run(ctx, since)
    moved = float(run.actual_position[-1] - run.actual_position[0])
    low, high = (-0.005, 0.005) if way_um < 50 else (0.015, 0.055)
    ctx.measure("way of the axis", moved, "mm", low=low, high=high, requirements=("CTL-047",))
    rest = run.control_difference / 0.05
    ctx.measure(
        "control difference off a whole multiple",
        float(abs(rest - np.round(rest)).max()),
        high=1e-6,
        requirements=("CTL-012",),
    )


@CASES.product(
    "simulated/{kpc}",
    parameters={"kpc": (0, 100)},
    title="simulated axis with {kpc} % of precontrol",
    tags=("simulation",),
    requirements=("CTL-016", "CTL-060"),
)
def simulated(ctx: CaseContext, kpc: int) -> None:
    """Simulated actual values lag by the control loop: with precontrol T_ipo + T_servo + T_vtc + T_addPtc,
    without T_ipo + 1 / Kv + T_addPtc.
    """
    loop(
        ctx,
        "controller",
        {"Simulation.Mode": 1},
        PositionControl__Kpc=float(kpc),
        DynamicAxisModel__AdditionalPositionTimeConstant=0.01,
        DynamicAxisModel__VelocityTimeConstant=0.006,
    )
    travel(ctx, 100.0)
    ctx.run_for(0.4)
    cycle = cycle_s(ctx)
    expected = 100.0 * (0.01 + (2.0 * cycle + 0.006 if kpc else cycle + 1.0 / GAIN))
    run = Run(ctx, ctx.now_s - 0.05)
    lag = float(run.position_setpoint[-1] - run.actual_position[-1])
    ctx.measure(
        "lag of the simulated axis",
        lag,
        "mm",
        low=0.99 * expected,
        high=1.01 * expected,
        requirements=("CTL-016",),
    )
    quiet(ctx)


@CASES.product(
    "response/{kv}",
    parameters={"kv": (10, 30)},
    title="answer of the loop to the end of a motion with Kv {kv}/s",
    tags=("travel",),
    requirements=("CTL-001", "CTL-046", "CTL-096"),
)
def response(ctx: CaseContext, kv: int) -> None:
    """Without precontrol what is left is closed with 1 / Kv: after that time a third of it, without
    overshoot; sooner with a higher gain.
    """
    loop(ctx, "controller", PositionControl__Kpc=0.0)
    configure(ctx, None, PositionControl__Kv=float(kv))
    job = ctx.axis.move_relative(10.0, Velocity=100.0, Acceleration=2000.0, Jerk=0.0)
    ctx.wait_until(lambda: not ctx.axis.motion.gen.done, 1.0, "the setpoint moves")
    ctx.wait_until(lambda: ctx.axis.motion.gen.done, 3.0, "the setpoint has ended")
    ended = ctx.now_s
    ctx.run_for(4.0 / kv)
    run = Run(ctx, ended)
    rest = run.position_setpoint[-1] - run.actual_position
    row = int(abs(run.time - run.time[0] - 1.0 / kv).argmin())
    share = float(rest[row] / rest[0])
    slow, fast = exp(-1.0), exp(-1.0 - kv * 2.0 * TRANSPORT * cycle_s(ctx))
    ctx.measure(
        "share that is left after 1 / Kv", share, low=fast, high=slow + 0.02, requirements=("CTL-046",)
    )
    ctx.measure("overshoot", float(-rest.min()), "mm", high=0.01)
    ctx.measure("the job is not failed", float(job.Error), high=0.0)


@CASES.product(
    "written-beyond/{variable}",
    parameters={"variable": ("Kpc", "Kv")},
    title="PositionControl.{variable} written beyond its range while moving",
    tags=("travel",),
    requirements=("CTL-009", "CTL-040", "CTL-104"),
)
def written_beyond(ctx: CaseContext, variable: str) -> None:
    """A value beyond its range acts as the bound that it violates, at once and without an alarm."""
    loop(ctx, "controller", PositionControl__Kpc=50.0)
    travel(ctx, 60.0)
    if variable == "Kpc":
        write(ctx, {"PositionControl.Kpc": 1000.0})
        ctx.run_for(0.4)
        shows_error(ctx, -0.5 * 60.0 / GAIN)
        ctx.measure(
            "Kpc in force",
            float(ctx.axis.var("PositionControl.Kpc")),
            "%",
            low=150.0,
            high=150.0,
            requirements=("CTL-104",),
        )
    else:
        write(ctx, {"PositionControl.Kv": 3.0e6})
        ctx.measure("speed output is a number", float(np.isfinite(Run(ctx).speed_output).all()), low=1.0)
        write(ctx, {"PositionControl.Kv": GAIN})
        ctx.run_for(0.4)
        shows_error(ctx, 0.5 * 60.0 / GAIN)
    ctx.expect(no_alarm(axis=axis_name(ctx)).covers("CTL-104"))


@CASES.case("follow-up", tags=("mechanics",), requirements=("CTL-002", "CTL-003", "CTL-004", "CTL-005"))
def follow_up(ctx: CaseContext) -> None:
    """Disabled and pushed, the axis tracks: setpoint is actual value, no following error, no alarm; enabled
    at rest nothing jumps.
    """
    enable(ctx)
    off = ctx.axis.power(False)
    ctx.wait_until(off.off, 3.0, "the axis is disabled")
    ctx.run_for(0.1)
    since = ctx.now_s
    ctx.inject("mechanics.load_step", drive_name(ctx), force_N=600.0, duration_s=0.08)
    ctx.run_for(1.5)
    run = Run(ctx, since)
    ctx.measure("way by hand", float(run.actual_position[-1] - run.actual_position[0]), "mm", low=5.0)
    ctx.measure(
        "setpoint against actual value",
        float(abs(run.position_setpoint - run.actual_position).max()),
        "mm",
        high=1e-9,
        requirements=("CTL-003",),
    )
    ctx.measure(
        "following error", float(abs(run.following_error).max()), "mm", high=0.0, requirements=("CTL-005",)
    )
    quiet(ctx, requirements=("CTL-005",))
