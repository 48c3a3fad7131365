"""Gearing: ratios, profiles, chains, shifts, limits, and what stops, homing and faults make of it."""

from __future__ import annotations

from typing import Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import (
    alarm,
    always,
    follows,
    job_output,
    no_alarm,
    no_motion_after,
    status_word_bit,
    value_at,
)
from testcases.campaigns._synchronous import (
    BENCH,
    DISTANCE,
    FOLLOWER,
    FUNCTIONS,
    LAST,
    LEADER,
    SPEED,
    applied,
    bring,
    machine,
    stays_in_gear,
)
from testcases.campaigns.camming import swing

_TURN: Final = 100.0
"""Modulo range of the follower where it has one, mm."""
ROUND: Final[BenchFile] = load_bench(BENCH).configured(
    {
        "axis": {
            FOLLOWER: {"variables": {"Modulo.Enable": True, "Modulo.StartValue": 0.0, "Modulo.Length": _TURN}}
        }
    }
)
CAMPAIGN: Final = Campaign("gearing", tags=("synchronous",), bench=BENCH)
TURNING: Final = Campaign(
    "gearing of a modulo axis", tags=("synchronous",), bench="testcases.campaigns.gearing:ROUND"
)
_MAXIMUM: Final = 500.0
"""Highest velocity of the axes of the bench, mm/s."""


@CAMPAIGN.product(
    "ratio/{numerator}:{denominator}",
    parameters={"numerator": (1, -3, 7), "denominator": (1, 4)},
    title="MC_GearIn {numerator}:{denominator} behind an axis that changes its velocity and stops",
    requirements=("SYN-118", "SYN-301"),
)
def ratio(ctx: CaseContext, numerator: int, denominator: int) -> None:
    """The positions keep the ratio in every cycle, through changes of velocity and at standstill."""
    here = machine(ctx)
    job = here.follower.gear_in(here.leader, numerator, denominator)
    here.lead(50.0)
    ctx.wait_until(job.in_gear, 3.0, "the axis is in gear")
    judge = stays_in_gear(ctx, here, numerator / denominator, "off the ratio")
    begin = ctx.now_s
    here.lead(60.0)
    ctx.run_for(0.5)
    ctx.do("MC_Halt on the leading axis")
    ctx.wait_until(here.leader.halt().done, 3.0, "the leading axis stands")
    ctx.run_for(0.1)
    judge()
    ctx.expect(
        status_word_bit(22, True, at=ctx.now_s, axis=FOLLOWER).covers("SYN-301"),
        follows(FOLLOWER, LEADER, numerator / denominator, since=begin, tolerance=0.2),
    )


@CAMPAIGN.product(
    "profile/{profile}/{direction}",
    parameters={"profile": (0, 1, 3, 4), "direction": ("forwards", "backwards")},
    title="MC_GearInPos with SyncProfileReference {profile}, leading axis {direction}",
    requirements=("SYN-118",),
)
def profile(ctx: CaseContext, profile: int, direction: str) -> None:
    """Whatever the profile, the axis is at its synchronous position when the leading axis is at its own."""
    here = machine(ctx)
    sign = 1.0 if direction == "forwards" else -1.0
    job = here.follower.gear_in_pos(
        here.leader,
        sign * 100.0,
        sign * 30.0,
        1,
        2,
        SyncProfileReference=profile,
        MasterStartDistance=DISTANCE,
    )
    here.lead(sign * SPEED)
    ctx.wait_until(job.in_sync, 4.0, "the axis is synchronous")
    ctx.run_for(0.2)
    x, y = here.position(here.leader), here.position(here.follower)
    wanted = sign * 30.0 + 0.5 * (x - sign * 100.0)
    ctx.measure("position off that of the gear", abs(y - wanted), "mm", high=1e-6, requirements=("SYN-118",))
    ctx.expect(no_alarm())


@CAMPAIGN.case("chain", title="A follower leads another one", requirements=("SYN-015",))
def chain(ctx: CaseContext) -> None:
    """Ratios multiply, and all axes of the chain use the values of the same cycle."""
    here = machine(ctx)
    last = ctx.bench.axis(LAST)
    first = here.follower.gear_in(here.leader, 1, 2)
    second = last.gear_in(here.follower, -3, 1)
    here.lead()
    ctx.wait_until(lambda: first.InGear and second.InGear, 3.0, "both are in gear")
    x, y = here.position(here.leader), here.position(last)
    here.lead(2.0 * SPEED)
    for _ in range(25):
        ctx.run_for(0.004)
        moved = here.position(last) - y + 1.5 * (here.position(here.leader) - x)
        if abs(moved) > 1e-6:
            break
    ctx.measure("last axis off the product of the ratios", abs(moved), "mm", high=1e-6)


@CAMPAIGN.case(
    "velocity/ratio-changes", title="MC_GearInVelocity with another ratio", requirements=("SYN-170",)
)
def velocity_ratio(ctx: CaseContext) -> None:
    """A changed ratio acts at once while ContinuousUpdate is TRUE, and the last one stays."""
    here = machine(ctx)
    job = here.follower.gear_in_velocity(here.leader, 1, 2, ContinuousUpdate=True)
    here.lead()
    ctx.wait_until(job.in_sync, 3.0, "the axis is synchronous")
    ctx.run_for(0.3)
    job.set(RatioNumerator=3, RatioDenominator=4)
    ctx.run_for(0.012)
    ctx.measure("velocity", here.follower.var("Velocity"), "mm/s", low=75.0, high=75.0)
    job.set(ContinuousUpdate=False)
    ctx.run_for(0.012)
    job.set(RatioNumerator=1)
    ctx.run_for(0.1)
    ctx.measure("velocity kept", here.follower.var("Velocity"), "mm/s", low=75.0, high=75.0)


@CAMPAIGN.product(
    "shift/{kind}",
    parameters={"kind": ("phasing", "offset", "additive")},
    title="{kind} on a synchronous axis",
)
def shift(ctx: CaseContext, kind: str) -> None:
    """The gear goes on from the shifted leading or following value."""
    here = machine(ctx)
    job = bring(ctx, here, "gear-in", "synchronous")
    x, y = here.position(here.leader), here.position(here.follower)
    if kind == "phasing":
        moved = here.follower.phasing_relative(8.0)
        added = 4.0
    elif kind == "offset":
        moved = here.follower.offset_relative(8.0, 20.0)
        added = 8.0
    else:
        additive = here.follower.leading_value_additive(0.5)
        ctx.run_for(0.02)
        ctx.measure("Busy", float(additive.Busy), low=1.0)
        moved, added = None, 0.25
    if moved is not None:
        ctx.wait_until(moved.done, 5.0, "the shift is done")
    off = here.position(here.follower) - y - 0.5 * (here.position(here.leader) - x) - added
    ctx.measure("position off the shifted gear", abs(off), "mm", high=1e-6)
    ctx.measure("InGear", float(job.InGear), low=1.0)
    ctx.expect(no_alarm())


@CAMPAIGN.case(
    "gear-out", title="MC_GearOut stops at a position", requirements=("SYN-205", "SYN-206", "SYN-207")
)
def gear_out(ctx: CaseContext) -> None:
    """The axis comes to rest at its stop position, over the distance; its former job is aborted."""
    here = machine(ctx)
    job = bring(ctx, here, "gear-in-pos", "synchronous")
    place = here.position(here.follower) + 60.0
    out = here.follower.gear_out(place, MasterStopDistance=DISTANCE)
    ctx.wait_until(lambda: out.StartSyncOut, 4.0, "desynchronising begins")
    begun = here.position(here.leader)
    ctx.run_for(0.008)
    ctx.measure("CommandAborted of the gear", float(job.CommandAborted), low=1.0, requirements=("SYN-207",))
    ctx.wait_until(out.done, 3.0, "the axis is desynchronised")
    way = here.position(here.leader) - begun
    ctx.measure(
        "way of the leading axis",
        way,
        "mm",
        low=DISTANCE - 1.0,
        high=DISTANCE + 3.0,
        requirements=("SYN-205",),
    )
    ctx.run_for(0.3)
    ctx.expect(
        value_at(f"{FOLLOWER}.position_setpoint", ctx.now_s, place, tolerance=1e-6).covers("SYN-206"),
        no_motion_after(ctx.now_s - 0.2, axis=FOLLOWER),
    )


@TURNING.case(
    "gear-out/behind",
    title="MC_GearOut to a place that the axis has just passed",
    requirements=("SYN-206",),
)
def gear_out_behind(ctx: CaseContext) -> None:
    """A modulo axis goes on in its direction to the stop position of the next turn; it does not come back."""
    here = machine(ctx)
    bring(ctx, here, "gear-in-pos", "synchronous")
    place = (here.position(here.follower) - 5.0) % _TURN
    since = ctx.now_s
    out = here.follower.gear_out(place, MasterStopDistance=DISTANCE)
    ctx.wait_until(out.done, 5.0, "the axis is desynchronised")
    ctx.run_for(0.2)
    ctx.expect(
        always(
            "the follower does not reverse",
            lambda velocity: velocity >= -1e-6,
            f"{FOLLOWER}.velocity_setpoint",
            since=since,
        ),
    )
    ctx.measure(
        "stop position",
        here.position(here.follower),
        "mm",
        low=place - 1e-6,
        high=place + 1e-6,
        requirements=("SYN-206",),
    )


@CAMPAIGN.product(
    "limit/velocity/{numerator}",
    parameters={"numerator": (6, -6)},
    title="The leading axis is too fast for the follower, {numerator}:1",
    requirements=("SYN-146",),
)
def too_fast(ctx: CaseContext, numerator: int) -> None:
    """The follower waits at its own limit, and gets in gear when the leading axis is slower."""
    here = machine(ctx)
    job = here.follower.gear_in(here.leader, numerator, 1)
    sign = 1.0 if numerator > 0 else -1.0
    here.lead()
    ctx.run_for(1.2)
    ctx.measure("velocity", sign * here.follower.var("Velocity"), "mm/s", low=_MAXIMUM, high=_MAXIMUM)
    ctx.measure("InGear", float(job.InGear), high=0.0)
    ctx.expect(no_alarm(besides=(501, 504)))
    here.lead(50.0)
    ctx.wait_until(job.in_gear, 3.0, "the axis is in gear")
    speed = sign * here.follower.var("Velocity")
    ctx.measure("velocity in gear", speed, "mm/s", low=6 * 50.0 - 1e-6, high=6 * _MAXIMUM)


@CAMPAIGN.case("leader-off", title="MC_Power off with a ramp on the leading axis", requirements=("SYN-293",))
def leader_off(ctx: CaseContext) -> None:
    """The follower comes to rest with it, stays synchronous, and follows when it is enabled and moves."""
    here = machine(ctx)
    job = bring(ctx, here, "gear-in", "synchronous")
    ctx.do("MC_Power off on the leading axis")
    here.leader.power(False)
    ctx.run_for(0.8)
    ctx.measure("InGear at rest", float(job.InGear), low=1.0)
    ctx.wait_until(here.leader.power().status, 2.0, "the leading axis is enabled again")
    x, y = here.position(here.leader), here.position(here.follower)
    here.lead()
    ctx.run_for(0.4)
    off = here.position(here.follower) - y - 0.5 * (here.position(here.leader) - x)
    ctx.measure("off the ratio afterwards", abs(off), "mm", high=1e-6)
    ctx.measure("way of the follower", here.position(here.follower) - y, "mm", low=5.0)


@CAMPAIGN.case("leader-restart", title="MC_Reset with Restart on the leading axis", requirements=("SYN-296",))
def leader_restart(ctx: CaseContext) -> None:
    """The leading value becomes invalid: alarm 601 at the follower."""
    here = machine(ctx)
    job = bring(ctx, here, "gear-in", "synchronous")
    here.leader.power(False)
    ctx.run_for(0.8)
    since = ctx.do("MC_Reset Restart = TRUE on the leading axis")
    here.leader.reset(restart=True)
    ctx.run_for(0.3)
    ctx.expect(alarm(601, reaction=2, since=since, axis=FOLLOWER).covers("SYN-296"))
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)


@CAMPAIGN.case("halt", title="MC_Halt on the follower", requirements=("SYN-302", "SYN-303"))
def halt(ctx: CaseContext) -> None:
    """The synchronous job ends, the follower stops by itself and stays; the leading axis goes on."""
    here = machine(ctx)
    job = bring(ctx, here, "gear-in", "synchronous")
    since = ctx.do("MC_Halt on the follower")
    ctx.wait_until(here.follower.halt().done, 3.0, "the follower stands")
    ctx.run_for(0.3)
    ctx.expect(
        job_output(job.name, "CommandAborted", since=since).covers("SYN-302"),
        no_motion_after(ctx.now_s - 0.2, axis=FOLLOWER).covers("SYN-303"),
        no_alarm(),
    )
    ctx.measure("velocity of the leading axis", here.leader.var("Velocity"), "mm/s", low=SPEED, high=SPEED)


@CAMPAIGN.case("follower-off", title="MC_Power off on the follower", requirements=("SYN-292", "SYN-303"))
def follower_off(ctx: CaseContext) -> None:
    """Active and waiting jobs are aborted; enabled again, the axis stands."""
    here = machine(ctx)
    gear = bring(ctx, here, "gear-in", "synchronous")
    waiting = here.follower.gear_in_pos(here.leader, 4000.0, 0.0)
    ctx.run_for(0.05)
    since = ctx.do("MC_Power off on the follower")
    here.follower.power(False)
    ctx.run_for(0.6)
    for job in (gear, waiting):
        ctx.expect(job_output(job.name, "CommandAborted", since=since).covers("SYN-292"))
    ctx.wait_until(here.follower.power().status, 2.0, "the follower is enabled again")
    ctx.run_for(0.3)
    ctx.expect(no_motion_after(ctx.now_s - 0.2, axis=FOLLOWER).covers("SYN-303"))


@CAMPAIGN.case(
    "leader-homed", title="MC_Home moves the coordinates of the leading axis", requirements=("SYN-028",)
)
def leader_homed(ctx: CaseContext) -> None:
    """The leading value jumps, and the follower with it, by the ratio."""
    here = machine(ctx)
    bring(ctx, here, "gear-in", "synchronous")
    ctx.wait_until(here.leader.halt().done, 3.0, "the leading axis stands")
    ctx.run_for(0.2)
    y = here.position(here.follower)
    ctx.do("MC_Home Mode 1: the leading axis is 2 mm further")
    ctx.wait_until(here.leader.home(2.0, mode=1).done, 1.0, "it is homed")
    ctx.run_for(0.1)
    step = here.position(here.follower) - y
    ctx.measure(
        "step of the follower", step, "mm", low=1.0 - 1e-6, high=1.0 + 1e-6, requirements=("SYN-028",)
    )


@CAMPAIGN.product(
    "follower-homed/{function}",
    parameters={"function": tuple(FUNCTIONS)},
    title="MC_Home moves the coordinates of the follower: {function}",
    requirements=("HOM-139", "HOM-140", "HOM-142"),
)
def follower_homed(ctx: CaseContext, function: str) -> None:
    """The numbers of its positions change and nothing else: no motion, no job ends, and the relation to the
    leading axis goes on from the new numbers; on the way and at rest.
    """
    here = machine(ctx)
    job = bring(ctx, here, function, "synchronous")

    def synchronous() -> float:
        """Return what the function makes of the leading position."""
        x = here.position(here.leader)
        return swing(x - 50.0) if function == "cam-in" else 0.5 * x

    origin = here.position(here.follower) - synchronous()
    for mode, place in ((1, 7.0), (1, -31.0), (0, 3.0)):
        if mode == 0:
            ctx.wait_until(here.leader.halt().done, 3.0, "the leading axis stands")
            ctx.run_for(0.3)
        origin += place - (here.follower.var("ActualPosition") if mode == 0 else 0.0)
        since = ctx.do(f"MC_Home Mode {mode}, {place:g} mm")
        ctx.wait_until(here.follower.home(place, mode=mode).done, 1.0, "it is homed")
        ctx.run_for(0.1)
        ctx.measure(
            f"Mode {mode}: off the relation",
            abs(here.position(here.follower) - synchronous() - origin),
            "mm",
            high=0.02 if mode == 0 or function == "gear-in-velocity" else 1e-6,
            requirements=("HOM-142",),
        )
        shown = ctx.trace()[f"{FOLLOWER}.actual_velocity"].between(since, ctx.now_s).values
        ctx.measure(
            f"Mode {mode}: change of the velocity of the machine",
            float(shown.max() - shown.min()),
            "mm/s",
            high=100.0,
            requirements=("HOM-140",),
        )
    ctx.measure("the job goes on", float(job.Busy), low=1.0, requirements=("HOM-142",))
    ctx.expect(no_alarm())


@CAMPAIGN.case(
    "limit/software", title="The follower meets its software limit switch", requirements=("SYN-308",)
)
def software_limit(ctx: CaseContext) -> None:
    """Alarm 533 stops the follower in front of it with maximum dynamics; the leading axis goes on."""
    here = machine(ctx)
    for path, value in (("MaxPosition", 40.0), ("MinPosition", -4000.0), ("Active", True)):
        here.follower.write(f"PositionLimits_SW.{path}", value)
    job = bring(ctx, here, "gear-in", "synchronous")
    ctx.run_for(1.5)
    ctx.expect(alarm(533, reaction=2, axis=FOLLOWER).covers("SYN-308"), no_alarm(axis=LEADER))
    ctx.measure(f"ErrorID of {job.name}", job.ErrorID, low=0x8001, high=0x8001)
    ctx.measure("position", here.follower.var("ActualPosition"), "mm", low=20.0, high=40.5)


@CAMPAIGN.product(
    "cycles-lost/{which}",
    parameters={"which": ("leader_drive", "a_drive")},
    title="Two bus cycles of {which} are lost",
)
def cycles_lost(ctx: CaseContext, which: str) -> None:
    """The gear bridges them: the setpoints keep the ratio, and nobody stops."""
    here = machine(ctx)
    job = bring(ctx, here, "gear-in", "synchronous")
    judge = stays_in_gear(ctx, here, 0.5, "off the ratio")
    target = ctx.bench.drive(which).name
    identifier = ctx.bench.cob_ids(target)["tpdo1"]
    ctx.inject("frame.drop", count=2, can_id=identifier)
    ctx.run_for(0.3)
    judge()
    ctx.measure("InGear", float(job.InGear), low=1.0)
    ctx.expect(no_alarm(since=applied()))
