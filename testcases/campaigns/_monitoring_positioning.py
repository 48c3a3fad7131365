"""Cases of `monitoring`: the positioning window and its times, fixed stop, and what disturbs an axis that
settles.
"""

from __future__ import annotations

from math import exp, log
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, happens, job_output, never_happens, no_alarm
from hil.record import event
from testcases.campaigns._loop import (
    SIGN,
    UNHURRIED,
    WIDE,
    Run,
    acknowledged,
    alarm_after,
    begin,
    bit,
    cycle_s,
    disabled_with,
    increments,
    quiet,
    travel,
    until_setpoint_ends,
    write,
)
from testcases.campaigns.support import axis_name, can_segment, drive_name, grace_s

CASES: Final = Campaign("monitoring", tags=("monitoring",), bench="reference")

LAGGING: Final = {"PositionControl.Kpc": 0.0, **WIDE}
"""Without precontrol the axis closes what is left with the time constant 1 / Kv."""
WINDOWS: Final = {"narrow": 0.1, "middle": 0.5, "wide": 2.0}
DWELLS: Final = {"none": 0.0, "short": 0.01, "long": 0.2}


def settle(
    ctx: CaseContext, kv: float, *, window: float, dwell: float = 0.01, tolerance: float = 1.0
) -> tuple[Any, float]:
    """Start a motion after whose end the axis closes its lag with 1 / Kv; returns the job and the end of the
    setpoint, s.
    """
    values = {
        "PositionControl.Kv": kv,
        "PositioningMonitoring.Window": window,
        "PositioningMonitoring.MinDwellTime": dwell,
        "PositioningMonitoring.ToleranceTime": tolerance,
    }
    begin(ctx, None, LAGGING, values)
    ctx.do("MC_MoveRelative 15 mm with 100 mm/s")
    job = ctx.axis.move_relative(15.0, Velocity=100.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0)
    return job, until_setpoint_ends(ctx, job)


def rate(kv: float, delay_s: float) -> float:
    """Return how fast a loop with gain and dead time closes a deviation, 1/s: the root of r = Kv * exp(r *
    delay).
    """
    found = kv
    for _ in range(50):
        found = kv * exp(found * delay_s)
    return found


def deviation(run: Run, at: float) -> float:
    """Return how far the axis is from its setpoint at an instant, mm."""
    row = int(abs(run.time - at).argmin())
    return float(abs(run.position_setpoint[row] - run.actual_position[row]))


@CASES.product(
    "settles/{kv}/{window}/{dwell}",
    parameters=[
        {"kv": kv, "window": window, "dwell": dwell}
        for kv, window, dwell in (
            (5, "narrow", "short"),
            (5, "middle", "none"),
            (5, "wide", "long"),
            (12, "narrow", "none"),
            (12, "middle", "long"),
            (12, "wide", "short"),
            (30, "narrow", "long"),
            (30, "middle", "short"),
            (30, "wide", "none"),
        )
    ],
    title="window {window}, dwell {dwell}, Kv {kv}/s: Done when window and time are kept",
    tags=("positioning",),
    requirements=("MON-001", "MON-002", "MON-003", "MON-016", "MON-017", "MON-023", "MON-025", "MON-028"),
)
def settles(ctx: CaseContext, kv: float, window: str, dwell: str) -> None:
    """The window is entered ln(deviation / window) / r after the end of the setpoint, Done and X6 come a
    dwell time later.

    r is Kv, and somewhat more by the dead time of the loop, one cycle to two.
    """
    wide, stay = WINDOWS[window], DWELLS[dwell]
    job, ended = settle(ctx, kv, window=wide, dwell=stay, tolerance=3.0)
    ctx.wait_until(job.ended, 4.0, "the job ends")
    done = ctx.now_s
    ctx.run_for(0.05)
    run = Run(ctx, ended - 0.05)
    cycle = cycle_s(ctx)
    way = log(deviation(run, ended) / wide)
    early, late = (way / rate(kv, number * cycle) for number in (2, 1))
    ctx.measure(
        "Done after the end of the setpoint",
        done - ended,
        "s",
        low=early + stay - 2 * cycle,
        high=late + stay + 2 * cycle,
        requirements=("MON-017", "MON-023"),
    )
    shown = run.first(bit(run.status_word, 6) & (run.time > ended))
    ctx.measure(
        "X6 against Done",
        -1.0 if shown is None else abs(shown - done),
        "s",
        low=0.0,
        high=1.01 * cycle,
        requirements=("MON-028",),
    )
    ctx.expect(job_output(job.name, "Done").covers("MON-017"))
    quiet(ctx, requirements=("MON-017",))


@CASES.product(
    "too-late/{tolerance_ms}",
    parameters={"tolerance_ms": (0, 40, 150, 400)},
    title="tolerance time of {tolerance_ms} ms is over",
    tags=("positioning",),
    requirements=("MON-018", "MON-020", "MON-024", "MON-056"),
)
def too_late(ctx: CaseContext, tolerance_ms: int) -> None:
    """The window is not reached in time: 541 with info 1 at the end of the tolerance time, and the axis is
    disabled.
    """
    job, ended = settle(ctx, 2.0, window=0.1, tolerance=tolerance_ms / 1000.0)
    ctx.run_for(tolerance_ms / 1000.0 + 0.35)
    alarm_after(
        ctx,
        541,
        tolerance_ms / 1000.0,
        since=ended,
        early_s=cycle_s(ctx),
        requirements=("MON-018", "MON-024"),
    )
    ctx.expect(_info(ctx, 1).covers("MON-018"))
    disabled_with(ctx, 541, 12, job)
    acknowledged(ctx)


def _info(ctx: CaseContext, number: int) -> Any:
    return happens(event("alarm.raised", axis_name(ctx), number=541, info=number))


@CASES.product(
    "leaves-the-window/{cause}",
    parameters={"cause": ("jump-forwards", "jump-backwards", "overload")},
    title="the window is left again within the dwell time: {cause}",
    tags=("positioning", "encoder"),
    requirements=("MON-019", "MON-020"),
)
def leaves_the_window(ctx: CaseContext, cause: str) -> None:
    """Once entered, the window is left before the dwell time is over: 541 with info 2 in the next cycle."""
    job, ended = settle(ctx, 40.0, window=0.1, dwell=0.5, tolerance=1.0)
    ctx.run_for(0.3)
    outside = increments(ctx, 1.0)
    if cause == "overload":
        ctx.inject("mechanics.load_step", drive_name(ctx), force_N=8000.0, duration_s=0.02)
    else:
        ctx.inject(
            "encoder.jump", drive_name(ctx), increments=outside if cause == "jump-forwards" else -outside
        )
    ctx.run_for(0.8)
    late = 0.02 if cause == "overload" else 0.0
    alarm_after(ctx, 541, 0.0, late_s=late, requirements=("MON-019",))
    ctx.expect(_info(ctx, 2).covers("MON-019"), no_alarm(until=ended + 0.29, axis=axis_name(ctx)))
    disabled_with(ctx, 541, 12, job)


@CASES.product(
    "{instruction}/{mode}",
    parameters={"instruction": ("halt", "stop"), "mode": ("controlled", "not-controlled")},
    title="MC_{instruction}, {mode}: monitoring at its end",
    tags=("positioning",),
    requirements=("MON-021", "MON-022", "CTL-090"),
)
def halts(ctx: CaseContext, instruction: str, mode: str) -> None:
    """Under position control a halt or stop that does not settle is 541; without, it is done at standstill,
    wherever that is.
    """
    axis = axis_name(ctx)
    controlled = mode == "controlled"
    begin(ctx, None, LAGGING, {"PositionControl.Kv": 4.0, "PositioningMonitoring.ToleranceTime": 0.15})
    travel(ctx, 60.0, PositionControlled=controlled)
    ctx.run_for(0.3)
    ctx.do(f"MC_{instruction}")
    job = ctx.axis.halt() if instruction == "halt" else ctx.axis.stop(2)
    ended = until_setpoint_ends(ctx, job)
    ctx.run_for(0.4)
    if not controlled:
        ctx.expect(job_output(job.name, "Done").covers("MON-022"))
        quiet(ctx, requirements=("MON-022",))
        ctx.measure(
            "X28 after the end", float(ctx.axis.var("StatusWord.X28")), low=1.0, requirements=("CTL-090",)
        )
        return
    alarm_after(ctx, 541, 0.15, since=ended, early_s=cycle_s(ctx), requirements=("MON-021",))
    ended_with = (
        job_output(job.name, "Error", error_id=0x8001)
        if instruction == "halt"
        else job_output(job.name, "CommandAborted")
    )
    ctx.expect(ended_with.covers("MON-021"), never_happens(event("job.done", axis, job=job.name)))


@CASES.product(
    "new-job/{phase}",
    parameters={"phase": ("tolerance", "dwell")},
    title="a new job within the {phase} time",
    tags=("positioning",),
    requirements=("MON-027",),
)
def new_job(ctx: CaseContext, phase: str) -> None:
    """A new job ends the supervision of the old one, which is aborted; no 541 comes of it."""
    tolerance = phase == "tolerance"
    job, _ = settle(
        ctx, 2.0 if tolerance else 40.0, window=0.1, dwell=0.5, tolerance=0.3 if tolerance else 1.0
    )
    ctx.run_for(0.2 if tolerance else 0.4)
    ctx.do("MC_MoveVelocity 20 mm/s")
    other = ctx.axis.move_velocity(20.0)
    ctx.run_for(0.6)
    ctx.expect(job_output(job.name, "CommandAborted").covers("MON-027"))
    quiet(ctx, requirements=("MON-027",))
    ctx.measure("the new job is busy", float(other.Busy), low=1.0)


@CASES.product(
    "displaced-after-done/{share}",
    parameters={"share": (50, 150)},
    title="displaced by {share} % of the permitted following error after Done",
    tags=("positioning", "encoder"),
    requirements=("MON-026",),
)
def displaced_after_done(ctx: CaseContext, share: int) -> None:
    """After Done the window is not watched any more: beyond the permitted following error it is 521, within
    it nothing.
    """
    begin(ctx)
    job = ctx.axis.move_relative(5.0)
    ctx.wait_until(job.done, 3.0, "the axis is in position")
    ctx.run_for(0.1)
    ctx.inject("encoder.jump", drive_name(ctx), increments=increments(ctx, 2.0 * share / 100.0))
    ctx.run_for(0.4)
    if share < 100:
        quiet(ctx, requirements=("MON-026",))
        return
    alarm_after(ctx, 521, 0.0, requirements=("MON-026",))
    ctx.expect(no_alarm(axis=axis_name(ctx), besides=(521, 522)).covers("MON-026"))


@CASES.product(
    "lost-while-settling/{what}",
    parameters={"what": ("telegram", "torque", "encoder")},
    title="{what} lost while the axis settles",
    tags=("positioning", "bus"),
    requirements=("MON-016", "MON-020"),
)
def lost_while_settling(ctx: CaseContext, what: str) -> None:
    """What fails has its own alarm, at once, and the supervision of the position ends without one of its
    own.
    """
    axis = axis_name(ctx)
    job, _ = settle(ctx, 2.0, window=0.1, tolerance=0.4)
    ctx.run_for(0.1)
    number, within = {"telegram": (431, grace_s(ctx)), "torque": (421, 0.1), "encoder": (411, 0.1)}[what]
    if what == "telegram":
        ctx.inject("frame.drop", can_segment(ctx), message="tpdo1")
    elif what == "torque":
        ctx.inject("drive.fault", drive_name(ctx), code=0x8611)
    else:
        ctx.inject("encoder.wire_break", drive_name(ctx), duration_s=0.5)
        number = 421  # the drive trips first, on the fault of its encoder
    ctx.run_for(0.8)
    ctx.expect(
        alarm(number, reaction=4, since=event("fault.applied"), within_s=within, axis=axis),
        never_happens(event("alarm.raised", axis, number=541)).covers("MON-016"),
        job_output(job.name, "Error", error_id=0x8001).covers("MON-020"),
    )


@CASES.product(
    "fixed-stop/{side}",
    parameters={"side": ("positive", "negative")},
    title="travel to a fixed stop in {side} direction",
    tags=("clamping", "mechanics"),
    requirements=("MON-029", "MON-044", "MON-045"),
)
def fixed_stop(ctx: CaseContext, side: str) -> None:
    """The blocked axis is clamped when its following error reaches 5 mm, without 521 before or after; let go,
    it is 542.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    velocity = 60.0 * SIGN[side]
    begin(ctx, None, WIDE, UNHURRIED)
    write(ctx, {"Clamping.FollowingErrorDeviation": 5.0, "Clamping.PositionTolerance": 1.0})
    limiting = ctx.axis.torque_limiting(1.0, mode=1)
    ctx.run_for(0.05)
    ctx.require(not limiting.Error, "torque limiting with detection of a fixed stop")
    moving = travel(ctx, velocity)
    jam = ctx.inject("mechanics.jam", drive)
    ctx.wait_until(lambda: limiting.InClamping, 1.0, "the axis is clamped")
    clamped = ctx.now_s
    applied = Run(ctx).instant(event("fault.applied"))
    after = -1.0 if applied is None else clamped - applied
    ctx.measure(
        "clamped after the stop",
        after,
        "s",
        low=5.0 / 60.0 - 1e-6,
        high=5.0 / 60.0 + 3 * cycle_s(ctx),
        requirements=("MON-045",),
    )
    write(ctx, {"FollowingError.MinValue": 2.0, "FollowingError.MaxValue": 10.0})
    ctx.run_for(0.3)
    ctx.measure("X30", float(ctx.axis.var("StatusWord.X30")), low=1.0)
    ctx.expect(
        job_output(moving.name, "CommandAborted"),
        no_alarm(axis=axis, until=ctx.now_s).covers("MON-029", "MON-044"),
    )
    held = ctx.now_s
    jam.remove()
    ctx.run_for(0.3)
    ctx.expect(alarm(542, since=held, within_s=0.2, axis=axis))


@CASES.case("changed-while-settling", tags=("positioning",), requirements=("MON-001", "MON-003"))
def changed_while_settling(ctx: CaseContext) -> None:
    """A wider window that is written while the axis settles is entered in the next cycle, and Done follows
    the new dwell time.
    """
    job, _ = settle(ctx, 1.0, window=0.1, tolerance=1.0)
    ctx.run_for(0.2)
    write(ctx, {"PositioningMonitoring.Window": 50.0, "PositioningMonitoring.MinDwellTime": 0.1})
    written = ctx.now_s
    ctx.wait_until(job.ended, 1.0, "the job ends")
    ctx.measure(
        "Done after the change", ctx.now_s - written, "s", low=0.1 - 1e-6, high=0.1 + 3 * cycle_s(ctx)
    )
    quiet(ctx)


@CASES.case("tolerance-shortened", tags=("positioning",), requirements=("MON-001", "MON-018"))
def tolerance_shortened(ctx: CaseContext) -> None:
    """A tolerance time that is shortened below what has passed is over at once."""
    job, ended = settle(ctx, 1.0, window=0.1, tolerance=5.0)
    ctx.run_for(0.25)
    write(ctx, {"PositioningMonitoring.ToleranceTime": 0.1})
    ctx.run_for(0.2)
    alarm_after(ctx, 541, 0.25, since=ended, early_s=cycle_s(ctx), requirements=("MON-018",))
    disabled_with(ctx, 541, 12, job)


@CASES.case("simulated", tags=("positioning",), requirements=("MON-016", "MON-017"))
def simulated(ctx: CaseContext) -> None:
    """A simulated axis settles like one with a drive, and no following error or window can disturb it."""
    begin(ctx, {"Simulation.Mode": 1})
    job = ctx.axis.move_relative(20.0)
    ctx.wait_until(job.done, 3.0, "the simulated axis is in position")
    ctx.run_for(0.2)
    quiet(ctx)
