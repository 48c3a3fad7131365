"""What an axis made of the fault or stop of a case, and what it takes to move again: facts for comparing
makes of controllers, measured on the trace and tried on the bench.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from reports.model import Reaction, Step
from reports.text import reaction_name

if TYPE_CHECKING:
    from fieldbus.history import Event
    from hil.bench.bench import Bench
    from hil.record import Trace

_REST: Final = 0.0005
"""Speed of the machine that counts as rest, m/s."""
_RESTS_S: Final = 0.1
"""Time for which it has to last, s."""
_STOPS: Final = ("MC_Power Enable = FALSE", "MC_Stop", "MC_Halt", "alarm ")
"""What the instruction of a case begins with that stops an axis."""
_RELEASE: Final = "MC_Stop Execute = FALSE"
_ENABLE: Final = "MC_Power Enable = TRUE"
_RESET: Final = "MC_Reset; the enable comes back without a new edge"
_RESET_AND_EDGE: Final = "MC_Reset and MC_Power with a new edge"
_TRIED_S: Final = 3.0
_WAY: Final = -5.0


def reaction_of(trace: Trace, story: Sequence[Step], *, axis: str, drive: str) -> Reaction | None:
    """Return what the axis made of the first fault, or else of the first stop of a case; None: it had
    neither, or its machine is not recorded.
    """
    applied = next(iter(trace.select(kind="fault.applied")), None)
    stop = next((step for step in story if step.kind == "do" and step.text.startswith(_STOPS)), None)
    if applied is not None:
        begin_s = applied.time_ns * 1e-9
        cause = f"{applied.data.get('fault')} on {applied.source}"
    elif stop is not None:
        begin_s, cause = stop.time_s, stop.text
    else:
        return None
    if f"{drive}.velocity" not in trace or f"{drive}.position" not in trace:
        return None
    velocity, position = trace[f"{drive}.velocity"], trace[f"{drive}.position"]
    speed = float(velocity.at(begin_s))
    reaction = Reaction(cause, begin_s, axis, drive, speed * 1000.0)
    _code(trace, reaction)
    if abs(speed) > _REST:
        rest_s = _rests(np.asarray(velocity.time_s), np.asarray(velocity.values), begin_s)
        if rest_s is not None:
            reaction.stop_s = rest_s - begin_s
            way = float(position.at(rest_s)) - float(position.at(begin_s))
            reaction.distance = abs(way) * 1000.0
    return reaction


def _code(trace: Trace, reaction: Reaction) -> None:
    """Fill in the alarm or the error that came first."""

    def first(kind: str) -> Event | None:
        entries = trace.select(source=reaction.axis, kind=kind)
        return next((one for one in entries if one.time_ns * 1e-9 >= reaction.begin_s - 1e-9), None)

    alarm, error, missing = first("alarm.raised"), first("axis.error"), first("axis.feed_missing")
    entry = alarm or error or missing
    if entry is None:
        return
    reaction.delay_s = entry.time_ns * 1e-9 - reaction.begin_s
    text = str(entry.data.get("text") or "")
    if alarm is not None:
        number = int(alarm.data.get("reaction") or 0)
        reaction.code = f"alarm {alarm.data.get('number')}" + (f": {text}" if text else "")
        reaction.response = f"reaction {number} ({reaction_name(number)})"
    else:
        reaction.code = text
        reaction.response = (
            "shut down without a ramp" if error is not None else "stopped on the ramp of its command"
        )


def _rests(time_s: Any, speed: Any, since_s: float) -> float | None:
    """Return when the machine stands for a while; None: it does not."""
    moving = np.flatnonzero((time_s >= since_s) & (np.abs(speed) > _REST))
    after = int(np.searchsorted(time_s, since_s))
    candidates = [after, *(int(index) + 1 for index in moving)]
    for index in candidates:
        if index >= len(time_s) or abs(speed[index]) > _REST:
            continue
        end = int(np.searchsorted(time_s, time_s[index] + _RESTS_S))
        if end < len(time_s) and bool((np.abs(speed[index:end]) <= _REST).all()):
            return float(time_s[index])
    return None


def shown_to_go_on(story: Sequence[Step], reaction: Reaction, *, passed: bool) -> str:
    """Return what a case has shown of going on: what it gave behind the stop, up to a motion that it waited
    for; empty: it has shown nothing.
    """
    given = [step.text for step in story if step.kind == "do" and step.time_s > reaction.begin_s]
    if not passed or not given or not given[-1].startswith("MC_Move"):
        return ""
    resets = [index for index, text in enumerate(given) if text.startswith("MC_Reset")]
    enables = [index for index, text in enumerate(given) if text.startswith("MC_Power Enable")]
    if not resets:
        if enables:
            return _ENABLE
        return _RELEASE if _RELEASE in given else ""
    return _RESET_AND_EDGE if any(index > resets[-1] for index in enables) else _RESET


def tried_to_go_on(bench: Bench, axis: str, *, disabled: bool) -> str:
    """Move the axis of a case that is over, and if it does not, do more and more until it does.

    Faults have to be taken back before.

    Args:
        bench: The bench of the case.
        axis: The axis.
        disabled: The case has disabled it.

    """
    handle: Any = bench.axis(axis)
    power = handle.power(True)

    def moves() -> bool:
        job = handle.move_relative(_WAY, Velocity=50.0)
        bench.run_until(lambda: bool(job.Done or job.Error or job.CommandAborted), _TRIED_S)
        return bool(job.Done)

    def release() -> None:
        for block in _stops(bench):
            block.set(Execute=False)
        bench.run_for(0.1)

    def reset() -> None:
        job = handle.reset()
        bench.run_until(lambda: bool(job.Done or job.Error), _TRIED_S)
        bench.run_until(power.status, 1.0)

    def edge() -> None:
        handle.power(False)
        bench.run_for(0.5)
        reset()
        handle.power(True)
        bench.run_until(power.status, _TRIED_S)

    steps: list[tuple[str, Callable[[], object]]] = [
        (
            _ENABLE if disabled else "nothing: the next command moves it",
            lambda: bench.run_until(power.status, 1.0),
        ),
        (_RESET, reset),
        (_RESET_AND_EDGE, edge),
    ]
    if _stops(bench):
        steps.insert(1, (_RELEASE, release))
    for words, step in steps:
        step()
        if moves():
            return words
    return "more than MC_Reset and MC_Power"


def _stops(bench: Bench) -> list[Any]:
    """Return the instances of `MC_Stop` that keep an axis from moving."""
    blocks: list[Any] = [*bench.runtime.user_program.instances]
    if bench.nc_axis_names:
        blocks += bench.nc.program
    return [one for one in blocks if type(one).__name__ == "MC_Stop" and one.Execute]
