"""Always-on rules about synchronous operation: a follower stays on the function of its gear or cam, its
leading value is that of the leading object, a synchronous job has one end, and nothing moves behind it.

They work from the recorded positions, the gear or cam of the event `axis.follows` and the function of the
event `cam.interpolated`. Where a trace lacks one of these they say nothing.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldbus.history import Event, Scalar
from hil.record import Trace
from reports.model import Check, Verdict

Numbers = NDArray[np.float64]
Flags = NDArray[np.bool_]
Finding = tuple[float, str]

JOBS: Final = frozenset(
    {
        "MC_GearIn", "MC_GearInPos", "MC_GearInVelocity", "MC_GearOut", "MC_CamIn", "MC_CamOut",
        "MC_PhasingAbsolute", "MC_PhasingRelative", "MC_OffsetAbsolute", "MC_OffsetRelative",
    }
)  # fmt: skip
"""Instructions whose jobs follow or leave a leading value, or shift a value of one that does."""
ENDLESS: Final = frozenset({"MC_GearIn", "MC_GearInPos", "MC_GearInVelocity"})
"""Those that have no `Done` (SYN-135, SYN-148, SYN-165)."""
LEAVING: Final = frozenset({"MC_GearOut", "MC_CamOut"})
_ENDS: Final = ("job.done", "job.aborted", "job.error")
_OFF: Final = frozenset(
    {"DISABLED", "DISABLING_RAMP", "DISABLING_QUICK", "DISABLING_COAST", "ALARM_DISABLED", "RESTARTING"}
)
"""States in which an axis follows nothing."""
_SYNCHRONOUS, _DESYNCHRONISING = 3, 4
"""Phases."""
_FOLLOWS: Final = (2, 3)
_SHARE: Final = 1e-6
"""Share of the positions at hand, and at least as many units, up to which they count as equal."""
_OFFSET: Final = 1 << 4 | 1 << 5
_SUPERIMPOSED_2: Final = 1 << 6 | 1 << 7
_SUPERIMPOSED: Final = 1 << 23
_NOT_CONTROLLED: Final = 1 << 28


@dataclass(frozen=True)
class _Stretch:
    """A time in which an axis is under one synchronous job."""

    follows: Event
    """What it follows."""
    first: int
    """First sample."""
    last: int
    """Sample behind the last one."""


def check_synchronous_operation(trace: Trace) -> list[Check]:
    """Return the checks of all rules on all axes of a trace that followed something."""
    checks = []
    for axis in trace.components_with("sync_phase", "function_position", "leading_position"):
        followed = list(trace.select(source=axis, kind="axis.follows"))
        if followed:
            stretches = list(_stretches(trace, axis, followed))
            checks.append(_on_its_function(trace, axis, stretches))
            checks.append(_leading_value(trace, axis, stretches))
        jobs = [
            entry for entry in trace.select(source=axis, kind="job.") if entry.data.get("instruction") in JOBS
        ]
        if jobs:
            checks.append(_one_end(trace, axis, jobs))
            checks.append(_rest_behind_the_end(trace, axis, jobs))
    return [check for check in checks if check is not None]


def _check(rule: tuple[str, str], found: list[Finding], seen: str, requirements: list[str]) -> Check | None:
    """Return the check of a rule, its name and what it says; None: nothing was seen."""
    if not seen and not found:
        return None
    found.sort()
    more = f"; {len(found)} times in all" if len(found) > 1 else ""
    return Check(
        name=rule[0],
        verdict=Verdict.FAILED if found else Verdict.PASSED,
        expected=rule[1],
        observed=found[0][1] + more if found else seen,
        time_s=found[0][0] if found else None,
        requirements=requirements,
    )


def _stretches(trace: Trace, axis: str, followed: list[Event]) -> Iterator[_Stretch]:
    times = trace[f"{axis}.sync_phase"].time_s
    starts = [int(np.searchsorted(times, entry.time_ns * 1e-9 - 1e-9)) for entry in followed]
    for number, entry in enumerate(followed):
        end = starts[number + 1] if number + 1 < len(starts) else len(times)
        if end > starts[number]:
            yield _Stretch(entry, starts[number], end)


# -- the function


def _on_its_function(trace: Trace, axis: str, stretches: list[_Stretch]) -> Check | None:
    """While the axis is synchronous its setpoint is the function of its leading value, and its velocity the
    derivative (SYN-118, SYN-119, CAM-105).
    """
    rows = _Rows(trace, axis)
    found: list[Finding] = []
    judged = 0
    for stretch in stretches:
        function = _function(trace, stretch.follows)
        if function is not None:
            count, wrong = rows.compared(stretch, function)
            judged += count
            found += wrong
    return _check(
        (f"{axis} on its function", "while it is synchronous, positions and velocities by its gear or cam"),
        found,
        f"{judged} synchronous cycles" if judged else "",
        ["SYN-118", "SYN-119"],
    )


class _Rows:
    """What is recorded of one axis.

    Args:
        trace: The recording.
        axis: The axis.

    """

    def __init__(self, trace: Trace, axis: str) -> None:
        def values(name: str) -> Numbers:
            return trace[f"{axis}.{name}"].values

        self._times = trace[f"{axis}.sync_phase"].time_s
        self._synchronous = np.round(values("sync_phase")) == _SYNCHRONOUS
        self._x, self._x_zero = values("leading_position"), values("leading_zero")
        self._y, self._y_zero = values("function_position"), values("following_zero")
        self._setpoint, self._speed = values("position_setpoint"), values("velocity_setpoint")
        self._leading_speed = values("leading_velocity")
        self._unit = trace[f"{axis}.function_position"].unit
        self._alone = ~_beside(trace, axis)
        self._fine = f"{axis}.interpolator_s" in trace.constants

    def compared(self, stretch: _Stretch, function: Function) -> tuple[int, list[Finding]]:
        """Return how many samples were judged, and the first of each kind that are not by the function."""
        part = slice(stretch.first, stretch.last)
        data, unit, times = stretch.follows.data, self._unit, self._times[part]
        here, x, y = self._synchronous[part], self._x[part], self._y[part]
        by_velocity = "updated" in data
        wanted, slope = function(x - self._x_zero[part])
        wanted = wanted + self._y_zero[part]
        near = _SHARE * np.maximum(1.0, np.maximum(np.abs(wanted), np.abs(x)))
        found: list[Finding] = []
        if not by_velocity:
            off = here & (np.abs(y - wanted) > near)
            found += _first(times, off, lambda i: f"{y[i]:.6g} {unit} in place of {wanted[i]:.6g}")
        free = here & self._alone[part]
        if self._fine:
            return int(np.count_nonzero(here)), found  # setpoints of the servo lie between those of the job
        if not by_velocity:
            shown = self._setpoint[part]
            # At the end of a simulation the axis is synchronous again and follows from the next cycle on.
            following = free & np.concatenate(([False], here[:-1]))
            off = following & (np.abs(shown - y) > near)
            found += _first(times, off, lambda i: f"setpoint {shown[i]:.6g} {unit}, function {y[i]:.6g}")
        rate, speed = slope * self._leading_speed[part], self._speed[part]
        off = free & (np.abs(speed - rate) > _SHARE * np.maximum(1.0, np.abs(rate)))
        if "cam" in data:
            off[1:] &= off[:-1]  # it has two slopes where its pieces meet
        found += _first(times, off, lambda i: f"{speed[i]:.6g} {unit}/s in place of {rate[i]:.6g}")
        return int(np.count_nonzero(free if by_velocity else here)), found


def _first(times: Numbers, broken: Flags, text: Callable[[int], str]) -> list[Finding]:
    """Return the first sample that is broken."""
    places = np.flatnonzero(broken)
    return [(float(times[places[0]]), text(int(places[0])))] if len(places) else []


def _beside(trace: Trace, axis: str) -> Flags:
    """Return the samples in which something is superimposed, or the following value is shifted; and those
    next to them.
    """
    word = trace[f"{axis}.status_word"].values.astype(np.int64)
    word2 = trace[f"{axis}.status_word2"].values.astype(np.int64)
    flags: Flags = np.asarray((word & _SUPERIMPOSED | word2 & (_OFFSET | _SUPERIMPOSED_2)) != 0, dtype=bool)
    spread = flags.copy()
    spread[1:] |= flags[:-1]
    spread[:-1] |= flags[1:]
    return spread


Function = Callable[[Numbers], tuple[Numbers, Numbers]]
"""Following values and their derivatives of leading values."""


def _function(trace: Trace, follows: Event) -> Function | None:
    """Return the function of a synchronous job; None: the trace does not hold it."""
    data = follows.data
    if "cam" not in data:
        if data.get("updated"):
            return None  # the program changes the ratio while it runs
        numerator, denominator = _number(data, "numerator"), _number(data, "denominator")
        x0, y0 = _number(data, "master"), _number(data, "slave")
        return lambda x: (
            y0 + numerator * (x - x0) / denominator,
            np.full_like(x, numerator / denominator),
        )
    texts = [
        str(entry.data.get("function", ""))
        for entry in trace.select(source=str(data["cam"]), kind="cam.interpolated")
        if entry.time_ns <= follows.time_ns
    ]
    if not texts or not texts[-1]:
        return None
    pieces = np.array(json.loads(texts[-1]), dtype=np.float64)
    return _cam(pieces, data)


def _number(data: Mapping[str, Scalar], key: str) -> float:
    """Return a number of an event; 0 where it says nothing."""
    return float(str(data.get(key, 0.0)))


def _cam(pieces: Numbers, data: Mapping[str, Scalar]) -> Function:
    """Return the function of a cam, scaled and shifted (CAM-105, CAM-104)."""
    scale_x, scale_y = _number(data, "master_scaling"), _number(data, "slave_scaling")
    x0, y0, mode = _number(data, "master"), _number(data, "slave"), int(_number(data, "mode"))
    start, end = float(pieces[0, 0]), float(pieces[-1, 1])
    period = end - start
    lift = _evaluate(pieces, np.array([end]))[0][0] - _evaluate(pieces, np.array([start]))[0][0]

    def function(x: Numbers) -> tuple[Numbers, Numbers]:
        argument = (x - x0) / scale_x
        added = np.zeros_like(argument)
        if mode:
            cycle = np.floor((argument - start) / period)
            argument = argument - cycle * period
            added = cycle * lift if mode == 2 else added
        y, slope = _evaluate(pieces, argument)
        return (y + added) * scale_y + y0, slope * scale_y / scale_x

    return function


def _evaluate(pieces: Numbers, x: Numbers) -> tuple[Numbers, Numbers]:
    """Return values and derivatives of piecewise polynomials with a sine, at the ends outside of them."""
    inside = np.clip(x, pieces[0, 0], pieces[-1, 1])
    number = np.clip(np.searchsorted(pieces[:, 0], inside, side="right") - 1, 0, len(pieces) - 1)
    piece = pieces[number]
    s = inside - piece[:, 2]
    powers = s[:, None] ** np.arange(7)
    y = (piece[:, 3:10] * powers).sum(axis=1)
    slope = (piece[:, 4:10] * np.arange(1, 7) * powers[:, :6]).sum(axis=1)
    angle = piece[:, 11] * s + piece[:, 12]
    return y + piece[:, 10] * np.sin(angle), slope + piece[:, 10] * piece[:, 11] * np.cos(angle)


# -- the leading value


def _leading_value(trace: Trace, axis: str, stretches: list[_Stretch]) -> Check | None:
    """The leading value is the setpoint of the leading axis in the same cycle, and what is added to it
    (SYN-015, SYN-020, SYN-223).
    """
    phase = trace[f"{axis}.sync_phase"]
    x, shift = (trace[f"{axis}.{name}"].values for name in ("leading_position", "leading_shift"))
    found: list[Finding] = []
    judged = 0
    for stretch in stretches:
        leader = str(stretch.follows.data["leader"])
        name = f"{leader}.position_setpoint"
        if stretch.follows.data["coupling"] != "setpoint" or name not in trace:
            continue
        if any(f"{one}.interpolator_s" in trace.constants for one in (axis, leader)):
            continue
        part = slice(stretch.first, stretch.last)
        given = trace[name]
        if len(given) != len(phase):
            continue
        here = np.isin(np.round(phase.values[part]), _FOLLOWS)
        own = x[part] - shift[part]
        value = given.values[part]
        # An axis that is called before its leading axis has the value of the cycle before.
        before = given.values[max(stretch.first - 1, 0) : stretch.last - 1]
        before = value if len(before) != len(value) else before
        # The leading axis may be moved by its program or alarm after this axis has been called.
        error = np.minimum(np.abs(own - value), np.abs(own - before))
        off = (
            here & (error > _SHARE * np.maximum(1.0, np.abs(value))) & ~_moved_otherwise(trace, leader, part)
        )
        judged += int(np.count_nonzero(here))
        found += _first(
            phase.time_s[part],
            off,
            lambda i, own=own, value=value, leader=leader: (  # type: ignore[misc]
                f"{own[i]:.6g} while {leader} gives {value[i]:.6g}"
            ),
        )
    return _check(
        (f"leading value of {axis}", "the setpoint of the leading axis, in the same cycle"),
        found,
        f"{judged} cycles" if judged else "",
        ["SYN-015", "SYN-020"],
    )


def _moved_otherwise(trace: Trace, leader: str, part: slice) -> Flags:
    """Return the samples next to a change of the leading axis that is no motion (homing, state, alarm), and
    those without position control.
    """
    times = trace[f"{leader}.position_setpoint"].time_s
    flags = np.zeros(len(times), dtype=bool)
    for kind in ("axis.homed", "axis.state", "alarm.raised"):
        for entry in trace.select(source=leader, kind=kind):
            at = int(np.searchsorted(times, entry.time_ns * 1e-9 - 1e-9))
            flags[max(at - 2, 0) : at + 3] = True
    # Without position control an axis has no positions to give (SYN-026).
    free = trace[f"{leader}.status_word"].values.astype(np.int64) & _NOT_CONTROLLED != 0
    flags |= free
    flags[1:] |= free[:-1]
    flags[:-1] |= free[1:]
    return flags[part]


# -- the ends of jobs


def _one_end(trace: Trace, axis: str, jobs: list[Event]) -> Check | None:
    """A synchronous job ends once, by one of the ends that it has, and not later than its axis goes out of
    operation (MC-071, SYN-135).
    """
    found: list[Finding] = []
    count = 0
    running: dict[str, Event] = {}
    reached: set[str] = set()
    for entry in jobs:
        when = entry.time_ns * 1e-9
        name, instruction = str(entry.data["job"]), str(entry.data["instruction"])
        if entry.kind == "job.started":
            running[name] = entry
            reached.discard(name)
            count += 1
        elif entry.kind == "job.synchronous":
            if name not in running:
                found.append((when, f"{name} is synchronous and has ended before"))
            elif name in reached:
                found.append((when, f"{name} becomes synchronous twice"))
            reached.add(name)
        elif entry.kind in _ENDS:
            if running.pop(name, None) is None and entry.kind != "job.error":
                found.append((when, f"{name}: a second end, {entry.kind}"))
            if entry.kind == "job.done" and instruction in ENDLESS:
                found.append((when, f"{name}: Done, which {instruction} does not have"))
    if running:
        found += _outlived(trace, axis, running)
    says = "each ends once, by an end that it has, at the latest with the operation of the axis"
    return _check(
        (f"synchronous jobs of {axis}", says),
        found,
        f"{count} jobs" if count else "",
        ["MC-071"],
    )


def _outlived(trace: Trace, axis: str, running: dict[str, Event]) -> Iterator[Finding]:
    """Return the jobs that go on at the end of the trace though the axis has left operation since."""
    signal = trace[f"{axis}.state"]
    off = np.isin(np.round(signal.values), [code for code, text in signal.enum.items() if text in _OFF])
    for name, entry in running.items():
        later = np.flatnonzero(off & (signal.time_s > entry.time_ns * 1e-9 + 1e-6))
        # Two cycles: the job is told in the cycle behind the one in which the state is recorded.
        if len(later) > 2:
            yield float(signal.time_s[later[2]]), f"{name} goes on while {axis} is out of operation"


def _rest_behind_the_end(trace: Trace, axis: str, jobs: list[Event]) -> Check | None:
    """After `MC_GearOut` and `MC_CamOut` have come to their end the axis stands until something new begins
    (SYN-206).
    """
    velocity, phase = trace[f"{axis}.velocity_setpoint"], trace[f"{axis}.sync_phase"]
    begun = sorted(
        entry.time_ns * 1e-9
        for kind in ("job.started", "job.active", "axis.state", "alarm.raised", "axis.homed", "program.write")
        for entry in trace.select(source=axis, kind=kind)
    )
    found: list[Finding] = []
    count = 0
    for entry in jobs:
        if entry.kind != "job.done" or entry.data["instruction"] not in LEAVING:
            continue
        since = entry.time_ns * 1e-9
        at = int(np.searchsorted(phase.time_s, since - 1e-9)) - 1
        if at < 0 or round(float(phase.values[at])) != _DESYNCHRONISING:
            continue  # it has ended a job that waits, and the axis goes on (SYN-209)
        until = next((when for when in begun if when > since + 1e-9), trace.end_s)
        part = velocity.between(since + 1e-9, until - 1e-9)
        moving = np.flatnonzero(np.abs(part.values) > _SHARE)
        count += 1
        if len(moving):
            found.append(
                (
                    float(part.time_s[moving[0]]),
                    f"{part.values[moving[0]]:.4g} {part.unit} after {entry.data['job']} has ended",
                )
            )
    return _check(
        (f"{axis} after desynchronising", "it stands until another job begins"),
        found,
        f"{count} ends" if count else "",
        ["SYN-206"],
    )
