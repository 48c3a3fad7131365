"""Cases of `motion_in`: bus, drive, encoder, machine, controller and program fail under setpoints that come
from outside.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    alarm,
    never_happens,
    no_alarm,
    state_at,
    stays_within,
    value_at,
)
from hil.record import event
from testcases.campaigns._motion_in import (
    EXACT,
    FAULT_SPEED,
    MODES,
    Program,
    ends_with,
    permit,
    ramp_to,
    takes_part,
    trapezoid,
    under_way,
)
from testcases.campaigns._profiles import by_profile, encoder_increments_per_revolution, of_profile
from testcases.campaigns._reactions import machine_at_rest, recovers, stopped_for_good
from testcases.campaigns.support import (
    acknowledge,
    axis_name,
    can_segment,
    drive_name,
    enable,
    grace_s,
    settle_s,
)

CASES: Final = Campaign("motion in", tags=("motion-in", "fault"), bench="reference")


def _frames_lost(ctx: CaseContext, message: str) -> None:
    lost_s = grace_s(ctx) + 0.6
    ctx.inject("frame.drop", can_segment(ctx), message=message, duration_s=lost_s)


def _jump(ctx: CaseContext) -> None:
    # 6 mm on a screw of 10 mm: more than the permitted following error. Much more lets the motor race until
    # the drive notices.
    ctx.inject(
        "encoder.jump", drive_name(ctx), increments=round(0.6 * encoder_increments_per_revolution(ctx))
    )


_FAULTS: Final[dict[str, tuple[Callable[[CaseContext], object], int | dict[str, int], tuple[str, ...]]]] = {
    "actual-values-lost": (lambda ctx: _frames_lost(ctx, "tpdo1"), 431, ("STP-574",)),
    "setpoints-lost": (
        lambda ctx: _frames_lost(ctx, "rpdo1"),
        {"cia402": 550, "profidrive": 431},
        ("STP-561",),
    ),
    "drive-fault": (
        lambda ctx: ctx.inject("drive.fault", drive_name(ctx), code=0x2310, duration_s=0.3),
        421,
        ("STP-559",),
    ),
    "encoder-wire-break": (
        lambda ctx: ctx.inject("encoder.wire_break", drive_name(ctx), duration_s=0.3),
        {"cia402": 421, "profidrive": 411},
        ("HOM-179",),
    ),
    "encoder-jump": (_jump, 521, ("MON-040",)),
    "jam": (lambda ctx: ctx.inject("mechanics.jam", drive_name(ctx), duration_s=0.4), 521, ("MON-040",)),
    "limit-switch": (
        lambda ctx: ctx.inject("switch.press", drive_name(ctx), input="positive_limit", duration_s=0.6),
        531,
        ("LIM-034",),
    ),
    "supply-of-the-drive": (
        lambda ctx: ctx.inject("drive.power_off", drive_name(ctx), duration_s=grace_s(ctx) + 1.0),
        431,
        ("STP-574",),
    ),
}
"""Name -> what happens, the alarm that comes of it (by profile), requirements of that alarm."""


_UNDER: Final = {
    "velocity": tuple(_FAULTS),
    "position": ("actual-values-lost", "drive-fault", "jam", "limit-switch"),
    "superimposed": ("setpoints-lost", "encoder-jump", "limit-switch"),
}


@CASES.product(
    "{fault}/{mode}",
    parameters=[{"fault": fault, "mode": mode} for mode, faults in _UNDER.items() for fault in faults],
    title="{fault} under MC_MotionIn ({mode})",
    requirements=lambda fault, mode: ("MIN-010", *_FAULTS[fault][2]),
)
def fault(ctx: CaseContext, fault: str, mode: str) -> None:
    """The alarm of any motion: Error 16#8001, further vectors do nothing, neither then nor after MC_Reset,
    until Enable rises again.
    """
    axis, name = ctx.axis, axis_name(ctx)
    permit(ctx, 4.0)
    job, program = MODES[mode](ctx, FAULT_SPEED)
    since = ctx.now_s
    inject, numbers, _ = _FAULTS[fault]
    number = numbers if isinstance(numbers, int) else of_profile(ctx, numbers)
    inject(ctx)
    ctx.run_for(1.6 + grace_s(ctx) + settle_s(ctx))
    ended = ctx.now_s
    ctx.expect(
        alarm(number, since=since, axis=name).covers("MIN-010"),
        ends_with(ctx, job, "Error", since=since, error_id=0x8001).covers("MIN-010"),
    )
    takes_part(ctx, at=ended, state=0)
    machine_at_rest(ctx, ended)
    ctx.measure("Enable is still TRUE, and vectors still come", float(job.Enable), low=1.0)
    if fault == "limit-switch":
        # Alarm 531 stays while the axis lies behind the switch; here it was a push on the switch.
        ctx.run_for(0.2)
    acknowledge(ctx)
    ctx.wait_until(axis.power_instance.status, 5.0, "the axis is enabled again without a new edge")
    ctx.run_for(0.4)
    ctx.expect(
        never_happens(event("job.started", name, job=job.name), since=since).covers("MIN-010"),
        stays_within(
            f"{name}.velocity_setpoint", low=-EXACT, high=EXACT, since=ctx.now_s - 0.2, until=ctx.now_s
        ),
    )
    program.end()
    job.set(Enable=False)
    ctx.run_for(0.02)
    if fault == "limit-switch":
        return
    ctx.do("a new instance moves on")
    late = axis.motion_in_velocity(0.0)
    Program(ctx, ramp_to(-50.0)).lead(late)
    ctx.run_for(0.4 + settle_s(ctx))
    ctx.expect(
        value_at(f"{drive_name(ctx)}.velocity", ctx.now_s, -0.05, tolerance=0.003).named("it moves again")
    )
    late.set(Enable=False)
    ctx.run_for(0.3 + settle_s(ctx))


_REACTIONS: Final = {
    1: (533, "ALARM_STANDSTILL"),
    2: (104, "ALARM_DISABLED"),
    3: (531, "ALARM_STANDSTILL"),
    4: (521, "ALARM_DISABLED"),
}
"""Reaction -> an alarm that has it, and the state in which the axis ends with that."""


@CASES.product(
    "reaction/{reaction}/{mode}",
    parameters={"reaction": (1, 2, 3, 4), "mode": ("velocity", "position")},
    title="an alarm with reaction {reaction} under MC_MotionIn ({mode})",
    requirements=("MIN-010", "STP-386", "STP-387", "STP-388"),
)
def reaction(ctx: CaseContext, reaction: int, mode: str) -> None:
    """The axis brakes as the reaction says, from the velocity that was given, and the job ends with
    16#8001.
    """
    name = axis_name(ctx)
    job, program = MODES[mode](ctx, FAULT_SPEED)
    since = ctx.now_s
    number, end = _REACTIONS[reaction]
    ctx.inject("axis.alarm", name, number=number, reaction=reaction)
    ctx.run_for(1.2 + settle_s(ctx))
    program.end()
    ended = ctx.now_s
    ctx.expect(
        ends_with(ctx, job, "Error", since=since, error_id=0x8001).covers("MIN-010"),
        state_at(name, ended, end),
    )
    stopped_for_good(ctx, ended)
    if reaction < 4:
        read = ctx.axis.variables.read
        deceleration = {
            1: read("DynamicDefaults.Deceleration"),
            2: read("DynamicLimits.MaxDeceleration"),
            3: read("DynamicDefaults.EmergencyDeceleration"),
        }[reaction]
        jerk = {1: read("DynamicDefaults.Jerk"), 2: read("DynamicLimits.MaxJerk"), 3: 0.0}[reaction]
        cycle = ctx.bench.interpolator_ns * 1e-9
        shape = deceleration**2 / jerk if jerk else 0.0
        if shape <= FAULT_SPEED:
            ramp_s = FAULT_SPEED / deceleration + (deceleration / jerk if jerk else 0.0)
        else:
            ramp_s = 2.0 * (FAULT_SPEED / jerk) ** 0.5
        setpoint = ctx.trace()[f"{name}.velocity_setpoint"]
        begins = next(one.time_ns * 1e-9 for one in ctx.trace().select(kind="alarm.raised"))
        rests = setpoint.settles(EXACT, after_s=begins)
        ctx.measure(
            "ramp to zero",
            -1.0 if rests is None else rests - begins,
            "s",
            low=ramp_s - 3 * cycle,
            high=ramp_s + 3 * cycle + ctx.bench.config.tolerance.time_s,
        )


@CASES.product(
    "software-limit/{how}",
    parameters={"how": ("approached", "jumped-past", "position-past")},
    title="the software limit switch is {how}",
    requirements=("MIN-009", "LIM-084"),
)
def software_limit(ctx: CaseContext, how: str) -> None:
    """Approached with a velocity: 533 and at rest before the limit; a position beyond it: 534."""
    axis, name = ctx.axis, axis_name(ctx)
    enable(ctx)
    ctx.wait_until(axis.home(440.0).done, 1.0, "the axis is homed 60 mm before its software limit switch")
    axis.write("PositionLimits_SW.Active", True)
    ctx.run_for(0.05)
    since = ctx.now_s
    permit(ctx, 80.0)
    if how == "approached":
        job = axis.motion_in_velocity(0.0)
        Program(ctx, ramp_to(FAULT_SPEED)).lead(job)
        number = 533
    elif how == "jumped-past":
        job = axis.motion_in_position(440.0)
        ctx.run_for(0.05)
        job.set(Position=505.0)
        number = 534
    else:
        job = axis.motion_in_position(440.0)
        profile = trapezoid(80.0, FAULT_SPEED, 800.0)
        Program(
            ctx,
            lambda t: dict(
                zip(("Position", "Velocity"), (440.0 + profile(t)[0], profile(t)[1]), strict=True)
            ),
        ).lead(job)
        number = 533
    ctx.run_for(1.6 + settle_s(ctx))
    ctx.expect(
        alarm(number, since=since, axis=name).covers("MIN-009"),
        ends_with(ctx, job, "Error", since=since, error_id=0x8001).covers("MIN-010"),
    )
    if number == 533:
        ctx.expect(
            stays_within(f"{name}.position_setpoint", high=500.0 + 1e-3, since=since).covers("MIN-009")
        )
    machine_at_rest(ctx, ctx.now_s)


@CASES.product(
    "telegram/{kind}",
    parameters={"kind": ("freeze", "late", "sign_of_life")},
    title="the telegram of the drive: {kind}",
    tags=("telegram",),
    requirements=("MIN-010", "PD-132"),
)
def telegram(ctx: CaseContext, kind: str) -> None:
    """Frozen, late or without sign of life: the motion ends by an alarm, or goes on where the telegram is
    late only.
    """
    ctx.require(by_profile(ctx, cia402=False, profidrive=True), "a drive with a PROFIdrive telegram")
    name = axis_name(ctx)
    job, program = under_way(ctx, FAULT_SPEED)
    since = ctx.now_s
    options: dict[str, Any] = (
        {"cycles": 1} if kind == "late" else {"how": "freeze"} if kind == "sign_of_life" else {}
    )
    ctx.inject(f"telegram.{kind}", drive_name(ctx), direction="actual", duration_s=0.4, **options)
    ctx.run_for(1.6 + settle_s(ctx))
    program.end()
    if kind == "late":
        ctx.expect(no_alarm(since=since, axis=name, besides=(522,)))
        ctx.measure("Busy", float(job.Busy), low=1.0)
        job.set(Enable=False)
        ctx.run_for(0.3 + settle_s(ctx))
        return
    ctx.expect(
        alarm(431, since=since, axis=name),
        ends_with(ctx, job, "Error", since=since, error_id=0x8001).covers("MIN-010"),
    )
    machine_at_rest(ctx, ctx.now_s)
    recovers(ctx)
