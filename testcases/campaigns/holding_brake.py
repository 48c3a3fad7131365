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
