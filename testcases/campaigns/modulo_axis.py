"""An axis with a modulo range: the place that it goes to, and the way there."""

from __future__ import annotations

from typing import Final

from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from hil.expect import no_alarm
from testcases.campaigns.support import axis_name, drive_name, enable

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
