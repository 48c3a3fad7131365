"""A hanging load and its holding brake: who holds it, and from when to when."""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from hil.expect import always, no_alarm, stays_within, value_at
from testcases.campaigns._hanging_load import CLOSING_S, OPENING_S
from testcases.campaigns._reactions import cycles
from testcases.campaigns.support import axis_name, drive_name, enable, settle_s

CAMPAIGN: Final = Campaign("holding brake", tags=("brake",), bench="testcases.campaigns._hanging_load:BENCH")

SAG_M: Final = 0.0002
"""How far the load may give way while the drive takes it over, m."""


def held(ctx: CaseContext, since: float, place_m: float) -> None:
    """Expect the load at its place from `since` on."""
    ctx.expect(
        stays_within(
            f"{drive_name(ctx)}.position", low=place_m - SAG_M, high=place_m + SAG_M, since=since
        ).named("the load is held")
    )


def place(ctx: CaseContext) -> float:
    """Return where the load is now, m."""
    return float(ctx.trace()[f"{drive_name(ctx)}.position"].values[-1])


@CAMPAIGN.case("opens", requirements=("C402-173",))
def opens(ctx: CaseContext) -> None:
    """The brake opens after its time; a motion commanded meanwhile does not begin before, nor does the load
    give way.
    """
    drive = drive_name(ctx)
    enable(ctx)
    begun = ctx.now_s
    closed = f"{drive}.brake_closed"
    ctx.check(value_at(closed, begun, 1.0, tolerance=0.0).named("the brake is still on its way"))
    ctx.do("MC_MoveVelocity 5 mm/s")
    ctx.axis.move_velocity(5.0)
    ctx.run_for(0.5)
    ctx.expect(
        always(
            "no speed is demanded of a motor whose brake is closed",
            lambda demand, brake: (np.abs(demand) < 0.01) | (brake == 0.0),
            f"{drive}.velocity_demand",
            closed,
        ).covers("C402-173"),
        value_at(closed, begun + OPENING_S + cycles(ctx, 2), 0.0, tolerance=0.0),
        stays_within(f"{drive}.position", low=-SAG_M).named("the load does not give way"),
        no_alarm(axis=axis_name(ctx)),
    )


@CAMPAIGN.product(
    "closes/power-{mode}",
    parameters={"mode": (0, 1, 2)},
    title="the brake closes at MC_Power StopMode {mode}",
    requirements=("STP-532",),
)
def closes(ctx: CaseContext, mode: int) -> None:
    """The motor holds the load until the brake has closed, then the torque goes."""
    drive = drive_name(ctx)
    enable(ctx)
    ctx.run_for(0.5)
    before, there = ctx.now_s, place(ctx)
    ctx.do(f"MC_Power Enable = FALSE, StopMode {mode}")
    power = ctx.axis.power(False, stop_mode=mode)
    ctx.wait_until(power.off, 2.0, "the axis is disabled")
    ctx.run_for(0.5 + settle_s(ctx))
    held(ctx, before, there)
    ctx.expect(
        value_at(f"{drive}.brake_closed", ctx.now_s, 1.0, tolerance=0.0),
        value_at(f"{drive}.torque", ctx.now_s, 0.0, tolerance=1e-9),
        always(
            "the motor holds the load until the brake has closed",
            lambda torque, brake: (np.abs(torque) > 0.1) | (brake == 1.0),
            f"{drive}.torque",
            f"{drive}.brake_closed",
            since=before,
        ).covers("STP-532"),
    )
    closed_s = float(ctx.trace()[f"{drive}.brake_closed"].changes()[0][-1])
    ctx.measure("time to the closed brake", closed_s - before, "s", low=CLOSING_S, requirements=("STP-532",))


@CAMPAIGN.case("again", requirements=("C402-173", "STP-532"))
def again(ctx: CaseContext) -> None:
    """Every opening and every closing takes its time, not only the first."""
    drive = drive_name(ctx)
    asked = []
    for _ in range(3):
        enable(ctx)
        ctx.run_for(0.3)
        asked.append(ctx.now_s)
        ctx.do("MC_Power Enable = FALSE, StopMode 2")
        ctx.wait_until(ctx.axis.power(False, stop_mode=2).off, 2.0, "the axis is disabled")
        ctx.run_for(0.2 + settle_s(ctx))
    trace = ctx.trace()
    enabled = [one.time_ns * 1e-9 for one in trace.select(source=drive, kind="drive.state")
               if one.data["to"] == "Operation enabled"]  # fmt: skip
    moved = trace[f"{drive}.brake_closed"].changes()[1:]
    for closed, begun, shortest, requirement in (
        (0.0, enabled, OPENING_S, "C402-173"),
        (1.0, asked, CLOSING_S, "STP-532"),
    ):
        changed = [time_s for time_s, level in moved if level == closed]
        ctx.require(len(changed) >= 3, "the brake opens and closes each time")
        for number, (begin, end) in enumerate(zip(begun, changed[-3:], strict=True), 1):
            ctx.measure(
                f"time of {'closing' if closed else 'opening'} number {number}",
                end - begin,
                "s",
                low=shortest - cycles(ctx, 1),
                high=shortest + cycles(ctx, 8),
                requirements=(requirement,),
            )
    ctx.expect(no_alarm(axis=axis_name(ctx)))
