"""What the cases of `limits` share: kinds of switches, ways to be in motion, and what an axis owes at its
limit.

Numbers are those of the switch, the ramp and the machine; nothing here asks the axis whether it has stopped
well.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

from hil.campaign import CaseContext
from hil.expect import (
    alarm,
    golden,
    job_output,
    no_alarm,
    no_motion_after,
    ramp,
    state_at,
    status_word_bit,
    value_at,
)
from hil.record import EventSelector, event
from testcases.campaigns._reactions import cycles, detection_s
from testcases.campaigns.own_axis import own
from testcases.campaigns.support import (
    MAXIMUM_VELOCITY,
    VELOCITY,
    axis_name,
    bring_into,
    drive_name,
    quick_stop,
    restart,
    state_change,
    tolerance,
)

SIGN: Final = {"positive": 1, "negative": -1}
OTHER: Final = {"positive": "negative", "negative": "positive"}
HARDWARE_BIT: Final = {"positive": 18, "negative": 17}
SOFTWARE_BIT: Final = {"positive": 16, "negative": 15}
EMERGENCY: Final = 4000.0
"""`DynamicDefaults.EmergencyDeceleration` of the reference axis, mm/s2."""
OFF3_S: Final = 0.5
"""Time of the drive from its maximum velocity to zero, s."""


class Kind(NamedTuple):
    """What a hardware limit switch is, and what the axis does at it."""

    mode: int
    """`PositionLimits_HW.Mode`: 0 not traversable, 1 traversable."""
    approach: int
    """`PositionLimits_HW.ApproachBehavior`: 0 disable, 1 emergency ramp."""

    @property
    def reaction(self) -> int:
        """Reaction of alarm 531 (LIM-032 to LIM-034)."""
        return 3 if (self.mode, self.approach) == (0, 1) else 4

    @property
    def stays_enabled(self) -> bool:
        """Whether the axis is enabled all the time."""
        return self.reaction == 3


KINDS: Final = {"braking": Kind(0, 1), "disabling": Kind(0, 0), "traversable": Kind(1, 1)}
"""By the word in the names of cases. A traversable switch takes no notice of `ApproachBehavior`, so that it
says the other here.
"""

MOTIONS: Final = (
    "constant",
    "accelerating",
    "jog",
    "positioning",
    "homing",
    "superimposed",
    "motion-in",
    "uncontrolled",
    "standstill",
)
"""Ways to be under way when the limit comes; all but the last at 300 mm/s."""
DYNAMICS: Final = {"Acceleration": 1000.0, "Deceleration": 1000.0, "Jerk": 10_000.0}


def alarm_raised(ctx: CaseContext, number: int) -> EventSelector:
    """Select the first time that the axis raises an alarm."""
    return event("alarm.raised", axis_name(ctx), number=number)


def configure(ctx: CaseContext, kind: str, **start: Any) -> Kind:
    """Give the limit switches of the axis a kind; `start` are further start values, `__` for a dot."""
    wanted = KINDS[kind]
    values = {"PositionLimits_HW.Mode": wanted.mode, "PositionLimits_HW.ApproachBehavior": wanted.approach}
    values |= {name.replace("__", "."): value for name, value in start.items()}
    read = ctx.axis.variables.read
    changed = {path: value for path, value in values.items() if read(path) != value}
    if changed:
        restart(ctx, changed)
    return wanted


def set_in_motion(ctx: CaseContext, motion: str, sign: int) -> list[Any]:
    """Bring the enabled axis into a motion, one of `MOTIONS`; returns the jobs that run."""
    axis = ctx.axis
    if motion in ("constant", "accelerating", "standstill"):
        job = bring_into(ctx, motion, direction=sign)
        return [] if job is None else [job]
    velocity = VELOCITY * sign
    inputs = own(ctx).dynamics().inputs
    words = f"{motion} at {velocity:g} mm/s"
    ctx.do(words)
    if motion == "jog":
        jobs = [axis.jog(VELOCITY, backward=sign < 0, **inputs)]
    elif motion == "positioning":
        jobs = [axis.move_relative(400.0 * sign, Velocity=VELOCITY, **inputs)]
    elif motion == "homing":
        axis.write("Homing.ApproachVelocity", VELOCITY)
        axis.write("Homing.ApproachDirection", sign < 0)
        jobs = [axis.home(0.0, mode=3)]
    elif motion == "superimposed":
        jobs = [
            axis.move_velocity(0.5 * velocity, **inputs),
            axis.move_superimposed(400.0 * sign, VelocityDiff=0.5 * VELOCITY, **inputs),
        ]
    elif motion == "uncontrolled":
        jobs = [axis.move_velocity(velocity, PositionControlled=False, **inputs)]
    else:
        jobs = [axis.motion_in_velocity(0.0)]
        for step in range(1, 76):  # 1000 mm/s2 of a user program that gives its setpoints itself
            ctx.run_for(ctx.bench.cycle_ns * 1e-9)
            jobs[0].set(Velocity=4.0 * step * sign, Acceleration=1000.0 * sign if step < 75 else 0.0)
    ctx.wait_until(lambda: axis.servo.total.v * sign > VELOCITY - 1e-6, 5.0, f"the axis is in its {words}")
    ctx.run_for(0.05)
    return jobs


def release(job: Any) -> None:
    """Take the level inputs of an instruction back, so that it does not begin again after the
    acknowledgement.
    """
    if hasattr(job, "JogForward"):
        job.set(JogForward=False, JogBackward=False)
    elif hasattr(job, "Enable"):
        job.set(Enable=False)


def tell_stop(ctx: CaseContext, kind: Kind, side: str, jobs: list[Any], *, hit: EventSelector) -> None:
    """Expect alarm 531 of this side in time, its bit in the same cycle, and all jobs ended by it (LIM-031 to
    LIM-039).

    Args:
        ctx: The case.
        kind: What the switch is.
        side: Which one.
        jobs: What ran.
        hit: When the input changed.

    """
    axis = axis_name(ctx)
    raised = alarm_raised(ctx, 531)
    ctx.expect(
        alarm(531, reaction=kind.reaction, since=hit, within_s=detection_s(ctx, 3), axis=axis).covers(
            "LIM-031"
        ),
        status_word_bit(HARDWARE_BIT[side], True, at=raised.plus(cycles(ctx, 0.5)), axis=axis).covers(
            "LIM-039"
        ),
        status_word_bit(HARDWARE_BIT[OTHER[side]], False, at=raised.plus(cycles(ctx, 0.5)), axis=axis),
        status_word_bit(9, True, at=raised.plus(cycles(ctx, 0.5)), axis=axis, word="error_word").covers(
            "LIM-022"
        ),
    )
    for job in jobs:
        ctx.expect(
            job_output(job.name, "Error", since=hit, within_s=detection_s(ctx, 3), error_id=0x8001).covers(
                "LIM-037"
            )
        )


def stopped_on_ramp(
    ctx: CaseContext,
    kind: Kind,
    *,
    hit: EventSelector,
    until: float,
    moving: bool,
    homing: bool = False,
    bounces_s: float = 0.0,
) -> None:
    """Expect the ramp of the reaction, and the machine within the way that reaction and detection take
    (LIM-029, LIM-036).

    A homing fails besides: its alarm 342 disables the axis at the end of the ramp, which 531 alone does not.

    Args:
        ctx: The case.
        kind: What the switch is.
        hit: When the input changed.
        until: End of what is looked at, s.
        moving: The axis moved when the input changed.
        homing: It homed.
        bounces_s: Longest time for which the input was not stable, s.

    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    enabled = kind.stays_enabled and not homing
    ctx.expect(
        state_at(axis, until, "ALARM_STANDSTILL" if enabled else "ALARM_DISABLED"),
        value_at(f"{axis}.power_status", until, float(enabled), tolerance=0.0).covers("LIM-035"),
        value_at(f"{axis}.power_busy", until, 1.0, tolerance=0.0).covers("LIM-038"),
        no_motion_after(until - 0.05, position=f"{drive}.position", tolerance=0.00005, until=until),
    )
    if not moving:
        ctx.expect(no_motion_after(hit, position=f"{drive}.position", tolerance=0.0001, until=until))
        return
    allowed = tolerance(ctx)
    trace = ctx.trace()
    since = state_change(ctx, "ALARM_RAMP") if kind.stays_enabled else quick_stop(ctx)
    start, pressed = trace.instant(since), trace.instant(hit)
    if start is None or pressed is None:
        ctx.expect(state_at(axis, until, "a stop that has begun"))
        return
    speed, fastest = _speeds(trace[f"{drive}.velocity"], pressed, start)
    if kind.stays_enabled:
        expected = golden.stop_ramp(abs(trace[f"{axis}.actual_velocity"].at(start)), EMERGENCY)
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
                until=until,
            ).covers("LIM-034", "LIM-036")
        )
    else:
        at_start = abs(trace[f"{drive}.velocity"].at(start)) * 1000.0
        expected = golden.drive_ramp(at_start, MAXIMUM_VELOCITY, OFF3_S)
        ctx.expect(
            ramp(
                since,
                axis=axis,
                velocity=f"{drive}.motor_speed",
                position=f"{drive}.position",
                made_by="drive",
                time_s=expected.time_s,
                time_tolerance_s=allowed.time_s,
                distance=expected.distance * 0.001,
                distance_tolerance=allowed.distance * 0.001,
                threshold=6.0,
                until=until,
                delay_s=cycles(ctx, 5),
            ).covers("LIM-033")
        )
    # What the machine builder has to leave free behind the switch: the way of the detection and of the ramp.
    braking = EMERGENCY if kind.stays_enabled else MAXIMUM_VELOCITY / OFF3_S
    clear = golden.switch_clearance(fastest, braking, detection_s=detection_s(ctx, 5) + bounces_s)
    way = abs(trace[f"{drive}.position"].at(until) - trace[f"{drive}.position"].at(pressed)) * 1000.0
    ctx.measure(
        "travel of the machine behind the switch",
        way,
        "mm",
        low=golden.stop_distance(speed, braking) * 0.9,
        high=clear + allowed.distance,
    )


def _speeds(velocity: Any, pressed: float, start: float) -> tuple[float, float]:
    """Return the speed at the switch, and the greatest one from there to the ramp, mm/s, of a velocity in
    m/s.
    """
    speed = abs(velocity.at(pressed)) * 1000.0
    return speed, max(speed, abs(velocity.at(start)) * 1000.0)


def bit_at(ctx: CaseContext, bit: int, state: bool, at: float | None = None) -> Any:
    """Expect a bit of the status word, by default now."""
    return status_word_bit(bit, state, at=ctx.now_s if at is None else at, axis=axis_name(ctx))


def refused(ctx: CaseContext, velocity: float, *, cause: str = "LIM-059") -> None:
    """Expect 531 again and 16#8001 for a motion with `velocity` that the switch forbids, and hardly any
    motion.
    """
    drive = drive_name(ctx)
    since = ctx.now_s
    ctx.do(f"MC_MoveVelocity {velocity:g} mm/s: not allowed here")
    job = ctx.axis.move_velocity(velocity, **DYNAMICS)
    ctx.run_for(0.15 + cycles(ctx, 0))
    ctx.expect(
        job_output(job.name, "Error", since=since, error_id=0x8001).covers(cause),
        alarm(531, since=since, within_s=cycles(ctx, 4), axis=axis_name(ctx)).covers(cause),
        no_motion_after(since, position=f"{drive}.position", tolerance=0.0005, until=ctx.now_s),
    )


def retracts(ctx: CaseContext, distance: float) -> None:
    """Expect a positioning by `distance` to be done without an alarm."""
    since = ctx.now_s
    ctx.do(f"MC_MoveRelative {distance:g} mm: away from the limit")
    job = ctx.axis.move_relative(distance, Velocity=200.0, **DYNAMICS)
    ctx.wait_until(job.ended, 5.0, "the retraction ends")
    ctx.expect(
        job_output(job.name, "Done", since=since).covers("LIM-048", "LIM-057"),
        no_alarm(since=since, until=ctx.now_s, axis=axis_name(ctx)),
    )
