"""A queue of jobs and what ends it, and stops that meet stops."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from testcases.campaigns._instruction_outputs import Outputs, Watched
from testcases.campaigns._reactions import cycles
from testcases.campaigns.limits_in_motion import Slopes
from testcases.campaigns.support import axis_name, enable, equal

QUEUE: Final = Campaign("queue of jobs", tags=("axis",), bench="reference")
MEMORY_FULL: Final = 0x8014
LOCKED: Final = 0x800F


def _queued(ctx: CaseContext, outputs: Outputs, number: int) -> list[Watched]:
    """Start a motion and append others, one call after the other."""
    jobs = [outputs.watch(ctx.axis.move_relative(90.0, Velocity=60.0))]
    outputs.calls(2)
    for one in range(number):
        jobs.append(outputs.watch(ctx.axis.move_relative(2.0 + one, Velocity=60.0, BufferMode=1)))
        outputs.calls(2)
    return jobs


@QUEUE.case("depth", requirements=("MC-017", "OVR-019"))
def depth(ctx: CaseContext) -> None:
    """As many motions wait as there is room for, are executed in their order, and one more is refused and
    leaves them alone.
    """
    enable(ctx)
    outputs, begun = Outputs(ctx), float(ctx.axis.var("Position"))
    jobs = _queued(ctx, outputs, 1)
    while not jobs[-1].last.error and len(jobs) < 12:
        jobs.append(outputs.watch(ctx.axis.move_relative(float(len(jobs)), Velocity=60.0, BufferMode=1)))
        outputs.calls(2)
    ctx.do(f"{len(jobs) - 1} motions at once; the next one shows {jobs[-1].last.text}")
    ctx.measure("motions that wait", len(jobs) - 2, low=1.0, high=10.0)
    equal(ctx, "ErrorID of one too many", jobs[-1].last.error_id, MEMORY_FULL, "MC-017")
    for one in jobs[:-1]:
        equal(ctx, "Busy", one.last.busy, 1.0, "OVR-019")
    ctx.axis.write("Override.Velocity", 200.0)
    waiting = jobs[1:-1]
    for at, one in enumerate(waiting):
        outputs.until(one, "done", 4.0, f"motion {at + 2} is done")
        equal(ctx, f"motions behind {at + 2} wait", sum(later.last.done for later in waiting[at + 1 :]), 0.0)
    ways = 90.0 + 2.0 + sum(range(2, len(jobs) - 1))
    equal(ctx, "way", float(ctx.axis.var("Position")) - begun, ways, within=1e-6)
    outputs.release()


@QUEUE.product(
    "ended-by/{what}",
    parameters={"what": ("stop", "halt", "velocity", "alarm", "disable", "homing", "uncontrolled")},
    title="a queue of motions, ended by {what}",
    requirements=("OVR-019", "MC-123"),
)
def ended(ctx: CaseContext, what: str) -> None:
    """What ends the motion ends those that wait, each with its own end: aborted, or failed by the alarm."""
    enable(ctx)
    outputs, axis = Outputs(ctx), ctx.axis
    jobs = _queued(ctx, outputs, 1)
    outputs.calls(20)
    acts: dict[str, Callable[[], Any]] = {
        "stop": lambda: axis.stop(0),
        "halt": axis.halt,
        "velocity": lambda: axis.move_velocity(-30.0),
        "alarm": lambda: ctx.inject("axis.alarm", axis_name(ctx), number=307, reaction=2),
        "disable": lambda: axis.power(False),
        "homing": lambda: axis.home(0.0, mode=5),
        "uncontrolled": lambda: axis.move_velocity(20.0, PositionControlled=False),
    }
    acts[what]()
    outputs.calls(4)
    for number, one in enumerate(jobs, 1):
        failed = what == "alarm"
        equal(ctx, f"motion {number} is aborted", one.last.aborted, not failed, "OVR-019")
        equal(ctx, f"ErrorID of motion {number}", one.last.error_id, 0x8001 if failed else 0.0, "MC-123")
    outputs.release()


@QUEUE.product(
    "stop-on-stop/{first}-{second}",
    parameters=[{"first": first, "second": second} for first in (0, 2, 3) for second in (0, 2, 3)],
    title="MC_Stop Mode {second} while Mode {first} brakes",
    requirements=("STP-423",),
)
def stops(ctx: CaseContext, first: int, second: int) -> None:
    """The same or a harder stop takes over, a softer one is aborted; the ramp is that of the last one."""
    enable(ctx)
    outputs, axis, slopes = Outputs(ctx), ctx.axis, Slopes(ctx)
    job = axis.move_velocity(400.0)
    ctx.wait_until(job.in_velocity, 3.0, "constant")
    braking = {"Deceleration": 700.0, "Jerk": 0.0}
    one = outputs.watch(axis.stop(first, **(braking if first == 3 else {})))
    outputs.calls(3)
    other = {"Deceleration": 500.0, "Jerk": 0.0}
    two = outputs.watch(axis.stop(second, **(other if second == 3 else {})))
    outputs.calls(3)
    order = {3: 0, 2: 1, 0: 2}
    takes = order[second] >= order[first]
    equal(ctx, "the first is aborted", one.last.aborted, takes, "STP-423")
    equal(ctx, "the second is aborted", two.last.aborted, not takes, "STP-423")
    wanted = {0: 4000.0, 2: 2000.0, 3: 500.0 if takes else 700.0}[second if takes else first]
    since = ctx.now_s
    # Mode 2 keeps to the limit of the jerk: its ramp needs a tenth of a second to become as steep.
    ctx.run_for(cycles(ctx, 4) if (second if takes else first) != 2 else 0.11)
    slopes.constant("ramp", since, -wanted, "STP-423", skip=0 if (second if takes else first) != 2 else 25)
    running = two if takes else one
    outputs.until(running, "done", 3.0, "the stop is done")
    refused = outputs.watch(axis.move_relative(1.0))
    outputs.calls(2)
    equal(ctx, "ErrorID while it is held", refused.last.error_id, LOCKED)
    outputs.release()
    ctx.wait_until(axis.move_relative(1.0).done, 3.0, "it moves again")
