"""Cases of `monitoring`: faults of machine, encoder, drive and bus that use the permitted following error up,
or do not.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, job_output, no_alarm, state_at, value_at
from testcases.campaigns._loop import (
    APPLIED,
    SIGN,
    WIDE,
    Run,
    acknowledged,
    alarm_after,
    begin,
    cycle_s,
    disabled_with,
    increments,
    permitted,
    quiet,
    travel,
)
from testcases.campaigns.support import axis_name, drive_name

CASES: Final = Campaign("monitoring", tags=("monitoring",), bench="reference")

LEVEL: Final = 0.9
"""Warning level of the bench files."""


@CASES.product(
    "jam/{velocity}",
    parameters={"velocity": (20, 50, 150, -300, 450)},
    title="jammed at {velocity} mm/s",
    tags=("following-error", "mechanics"),
    requirements=("MON-038", "MON-040", "MON-041", "MON-056", "MON-055"),
)
def jam(ctx: CaseContext, velocity: int) -> None:
    """The following error of a blocked axis grows with its velocity: 522 at 90 % of what is permitted, 521
    beyond it.
    """
    begin(ctx)
    job = travel(ctx, velocity)
    blocked = ctx.inject("mechanics.jam", drive_name(ctx))
    allowed = permitted(ctx, velocity)
    used_up = allowed / abs(velocity)
    ctx.run_for(used_up + 0.5)
    if (1.0 - LEVEL) * used_up > 1.5 * cycle_s(ctx):  # else both may be due in the same cycle
        alarm_after(ctx, 522, LEVEL * used_up, reaction=0, early_s=0.002, requirements=("MON-041",))
    alarm_after(ctx, 521, used_up, early_s=0.002, requirements=("MON-038", "MON-040"))
    disabled_with(ctx, 521, 11, job)
    blocked.remove()
    ctx.run_for(0.1)
    acknowledged(ctx)


@CASES.product(
    "frozen/{velocity}",
    parameters={"velocity": (60, -150, 300)},
    title="encoder frozen at {velocity} mm/s",
    tags=("following-error", "encoder"),
    requirements=("MON-040", "MON-041"),
)
def frozen(ctx: CaseContext, velocity: int) -> None:
    """An actual value that stands still uses the permitted following error up as a blocked axis does, though
    the machine moves.
    """
    begin(ctx)
    job = travel(ctx, velocity)
    ctx.inject("encoder.freeze", drive_name(ctx), duration_s=1.0)
    used_up = permitted(ctx, velocity) / abs(velocity)
    ctx.run_for(1.5)
    alarm_after(ctx, 521, used_up, early_s=0.002, requirements=("MON-040",))
    ctx.expect(job_output(job.name, "Error", error_id=0x8001).covers("MON-040"))


@CASES.product(
    "jump/{share}",
    parameters={"share": (-20, 20, -150, 150)},
    title="encoder jumps by {share} % of the permitted following error",
    tags=("following-error", "encoder"),
    requirements=("MON-040", "MON-056"),
)
def jump(ctx: CaseContext, share: int) -> None:
    """A small jump is worked off, one beyond the permitted following error is 521 in the next cycle."""
    axis = axis_name(ctx)
    begin(ctx)
    ctx.run_for(0.05)
    ctx.inject(
        "encoder.jump", drive_name(ctx), increments=increments(ctx, permitted(ctx, 0.0) * share / 100.0)
    )
    ctx.run_for(0.5)
    if abs(share) > 100:
        alarm_after(ctx, 521, 0.0, requirements=("MON-040",))
        disabled_with(ctx, 521, 11, None)
        return
    ctx.expect(
        no_alarm(axis=axis).covers("MON-040"),
        state_at(axis, ctx.now_s, "STANDSTILL"),
        value_at(f"{axis}.following_error", ctx.now_s, 0.0, tolerance=0.02),
    )


@CASES.product(
    "unwatched/{what}",
    parameters={"what": ("switched-off", "not-controlled")},
    title="following error {what}",
    tags=("following-error",),
    requirements=("MON-004", "MON-036", "MON-043"),
)
def unwatched(ctx: CaseContext, what: str) -> None:
    """Switched off, or without position control, nothing is compared: a jam of 6 mm passes, and the axis goes
    on.
    """
    axis = axis_name(ctx)
    off = what == "switched-off"
    begin(ctx, {"FollowingError.EnableMonitoring": False} if off else None)
    job = travel(ctx, 60.0, PositionControlled=off)
    ctx.inject("mechanics.jam", drive_name(ctx), duration_s=0.1)
    ctx.run_for(0.6)
    ctx.expect(
        no_alarm(axis=axis, besides=(504,)).covers("MON-043"),
        state_at(axis, ctx.now_s, "MOTION"),
    )
    run = Run(ctx)
    largest = float(abs(run.following_error).max())
    ctx.measure(
        "largest following error shown",
        largest,
        "mm",
        low=5.0 if off else 0.0,
        high=7.0 if off else 0.0,
        requirements=("MON-036",),
    )
    ctx.measure("the job is busy", float(job.Busy), low=1.0)


@CASES.product(
    "reversed/{state}",
    parameters={"state": ("standstill", "travel")},
    title="direction of the encoder reversed at {state}",
    tags=("following-error", "encoder"),
    requirements=("MON-040",),
    without=("STP-331",),
)
def reversed_encoder(ctx: CaseContext, state: str) -> None:
    """An axis whose encoder counts the wrong way runs away, and is stopped when the permitted following error
    is used up.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    begin(ctx)
    travel(ctx, 0.0 if state == "standstill" else 50.0)
    ctx.inject("encoder.reverse", drive, duration_s=0.4)
    if state == "standstill":
        ctx.do("MC_MoveRelative 5 mm")
        ctx.axis.move_relative(5.0)
    ctx.run_for(1.5)
    ctx.expect(alarm(521, reaction=4, since=APPLIED, within_s=0.25, axis=axis).covers("MON-040"))


@CASES.product(
    "blind/{every}",
    parameters={"every": (20, 100)},
    title="one of {every} increments lost",
    tags=("following-error", "encoder"),
    requirements=("MON-030", "MON-040"),
)
def steps_lost(ctx: CaseContext, every: int) -> None:
    """An encoder that misses increments deceives every loop: no following error, no alarm, and the machine is
    too far.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    begin(ctx)
    origin = float(Run(ctx).drive("position")[1][-1])
    ctx.inject("encoder.step_loss", drive, every=every)
    job = ctx.axis.move_relative(40.0, Velocity=200.0)
    ctx.wait_until(job.done, 3.0, "the axis believes that it has arrived")
    ctx.run_for(0.1)
    quiet(ctx, requirements=("MON-040",))
    reached = (float(Run(ctx).drive("position")[1][-1]) - origin) * 1000.0
    ctx.measure(
        "way of the machine",
        reached,
        "mm",
        low=40.0 * every / (every - 1) - 0.15,
        high=40.0 * every / (every - 1) + 0.15,
    )
    ctx.expect(value_at(f"{axis}.following_error", ctx.now_s, 0.0, tolerance=0.1))


UNSEEN: Final = {
    "scale": ("encoder.scale", {"factor": 0.95}, 40.0 / 0.95),
    "slip": ("mechanics.slip", {"revolutions": -0.3}, 37.0),
    "coupling": ("mechanics.coupling_break", {"motor_share": 0.5}, 0.0),
}
"""Fault, its parameters, and the way of the load where the axis believes in 40 mm, mm; with a screw of 10 mm.
"""


@CASES.product(
    "unseen/{fault}",
    parameters={"fault": list(UNSEEN)},
    title="{fault}: what an encoder on the motor cannot see",
    tags=("following-error", "encoder", "mechanics"),
    requirements=("MON-030", "MON-040"),
)
def unseen(ctx: CaseContext, fault: str) -> None:
    """No loop and no monitoring sees behind the encoder: the axis arrives without an alarm, and the load is
    elsewhere.
    """
    kind, options, way = UNSEEN[fault]
    mechanics = ctx.bench.config.drive[drive_name(ctx)].mechanics
    ctx.require(mechanics.lead_screw_mm == 10.0, "a screw of 10 mm without a gear")
    begin(ctx)
    origin = float(Run(ctx).drive("position")[1][-1])
    ctx.inject(kind, drive_name(ctx), **options)
    job = ctx.axis.move_relative(40.0, Velocity=200.0)
    ctx.wait_until(job.done, 3.0, "the axis believes that it has arrived")
    ctx.run_for(0.1)
    reached = (float(Run(ctx).drive("position")[1][-1]) - origin) * 1000.0
    ctx.measure("way of the load", reached, "mm", low=way - 0.15, high=way + 0.15, requirements=("MON-040",))
    quiet(ctx, requirements=("MON-040",))


@CASES.product(
    "drive-fault/{state}",
    parameters={"state": ("standstill", "travel")},
    title="following error fault of the drive at {state}",
    tags=("following-error", "drive"),
    requirements=("MON-054", "TA-020"),
)
def fault_of_the_drive(ctx: CaseContext, state: str) -> None:
    """A following error that the drive itself finds (8611h) is a drive fault, 421, and no 521."""
    axis = axis_name(ctx)
    begin(ctx)
    travel(ctx, 0.0 if state == "standstill" else 200.0)
    ctx.inject("drive.fault", drive_name(ctx), code=0x8611)
    ctx.run_for(1.2)
    ctx.expect(
        alarm(421, reaction=4, since=APPLIED, within_s=4 * cycle_s(ctx), axis=axis).covers("MON-054"),
        no_alarm(axis=axis, besides=(421,)).covers("MON-054"),
    )


@CASES.product(
    "late/{cycles}",
    parameters={"cycles": (1, 2)},
    title="actual values {cycles} cycles late",
    tags=("following-error", "bus"),
    requirements=("MON-030", "MON-040"),
)
def late_actual_values(ctx: CaseContext, cycles: int) -> None:
    """Actual values that come later look like a following error of the way in that time: 1.2 mm a cycle at
    300 mm/s.
    """
    axis = axis_name(ctx)
    begin(
        ctx,
        None,
        {
            "FollowingError.MinValue": 1.8,
            "FollowingError.MaxValue": 1.8,
            "FollowingError.WarningLevel": 100.0,
        },
    )
    travel(ctx, 300.0)
    ctx.inject("telegram.late", drive_name(ctx), direction="actual", cycles=cycles)
    ctx.run_for(0.5)
    if cycles == 1:
        ctx.expect(no_alarm(axis=axis).covers("MON-040"))
    else:
        ctx.expect(
            alarm(521, reaction=4, since=APPLIED, within_s=6 * cycle_s(ctx), axis=axis).covers("MON-040")
        )
    run = Run(ctx)
    applied = run.instant(APPLIED)
    shown = abs(run.following_error)[run.time > applied] if applied is not None else run.following_error
    ctx.measure(
        "largest following error",
        float(shown.max()),
        "mm",
        low=1.2 * cycles - 0.2,
        high=1.2 * cycles + 0.2,
        requirements=("MON-030",),
    )


@CASES.product(
    "load/{side}",
    parameters={"side": ("positive", "negative")},
    title="a load within the torque of the drive, in {side} direction",
    tags=("following-error", "mechanics"),
    requirements=("MON-035", "MON-040"),
)
def load(ctx: CaseContext, side: str) -> None:
    """A force that the drive can bear disturbs the following error for a moment, and leaves neither alarm nor
    deviation.
    """
    axis = axis_name(ctx)
    begin(ctx, None, WIDE)
    travel(ctx, 100.0)
    ctx.inject("mechanics.load_step", drive_name(ctx), force_N=400.0 * SIGN[side], duration_s=0.3)
    ctx.run_for(0.7)
    quiet(ctx, requirements=("MON-040",))
    run = Run(ctx)
    ctx.measure("largest following error", float(abs(run.following_error).max()), "mm", low=0.005, high=0.5)
    lag_of_model = 100.0 * float(ctx.axis.var("DynamicAxisModel.VelocityTimeConstant"))
    ctx.expect(value_at(f"{axis}.following_error", ctx.now_s, lag_of_model, tolerance=0.01).covers("MON-035"))
