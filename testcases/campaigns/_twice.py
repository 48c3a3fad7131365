"""A program of an axis that is run twice, and the comparison of both runs: the same events in the same
cycles, the same motion sample by sample.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from hil.campaign import CaseContext
from testcases.campaigns.own_axis import Own
from testcases.campaigns.support import drive_name, equal

Program = Callable[[CaseContext, Any, Own], None]
Span = tuple[int, int]
"""Begin and end of a run, ns."""
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


def settle(ctx: CaseContext) -> None:
    """Let the axis come to rest."""
    ctx.run_for(0.6)


def enable(ctx: CaseContext, axis: Any) -> None:
    """Enable the axis and wait for it."""
    ctx.wait_until(axis.power().status, 5.0, "the axis is enabled")


def once(ctx: CaseContext, axis: Any, values: Own, program: Program) -> Span:
    """Run a program; returns begin and end, ns. It begins with a call of the interpolator."""
    call = round(ctx.bench.interpolator_ns * ctx.bench.config.bench.program_cycles)
    ctx.run_for((-round(ctx.now_s * 1e9) % call) * 1e-9)
    begin = round(ctx.now_s * 1e9)
    program(ctx, axis, values)
    settle(ctx)
    return begin, round(ctx.now_s * 1e9)


def story(ctx: CaseContext, axis: Any, begin: int, end: int) -> list[tuple[str, str, tuple[str, ...], int]]:
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


def compare(ctx: CaseContext, axis: Any, values: Own, spans: list[Span], *, ways: bool) -> None:
    """Expect the same events in the same cycles, and the same motion sample by sample."""
    first, second = (story(ctx, axis, *span) for span in spans)
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


def back(ctx: CaseContext, axis: Any, start: float, values: Own) -> None:
    """Bring the axis back to where it stood."""
    way = start - axis.var("Position")
    if axis.var("Modulo.Enable"):
        length = axis.var("Modulo.Length")
        way = (way + 0.5 * length) % length - 0.5 * length
    if abs(way) > values.increment:
        ctx.wait_until(axis.move_relative(way).done, 5.0, "the axis is back")
    settle(ctx)
