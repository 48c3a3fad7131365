"""Cases of `limits`: hardware limit switches that lie: bouncing, stuck, wired wrongly, both active,
monitoring switched off.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, happens, job_output, no_alarm, no_motion_after, state_at, value_at
from hil.record import EventSelector, event
from testcases.campaigns._limits import (
    DYNAMICS,
    HARDWARE_BIT,
    KINDS,
    OTHER,
    SIGN,
    bit_at,
    configure,
    refused,
    retracts,
    stopped_on_ramp,
    tell_stop,
)
from testcases.campaigns._reactions import cycles, detection_s, disabled_by_alarm, stopped_for_good
from testcases.campaigns.support import (
    VELOCITY,
    acknowledge,
    acknowledge_and_enable,
    axis_name,
    bring_into,
    drive_name,
    enable,
    settle_s,
)

CASES: Final = Campaign("limits", tags=("limits", "wiring"), bench="reference")
HARDWARE: Final = 531
MONITORING: Final = 1000
"""Parameter of `MC_WriteParameter` that switches the monitoring of the hardware limit switches."""


def _raised(ctx: CaseContext, info: int) -> EventSelector:
    """Select alarm 531 with a cause: 1 and 2 the switch, 3 the direction, 4 reversed, 5 both."""
    return event("alarm.raised", axis_name(ctx), number=HARDWARE, info=info)


def _monitor(ctx: CaseContext, on: bool) -> None:
    """Switch the monitoring, and expect that to be done."""
    since = ctx.now_s
    ctx.do(f"MC_WriteParameter 1000 = {str(on).upper()}")
    job = ctx.axis.write_parameter(MONITORING, on)
    ctx.run_for(cycles(ctx, 3))
    ctx.expect(job_output(job.name, "Done", since=since).covers("LIM-065"))


def _runs_free(ctx: CaseContext, sign: int) -> None:
    """Expect motion in both directions, without an alarm (LIM-063)."""
    since = ctx.now_s
    for distance in (-6.0 * sign, 6.0 * sign, -12.0 * sign):
        job = ctx.axis.move_relative(distance, Velocity=200.0, **DYNAMICS)
        ctx.wait_until(job.ended, 5.0, "the motion ends")
        ctx.expect(job_output(job.name, "Done", since=since).covers("LIM-063"))
    ctx.expect(no_alarm(since=since, until=ctx.now_s, axis=axis_name(ctx)))


@CASES.product(
    "bounces/{side}/{kind}/{pulses}",
    parameters={"side": tuple(SIGN), "kind": tuple(KINDS), "pulses": (1, 12)},
    title="{side} switch ({kind}) bounces with {pulses} pulses",
    tags=("bounce", "{kind}"),
    requirements=("LIM-105", "LIM-031"),
)
def bounces(ctx: CaseContext, side: str, kind: str, pulses: int) -> None:
    """One alarm, one stop: what follows changes neither the reaction nor its ramp."""
    axis, drive = axis_name(ctx), drive_name(ctx)
    wanted = configure(ctx, kind)
    enable(ctx)
    job = bring_into(ctx, "constant", direction=SIGN[side])
    ctx.inject(
        "switch.bounce", drive, input=f"{side}_limit", pulses=pulses, shortest_s=0.0015, longest_s=0.006
    )
    longest_s = 2 * pulses * 0.006
    ctx.run_for(0.7 + settle_s(ctx))
    hit = event("fault.applied")
    ctx.expect(
        alarm(
            HARDWARE,
            reaction=wanted.reaction,
            since=hit,
            within_s=longest_s + detection_s(ctx, 3),
            axis=axis,
        ).covers("LIM-105"),
        job_output(job.name, "Error", since=hit, error_id=0x8001),
        bit_at(ctx, HARDWARE_BIT[side], True),
    )
    raised = sum(1 for one in ctx.trace().select(source=axis, kind="alarm.raised"))
    ctx.measure("alarms of one bouncing switch", raised, low=1, high=1, requirements=("LIM-031",))
    stopped_on_ramp(ctx, wanted, hit=hit, until=ctx.now_s, moving=True, bounces_s=longest_s)


@CASES.product(
    "bounces-when-left/{side}/{kind}",
    parameters={"side": tuple(SIGN), "kind": tuple(KINDS)},
    title="{side} switch ({kind}) bounces while the axis leaves it",
    tags=("bounce", "{kind}"),
    requirements=("LIM-105", "LIM-055"),
)
def bounces_when_left(ctx: CaseContext, side: str, kind: str) -> None:
    """On the way back the contact opens and closes: a live switch alarms at each closing, one that is held
    does not.
    """
    sign, axis, drive = SIGN[side], axis_name(ctx), drive_name(ctx)
    wanted = configure(ctx, kind)
    enable(ctx)
    bring_into(ctx, "constant", direction=sign)
    press = ctx.inject("switch.press", drive, input=f"{side}_limit")
    ctx.run_for(0.6 + settle_s(ctx))
    press.remove()
    ctx.run_for(detection_s(ctx, 3))
    acknowledge_and_enable(ctx)
    back = ctx.axis.move_velocity(-60.0 * sign, **DYNAMICS)
    ctx.run_for(0.1)
    since = ctx.now_s
    again = ctx.inject("switch.press", drive, input=f"{side}_limit")
    ctx.run_for(0.3 + settle_s(ctx))
    again.remove()
    if wanted.mode == 1:
        # Held since it was met, and moved over in the direction of retraction: no new alarm (section 1.5).
        ctx.expect(no_alarm(since=since, until=ctx.now_s, axis=axis).covers("LIM-046"))
        return
    # Live, it had been left already: closing again it is met from the wrong side, which is a polarity that is
    # reversed.
    ctx.expect(
        happens(_raised(ctx, 4), since=since, within_s=detection_s(ctx, 4)).covers("LIM-055", "LIM-062"),
        job_output(back.name, "Error", since=since, error_id=0x8001),
    )


@CASES.product(
    "stuck-free/{side}/{kind}",
    parameters={"side": tuple(SIGN), "kind": ("braking", "traversable")},
    title="{side} switch ({kind}) stuck free: the end stop stops the load",
    tags=("stuck",),
    requirements=("LIM-105", "MON-040"),
    without=("STP-331",),
)
def stuck_free(ctx: CaseContext, side: str, kind: str) -> None:
    """A normally open contact with a broken wire: nobody sees the switch, the axis meets the end stop,
    521.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    configure(ctx, kind)
    enable(ctx)
    ctx.inject("switch.stuck", drive, input=f"{side}_limit", state=False)
    ctx.do("MC_MoveVelocity 500 mm/s towards the end stop")
    job = ctx.axis.move_velocity(500.0 * SIGN[side], Acceleration=2000.0, Jerk=0.0)
    ctx.wait_until(job.error, 10.0, "the end stop has stopped the axis")
    ctx.run_for(1.0 + settle_s(ctx))
    ctx.expect(
        alarm(521, reaction=4, axis=axis).covers("MON-040"),
        bit_at(ctx, HARDWARE_BIT[side], False).covers("LIM-105"),
    )
    stopped_for_good(ctx, ctx.now_s)
    disabled_by_alarm(ctx, ctx.now_s)


@CASES.product(
    "stuck-actuated/{side}/{kind}",
    parameters={"side": tuple(SIGN), "kind": tuple(KINDS)},
    title="{side} switch ({kind}) stuck actuated",
    tags=("stuck", "{kind}"),
    requirements=("LIM-105", "LIM-059"),
)
def stuck_actuated(ctx: CaseContext, side: str, kind: str) -> None:
    """However far the axis comes back, it may not go outwards again; repaired, it may."""
    sign, drive = SIGN[side], drive_name(ctx)
    wanted = configure(ctx, kind)
    enable(ctx)
    job = bring_into(ctx, "constant", direction=sign)
    stuck = ctx.inject("switch.stuck", drive, input=f"{side}_limit", state=True)
    ctx.run_for(0.6 + settle_s(ctx))
    tell_stop(ctx, wanted, side, [job], hit=event("fault.applied"))
    acknowledge_and_enable(ctx)
    retracts(ctx, -90.0 * sign)
    ctx.expect(bit_at(ctx, HARDWARE_BIT[side], True))
    refused(ctx, 30.0 * sign)
    stuck.remove()
    acknowledge_and_enable(ctx)
    ctx.run_for(cycles(ctx, 3))
    ctx.expect(bit_at(ctx, HARDWARE_BIT[side], False))
    retracts(ctx, 5.0 * sign)


@CASES.product(
    "wire-break/{side}/{contact}",
    parameters={"side": tuple(SIGN), "contact": ("normally-closed", "normally-open")},
    title="wire of the {side} switch ({contact}) breaks",
    tags=("wire",),
    requirements=("LIM-014", "LIM-015", "LIM-023", "LIM-024", "LIM-105"),
)
def wire_break(ctx: CaseContext, side: str, contact: str) -> None:
    """A normally closed contact on an input that is active low stops the axis; a normally open one says
    nothing.
    """
    sign, axis, drive = SIGN[side], axis_name(ctx), drive_name(ctx)
    closed = contact == "normally-closed"
    names = [f"{one}_limit" for one in SIGN]
    level = not closed
    if closed:
        _monitor(ctx, False)  # until their level is configured too, the contacts mean the opposite
        for name in names:
            ctx.inject("switch.inverted", drive, input=name)
    wanted = configure(
        ctx, "braking", PositionLimits_HW__MinSwitchLevel=level, PositionLimits_HW__MaxSwitchLevel=level
    )
    enable(ctx)
    job = bring_into(ctx, "constant", direction=sign)
    since = ctx.now_s
    ctx.inject("switch.stuck", drive, input=f"{side}_limit", state=False)
    hit = event("fault.applied", nth=3 if closed else 1)
    ctx.run_for(0.25 + settle_s(ctx))
    if closed:
        tell_stop(ctx, wanted, side, [job], hit=hit)
        stopped_on_ramp(ctx, wanted, hit=hit, until=ctx.now_s, moving=True)
    else:
        ctx.expect(
            no_alarm(since=since, axis=axis).covers("LIM-024"),
            value_at(f"{axis}.velocity_setpoint", ctx.now_s, VELOCITY * sign, tolerance=1e-6),
        )


@CASES.product(
    "level-wrong/{side}",
    parameters={"side": tuple(SIGN)},
    title="{side} switch is configured with the wrong level",
    tags=("wiring",),
    requirements=("LIM-023", "LIM-041"),
)
def level_wrong(ctx: CaseContext, side: str) -> None:
    """Active low for a contact that closes: 531 as soon as the restart is over, far from the switch; outwards
    refused.
    """
    sign, axis = SIGN[side], axis_name(ctx)
    end = "Max" if sign > 0 else "Min"
    since = ctx.now_s
    configure(ctx, "braking", **{f"PositionLimits_HW__{end}SwitchLevel": False})
    ctx.run_for(0.02)
    ctx.expect(
        alarm(HARDWARE, reaction=3, since=since, axis=axis).covers("LIM-041"),
        bit_at(ctx, HARDWARE_BIT[side], True).covers("LIM-023"),
        bit_at(ctx, HARDWARE_BIT[OTHER[side]], False),
        state_at(axis, ctx.now_s, "ALARM_DISABLED"),
    )
    acknowledge(ctx)
    enable(ctx)
    refused(ctx, 30.0 * sign)
    acknowledge_and_enable(ctx)
    retracts(ctx, -5.0 * sign)


@CASES.product(
    "swapped/{side}/{kind}",
    parameters={"side": tuple(SIGN), "kind": tuple(KINDS)},
    title="limit switches ({kind}) swapped, motion to the {side} one",
    tags=("wiring", "{kind}"),
    requirements=("LIM-062", "LIM-063", "LIM-064", "TA-016"),
)
def swapped(ctx: CaseContext, side: str, kind: str) -> None:
    """The other switch comes: reversed, no way out in either direction; a traversable pair needs a restart;
    1000 frees the axis.
    """
    sign, axis, drive = SIGN[side], axis_name(ctx), drive_name(ctx)
    wanted = configure(ctx, kind)
    enable(ctx)
    ctx.inject("switch.swapped", drive)
    job = bring_into(ctx, "constant", direction=sign)
    press = ctx.inject("switch.press", drive, input=f"{side}_limit")
    hit = event("fault.applied", nth=2)
    ctx.run_for(0.6 + settle_s(ctx))
    tell_stop(ctx, wanted, OTHER[side], [job], hit=hit)
    ctx.expect(happens(_raised(ctx, 4), since=hit).covers("LIM-062"))
    stopped_on_ramp(ctx, wanted, hit=hit, until=ctx.now_s, moving=True)
    if wanted.mode == 1:
        acknowledge(ctx)
        ctx.expect(value_at(f"{axis}.alarm_number", ctx.now_s, HARDWARE, tolerance=0.0).covers("LIM-064"))
        return
    for direction in (1, -1):
        acknowledge_and_enable(ctx)
        refused(ctx, 30.0 * direction, cause="LIM-062")
    _monitor(ctx, False)
    acknowledge_and_enable(ctx)
    _runs_free(ctx, sign)
    press.remove()
    ctx.run_for(detection_s(ctx, 2))
    _monitor(ctx, True)
    ctx.expect(no_alarm(since=ctx.now_s - 0.01, axis=axis))


@CASES.product(
    "both/{kind}/{motion}",
    parameters={"kind": tuple(KINDS), "motion": ("constant", "standstill")},
    title="both limit switches ({kind}) active, {motion}",
    tags=("wiring", "{kind}"),
    requirements=("LIM-061", "LIM-063", "LIM-064", "TA-016"),
)
def both(ctx: CaseContext, kind: str, motion: str) -> None:
    """Both bits, cause 5, no way out: non-traversable switches are freed by 1000, traversable ones by a
    restart.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    wanted = configure(ctx, kind)
    power = enable(ctx)
    bring_into(ctx, motion)
    presses = [ctx.inject("switch.press", drive, input=f"{one}_limit") for one in SIGN]
    hit = event("fault.applied")
    ctx.run_for(0.6 + settle_s(ctx))
    ctx.expect(
        happens(_raised(ctx, 5), since=hit, within_s=detection_s(ctx, 3)).covers("LIM-061"),
        bit_at(ctx, 17, True).covers("LIM-061"),
        bit_at(ctx, 18, True).covers("LIM-061"),
    )
    stopped_on_ramp(ctx, wanted, hit=hit, until=ctx.now_s, moving=motion != "standstill")
    if wanted.mode == 1:
        acknowledge(ctx)
        ctx.expect(value_at(f"{axis}.alarm_number", ctx.now_s, HARDWARE, tolerance=0.0).covers("LIM-064"))
        for press in presses:
            press.remove()
        power.set(Enable=False)
        ctx.run_for(0.1)
        ctx.wait_until(ctx.axis.reset(restart=True).done, 5.0, "the axis is restarted")
        ctx.run_for(0.02)
        enable(ctx)
        _runs_free(ctx, 1)
        return
    for direction in (1, -1):
        acknowledge_and_enable(ctx)
        refused(ctx, 30.0 * direction, cause="LIM-061")
    _monitor(ctx, False)
    acknowledge_and_enable(ctx)
    _runs_free(ctx, 1)


@CASES.product(
    "monitoring-off/{side}/{kind}",
    parameters={"side": tuple(SIGN), "kind": tuple(KINDS)},
    title="{side} switch ({kind}) with the monitoring off",
    tags=("monitoring", "{kind}"),
    requirements=("LIM-003", "LIM-013", "LIM-041", "LIM-065", "LIM-068"),
)
def monitoring_off(ctx: CaseContext, side: str, kind: str) -> None:
    """Switched off while the axis moves, the switch is nothing; switched on again on it, 531 comes once, and
    inwards is free.
    """
    sign, axis, drive, bit = SIGN[side], axis_name(ctx), drive_name(ctx), HARDWARE_BIT[side]
    wanted = configure(ctx, kind)
    enable(ctx)
    job = bring_into(ctx, "constant", direction=sign)
    _monitor(ctx, False)
    since = ctx.now_s
    press = ctx.inject("switch.press", drive, input=f"{side}_limit")
    ctx.run_for(0.1)
    ctx.expect(
        no_alarm(since=since, until=ctx.now_s, axis=axis).covers("LIM-003"),
        bit_at(ctx, bit, False).covers("LIM-003"),
        value_at(f"{axis}.velocity_setpoint", ctx.now_s, VELOCITY * sign, tolerance=1e-6),
    )
    on = ctx.now_s
    _monitor(ctx, True)
    ctx.run_for(0.6 + settle_s(ctx))
    ctx.expect(
        alarm(HARDWARE, reaction=wanted.reaction, since=on, within_s=cycles(ctx, 3), axis=axis).covers(
            "LIM-041"
        ),
        bit_at(ctx, bit, True),
        job_output(job.name, "Error", since=on, error_id=0x8001),
        no_motion_after(ctx.now_s - 0.05, position=f"{drive}.position", tolerance=0.00005, until=ctx.now_s),
    )
    acknowledge_and_enable(ctx)
    refused(ctx, 30.0 * sign)
    acknowledge_and_enable(ctx)
    retracts(ctx, -10.0 * sign)
    # Off forgets what was known, the place of a traversable switch too (LIM-052).
    _monitor(ctx, False)
    ctx.run_for(cycles(ctx, 1))
    ctx.expect(bit_at(ctx, bit, False).covers("LIM-052"))
    press.remove()
    ctx.run_for(detection_s(ctx, 1))
    _monitor(ctx, True)
    retracts(ctx, 5.0 * sign)


@CASES.product(
    "kept/{by}",
    parameters={"by": ("run-stop-run", "restart")},
    title="monitoring that was switched off, after {by}",
    tags=("monitoring",),
    requirements=("LIM-066", "LIM-067"),
)
def kept(ctx: CaseContext, by: str) -> None:
    """RUN to STOP to RUN keeps what index 1000 has set; a restart of the object brings the configured value
    back.
    """
    axis, drive = axis_name(ctx), drive_name(ctx)
    configure(ctx, "braking")
    _monitor(ctx, False)
    if by == "restart":
        ctx.wait_until(ctx.axis.reset(restart=True).done, 5.0, "the axis is restarted")
    else:
        ctx.do("RUN, STOP, RUN")
        ctx.bench.controller.stop()
        ctx.wait_until(lambda: ctx.bench.controller.state.value == "STOP", 5.0, "STOP")
        ctx.bench.controller.run()
        ctx.wait_until(lambda: ctx.bench.controller.state.value == "RUN", 5.0, "RUN")
        ctx.run_for(0.1)
    since = ctx.now_s
    ctx.inject("switch.press", drive, input="positive_limit")
    ctx.run_for(0.05)
    if by == "restart":
        ctx.expect(alarm(HARDWARE, since=since, axis=axis).covers("LIM-067"))
    else:
        ctx.expect(no_alarm(since=since, axis=axis).covers("LIM-066"))
