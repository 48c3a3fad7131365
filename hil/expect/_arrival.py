"""An event that has to come, and in time: what expectations of alarms and of error codes have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from fieldbus.history import Event
from hil.expect._base import SLACK_S, Expectation, Reference, instant
from hil.expect._wording import moment, within
from hil.record import Trace
from reports.model import Check


def events_between(
    trace: Trace, kind: str, source: str | None, since_s: float, until_s: float
) -> list[Event]:
    """Return the events of a kind between two times, s, both included; `source` None: of anybody."""
    return [
        entry
        for entry in trace.select(source=source, kind=kind)
        if since_s - SLACK_S <= entry.time_ns * 1e-9 <= until_s + SLACK_S
    ]


def judge_arrival(
    expectation: Expectation,
    trace: Trace,
    entries: Sequence[Event],
    is_it: Callable[[Event], bool],
    *,
    subject: str,
    since: Reference,
    within_s: float | None,
    told: Callable[[Sequence[Event]], str],
    instead: Callable[[Sequence[Event]], str],
    wrong: Callable[[Event], str] = lambda _: "",
) -> list[Check]:
    """Judge whether the first event that is the expected one came in time.

    Args:
        expectation: Whose check it is.
        trace: What is judged.
        entries: Events of the kind since the reference instant.
        is_it: Whether an event is the expected one.
        subject: Name of the expected event.
        since: Reference instant.
        within_s: Bound after it, s; None: up to the end of the trace.
        told: Events as the check lists them.
        instead: What came, where the expected one did not.
        wrong: What is not as expected about the event, as a clause; empty: nothing.

    """
    since_s = instant(trace, since)
    entry = next((one for one in entries if is_it(one)), None)
    if entry is None:
        bound_s = None if within_s is None else since_s + within_s
        sentence = f"{subject} did not come{moment(since, None)}, {instead(entries)}{within(within_s)}"
        return [expectation.missing(trace, told(entries), since_s, bound_s, sentence=sentence)]
    at_s = entry.time_ns * 1e-9
    delay_s = at_s - since_s
    flaw = wrong(entry)
    return [
        expectation.outcome(
            passed=not flaw and (within_s is None or delay_s <= within_s + SLACK_S),
            observed=f"{told([entry])}, {delay_s:.6f} s after",
            time_s=at_s,
            value=delay_s,
            unit="s",
            low=0.0 if within_s is not None else None,
            high=within_s,
            since_s=since_s,
            sentence=f"{subject} came{moment(since, delay_s)}{within(within_s)}{flaw}",
        )
    ]
