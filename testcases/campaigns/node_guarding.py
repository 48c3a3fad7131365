"""Drives that are watched by node guarding in place of heartbeats: in time, too late, and back again."""

from __future__ import annotations

from typing import Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, happens, no_alarm, value_at
from hil.record import event
from testcases.campaigns._reactions import cycles, disabled_by_alarm, recovers, stopped_for_good
from testcases.campaigns.support import axis_name, bring_into, can_segment, drive_name, enable, settle_s

GUARD_S, FACTOR = 0.02, 3
BENCH: Final = BenchFile(
    "node guarding",
    load_bench("reference").text.replace(
        "[drive.drive1]\n",
        "[drive.drive1]\nheartbeat_ms = 0\n"
        f"guard_time_ms = {GUARD_S * 1000:.0f}\nlife_time_factor = {FACTOR}\n",
    ),
)
CAMPAIGN: Final = Campaign(
    "node guarding", tags=("canopen",), bench="testcases.campaigns.node_guarding:BENCH"
)


def guarding(ctx: CaseContext) -> int:
    """Return the identifier of the guarding frames of the drive."""
    return 0x700 + int(ctx.bench.config.drive[drive_name(ctx)].node_id)


@CAMPAIGN.case("in-time", requirements=("C301-029",))
def in_time(ctx: CaseContext) -> None:
    """One question or answer may be missing now and then: the axis goes on."""
    enable(ctx)
    bring_into(ctx, "constant")
    for _ in range(3):
        ctx.inject("frame.drop", can_segment(ctx), can_id=guarding(ctx), duration_s=GUARD_S - 0.002)
        ctx.run_for(0.2)
    ctx.expect(
        no_alarm(axis=axis_name(ctx)).covers("C301-029"),
        value_at(f"{axis_name(ctx)}.communication_ok", ctx.now_s, 1.0, tolerance=0.0),
    )


@CAMPAIGN.product(
    "lost/{phase}",
    parameters={"phase": ("constant", "standstill")},
    title="node guarding fails from {phase}",
    tags=("{phase}",),
    requirements=("C301-029", "STP-574"),
)
def lost(ctx: CaseContext, phase: str) -> None:
    """After the life time the axis reports the drive as lost, not before; both recover."""
    enable(ctx)
    bring_into(ctx, phase)
    fault = ctx.inject("frame.drop", can_segment(ctx), can_id=guarding(ctx))
    ctx.run_for(2.0 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(
            431,
            reaction=4,
            since=event("fault.applied"),
            within_s=(FACTOR + 1) * GUARD_S + cycles(ctx, 3),
            axis=axis_name(ctx),
        ).covers("STP-574"),
        happens(
            event("drive.connection_lost", drive_name(ctx)),
            since=event("fault.applied"),
            within_s=(FACTOR + 2) * GUARD_S,
        ).covers("C301-029"),
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    fault.remove()
    ctx.wait_until(lambda: ctx.bench.port(drive_name(ctx)).link_ok, 5.0, "the drive is in service again")
    recovers(ctx)
