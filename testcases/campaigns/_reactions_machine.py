"""Cases of `fault_reactions`: switches, mechanics and the encoder of the machine."""

from __future__ import annotations

import math
from typing import Final

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    alarm,
    golden,
    happens,
    job_output,
    no_alarm,
    no_motion_after,
    ramp,
    standstill,
    state_at,
    value_at,
)
from hil.record import event
from testcases.campaigns._profiles import encoder_increments_per_revolution
from testcases.campaigns._reactions import cycles, detection_s, disabled_by_alarm, recovers, stopped_for_good
from testcases.campaigns.support import (
    MOVING,
    PHASES,
    acknowledge,
    axis_name,
    bring_into,
    drive_name,
    enable,
    following_error_s,
    need_permitted_error_below,
    permitted_error_mm,
    settle_s,
    state_change,
    tolerance,
)

CASES: Final = Campaign("fault reactions", tags=("fault",), bench="reference")


REVOLUTION: Final = 131_072
"""Jumps are named by increments of the encoder that most benches have; they are scaled to that of the bench.
"""


@CASES.product(
    "limit-switch/{phase}",
    parameters={"phase": PHASES},
    title="positive limit switch from {phase}",
    tags=("switch", "{phase}"),
    requirements=("LIM-034", "LIM-037", "STP-589", "STP-597"),
)
def limit_switch(ctx: CaseContext, phase: str) -> None:
    """A limit switch is pressed: 531 with the emergency ramp, the axis stays enabled, and leaves it backwards
    only.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    allowed = tolerance(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    before = ctx.now_s
    press = ctx.inject("switch.press", drive, input="positive_limit")
    ctx.run_for(0.8 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(531, reaction=3, since=event("fault.applied"), within_s=detection_s(ctx, 3), axis=axis).covers(
            "LIM-034"
        )
    )
    ctx.expect(state_at(axis, ended, "ALARM_STANDSTILL").covers("STP-597"))
    ctx.expect(value_at(f"{axis}.power_status", ended, 1.0, tolerance=0.0).covers("STP-589"))
    if phase == "standstill":
        ctx.expect(no_motion_after(before, axis=axis, until=ended))
    else:
        since = state_change(ctx, "ALARM_RAMP")
        trace = ctx.trace()
        start = trace.instant(since)
        velocity = trace[f"{axis}.actual_velocity"].at(start) if start is not None else 0.0
        expected = golden.stop_ramp(velocity, 4000.0)
        ctx.expect(
            ramp(
                since,
                expected,
                axis=axis,
                velocity=f"{axis}.velocity_setpoint",
                position=f"{axis}.position_setpoint",
                time_tolerance_s=allowed.time_s,
                distance_tolerance=allowed.distance,
                threshold=1e-9,
                until=ended,
            ).covers("LIM-034")
        )
    stopped_for_good(ctx, ended)
    acknowledge(ctx)
    ctx.do("MC_MoveVelocity 50 mm/s: further into the switch")
    outwards = ctx.axis.move_velocity(50.0)
    ctx.run_for(0.3)
    ctx.expect(job_output(outwards.name, "Error", since=ended).covers("LIM-059"))
    acknowledge(ctx)
    ctx.do("MC_MoveRelative -20 mm: out of the switch")
    inwards = ctx.axis.move_relative(-20.0)
    ctx.wait_until(inwards.done, 5.0, "the axis leaves the switch")
    press.remove()
    ctx.run_for(0.1)
    ctx.expect(no_alarm(since=ctx.now_s - 0.05, axis=axis))


@CASES.case("limit-switch-bounces", tags=("switch",), requirements=("LIM-055",))
def limit_switch_bounces(ctx: CaseContext) -> None:
    """A bouncing limit switch stops the axis once and stays one alarm."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("switch.bounce", drive, input="positive_limit", pulses=9, shortest_s=0.001, longest_s=0.006)
    ctx.run_for(0.8 + settle_s(ctx))
    longest_s = 2 * 9 * 0.006 + detection_s(ctx, 3)  # a filter may wait until the last bounce is over
    ctx.expect(alarm(531, reaction=3, since=event("fault.applied"), within_s=longest_s, axis=axis))
    raised = sum(1 for _ in ctx.trace().select(source=axis, kind="alarm.raised"))
    ctx.measure("alarms raised by one bouncing switch", raised, low=1, high=1)
    stopped_for_good(ctx, ctx.now_s)


@CASES.case(
    "limit-switch-stuck", tags=("switch", "mechanics"), requirements=("MON-040",), without=("STP-331",)
)
def limit_switch_stuck(ctx: CaseContext) -> None:
    """With the limit switch stuck open the axis meets its end stop: following error 521, no motion
    afterwards.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    ctx.inject("switch.stuck", drive, input="positive_limit", state=False)
    ctx.do("MC_MoveVelocity 300 mm/s towards the end stop")
    ctx.axis.move_velocity(300.0)
    ctx.run_for(4.0 + settle_s(ctx))
    ctx.expect(alarm(521, reaction=4, axis=axis).covers("MON-040"))
    stopped_for_good(ctx, ctx.now_s)
    disabled_by_alarm(ctx, ctx.now_s)


@CASES.product(
    "jam/{phase}",
    parameters={"phase": MOVING},
    title="mechanics jammed from {phase}",
    tags=("mechanics", "{phase}"),
    requirements=("MON-040", "STP-348"),
)
def jam(ctx: CaseContext, phase: str) -> None:
    """The mechanics is blocked: following error 521 with reaction 4 as soon as the permitted error is used
    up.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    if phase == "decelerating":
        need_permitted_error_below(ctx, 40.0, "the rest of the braking distance from 300 mm/s is no longer")
    enable(ctx)
    bring_into(ctx, phase)
    blocked = ctx.inject("mechanics.jam", drive)
    ctx.run_for(1.5 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(
            521, reaction=4, since=event("fault.applied"), within_s=following_error_s(ctx), axis=axis
        ).covers("MON-040")
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    blocked.remove()
    recovers(ctx)


@CASES.case("emergency-from-actual-values", tags=("mechanics",), requirements=("STP-123",))
def emergency_from_actual_values(ctx: CaseContext) -> None:
    """The emergency ramp begins where a jammed axis stands, with the velocity that it has: none, whatever was
    commanded.
    """
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("mechanics.jam", drive_name(ctx))
    ctx.run_for(cycles(ctx, 4))
    ctx.check(no_alarm(axis=axis))
    ctx.do("alarm 304 with reaction 3")
    ctx.inject("axis.alarm", axis, number=304, reaction=3)
    begins = state_change(ctx, "ALARM_RAMP")
    ctx.run_for(cycles(ctx, 3))
    ctx.check(happens(begins))
    trace = ctx.trace()
    # Its first setpoint: later the following error could have ended a ramp that begins with the setpoints.
    first = (trace.instant(begins) or 0.0) + 1.5 * ctx.bench.interpolator_ns * 1e-9
    ahead = trace[f"{axis}.position_setpoint"].at(first) - trace[f"{axis}.actual_position"].at(first)
    ctx.measure(
        "first velocity setpoint of the emergency ramp",
        trace[f"{axis}.velocity_setpoint"].at(first),
        "mm/s",
        low=-60.0,
        high=60.0,
        requirements=("STP-123",),
    )
    allowed = tolerance(ctx).distance
    ctx.measure(
        "its first position setpoint, from the actual position",
        ahead,
        "mm",
        low=-allowed,
        high=allowed,
        requirements=("STP-123",),
    )
    ctx.run_for(1.0 + settle_s(ctx))
    stopped_for_good(ctx, ctx.now_s)


@CASES.case("load-step", tags=("mechanics",), requirements=("MON-040",))
def load_step(ctx: CaseContext) -> None:
    """A load step within the torque limit disturbs the following error and gives no alarm."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("mechanics.load_step", drive, force_N=-400.0, duration_s=0.3)
    ctx.run_for(0.8)
    ctx.expect(no_alarm(axis=axis), state_at(axis, ctx.now_s, "MOTION"))


@CASES.case("overload", tags=("mechanics",), requirements=("MON-040",))
def overload(ctx: CaseContext) -> None:
    """A load beyond the torque limit drags the axis back: following error 521."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    need_permitted_error_below(ctx, 40.0, "the load would drag the machine out of its travel before")
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("mechanics.load_step", drive, force_N=-8000.0, duration_s=0.15)
    # A drive that trips on its overspeed coasts, from one end stop to the other.
    ctx.run_for(5.0 + settle_s(ctx))
    ctx.expect(
        alarm(
            521, reaction=4, since=event("fault.applied"), within_s=0.15 + cycles(ctx, 4), axis=axis
        ).covers("MON-040")
    )
    stopped_for_good(ctx, ctx.now_s)


@CASES.product(
    "encoder-frozen/{phase}",
    parameters={"phase": MOVING},
    title="encoder frozen from {phase}",
    tags=("encoder", "{phase}"),
    requirements=("MON-040", "STP-550"),
)
def encoder_frozen(ctx: CaseContext, phase: str) -> None:
    """The encoder's value no longer changes: following error 521, and the machine comes to rest."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    need_permitted_error_below(ctx, 40.0, "blind, the drive would leave its travel before")
    enable(ctx)
    bring_into(ctx, phase)
    ctx.inject("encoder.freeze", drive, duration_s=2.0)
    ctx.run_for(4.0 + settle_s(ctx))
    ctx.expect(
        alarm(
            521, reaction=4, since=event("fault.applied"), within_s=following_error_s(ctx), axis=axis
        ).covers("MON-040")
    )
    ctx.expect(
        standstill(by=ctx.now_s - 0.3, velocity=f"{drive}.velocity", tolerance=0.0005)
        .named("true standstill")
        .covers("STP-550")
    )


@CASES.product(
    "encoder-jump/{increments}",
    parameters={"increments": (-REVOLUTION, REVOLUTION)},
    title="encoder jumps by {increments} increments of 131072 a revolution",
    tags=("encoder",),
    requirements=("MON-040",),
)
def encoder_jump(ctx: CaseContext, increments: int) -> None:
    """A jump of the encoder beyond the permitted following error: 521 at once."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    # One revolution, more where a wider following error is permitted.
    turns = max(
        1, math.ceil(1.5 * permitted_error_mm(ctx) / ctx.bench.config.drive[drive].mechanics.lead_screw_mm)
    )
    per_turn = encoder_increments_per_revolution(ctx)
    ctx.inject("encoder.jump", drive, increments=turns * per_turn * increments // REVOLUTION)
    ctx.run_for(2.0 + settle_s(ctx))
    ctx.expect(
        alarm(521, reaction=4, since=event("fault.applied"), within_s=cycles(ctx, 4), axis=axis).covers(
            "MON-040"
        )
    )
    stopped_for_good(ctx, ctx.now_s)


@CASES.case("small-encoder-jump", tags=("encoder",), requirements=("MON-040",))
def small_encoder_jump(ctx: CaseContext) -> None:
    """A jump within the permitted following error is worked off without an alarm."""
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    small = round(0.038 * encoder_increments_per_revolution(ctx))
    ctx.inject("encoder.jump", drive_name(ctx), increments=small)
    ctx.run_for(0.5)
    ctx.expect(no_alarm(axis=axis), state_at(axis, ctx.now_s, "MOTION"))
