"""Cases of `fault_reactions`: a controller that stops, overruns its cycle, hangs, or loses its supply."""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign, CaseContext
from hil.expect import happens, never_happens, state_at, value_at
from hil.record import event
from testcases.campaigns._profiles import enters, profile_of
from testcases.campaigns._reactions import cycles, machine_at_rest, stopped_for_good
from testcases.campaigns.support import (
    MOVING,
    acknowledge,
    axis_name,
    bring_into,
    drive_name,
    enable,
    settle_s,
)

CASES: Final = Campaign("fault reactions", tags=("fault",), bench="reference")

STOPPED: Final = event("controller.state", to="STOP")


def _enabled_again(ctx: CaseContext) -> None:
    """Acknowledge what the drive reports of the time without controller; nothing has started by itself, and
    it can be enabled.
    """
    ctx.run_for(0.5)
    ctx.expect(
        value_at(f"{axis_name(ctx)}.power_status", ctx.now_s, 0.0, tolerance=0.0).named(
            "nothing starts by itself"
        )
    )
    acknowledge(ctx)
    enable(ctx)
    ctx.do("MC_MoveRelative -20 mm")
    move = ctx.axis.move_relative(-20.0)
    ctx.wait_until(move.done, 5.0, "the axis moves again")


@CASES.product(
    "controller-stop/{phase}",
    parameters={"phase": MOVING},
    title="STOP of the controller from {phase}",
    tags=("controller", "{phase}"),
    requirements=("MC-629", "STP-506", "STP-588"),
)
def controller_stop(ctx: CaseContext, phase: str) -> None:
    """RUN to STOP: the job ends with CommandAborted, the drive stops as RemoveEnableReaction says; RUN
    enables nothing.
    """
    axis = axis_name(ctx)
    enable(ctx)
    job = bring_into(ctx, phase)
    stop_s = 1.0 + settle_s(ctx)
    ctx.inject("controller.stop", duration_s=stop_s)
    ctx.run_for(stop_s)
    ended = ctx.now_s
    ctx.expect(
        happens(event("job.aborted", axis, job=job.name), since=STOPPED, within_s=cycles(ctx, 1)).covers(
            "MC-629"
        ),
        never_happens(event("job.error", axis)),
        happens(
            event("axis.state", axis, to="ALARM_DRIVE_STOP"), since=STOPPED, within_s=cycles(ctx, 1)
        ).covers("STP-506"),
        state_at(axis, ended - 0.1, "DISABLED").covers("STP-506"),
        value_at(f"{axis}.stw1", ended - 0.1, 0.0, tolerance=0.0)
        .covers("MC-629")
        .named("process outputs off"),
    )
    stopped_for_good(ctx, ended)
    _enabled_again(ctx)


@CASES.product(
    "controller-power-off/{phase}",
    parameters={"phase": MOVING},
    title="supply of the controller lost from {phase}",
    tags=("controller", "{phase}"),
    requirements=("MC-630",),
)
def controller_power_off(ctx: CaseContext, phase: str) -> None:
    """The drive misses its controller and stops by itself; the controller takes it into service again when it
    is back.
    """
    enable(ctx)
    bring_into(ctx, phase)
    off_s = 1.0 + settle_s(ctx)
    ctx.inject("controller.power_off", duration_s=off_s)
    ctx.run_for(off_s)
    ended = ctx.now_s
    ctx.expect(happens(event("drive.fault", drive_name(ctx)), since=event("fault.applied")))
    stopped_for_good(ctx, ended)
    ctx.run_for(0.5)
    ctx.expect(
        happens(event("controller.state", to="RUN"), since=event("fault.removed"), within_s=1.0).covers(
            "MC-630"
        )
    )
    _enabled_again(ctx)


@CASES.product(
    "controller-overrun/{level}",
    parameters={"level": ("servo", "interpolator")},
    title="MC_{level} overruns its cycle",
    tags=("controller",),
    requirements=("MC-636", "MC-637"),
)
def controller_overrun(ctx: CaseContext, level: str) -> None:
    """Too long a servo, or the fourth overflow of the interpolator in a row, stops the controller, and with
    it the axis.
    """
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    cycle_ms = ctx.bench.cycle_ns * 1e-6
    ctx.inject("controller.overrun", level=level, time_ms=1.2 * cycle_ms, duration_s=0.5)
    ctx.run_for(1.0 + settle_s(ctx))
    ended = ctx.now_s
    calls, identifier = (3, "MC-636") if level == "servo" else (6, "MC-637")
    ctx.expect(
        happens(STOPPED, since=event("fault.applied"), within_s=cycles(ctx, calls)).covers(identifier),
        state_at(axis, ended, "DISABLED"),
    )
    stopped_for_good(ctx, ended)


@CASES.case("controller-stall", tags=("controller",), requirements=("C402-104", "PD-127"))
def controller_stall(ctx: CaseContext) -> None:
    """The controller hangs without noticing: the drive misses its setpoints and brakes by itself."""
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("controller.stall", duration_s=1.0)
    ctx.run_for(1.0)
    ended = ctx.now_s
    applied = event("fault.applied")
    if profile_of(ctx) == "cia402":
        ctx.expect(
            happens(enters(ctx, "quick stop"), since=applied, within_s=cycles(ctx, 4)).covers("C402-104")
        )
    else:
        ctx.expect(
            happens(event("drive.fault", drive_name(ctx)), since=applied, within_s=cycles(ctx, 4)).covers(
                "PD-127"
            )
        )
    machine_at_rest(ctx, ended)
