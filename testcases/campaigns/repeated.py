"""The same again: what happens once has to happen a second time, whatever came between.

Nothing is said about what is right. Both times are compared sample by sample: what a device keeps from the
past, or has only from its start, shows as a difference.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from hil.campaign import Campaign, CaseContext
from hil.errors import BlockedError
from testcases.campaigns._twice import Program, back, compare, enable, once, settle
from testcases.campaigns.own_axis import Own, own
from testcases.campaigns.support import axis_name, drive_name

CAMPAIGN: Final = Campaign("repeated", tags=("axis",), bench="reference")
# -- what is done twice ------------------------------------------------------------------------------------


def _travel(ctx: CaseContext, axis: Any, values: Own) -> None:
    """There with a job that is superseded, and back."""
    dynamics = values.dynamics().inputs
    axis.move_relative(values.way(0.31), Velocity=values.given(values.speed(0.45)), **dynamics)
    ctx.run_for(0.25)
    job = axis.move_relative(-values.way(0.07), Velocity=values.given(values.speed(0.7)), **dynamics)
    ctx.wait_until(job.done, 5.0, "the second job is done")


def _jog(ctx: CaseContext, axis: Any, values: Own) -> None:
    """Jog to and fro, then halt out of a constant velocity."""
    job = axis.jog(values.given(values.speed(0.3)))
    ctx.run_for(0.4)
    job.set(JogForward=False, JogBackward=True)
    ctx.run_for(0.7)
    job.set(JogBackward=False)
    ctx.run_for(0.4)
    axis.move_velocity(values.given(-values.speed(0.35)))
    ctx.run_for(0.4)
    ctx.wait_until(axis.halt().done, 5.0, "the axis has halted")


def _stop(ctx: CaseContext, axis: Any, values: Own) -> None:
    """Stop on the way, held until Execute falls."""
    axis.move_velocity(values.given(values.speed(0.5)))
    ctx.run_for(0.35)
    stop = axis.stop(2)
    ctx.wait_until(stop.done, 5.0, "the stop is done")
    ctx.run_for(0.05)
    stop.set(Execute=False)
    ctx.run_for(0.05)


def _superimposed(ctx: CaseContext, axis: Any, values: Own) -> None:
    """A motion with another one on top of it."""
    basic = axis.move_relative(values.way(0.3), Velocity=values.given(values.speed(0.3)))
    ctx.run_for(0.2)
    axis.move_superimposed(values.way(0.05), VelocityDiff=values.given(values.speed(0.15)))
    ctx.wait_until(basic.done, 5.0, "the basic motion is done")
    ctx.run_for(0.4)


def _disable(ctx: CaseContext, axis: Any, values: Own) -> None:
    """Disable while it moves, and enable again."""
    axis.move_velocity(values.given(-values.speed(0.4)))
    ctx.run_for(0.4)
    axis.power(False, stop_mode=1)
    ctx.run_for(1.0)
    ctx.wait_until(axis.power().status, 5.0, "the axis is enabled again")


def _alarm(ctx: CaseContext, axis: Any, values: Own) -> None:
    """An alarm that brakes, acknowledged."""
    axis.move_velocity(values.given(values.speed(0.5)))
    ctx.run_for(0.4)
    ctx.inject("axis.alarm", axis_name(ctx), number=307, reaction=2)
    ctx.run_for(0.8)
    ctx.wait_until(axis.reset().done, 5.0, "the alarm is acknowledged")
    ctx.wait_until(axis.power_instance.status, 5.0, "the axis is enabled again")


def _fault(ctx: CaseContext, axis: Any, values: Own) -> None:
    """A fault of the drive that passes, acknowledged."""
    axis.move_velocity(values.given(values.speed(0.5)))
    ctx.run_for(0.4)
    code = 0x2310 if ctx.bench.config.drive[drive_name(ctx)].profile == "cia402" else 30001
    ctx.inject("drive.fault", drive_name(ctx), code=code)
    ctx.run_for(1.2)
    ctx.wait_until(axis.reset().done, 5.0, "the fault is acknowledged")
    ctx.wait_until(axis.power_instance.status, 5.0, "the axis is enabled again")


def _homing(ctx: CaseContext, axis: Any, _: Own) -> None:
    """The position is set."""
    ctx.wait_until(axis.home(5.0).done, 5.0, "the axis is homed")
    ctx.run_for(0.1)


_PROGRAMS: Final[dict[str, Program]] = {
    "travel": _travel,
    "jog": _jog,
    "stop": _stop,
    "superimposed": _superimposed,
    "disable": _disable,
    "alarm": _alarm,
    "fault": _fault,
    "homing": _homing,
}


# -- what comes between ------------------------------------------------------------------------------------


def _nothing(ctx: CaseContext, axis: Any) -> None:
    del ctx, axis


def _off_and_on(ctx: CaseContext, axis: Any) -> None:
    axis.power(False)
    ctx.run_for(0.8)
    enable(ctx, axis)


def _restart(ctx: CaseContext, axis: Any) -> None:
    axis.power(False)
    ctx.run_for(0.8)
    ctx.wait_until(axis.reset(restart=True).done, 5.0, "the axis has restarted")
    ctx.run_for(0.1)
    enable(ctx, axis)


def _drive_off(ctx: CaseContext, axis: Any) -> None:
    axis.power(False)
    ctx.run_for(0.8)
    off = ctx.inject("drive.power_off", drive_name(ctx))
    ctx.run_for(0.5)
    off.remove()
    ctx.run_for(2.0)
    axis.reset()
    ctx.run_for(0.3)
    enable(ctx, axis)


def _plc(ctx: CaseContext, axis: Any) -> None:
    axis.power(False)
    ctx.run_for(0.8)
    ctx.bench.controller.stop()
    ctx.run_for(0.5)
    ctx.bench.controller.run()
    ctx.run_for(3.0)
    ctx.wait_until(axis.reset().done, 5.0, "axis and drive are acknowledged")
    axis.power(False)
    ctx.run_for(0.05)
    enable(ctx, axis)


_BETWEEN: Final[dict[str, Callable[[CaseContext, Any], None]]] = {
    "nothing": _nothing,
    "off-and-on": _off_and_on,
    "restart": _restart,
    "drive-off": _drive_off,
    "plc": _plc,
}


@CAMPAIGN.product(
    "{program}/{between}",
    parameters={"program": tuple(_PROGRAMS), "between": tuple(_BETWEEN)},
    title="{program} twice, between them: {between}",
    # A controller that starts anew has other phases between its calls.
    needs=lambda between, **_: {"interpolator": "1", "program": "1"} if between == "plc" else {},
)
def twice(ctx: CaseContext, program: str, between: str) -> None:
    """The second time is like the first: the same events in the same cycles, the same motion."""
    if between == "drive-off" and program == "homing":
        raise BlockedError("an incremental encoder begins anew with its drive")
    axis, values = ctx.axis, own(ctx)
    enable(ctx, axis)
    if program == "fault" and ctx.bench.config.drive[drive_name(ctx)].profile not in ("cia402", "profidrive"):
        raise BlockedError("the drive has no numbers of faults")
    run = _PROGRAMS[program]
    start = axis.var("ActualPosition") if axis.object.has_position else 0.0
    settle(ctx)
    spans = [once(ctx, axis, values, run)]
    if program == "homing":
        _BETWEEN[between](ctx, axis)
    else:
        back(ctx, axis, start, values)
        start = axis.var("Position")
        _BETWEEN[between](ctx, axis)
        if between != "drive-off":
            back(ctx, axis, start, values)
    settle(ctx)
    spans.append(once(ctx, axis, values, run))
    # What sets the position moves it the first time only.
    compare(ctx, axis, values, spans, ways=program != "homing")
