"""Cases of `commissioning`: the life sign fails, bus, drive, machine and controller fail, and an operator
goes on afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import (
    alarm,
    happens,
    job_output,
    never_happens,
    no_alarm,
    state_at,
    status_word_bit,
    value_at,
)
from hil.record import event
from testcases.campaigns._commissioning import MONITORING_S, Operator, at_rest, greatest_deceleration
from testcases.campaigns._profiles import of_profile
from testcases.campaigns._reactions import cycles, machine_at_rest
from testcases.campaigns.support import axis_name, can_segment, drive_name, enable, grace_s, settle_s

CASES: Final = Campaign("commissioning", tags=("panel", "fault"), bench="reference")

_LOST: Final = 0x8013


@CASES.product(
    "heartbeat-every/{share}",
    parameters={"share": (0.5, 0.9, 1.1, 5.0)},
    title="a sign of life every {share} monitoring times",
    requirements=("COM-024", "COM-031", "COM-074"),
)
def heartbeat_every(ctx: CaseContext, share: float) -> None:
    """Up to the monitoring time control is kept; beyond it the axis stops with the greatest deceleration and
    is returned with 16#8013.
    """
    operator = Operator(ctx, alive=False)
    name = axis_name(ctx)
    operator.panel.keep_alive(0.2 * MONITORING_S)
    operator.take()
    operator.jog()
    since = ctx.now_s
    operator.panel.keep_alive(share * MONITORING_S)
    ctx.run_for(3.0 * MONITORING_S)
    kept = share < 1.0
    ctx.measure(
        "control", float(operator.panel.active), low=float(kept), high=float(kept), requirements=("COM-074",)
    )
    if kept:
        ctx.expect(
            no_alarm(since=since, axis=name),
            value_at(f"{name}.velocity_setpoint", ctx.now_s, 200.0, tolerance=1e-6),
        )
        operator.give_back()
        return
    ctx.measure("ErrorID", operator.panel.error_id, low=_LOST, high=_LOST, requirements=("COM-031",))
    ctx.expect(
        greatest_deceleration(ctx, event("axis.state", name, to="DISABLING_RAMP")),
        value_at(f"{name}.velocity_setpoint", since + 0.98 * MONITORING_S, 200.0, tolerance=1e-6)
        .named("the last setpoint goes on")
        .covers("COM-024"),
        operator.returned(since=since, within_s=2.0 * MONITORING_S, error_id=_LOST).covers("COM-031"),
        at_rest(ctx),
    )


@CASES.product(
    "connection-lost/{during}",
    parameters={"during": ("standstill", "relative", "homing", "disabled", "stopping", "alarm")},
    title="the connection of the panel is lost: {during}",
    requirements=("COM-031", "COM-032", "COM-034"),
)
def connection_lost(ctx: CaseContext, during: str) -> None:
    """Whatever the axis does it is at rest, disabled, and the program can have it again; the alarm tells what
    happened.
    """
    operator = Operator(ctx)
    name, panel = axis_name(ctx), operator.panel
    if during == "disabled":
        panel.take_control()
        ctx.run_for(0.05)
    else:
        operator.take()
    job: Any = None
    panel.velocity = 100.0
    if during == "relative":
        job = panel.move_relative(300.0)
        ctx.run_for(0.4)
    elif during == "homing":
        job = panel.home(0.0)
        ctx.run_for(0.1)
    elif during == "stopping":
        operator.jog()
        panel.deceleration = 100.0
        panel.slide(0.0)
        ctx.run_for(0.1)
    elif during == "alarm":
        operator.jog()
        ctx.inject("axis.alarm", name, number=521, reaction=4)
        ctx.run_for(0.2)
    since = ctx.now_s
    ctx.do("no sign of life any more")
    panel.disconnect()
    ctx.run_for(MONITORING_S + 1.0 + settle_s(ctx))
    ctx.expect(
        operator.returned(since=since, within_s=MONITORING_S + 0.7, error_id=_LOST).covers("COM-031"),
        alarm(204, since=since, axis=name).covers("COM-032"),
        at_rest(ctx),
        operator.has_control(at=ctx.now_s, control=False),
    )
    if job is not None:
        ctx.measure("the job has ended", float(job.Busy), high=0.0)
    machine_at_rest(ctx, ctx.now_s)
    ctx.wait_until(ctx.axis.reset().done, 3.0, "the alarm is acknowledged")
    enable(ctx)
    ctx.run_for(0.2)
    ctx.expect(state_at(name, ctx.now_s, "STANDSTILL").named("the program has the axis, and nothing moves"))


_Fault = tuple[Callable[[CaseContext], object], int | dict[str, int], int]
_FAULTS: Final[dict[str, _Fault]] = {
    "drive-fault": (
        lambda ctx: ctx.inject("drive.fault", drive_name(ctx), code=0x2310, duration_s=0.3),
        421,
        4,
    ),
    "actual-values-lost": (
        lambda ctx: ctx.inject(
            "frame.drop", can_segment(ctx), message="tpdo1", duration_s=grace_s(ctx) + 0.4
        ),
        431,
        4,
    ),
    "setpoints-lost": (
        lambda ctx: ctx.inject("frame.drop", can_segment(ctx), message="rpdo1", duration_s=0.6),
        {"cia402": 550, "profidrive": 431},
        0,
    ),
    "limit-switch": (
        lambda ctx: ctx.inject("switch.press", drive_name(ctx), input="positive_limit", duration_s=0.5),
        531,
        3,
    ),
    "jam": (lambda ctx: ctx.inject("mechanics.jam", drive_name(ctx), duration_s=0.4), 521, 4),
    "wire-break": (
        lambda ctx: ctx.inject("encoder.wire_break", drive_name(ctx), duration_s=0.3),
        {"cia402": 421, "profidrive": 411},
        4,
    ),
    "supply-of-the-drive": (
        lambda ctx: ctx.inject("drive.power_off", drive_name(ctx), duration_s=grace_s(ctx) + 0.8),
        431,
        4,
    ),
}
"""What happens, its alarm (by profile), and the reaction, 0 where the profiles differ."""


@CASES.product(
    "{fault}/{motion}",
    parameters=[
        *({"fault": fault, "motion": "jog"} for fault in _FAULTS),
        *(
            {"fault": fault, "motion": "relative"}
            for fault in ("drive-fault", "actual-values-lost", "limit-switch")
        ),
    ],
    title="{fault} while the panel moves the axis ({motion})",
    requirements=("COM-007", "COM-008", "COM-023"),
)
def fault(ctx: CaseContext, fault: str, motion: str) -> None:
    """The alarm of any motion; the panel keeps control. After the acknowledgement nothing resumes by itself,
    and an axis that the alarm has disabled stays off until the operator enables it.
    """
    operator = Operator(ctx).take()
    panel, axis, name = operator.panel, ctx.axis, axis_name(ctx)
    for path in ("FollowingError.MinValue", "FollowingError.MaxValue"):
        panel.try_value(path, 4.0)
    if motion == "jog":
        job = operator.jog(150.0)
    else:
        panel.velocity, panel.acceleration, panel.jerk = 150.0, 1000.0, 0.0
        job = panel.move_relative(400.0)
        ctx.run_for(0.4)
    since = ctx.now_s
    inject, numbers, reaction = _FAULTS[fault]
    number = numbers if isinstance(numbers, int) else of_profile(ctx, numbers)
    inject(ctx)
    ctx.run_for(1.8 + grace_s(ctx) + settle_s(ctx))
    ctx.expect(
        alarm(number, since=since, axis=name, **({"reaction": reaction} if reaction else {})),
        job_output(job.name, "Error", since=since, error_id=0x8001),
        operator.has_control(at=ctx.now_s),
        status_word_bit(1, True, at=ctx.now_s, axis=name),
    )
    machine_at_rest(ctx, ctx.now_s)
    kept = float(panel.enabled)
    ctx.do("acknowledge in the panel")
    panel.acknowledge()
    ctx.wait_until(lambda: axis.alarms.engine.number == 0, 6.0, "acknowledged")
    ctx.run_for(0.4)
    ctx.measure("enabled after the acknowledgement", float(panel.enabled), low=kept, high=kept)
    panel.enable()
    ctx.wait_until(lambda: panel.enabled, 6.0, "the axis is there again")
    ctx.run_for(0.4)
    ctx.expect(
        never_happens(event("job.started", name, job=job.name), since=since).named(
            "nothing resumes by itself"
        ),
        at_rest(ctx),
    )
    move = panel.move_relative(-20.0)
    ctx.wait_until(move.done, 5.0, "the operator moves the axis again")
    operator.give_back()


@CASES.product(
    "controller/{what}",
    parameters={"what": ("stop", "power_off", "stall", "overrun")},
    title="controller.{what} while the panel jogs",
    tags=("controller",),
    requirements=("COM-022", "COM-025", "MC-629", "MC-630"),
)
def controller(ctx: CaseContext, what: str) -> None:
    """The axis comes to rest; outside of RUN control goes, afterwards it can be taken again, and the axis
    moves for whoever has it.
    """
    operator = Operator(ctx).take()
    name = axis_name(ctx)
    operator.jog(150.0)
    since = ctx.now_s
    options: dict[str, Any] = (
        {"level": "servo", "time_ms": 1.2 * ctx.bench.cycle_ns * 1e-6} if what == "overrun" else {}
    )
    ctx.inject(f"controller.{what}", duration_s=0.8, **options)
    ctx.run_for(0.8 + settle_s(ctx))
    if what != "stall":
        # A controller that hangs says nothing of its own setpoint, only the machine does.
        ctx.expect(
            status_word_bit(4, False, at=ctx.now_s, axis=name).covers("COM-022")
            if what == "stop"
            else happens(event("controller.state"), since=since)
        )
    machine_at_rest(ctx, ctx.now_s)
    if what == "overrun":
        ctx.bench.controller.run()
    ctx.run_for(2.0)
    machine_at_rest(ctx, ctx.now_s)
    ctx.expect(at_rest(ctx))
    if operator.panel.active:
        operator.panel.acknowledge()
        ctx.run_for(1.0)
        operator.give_back()
    ctx.measure("panel without control", float(operator.panel.active), high=0.0)
    ctx.wait_until(ctx.axis.reset().done, 3.0, "acknowledged")
    operator.take()
    move = operator.panel.move_relative(-15.0)
    ctx.wait_until(move.done, 5.0, "the axis moves for the panel again")
    operator.give_back()


@CASES.case("two-panels", requirements=("COM-022", "COM-025", "COM-031"))
def two_panels(ctx: CaseContext) -> None:
    """The second one is refused as long as the first has control, also while that is being returned; after
    its loss it gets the axis.
    """
    first, second = Operator(ctx).take(), Operator(ctx)
    first.jog()
    second.refused(second.panel.take_control, "another panel has master control")
    since = ctx.now_s
    first.panel.disconnect()
    ctx.run_until(lambda: first.panel.error_id != 0, 2.0)
    second.refused(second.panel.take_control, "another panel has master control")
    first.refused(lambda: first.panel.jog(10.0), "does not have master control")
    ctx.wait_until(lambda: not first.panel.active, 3.0, "the axis is returned")
    ctx.expect(first.returned(since=since, within_s=2.0, error_id=_LOST))
    ctx.run_for(0.05)
    ctx.wait_until(ctx.axis.reset().done, 3.0, "the alarm is acknowledged")
    second.take()
    move = second.panel.move_relative(-10.0)
    ctx.wait_until(move.done, 5.0, "the second panel moves the axis")
    first.panel.release()
    ctx.run_for(0.1)
    ctx.measure("the first one releases what it does not have", float(second.panel.active), low=1.0)
    second.give_back()


@CASES.product(
    "taken-away-while/{what}",
    parameters={"what": ("enabling", "jogging", "acknowledging", "disabling")},
    title="release while {what}",
    requirements=("COM-070",),
)
def taken_away_while(ctx: CaseContext, what: str) -> None:
    """Returned at any time the axis is off and the program's again; nothing of the panel acts afterwards."""
    operator = Operator(ctx)
    panel, name = operator.panel, axis_name(ctx)
    panel.take_control()
    ctx.run_for(0.02)
    if what == "enabling":
        panel.enable()
        ctx.run_for(cycles(ctx, 2))
    else:
        panel.enable()
        ctx.wait_until(lambda: panel.enabled, 5.0, "enabled")
        operator.jog()
        if what == "acknowledging":
            ctx.inject("axis.alarm", name, number=521, reaction=4)
            ctx.run_for(0.1)
            panel.acknowledge()
        elif what == "disabling":
            panel.disable()
            ctx.run_for(0.03)
    operator.give_back()
    since = ctx.now_s
    ctx.run_for(0.5 + settle_s(ctx))
    ctx.expect(at_rest(ctx), never_happens(event("job.started", name), since=since, until=ctx.now_s))
    machine_at_rest(ctx, ctx.now_s)
    if ctx.axis.alarms.engine.number:
        ctx.wait_until(ctx.axis.reset().done, 3.0, "acknowledged")
    ctx.axis.power(False)
    ctx.run_for(0.02)
    enable(ctx)
