"""Cases of `axis_faults`: what meets an axis at the moment of its enabling."""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, always, event_order, golden, no_alarm, no_motion_after, state_at, value_at
from hil.record import event
from testcases.campaigns._profiles import by_profile, encoder_increments_per_revolution
from testcases.campaigns._reactions import cycles, disabled_by_alarm, recovers, stopped_for_good
from testcases.campaigns.support import (
    PHASES,
    axis_name,
    bring_into,
    drive_name,
    enable,
    settle_s,
    state_change,
)

CASES: Final = Campaign("axis faults", tags=("fault", "axis"), bench="reference")

PUSHED: Final = 100.0
"""Velocity to which the axis is pushed before it is enabled, mm/s."""


@CASES.case("enabling/noise", tags=("encoder", "enabling"), requirements=("STP-054", "STP-055", "STP-564"))
def noise(ctx: CaseContext) -> None:
    """A noisy encoder at rest: the setpoint steps by the apparent velocity times the delay, and the axis
    stays where it is.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    increments = round(0.0002 * encoder_increments_per_revolution(ctx))
    ctx.require(increments > 0, "an encoder with more than 2500 increments per revolution")
    ctx.inject("encoder.noise", drive, increments=increments, duration_s=1.0)
    ctx.run_for(0.1)
    enable(ctx)
    trace = ctx.trace()
    at = trace.instant(state_change(ctx, "STANDSTILL"))
    assert at is not None  # enabled
    setpoint, actual, velocity = (
        trace[f"{axis}.{name}"].at(at) for name in ("position_setpoint", "actual_position", "actual_velocity")
    )
    delay = ctx.axis.object.delay_s
    ctx.measure("apparent velocity, mm/s", abs(velocity), low=1e-9)
    ctx.measure(
        "step of the setpoint apart from the formula, mm",
        setpoint - actual - velocity * delay,
        low=-1e-9,
        high=1e-9,
    )
    ctx.run_for(1.5 + settle_s(ctx))
    ctx.expect(no_alarm(axis=axis), state_at(axis, ctx.now_s, "STANDSTILL"))
    ctx.expect(
        no_motion_after(ctx.now_s - 0.3, position=f"{drive}.position", tolerance=0.00005).covers("STP-564")
    )


def push(ctx: CaseContext) -> None:
    """Let something push the axis, which is disabled and has no brake, to a velocity; then it coasts."""
    ctx.do(f"the axis is pushed to {PUSHED:g} mm/s")
    push_on = ctx.inject("mechanics.load_step", drive_name(ctx), force_N=500.0)
    ctx.wait_until(lambda: ctx.axis.var("ActualVelocity") >= PUSHED, 2.0, "the axis has been pushed")
    push_on.remove()


@CASES.product(
    "enabling/pushed/{start_mode}",
    parameters={"start_mode": (0, 1)},
    title="an axis that is moving is enabled with StartMode {start_mode}",
    tags=("mechanics", "enabling"),
    requirements=lambda start_mode: ("STP-565", *(("STP-049", "STP-053") if start_mode else ("STP-051",))),
)
def pushed(ctx: CaseContext, start_mode: int) -> None:
    """With position control a ramp with MaxDeceleration, and the axis holds where it ends; without, a step to
    zero.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    push(ctx)
    ctx.do(f"MC_Power Enable = TRUE, StartMode {start_mode}")
    power = ctx.axis.power(start_mode=start_mode)
    ctx.wait_until(power.status, 2.0, "the axis is enabled")
    ctx.run_for(1.0 + settle_s(ctx))
    ended = ctx.now_s
    trace = ctx.trace()
    begin = trace.instant(state_change(ctx, "ENABLE_RAMP" if start_mode else "STANDSTILL"))
    assert begin is not None
    velocity = trace[f"{axis}.actual_velocity"].at(begin)
    ctx.measure("velocity at the moment of enabling, mm/s", velocity, low=0.3 * PUSHED, high=1.3 * PUSHED)
    ctx.expect(no_alarm(axis=axis), state_at(axis, ended, "STANDSTILL"))
    if start_mode:
        ctx.expect(event_order([state_change(ctx, "ENABLE_RAMP"), state_change(ctx, "STANDSTILL")]))
        ramp_s = velocity / 2000.0
        ctx.expect(
            always(
                "the setpoint brakes with MaxDeceleration",
                lambda v: v > 1e-9,
                f"{axis}.velocity_setpoint",
                since=begin,
                until=begin + ramp_s - cycles(ctx, 2),
            ).covers("STP-049"),
            always(
                "the ramp is over",
                lambda v: v == 0.0,
                f"{axis}.velocity_setpoint",
                since=begin + ramp_s + cycles(ctx, 2),
            ).covers("STP-049"),
        )
        travelled = trace[f"{axis}.actual_position"].at(ended) - trace[f"{axis}.actual_position"].at(begin)
        low = golden.stop_distance(velocity, 2000.0)
        ctx.measure(
            "travel from enabling to rest, mm", travelled, low=low, high=low + velocity * cycles(ctx, 4)
        )
    else:
        ctx.expect(
            always(
                "the setpoint is zero at once", lambda v: v == 0.0, f"{axis}.velocity_setpoint", since=begin
            ).covers("STP-051")
        )
    ctx.expect(no_motion_after(ended - 0.3, position=f"{drive}.position", tolerance=0.0001, until=ended))


@CASES.product(
    "control-withdrawn/{phase}",
    parameters={"phase": PHASES},
    title="the drive withdraws its control request from {phase}",
    tags=("drive", "{phase}"),
    requirements=("STP-558", "TA-020"),
)
def control_withdrawn(ctx: CaseContext, phase: str) -> None:
    """The drive no longer requests control (ZSW1.9, Remote): CommunicationOK FALSE, alarm 421 that says so,
    reaction 4.
    """
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    kind, options = by_profile(
        ctx, cia402=("drive.local_control", {}), profidrive=("telegram.control_lost", {"direction": "actual"})
    )
    fault = ctx.inject(kind, drive_name(ctx), **options)
    ctx.run_for(1.5 + settle_s(ctx))
    applied = event("fault.applied")
    ctx.expect(
        alarm(421, reaction=4, since=applied, within_s=cycles(ctx, 4), axis=axis).covers("STP-558"),
        value_at(f"{axis}.communication_ok", event("alarm.raised", axis), 0.0, tolerance=0.0).covers(
            "STP-558"
        ),
    )
    texts = [str(one.data["text"]) for one in ctx.trace().select(source=axis, kind="alarm.raised")]
    ctx.measure(
        "alarm 421 names the control request", float("control request" in texts[0]), low=1.0, high=1.0
    )
    fault.remove()
    ctx.run_for(2.0)
    stopped_for_good(ctx, ctx.now_s)
    disabled_by_alarm(ctx, ctx.now_s)
    recovers(ctx)


@CASES.case(
    "enabling/fatal-alarm", tags=("enabling",), requirements=("STP-586", "STP-065", "STP-079", "STP-078")
)
def fatal_alarm(ctx: CaseContext) -> None:
    """An alarm of class R: MC_Reset does not help, a restart is refused while Enable is TRUE, and helps
    afterwards.
    """
    axis = axis_name(ctx)
    power = enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("axis.alarm", axis, number=101)
    ctx.run_for(1.0 + settle_s(ctx))
    stopped_for_good(ctx, ctx.now_s)
    ctx.do("MC_Reset, then with Restart, while Enable is TRUE")
    plain = ctx.axis.reset()
    ctx.run_for(0.1)
    ctx.measure("pending alarm after MC_Reset", ctx.axis.var("ErrorDetail.Number"), low=101, high=101)
    refused = ctx.axis.reset(restart=True)
    ctx.run_for(0.1)
    ctx.measure("ErrorID of the refused restart", refused.ErrorID, low=0x800E, high=0x800E)
    plain.set(Execute=False)
    ctx.do("MC_Power Enable = FALSE, then the restart")
    ctx.axis.power(False)
    ctx.wait_until(power.off, 2.0, "MC_Power is off")
    ctx.wait_until(ctx.axis.reset(restart=True).done, 2.0, "the object has been restarted")
    ctx.measure("pending alarm after the restart", ctx.axis.var("ErrorDetail.Number"), low=0, high=0)
    enable(ctx)
    ctx.expect(state_at(axis, ctx.now_s, "STANDSTILL"))


@CASES.case("several-alarms", tags=("enabling",), requirements=("STP-587", "STP-070", "STP-066"))
def several_alarms(ctx: CaseContext) -> None:
    """Several alarms, one MC_Reset: none is raised again on the way, and with Done all are gone."""
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    for number in (533, 104, 304, 521, 501):
        ctx.inject("axis.alarm", axis, number=number)
        ctx.run_for(0.02)
    ctx.run_for(1.0 + settle_s(ctx))
    stopped_for_good(ctx, ctx.now_s)
    before = ctx.now_s
    recovers(ctx)
    ctx.expect(no_alarm(since=before, axis=axis).covers("STP-587"))
    ctx.measure(
        "alarms raised", sum(1 for _ in ctx.trace().select(source=axis, kind="alarm.raised")), low=5, high=5
    )
