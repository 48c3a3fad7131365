"""Expectations about the event log: alarms, jobs, states, order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Final

from typing_extensions import override

from fieldbus.errors import ConfigurationError
from fieldbus.history import Event
from hil.expect._arrival import events_between, judge_arrival
from hil.expect._base import (
    SLACK_S,
    Expectation,
    Reference,
    check_bound,
    check_whole,
    end_of,
    instant,
    value_in_force,
    words_of,
    words_of_span,
)
from hil.expect._hidden import hidden_state
from hil.expect._wording import allowed, clause, instant_words, moment, period, within
from hil.record import EventSelector, Trace, check_state
from hil.record import event as select_event
from reports.model import Check
from reports.text import REACTION_NAMES, reaction_name

_LAST_ALARM: Final = 9999

JOB_OUTPUTS: Final = {
    "Busy": "job.started",
    "Active": "job.active",
    "InVelocity": "job.in_velocity",
    "Done": "job.done",
    "CommandAborted": "job.aborted",
    "Error": "job.error",
}
"""Output of an instruction and the kind of event of its rising edge."""


def nth_of(entries: Sequence[Event], nth: int) -> Event | None:
    """Return the `nth` of some events, counted from the last one if negative; None where there are fewer."""
    index = nth - 1 if nth > 0 else nth
    return entries[index] if -len(entries) <= index < len(entries) else None


def _event_text(entry: Event, *keys: str) -> str:
    parts = [f"{key} {entry.data[key]}" for key in keys if entry.data.get(key) not in (None, "")]
    return f"{', '.join(parts)} at {entry.time_ns * 1e-9:.6f} s"


def _listed(entries: Sequence[Event]) -> str:
    return "; ".join(_event_text(entry, "number", "reaction", "text") for entry in entries) or "no alarm"


@dataclass(frozen=True)
class alarm(Expectation):
    """Expect technology alarm `number`, with `reaction`, at most `within_s` after `since`.

    Args:
        number: Number of the technology alarm.
        reaction: Expected reaction, 0 to 15 (for an axis 0 to 5); None: any.
        within_s: Bound after `since`, s; None: up to the end of the trace.
        since: Reference instant.
        axis: Name of the axis; None: any.

    Raises:
        ConfigurationError: `number` or `reaction` is none, or `within_s` is negative.

    """

    number: int
    _: KW_ONLY
    reaction: int | None = None
    within_s: float | None = None
    since: Reference = 0.0
    axis: str | None = None

    def __post_init__(self) -> None:
        check_whole("alarm.number", self.number, 1, _LAST_ALARM)
        check_whole("alarm.reaction", self.reaction, 0, max(REACTION_NAMES))
        check_bound("alarm.within_s", self.within_s)

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"alarm {self.number}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        reaction = "" if self.reaction is None else f" with reaction {self.reaction}"
        bound = "" if self.within_s is None else f" within {self.within_s:g} s"
        return f"alarm {self.number}{reaction}{bound} after {words_of(self.since)}"

    @override
    def events_named(self) -> Iterator[EventSelector]:
        yield select_event("alarm.raised", self.axis, number=self.number)
        yield from super().events_named()

    @override
    def needed_until(self, trace: Trace) -> Reference:
        return self.since

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace."""
        return judge_arrival(
            self,
            trace,
            events_between(trace, "alarm.raised", self.axis, instant(trace, self.since), trace.end_s),
            lambda entry: entry.data.get("number") == self.number,
            subject=self._subject,
            since=self.since,
            within_s=self.within_s,
            told=_listed,
            instead=lambda others: f"instead {_numbers(others)} came" if others else "no alarm came",
            wrong=self._other_reaction,
        )

    def _other_reaction(self, entry: Event) -> str:
        found = int(entry.data.get("reaction") or 0)
        if self.reaction is None or found == self.reaction:
            return ""
        return (
            f", but with reaction {found} ({reaction_name(found)}) "
            f"instead of {self.reaction} ({reaction_name(self.reaction)})"
        )

    @property
    def _subject(self) -> str:
        return f"alarm {self.number}" + (f" of {self.axis}" if self.axis else "")


def _numbers(entries: Sequence[Event]) -> str:
    numbers = [str(entry.data.get("number")) for entry in entries]
    more = f" and {len(numbers) - 3} more" if len(numbers) > 3 else ""
    return f"alarm{'s' if len(numbers) > 1 else ''} {', '.join(numbers[:3])}{more}"


@dataclass(frozen=True)
class no_alarm(Expectation):
    """Expect no alarm from `since` to `until` (default: the end), besides the numbers given.

    Args:
        since: Begin of the observation.
        until: End of the observation; None: the end of the trace.
        axis: Name of the axis; None: all.
        besides: Numbers of alarms that may come.

    Raises:
        ConfigurationError: One of `besides` is no number of an alarm.

    """

    _: KW_ONLY
    since: Reference = 0.0
    until: Reference | None = None
    axis: str | None = None
    besides: Sequence[int] = ()

    def __post_init__(self) -> None:
        for number in self.besides:
            check_whole("no_alarm.besides", number, 1, _LAST_ALARM)

    @property
    def title(self) -> str:
        """Name made from the content."""
        return "no alarm" if not self.besides else f"no alarm besides {', '.join(map(str, self.besides))}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        return f"{self.title} {words_of_span(self.since, self.until)}"

    @override
    def events_named(self) -> Iterator[EventSelector]:
        yield select_event("alarm.raised", self.axis)
        yield from (select_event("alarm.raised", number=number) for number in self.besides)
        yield from super().events_named()

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace."""
        start_s, end_s = instant(trace, self.since), end_of(trace, self.until)
        entries = events_between(trace, "alarm.raised", self.axis, start_s, end_s)
        entries = [entry for entry in entries if entry.data.get("number") not in self.besides]
        when = entries[0].time_ns * 1e-9 if entries else None
        besides = f" but {', '.join(map(str, self.besides))}" if self.besides else ""
        axis = f" of {self.axis}" if self.axis else ""
        sentence = f"no alarm{axis}{besides} came {period(self.since, self.until)}"
        if when is not None:
            sentence = f"{_numbers(entries)}{axis} came at {instant_words(when)}{allowed(f'none{besides}')}"
        return [self.outcome(passed=not entries, observed=_listed(entries), time_s=when, sentence=sentence)]


@dataclass(frozen=True)
class happens(Expectation):
    """Expect an event at most `within_s` after `since`, and not after `until`.

    Args:
        selector: The event, without an offset.
        since: Reference instant.
        within_s: Bound after `since`, s; None: none.
        until: Latest instant; None: the end of the trace.
        never: The event must not happen in this time; `never_happens` reads better.

    Raises:
        ConfigurationError: The event has an offset, or `within_s` is negative.

    """

    selector: EventSelector
    _: KW_ONLY
    since: Reference = 0.0
    within_s: float | None = None
    until: Reference | None = None
    never: bool = False

    def __post_init__(self) -> None:
        _check_event("never_happens" if self.never else "happens", self.selector)
        check_bound("happens.within_s", self.within_s)

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"never {self.selector}" if self.never else str(self.selector)

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        bound = "" if self.within_s is None else f" within {self.within_s:g} s"
        until = "" if self.until is None else f" until {words_of(self.until)}"
        return f"{self.title}{bound} after {words_of(self.since)}{until}"

    @override
    def needed_until(self, trace: Trace) -> Reference:
        return super().needed_until(trace) if self.never else self.since

    @override
    def components_named(self) -> tuple[str, ...]:
        return (self.selector.source or "",)

    @override
    def needs_values(self) -> bool:
        return self.selector.kind.startswith("drive.") and self.selector.kind != "drive.nmt"

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace."""
        since_s, until_s = instant(trace, self.since), end_of(trace, self.until)
        inside = [
            entry
            for entry in self.selector.select(trace.events)
            if since_s - SLACK_S <= entry.time_ns * 1e-9 <= until_s + SLACK_S
        ]
        entry = nth_of(inside, self.selector.nth)
        phrase = clause(self.selector)
        limit = within(self.within_s)
        hidden = hidden_state(trace, self.selector, since_s, until_s) if entry is None else ""
        if hidden:
            return [self.unseen(trace, f"it was not seen, but {hidden}", since_s)]
        if self.never:
            observed = (
                "it did not happen" if entry is None else f"{entry.kind} at {entry.time_ns * 1e-9:.6f} s"
            )
            when = None if entry is None else entry.time_ns * 1e-9
            sentence = f"{phrase.subject} {phrase.denied} {period(self.since, self.until)}"
            if when is not None:
                sentence = f"{phrase.subject} {phrase.past} at {instant_words(when)}{allowed('never')}"
            return [
                self.outcome(
                    passed=entry is None, observed=observed, time_s=when, since_s=since_s, sentence=sentence
                )
            ]
        if entry is None:
            bounds = [since_s + self.within_s] if self.within_s is not None else []
            bounds += [until_s] if self.until is not None else []
            instead = self._seen_instead(trace, since_s)
            sentence = f"{phrase.subject} {phrase.denied}{moment(self.since, None)}{limit}{instead}"
            return [
                self.missing(
                    trace,
                    f"it did not happen{instead}",
                    since_s,
                    min(bounds, default=None),
                    sentence=sentence,
                )
            ]
        delay_s = entry.time_ns * 1e-9 - since_s
        return [
            self.outcome(
                passed=self.within_s is None or delay_s <= self.within_s + SLACK_S,
                observed=f"{entry.kind} of {entry.source} {delay_s:.6f} s after",
                time_s=entry.time_ns * 1e-9,
                value=delay_s,
                unit="s",
                low=0.0 if self.within_s is not None else None,
                high=self.within_s,
                since_s=since_s,
                sentence=f"{phrase.subject} {phrase.past}{moment(self.since, delay_s)}{limit}",
            )
        ]

    def _seen_instead(self, trace: Trace, since_s: float) -> str:
        """Tell what the same job or component did in its place."""
        family = self.selector.kind.split(".")[0] + "."
        near = [
            entry
            for entry in trace.select(source=self.selector.source, kind=family)
            if entry.time_ns * 1e-9 >= since_s - SLACK_S
            and ("job" not in self.selector.data or entry.data.get("job") == self.selector.data["job"])
        ]
        texts = [
            f"{entry.kind}"
            + (f" to {entry.data['to']}" if "to" in entry.data else "")
            + (
                f" 16#{entry.data['error_id']:04X}"
                if isinstance(entry.data.get("error_id"), int) and entry.data["error_id"]
                else ""
            )
            + f" at {entry.time_ns * 1e-9:.6f} s"
            for entry in near[:3]
        ]
        return f"; instead: {', '.join(texts)}" if texts else ""


@dataclass(frozen=True)
class event_order(Expectation):
    """Expect events in this order in the log, others in between allowed.

    Args:
        selectors: The events, without offsets.
        since: Reference instant.

    Raises:
        ConfigurationError: No event is given, or one has an offset.

    """

    selectors: Sequence[EventSelector]
    _: KW_ONLY
    since: Reference = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "selectors", tuple(self.selectors))
        if not self.selectors:
            raise ConfigurationError("event_order.selectors", self.selectors, "at least one event")
        for one in self.selectors:
            _check_event("event_order", one)

    @property
    def title(self) -> str:
        """Name made from the content."""
        return "order of events"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        return f"{', then '.join(map(str, self.selectors))} after {words_of(self.since)}"

    @override
    def needed_until(self, trace: Trace) -> Reference:
        return self.since

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace: every event must come in the log behind the one before it."""
        since_s = instant(trace, self.since)
        start = next(
            (n for n, entry in enumerate(trace.events) if entry.time_ns * 1e-9 >= since_s - SLACK_S),
            len(trace.events),
        )
        position = start
        found: list[str] = []
        for selector in self.selectors:
            places = [n for n in range(start, len(trace.events)) if selector.matches(trace.events[n])]
            if selector.nth == 1:
                at = next((n for n in places if n >= position), None)
            else:
                index = selector.nth - 1 if selector.nth > 0 else selector.nth
                at = places[index] if -len(places) <= index < len(places) else None
                at = at if at is not None and at >= position else None
            if at is None:
                early = next((n for n in places if n < position), None)
                missing = (
                    "did not happen"
                    if early is None
                    else f"came too early, at {trace.events[early].time_ns * 1e-9:.6f} s"
                )
                before = f" after {', '.join(found)}" if found else ""
                when = (trace.events[position - 1].time_ns * 1e-9) if found else since_s
                hidden = hidden_state(trace, selector, since_s, trace.end_s)
                if hidden:
                    return [self.unseen(trace, f"'{selector}' {missing}{before}, but {hidden}", when)]
                return [
                    self.outcome(
                        passed=False,
                        observed=f"'{selector}' {missing}{before}",
                        time_s=when,
                        since_s=since_s,
                        sentence=self._broken(selector, trace, early),
                    )
                ]
            entry = trace.events[at]
            found.append(f"{entry.kind} at {entry.time_ns * 1e-9:.6f} s")
            position = at + 1
        when = trace.events[position - 1].time_ns * 1e-9 if found else since_s
        words = ", then ".join(instant_words(selector) for selector in self.selectors)
        return [
            self.outcome(
                passed=True, observed=", ".join(found), time_s=when, sentence=f"in order came {words}"
            )
        ]

    def _broken(self, selector: EventSelector, trace: Trace, early: int | None) -> str:
        """Return the sentence for the first event that is not in its place."""
        phrase = clause(selector)
        before = [instant_words(one) for one in self.selectors[: list(self.selectors).index(selector)]]
        behind = f" after {before[-1]}" if before else ""
        if early is None:
            return f"{phrase.subject} {phrase.denied}{behind}"
        when = trace.events[early].time_ns * 1e-9
        return f"{phrase.subject} {phrase.past} too early, at {instant_words(when)} (allowed: only{behind})"


@dataclass(frozen=True)
class state_at(Expectation):
    """Expect `component` in the state `text` at an instant.

    Args:
        component: Axis, drive, encoder or node.
        at: The instant.
        text: Name of the state.
        kind: Event kind of the state machine, where a component has several (`drive.nmt`).

    """

    component: str
    at: Reference
    text: str
    _: KW_ONLY
    kind: str = ""

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"state of {self.component}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        return f"{self.component} in state {self.text} at {words_of(self.at)}"

    @override
    def components_named(self) -> tuple[str, ...]:
        return (self.component,)

    @override
    def needs_values(self) -> bool:
        return self.kind not in ("drive.nmt", "nmt.state")

    @override
    def verify(self, trace: Trace) -> None:
        super().verify(trace)
        check_state(trace, self.component, self.text, self.kind)

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace: of every state machine of the component, the last
        event not later than the instant.
        """
        at_s = instant(trace, self.at)
        found: dict[str, Event] = {}
        for entry in trace.select(source=self.component):
            if entry.time_ns * 1e-9 > at_s + SLACK_S:
                break
            if (
                entry.kind == self.kind if self.kind else entry.kind.endswith(".state")
            ) and "to" in entry.data:
                found[entry.kind] = entry
        if found:
            states = [str(entry.data["to"]) for entry in found.values()]
            observed = ", ".join(
                f"{entry.data['to']} since {entry.time_ns * 1e-9:.6f} s" for entry in found.values()
            )
        else:
            name = f"{self.component}.state"
            states = [trace[name].text(value_in_force(trace, name, at_s))]
            observed = states[0]
        passed = self.text in states
        where = f"at {instant_words(self.at)}"
        shown = self.text if passed else " and ".join(states)
        instead = "" if passed else f" instead of {self.text}"
        sentence = f"{self.component} was in {shown}{instead} {where}"
        return [self.outcome(passed=passed, observed=observed, time_s=at_s, sentence=sentence)]


def _check_event(where: str, selector: EventSelector) -> None:
    """Refuse an instant (`event(...).plus(s)`) where an event itself is meant."""
    if selector.offset_s:
        raise ConfigurationError(
            where, str(selector), "an event; times after it go to since, until or within_s"
        )


def never_happens(
    selector: EventSelector, *, since: Reference = 0.0, until: Reference | None = None
) -> happens:
    """Expect that an event does not happen from `since` to `until` (default: the end); with nth=2 not a
    second time.
    """
    return happens(selector, since=since, until=until, never=True)


def job_output(
    job: str,
    output: str,
    *,
    within_s: float | None = None,
    since: Reference = 0.0,
    error_id: int | None = None,
) -> happens:
    """Expect the rising edge of an output of an instruction instance.

    Args:
        job: Name of the instance.
        output: Busy, Active, InVelocity, Done, CommandAborted or Error.
        within_s: Bound after `since`, s.
        since: Reference instant.
        error_id: Expected ErrorID (with Error).

    """
    kind = JOB_OUTPUTS.get(output)
    if kind is None:
        raise ConfigurationError("job_output.output", output, ", ".join(JOB_OUTPUTS))
    selector = (
        select_event(kind, job=job) if error_id is None else select_event(kind, job=job, error_id=error_id)
    )
    return happens(selector, since=since, within_s=within_s)
