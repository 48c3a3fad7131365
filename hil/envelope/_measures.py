"""What is measured in a copy of the bench after its stimulus: numbers with units, from the trace alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hil.record import Signal, Trace
    from reports.model import Check

REST_M_S: Final = 1e-3
"""Velocity up to which a linear axis counts as at rest, m/s."""
REST_RAD_S: Final = 1e-2
"""Velocity up to which a rotary axis counts as at rest, rad/s."""
_DISPLAYED: Final = {"m": (1e3, "mm"), "rad": (180.0 / np.pi, "deg")}


@dataclass(frozen=True)
class Measure:
    """A number that every branch has, of one axis."""

    name: str
    unit: str
    """`position` stands for mm or deg, as the machine moves."""
    text: str


MEASURES: Final[dict[str, Measure]] = {
    one.name: one
    for one in (
        Measure("stop_distance", "position", "Way of the machine from the stimulus to its place at rest."),
        Measure(
            "stop_time",
            "s",
            "Time from the stimulus until the machine is at rest and stays so; the time that was watched if "
            "it is never at rest.",
        ),
        Measure("overshoot", "position", "Way beyond the range that the undisturbed motion covers."),
        Measure("peak_torque", "Nm", "Greatest torque of the motor, without its sign."),
        Measure(
            "reaction_time",
            "s",
            "Time from the stimulus to the first alarm, error or change of state of an axis or drive; of an "
            "NC axis Operational, HasBeenStopped, HasJob and Error are its state. The time that was watched "
            "if there is none.",
        ),
    )
}
"""Measures by name."""


@dataclass(frozen=True)
class Range:
    """Where the undisturbed motion of an axis takes place, unit of the drive's position."""

    low: float
    high: float


def motion_range(trace: Trace, drive: str, since_s: float, until_s: float) -> Range:
    """Return the range of a drive's machine between two times."""
    values = trace[f"{drive}.position"].between(since_s, until_s).values
    return Range(float(values.min()), float(values.max()))


def unit_of(unit: str) -> str:
    """Return the unit in which positions of a machine are shown: mm for m, deg for rad."""
    return _DISPLAYED.get(unit, (1.0, unit))[1]


def display_factor(unit: str) -> float:
    """Return what a position of a machine is multiplied with to be shown."""
    return _DISPLAYED.get(unit, (1.0, unit))[0]


def rest_speed(unit: str) -> float:
    """Return the velocity up to which a machine with positions in a unit, m or rad, counts as at rest."""
    return REST_M_S if unit == "m" else REST_RAD_S


def measure(
    trace: Trace, drive: str, at_s: float, nominal: Range, watched_s: float
) -> tuple[dict[str, float], float]:
    """Return the measures of the axis behind a drive, by name, and where its machine comes to rest, or is at
    the end of the trace; positions in mm or deg.
    """
    whole = trace[f"{drive}.position"]
    position = whole.between(at_s, trace.end_s)
    velocity = trace[f"{drive}.velocity"].between(at_s, trace.end_s)
    torque = trace[f"{drive}.torque"].between(at_s, trace.end_s)
    factor = display_factor(whole.unit)
    settled = velocity.settles(rest_speed(whole.unit))
    start = whole.at(at_s)
    place = whole.at(trace.end_s if settled is None else settled) * factor
    values = np.append(position.values, start)
    beyond = max(nominal.low - float(values.min()), float(values.max()) - nominal.high, 0.0)
    measures = {
        "stop_distance": abs(place - start * factor),
        "stop_time": watched_s if settled is None else max(settled - at_s, 0.0),
        "overshoot": beyond * factor,
        "peak_torque": float(np.abs(torque.values).max(initial=0.0)),
        "reaction_time": _reaction_time(trace, at_s, watched_s),
    }
    return measures, place


_REACTIONS: Final = ("alarm.raised", "axis.error", "axis.state", "drive.state", "drive.fault")
_NC_STATE: Final = 1 << 0 | 1 << 7 | 1 << 8 | 1 << 31
"""Bits of `StateDWord` that are the state of an NC axis, which has no event for it: Operational,
HasBeenStopped, HasJob, Error.
"""


def _reaction_time(trace: Trace, at_s: float, watched_s: float) -> float:
    at_ns = round(at_s * 1e9)
    events = (entry for entry in trace.events if entry.time_ns >= at_ns and entry.kind in _REACTIONS)
    first = next(events, None)
    times = [] if first is None else [(first.time_ns - at_ns) * 1e-9]
    times += [
        (round(changed_s * 1e9) - at_ns) * 1e-9
        for axis in trace.components_with("state_dword")
        if (changed_s := _nc_state_changed(trace[f"{axis}.state_dword"], at_s)) is not None
    ]
    return min(times, default=watched_s)


def _nc_state_changed(word: Signal, at_s: float) -> float | None:
    """Return when the state of an NC axis differs for the first time from that at an instant; None: never."""
    part = word.between(at_s, float("inf"))
    if not len(part):
        return None
    state = part.values.astype(np.int64) & _NC_STATE
    changed = np.flatnonzero(state != int(word.at(at_s)) & _NC_STATE)
    return float(part.time_s[changed[0]]) if len(changed) else None


def reaction_class(trace: Trace, axes: Sequence[str], at_s: float, checks: Sequence[Check]) -> str:
    """Return what the reaction was, in words that are equal for equal reactions: alarms in their order, how
    jobs ended, the last state of each axis, and rules that were broken.
    """
    at_ns = round(at_s * 1e9)
    words: list[str] = []
    for entry in trace.events:
        if entry.time_ns < at_ns or entry.source not in axes:
            continue
        if entry.kind == "alarm.raised":
            words.append(f"{entry.source} alarm {entry.data['number']} reaction {entry.data['reaction']}")
        elif entry.kind == "axis.error":
            words.append(f"{entry.source} error 16#{int(entry.data['error_id'] or 0):04X}")
    for axis in axes:
        if f"{axis}.state" in trace:
            signal = trace[f"{axis}.state"]
            words.append(f"{axis} {signal.text_at(trace.end_s)}")
    words.extend(f"broken: {check.name}" for check in checks)
    return "; ".join(dict.fromkeys(words)) or "no alarm"
