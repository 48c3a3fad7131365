"""The same again: what happens once has to happen a second time, whatever came between.

Nothing is said about what is right. Both times are compared sample by sample: what a device keeps from the
past, or has only from its start, shows as a difference.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from hil.campaign import Campaign, CaseContext
from hil.errors import BlockedError
from testcases.campaigns.own_axis import Own, own
from testcases.campaigns.support import axis_name, drive_name, equal

CAMPAIGN: Final = Campaign("repeated", tags=("axis",), bench="reference")
_WAYS: Final = ("position_setpoint", "actual_position")
"""Columns of an axis that are compared from where it stood at the beginning."""
_SAME: Final = (
    "velocity_setpoint",
    "acceleration_setpoint",
    "state",
    "stw1",
    "alarm_number",
    "alarm_reaction",
)
_NEARLY: Final = ("actual_velocity", "following_error")
_KINDS: Final = frozenset(
    {
        "axis.state",
        "job.active",
        "job.done",
        "job.aborted",
        "job.error",
        "alarm.raised",
        "alarm.cleared",
        "power.status",
        "drive.state",
        "drive.fault",
        "emcy.raised",
        "emcy.cleared",
        "emcy.received",
        "axis.homed",
    }
)
"""Events that have to come again."""


# -- what is done twice ------------------------------------------------------------------------------------


def _settle(ctx: CaseContext) -> None:
    ctx.run_for(0.6)


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


_PROGRAMS: Final[dict[str, Callable[[CaseContext, Any, Own], None]]] = {
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


def _enable(ctx: CaseContext, axis: Any) -> None:
    ctx.wait_until(axis.power().status, 5.0, "the axis is enabled")


def _nothing(ctx: CaseContext, axis: Any) -> None:
    del ctx, axis


def _off_and_on(ctx: CaseContext, axis: Any) -> None:
    axis.power(False)
    ctx.run_for(0.8)
    _enable(ctx, axis)


def _restart(ctx: CaseContext, axis: Any) -> None:
    axis.power(False)
    ctx.run_for(0.8)
    ctx.wait_until(axis.reset(restart=True).done, 5.0, "the axis has restarted")
    ctx.run_for(0.1)
    _enable(ctx, axis)


def _drive_off(ctx: CaseContext, axis: Any) -> None:
    axis.power(False)
    ctx.run_for(0.8)
    off = ctx.inject("drive.power_off", drive_name(ctx))
    ctx.run_for(0.5)
    off.remove()
    ctx.run_for(2.0)
    axis.reset()
    ctx.run_for(0.3)
    _enable(ctx, axis)


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
    _enable(ctx, axis)


_BETWEEN: Final[dict[str, Callable[[CaseContext, Any], None]]] = {
    "nothing": _nothing,
    "off-and-on": _off_and_on,
    "restart": _restart,
    "drive-off": _drive_off,
    "plc": _plc,
}


# -- the comparison ----------------------------------------------------------------------------------------


def _once(
    ctx: CaseContext, axis: Any, values: Own, program: Callable[[CaseContext, Any, Own], None]
) -> tuple[int, int]:
    """Run a program; returns begin and end, ns. It begins with a call of the interpolator."""
    call = round(ctx.bench.interpolator_ns * ctx.bench.config.bench.program_cycles)
    ctx.run_for((-round(ctx.now_s * 1e9) % call) * 1e-9)
    begin = round(ctx.now_s * 1e9)
    program(ctx, axis, values)
    _settle(ctx)
    return begin, round(ctx.now_s * 1e9)


def _story(ctx: CaseContext, axis: Any, begin: int, end: int) -> list[tuple[str, str, tuple[str, ...], int]]:
    """Return the events of axis and drive: source, kind, what they say, and the cycle in which they came."""
    sources = {axis.name, drive_name(ctx)}
    found = []
    for entry in ctx.trace().events:
        if begin <= entry.time_ns < end and entry.source in sources and entry.kind in _KINDS:
            facts = tuple(
                f"{key}={value}"
                for key, value in entry.data.items()
                if key not in ("job", "position", "time", "offset")
            )
            found.append(
                (entry.source, entry.kind, facts, (entry.time_ns - begin) // int(ctx.bench.cycle_ns))
            )
    return found


def _compare(ctx: CaseContext, axis: Any, values: Own, spans: list[tuple[int, int]], *, ways: bool) -> None:
    """Expect the same events in the same cycles, and the same motion sample by sample."""
    first, second = (_story(ctx, axis, *span) for span in spans)
    told = [[one[:3] for one in story] for story in (first, second)]
    at = next((n for n, pair in enumerate(zip(*told, strict=False)) if pair[0] != pair[1]), None)
    if at is None and len(told[0]) != len(told[1]):
        at = min(map(len, told))
    what = "" if at is None else f": {[story[at] if at < len(story) else 'nothing' for story in told]}"
    equal(ctx, f"events that differ{what}", at is not None, 0)
    late = max((abs(a[3] - b[3]) for a, b in zip(first, second, strict=False)), default=0)
    equal(ctx, "greatest difference of their times, cycles", late, 0, within=_LATE)
    trace = ctx.trace()
    grid = [trace[f"{axis.name}.velocity_setpoint"].time_s * 1e9]
    places = [int(np.searchsorted(grid[0], begin + 0.5)) for begin, _ in spans]
    ends = [int(np.searchsorted(grid[0], end - 0.5)) for _, end in spans]
    count = min(end - place for place, end in zip(places, ends, strict=True))
    fast = values.golden.maximum_velocity
    bounds = {
        **dict.fromkeys(_SAME, 0.0),
        "velocity_setpoint": 1e-3 * fast,
        "acceleration_setpoint": 0.02 * values.golden.maximum_acceleration,
        "actual_velocity": 0.02 * fast + 4.0 * values.increment / (ctx.bench.cycle_ns * 1e-9),
        "following_error": 2e-3 * fast + 4.0 * values.increment,
        **dict.fromkeys(_WAYS, 1.5e-3 * fast + 4.0 * values.increment),
    }
    for column in (*_SAME, *_NEARLY, *(_WAYS if ways else ())):
        name = f"{axis.name}.{column}"
        if name not in trace:
            continue
        parts = [trace[name].values[place : place + count] for place in places]
        if column in _WAYS:
            parts = [part - part[0] for part in parts]
        off = np.abs(parts[0] - parts[1])
        # A bit that comes a cycle later by rounding is no other behaviour.
        if column in _SAME:
            off = np.minimum(off, np.minimum(_shifted(off, parts, 1), _shifted(off, parts, -1)))
        worst = int(np.argmax(off)) if len(off) else 0
        ctx.measure(
            f"difference of {column}, greatest {worst} cycles behind the beginning",
            float(off[worst]) if len(off) else 0.0,
            high=bounds[column] + 1e-9,
        )


_LATE: Final = 1
"""Events may come so many cycles earlier or later the second time: frames and cycles have another phase."""


def _shifted(off: Any, parts: list[Any], step: int) -> Any:
    other = np.roll(parts[1], step)
    found = np.abs(parts[0] - other)
    found[0], found[-1] = off[0], off[-1]
    return found


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
    _enable(ctx, axis)
    if program == "fault" and ctx.bench.config.drive[drive_name(ctx)].profile not in ("cia402", "profidrive"):
        raise BlockedError("the drive has no numbers of faults")
    run = _PROGRAMS[program]
    start = axis.var("ActualPosition") if axis.object.has_position else 0.0
    _settle(ctx)
    spans = [_once(ctx, axis, values, run)]
    if program == "homing":
        _BETWEEN[between](ctx, axis)
    else:
        _back(ctx, axis, start, values)
        start = axis.var("Position")
        _BETWEEN[between](ctx, axis)
        if between != "drive-off":
            _back(ctx, axis, start, values)
    _settle(ctx)
    spans.append(_once(ctx, axis, values, run))
    # What sets the position moves it the first time only.
    _compare(ctx, axis, values, spans, ways=program != "homing")


def _back(ctx: CaseContext, axis: Any, start: float, values: Own) -> None:
    """Bring the axis back to where it stood."""
    way = start - axis.var("Position")
    if axis.var("Modulo.Enable"):
        length = axis.var("Modulo.Length")
        way = (way + 0.5 * length) % length - 0.5 * length
    if abs(way) > values.increment:
        ctx.wait_until(axis.move_relative(way).done, 5.0, "the axis is back")
    _settle(ctx)
