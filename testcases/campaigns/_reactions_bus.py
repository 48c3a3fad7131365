"""Cases of `fault_reactions`: what a disturbed bus and a lost node do to the axis."""

from __future__ import annotations

from typing import Final

from fieldbus.canopen import NmtState
from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, happens, never_happens, no_alarm, state_at, stays_within, value_at
from hil.record import event
from testcases.campaigns._profiles import enters, profile_of
from testcases.campaigns._reactions import cycles, disabled_by_alarm, recovers, stopped_for_good
from testcases.campaigns.support import (
    MOVING,
    PHASES,
    axis_name,
    bring_into,
    can_segment,
    drive_name,
    drive_setting,
    enable,
    grace_s,
    settle_s,
)

SIGN_OF_LIFE: Final = "sign of life of the controller failed"
"""Text of fault 1912."""

CASES: Final = Campaign("fault reactions", tags=("fault",), bench="reference")


@CASES.product(
    "actual-values-lost/{phase}",
    parameters={"phase": PHASES},
    title="actual values lost from {phase}",
    tags=("bus", "{phase}"),
    requirements=("STP-574", "STP-397", "TA-020"),
)
def actual_values_lost(ctx: CaseContext, phase: str) -> None:
    """The drive's actual values do not arrive any more: alarm 431 within the grace of three cycles, reaction
    4.
    """
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    lost_s = grace_s(ctx) + 0.5
    ctx.inject("frame.drop", can_segment(ctx), message="tpdo1", duration_s=lost_s)
    ctx.run_for(lost_s + 1.0 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(431, reaction=4, since=event("fault.applied"), within_s=grace_s(ctx), axis=axis).covers(
            "TA-020"
        ),
        value_at(f"{axis}.communication_ok", event("alarm.raised", axis, reaction=4), 0.0, tolerance=0.0),
        # The way of the gap is no velocity of one cycle.
        stays_within(f"{axis}.actual_velocity", low=-1000.0, high=1000.0),
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    recovers(ctx)


@CASES.product(
    "setpoints-lost/{phase}",
    parameters={"phase": MOVING},
    title="setpoints lost from {phase}",
    tags=("bus", "{phase}"),
    requirements=("C402-104", "STP-561", "PD-127", "PD-129", "PD-132", "STP-574"),
)
def setpoints_lost(ctx: CaseContext, phase: str) -> None:
    """The drive gets no setpoints any more: it brakes by itself, which the axis notices.

    A CiA 402 drive makes a quick stop and stays without fault (550); a PROFIdrive axis in isochronous
    operation misses the sign of life, brakes with OFF1 and takes its own sign of life away, which is a lost
    communication (431).
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    # A PROFIdrive axis tolerates one wrong sign of life (PNU 925 = 1).
    tolerated = drive_setting(ctx, "missing_setpoints") if profile_of(ctx) == "cia402" else 2
    missing_s = tolerated * ctx.bench.cycle_ns * 1e-9
    ctx.inject("frame.drop", can_segment(ctx), message="rpdo1", duration_s=missing_s + 1.2)
    ctx.run_for(missing_s + 2.2 + settle_s(ctx))
    ended = ctx.now_s
    applied = event("fault.applied")
    if profile_of(ctx) == "cia402":
        ctx.expect(
            happens(enters(ctx, "quick stop"), since=applied).covers("C402-104"),
            alarm(550, reaction=5, since=applied, axis=axis).covers("STP-561"),
        )
    else:
        # One wrong value is tolerated (PNU 925 = 1), the second one is the fault.
        ctx.expect(
            happens(
                event("drive.fault", drive, text=SIGN_OF_LIFE), since=applied, within_s=cycles(ctx, 3)
            ).covers("PD-127"),
            happens(
                event("drive.state", drive, to="S5 ramp stop"), since=applied, within_s=cycles(ctx, 3)
            ).covers("PD-129"),
            alarm(431, reaction=4, since=applied, within_s=cycles(ctx, 6), axis=axis).covers(
                "PD-132", "STP-574"
            ),
        )
    stopped_for_good(ctx, ended)


@CASES.case("two-actual-values-lost", tags=("bus",), requirements=("STP-574",))
def two_actual_values_lost(ctx: CaseContext) -> None:
    """Two missing actual values lie within the grace: no alarm, the motion goes on."""
    axis = axis_name(ctx)
    enable(ctx)
    job = bring_into(ctx, "constant")
    ctx.inject("frame.drop", can_segment(ctx), message="tpdo1", count=2)
    ctx.run_for(0.5)
    ctx.expect(
        no_alarm(axis=axis),
        state_at(axis, ctx.now_s, "MOTION"),
        never_happens(event("job.error", job=job.name)),
    )


@CASES.case("corrupted-frames", tags=("bus",), requirements=("CANP-030", "CANP-042", "CANP-045"))
def corrupted_frames(ctx: CaseContext) -> None:
    """Bit errors on the wire are repaired by repetition: no alarm, the motion goes on."""
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("frame.corrupt", can_segment(ctx), message="tpdo1", count=10, attempts=2)
    ctx.run_for(0.5)
    ctx.expect(no_alarm(axis=axis), state_at(axis, ctx.now_s, "MOTION"), happens(event("can.bus_error")))


@CASES.case("delayed-actual-values", tags=("bus",))
def delayed_actual_values(ctx: CaseContext) -> None:
    """Actual values that come half a cycle late disturb, but give no alarm."""
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject(
        "frame.delay", can_segment(ctx), message="tpdo1", delay_s=ctx.bench.cycle_ns * 0.75e-9, duration_s=0.2
    )
    ctx.run_for(0.5)
    ctx.expect(no_alarm(axis=axis, besides=(522,)), state_at(axis, ctx.now_s, "MOTION"))


@CASES.product(
    "node-off/{phase}",
    parameters={"phase": PHASES},
    title="drive loses its supply from {phase}",
    tags=("node", "{phase}"),
    requirements=("STP-397", "TA-020", "C301-022"),
)
def node_off(ctx: CaseContext, phase: str) -> None:
    """The node vanishes and comes back: 431, boot-up, cyclic data again; an incremental axis is not homed any
    more.
    """
    axis = axis_name(ctx)
    enable(ctx)
    ctx.do("MC_Home Mode 0, Position 0")
    ctx.axis.home(0.0)
    bring_into(ctx, phase)
    ctx.inject("drive.power_off", drive_name(ctx), duration_s=grace_s(ctx) + 2.4)
    ctx.run_for(grace_s(ctx) + 3.4 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(431, reaction=4, since=event("fault.applied"), within_s=grace_s(ctx), axis=axis).covers(
            "TA-020"
        ),
        happens(event("node.bootup"), since=event("fault.removed")).covers("C301-022"),
        happens(event("node.booted"), since=event("fault.removed")),
        value_at(f"{axis}.communication_ok", ended, 1.0, tolerance=0.0),
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    if ctx.axis.var("StatusWord.X5"):
        ctx.measure("homed after power-off of an incremental encoder", 1.0, low=0.0, high=0.0)
    recovers(ctx)


@CASES.product(
    "heartbeat-lost/{phase}",
    parameters={"phase": ("constant", "standstill")},
    title="heartbeat of the drive lost from {phase}",
    tags=("node", "{phase}"),
    requirements=("TA-020", "C301-026"),
)
def heartbeat_lost(ctx: CaseContext, phase: str) -> None:
    """The drive's heartbeat stays away although its data arrive: 431 after the consumer time."""
    axis = axis_name(ctx)
    enable(ctx)
    ctx.run_for(0.3)
    bring_into(ctx, phase)
    consumer = drive_setting(ctx, "consumer_heartbeat_ms") * 1e-3
    ctx.inject("drive.heartbeat_loss", drive_name(ctx), duration_s=consumer + 0.6)
    ctx.run_for(consumer + 1.6 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(
            431, reaction=4, since=event("fault.applied"), within_s=consumer + cycles(ctx, 2), axis=axis
        ).covers("TA-020")
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    recovers(ctx)


@CASES.product(
    "controller-heartbeat-lost/{phase}",
    parameters={"phase": ("constant", "standstill")},
    title="heartbeat of the controller lost from {phase}",
    tags=("node", "{phase}"),
    requirements=("C301-026", "C402-077", "C301-123"),
)
def controller_heartbeat_lost(ctx: CaseContext, phase: str) -> None:
    """The drive misses the controller's heartbeat: it stops by its option code and says so (EMCY 8130h)."""
    axis = axis_name(ctx)
    enable(ctx)
    ctx.run_for(0.3)
    bring_into(ctx, phase)
    consumer = drive_setting(ctx, "consumer_heartbeat_ms") * 1e-3
    ctx.inject("frame.drop", can_segment(ctx), message="controller_heartbeat", duration_s=consumer + 0.5)
    ctx.run_for(consumer + 1.5 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        happens(
            event("emcy.received", code=0x8130),
            since=event("fault.applied"),
            within_s=consumer + cycles(ctx, 3),
        ).covers("C301-123"),
        # The default error behaviour takes the node to Pre-operational, so that its data stay away as well
        # (1029h).
        alarm(431, reaction=4, since=event("fault.applied"), axis=axis).covers("C301-020"),
    )
    stopped_for_good(ctx, ended)


@CASES.product(
    "nmt-{command}/{phase}",
    parameters={"command": ("02", "80"), "phase": ("constant", "standstill")},
    title="a foreign node sends NMT command {command}h, from {phase}",
    tags=("bus", "{phase}"),
    requirements=("C301-016", "C301-020", "C402-077"),
)
def foreign_nmt(ctx: CaseContext, command: str, phase: str) -> None:
    """A foreign node takes the drive out of Operational: the drive stops, its data stay away, alarm 431."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    node = drive_setting(ctx, "node_id")
    ctx.inject("frame.inject", can_segment(ctx), can_id=0, data=f"{command}{node:02X}", count=1)
    ctx.run_for(1.5 + settle_s(ctx))
    ended = ctx.now_s
    state = {"02": NmtState.STOPPED, "80": NmtState.PRE_OPERATIONAL}[command]
    ctx.expect(
        happens(
            event("link.nmt_state", drive, state=int(state)), since=event("fault.applied"), within_s=0.5
        ).named("the heartbeat shows the state"),
        alarm(431, reaction=4, since=event("fault.applied"), within_s=grace_s(ctx), axis=axis).covers(
            "C301-020"
        ),
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
