"""Cases of `homing`: every mark from every side and start, with and without the reversal at the limit
switches.
"""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign, CaseContext
from hil.expect import alarm, event_order, happens, never_happens, stays_within
from hil.record import event
from testcases.campaigns._homing import (
    HOMING,
    SIGN,
    Machine,
    go_to,
    home,
    homed_at,
    never_in_a_stop,
    not_homed,
    prepare,
)
from testcases.campaigns.support import axis_name

CASES: Final = Campaign("homing", tags=("homing", "active"), bench="profidrive")

STARTS: Final = ("above", "below", "on")
"""Where the load stands at the start, as seen from the cam."""


def _start(places: Machine, start: str) -> float:
    low, high = places.cam
    return {"above": high + 60.0, "below": low - 15.0, "on": 0.5 * (low + high)}[start]


def _approach(start: str) -> str:
    return "positive" if start == "below" else "negative"


@CASES.product(
    "zero-mark/{direction}/{start}",
    parameters={"direction": ("positive", "negative"), "start": ("above", "on")},
    title="first zero mark in {direction} direction, from {start}",
    tags=("{direction}",),
    requirements=("HOM-098", "HOM-099", "HOM-100", "HOM-066"),
)
def zero_mark(ctx: CaseContext, direction: str, start: str) -> None:
    """The first zero mark in homing direction, with homing velocity; the cam has no part in it."""
    places = prepare(ctx, "zero-mark", direction=direction)
    place = _start(places, start) + 4.0
    go_to(ctx, place)
    since = ctx.now_s
    job = home(ctx)
    mark = places.next_mark(place, SIGN[direction])
    homed_at(ctx, job, places, "zero-mark", mark, since=since)
    axis = axis_name(ctx)
    ctx.expect(
        stays_within(
            f"{axis}.velocity_setpoint",
            low=-HOMING - 1.0,
            high=HOMING + 1.0,
            since=since,
            until=event("axis.homed", axis),
        ).covers("HOM-098")
    )


@CASES.product(
    "cam/{direction}/{start}",
    parameters={"direction": ("positive", "negative"), "start": STARTS},
    title="zero mark behind the cam in {direction} direction, from {start}",
    tags=("{direction}",),
    requirements=("HOM-089", "HOM-090", "HOM-091", "HOM-068"),
)
def cam(ctx: CaseContext, direction: str, start: str) -> None:
    """The first zero mark after the cam has been left in homing direction, whichever way it was
    approached.
    """
    places = prepare(ctx, "cam", direction=direction, approach=_approach(start))
    go_to(ctx, _start(places, start))
    since = ctx.now_s
    job = home(ctx)
    mark = places.next_mark(places.leaves_cam(SIGN[direction]), SIGN[direction])
    homed_at(ctx, job, places, "cam", mark, since=since)
    if start == "on":
        ctx.expect(
            never_happens(event("homing.phase", axis_name(ctx), phase="approach"), since=since).covers(
                "HOM-096"
            )
        )


@CASES.product(
    "input/{direction}/{side}/{start}",
    parameters={"direction": ("positive", "negative"), "side": ("positive", "negative"), "start": STARTS},
    title="{side} side of the input in {direction} direction, from {start}",
    tags=("{direction}",),
    requirements=("HOM-102", "HOM-107", "HOM-067"),
)
def digital_input(ctx: CaseContext, direction: str, side: str, start: str) -> None:
    """The edge of the configured side, met in homing direction with homing velocity."""
    positive_side = side == "positive"
    places = prepare(
        ctx, "input", direction=direction, positive_side=positive_side, approach=_approach(start)
    )
    go_to(ctx, _start(places, start))
    since = ctx.now_s
    job = home(ctx)
    homed_at(ctx, job, places, "input", places.edge(SIGN[direction], positive_side), since=since)


@CASES.product(
    "reversal/{mark}/{direction}/{start}",
    parameters={"mark": ("cam", "input"), "direction": ("positive", "negative"), "start": ("above", "below")},
    title="{mark} in {direction} direction, approached from {start} the wrong way round",
    tags=("reversal", "{direction}"),
    requirements=("HOM-108", "HOM-109", "HOM-113", "LIM-043"),
)
def reversal(ctx: CaseContext, mark: str, direction: str, start: str) -> None:
    """The approach leads away from the cam: the axis turns round at the limit switch, without an alarm, and
    finds the mark.
    """
    away = "negative" if start == "below" else "positive"
    places = prepare(ctx, mark, direction=direction, approach=away, reversal=True)
    go_to(ctx, _start(places, start))
    if start == "above":
        ctx.axis.write("Homing.ApproachVelocity", 120.0)
    since = ctx.now_s
    job = home(ctx)
    sign = SIGN[direction]
    expected = places.next_mark(places.leaves_cam(sign), sign) if mark == "cam" else places.edge(sign, False)
    homed_at(ctx, job, places, mark, expected, since=since)
    axis = axis_name(ctx)
    ctx.expect(
        event_order(
            [
                event("homing.phase", axis, phase="approach"),
                event("homing.phase", axis, phase="search", direction=sign),
                event("axis.homed", axis),
            ],
            since=since,
        )
    )


@CASES.product(
    "limit/{mark}/{reversal}",
    parameters={"mark": ("cam", "input"), "reversal": ("with", "without")},
    title="{mark} on the other side, {reversal} reversal",
    tags=("limit",),
    requirements=("HOM-112", "HOM-097"),
)
def limit_in_the_way(ctx: CaseContext, mark: str, reversal: str) -> None:
    """A limit switch comes before the cam: with reversal the axis is homed all the same, without it stops
    with 531 and 342.
    """
    places = prepare(ctx, mark, direction="positive", approach="negative", reversal=reversal == "with")
    go_to(ctx, _start(places, "below"))
    since = ctx.now_s
    job = home(ctx)
    axis = axis_name(ctx)
    if reversal == "with":
        sign = SIGN["positive"]
        expected = (
            places.next_mark(places.leaves_cam(sign), sign) if mark == "cam" else places.edge(sign, False)
        )
        homed_at(ctx, job, places, mark, expected, since=since)
        return
    not_homed(ctx, job, since=since)
    ctx.expect(
        alarm(531, reaction=3, since=since, axis=axis).covers("HOM-112"),
        alarm(342, reaction=3, since=since, axis=axis).covers("HOM-097"),
        happens(event("homing.phase", axis, phase="approach"), since=since),
    )
    never_in_a_stop(ctx, places)
