"""What every expectation is: a value that judges a trace."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from copy import copy
from dataclasses import dataclass, fields, replace
from numbers import Real
from operator import index
from typing import Self, SupportsIndex, TypeGuard, cast

from fieldbus.errors import ConfigurationError
from fieldbus.history import Event
from hil.errors import NotRecordedError, RecordingError
from hil.expect._wording import clause, default_sentence, starting
from hil.record import EventSelector, Signal, Trace, check_selector
from reports.model import Check, Verdict
from reports.text import check_sentence, margin_text

Reference = float | EventSelector
"""An instant: seconds from the start of the case, or an event of the log (`event("fault.applied")`)."""

SLACK_S = 1e-9
"""Times are whole nanoseconds held as float64 seconds: differences below this are none."""


class ReferenceMissingError(Exception):
    """The event that an expectation counts from did not happen."""

    def __init__(self, reference: EventSelector) -> None:
        super().__init__(f"the reference event '{reference}' did not happen")
        self.reference = reference


class UnknownYetError(Exception):
    """A signal has no value yet at the instant at which it is judged."""

    def __init__(self, signal: Signal, time_s: float) -> None:
        first = f"before {signal.time_s[0]:.6f} s" if len(signal) else "at all"
        super().__init__(f"{signal.name} has no value {first}")
        self.time_s = time_s


_BEGINS = ("since", "at", "by", "after")
_REFERENCES = (*_BEGINS, "until")
"""Fields that say from when on something is judged."""


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


def check_bound(where: str, value: float | None) -> None:
    """Refuse a time or tolerance that is negative or no number.

    Raises:
        ConfigurationError: With `where` and what is allowed.

    """
    if value is not None and not (_is_number(value) and value >= 0):
        raise ConfigurationError(where, value, "a time >= 0 s" if where.endswith("_s") else "a number >= 0")


def check_whole(where: str, value: object, low: int, high: int) -> None:
    """Refuse what is no whole number of a range; None is permitted.

    Raises:
        ConfigurationError: With `where`, and what is allowed.

    """
    whole = _is_number(value) and hasattr(value, "__index__")
    if value is not None and not (whole and low <= index(cast("SupportsIndex", value)) <= high):
        written = value.strip() if isinstance(value, str) else ""
        hint = f": {written}, without quotes" if written.isdecimal() and low <= int(written) <= high else ""
        raise ConfigurationError(where, value, f"a number from {low} to {high}{hint}")


def value_in_force(trace: Trace, name: str, time_s: float) -> float:
    """Return the value of a signal at an instant.

    Raises:
        UnknownYetError: Its first sample is later, or there is none.

    """
    signal = trace[name]
    if len(signal) == 0 or signal.time_s[0] > time_s + SLACK_S:
        raise UnknownYetError(signal, time_s)
    return signal.at(time_s)


def pending_alarms(trace: Trace, axis: str) -> list[tuple[int, int, int, int]]:
    """Return (raised_ns, cleared_ns, number, reaction) of the alarms of an axis."""
    open_alarms: dict[int, Event] = {}
    spans = []
    for entry in trace.select(source=axis, kind="alarm."):
        number = int(entry.data.get("number") or 0)
        if entry.kind == "alarm.raised":
            open_alarms.setdefault(number, entry)
        elif entry.kind == "alarm.cleared" and number in open_alarms:
            raised = open_alarms.pop(number)
            spans.append((raised.time_ns, entry.time_ns, number, int(raised.data.get("reaction") or 0)))
    end = trace.end_ns + 1
    spans += [(e.time_ns, end, n, int(e.data.get("reaction") or 0)) for n, e in open_alarms.items()]
    return sorted(spans)


def words_of(reference: Reference) -> str:
    """Return a reference in words."""
    if isinstance(reference, EventSelector):
        return str(reference)
    return f"{reference:g} s" if _is_number(reference) else repr(reference)


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, Real) and not isinstance(value, bool)


def of_axis(axis: str | None, column: str) -> str:
    """Return the name of a signal of an axis; of the axis that is not known yet its column alone."""
    return f"{axis}.{column}" if axis else column


def words_of_span(since: Reference, until: Reference | None) -> str:
    """Return a period in words; without `until` it goes to the end of the trace."""
    return f"from {words_of(since)} to {'the end' if until is None else words_of(until)}"


@dataclass(frozen=True, kw_only=True)
class Expectation(ABC):
    """Base of all expectations, which are frozen dataclasses: `alarm(421, within_s=0.05)` is a value.

    Their names are in lower case, because they read as sentences in a test: `ctx.expect(alarm(421))`.
    """

    requirements: tuple[str, ...] = ()
    """Identifiers of the specification that this expectation checks."""
    label: str = ""
    """Name in the report; empty: a name made from the content."""

    def covers(self, *identifiers: str) -> Self:
        """Return the same expectation, marked with requirement identifiers."""
        return self._with(requirements=(*self.requirements, *identifiers))

    def named(self, label: str) -> Self:
        """Return the same expectation under another name."""
        return self._with(label=label)

    def _with(self, **changes: object) -> Self:
        """Return a copy with other values; `dataclasses.replace` needs an `__init__` of the fields."""
        result = copy(self)
        for name, value in changes.items():
            object.__setattr__(result, name, value)
        return result

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
        """Evaluate on a trace; may raise `ReferenceMissingError`, which
        `evaluate` turns into a failed check.
        """

    def signals_named(self) -> tuple[str, ...]:
        """Return the signals that this expectation judges: a plot of a failed one has to show them."""
        return ()

    def levels_named(self) -> tuple[str, ...]:
        """Return the signals whose values it compares with numbers, for which their zero has to be known."""
        return ()

    def components_named(self) -> tuple[str, ...]:
        """Return the components that have to be heard for it to pass; by default those of its signals."""
        return tuple(dict.fromkeys(name.partition(".")[0] for name in self.signals_named()))

    def needs_values(self) -> bool:
        """Whether its components have to send process data, and not only to be heard."""
        return bool(self.signals_named())

    def needed_until(self, trace: Trace) -> Reference:
        """Return to when everything has to be recorded for it to pass: by default `until`, the instant
        itself, or the end.
        """
        at, until = self._reference("at"), self._reference("until")
        return next((one for one in (at, until) if one is not None), trace.end_s)

    def _fields(self) -> dict[str, object]:
        return {item.name: getattr(self, item.name) for item in fields(self)}

    def _reference(self, name: str) -> Reference | None:
        """Return an instant that it names; None: it has no such field, or leaves it open."""
        value = self._fields().get(name)
        return value if isinstance(value, EventSelector) or _is_number(value) else None

    def events_named(self) -> Iterator[EventSelector]:
        """Return the events that this expectation names."""
        for value in self._fields().values():
            for one in value if isinstance(value, tuple) else (value,):
                if isinstance(one, EventSelector):
                    yield one

    def on(self, trace: Trace) -> Self:  # noqa: ARG002 - for those that are about an axis
        """Return the same expectation with the axis that it is about, where it names none.

        That is the axis, or the axis of the drive, that its reference is an event of, or the only axis. A
        drive that is named as axis stands for its axis.

        Raises:
            RecordingError: There are several axes, and it is about none of them.

        """
        return self

    def signals_on(self, trace: Trace) -> tuple[str, ...]:
        """Return the signals that this expectation judges on a trace."""
        try:
            return self.on(trace).signals_named()
        except RecordingError:
            return ()

    def verify(self, trace: Trace) -> None:
        """Refuse names that cannot be in the trace: an expectation with a misspelt name must not pass.

        Raises:
            RecordingError: There is no such kind of event, component, state, job, ...; the message names
                what there is.

        """
        for selector in self.events_named():
            check_selector(trace, selector)

    def evaluate(self, trace: Trace) -> list[Check]:
        """Return the outcome on `trace`: at least one check, each with expected, observed and when.

        A check is an *error* when it names what does not exist, and *blocked* when a recording like this one
        cannot answer it.
        """
        try:
            self._check_references()
            one = self.on(trace)
        except RecordingError as error:
            return [self.check(Verdict.ERROR, str(error), None)]
        return one._evaluate(trace)  # noqa: SLF001 - itself, or a copy

    def _check_references(self) -> None:
        """Refuse an instant that is neither a number nor an event.

        Raises:
            RecordingError: It is something else, such as a text.

        """
        for name, value in self._fields().items():
            known = value is None or isinstance(value, EventSelector) or _is_number(value)
            if name in _REFERENCES and not known:
                allowed = "a time in seconds, such as 0.05, or an event(...)"
                raise RecordingError(f"{name}: {value!r} is not allowed; allowed: {allowed}")

    def _evaluate(self, trace: Trace) -> list[Check]:
        """Return the outcome, with the axis known."""
        try:
            self.verify(trace)
            self._check_zero(trace)
            refused = self._outside(trace)
            if refused:
                return [self.unseen(trace, *refused)]
            return [self._as_far_as_recorded(trace, check) for check in self.judge(trace)]
        except UnknownYetError as unknown:
            return [self.unseen(trace, str(unknown), unknown.time_s)]
        except ReferenceMissingError as missing:
            silences = trace.silences(missing.reference.source or "")
            if silences:
                return [self.unseen(trace, f"{missing}, but {silences[0][2]}", silences[0][0])]
            phrase = clause(missing.reference)
            sentence = f"{phrase.subject} {phrase.denied}, from which on {self.title} was expected"
            return [self.outcome(passed=False, observed=str(missing), time_s=trace.end_s, sentence=sentence)]
        except NotRecordedError as error:
            return [self.check(Verdict.BLOCKED, str(error), None)]
        except RecordingError as error:
            return [self.check(Verdict.ERROR, str(error), None)]

    def unseen(self, trace: Trace, observed: str, time_s: float) -> Check:
        """Return the check for what was not recorded: *blocked* where a log of somebody else ends, *failed*
        on the bench.
        """
        return self.check(Verdict.BLOCKED if trace.from_log else Verdict.FAILED, observed, time_s)

    def missing(
        self, trace: Trace, observed: str, time_s: float, bound_s: float | None, *, sentence: str = ""
    ) -> Check:
        """Return the check for what did not come until `bound_s`; a log that
        ended before then cannot tell.
        """
        begin_s = self._begin(trace) or 0.0
        end_s = trace.end_s if bound_s is None else bound_s
        if trace.from_log and end_s > trace.end_s + SLACK_S:
            text = f"{observed}, and the recording ends at {trace.end_s:.6f} s, before {end_s:.6f} s"
            return self.check(Verdict.BLOCKED, text, trace.end_s)
        unknown = self._not_known(trace, begin_s, end_s)
        if unknown is not None:
            return self.check(Verdict.BLOCKED, f"{observed}, but {unknown[1]}", unknown[0])
        return self.outcome(
            passed=False, observed=observed, time_s=time_s, since_s=begin_s, sentence=sentence
        )

    def _check_zero(self, trace: Trace) -> None:
        """Refuse to compare a value with numbers where only its displacement is known."""
        words = trace.vocabulary
        for name in self.levels_named():
            if words is not None and name in words.relative:
                raise NotRecordedError(
                    f"{words.origin} does not tell where the zero of {name} is, which homing sets; judge "
                    f"displacements, "
                    "or the increments of the encoder"
                )

    def _begin(self, trace: Trace) -> float | None:
        """Return from when on it is judged."""
        begin = self._named_begin()
        return None if begin is None else instant(trace, begin)

    def _named_begin(self) -> Reference | None:
        named = (self._reference(item.name) for item in fields(self) if item.name in _BEGINS)
        return next((one for one in named if one is not None), None)

    def _outside(self, trace: Trace) -> tuple[str, float] | None:
        """Return what of the observation lies outside of the recording, or makes it
        none, and when; None: nothing.
        """
        begin_s = self._begin(trace)
        if begin_s is None:
            return None
        if hasattr(self, "at"):
            unknown = self._not_known(trace, begin_s, begin_s)
            if unknown is not None:
                return unknown[1], unknown[0]
        if math.isnan(begin_s):
            return "the observation begins at a time that is no number", 0.0
        if begin_s > trace.end_s + SLACK_S:
            return f"the recording ends at {trace.end_s:.6f} s, before {self._begin_words()}", trace.end_s
        if begin_s < -SLACK_S:
            return f"the observation begins at {begin_s:.6f} s, before the recording", 0.0
        until = self._reference("until")
        if until is not None:
            until_s = instant(trace, until)
            if not until_s >= begin_s - SLACK_S:
                return (
                    f"the observation ends at {until_s:.6f} s, before it begins at {begin_s:.6f} s",
                    begin_s,
                )
        return None

    def _begin_words(self) -> str:
        begin = self._named_begin()
        return "" if begin is None else words_of(begin)

    def _as_far_as_recorded(self, trace: Trace, check: Check) -> Check:
        """Return a check; a passed one only where everything that it speaks of was recorded."""
        if check.verdict is not Verdict.PASSED:
            return check
        needed = self.needed_until(trace)
        begin_s, end_s = self._begin(trace), instant(trace, needed)
        if end_s > trace.end_s + SLACK_S:
            observed = (
                f"{check.observed}, but the recording ends at {trace.end_s:.6f} s, before {words_of(needed)}"
            )
            return self._named(self.unseen(trace, observed, trace.end_s), check.name)
        if begin_s is None:
            return check
        unknown = self._not_known(trace, begin_s, end_s)
        if unknown is None:
            return check
        observed = f"{check.observed}, but {unknown[1]}"
        return self._named(self.unseen(trace, observed, unknown[0]), check.name)

    def _named(self, check: Check, name: str) -> Check:
        named = replace(check, name=name)
        named.sentence = default_sentence(named)
        return named

    def _not_known(self, trace: Trace, begin_s: float, end_s: float) -> tuple[float, str] | None:
        """Return when a component that has to be heard was not in a log, between
        two times, and the words for it.
        """
        for component in self.components_named():
            for silent_s, heard_s, reason in trace.silences(
                component, values=self.needs_values(), states=not self.signals_named()
            ):
                over = silent_s <= begin_s + SLACK_S and heard_s >= trace.end_s - SLACK_S
                if over or (silent_s < end_s - SLACK_S and heard_s > begin_s + SLACK_S):
                    return max(
                        silent_s, begin_s
                    ), f"not known from {silent_s:.6f} s to {heard_s:.6f} s: {reason}"
        return None

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
        sentence: str = "",
    ) -> Check:
        """Return a passed or failed check of this expectation; `sentence` says what
        came of it, limits in brackets.
        """
        check = self.check(Verdict.PASSED if passed else Verdict.FAILED, observed, time_s)
        if name:
            check.name = f"{check.name}: {name}"
        if expected:
            check.expected = expected
        if sentence:
            label = f"{starting(self.label)}: " if self.label else ""
            check.sentence = label + sentence if label else starting(sentence)
        else:
            check.sentence = default_sentence(check)
        check.value, check.unit, check.low, check.high = value, unit, low, high
        check.signal, check.since_s = signal, since_s
        return check

    def check(self, verdict: Verdict, observed: str, time_s: float | None) -> Check:
        """Return a check of this expectation with any verdict."""
        check = Check(
            name=self.label or self.title,
            verdict=verdict,
            expected=self.wanted,
            observed=observed,
            time_s=time_s,
            requirements=list(self.requirements),
        )
        check.sentence = default_sentence(check)
        return check


def evaluate(trace: Trace, expectations: Iterable[Expectation]) -> list[Check]:
    """Evaluate expectations in order.

    Raises:
        ConfigurationError: One of them is no expectation.

    """
    expectations = list(expectations)
    given: list[object] = [*expectations]
    for one in given:
        if not isinstance(one, Expectation):
            allowed = "expectations of hil.expect, such as alarm(421)"
            if isinstance(one, list | tuple):
                allowed += "; those of a list with a star: check(*expectations)"
            elif isinstance(one, type):
                allowed += f"; with parentheses: {one.__name__}(...)"
            raise ConfigurationError("check", one, allowed)
    return [check for expectation in expectations for check in expectation.evaluate(trace)]


def describe(check: Check) -> str:
    """Return a check as one readable text: its sentence, by how much it missed a limit, when."""
    by = "" if check.verdict is Verdict.PASSED else margin_text(check)
    margin = f", {by}" if by else ""
    when = "" if check.time_s is None else f" (at {check.time_s:.6f} s)"
    return f"{check_sentence(check)}{margin}{when}"
