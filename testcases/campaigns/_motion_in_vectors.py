"""Cases of `motion_in`: vectors that are followed, that step, that are wrong, and that end."""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, job_output, no_alarm, state_at, status_word_bit, stays_within, value_at
from testcases.campaigns._motion_in import (
    ACCELERATION,
    AT_MAXIMUM,
    EXACT,
    SIGN,
    SPEED,
    Program,
    at_rest,
    ends_with,
    largest_error,
    moving_position,
    permit,
    ramp_to,
    restart_with,
    takes_part,
    trapezoid,
    under_way,
    watch,
)
from testcases.campaigns.support import axis_name, drive_name, enable, settle_s

CASES: Final = Campaign("motion in", tags=("motion-in",), bench="reference")


@CASES.product(
    "velocity-followed/{direction}/{control}",
    parameters={"direction": tuple(SIGN), "control": ("position-control", "speed-control")},
    title="MC_MotionInVelocity {direction}, {control}",
    requirements=("MIN-001", "MIN-013", "MIN-018", "MIN-019", "MIN-020", "MIN-028", "MC-488"),
)
def velocity_followed(ctx: CaseContext, direction: str, control: str) -> None:
    """Every vector is the setpoint of the next cycle; the drive follows; released, the axis stands where it
    is.
    """
    enable(ctx)
    controlled = control == "position-control"
    axis, speed = ctx.axis, SIGN[direction] * SPEED
    since = ctx.now_s
    profile = trapezoid(SIGN[direction] * 60.0, SPEED, ACCELERATION)

    def vector(time_s: float) -> dict[str, float]:
        _, velocity, acceleration = profile(time_s)
        return {"Velocity": velocity, "Acceleration": acceleration}

    program = Program(ctx, vector)
    ctx.do(f"MC_MotionInVelocity, a trapezoid up to {speed:g} mm/s, PositionControlled = {controlled}")
    start = float(ctx.axis.var("ActualPosition"))
    job = program.lead(axis.motion_in_velocity(0.0, PositionControlled=controlled))
    ctx.run_for(0.4)
    takes_part(ctx, at=ctx.now_s, state=1)
    ctx.run_for(0.4)
    program.end()
    ctx.measure(
        "deviation of the velocity",
        program.deviation(ctx, "velocity_setpoint", "Velocity"),
        "mm/s",
        high=EXACT,
    )
    ctx.measure(
        "deviation of the acceleration",
        program.deviation(ctx, "acceleration_setpoint", "Acceleration"),
        "mm/s2",
        high=EXACT,
    )
    ctx.expect(
        status_word_bit(28, not controlled, at=ctx.now_s, axis=axis_name(ctx)).covers("MIN-020"),
        value_at(
            f"{axis_name(ctx)}.actual_position",
            ctx.now_s,
            start + SIGN[direction] * 60.0,
            tolerance=0.1 if controlled else 2.0,
        ),
    )
    job.set(Enable=False)
    ctx.run_for(0.2 + settle_s(ctx))
    takes_part(ctx, at=ctx.now_s, state=0)
    ctx.expect(
        job_output(job.name, "Done", since=since),
        state_at(axis_name(ctx), ctx.now_s, "STANDSTILL"),
        status_word_bit(28, not controlled, at=ctx.now_s, axis=axis_name(ctx)).covers("MIN-020", "MIN-028"),
    )
    at_rest(ctx, since=since)


@CASES.product(
    "position-followed/{direction}/{velocity}",
    parameters={"direction": tuple(SIGN), "velocity": ("given", "withheld")},
    title="MC_MotionInPosition {direction}, velocity {velocity}",
    requirements=("MIN-021", "MIN-022", "MIN-023", "MC-498"),
)
def position_followed(ctx: CaseContext, direction: str, velocity: str) -> None:
    """Position and velocity are the setpoints of the next cycle; without the velocity the axis lags by v /
    Kv.
    """
    enable(ctx)
    axis, distance = ctx.axis, SIGN[direction] * 15.0
    start = float(axis.var("Position"))
    kv = float(axis.variables.read("PositionControl.Kv"))
    speed = 20.0
    profile = trapezoid(distance, speed, ACCELERATION)
    given = velocity == "given"

    def vector(time_s: float) -> dict[str, float]:
        position, precontrol, acceleration = profile(time_s)
        return {
            "Position": start + position,
            "Velocity": precontrol if given else 0.0,
            "Acceleration": acceleration if given else 0.0,
        }

    since = ctx.now_s
    program = Program(ctx, vector)
    ctx.do(f"MC_MotionInPosition, a trapezoid by {distance:g} mm, its velocity {velocity}")
    job = program.lead(axis.motion_in_position(start))
    ctx.run_for(0.5)
    takes_part(ctx, at=ctx.now_s, state=2)
    axis_error = abs(float(axis.var("StatusPositioning.FollowingError")))
    lag = speed / kv
    if given:
        ctx.measure("lag with the velocity", axis_error, "mm", high=0.1 * lag, requirements=("MIN-022",))
    else:
        ctx.measure(
            "lag without the velocity",
            axis_error,
            "mm",
            low=0.9 * lag,
            high=1.1 * lag,
            requirements=("MIN-022",),
        )
    ctx.run_for(0.8)
    program.end()
    ctx.measure(
        "deviation of the position", program.deviation(ctx, "position_setpoint", "Position"), "mm", high=EXACT
    )
    ctx.measure(
        "deviation of the velocity",
        program.deviation(ctx, "velocity_setpoint", "Velocity"),
        "mm/s",
        high=EXACT,
    )
    ctx.measure(
        "deviation of the acceleration",
        program.deviation(ctx, "acceleration_setpoint", "Acceleration"),
        "mm/s2",
        high=EXACT,
    )
    job.set(Enable=False)
    ctx.run_for(0.2 + settle_s(ctx))
    ctx.expect(job_output(job.name, "Done", since=since))
    at_rest(ctx, since=since, place=start + distance)


@CASES.case("velocity-without-way", requirements=("MIN-022",))
def velocity_without_way(ctx: CaseContext) -> None:
    """A velocity that comes with a position at rest is precontrol alone: it is not taken for the slope of the
    position.
    """
    enable(ctx)
    axis = ctx.axis
    axis.write("DynamicAxisModel.VelocityTimeConstant", 0.03)
    place, velocity = float(axis.var("Position")), 8.0
    job = axis.motion_in_position(place)
    job.set(Position=place, Velocity=velocity)
    ctx.run_for(0.3)
    trace = ctx.trace()
    name = axis_name(ctx)
    behind = place - float(trace[f"{name}.balanced_position"].values[-1])
    ctx.measure(
        "balanced position behind the setpoint",
        behind,
        "mm",
        low=-EXACT,
        high=EXACT,
        requirements=("MIN-022",),
    )
    ahead = float(trace[f"{name}.actual_position"].values[-1]) - place
    expected = velocity / float(axis.variables.read("PositionControl.Kv"))
    ctx.measure("actual position ahead of it", ahead, "mm", low=0.9 * expected, high=1.1 * expected)
    job.set(Enable=False)
    ctx.run_for(0.1)
    ctx.expect(no_alarm(axis=name))


@CASES.product(
    "beyond-limits/{what}",
    parameters={"what": ("velocity", "velocity-backwards", "acceleration")},
    title="{what} beyond the dynamic limits of the axis",
    requirements=("MIN-004", "MIN-005"),
)
def beyond_limits(ctx: CaseContext, what: str) -> None:
    """Dynamic limits of the axis do not act; a velocity above them is reported by MaxVelocityExceeded as
    long as it lasts.
    """
    axis = ctx.axis
    exceeded = what != "acceleration"
    speed = -SPEED if what == "velocity-backwards" else SPEED
    if exceeded:
        restart_with(ctx, DynamicLimits__MaxVelocity=0.5 * SPEED)
    else:
        axis.write("DynamicLimits.MaxAcceleration", 0.1 * ACCELERATION)
        axis.write("DynamicLimits.MaxDeceleration", 0.1 * ACCELERATION)
    enable(ctx)
    since = ctx.now_s
    program = Program(ctx, ramp_to(speed))
    ctx.do(f"MC_MotionInVelocity to {speed:g} mm/s with {ACCELERATION:g} mm/s2")
    job = program.lead(axis.motion_in_velocity(0.0))
    ctx.run_for(0.4 + settle_s(ctx))
    ctx.measure(
        "MaxVelocityExceeded",
        float(axis.var("StatusMotionIn.StatusWord.X0")),
        low=float(exceeded),
        high=float(exceeded),
    )
    ctx.measure(
        "deviation of the velocity",
        program.deviation(ctx, "velocity_setpoint", "Velocity"),
        "mm/s",
        high=EXACT,
    )
    ctx.expect(
        value_at(f"{drive_name(ctx)}.velocity", ctx.now_s, speed / 1000.0, tolerance=0.004).covers("MIN-004"),
    )
    program.end()
    job.set(Velocity=0.4 * speed)
    ctx.run_for(0.2)
    ctx.measure("MaxVelocityExceeded afterwards", float(axis.var("StatusMotionIn.StatusWord.X0")), high=0.0)
    job.set(Enable=False)
    ctx.run_for(0.3 + settle_s(ctx))
    at_rest(ctx, since=since)


@CASES.product(
    "step/{step}/{monitoring}",
    parameters={"step": ("up", "to-zero", "reversed"), "monitoring": ("watched", "unwatched")},
    title="the velocity steps {step}, following error {monitoring}",
    requirements=("MIN-004", "MIN-006", "MIN-007", "MC-480", "MC-490"),
)
def step(ctx: CaseContext, step: str, monitoring: str) -> None:
    """A step that the drive cannot follow: 521 and disabled, or, unwatched, as fast as the drive can, to the
    place that was given.
    """
    watched = monitoring == "watched"
    axis, name = ctx.axis, axis_name(ctx)
    before, after = {"up": (0.0, 450.0), "to-zero": (450.0, 0.0), "reversed": (300.0, -300.0)}[step]
    watch(ctx, watched=watched)
    if before:
        job, program = under_way(ctx, before)
        program.end()
    else:
        enable(ctx)
        job = axis.motion_in_velocity(0.0)
        ctx.run_for(0.1)
    permit(ctx, 1.0)
    ctx.run_for(0.02)
    ctx.require(axis.alarms.engine.number == 0, "an axis that travels with less than 1 mm of following error")
    since = ctx.now_s
    ctx.do(f"Velocity steps from {before:g} to {after:g} mm/s")
    job.set(Velocity=after, Acceleration=0.0)
    cycle = ctx.bench.interpolator_ns * 1e-9
    ctx.run_for(3 * cycle)
    ctx.expect(
        value_at(f"{name}.velocity_setpoint", since + 2 * cycle, after, tolerance=EXACT).covers("MIN-006")
    )
    ctx.run_for(0.4 + settle_s(ctx))
    if watched:
        ctx.expect(alarm(521, reaction=4, since=since, axis=name).covers("MIN-007", "MC-490"))
        ctx.run_for(0.8)
        ctx.expect(
            ends_with(ctx, job, "Error", since=since, error_id=0x8001).covers("MIN-010"),
            state_at(name, ctx.now_s, "ALARM_DISABLED"),
            value_at(f"{drive_name(ctx)}.velocity", ctx.now_s, 0.0, tolerance=0.001),
        )
        return
    ctx.expect(
        no_alarm(since=since, axis=name, besides=(AT_MAXIMUM,)),
        value_at(f"{drive_name(ctx)}.velocity", ctx.now_s, after / 1000.0, tolerance=0.005).covers("MIN-007"),
    )
    ctx.measure("following error afterwards", largest_error(ctx, since=ctx.now_s - 0.02), "mm", high=0.5)
    job.set(Velocity=0.0)
    ctx.run_for(0.4 + settle_s(ctx))
    at_rest(ctx, since=since, besides=(AT_MAXIMUM,))


@CASES.product(
    "jump/{distance}/{monitoring}",
    parameters={"distance": (0.5, 40.0, -40.0), "monitoring": ("watched", "unwatched")},
    title="the position jumps by {distance} mm, following error {monitoring}",
    requirements=("MIN-007", "MC-500"),
)
def jump(ctx: CaseContext, distance: float, monitoring: str) -> None:
    """Within the permitted following error the axis goes there; beyond it 521; unwatched it goes there as
    fast as it can.
    """
    watched = monitoring == "watched"
    axis, name = ctx.axis, axis_name(ctx)
    watch(ctx, watched=watched)
    enable(ctx)
    start = float(axis.var("Position"))
    job = axis.motion_in_position(start)
    ctx.run_for(0.05)
    since = ctx.now_s
    ctx.do(f"Position jumps by {distance:g} mm")
    job.set(Position=start + distance)
    ctx.run_for(0.8 + settle_s(ctx))
    if watched and abs(distance) > 10.0:
        ctx.expect(
            alarm(521, reaction=4, since=since, axis=name).covers("MIN-007", "MC-500"),
            ends_with(ctx, job, "Error", since=since, error_id=0x8001),
        )
        return
    ctx.measure("Busy", float(job.Busy), low=1.0)
    at_rest(ctx, since=since, place=start + distance, besides=(AT_MAXIMUM,))


@CASES.product(
    "alternating/{mode}",
    parameters={"mode": ("velocity", "position", "superimposed")},
    title="the {mode} alternates with every cycle",
    requirements=("MIN-001", "MIN-002", "MIN-033"),
)
def alternating(ctx: CaseContext, mode: str) -> None:
    """A vector that changes its sign with every call: each one is the setpoint for one cycle, and nothing
    adds up.
    """
    axis, name = ctx.axis, axis_name(ctx)
    enable(ctx)
    start = float(axis.var("Position"))
    calls = [0]

    def vector(_: float) -> dict[str, float]:
        calls[0] += 1
        sign = 1.0 if calls[0] % 2 else -1.0
        if mode == "velocity":
            return {"Velocity": 5.0 * sign}
        if mode == "position":
            return {"Position": start + 0.02 * sign, "Velocity": 0.0}
        return {"Distance": 0.02 * sign, "VelocityDiff": 0.0}

    program = Program(ctx, vector)
    since = ctx.now_s
    ctx.do(f"MC_MotionIn{mode.capitalize()}: another sign with every call of the program")
    if mode == "velocity":
        job = program.lead(axis.motion_in_velocity(0.0))
    elif mode == "position":
        job = program.lead(axis.motion_in_position(start))
    else:
        job = program.lead(axis.motion_in_superimposed(0.0))
    ctx.run_for(200 * ctx.bench.interpolator_ns * 1e-9)
    program.end()
    if mode == "velocity":
        ctx.measure(
            "deviation of the velocity",
            program.deviation(ctx, "velocity_setpoint", "Velocity"),
            "mm/s",
            high=EXACT,
        )
    elif mode == "position":
        ctx.measure(
            "deviation of the position",
            program.deviation(ctx, "position_setpoint", "Position"),
            "mm",
            high=EXACT,
        )
    ctx.expect(
        stays_within(f"{name}.position_setpoint", low=start - 0.05, high=start + 0.05, since=since),
        stays_within(f"{drive_name(ctx)}.velocity", low=-0.02, high=0.02, since=since),
    )
    job.set(Enable=False)
    ctx.run_for(0.2 + settle_s(ctx))
    at_rest(ctx, since=since, place=start)


@CASES.product(
    "not-updated/{mode}",
    parameters={"mode": ("velocity", "position")},
    title="nobody updates the {mode}",
    requirements=("MIN-002", "MIN-003", "MIN-023"),
)
def not_updated(ctx: CaseContext, mode: str) -> None:
    """The last vector goes on: the velocity keeps moving; the position holds, off by the velocity that it is
    still precontrolled with.
    """
    axis, name = ctx.axis, axis_name(ctx)
    speed = 20.0
    job, program = (under_way if mode == "velocity" else moving_position)(ctx, speed)
    since = ctx.now_s
    ctx.do("the program gives no vector any more")
    program.end()
    place = float(axis.var("Position"))
    ctx.run_for(0.8 + settle_s(ctx))
    ctx.expect(no_alarm(since=since, axis=name))
    if mode == "velocity":
        ctx.expect(
            value_at(f"{drive_name(ctx)}.velocity", ctx.now_s, speed / 1000.0, tolerance=0.002).covers(
                "MIN-003"
            )
        )
        job.set(Enable=False)
    else:
        kv = float(axis.variables.read("PositionControl.Kv"))
        kpc = float(axis.variables.read("PositionControl.Kpc")) / 100.0
        deviation = speed * kpc / kv
        cycle = ctx.bench.interpolator_ns * 1e-9
        ctx.expect(
            value_at(
                f"{name}.actual_position",
                ctx.now_s,
                place + speed * cycle + deviation,
                tolerance=0.1 * deviation,
            )
            .named("the place with the velocity of the precontrol")
            .covers("MIN-003", "MIN-023"),
        )
        ctx.do("Velocity = 0")
        job.set(Velocity=0.0, Acceleration=0.0)
    ctx.run_for(0.4 + settle_s(ctx))
    at_rest(ctx, since=since)
