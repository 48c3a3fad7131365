"""Camming: cyclic, appending and single cams, scaling, changes and faults of a cam in use."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, job_output, no_alarm, no_motion_after, value_at
from testcases.campaigns._synchronous import (
    BENCH,
    DISTANCE,
    FOLLOWER,
    LAST,
    Machine,
    bring,
    machine,
)
from testcases.campaigns.support import equal

CAMPAIGN: Final = Campaign("camming", tags=("synchronous",), bench=BENCH)
_PERIOD: Final = 100.0
_LIFT: Final = 20.0
_EXACT: Final = 1e-7
"""What a position may be off the formula of its cam, mm."""


def swing(x: float) -> float:
    """Return the following value of the cam `swing` by formula: polynomial 3-4-5 of VDI 2143, to and fro."""
    place = x % _PERIOD
    z = (place if place <= _PERIOD / 2 else _PERIOD - place) / (_PERIOD / 2)
    return _LIFT * z**3 * (10.0 - 15.0 * z + 6.0 * z**2)


def _on_cam(ctx: CaseContext, here: Machine, law: Callable[[float], float], cycles: int = 120) -> None:
    """Measure the greatest deviation of the setpoint from a formula, cycle by cycle."""
    worst = 0.0
    for _ in range(cycles):
        ctx.run_for(0.004)
        wanted = law(here.position(here.leader))
        worst = max(worst, abs(here.position(here.follower) - wanted))
    ctx.measure("position off the formula of the cam", worst, "mm", high=_EXACT)


def _cam_in(ctx: CaseContext, here: Machine, cam: str = "swing", **inputs: Any) -> Any:
    """Let the follower get on a cam with its synchronous position at 50 mm of it; returns the job."""
    given = {"MasterSyncPosition": 50.0, "MasterStartDistance": DISTANCE, "ApplicationMode": 1, **inputs}
    job = here.follower.cam_in(here.leader, ctx.bench.cam(cam), **given)
    here.lead()
    ctx.wait_until(lambda: job.InSync, 4.0, "the axis is on its cam")
    return job


@CAMPAIGN.product(
    "cyclic/{change}",
    parameters={"change": ("constant", "faster", "halt", "backwards")},
    title="A cyclic cam, leading axis: {change}",
    requirements=("CAM-105",),
)
def cyclic(ctx: CaseContext, change: str) -> None:
    """The axis is on the formula of its cam, whatever the leading axis does."""
    here = machine(ctx)
    _cam_in(ctx, here)
    if change == "faster":
        here.lead(180.0)
    elif change == "halt":
        here.leader.halt()
    elif change == "backwards":
        here.lead(-80.0)
    _on_cam(ctx, here, swing, 250)
    ctx.expect(no_alarm())


@CAMPAIGN.product(
    "scaled/{master}:{slave}",
    parameters={"master": (2.0, -1.0), "slave": (0.5, -1.0)},
    title="A cam scaled by {master} and {slave}",
    requirements=("CAM-104", "CAM-105"),
)
def scaled(ctx: CaseContext, master: float, slave: float) -> None:
    """The scaled formula holds; a negative scaling of the leading value mirrors the cam."""
    here = machine(ctx)
    _cam_in(
        ctx,
        here,
        MasterScaling=master,
        SlaveScaling=slave,
        MasterSyncPosition=50.0 * master,
        MasterOffset=200.0,
    )
    _on_cam(ctx, here, lambda x: slave * swing((x - 200.0) / master))
    ctx.expect(no_alarm())


@CAMPAIGN.product(
    "appending/{slave}",
    parameters={"slave": (1.0, -0.5)},
    title="A cam that appends its lift, scaled by {slave}",
    requirements=("CAM-105", "CAM-108"),
)
def appending(ctx: CaseContext, slave: float) -> None:
    """Every run adds the lift of the one before, scaled as the function; backwards it is taken away again."""
    here = machine(ctx)
    _cam_in(ctx, here, "step", ApplicationMode=2, MasterSyncPosition=80.0, SlaveScaling=slave)
    for velocity, run in ((400.0, 2), (-400.0, -1)):
        here.lead(velocity)
        ctx.wait_until(
            lambda run=run: (
                here.position(here.leader) // _PERIOD == run and here.position(here.leader) % _PERIOD > 82.0
            ),
            3.0,
            f"the cam dwells in run {run}",
        )
        ctx.run_for(0.008)
        equal(
            ctx,
            f"position in run {run}, mm",
            here.position(here.follower),
            40.0 * slave * (run + 1),
            "CAM-108",
            within=_EXACT,
        )


@CAMPAIGN.case("once", title="A cam that is run once")
def once(ctx: CaseContext) -> None:
    """At its end the job ends with EndOfProfile, and the axis stays where the cam ends."""
    here = machine(ctx)
    job = _cam_in(ctx, here, "step", ApplicationMode=0)
    ctx.wait_until(lambda: not job.Busy, 3.0, "the cam is at its end")
    ctx.run_for(0.3)
    ctx.expect(
        value_at(f"{FOLLOWER}.position_setpoint", ctx.now_s, 40.0, tolerance=_EXACT),
        no_motion_after(ctx.now_s - 0.2, axis=FOLLOWER),
        no_alarm(),
    )


@CAMPAIGN.case("two-axes", title="Two axes share a cam with different scalings", requirements=("CAM-105",))
def two_axes(ctx: CaseContext) -> None:
    """Each follows the formula with its own scaling."""
    here = machine(ctx)
    last = ctx.bench.axis(LAST)
    other = last.cam_in(
        here.leader, ctx.bench.cam("swing"), SlaveScaling=0.5, MasterSyncPosition=50.0,
        MasterStartDistance=DISTANCE, ApplicationMode=1,
    )  # fmt: skip
    _cam_in(ctx, here)
    ctx.measure("the other is on its cam, too", float(other.InSync), low=1.0)
    _on_cam(ctx, here, swing)
    off = here.position(last) - 0.5 * swing(here.position(here.leader))
    ctx.measure("other axis off its formula", abs(off), "mm", high=_EXACT, requirements=("CAM-105",))


@CAMPAIGN.case("leave", title="MC_CamOut stops at a position", requirements=("SYN-206",))
def leave(ctx: CaseContext) -> None:
    """The axis comes to rest at its stop position and stays."""
    here = machine(ctx)
    _cam_in(ctx, here)
    out = here.follower.cam_out(12.0, MasterStopDistance=5.0)
    ctx.wait_until(out.done, 5.0, "the axis has left its cam")
    ctx.run_for(0.3)
    ctx.expect(
        value_at(f"{FOLLOWER}.position_setpoint", ctx.now_s, 12.0, tolerance=_EXACT).covers("SYN-206"),
        no_motion_after(ctx.now_s - 0.2, axis=FOLLOWER),
    )


@CAMPAIGN.case("next", title="Another cam at the end of the first", requirements=("CAM-136",))
def next_cam(ctx: CaseContext) -> None:
    """The first one is run to its end, without a step of the setpoint at the change."""
    here = machine(ctx)
    first = _cam_in(ctx, here)
    ctx.wait_until(
        lambda: 20.0 < here.position(here.leader) % _PERIOD < 30.0, 2.0, "the first cam is under way"
    )
    second = here.follower.cam_in(
        here.leader, ctx.bench.cam("step"), SyncProfileReference=5, ApplicationMode=2, MasterSyncPosition=0.0
    )
    ctx.run_for(0.1)
    ctx.measure("the first cam goes on", float(first.InSync and not second.InSync), low=1.0)
    before, worst = here.position(here.follower), 0.0
    for _ in range(300):
        ctx.run_for(0.004)
        now = here.position(here.follower)
        worst, before = max(worst, abs(now - before)), now
    ctx.measure("the second one has taken over", float(second.InSync and first.CommandAborted), low=1.0)
    # Both cams move by at most 1.875 * 20 / 50 of the leading value.
    ctx.measure("greatest step of a cycle", worst, "mm", high=1.02 * 0.88 * 0.4)


@CAMPAIGN.case("not-interpolated", title="A cam that has not been interpolated", requirements=("SYN-313",))
def not_interpolated(ctx: CaseContext) -> None:
    """Alarm 612, and the axis is disabled."""
    here = machine(ctx, interpolated=False)
    since = ctx.do("MC_CamIn")
    job = here.follower.cam_in(here.leader, ctx.bench.cam("swing"), MasterStartDistance=DISTANCE)
    ctx.run_for(0.2)
    ctx.expect(
        alarm(612, reaction=4, since=since, axis=FOLLOWER).covers("SYN-313"),
        job_output(job.name, "Error", since=since, error_id=0x8001),
    )


@CAMPAIGN.product(
    "overwritten/{interpolated}",
    parameters={"interpolated": ("points", "points-and-interpolation")},
    title="The cam is overwritten while it is in use: {interpolated}",
    requirements=("CAM-105",),
)
def overwritten(ctx: CaseContext, interpolated: str) -> None:
    """The axis stays on the function that it began with; a new interpolation is refused with 16#80AB, and the
    next job has the new function only after one.
    """
    here = machine(ctx)
    job = _cam_in(ctx, here)
    both = interpolated != "points"
    ctx.inject("cam.overwrite", "swing", shift=5.0, interpolate=both, duration_s=0.5)
    _on_cam(ctx, here, swing, 200)
    ctx.measure("InSync", float(job.InSync), low=1.0)
    ctx.expect(no_alarm())
    if both:
        refused = job_output("swing.MC_InterpolateCam_2", "Error", error_id=0x80AB)
        ctx.expect(refused)


@CAMPAIGN.product(
    "leader/{fault}",
    parameters={"fault": ("drive-fault", "unplugged")},
    title="The leading axis of a cam fails: {fault}",
    requirements=("SYN-294",),
)
def leader_fails(ctx: CaseContext, fault: str) -> None:
    """A leading axis that stops leaves the axis on its cam; one without a value stops it with alarm 601."""
    here = machine(ctx)
    job = bring(ctx, here, "cam-in", "synchronous")
    if fault == "drive-fault":
        ctx.inject("drive.fault", "leader_drive", code=0x2310)
        ctx.run_for(1.0)
        ctx.measure("InSync", float(job.InSync), low=1.0)
        ctx.expect(alarm(421, reaction=4, axis=here.leader.name), no_alarm(axis=FOLLOWER, besides=(522,)))
        return
    ctx.inject("can.unplug", node="leader_drive", duration_s=0.4)
    ctx.run_for(1.0)
    ctx.expect(alarm(601, reaction=2, axis=FOLLOWER).covers("SYN-294"))
