"""Faults of bus, drive, encoder, switches and mechanics, and what the axis makes of them."""

from __future__ import annotations

import math
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    alarm,
    event_order,
    golden,
    happens,
    job_output,
    never_happens,
    no_alarm,
    no_motion_after,
    ramp,
    standstill,
    state_at,
    value_at,
)
from hil.record import event
from testcases.campaigns.support import (
    PHASES,
    acknowledge,
    axis_name,
    bring_into,
    drive_name,
    enable,
    following_error_s,
    grace_s,
    need_permitted_error_below,
    permitted_error_mm,
    settle_s,
    state_change,
    tolerance,
)

CAMPAIGN: Final = Campaign("fault reactions", tags=("fault",), bench="reference")

MOVING: Final = PHASES[:3]


def cycles(ctx: CaseContext, number: float) -> float:
    """Return the time of `number` cycles plus the scheduling tolerance of the bench, s."""
    return number * ctx.bench.cycle_ns * 1e-9 + float(ctx.bench.config.tolerance.time_s)


def stopped_for_good(ctx: CaseContext, ended: float) -> None:
    """Expect the machine itself at rest, and no motion afterwards."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    ctx.expect(
        standstill(by=ended - 0.3, axis=axis, until=ended),
        no_motion_after(ended - 0.3, position=f"{drive}.position", tolerance=0.00005, until=ended).named(
            "machine at rest"
        ),
    )


def disabled_by_alarm(ctx: CaseContext, ended: float) -> None:
    """Expect the axis disabled by its alarm, with `MC_Power` still busy (STP-344)."""
    axis = axis_name(ctx)
    ctx.expect(
        state_at(axis, ended, "ALARM_DISABLED"),
        value_at(f"{axis}.power_status", ended, 0.0, tolerance=0.0).covers("STP-344"),
        value_at(f"{axis}.power_busy", ended, 1.0, tolerance=0.0).covers("STP-344"),
    )


def recovers(ctx: CaseContext) -> None:
    """Acknowledge, wait for the automatic enable, and move again."""
    acknowledge(ctx)
    ctx.wait_until(ctx.axis.power_instance.status, 5.0, "the axis is enabled again without a new edge")
    ctx.do("MC_MoveRelative -20 mm")
    move = ctx.axis.move_relative(-20.0)
    ctx.wait_until(move.done, 5.0, "the axis moves again")


@CAMPAIGN.product(
    "drive-fault/{code}/{phase}",
    parameters={"code": ("2310", "8611", "3210"), "phase": PHASES},
    title="drive fault {code}h from {phase}",
    tags=("drive", "{phase}"),
    requirements=("STP-559", "TA-020", "C402-014", "C402-015"),
)
def drive_fault(ctx: CaseContext, code: str, phase: str) -> None:
    """The drive trips: alarm 421 with reaction 4, jobs end with 16#8001, standstill, and recovery by one MC_Reset."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    job = bring_into(ctx, phase)
    before = ctx.now_s
    ctx.inject("drive.fault", drive, code=int(code, 16))
    ctx.run_for(3.0 + settle_s(ctx))
    ended = ctx.now_s
    applied = event("fault.applied")
    ctx.expect(alarm(421, reaction=4, since=applied, within_s=cycles(ctx, 4), axis=axis).covers("STP-559"))
    ctx.expect(happens(event("drive.state", drive, to="Fault"), since=before).covers("C402-015"))
    ctx.expect(
        event_order(
            [
                event("fault.applied"),
                event("drive.state", drive, to="Fault reaction active"),
                event("alarm.raised", axis),
                event("drive.state", drive, to="Fault"),
            ]
        )
        if phase != "standstill" and code != "3210"
        else event_order([event("fault.applied"), event("alarm.raised", axis)])
    )
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


@CAMPAIGN.product(
    "encoder-fault/{phase}",
    parameters={"phase": PHASES},
    title="encoder fault 7305h from {phase}",
    tags=("encoder", "{phase}"),
    requirements=("TA-020",),
)
def encoder_fault(ctx: CaseContext, phase: str) -> None:
    """The drive reports its encoder as faulty: alarm 411 with reaction 4; without an encoder the drive cannot brake."""
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


@CAMPAIGN.product(
    "safe-torque-off/{phase}",
    parameters={"phase": PHASES},
    title="safe torque off from {phase}",
    tags=("drive", "{phase}"),
    requirements=("STP-560", "C402-030", "TA-018"),
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
            event("drive.state", drive, to="Switch on disabled"),
            since=event("fault.applied"),
            within_s=cycles(ctx, 1),
        ).covers("C402-030")
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    sto.remove()
    recovers(ctx)


@CAMPAIGN.product(
    "actual-values-lost/{phase}",
    parameters={"phase": PHASES},
    title="actual values lost from {phase}",
    tags=("bus", "{phase}"),
    requirements=("STP-574", "STP-397", "TA-020"),
)
def actual_values_lost(ctx: CaseContext, phase: str) -> None:
    """The drive's actual values do not arrive any more: alarm 431 within the grace of three cycles, reaction 4."""
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    lost_s = grace_s(ctx) + 0.5
    ctx.inject("frame.drop", "can0", message="tpdo1", duration_s=lost_s)
    ctx.run_for(lost_s + 1.0 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(431, reaction=4, since=event("fault.applied"), within_s=grace_s(ctx), axis=axis).covers(
            "TA-020"
        ),
        value_at(f"{axis}.communication_ok", event("alarm.raised", axis), 0.0, tolerance=0.0),
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)
    recovers(ctx)


@CAMPAIGN.product(
    "setpoints-lost/{phase}",
    parameters={"phase": MOVING},
    title="setpoints lost from {phase}",
    tags=("bus", "{phase}"),
    requirements=("C402-104", "STP-561"),
)
def setpoints_lost(ctx: CaseContext, phase: str) -> None:
    """The drive gets no setpoints any more: it brakes by itself, which the axis notices."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    missing_s = ctx.bench.config.drive[drive].missing_setpoints * ctx.bench.cycle_ns * 1e-9
    ctx.inject("frame.drop", "can0", message="rpdo1", duration_s=missing_s + 1.2)
    ctx.run_for(missing_s + 2.2 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        happens(event("drive.state", drive, to="Quick stop active"), since=event("fault.applied")).covers(
            "C402-104"
        )
    )
    ctx.expect(alarm(550, reaction=5, since=event("fault.applied"), axis=axis).covers("STP-561"))
    stopped_for_good(ctx, ended)


@CAMPAIGN.case("two-actual-values-lost", tags=("bus",), requirements=("STP-574",))
def two_actual_values_lost(ctx: CaseContext) -> None:
    """Two missing actual values lie within the grace: no alarm, the motion goes on."""
    axis = axis_name(ctx)
    enable(ctx)
    job = bring_into(ctx, "constant")
    ctx.inject("frame.drop", "can0", message="tpdo1", count=2)
    ctx.run_for(0.5)
    ctx.expect(
        no_alarm(axis=axis),
        state_at(axis, ctx.now_s, "MOTION"),
        never_happens(event("job.error", job=job.name)),
    )


@CAMPAIGN.case("corrupted-frames", tags=("bus",), requirements=("CANP-030", "CANP-042", "CANP-045"))
def corrupted_frames(ctx: CaseContext) -> None:
    """Bit errors on the wire are repaired by repetition: no alarm, the motion goes on."""
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("frame.corrupt", "can0", message="tpdo1", count=10, attempts=2)
    ctx.run_for(0.5)
    ctx.expect(no_alarm(axis=axis), state_at(axis, ctx.now_s, "MOTION"), happens(event("can.bus_error")))


@CAMPAIGN.case("delayed-actual-values", tags=("bus",))
def delayed_actual_values(ctx: CaseContext) -> None:
    """Actual values that come half a cycle late disturb, but give no alarm."""
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("frame.delay", "can0", message="tpdo1", delay_s=ctx.bench.cycle_ns * 0.75e-9, duration_s=0.2)
    ctx.run_for(0.5)
    ctx.expect(no_alarm(axis=axis, besides=(522,)), state_at(axis, ctx.now_s, "MOTION"))


@CAMPAIGN.product(
    "node-off/{phase}",
    parameters={"phase": PHASES},
    title="drive loses its supply from {phase}",
    tags=("node", "{phase}"),
    requirements=("STP-397", "TA-020", "C301-022"),
)
def node_off(ctx: CaseContext, phase: str) -> None:
    """The node vanishes and comes back: 431, boot-up, cyclic data again; an incremental axis is not homed any more."""
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


@CAMPAIGN.product(
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
    consumer = ctx.bench.config.drive[drive_name(ctx)].consumer_heartbeat_ms * 1e-3
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


@CAMPAIGN.product(
    "controller-heartbeat-lost/{phase}",
    parameters={"phase": ("constant", "standstill")},
    title="heartbeat of the controller lost from {phase}",
    tags=("node", "{phase}"),
    requirements=("C301-026", "C402-077", "C301-123"),
)
def controller_heartbeat_lost(ctx: CaseContext, phase: str) -> None:
    """The drive misses the controller's heartbeat: it stops by its option code and says so (EMCY 8130h)."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    ctx.run_for(0.3)
    bring_into(ctx, phase)
    consumer = ctx.bench.config.drive[drive].consumer_heartbeat_ms * 1e-3
    ctx.inject("frame.drop", "can0", message="controller_heartbeat", duration_s=consumer + 0.5)
    ctx.run_for(consumer + 1.5 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        happens(
            event("emcy.received", code=0x8130),
            since=event("fault.applied"),
            within_s=consumer + cycles(ctx, 3),
        ).covers("C301-123"),
        # The default error behaviour takes the node to Pre-operational, so that its data stay away as well (1029h).
        alarm(431, reaction=4, since=event("fault.applied"), axis=axis).covers("C301-020"),
    )
    stopped_for_good(ctx, ended)


@CAMPAIGN.product(
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
    node = ctx.bench.config.drive[drive].node_id
    ctx.inject("frame.inject", "can0", can_id=0, data=f"{command}{node:02X}", count=1)
    ctx.run_for(1.5 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(431, reaction=4, since=event("fault.applied"), within_s=grace_s(ctx), axis=axis).covers(
            "C301-020"
        )
    )
    stopped_for_good(ctx, ended)
    disabled_by_alarm(ctx, ended)


@CAMPAIGN.product(
    "limit-switch/{phase}",
    parameters={"phase": PHASES},
    title="positive limit switch from {phase}",
    tags=("switch", "{phase}"),
    requirements=("LIM-034", "LIM-037", "STP-589", "STP-597"),
)
def limit_switch(ctx: CaseContext, phase: str) -> None:
    """A limit switch is pressed: 531 with the emergency ramp, the axis stays enabled, and leaves it backwards only."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    allowed = tolerance(ctx)
    enable(ctx)
    bring_into(ctx, phase)
    before = ctx.now_s
    press = ctx.inject("switch.press", drive, input="positive_limit")
    ctx.run_for(0.8 + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(531, reaction=3, since=event("fault.applied"), within_s=cycles(ctx, 3), axis=axis).covers(
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
                since, expected, axis=axis, velocity=f"{axis}.velocity_setpoint", position=f"{axis}.position_setpoint",
                time_tolerance_s=allowed.time_s, distance_tolerance=allowed.distance_mm, threshold=1e-9, until=ended,
            ).covers("LIM-034")
        )  # fmt: skip
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


@CAMPAIGN.case("limit-switch-bounces", tags=("switch",), requirements=("LIM-055",))
def limit_switch_bounces(ctx: CaseContext) -> None:
    """A bouncing limit switch stops the axis once and stays one alarm."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("switch.bounce", drive, input="positive_limit", pulses=9, shortest_s=0.001, longest_s=0.006)
    ctx.run_for(0.8 + settle_s(ctx))
    ctx.expect(alarm(531, reaction=3, since=event("fault.applied"), within_s=cycles(ctx, 8), axis=axis))
    raised = sum(1 for _ in ctx.trace().select(source=axis, kind="alarm.raised"))
    ctx.measure("alarms raised by one bouncing switch", raised, low=1, high=1)
    stopped_for_good(ctx, ctx.now_s)


@CAMPAIGN.case(
    "limit-switch-stuck", tags=("switch", "mechanics"), requirements=("MON-040",), without=("STP-331",)
)
def limit_switch_stuck(ctx: CaseContext) -> None:
    """With the limit switch stuck open the axis meets its end stop: following error 521, no motion afterwards."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    ctx.inject("switch.stuck", drive, input="positive_limit", state=False)
    ctx.do("MC_MoveVelocity 300 mm/s towards the end stop")
    ctx.axis.move_velocity(300.0)
    ctx.run_for(4.0 + settle_s(ctx))
    ctx.expect(alarm(521, reaction=4, axis=axis).covers("MON-040"))
    stopped_for_good(ctx, ctx.now_s)
    disabled_by_alarm(ctx, ctx.now_s)


@CAMPAIGN.product(
    "jam/{phase}",
    parameters={"phase": MOVING},
    title="mechanics jammed from {phase}",
    tags=("mechanics", "{phase}"),
    requirements=("MON-040", "STP-348"),
)
def jam(ctx: CaseContext, phase: str) -> None:
    """The mechanics is blocked: following error 521 with reaction 4 as soon as the permitted error is used up."""
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


@CAMPAIGN.case("load-step", tags=("mechanics",), requirements=("MON-040",))
def load_step(ctx: CaseContext) -> None:
    """A load step within the torque limit disturbs the following error and gives no alarm."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("mechanics.load_step", drive, force_N=-400.0, duration_s=0.3)
    ctx.run_for(0.8)
    ctx.expect(no_alarm(axis=axis), state_at(axis, ctx.now_s, "MOTION"))


@CAMPAIGN.case("overload", tags=("mechanics",), requirements=("MON-040",))
def overload(ctx: CaseContext) -> None:
    """A load beyond the torque limit drags the axis back: following error 521."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    need_permitted_error_below(ctx, 40.0, "the load would drag the machine out of its travel before")
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("mechanics.load_step", drive, force_N=-8000.0, duration_s=0.15)
    ctx.run_for(3.0 + settle_s(ctx))
    ctx.expect(
        alarm(
            521, reaction=4, since=event("fault.applied"), within_s=0.15 + cycles(ctx, 4), axis=axis
        ).covers("MON-040")
    )
    stopped_for_good(ctx, ctx.now_s)


@CAMPAIGN.product(
    "encoder-frozen/{phase}",
    parameters={"phase": MOVING},
    title="encoder frozen from {phase}",
    tags=("encoder", "{phase}"),
    requirements=("MON-040",),
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


@CAMPAIGN.product(
    "encoder-jump/{increments}",
    parameters={"increments": (-131072, 131072)},
    title="encoder jumps by {increments} increments",
    tags=("encoder",),
    requirements=("MON-040",),
)
def encoder_jump(ctx: CaseContext, increments: int) -> None:
    """A jump of the encoder beyond the permitted following error: 521 at once."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    section = ctx.bench.config.drive[drive]
    jump_mm = section.mechanics.lead_screw_mm * abs(increments) / section.increments_per_revolution
    # One jump on the bench that this was written for, more where a wider following error is permitted.
    times = max(1, math.ceil(1.5 * permitted_error_mm(ctx) / jump_mm))
    ctx.inject("encoder.jump", drive, increments=times * increments)
    ctx.run_for(2.0 + settle_s(ctx))
    ctx.expect(
        alarm(521, reaction=4, since=event("fault.applied"), within_s=cycles(ctx, 4), axis=axis).covers(
            "MON-040"
        )
    )
    stopped_for_good(ctx, ctx.now_s)


@CAMPAIGN.case("small-encoder-jump", tags=("encoder",), requirements=("MON-040",))
def small_encoder_jump(ctx: CaseContext) -> None:
    """A jump within the permitted following error is worked off without an alarm."""
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    ctx.inject("encoder.jump", drive_name(ctx), increments=5000)
    ctx.run_for(0.5)
    ctx.expect(no_alarm(axis=axis), state_at(axis, ctx.now_s, "MOTION"))


def _stop(ctx: CaseContext, mode: int) -> Any:
    ctx.do(f"MC_Stop Mode {mode}")
    return ctx.axis.stop(mode)


PRECEDENCE: Final = (
    # first, second, MC_Stop aborted, requirement
    ("alarm-2", "stop-0", False, "STP-439"),
    ("stop-3", "alarm-2", True, "STP-440"),
    ("alarm-3", "stop-0", True, "STP-441"),
    ("stop-2", "alarm-2", False, "STP-442"),
    ("stop-0", "alarm-4", True, "STP-516"),
    ("alarm-4", "stop-0", True, "STP-444"),
)


@CAMPAIGN.product(
    "precedence/{first}/{second}",
    parameters=[
        dict(zip(("first", "second", "aborted", "identifier"), row, strict=True)) for row in PRECEDENCE
    ],
    title="{second} while {first} is active",
    tags=("precedence",),
    requirements=lambda first, second, aborted, identifier: ("STP-436", identifier),
)
def precedence(ctx: CaseContext, first: str, second: str, aborted: bool, identifier: str) -> None:
    """The more severe of MC_Stop and alarm reaction wins; an MC_Stop that loses shows CommandAborted, never Error."""
    numbers = {1: 533, 2: 104, 3: 304, 4: 521}
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    before = ctx.now_s
    stop = None
    for what in (first, second):
        kind, _, value = what.partition("-")
        if kind == "stop":
            stop = _stop(ctx, int(value))
            ctx.run_for(5 * ctx.bench.cycle_ns * 1e-9)
        else:
            ctx.inject("axis.alarm", axis, number=numbers[int(value)], reaction=int(value))
            ctx.run_for(5 * ctx.bench.cycle_ns * 1e-9)
    ctx.run_for(1.5 + settle_s(ctx))
    assert stop is not None
    output = "CommandAborted" if aborted else "Done"
    ctx.expect(job_output(stop.name, output, since=before).covers(identifier))
    ctx.expect(never_happens(event("job.error", job=stop.name)).covers("STP-437"))
    ctx.expect(state_at(axis, ctx.now_s, "ALARM_DISABLED").covers("STP-443"))
    stopped_for_good(ctx, ctx.now_s)
