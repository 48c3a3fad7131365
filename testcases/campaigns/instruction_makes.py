"""Instructions on other objects and controllers: a speed axis, an S7-1500, an S7-1200 G2."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from fieldbus.errors import ConfigurationError
from hil.bench import BenchFile, load_bench
from hil.campaign import Campaign, CaseContext
from testcases.campaigns._instruction_jobs import stage
from testcases.campaigns._instruction_outputs import Outputs

_HERE: Final = "testcases.campaigns.instruction_makes"
_WRONG_OBJECT: Final = 0x8002
_NEW_IN_V9: Final = ("absolute-buffered", "relative-buffered", "halt-basic")
"""Jobs with inputs that came with technology version V9.0."""


def _on(cpu: str) -> BenchFile:
    return load_bench("reference").configured({"bench": {"cpu": cpu}})


S7_1500: Final = _on("S7-1500")
S7_1200_G2: Final = _on("S7-1200 G2")

SPEED_AXIS: Final = Campaign("instructions of a speed axis", tags=("axis", "states"), bench="speed")
OF_1500: Final = Campaign("instructions of an S7-1500", tags=("axis",), bench=f"{_HERE}:S7_1500")
OF_G2: Final = Campaign("instructions of an S7-1200 G2", tags=("axis",), bench=f"{_HERE}:S7_1200_G2")


@SPEED_AXIS.case("wrong-object", requirements=("MC-007", "MC-051", "MC-102"))
def speed_axis(ctx: CaseContext) -> None:
    """A speed axis refuses what needs a position with 16#8002, and goes on with what it does."""
    axis, outputs = ctx.axis, Outputs(ctx)
    ctx.wait_until(axis.power().status, 5.0, "the axis is enabled")
    maximum = float(axis.var("DynamicLimits.MaxVelocity"))
    running = outputs.watch(axis.move_velocity(0.3 * maximum))
    ctx.wait_until(running.instance.in_velocity, 30.0, "the speed is reached")
    makers: dict[str, Callable[[], Any]] = {
        "MC_Home": lambda: axis.home(1.0),
        "MC_MoveAbsolute": lambda: axis.move_absolute(1.0),
        "MC_MoveRelative": lambda: axis.move_relative(1.0),
        "MC_MoveSuperimposed": lambda: axis.move_superimposed(1.0),
        "MC_HaltSuperimposed": axis.halt_superimposed,
        "MC_MotionInPosition": lambda: axis.motion_in_position(1.0),
        "MC_MotionInSuperimposed": lambda: axis.motion_in_superimposed(1.0),
        "MC_SetSensor": lambda: axis.set_sensor(1),
    }
    for name, make in makers.items():
        one = outputs.watch(make())
        outputs.calls(2)
        ctx.measure(
            f"{name} shows {one.last.text}",
            float(one.last.error_id == _WRONG_OBJECT),
            low=1.0,
            requirements=("MC-051", "MC-007"),
        )
    ctx.measure("the job goes on", float(running.last.success), low=1.0, requirements=("MC-059", "MC-051"))
    outputs.release()


TECHNOLOGY: Final[dict[str, Callable[[Any], Any]]] = {
    "MC_SetSensor": lambda axis: axis.set_sensor(1),
    "MC_MotionInVelocity": lambda axis: axis.motion_in_velocity(0.0),
    "MC_MotionInPosition": lambda axis: axis.motion_in_position(0.0),
    "MC_MotionInSuperimposed": lambda axis: axis.motion_in_superimposed(0.0),
}
"""Instructions of the technology CPU."""


def _of_a_controller(ctx: CaseContext) -> None:
    cpu = ctx.bench.config.bench.cpu
    on = stage(ctx)
    for name, make in TECHNOLOGY.items():
        try:
            make(ctx.axis)
        except ConfigurationError:
            there = False
        else:
            there = True
        ctx.measure(f"{name} on {cpu}", float(there), high=0.0, requirements=("CFG-062",))
    early = cpu == "S7-1200 G2"
    for job in _NEW_IN_V9:
        try:
            one = on.outputs.watch(on.start(job, 0.02, "running"))
        except ConfigurationError:
            ctx.measure(f"{job} on {cpu}", 0.0, low=0.0 if early else 1.0, requirements=("G2-049",))
            continue
        ctx.measure(f"{job} on {cpu}", 1.0, high=0.0 if early else 1.0, requirements=("G2-049", "MC-017"))
        on.outputs.until(one, "done", 3.0, f"{job} is done")
        on.outputs.release()
    for job in ("absolute", "relative"):
        one = on.outputs.watch(on.start(job, 0.02, "running"))
        on.outputs.calls(2)
        shows = hasattr(one.instance, "Active")
        ctx.measure(
            f"{job}: output Active", float(shows), low=not early, high=not early, requirements=("G2-049",)
        )
        on.outputs.until(one, "done", 3.0, f"{job} is done")
        on.outputs.release()


for _campaign in (OF_1500, OF_G2):
    _campaign.case(
        "technology", title="what there is of the instructions", requirements=("CFG-062", "G2-049")
    )(_of_a_controller)
