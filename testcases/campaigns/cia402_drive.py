"""What the CiA 402 drive owes its controller and the other campaigns do not ask for: local control, lost
SYNC, missing setpoints.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, always, happens, never_happens, no_alarm
from hil.record import event
from testcases.campaigns._reactions import cycles, recovers
from testcases.campaigns.support import (
    axis_name,
    bring_into,
    can_segment,
    drive_name,
    drive_setting,
    enable,
    settle_s,
)

CAMPAIGN: Final = Campaign("cia402 drive", tags=("drive", "cia402"), bench="reference")

_REMOTE: Final = 1 << 9


@CAMPAIGN.case("local-control", requirements=("C402-041", "STP-559"))
def local_control(ctx: CaseContext) -> None:
    """Under local control bit 9 is 0 and no control word acts; the axis tells it, and leads the drive again
    afterwards.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    fault = ctx.inject("drive.local_control", drive)
    taken = ctx.now_s
    ctx.run_for(0.5 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(421, reaction=4, since=taken, within_s=cycles(ctx, 4), axis=axis),
        always(
            "bit 9 of the status word is 0",
            lambda word: (word.astype(np.int64) & _REMOTE) == 0,
            f"{drive}.statusword",
            since=taken + cycles(ctx, 2),
            until=ended - cycles(ctx, 1),
        ).covers("C402-041"),
        never_happens(event("drive.state", drive), since=taken, until=ended - cycles(ctx, 1)),
    )
    fault.remove()
    ctx.run_for(1.0 + settle_s(ctx))
    recovers(ctx)


@CAMPAIGN.product(
    "sync-lost/{phase}",
    parameters={"phase": ("constant", "standstill")},
    title="SYNC stays away from {phase}",
    tags=("{phase}",),
    requirements=("C301-037",),
)
def sync_lost(ctx: CaseContext, phase: str) -> None:
    """Without SYNC a drive in a cyclic mode goes into its fault reaction after one and a half cycles, with
    EMCY 8700h.
    """
    drive = drive_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    ctx.inject("frame.drop", can_segment(ctx), can_id=0x080, duration_s=0.5)
    ctx.run_for(2.0 + settle_s(ctx))
    ctx.expect(
        happens(
            event("emcy.raised", drive, code=0x8700),
            since=event("fault.applied"),
            within_s=cycles(ctx, 3),
        ).covers("C301-037"),
        happens(event("drive.state", drive, to="Fault"), since=event("fault.applied"), within_s=1.0),
    )
    recovers(ctx)


@CAMPAIGN.product(
    "setpoints-missing/{number}",
    parameters={"number": (1, 2)},
    title="{number} setpoints in a row are missing",
    requirements=("C402-077",),
)
def setpoints_missing(ctx: CaseContext, number: int) -> None:
    """The drive bridges gaps shorter than `missing_setpoints`; at that number it takes the connection for
    lost.
    """
    drive = drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    tolerated = int(drive_setting(ctx, "missing_setpoints"))
    ctx.inject("frame.drop", can_segment(ctx), message="rpdo1", count=number)
    ctx.run_for(1.5 + settle_s(ctx))
    lost = event("drive.connection_lost", drive)
    since = event("fault.applied")
    ctx.expect(
        never_happens(lost, since=since)
        if number < tolerated
        else happens(lost, since=since, within_s=cycles(ctx, tolerated + 2)),
    )
    if number < tolerated:
        ctx.expect(no_alarm(axis=axis_name(ctx)))


@CAMPAIGN.case("heartbeat-never-comes")
def heartbeat_never_comes(ctx: CaseContext) -> None:
    """A drive that is configured to send heartbeats and starts without a single one is lost like one whose
    heartbeat has stopped.
    """
    drive = drive_name(ctx)
    off = ctx.inject("drive.power_off", drive)
    ctx.run_for(0.5)
    silent = ctx.inject("drive.heartbeat_loss", drive)
    off.remove()
    since = ctx.now_s
    ctx.run_for(1.5)
    ctx.expect(happens(event("node.lost", reason="heartbeat"), since=since, within_s=1.5))
    silent.remove()


@CAMPAIGN.product(
    "nmt-of-others/{command}",
    parameters={"command": ("02", "80", "81")},
    title="NMT command {command}h to another node",
    requirements=("C301-016",),
)
def nmt_of_others(ctx: CaseContext, command: str) -> None:
    """A node obeys NMT commands to itself and to all, not those to another node."""
    enable(ctx)
    bring_into(ctx, "constant")
    other = int(drive_setting(ctx, "node_id")) + 1
    ctx.inject("frame.inject", can_segment(ctx), can_id=0, data=f"{command}{other:02X}", count=1)
    ctx.run_for(0.5)
    ctx.expect(
        never_happens(event("nmt.state", drive_name(ctx)), since=event("fault.applied")).covers("C301-016"),
        no_alarm(axis=axis_name(ctx)),
    )
