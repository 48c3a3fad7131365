"""Cases of `fault_reactions`: the drive trips, its encoder is faulty, its torque is taken."""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, event_order, happens, job_output, state_at
from hil.record import event
from testcases.campaigns._profiles import by_profile, enters, profile_of
from testcases.campaigns._reactions import cycles, disabled_by_alarm, recovers, stopped_for_good
from testcases.campaigns.support import PHASES, axis_name, bring_into, drive_name, enable, settle_s

COASTS_402: Final = ("3210",)
"""Faults of `drive_fault` after which a CiA 402 drive has no torque."""
COASTS_PD: Final = ("2310", "3210")
"""Those with reaction OFF2 of a PROFIdrive axis: pulses off at once. The following error has OFF1."""

CASES: Final = Campaign("fault reactions", tags=("fault",), bench="reference")


@CASES.product(
    "drive-fault/{code}/{phase}",
    parameters={"code": ("2310", "8611", "3210"), "phase": PHASES},
    title="drive fault {code}h from {phase}",
    tags=("drive", "{phase}"),
    requirements=("STP-559", "TA-020", "C402-014", "C402-015", "PD-104", "PD-115"),
)
def drive_fault(ctx: CaseContext, code: str, phase: str) -> None:
    """The drive trips: alarm 421 with reaction 4, jobs end with 16#8001, standstill, and recovery by one
    MC_Reset.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    job = bring_into(ctx, phase)
    before = ctx.now_s
    ctx.inject("drive.fault", drive, code=int(code, 16))
    ctx.run_for(3.0 + settle_s(ctx))
    ended = ctx.now_s
    applied = event("fault.applied")
    ctx.expect(alarm(421, reaction=4, since=applied, within_s=cycles(ctx, 4), axis=axis).covers("STP-559"))
    faulted = enters(ctx, "off after a fault")
    ctx.expect(
        happens(faulted, since=before).covers(
            *by_profile(ctx, cia402=("C402-015",), profidrive=("PD-104", "PD-115"))
        )
    )
    order = [applied, event("alarm.raised", axis)]
    brakes = phase != "standstill" and code not in by_profile(ctx, cia402=COASTS_402, profidrive=COASTS_PD)
    if brakes:
        # The drive has the time to tell before it stands.
        reacts = by_profile(ctx, cia402="Fault reaction active", profidrive="S5 ramp stop")
        order[1:1] = [event("drive.state", drive, to=reacts)]
        order.append(faulted)
    elif profile_of(ctx) == "profidrive" and code in COASTS_PD:
        order[1:1] = [faulted]
    ctx.expect(event_order(order))
    if job is not None:
        ctx.expect(
            job_output(job.name, "Error", since=before, error_id=0x8001, within_s=cycles(ctx, 4)).covers(
                "STP-252"
            )
        )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    recovers(ctx)
    ctx.expect(state_at(axis, ctx.now_s, "STANDSTILL").covers("STP-033"))


@CASES.product(
    "encoder-fault/{phase}",
    parameters={"phase": PHASES},
    title="encoder fault 7305h from {phase}",
    tags=("encoder", "{phase}"),
    requirements=("TA-020",),
)
def encoder_fault(ctx: CaseContext, phase: str) -> None:
    """The drive reports its encoder as faulty: alarm 411 with reaction 4; without an encoder the drive cannot
    brake.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    ctx.inject("drive.fault", drive, code=0x7305)
    ctx.run_for(4.0 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(411, reaction=4, since=event("fault.applied"), within_s=cycles(ctx, 4), axis=axis).covers(
            "TA-020"
        )
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)


@CASES.product(
    "safe-torque-off/{phase}",
    parameters={"phase": PHASES},
    title="safe torque off from {phase}",
    tags=("drive", "{phase}"),
    requirements=("STP-560", "C402-030", "PD-104", "TA-018"),
)
def safe_torque_off(ctx: CaseContext, phase: str) -> None:
    """Safe torque off: the axis coasts, alarm 421; released and acknowledged it is enabled again."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    sto = ctx.inject("drive.sto", drive)
    ctx.run_for(3.5 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(421, reaction=4, since=event("fault.applied"), within_s=cycles(ctx, 4), axis=axis).covers(
            "STP-560"
        )
    )
    ctx.expect(
        happens(
            enters(ctx, "switched off"),
            since=event("fault.applied"),
            within_s=cycles(ctx, 1),
        ).covers(*by_profile(ctx, cia402=("C402-030",), profidrive=("PD-104",)))
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    sto.remove()
    recovers(ctx)
