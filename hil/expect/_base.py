"""What every expectation is: a value that judges a trace."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, replace
from typing import Self

from hil.errors import NotRecordedError, RecordingError
from hil.record import EventSelector, Trace, check_selector
from reports.model import Check, Verdict
from reports.words import margin_text

Reference = float | EventSelector
"""An instant: seconds from the start of the case, or an event of the log (`event("fault.applied")`)."""

SLACK_S = 1e-9
"""Times are whole nanoseconds held as float64 seconds: differences below this are none."""


class ReferenceMissingError(Exception):
    """The event that an expectation counts from did not happen."""

    def __init__(self, reference: EventSelector) -> None:
        super().__init__(f"the reference event '{reference}' did not happen")


_BEGINS = ("since", "at", "by", "after")
"""Fields that say from when on something is judged."""


def _is_log(trace: Trace) -> bool:
    """Whether the trace is of a recording that could have ended earlier than what is asked about."""
    return trace.vocabulary is not None and bool(trace.vocabulary.kinds)


def instant(trace: Trace, reference: Reference) -> float:
    """Return a reference in seconds, or raise `ReferenceMissingError`."""
    time_s = trace.instant(reference)
    if time_s is None:
        assert isinstance(reference, EventSelector)
        raise ReferenceMissingError(reference)
    return time_s


def end_of(trace: Trace, until: Reference | None) -> float:
    """Return the end of an observation: `until`, or the end of the trace."""
    return trace.end_s if until is None else instant(trace, until)


def words_of(reference: Reference) -> str:
    """Return a reference in words."""
    return str(reference) if isinstance(reference, EventSelector) else f"{reference:g} s"


def words_of_span(since: Reference, until: Reference | None) -> str:
    """Return a period in words; without `until` it goes to the end of the trace."""
    return f"from {words_of(since)} to {'the end' if until is None else words_of(until)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation(ABC):
    """Base of all expectations. They are made by the functions of `hil.expect`."""

    requirements: tuple[str, ...] = ()
    """Identifiers of the specification that this expectation checks."""
    label: str = ""
    """Name in the report; empty: a name made from the content."""

    def covers(self, *identifiers: str) -> Self:
        """Return the same expectation, marked with requirement identifiers."""
        return replace(self, requirements=(*self.requirements, *identifiers))

    def named(self, label: str) -> Self:
        """Return the same expectation under another name."""
        return replace(self, label=label)

    @property
    @abstractmethod
    def title(self) -> str:
        """Name made from the content."""

    @property
    @abstractmethod
    def wanted(self) -> str:
        """What is expected, in words."""

    @abstractmethod
    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace; may raise `ReferenceMissingError`, which `evaluate` turns into a failed check."""

    def events_named(self) -> Iterator[EventSelector]:
        """Return the events that this expectation names."""
        for item in fields(self):
            value = getattr(self, item.name)
            for one in value if isinstance(value, tuple) else (value,):
                if isinstance(one, EventSelector):
                    yield one

    def verify(self, trace: Trace) -> None:
        """Refuse names that cannot be in the trace: an expectation with a slip of the pen must not pass.

        Raises:
            RecordingError: There is no such kind of event, component, state, job, ...; the message names what there is.

        """
        for selector in self.events_named():
            check_selector(trace, selector)

    def evaluate(self, trace: Trace) -> list[Check]:
        """Return the outcome on `trace`: at least one check, each with expected, observed and when.

        A check is an *error* when it names what does not exist, and *blocked* when a recording like this one cannot
        answer it.
        """
        try:
            self.verify(trace)
            late = self._begins_after(trace)
            if late:
                verdict = Verdict.BLOCKED if _is_log(trace) else Verdict.FAILED
                return [
                    self.check(
                        verdict, f"the recording ends at {trace.end_s:.6f} s, before {late}", trace.end_s
                    )
                ]
            return self.judge(trace)
        except ReferenceMissingError as missing:
            return [self.outcome(passed=False, observed=str(missing), time_s=trace.end_s)]
        except NotRecordedError as error:
            return [self.check(Verdict.BLOCKED, str(error), None)]
        except RecordingError as error:
            return [self.check(Verdict.ERROR, str(error), None)]

    def _begins_after(self, trace: Trace) -> str:
        """Return the reference that lies behind the end of the recording, in words; empty when there is none."""
        for item in fields(self):
            value = getattr(self, item.name)
            if item.name not in _BEGINS or value is None:
                continue
            if instant(trace, value) > trace.end_s + SLACK_S:
                return words_of(value)
        return ""

    def outcome(
        self,
        *,
        passed: bool,
        observed: str,
        time_s: float | None = None,
        name: str = "",
        expected: str = "",
        value: float | None = None,
        unit: str = "",
        low: float | None = None,
        high: float | None = None,
        signal: str = "",
        since_s: float | None = None,
    ) -> Check:
        """Return a passed or failed check of this expectation."""
        check = self.check(Verdict.PASSED if passed else Verdict.FAILED, observed, time_s)
        if name:
            check.name = f"{check.name}: {name}"
        if expected:
            check.expected = expected
        check.value, check.unit, check.low, check.high = value, unit, low, high
        check.signal, check.since_s = signal, since_s
        return check

    def check(self, verdict: Verdict, observed: str, time_s: float | None) -> Check:
        """Return a check of this expectation with any verdict."""
        return Check(
            name=self.label or self.title,
            verdict=verdict,
            expected=self.wanted,
            observed=observed,
            time_s=time_s,
            requirements=list(self.requirements),
        )


def evaluate(trace: Trace, expectations: Iterable[Expectation]) -> list[Check]:
    """Evaluate expectations in order."""
    return [check for expectation in expectations for check in expectation.evaluate(trace)]


def describe(check: Check) -> str:
    """Return a check as one readable text: name, verdict, expected, observed, by how much, when."""
    by = margin_text(check)
    margin = f", {by}" if by else ""
    when = "" if check.time_s is None else f" (at {check.time_s:.6f} s)"
    return f"{check.name}: {check.verdict.value}; expected {check.expected}; observed {check.observed}{margin}{when}"
