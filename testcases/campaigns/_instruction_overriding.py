"""Cases of `instructions`: a running job and every new one, cell by cell of the specification."""

from __future__ import annotations

from typing import Final

from hil.campaign import Campaign, CaseContext
from testcases.campaigns._instruction_jobs import Stage, stage
from testcases.campaigns._instruction_outputs import Watched
from testcases.campaigns._overriding import ALARM, LOCKED, RUNNING, Cell, cells
from testcases.campaigns._reactions import calls

CASES: Final = Campaign("instructions", tags=("axis", "overriding"), bench="reference")

_MOMENTS: Final = {"at-once": (1, 2), "later": (12, 40)}
"""Calls of the program from the running job to the new one: at least, less than."""


def _identifiers(running: str, moment: str) -> tuple[str, ...]:
    del moment
    return tuple(dict.fromkeys(one for cell in cells(running) for one in cell.identifiers))


@CASES.product(
    "over/{running}/{moment}",
    parameters={"running": RUNNING, "moment": tuple(_MOMENTS)},
    title="every new job over {running}, {moment}",
    requirements=_identifiers,
)
def over(ctx: CaseContext, running: str, moment: str) -> None:
    """Each new job does to the running one what the table says, and becomes itself what the table says."""
    with_jobs = stage(ctx)
    drawn = ctx.rng("calls")
    for number, cell in enumerate(cells(running)):
        with_jobs.sign = 1 if number % 2 else -1
        _pair(with_jobs, running, cell, int(drawn.integers(*_MOMENTS[moment])), held=number % 4 < 2)


def _pair(on: Stage, running: str, cell: Cell, after: int, *, held: bool) -> None:
    ctx, outputs = on.ctx, on.outputs
    ctx.do(f"{cell.new} over {running}")
    first = on.run(running, after)
    ctx.require(first.last.busy, f"{running} is busy when {cell.new} comes")
    if not held and running != "stop" and "Execute" in first.instance.inputs:
        first.lower()
        outputs.calls(1)
    velocity = on.velocity
    second = on.new(cell.new)
    outputs.calls(4)
    words = f"{cell.new} over {running}"
    _running_one(ctx, words, first, cell, held=held)
    if cell.new == "disable":
        _disabled(on, words)
        return
    _new_one(ctx, words, second, cell)
    if cell.aborts and cell.fate == "takes" and not cell.new.startswith("motion-in"):
        step = abs(on.velocity - velocity)
        limits = on.values.golden
        steepest = max(
            limits.maximum_acceleration, limits.maximum_deceleration, limits.emergency_deceleration
        )
        ctx.measure(
            f"{words}: change of the velocity setpoint",
            step,
            f"{on.values.unit}/s",
            high=steepest * calls(ctx, 6),
            requirements=("OVR-008",),
        )
    outputs.calls(3)
    on.back()


def _running_one(ctx: CaseContext, words: str, one: Watched, cell: Cell, *, held: bool) -> None:
    """Judge what has become of the running job in the four calls since the new one came."""
    latest = one.calls[-4:]
    aborted = any(call.aborted for call in latest)
    failed = any(call.error_id == ALARM for call in latest)
    good = aborted == cell.aborts and failed == (cell.fate == "not homed")
    if aborted and held:
        good = good and one.last.aborted  # held until Execute falls
    ctx.measure(
        f"{words}: the running job shows {' / '.join(call.text for call in latest)}",
        float(good),
        low=1.0,
        requirements=(cell.identifiers[0],),
    )


def _new_one(ctx: CaseContext, words: str, one: Watched, cell: Cell) -> None:
    """Judge what has become of the new job."""
    last = one.last
    refused_at_once = one.calls[0].error
    good = {
        "takes": ((last.busy or last.done) and last.active is not False) or last.done,
        "beside": last.busy or last.done,
        "waits": last.busy and last.active is False,
        "done": any(call.done for call in one.calls),
        "refused": last.error and refused_at_once,
        "not homed": last.error_id == ALARM,
        "open": True,
    }[cell.fate]
    if cell.fate == "refused" and "OVR-084" in cell.identifiers:
        good = good and last.error_id == LOCKED
    ctx.measure(
        f"{words}: the new job shows {last.text}",
        float(good),
        low=1.0,
        requirements=cell.identifiers[1:] or cell.identifiers,
    )


def _disabled(on: Stage, words: str) -> None:
    """Wait until the axis is disabled, and enable it again."""
    ctx, power = on.ctx, on.axis.power_instance
    ctx.wait_until(lambda: not power.Busy, 8.0, f"{words}: disabling is complete")
    ctx.measure(f"{words}: MC_Power.Status", float(power.Status), high=0.0, requirements=("MC-152",))
    on.outputs.release()
    ctx.wait_until(on.axis.power().status, 5.0, "the axis is enabled again")
    on.back()
