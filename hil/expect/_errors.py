"""Expectations about axes of an NC: error codes, refused commands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import ClassVar, Final

from typing_extensions import override

from fieldbus.history import Event
from hil.expect._arrival import events_between, judge_arrival
from hil.expect._base import (
    Expectation,
    Reference,
    check_bound,
    check_whole,
    end_of,
    instant,
    words_of,
    words_of_span,
)
from hil.expect._wording import allowed, instant_words, period
from hil.record import EventSelector, Trace
from hil.record import event as select_event
from reports.model import Check

_LAST_CODE: Final = 0xFFFF


def _text(entry: Event) -> str:
    return str(entry.data.get("text") or f"0x{int(entry.data.get('error_id') or 0):04X}")


def _listed(entries: Sequence[Event]) -> str:
    return "; ".join(f"{_text(entry)} at {entry.time_ns * 1e-9:.6f} s" for entry in entries) or "none"


@dataclass(frozen=True)
class _Code(Expectation):
    """What `axis_error` and `command_refused` have in common: an event with a code, in time."""

    event_kind: ClassVar[str]
    words: ClassVar[str]

    code: int
    _: KW_ONLY
    within_s: float | None = None
    since: Reference = 0.0
    axis: str | None = None

    def __post_init__(self) -> None:
        check_whole(f"{type(self).__name__}.code", self.code, 1, _LAST_CODE)
        check_bound(f"{type(self).__name__}.within_s", self.within_s)

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"{self.words} 0x{self.code:04X}"

    @property
    def _subject(self) -> str:
        return self.title + (f" of {self.axis}" if self.axis else "")

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        bound = "" if self.within_s is None else f" within {self.within_s:g} s"
        return f"{self.title}{bound} after {words_of(self.since)}"

    @override
    def events_named(self) -> Iterator[EventSelector]:
        yield select_event(self.event_kind, self.axis, error_id=self.code)
        yield from super().events_named()

    @override
    def needed_until(self, trace: Trace) -> Reference:
        return self.since

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace."""
        entries = events_between(trace, self.event_kind, self.axis, instant(trace, self.since), trace.end_s)
        return judge_arrival(
            self,
            trace,
            entries,
            lambda entry: entry.data.get("error_id") == self.code,
            subject=self._subject,
            since=self.since,
            within_s=self.within_s,
            told=_listed,
            instead=lambda others: (
                f"instead {_text(others[0])} came" if others else f"and no other {self.words}"
            ),
        )


@dataclass(frozen=True)
class axis_error(_Code):
    """Expect that an NC axis goes into error with `code`, at most `within_s` after `since`.

    Args:
        code: Error code of the axis, 1 to 65535 ([NC axes](nc-axis.md)).
        within_s: Bound after `since`, s; None: up to the end of the trace.
        since: Reference instant.
        axis: Name of the axis; None: any.

    Raises:
        ConfigurationError: `code` is none, or `within_s` is negative.

    """

    event_kind: ClassVar[str] = "axis.error"
    words: ClassVar[str] = "error"


@dataclass(frozen=True)
class command_refused(_Code):
    """Expect that an NC axis refuses a command with `code`, at most `within_s` after `since`.

    Args:
        code: Error code of the refusal, 1 to 65535 ([NC axes](nc-axis.md)).
        within_s: Bound after `since`, s; None: up to the end of the trace.
        since: Reference instant.
        axis: Name of the axis; None: any.

    Raises:
        ConfigurationError: `code` is none, or `within_s` is negative.

    """

    event_kind: ClassVar[str] = "command.refused"
    words: ClassVar[str] = "refusal"


@dataclass(frozen=True)
class no_axis_error(Expectation):
    """Expect that no NC axis goes into error from `since` to `until` (default: the end).

    Args:
        since: Begin of the observation.
        until: End of the observation; None: the end of the trace.
        axis: Name of the axis; None: all.

    """

    _: KW_ONLY
    since: Reference = 0.0
    until: Reference | None = None
    axis: str | None = None

    @property
    def title(self) -> str:
        """Name made from the content."""
        return "no error of the axis"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        return f"{self.title} {words_of_span(self.since, self.until)}"

    @override
    def events_named(self) -> Iterator[EventSelector]:
        yield select_event("axis.error", self.axis)
        yield from super().events_named()

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace."""
        since_s, until_s = instant(trace, self.since), end_of(trace, self.until)
        entries = events_between(trace, "axis.error", self.axis, since_s, until_s)
        axis = f" of {self.axis}" if self.axis else ""
        when = entries[0].time_ns * 1e-9 if entries else None
        sentence = f"no error{axis} came {period(self.since, self.until)}"
        if when is not None:
            sentence = f"error {_text(entries[0])}{axis} came at {instant_words(when)}{allowed('none')}"
        return [self.outcome(passed=not entries, observed=_listed(entries), time_s=when, sentence=sentence)]
