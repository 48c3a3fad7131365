"""Borders of limits and monitoring on any machine: just below, just above, and at the border.

All numbers come from the bench file: places are ways of the axis, velocities shares of its maximum, times
whole cycles. So the same few cases run on machines of any unit, direction, gear, encoder and cycle.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from hil.expect import no_alarm
from testcases.campaigns._loop import permitted
from testcases.campaigns._monitoring_standstill import agrees
from testcases.campaigns._reactions import cycles
from testcases.campaigns.own_axis import Own, own
from testcases.campaigns.support import axis_name, drive_name, enable, equal

SIGN: Final = {"negative": -1.0, "positive": 1.0}
_BITS: Final = {"negative": 15, "positive": 16}
_SWITCH_BITS: Final = {"negative": 17, "positive": 18}
_REACHED: Final = 533
_SWITCH: Final = 531
_FOLLOWING_ERROR: Final = 521

CAMPAIGN: Final = Campaign(
    "axis borders",
    tags=("axis", "limits", "monitoring"),
    bench="reference",
    needs={"motion": ("linear", "rotary"), "play": "none", "load": "not heavy"},
)


def _homed(ctx: CaseContext) -> Own:
    """Enable the axis and call the place where it stands 0."""
    enable(ctx)
    ctx.wait_until(ctx.axis.home(0.0).done, 2.0, "the axis is homed")
    return own(ctx)


def _numbers(ctx: CaseContext) -> list[int]:
    """Return the alarms so far."""
    return [int(e.data["number"]) for e in ctx.trace().select(source=axis_name(ctx), kind="alarm.raised")]


def _setpoint(ctx: CaseContext) -> float:
    return float(ctx.trace()[f"{axis_name(ctx)}.position_setpoint"].values[-1])


@CAMPAIGN.product(
    "software-limit/{side}/{behaviour}",
    parameters={"side": tuple(SIGN), "behaviour": (0, 1)},
    title="software limit, {side} side, LimitReachedBehavior {behaviour}",
    requirements=("LIM-072", "LIM-075", "LIM-082"),
)
def software_limit(ctx: CaseContext, side: str, behaviour: int) -> None:
    """A target just inside is reached without a word, one at the limit, too; a motion outwards stops exactly
    at the limit with 533; the way back is free.
    """
    ctx.axis.variables.write_start("PositionLimits_SW.LimitReachedBehavior", behaviour)
    ctx.wait_until(ctx.axis.reset(restart=True).done, 5.0, "the axis is restarted")
    values = _homed(ctx)
    sign, bit, other = SIGN[side], _BITS[side], _BITS["positive" if side == "negative" else "negative"]
    low, high = -values.way(values.draw("low", 0.2, 0.22)), values.way(values.draw("high", 0.23, 0.25))
    limit = high if sign > 0 else low
    for name, value in (("MinPosition", low), ("MaxPosition", high), ("Active", True)):
        ctx.axis.write(f"PositionLimits_SW.{name}", value)
    ctx.run_for(cycles(ctx, 2))
    speed = {"Velocity": values.given(values.speed(0.4)), **values.dynamics().inputs}
    inside = limit - sign * 20.0 * values.still
    ctx.wait_until(ctx.axis.move_absolute(inside, **speed).done, 5.0, "a place just inside is reached")
    equal(ctx, f"X{bit} just inside", ctx.axis.var(f"StatusWord.X{bit}"), 0.0, "LIM-082")
    ctx.wait_until(ctx.axis.move_absolute(limit, **speed).done, 5.0, "the limit is reached")
    ctx.run_for(cycles(ctx, 2))
    equal(ctx, f"X{bit} at the limit", ctx.axis.var(f"StatusWord.X{bit}"), 1.0, "LIM-082")
    ctx.wait_until(ctx.axis.move_absolute(0.0, **speed).done, 5.0, "the axis is back")
    equal(ctx, f"X{bit} at 0", ctx.axis.var(f"StatusWord.X{bit}"), 0.0, "LIM-082")
    expected = [_REACHED] if _REACHED in _numbers(ctx) else []
    job = ctx.axis.move_velocity(sign * speed["Velocity"], **values.dynamics("out").inputs)
    ctx.wait_until(lambda: job.Error, 5.0, "the job ends in front of the limit")
    ctx.run_for(0.6)
    equal(ctx, "ErrorID", job.ErrorID, 0x8001, "LIM-075")
    near = 1e-6 * (high - low)
    equal(ctx, "place of the setpoint beyond the limit", _setpoint(ctx) - limit, 0.0, "LIM-075", within=near)
    equal(ctx, f"X{bit}", ctx.axis.var(f"StatusWord.X{bit}"), 1.0, "LIM-082")
    equal(ctx, f"X{other}", ctx.axis.var(f"StatusWord.X{other}"), 0.0, "LIM-082")
    equal(ctx, "alarms 533", _numbers(ctx).count(_REACHED), len(expected) + 1, "LIM-075")
    equal(ctx, "enabled", ctx.axis.var("StatusWord.X0"), 1.0)
    ctx.wait_until(ctx.axis.reset().done, 2.0, "the alarm is acknowledged")
    back = ctx.axis.move_relative(-sign * values.way(0.1), **speed)
    ctx.wait_until(back.done, 5.0, "the way back is free")
    equal(ctx, f"X{bit} inside again", ctx.axis.var(f"StatusWord.X{bit}"), 0.0, "LIM-082")


@CAMPAIGN.product(
    "switch/{side}",
    parameters={"side": tuple(SIGN)},
    title="hardware limit switch, {side} side",
    requirements=("LIM-031", "LIM-034"),
    needs={"switches": "not none", "software-limits": "off"},
)
def switch(ctx: CaseContext, side: str) -> None:
    """The load travels onto the switch: 531 when it is there, not before, and within filter and cycles; the
    stop is the emergency ramp; the way back is free.
    """
    values, sign, drive = _homed(ctx), SIGN[side], drive_name(ctx)
    config = ctx.bench.config
    table = config.drive[drive].switches
    switch_mm = table.positive_limit_mm if sign > 0 else table.negative_limit_mm
    velocity = values.speed(0.5)
    job = ctx.axis.move_velocity(values.given(sign * velocity), **values.dynamics().inputs)
    ctx.wait_until(lambda: job.Error, 10.0, "the switch is reached")
    ctx.run_for(0.5 + values.settling_s)
    trace, axis = ctx.trace(), axis_name(ctx)
    raised = next(e for e in trace.select(source=axis, kind="alarm.raised") if e.data["number"] == _SWITCH)
    when = raised.time_ns * 1e-9
    machine = trace[f"{drive}.position"]
    beyond = sign * (machine.at(when) * 1000.0 - switch_mm) * 1e-3 / values.golden.machine_m
    filter_s = config.input_filter_s(axis, f"{side}_limit")
    late_s = filter_s + cycles(ctx, 4) + 2.0 * ctx.bench.golden().cycle_s
    if str(getattr(ctx.bench.segment(), "kind", "")).startswith("modbus"):
        late_s += 3.0 * ctx.bench.golden().cycle_s
    ctx.measure(
        "place of the load behind the switch when 531 comes",
        beyond,
        values.unit,
        low=0.4 * velocity * filter_s - values.still,
        high=velocity * late_s + values.still,
        requirements=("LIM-034",),
    )
    emergency = values.golden.emergency(velocity)
    rest = sign * (float(machine.values[-1]) - machine.at(when)) / values.golden.machine_m
    slack = velocity * cycles(ctx, 4) + 0.1 * emergency.distance + 3.0 * values.still
    ctx.measure(
        "way from there to rest",
        rest,
        values.unit,
        low=emergency.distance - slack,
        high=emergency.distance + slack + velocity / values.kv,
        requirements=("LIM-034",),
    )
    bit, other = _SWITCH_BITS[side], _SWITCH_BITS["positive" if side == "negative" else "negative"]
    equal(ctx, f"X{bit}", ctx.axis.var(f"StatusWord.X{bit}"), 1.0)
    equal(ctx, f"X{other}", ctx.axis.var(f"StatusWord.X{other}"), 0.0)
    ctx.wait_until(ctx.axis.reset().done, 2.0, "the alarm is acknowledged")
    way = 2.0 * abs(beyond) + 2.0 * emergency.distance + values.way(0.06)
    back = ctx.axis.move_relative(-sign * way, Velocity=values.given(values.speed(0.3)))
    ctx.wait_until(back.done, 5.0, "the way back is free")
    ctx.run_for(filter_s + cycles(ctx, 4))
    equal(ctx, f"X{bit} in the end", ctx.axis.var(f"StatusWord.X{bit}"), 0.0)
    equal(ctx, "alarms", len(_numbers(ctx)), 1.0)


@CAMPAIGN.product(
    "following-error/{border}",
    parameters={"border": ("below", "above")},
    title="a following error just {border} what is permitted",
    requirements=("MON-038",),
    needs={"precontrol": ("none", "part"), "dsc": "off"},
)
def following_error(ctx: CaseContext, border: str) -> None:
    """The lag of a constant velocity is measured: 2 % less as limit is an alarm, 2 % more is none."""
    values, axis = _homed(ctx), axis_name(ctx)
    if values.kpc >= 100.0:
        ctx.axis.write("PositionControl.Kpc", 0.0)
        ctx.run_for(cycles(ctx, 2))
    velocity = values.speed(0.3)
    for name in ("MinValue", "MaxValue"):
        ctx.axis.write(f"FollowingError.{name}", velocity)
    job = ctx.axis.move_velocity(values.given(velocity), **values.dynamics().inputs)
    ctx.wait_until(job.in_velocity, 3.0, "the velocity is reached")
    ctx.run_for(0.1 + 1.2 * values.settling_s)
    error = np.abs(ctx.trace()[f"{axis}.following_error"].values[-20:])
    least, most = float(error.min()), float(error.max())
    limit = 1.02 * most + values.increment if border == "below" else 0.98 * least - values.increment
    for name in ("MinValue", "MaxValue"):
        ctx.axis.write(f"FollowingError.{name}", limit)
    equal(ctx, "permitted", permitted(ctx, values.given(velocity)), limit, "MON-038", within=1e-6 * limit)
    ctx.run_for(0.1)
    number = _FOLLOWING_ERROR
    equal(ctx, "alarms 521", _numbers(ctx).count(number), float(border == "above"), "MON-038")


@CAMPAIGN.product(
    "standstill/{percent}",
    parameters={"percent": (90, 120)},
    title="{percent} % of the threshold of the standstill signal",
    requirements=("MON-047", "MON-048"),
    needs={"interpolator": "1"},
)
def standstill(ctx: CaseContext, percent: int) -> None:
    """X7 in every cycle is what the rule makes of the actual velocity, on the way to a constant velocity just
    below or above the threshold and back.
    """
    values = _homed(ctx)
    noise = values.increment / values.golden.cycle_s
    threshold = max(values.speed(0.1), 40.0 * noise)
    ctx.require(1.2 * threshold < values.speed(0.6), "an encoder fine enough to tell 10 % of a velocity")
    dwell = 7.0 * float(ctx.bench.golden().cycle_s)
    for name, value in (("VelocityThreshold", values.given(threshold)), ("MinDwellTime", dwell)):
        ctx.axis.variables.write_start(f"StandstillSignal.{name}", value)
    ctx.axis.power(False)
    ctx.run_for(0.5)
    ctx.wait_until(ctx.axis.reset(restart=True).done, 5.0, "the axis is restarted")
    enable(ctx)
    ctx.run_for(dwell + 0.05)
    since = ctx.now_s
    dynamics: dict[str, Any] = values.dynamics().without_jerk().inputs
    fast = ctx.axis.move_velocity(values.given(2.0 * threshold), **dynamics)
    ctx.wait_until(fast.in_velocity, 3.0, "it is faster than the threshold")
    slow = ctx.axis.move_velocity(values.given(percent / 100.0 * threshold), **dynamics)
    ctx.wait_until(slow.in_velocity, 3.0, "the velocity near the threshold is reached")
    ctx.run_for(dwell + 0.1 + values.settling_s * (values.kpc < 100.0))
    equal(ctx, "X7", ctx.axis.var("StatusWord.X7"), float(percent < 100), "MON-048")
    ctx.wait_until(ctx.axis.halt().done, 3.0, "the axis has halted")
    ctx.run_for(dwell + 0.05)
    agrees(ctx, since, threshold, dwell)
    ctx.expect(no_alarm(axis=axis_name(ctx)))
