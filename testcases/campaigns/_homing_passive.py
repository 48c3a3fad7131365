"""Cases of `homing`: marks that are noticed on the fly, and homing without a mark."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    alarm,
    always,
    happens,
    job_output,
    never_happens,
    no_alarm,
    status_word_bit,
    value_at,
)
from hil.record import event
from testcases.campaigns._homing import MARKS, SIGN, Machine, configure, go_to, machine, tolerance_mm
from testcases.campaigns.support import axis_name, drive_name, enable, settle_s

CASES: Final = Campaign("homing", tags=("homing", "passive"), bench="profidrive")

_VELOCITY: Final = 40.0
_POSITION: Final = 300.0
_CONFIGURED: Final = 700.0


def _prepare(ctx: CaseContext, mark: str, direction: str) -> Machine:
    places = machine(ctx)
    configure(
        ctx,
        {"Sensor[1].PassiveHoming.Mode": MARKS[mark]},
        Sensor__PassiveHoming__Direction=int(direction == "negative"),
        Sensor__PassiveHoming__SideInput=True,
        Homing__HomePosition=_CONFIGURED,
    )
    go_to(ctx, places.cam[0] - 15.0 if direction == "positive" else places.cam[1] + 15.0)
    return places


def _pass_by(ctx: CaseContext, direction: str) -> Any:
    ctx.do(f"MC_MoveVelocity {SIGN[direction] * _VELOCITY:g} mm/s")
    return ctx.axis.move_velocity(SIGN[direction] * _VELOCITY)


def _at_rest(ctx: CaseContext) -> None:
    ctx.do("MC_Halt")
    ctx.wait_until(ctx.axis.halt().done, 5.0, "the axis has halted")
    ctx.run_for(0.3 + settle_s(ctx))


@CASES.product(
    "on-the-fly/{mark}/{direction}/{mode}",
    parameters={"mark": tuple(MARKS), "direction": ("positive", "negative"), "mode": ("2", "8", "10")},
    title="Mode {mode} on the mark {mark} in {direction} direction",
    tags=("{direction}",),
    requirements=("HOM-123", "HOM-124", "HOM-125", "HOM-126"),
)
def on_the_fly(ctx: CaseContext, mark: str, direction: str, mode: str) -> None:
    """At the mark the position becomes that of the mode, without a step of the velocity; mode 2 keeps the
    homed state.
    """
    places = _prepare(ctx, mark, direction)
    axis, name = ctx.axis, axis_name(ctx)
    ctx.wait_until(axis.home(0.0, mode=0).done, 1.0, "the axis is homed directly")
    since = ctx.now_s
    ctx.do(f"MC_Home Mode {mode}")
    job = axis.home(_POSITION, mode=int(mode))
    ctx.run_for(0.1)
    ctx.expect(
        status_word_bit(5, mode == "2", at=ctx.now_s, axis=name).covers("HOM-126"),
        status_word_bit(11, True, at=ctx.now_s, axis=name).covers("HOM-034"),
    )
    move = _pass_by(ctx, direction)
    ctx.wait_until(job.done, 10.0, "the mark is noticed")
    ctx.run_for(0.1)
    _at_rest(ctx)
    sign = SIGN[direction]
    starts = places.cam[0] - 15.0 if sign > 0 else places.cam[1] + 15.0
    expected = {
        "zero-mark": places.next_mark(starts, sign),
        "cam": places.next_mark(places.leaves_cam(sign), sign),
        "input": places.edge(sign, True),
    }[mark]
    position = _CONFIGURED if mode == "10" else _POSITION
    shift = expected - position
    limit = tolerance_mm(ctx, places, mark, _VELOCITY) + 0.02
    drive = drive_name(ctx)
    step = float(ctx.bench.cycle_ns) * 1e-9 * 2000.0
    ctx.expect(
        happens(event("axis.homed", name, mode=int(mode)), since=since).covers("HOM-125"),
        always(
            "the position belongs to the mark",
            lambda shown, place: abs(place * 1000.0 - shown - shift) <= limit,
            f"{name}.actual_position",
            f"{drive}.position",
            since=ctx.now_s - 0.1,
        ).covers("HOM-125", "HOM-131"),
        always(
            "the velocity setpoint has no step",
            lambda speed: abs(speed[1:] - speed[:-1]).max(initial=0.0) <= step + 1e-6 + 0.0 * speed,
            f"{name}.velocity_setpoint",
            since=since,
        ).covers("HOM-132"),
        never_happens(
            event("job.aborted", name, job=move.name), since=since, until=event("axis.homed", name)
        ).covers("HOM-123"),
        no_alarm(since=since, axis=name),
    )


@CASES.case("wrong-direction", title="against the homing direction", requirements=("HOM-124",))
def wrong_direction(ctx: CaseContext) -> None:
    """Marks that are passed the other way round mean nothing; mode 9 ends the waiting."""
    places = _prepare(ctx, "cam", "negative")
    axis, name = ctx.axis, axis_name(ctx)
    axis.write("Sensor[1].PassiveHoming.Direction", 0)
    since = ctx.now_s
    job = axis.home(_POSITION, mode=8)
    ctx.run_for(0.05)
    _pass_by(ctx, "negative")
    ctx.run_for((places.cam[1] - places.cam[0] + 25.0) / _VELOCITY)
    ctx.expect(status_word_bit(11, True, at=ctx.now_s, axis=name).covers("HOM-137"))
    ctx.do("MC_Home Mode 9")
    cancel = axis.home(mode=9)
    _at_rest(ctx)
    ctx.expect(
        never_happens(event("axis.homed", name), since=since).covers("HOM-124"),
        job_output(job.name, "CommandAborted", since=since).covers("HOM-134"),
        job_output(cancel.name, "Done", since=since).covers("HOM-134"),
        status_word_bit(11, False, at=ctx.now_s, axis=name),
    )


@CASES.case("encoder-lost", title="the encoder fails while a passive homing waits", requirements=("HOM-179",))
def encoder_lost(ctx: CaseContext) -> None:
    """Alarm 411: the passive job ends with 16#8001, and the axis is not homed."""
    _prepare(ctx, "cam", "positive")
    axis, name = ctx.axis, axis_name(ctx)
    since = ctx.now_s
    job = axis.home(_POSITION, mode=8)
    ctx.run_for(0.05)
    ctx.inject("encoder.wire_break", drive_name(ctx), duration_s=0.5)
    ctx.run_for(1.0 + settle_s(ctx))
    ctx.expect(
        alarm(411, reaction=4, since=since, axis=name),
        job_output(job.name, "Error", since=since, error_id=0x8001),
        status_word_bit(5, False, at=ctx.now_s, axis=name).covers("HOM-179"),
        status_word_bit(11, False, at=ctx.now_s, axis=name).covers("HOM-034"),
    )


@CASES.product(
    "direct/{mode}",
    parameters={"mode": ("0", "1", "11", "12", "13")},
    title="Mode {mode} during a motion",
    tags=("direct",),
    requirements=("HOM-139", "HOM-140", "HOM-145", "HOM-147"),
)
def direct(ctx: CaseContext, mode: str) -> None:
    """Position or setpoint are set while the axis moves: no step of the velocity, and the motion goes on."""
    axis, name = ctx.axis, axis_name(ctx)
    enable(ctx)
    since = ctx.now_s
    move = _pass_by(ctx, "positive")
    ctx.run_for(0.5)
    before = ctx.now_s
    ctx.do(f"MC_Home Mode {mode}, Position 500 mm")
    job = axis.home(500.0, mode=int(mode))
    ctx.run_for(0.5)
    ctx.expect(
        job_output(job.name, "Done", since=before, within_s=3 * ctx.bench.cycle_ns * 1e-9).covers("HOM-142"),
        value_at(f"{name}.velocity_setpoint", ctx.now_s, _VELOCITY, tolerance=1e-6).covers("HOM-147"),
        value_at(f"{name}.actual_velocity", ctx.now_s, _VELOCITY, tolerance=1.0),
        never_happens(event("job.aborted", name, job=move.name), since=since, until=ctx.now_s),
        status_word_bit(5, True, at=ctx.now_s, axis=name),
        no_alarm(since=since, axis=name),
    )
    shown = ctx.trace()[f"{name}.{'position_setpoint' if mode == '11' else 'actual_position'}"]
    origin = float(shown.at(before)) if mode in ("1", "12") else 0.0
    way = _VELOCITY * (ctx.now_s - before)
    ctx.measure(
        "position now, without the way since",
        float(shown.values[-1]) - way,
        "mm",
        low=origin + 500.0 - 1.5,
        high=origin + 500.0 + 1.5,
        requirements=("HOM-139",),
    )
    _at_rest(ctx)
