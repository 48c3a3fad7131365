"""An axis with a modulo range: the place that it goes to, and the way there."""

from __future__ import annotations

from typing import Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import no_alarm
from testcases.campaigns.support import axis_name, drive_name, enable, equal

BENCH: Final[BenchFile] = load_bench("reference").configured(
    {
        "axis": {
            "axis1": {"variables": {"Modulo.Enable": True, "Modulo.StartValue": 0.0, "Modulo.Length": 360.0}}
        }
    }
)
CAMPAIGN: Final = Campaign("modulo axis", tags=("axis",), bench="testcases.campaigns.modulo_axis:BENCH")


@CAMPAIGN.product(
    "place/{way}",
    parameters=[
        {"way": "positive", "direction": 1, "distance": 100.0},
        {"way": "negative", "direction": 2, "distance": -260.0},
        {"way": "shortest", "direction": 3, "distance": 100.0},
    ],
    title="MC_MoveAbsolute to a place of a modulo axis, way {way}",
    requirements=("MC-255",),
)
def modulo_place(ctx: CaseContext, way: str, direction: int, distance: float) -> None:
    """A second target, given with its edge, is approached at once, on the way that Direction says."""
    del way
    axis, place = axis_name(ctx), f"{drive_name(ctx)}.position"
    enable(ctx)
    home = ctx.axis.home(0.0)
    ctx.wait_until(home.done, 1.0, "the position is set")
    first = ctx.axis.move_absolute(300.0, Direction=1, Velocity=400.0)
    ctx.wait_until(first.done, 3.0, "the axis is at 300")
    begun = float(ctx.trace()[place].values[-1])
    ctx.do("MC_MoveAbsolute to 40")
    job = ctx.axis.move_absolute(40.0, Direction=direction, Velocity=400.0)
    ctx.wait_until(job.done, 3.0, "the positioning is done")
    moved = (float(ctx.trace()[place].values[-1]) - begun) * 1000.0
    ctx.measure(
        "way of the machine", moved, "mm", low=distance - 0.1, high=distance + 0.1, requirements=("MC-255",)
    )
    ctx.expect(no_alarm(axis=axis))


@CAMPAIGN.case("half-a-range", requirements=("CFG-122", "MC-255"))
def half_a_range(ctx: CaseContext) -> None:
    """To the place opposite both ways are alike: the positive one is taken, by a positioning and by a direct
    homing.
    """
    axis = ctx.axis
    enable(ctx)
    ctx.wait_until(axis.home(90.0, mode=11).done, 1.0, "the setpoint is 90")
    for target in (270.0, 90.0):
        begun = float(ctx.trace()[f"{drive_name(ctx)}.position"].values[-1])
        ctx.wait_until(axis.move_absolute(target, Direction=3, Velocity=400.0).done, 3.0, f"at {target:g}")
        moved = (float(ctx.trace()[f"{drive_name(ctx)}.position"].values[-1]) - begun) * 1000.0
        equal(ctx, f"way of the machine to {target:g}, mm", moved, 180.0, "MC-255", within=0.1)
    for place, turns in ((270.0, 0), (90.0, 1)):
        cycle = axis.var("ModuloCycle")
        ctx.wait_until(axis.home(place, mode=11).done, 1.0, "the setpoint is set")
        ctx.run_for(0.02)
        equal(ctx, "Position", axis.var("Position"), place, within=1e-6)
        equal(ctx, f"ModuloCycle at {place:g}", axis.var("ModuloCycle") - cycle, turns, "CFG-122")
    ctx.expect(no_alarm(axis=axis_name(ctx)))
