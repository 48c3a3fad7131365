"""Cases of `control`: position control switched off and on, at rest and while moving, and what keeps the mode
as it is.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from testcases.campaigns._control_travel import WHERE, loop
from testcases.campaigns._loop import (
    UNHURRIED,
    WIDE,
    Run,
    acknowledged,
    begin,
    bit,
    cycle_s,
    quiet,
    travel,
)
from testcases.campaigns.support import axis_name

CASES: Final = Campaign("control", tags=("control",), bench="reference")

NOT_CONTROLLED: Final = 28


def off(ctx: CaseContext) -> bool:
    """Return whether the axis is without position control now, by its status word."""
    return bool(ctx.axis.var(f"StatusWord.X{NOT_CONTROLLED}"))


def mode_is(ctx: CaseContext, expected: bool, text: str) -> None:
    """Record whether X28 is as expected."""
    ctx.measure(
        f"X28 {text}", float(off(ctx)), low=float(expected), high=float(expected), requirements=("CTL-085",)
    )


@CASES.product(
    "off-and-on/{where}/{velocity}",
    parameters={"where": WHERE, "velocity": (80, -250)},
    title="position control off and on at {velocity} mm/s, loop in the {where}",
    tags=("switching", "{where}"),
    requirements=("CTL-085", "CTL-087", "CTL-093", "CTL-033"),
)
def off_and_on(ctx: CaseContext, where: str, velocity: int) -> None:
    """Opened and closed again three times on the way: neither speed nor setpoint makes a jump, and no alarm
    comes.
    """
    loop(ctx, where)
    travel(ctx, velocity)
    since = ctx.now_s
    for closed in (False, True) * 3:
        ctx.do(f"MC_MoveVelocity PositionControlled = {closed}")
        ctx.axis.move_velocity(velocity, PositionControlled=closed)
        ctx.run_for(0.08)
        mode_is(ctx, not closed, "after the change")
    run = Run(ctx, since)
    ctx.measure(
        "greatest deviation of the speed",
        float(abs(run.actual_velocity - velocity).max()),
        "mm/s",
        high=4.0,
        requirements=("CTL-093",),
    )
    steps = np.diff(run.position_setpoint) - velocity * cycle_s(ctx)
    ctx.measure(
        "greatest step of the setpoint", float(abs(steps).max()), "mm", high=abs(velocity) * 4 * cycle_s(ctx)
    )
    quiet(ctx)


@CASES.product(
    "closed-by/{instruction}",
    parameters={
        "instruction": (
            "move_velocity",
            "move_relative",
            "move_absolute",
            "move_superimposed",
            "jog",
            "motion_in_position",
        )
    },
    title="position control closed at 50 mm/s by {instruction}",
    tags=("switching",),
    requirements=("CTL-087", "CTL-088", "CTL-089", "CTL-093"),
)
def closed_by(ctx: CaseContext, instruction: str) -> None:
    """A job that needs position control closes it on the way: the first setpoint is where the axis will be,
    X28 goes for good.
    """
    loop(ctx, "controller")
    ctx.wait_until(ctx.axis.home(0.0).done, 1.0, "the axis is homed")
    travel(ctx, 50.0, PositionControlled=False)
    ctx.run_for(0.2)
    mode_is(ctx, True, "before")
    since = ctx.now_s
    give: dict[str, Any] = {
        "move_velocity": lambda: ctx.axis.move_velocity(50.0),
        "move_relative": lambda: ctx.axis.move_relative(20.0, Velocity=50.0),
        "move_absolute": lambda: ctx.axis.move_absolute(60.0, Velocity=50.0),
        "move_superimposed": lambda: ctx.axis.move_superimposed(2.0),
        "jog": lambda: ctx.axis.jog(50.0),
        "motion_in_position": lambda: ctx.axis.motion_in_position(float(ctx.axis.var("ActualPosition"))),
    }
    give[instruction]()
    ctx.run_for(0.02)
    mode_is(ctx, False, "afterwards")
    run = Run(ctx, since - 1.5 * cycle_s(ctx))
    closed = int(np.flatnonzero(~bit(run.status_word, NOT_CONTROLLED))[0])
    ahead = float(run.position_setpoint[closed] - run.actual_position[closed])
    if instruction != "motion_in_position":
        ctx.measure(
            "first setpoint ahead of the actual position",
            ahead,
            "mm",
            low=50.0 * cycle_s(ctx),
            high=50.0 * 4 * cycle_s(ctx),
            requirements=("CTL-093",),
        )
        ctx.run_for(0.05)
        ctx.measure(
            "following error afterwards", float(abs(Run(ctx, since).following_error).max()), "mm", high=0.4
        )
    ctx.run_for(0.5)
    mode_is(ctx, False, "in the end")
    quiet(ctx, besides=(533, 534))


@CASES.product(
    "kept-by/{instruction}/{mode}",
    parameters={"instruction": ("halt", "stop"), "mode": ("controlled", "not-controlled")},
    title="MC_{instruction} keeps the mode: {mode}",
    tags=("switching",),
    requirements=("CTL-090",),
)
def kept_by(ctx: CaseContext, instruction: str, mode: str) -> None:
    """MC_Halt and MC_Stop end the motion in either mode and leave it as it is."""
    controlled = mode == "controlled"
    loop(ctx, "controller")
    travel(ctx, 100.0, PositionControlled=controlled)
    job = ctx.axis.halt() if instruction == "halt" else ctx.axis.stop(2)
    ctx.wait_until(job.done, 3.0, "the axis has stopped")
    mode_is(ctx, not controlled, "after it is done")
    ctx.run_for(0.2)
    mode_is(ctx, not controlled, "later")
    quiet(ctx, requirements=("CTL-090",))


@CASES.product(
    "power/{start_mode}",
    parameters={"start_mode": (0, 1)},
    title="MC_Power StartMode {start_mode}",
    tags=("switching",),
    requirements=("CTL-085", "CTL-086"),
)
def power(ctx: CaseContext, start_mode: int) -> None:
    """StartMode 0 enables without position control, which stays off through a velocity job without it, until
    a positioning.
    """
    ctx.do(f"MC_Power StartMode {start_mode}")
    power = ctx.axis.power(start_mode=start_mode)
    ctx.wait_until(power.status, 5.0, "the axis is enabled")
    ctx.run_for(0.1)
    mode_is(ctx, start_mode == 0, "after enabling")
    if start_mode == 0:
        travel(ctx, 40.0, PositionControlled=False)
        ctx.wait_until(ctx.axis.halt().done, 2.0, "the halt is done")
        mode_is(ctx, True, "after a job without it")
    ctx.wait_until(ctx.axis.move_relative(2.0).done, 2.0, "the positioning is done")
    mode_is(ctx, False, "after a positioning")
    quiet(ctx)


@CASES.product(
    "enabled-while-moving/{how}",
    parameters={"how": ("ramp", "at-once", "start-mode-0")},
    title="enabled while it coasts: {how}",
    tags=("switching",),
    requirements=("CTL-014", "CTL-095", "CTL-086"),
)
def enabled_while_moving(ctx: CaseContext, how: str) -> None:
    """VelocityModePowerOn 0 brakes with maximum dynamics, 1 and StartMode 0 with the setpoint 0 at once; none
    is an alarm.
    """
    start: dict[str, Any] = {"Actor.RemoveEnableReaction": 3}
    if how == "at-once":
        start["PositionControl.VelocityModePowerOn"] = 1
    begin(
        ctx,
        {key: value for key, value in start.items() if key.startswith("PositionControl")} or None,
        WIDE,
        UNHURRIED,
    )
    travel(ctx, 300.0)
    ctx.do("MC_Power Enable = FALSE, StopMode 3: the axis coasts")
    ending = ctx.axis.power(False, stop_mode=3)
    ctx.run_until(ending.off, 0.2)
    ctx.run_for(0.05)
    speed = abs(float(Run(ctx).actual_velocity[-1]))
    ctx.require(speed > 50.0, "a drive that coasts when it is disabled with StopMode 3")
    since = ctx.now_s
    power = ctx.axis.power(True, start_mode=0 if how == "start-mode-0" else 1)
    ctx.wait_until(power.status, 3.0, "the axis is enabled again")
    ctx.run_for(0.4)
    run = Run(ctx, since)
    enabled = int(np.flatnonzero(run.power_status)[0])
    slopes = -np.diff(run.actual_velocity[enabled:]) / cycle_s(ctx)
    if how == "ramp":
        ctx.measure(
            "greatest deceleration",
            float(slopes.max()),
            "mm/s²",
            low=1500.0,
            high=2600.0,
            requirements=("CTL-014",),
        )
    else:
        ctx.measure(
            "greatest deceleration",
            float(slopes.max()),
            "mm/s²",
            low=4000.0,
            requirements=("CTL-014", "CTL-095"),
        )
    ctx.measure("speed in the end", float(abs(run.actual_velocity[-1])), "mm/s", high=2.0)
    quiet(ctx, besides=(504,))


@CASES.product(
    "discarded/{where}",
    parameters={"where": WHERE},
    title="a following error is discarded with position control, loop in the {where}",
    tags=("switching", "{where}"),
    requirements=("CTL-094", "MON-036"),
)
def discarded(ctx: CaseContext, where: str) -> None:
    """4 mm behind, position control is switched off: they are never made up, and no following error is
    shown.
    """
    loop(ctx, where, PositionControl__Kpc=0.0)
    travel(ctx, 100.0)
    ctx.run_for(0.3)
    ctx.measure("following error before", float(Run(ctx).following_error[-1]), "mm", low=3.9, high=4.2)
    since = ctx.now_s
    ctx.axis.move_velocity(100.0, PositionControlled=False)
    ctx.run_for(0.4)
    run = Run(ctx, since + 2 * cycle_s(ctx))
    ctx.measure(
        "following error afterwards",
        float(abs(run.following_error).max()),
        "mm",
        high=0.0,
        requirements=("MON-036",),
    )
    ctx.measure(
        "greatest velocity", float(run.actual_velocity.max()), "mm/s", high=101.0, requirements=("CTL-094",)
    )
    quiet(ctx)


@CASES.product(
    "alarm-stop/{where}",
    parameters={"where": WHERE},
    title="setpoint on the ramp of the drive, loop in the {where}",
    tags=("switching", "{where}"),
    requirements=("CTL-003", "CTL-004", "CTL-006", "CTL-033"),
)
def alarm_stop(ctx: CaseContext, where: str) -> None:
    """Reaction 4 at 200 mm/s: while the drive brakes the setpoint tracks the actual value; enabled at rest
    nothing jumps.
    """
    loop(ctx, where)
    travel(ctx, 200.0)
    ctx.inject("axis.alarm", axis_name(ctx), number=541)
    ctx.run_for(0.02)
    since = ctx.now_s
    ctx.run_for(0.5)
    run = Run(ctx, since)
    ctx.measure("speed at the beginning", float(run.actual_velocity[0]), "mm/s", low=100.0)
    ctx.measure(
        "setpoint against actual value",
        float(abs(run.position_setpoint - run.actual_position).max()),
        "mm",
        high=1e-9,
        requirements=("CTL-006", "CTL-003"),
    )
    if where == "drive":
        times, kpc = run.drive("kpc")
        ctx.measure(
            "KPC while the axis tracks",
            float(kpc[times > since + 4 * cycle_s(ctx)].max()),
            high=0.0,
            requirements=("CTL-033",),
        )
    acknowledged(ctx)
