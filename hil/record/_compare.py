"""Finding the first difference of two traces that ought to be equal."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from hil.record._trace import Trace, TraceFrame, TraceGroup, event_json


@dataclass(frozen=True)
class Difference:
    """Where two traces part."""

    time_s: float
    subject: str
    """What differs: an event, a signal sample or a frame."""
    left: str
    right: str

    def __str__(self) -> str:
        return f"at {self.time_s:.6f} s {self.subject}: {self.left} against {self.right}"


def first_difference(left: Trace, right: Trace) -> Difference | None:
    """Return the earliest difference of two traces, or None when they are equal.

    Of differences at the same instant an event comes before a sample and a sample before a frame, because an
    event says best what happened.
    """
    found = [
        difference
        for difference in (_events(left, right), _samples(left, right), _frames(left, right))
        if difference is not None
    ]
    return min(found, key=lambda difference: difference.time_s) if found else None


def _events(left: Trace, right: Trace) -> Difference | None:
    for a, b in zip(left.events, right.events, strict=False):
        if a != b and event_json(a) != event_json(b):
            return Difference(
                min(a.time_ns, b.time_ns) * 1e-9,
                f"event {a.kind} of {a.source}",
                event_json(a),
                event_json(b),
            )
    shorter = min(len(left.events), len(right.events))
    for trace, mine in ((left, True), (right, False)):
        if len(trace.events) > shorter:
            entry = trace.events[shorter]
            text, nothing = event_json(entry), "nothing"
            return Difference(
                entry.time_ns * 1e-9,
                f"event {entry.kind} of {entry.source}",
                text if mine else nothing,
                nothing if mine else text,
            )
    return None


def _samples(left: Trace, right: Trace) -> Difference | None:
    mine = {group.name: group for group in left.groups}
    theirs = {group.name: group for group in right.groups}
    if list(mine) != list(theirs):
        return Difference(0.0, "recorded groups", ", ".join(mine), ", ".join(theirs))
    found = [
        difference
        for name, group in mine.items()
        if (difference := _group_difference(group, theirs[name])) is not None
    ]
    return min(found, key=lambda difference: difference.time_s) if found else None


def _group_difference(left: TraceGroup, right: TraceGroup) -> Difference | None:
    if left.columns != right.columns:
        return Difference(0.0, f"columns of {left.name}", str(left.columns), str(right.columns))
    rows = min(len(left.time_ns), len(right.time_ns))
    moved = np.flatnonzero(left.time_ns[:rows] != right.time_ns[:rows])
    a, b = left.values[:rows], right.values[:rows]
    # Compared bit by bit, as the digest does: not-a-number equals itself, and the two zeros differ.
    differs = np.ascontiguousarray(a).view(np.uint64) != np.ascontiguousarray(b).view(np.uint64)
    unequal = np.flatnonzero(differs.any(axis=1)) if rows else moved
    row = min([*moved[:1].tolist(), *unequal[:1].tolist()], default=None)
    if row is not None:
        time_s = min(int(left.time_ns[row]), int(right.time_ns[row])) * 1e-9
        if left.time_ns[row] != right.time_ns[row]:
            return Difference(
                time_s, f"sample time of {left.name}", f"{left.time_ns[row]} ns", f"{right.time_ns[row]} ns"
            )
        column = int(np.flatnonzero(differs[row])[0])
        name, unit = left.columns[column]
        return Difference(
            time_s,
            f"signal {left.name}.{name}",
            f"{float(a[row, column])!r} {unit}".rstrip(),
            f"{float(b[row, column])!r} {unit}".rstrip(),
        )
    if len(left.time_ns) != len(right.time_ns):
        longer = left if len(left.time_ns) > rows else right
        return Difference(
            int(longer.time_ns[rows]) * 1e-9,
            f"number of samples of {left.name}",
            str(len(left.time_ns)),
            str(len(right.time_ns)),
        )
    return None


def _frames(left: Trace, right: Trace) -> Difference | None:
    for a, b in zip_longest(left.iter_frames(), right.iter_frames()):
        if a == b:
            continue
        there = a or b
        assert there is not None  # one of them is longer
        time_ns = min(one.time_ns for one in (a, b) if one is not None)
        return Difference(time_ns * 1e-9, f"frame on {there.bus}", _frame(a), _frame(b))
    return None


def _frame(frame: TraceFrame | None) -> str:
    if frame is None:
        return "nothing"
    body = f"R{frame.dlc}" if frame.remote else frame.data.hex(" ").upper()
    problem = f" ({frame.error})" if frame.error else ""
    return f"{frame.time_ns} ns {frame.sender} {frame.can_id:03X}#{body}{problem}"
