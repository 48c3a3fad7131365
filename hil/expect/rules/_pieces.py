"""A long trace in pieces that overlap: rules hold in memory what they look at."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from fieldbus.history import Event
    from hil.record import Trace

_SAMPLES: Final = 131_072
"""Samples of all components together up to which a trace is judged in one piece: 174 s of an axis with its
drive and segment, 58 s of four, with a cycle of 4 ms.
"""
_OVERLAP: Final = 2_500
"""Samples before and behind a piece that its rules see, too: 10 s with a cycle of 4 ms."""
_WHAT: Final = ("job", "number", "variable", "start", "injection", "fault", "name", "object", "code")
"""Details that say what an event is about: of each the last one before a piece tells what holds then."""


def pieces(trace: Trace, *, longest: int | None = None) -> Iterator[tuple[Trace, tuple[float, float] | None]]:
    """Return the pieces of a trace with the times from which on and before which findings of each count, s;
    None: all do.

    Args:
        trace: The trace.
        longest: Samples of a component in a piece, without those of the overlap; None: by the number of
            components.

    """
    most = max(trace.groups, key=lambda group: len(group.time_ns), default=None)
    if longest is None:
        longest = _SAMPLES // max(1, len(trace.groups))
    if most is None or len(most.time_ns) <= longest:
        yield trace, None
        return
    times, overlap = most.time_ns, min(_OVERLAP, longest)
    events = iter(trace.events)
    before: dict[tuple[object, ...], Event] = {}
    kept: list[Event] = []
    ahead: Event | None = next(events, None)
    for first in range(0, len(times), longest):
        last = min(first + longest, len(times))
        ending = last == len(times)
        from_ns = int(times[max(first - overlap, 0)]) if first else 0
        # Events of the last moment come behind the last sample.
        to_ns = int(times[last + overlap - 1]) if last + overlap < len(times) else trace.end_ns
        while ahead is not None and ahead.time_ns <= to_ns:
            kept.append(ahead)
            ahead = next(events, None)
        past = [entry for entry in kept if entry.time_ns < from_ns]
        for entry in past:
            key = (entry.source, entry.kind, *(entry.data.get(name) for name in _WHAT))
            before.pop(key, None)
            before[key] = entry
        del kept[: len(past)]
        yield (
            trace.window(from_ns * 1e-9, to_ns * 1e-9, events=[*before.values(), *kept]),
            (
                float(times[first] * 1e-9) if first else float("-inf"),
                float("inf") if ending else float(times[last] * 1e-9),
            ),
        )
