"""Cases of `limits`: software limit switches, reached and passed, changed on the way, and left again."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    alarm,
    golden,
    job_output,
    never_happens,
    no_alarm,
    no_motion_after,
    ramp,
    state_at,
    stays_within,
    value_at,
)
from hil.record import EventSelector, event
from testcases.campaigns._limits import (
    DYNAMICS,
    SIGN,
    SOFTWARE_BIT,
    alarm_raised,
    bit_at,
    configure,
    release,
    retracts,
    set_in_motion,
)
from testcases.campaigns._reactions import cycles
from testcases.campaigns.own_axis import own
from testcases.campaigns.support import (
    VELOCITY,
    acknowledge,
    acknowledge_and_enable,
    axis_name,
    drive_name,
    enable,
    settle_s,
    state_change,
    tolerance,
)

CASES: Final = Campaign("limits", tags=("limits", "software"), bench="reference")
LIMIT: Final = 250.0
"""Software limits on either side of the home position, mm."""
REACHED: Final = 533
EXCEEDED: Final = 534
CURRENT: Final = {"current": 1, "maximum": 0}
"""`LimitReachedBehavior`."""
LEAVES: Final = {"disabling": (0, 4), "braking": (1, 3)}
"""`LimitExceededBehavior` and the reaction of alarm 534."""
EXACT: Final = 1e-6


def _prepare(ctx: CaseContext, *, active: bool = True, homed: bool = True, **start: Any) -> None:
    """Enable and home the axis, with software limits at both sides of where it is."""
    configure(ctx, "braking", **{f"PositionLimits_SW__{name}": value for name, value in start.items()})
    enable(ctx)
    if homed:
        ctx.do("MC_Home Mode 0, Position 0")
        ctx.wait_until(ctx.axis.home(0.0).done, 2.0, "the axis is homed")
    axis = ctx.axis
    axis.write("PositionLimits_SW.MinPosition", -LIMIT)
    axis.write("PositionLimits_SW.MaxPosition", LIMIT)
    axis.write("PositionLimits_SW.Active", active)
    ctx.run_for(cycles(ctx, 2))


def _braking(ctx: CaseContext, behaviour: str) -> tuple[float, float]:
    """Return deceleration and jerk of the approach: those of the job, or the greatest ones."""
    axis = own(ctx)
    if CURRENT[behaviour]:
        return axis.dynamics().deceleration, axis.dynamics().jerk
    return axis.golden.maximum_deceleration, axis.golden.maximum_jerk


def _rests_on(ctx: CaseContext, side: str, limit: float, *, since: float | EventSelector) -> None:
    """Expect the setpoint exactly on the limit, never behind it, the bit of its side, and the axis enabled
    (LIM-075, LIM-082).
    """
    axis, sign = axis_name(ctx), SIGN[side]
    now = ctx.now_s
    bound = {"high": limit + EXACT} if sign > 0 else {"low": limit - EXACT}
    ctx.expect(
        value_at(f"{axis}.position_setpoint", now, limit, tolerance=EXACT).covers("LIM-075"),
        stays_within(f"{axis}.position_setpoint", since=since, until=now, **bound).covers("LIM-075"),
        state_at(axis, now, "ALARM_STANDSTILL").covers("LIM-076"),
        value_at(f"{axis}.power_status", now, 1.0, tolerance=0.0).covers("LIM-076"),
        bit_at(ctx, SOFTWARE_BIT[side], True).covers("LIM-082"),
        bit_at(ctx, SOFTWARE_BIT["negative" if sign > 0 else "positive"], False),
        never_happens(event("alarm.raised", axis, number=EXCEEDED)),
    )


def _leave(ctx: CaseContext, side: str) -> None:
    """Acknowledge; outwards 533 or 534 again, without motion; inwards free, and the bit goes (LIM-083,
    LIM-094).
    """
    sign, axis = SIGN[side], axis_name(ctx)
    acknowledge_and_enable(ctx)
    since = ctx.now_s
    ctx.do("MC_MoveRelative further outwards")
    job = ctx.axis.move_relative(5.0 * sign, Velocity=50.0, **DYNAMICS)
    ctx.run_for(0.1 + cycles(ctx, 2))
    ctx.expect(
        job_output(job.name, "Error", since=since, error_id=0x8001).covers("LIM-097"),
        no_motion_after(since, axis=axis, until=ctx.now_s),
    )
    acknowledge_and_enable(ctx)
    retracts(ctx, -10.0 * sign)
    ctx.expect(bit_at(ctx, SOFTWARE_BIT[side], False).covers("LIM-083"))


@CASES.product(
    "software/{side}/{motion}/{behaviour}",
    parameters={
        "side": tuple(SIGN),
        "motion": ("constant", "accelerating", "jog", "positioning", "superimposed", "motion-in"),
        "behaviour": tuple(CURRENT),
    },
    title="{side} software limit from {motion}, {behaviour} dynamics",
    tags=("{motion}",),
    requirements=("LIM-021", "LIM-075", "LIM-076", "LIM-077", "LIM-081", "LIM-082", "LIM-083", "LIM-094"),
)
def reached(ctx: CaseContext, side: str, motion: str, behaviour: str) -> None:
    """The axis brakes with the dynamics of its job, or the greatest ones, so that it ends on the limit: 533,
    still enabled.
    """
    sign, axis = SIGN[side], axis_name(ctx)
    _prepare(ctx, LimitReachedBehavior=CURRENT[behaviour])
    began = ctx.now_s
    jobs = set_in_motion(ctx, motion, sign)
    if motion == "accelerating":
        # So close that braking has to begin in a moment, while the axis still accelerates.
        deceleration, jerk = _braking(ctx, behaviour)
        room = golden.stop_ramp(
            VELOCITY, deceleration, jerk, acceleration=own(ctx).dynamics().acceleration
        ).distance
        ctx.axis.write(
            f"PositionLimits_SW.{'Max' if sign > 0 else 'Min'}Position",
            ctx.axis.var("Position") + sign * (room + 10.0),
        )
        ctx.run_for(cycles(ctx, 1))
    limit = float(ctx.axis.variables.read(f"PositionLimits_SW.{'Max' if sign > 0 else 'Min'}Position"))
    ctx.run_for(1.2 + settle_s(ctx))
    reaction = 1 if CURRENT[behaviour] else 2
    ctx.expect(alarm(REACHED, reaction=reaction, since=began, axis=axis).covers("LIM-077"))
    for job in jobs:
        ctx.expect(job_output(job.name, "Error", since=began, error_id=0x8001).covers("LIM-079"))
        release(job)
    _rests_on(ctx, side, limit, since=began)
    since = state_change(ctx, "ALARM_RAMP")
    start = ctx.trace().instant(since)
    if motion not in ("accelerating", "motion-in") and start is not None:
        velocity = abs(ctx.trace()[f"{axis}.velocity_setpoint"].at(start))
        deceleration, jerk = _braking(ctx, behaviour)
        allowed = tolerance(ctx)
        ctx.expect(
            ramp(
                since,
                golden.stop_ramp(velocity, deceleration, jerk),
                axis=axis,
                velocity=f"{axis}.velocity_setpoint",
                position=f"{axis}.position_setpoint",
                time_tolerance_s=allowed.time_s + cycles(ctx, 1),
                distance_tolerance=allowed.distance,
                threshold=1e-9,
                until=ctx.now_s,
            ).covers("LIM-075", "LIM-077")
        )
    _leave(ctx, side)


@CASES.product(
    "software/{side}/passed/{how}/{leaves}",
    parameters={"side": tuple(SIGN), "how": ("motion-in", "moved", "uncontrolled"), "leaves": tuple(LEAVES)},
    title="{side} software limit passed by {how}, {leaves}",
    tags=("passed",),
    requirements=("LIM-084", "LIM-085", "LIM-087", "LIM-089"),
)
def passed(ctx: CaseContext, side: str, how: str, leaves: str) -> None:
    """No look-ahead can help: 534 at once, and the axis is disabled or brakes on its emergency ramp; then
    back inwards.
    """
    sign, axis, drive = SIGN[side], axis_name(ctx), drive_name(ctx)
    behaviour, reaction = LEAVES[leaves]
    _prepare(ctx, LimitExceededBehavior=behaviour)
    jobs = set_in_motion(ctx, "uncontrolled" if how == "uncontrolled" else "constant", sign)
    began = ctx.now_s
    name = f"PositionLimits_SW.{'Max' if sign > 0 else 'Min'}Position"
    if how == "motion-in":
        # Positions alone, without the velocity that a look-ahead would need.
        place = ctx.axis.var("Position")
        ctx.axis.write(name, place + 30.0 * sign)
        ctx.do("MC_MotionInPosition: positions lead behind the limit")
        jobs = [ctx.axis.motion_in_position(place)]
        while not jobs[0].Error and abs(place - ctx.axis.var("Position")) < 60.0:
            place += VELOCITY * sign * ctx.bench.cycle_ns * 1e-9
            jobs[0].set(Position=place)
            ctx.run_for(cycles(ctx, 1))
    if how == "moved":
        ctx.do("the limit is written to where the axis has been")
        ctx.axis.write(name, ctx.axis.var("Position") - 10.0 * sign)
    ctx.wait_until(jobs[0].error if how != "motion-in" else lambda: jobs[0].Error, 3.0, "534 ends the job")
    ctx.run_for((0.3 if reaction == 3 else 0.6) + settle_s(ctx))
    now = ctx.now_s
    ctx.expect(
        alarm(EXCEEDED, reaction=reaction, since=began, axis=axis).covers("LIM-084", "LIM-085"),
        state_at(axis, now, "ALARM_STANDSTILL" if reaction == 3 else "ALARM_DISABLED").covers("LIM-085"),
        value_at(f"{axis}.power_status", now, float(reaction == 3), tolerance=0.0).covers("LIM-085"),
        no_motion_after(now - 0.05, position=f"{drive}.position", tolerance=0.00005, until=now),
        bit_at(ctx, SOFTWARE_BIT[side], True),
    )
    if how == "moved":
        ctx.expect(alarm(EXCEEDED, since=began, within_s=cycles(ctx, 3), axis=axis).covers("LIM-087"))
    release(jobs[0])
    acknowledge_and_enable(ctx)
    retracts(ctx, -8.0 * sign)


@CASES.product(
    "software/{side}/without-effect/{why}",
    parameters={"side": tuple(SIGN), "why": ("not-homed", "switched-off")},
    title="{side} software limit without effect: {why}",
    requirements=("LIM-004", "LIM-008", "LIM-073"),
)
def without_effect(ctx: CaseContext, side: str, why: str) -> None:
    """Past the limit without alarm and bit; homed or switched on there, the place where the axis is is the
    limit.
    """
    sign, axis = SIGN[side], axis_name(ctx)
    _prepare(ctx, active=why != "switched-off", homed=why != "not-homed")
    began = ctx.now_s
    job = ctx.axis.move_relative(
        300.0 * sign, Velocity=400.0, Acceleration=2000.0, Deceleration=2000.0, Jerk=0.0
    )
    ctx.wait_until(job.ended, 5.0, "the motion ends")
    identifier = "LIM-073" if why == "not-homed" else "LIM-004"
    ctx.expect(
        job_output(job.name, "Done", since=began).covers(identifier),
        no_alarm(since=began, until=ctx.now_s, axis=axis).covers(identifier),
        bit_at(ctx, SOFTWARE_BIT[side], False).covers(identifier),
    )
    ctx.do("now the limit takes effect")
    if why == "not-homed":
        ctx.wait_until(ctx.axis.home(300.0 * sign).done, 2.0, "the axis is homed")
    else:
        ctx.axis.write("PositionLimits_SW.Active", True)
    ctx.run_for(cycles(ctx, 3))
    ctx.expect(bit_at(ctx, SOFTWARE_BIT[side], True).covers("LIM-087"))
    _leave_outside(ctx, side)


@CASES.product(
    "software/{side}/homed-outside",
    parameters={"side": tuple(SIGN)},
    title="homed behind the {side} software limit",
    requirements=("LIM-095", "LIM-096", "LIM-097"),
)
def homed_outside(ctx: CaseContext, side: str) -> None:
    """Where the axis is is the limit; it follows inwards, and the configured one holds again inside."""
    _prepare(ctx)
    ctx.wait_until(ctx.axis.home(300.0 * SIGN[side]).done, 2.0, "the axis is homed outside")
    ctx.run_for(cycles(ctx, 2))
    _leave_outside(ctx, side)


def _leave_outside(ctx: CaseContext, side: str) -> None:
    """From 300 mm, behind the limit: outwards refused, inwards free, outwards refused again, inside as
    always.
    """
    sign, axis = SIGN[side], axis_name(ctx)
    for _ in range(2):
        since = ctx.now_s
        job = ctx.axis.move_relative(4.0 * sign, Velocity=50.0, **DYNAMICS)
        ctx.run_for(0.1 + cycles(ctx, 2))
        ctx.expect(
            job_output(job.name, "Error", since=since, error_id=0x8001).covers("LIM-095", "LIM-096"),
            no_motion_after(since, axis=axis, until=ctx.now_s, tolerance=0.2),
        )
        acknowledge_and_enable(ctx)
        retracts(ctx, -10.0 * sign)
    retracts(ctx, -60.0 * sign)
    ctx.expect(bit_at(ctx, SOFTWARE_BIT[side], False))
    retracts(ctx, 15.0 * sign)


@CASES.product(
    "software/{side}/moved/{where}",
    parameters={"side": tuple(SIGN), "where": ("closer", "away")},
    title="{side} software limit moved {where} on the way",
    requirements=("LIM-087",),
)
def moved(ctx: CaseContext, side: str, where: str) -> None:
    """The new limit counts from the next cycle on: the axis ends there, or goes on."""
    sign = SIGN[side]
    _prepare(ctx)
    began = ctx.now_s
    job = ctx.axis.move_velocity(VELOCITY * sign, **DYNAMICS)
    ctx.wait_until(lambda: ctx.axis.var("Position") * sign > 80.0, 3.0, "80 mm are passed")
    limit = (170.0 if where == "closer" else 400.0) * sign
    ctx.axis.write(f"PositionLimits_SW.{'Max' if sign > 0 else 'Min'}Position", limit)
    if where == "away":
        ctx.wait_until(lambda: ctx.axis.var("Position") * sign > LIMIT, 3.0, "the former limit is passed")
        ctx.expect(no_alarm(since=began, until=ctx.now_s, axis=axis_name(ctx)).covers("LIM-087"))
    ctx.wait_until(job.error, 3.0, "the limit ends the motion")
    ctx.run_for(0.6 + settle_s(ctx))
    _rests_on(ctx, side, limit, since=began)


@CASES.product(
    "software/{side}/simulated",
    parameters={"side": tuple(SIGN)},
    title="{side} software limit of a simulated axis",
    requirements=("LIM-075", "LIM-076"),
)
def simulated(ctx: CaseContext, side: str) -> None:
    """Without a drive the setpoints are the same: the axis ends on its limit with 533."""
    configure(ctx, "braking", Simulation__Mode=1)
    _prepare(ctx)
    began = ctx.now_s
    job = ctx.axis.move_velocity(VELOCITY * SIGN[side], **DYNAMICS)
    ctx.wait_until(job.error, 3.0, "the limit ends the motion")
    ctx.run_for(0.6)
    ctx.expect(alarm(REACHED, since=began, axis=axis_name(ctx)))
    _rests_on(ctx, side, LIMIT * SIGN[side], since=began)


@CASES.product(
    "software/{side}/switch-on-the-way",
    parameters={"side": tuple(SIGN)},
    title="the {side} hardware switch comes on the ramp to the software limit",
    tags=("hardware",),
    requirements=("LIM-034", "LIM-037"),
)
def switch_on_the_way(ctx: CaseContext, side: str) -> None:
    """The stronger reaction takes the ramp over: the axis stands earlier, in front of the software limit."""
    sign, axis = SIGN[side], axis_name(ctx)
    _prepare(ctx, LimitReachedBehavior=1)
    ctx.axis.move_velocity(VELOCITY * sign, **DYNAMICS)
    ramp_begins = alarm_raised(ctx, REACHED)
    ctx.wait_until(lambda: ctx.axis.var("ErrorDetail.Number") == REACHED, 3.0, "the ramp to the limit begins")
    ctx.run_for(cycles(ctx, 5))
    place = ctx.axis.var("Position")
    velocity = abs(ctx.axis.var("Velocity"))
    ctx.inject("switch.press", drive_name(ctx), input=f"{side}_limit")
    ctx.run_for(0.4 + settle_s(ctx))
    way = abs(ctx.axis.var("Position") - place)
    ctx.expect(
        alarm(531, reaction=3, since=ramp_begins, axis=axis).covers("LIM-034"),
        state_at(axis, ctx.now_s, "ALARM_STANDSTILL"),
    )
    ctx.measure(
        "way to standstill",
        way,
        "mm",
        high=golden.switch_clearance(velocity, 4000.0, detection_s=cycles(ctx, 5)),
    )
    acknowledge_and_enable(ctx)
    retracts(ctx, -10.0 * sign)


@CASES.case("software/limits-exchanged", requirements=("LIM-088",))
def limits_exchanged(ctx: CaseContext) -> None:
    """`MinPosition` above `MaxPosition`: 104 with reaction 2; put right, acknowledged, and on."""
    axis = axis_name(ctx)
    _prepare(ctx)
    job = ctx.axis.move_velocity(VELOCITY, **DYNAMICS)
    ctx.wait_until(job.in_velocity, 3.0, "constant travel")
    since = ctx.now_s
    ctx.axis.write("PositionLimits_SW.MinPosition", LIMIT + 1.0)
    ctx.run_for(0.5 + settle_s(ctx))
    ctx.expect(
        alarm(104, reaction=2, since=since, within_s=cycles(ctx, 3), axis=axis).covers("LIM-088"),
        job_output(job.name, "Error", since=since, error_id=0x8001),
        no_motion_after(ctx.now_s - 0.05, position=f"{drive_name(ctx)}.position", tolerance=0.00005),
    )
    ctx.axis.write("PositionLimits_SW.MinPosition", -LIMIT)
    ctx.run_for(cycles(ctx, 2))
    acknowledge(ctx)
    ctx.wait_until(ctx.axis.power_instance.status, 5.0, "the axis is enabled again")
