"""Cases of `fault_reactions`: which of two stops wins."""

from __future__ import annotations

from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.expect import job_output, never_happens, standstill, state_at, value_at
from hil.record import event
from testcases.campaigns._reactions import stopped_for_good
from testcases.campaigns.support import axis_name, bring_into, enable, settle_s

CASES: Final = Campaign("fault reactions", tags=("fault",), bench="reference")


def _stop(ctx: CaseContext, mode: int) -> Any:
    ctx.do(f"MC_Stop Mode {mode}")
    return ctx.axis.stop(mode)


PRECEDENCE: Final = (
    # first, second, MC_Stop aborted, requirement
    ("alarm-2", "stop-0", False, "STP-439"),
    ("stop-3", "alarm-2", True, "STP-440"),
    ("alarm-3", "stop-0", True, "STP-441"),
    ("stop-2", "alarm-2", False, "STP-442"),
    ("stop-0", "alarm-4", True, "STP-516"),
    ("alarm-4", "stop-0", True, "STP-444"),
    ("stop-0", "alarm-2", False, "STP-433"),
)
NUMBERS: Final = {1: 533, 2: 104, 3: 304, 4: 521}
"""Reaction -> alarm that has it."""
EMERGENCY: Final = 4000.0
"""Deceleration of the emergency ramp, mm/s2."""


@CASES.product(
    "precedence/{first}/{second}",
    parameters=[
        dict(zip(("first", "second", "aborted", "identifier"), row, strict=True)) for row in PRECEDENCE
    ],
    title="{second} while {first} is active",
    tags=("precedence",),
    requirements=lambda first, second, aborted, identifier: ("STP-436", identifier),
)
def precedence(ctx: CaseContext, first: str, second: str, aborted: bool, identifier: str) -> None:
    """The more severe of MC_Stop and alarm reaction wins; an MC_Stop that loses shows CommandAborted, never
    Error.
    """
    axis = axis_name(ctx)
    enable(ctx)
    bring_into(ctx, "constant")
    before = ctx.now_s
    stop = None
    for what in (first, second):
        kind, _, value = what.partition("-")
        if kind == "stop":
            stop = _stop(ctx, int(value))
            ctx.run_for(5 * ctx.bench.cycle_ns * 1e-9)
        else:
            ctx.inject("axis.alarm", axis, number=NUMBERS[int(value)], reaction=int(value))
            ctx.run_for(5 * ctx.bench.cycle_ns * 1e-9)
    ctx.run_for(1.5 + settle_s(ctx))
    assert stop is not None
    output = "CommandAborted" if aborted else "Done"
    ctx.expect(job_output(stop.name, output, since=before).covers(identifier))
    ctx.expect(never_happens(event("job.error", job=stop.name)).covers("STP-437"))
    ctx.expect(state_at(axis, ctx.now_s, "ALARM_DISABLED").covers("STP-443"))
    stopped_for_good(ctx, ctx.now_s)


@CASES.product(
    "precedence/alarm-{first}/alarm-{second}",
    parameters=[{"first": first, "second": second} for first, second in ((1, 3), (3, 1), (2, 3))],
    title="alarm with reaction {second} while the ramp of reaction {first} runs",
    tags=("precedence",),
    requirements=("STP-432", "TA-003"),
)
def alarm_upon_alarm(ctx: CaseContext, first: int, second: int) -> None:
    """The ramp gets harder with a stronger reaction and never softer; ErrorDetail shows the stronger
    alarm.
    """
    axis = axis_name(ctx)
    stronger = max(first, second)
    enable(ctx)
    bring_into(ctx, "constant")
    for reaction in (first, second):
        ctx.inject("axis.alarm", axis, number=NUMBERS[reaction], reaction=reaction)
        ctx.run_for(5 * ctx.bench.cycle_ns * 1e-9)
    both = ctx.now_s
    ctx.run_for(1.5 + settle_s(ctx))
    velocity = float(ctx.trace()[f"{axis}.velocity_setpoint"].at(both))
    ctx.expect(
        value_at(f"{axis}.alarm_number", both, NUMBERS[stronger], tolerance=0.0).covers("TA-003"),
        value_at(f"{axis}.alarm_reaction", both, stronger, tolerance=0.0).covers("TA-003"),
        standstill(by=both + velocity / EMERGENCY + 15 * ctx.bench.cycle_ns * 1e-9, axis=axis)
        .named("the emergency ramp decides")
        .covers("STP-432"),
    )
    stopped_for_good(ctx, ctx.now_s)
