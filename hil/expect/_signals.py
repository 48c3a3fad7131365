"""Expectations about recorded signals: limits, words, predicates."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from fieldbus.errors import ConfigurationError
from hil.expect._axis import axis_about, signal_about
from hil.expect._base import (
    SLACK_S,
    Expectation,
    Reference,
    check_bound,
    end_of,
    instant,
    of_axis,
    value_in_force,
    words_of,
    words_of_span,
)
from hil.expect._wording import after, allowed, instant_words, span
from hil.expect._words import word_samples
from hil.record import Signal, Trace
from reports.model import Check
from reports.text import limit_words, quantity

Predicate = Callable[..., object]
STW1_MASK = 0x04FF
"""Bits of control word 1 that the technology object owns; the others belong to `MC_SetAxisSTW`."""


@dataclass(frozen=True, init=False)
class always(Expectation):
    """Expect `predicate` at every sample.

    Args:
        text: The rule in words, for the report.
        predicate: Takes one NumPy array per signal, returns an array of truth values.
        signals: Names of the signals; the first gives the sample times.
        since: Begin of the observation.
        until: End of the observation; None: the end of the trace.
        condition: Judge only samples where this is true (*always while*).
        never: The predicate must hold at no sample; `never` reads better.

    Raises:
        ConfigurationError: No signal is named.

    """

    text: str
    predicate: Predicate
    signals: tuple[str, ...]
    since: Reference
    until: Reference | None
    condition: Predicate | None
    never: bool

    def __init__(
        self,
        text: str,
        predicate: Predicate,
        *signals: str,
        since: Reference = 0.0,
        until: Reference | None = None,
        condition: Predicate | None = None,
        never: bool = False,
    ) -> None:
        if not signals:
            where = "never.signals" if never else "always.signals"
            raise ConfigurationError(where, signals, "at least one signal name")
        given = {
            "text": text, "predicate": predicate, "signals": signals, "since": since, "until": until,
            "condition": condition, "never": never, "requirements": (), "label": "",
        }  # fmt: skip
        for name, value in given.items():
            object.__setattr__(self, name, value)

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"{'never' if self.never else 'always'} {self.text}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        return f"{self.title} {words_of_span(self.since, self.until)}"

    @override
    def signals_named(self) -> tuple[str, ...]:
        return self.signals

    @override
    def levels_named(self) -> tuple[str, ...]:
        return self.signals_named()

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on the samples of the first signal; the others hold their last value.

        Samples at which another signal has no value yet are left out; a value that is no number is broken.
        """
        since_s = instant(trace, self.since)
        base = trace[self.signals[0]].between(since_s, end_of(trace, self.until))
        columns = [base.values]
        looked_at = np.ones(len(base), dtype=bool)
        for name in self.signals[1:]:
            held, begun = _held(trace[name], base)
            columns.append(held)
            looked_at &= begun
        if self.condition is not None and looked_at.any():
            looked_at &= np.broadcast_to(np.asarray(self.condition(*columns), dtype=bool), looked_at.shape)
        no_number = np.zeros(len(base), dtype=bool)
        for column in columns:  # one after the other: those of a long log are large
            no_number |= np.isnan(column)
        lost = np.flatnonzero(looked_at & no_number)
        if len(lost):
            return [self._broken(base, columns, int(lost[0]), f"{len(lost)} samples are no numbers")]
        if not looked_at.any():
            while_ = " where the condition holds" if self.condition is not None and len(base) else ""
            return [self.unseen(trace, f"no sample to judge{while_}", since_s)]
        holds = np.broadcast_to(np.asarray(self.predicate(*columns), dtype=bool), looked_at.shape)
        broken = np.flatnonzero(looked_at & (holds if self.never else ~holds))
        if len(broken) == 0:
            seen = f"so at all {int(looked_at.sum())} samples"
            return [self.outcome(passed=True, observed=seen, sentence=f"{self.title}: {seen}")]
        return [self._broken(base, columns, int(broken[0]), f"{len(broken)} samples break it")]

    def _broken(self, base: Signal, columns: list[NDArray[np.float64]], index: int, text: str) -> Check:
        values = ", ".join(
            f"{name} = {float(column[index]):g}" for name, column in zip(self.signals, columns, strict=True)
        )
        return self.outcome(
            passed=False,
            observed=f"{values}; {text}, this is the first",
            time_s=float(base.time_s[index]),
            signal=self.signals[0],
            sentence=f"{self.title}, but {values} at {instant_words(float(base.time_s[index]))} ({text})",
        )


def _held(signal: Signal, base: Signal) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return `signal` at the sample times of `base`, each time the last value
    so far, and where there is one.
    """
    if len(signal) == 0:
        return np.full(len(base), np.nan), np.zeros(len(base), dtype=bool)
    index = np.searchsorted(signal.time_s, base.time_s + SLACK_S / 2, side="right") - 1
    return signal.values[np.maximum(index, 0)], index >= 0


@dataclass(frozen=True)
class value_at(Expectation):
    """Expect `signal` at an instant to be `expected` within `tolerance`, in the unit of the signal.

    Raises:
        ConfigurationError: The tolerance is negative.

    """

    signal: str
    at: Reference
    expected: float
    _: KW_ONLY
    tolerance: float

    def __post_init__(self) -> None:
        check_bound("value_at.tolerance", self.tolerance)

    @override
    def on(self, trace: Trace) -> Self:
        return self._with(signal=signal_about(trace, self.signal, self.at))

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"{self.signal} at {words_of(self.at)}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        return f"{self.expected:g} +- {self.tolerance:g}"

    @override
    def signals_named(self) -> tuple[str, ...]:
        return (self.signal,)

    @override
    def levels_named(self) -> tuple[str, ...]:
        return self.signals_named()

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace."""
        at_s = instant(trace, self.at)
        signal, value = trace[self.signal], value_in_force(trace, self.signal, at_s)
        low, high = self.expected - self.tolerance, self.expected + self.tolerance
        return [
            self.outcome(
                passed=low <= value <= high,
                observed=f"{value:g} {signal.unit}".rstrip(),
                time_s=at_s,
                value=value,
                unit=signal.unit,
                low=low,
                high=high,
                signal=self.signal,
                sentence=f"{self.signal} was {quantity(value, signal.unit)} at {instant_words(self.at)}"
                f"{allowed(limit_words(low, high, signal.unit))}",
            )
        ]


@dataclass(frozen=True)
class stays_within(Expectation):
    """Expect `signal` within limits, in its unit, from `since` to `until`.

    Raises:
        ConfigurationError: No limit is given, or `low` is above `high`.

    """

    signal: str
    _: KW_ONLY
    low: float | None = None
    high: float | None = None
    since: Reference = 0.0
    until: Reference | None = None

    def __post_init__(self) -> None:
        low, high = self.low, self.high
        if low is None and high is None:
            raise ConfigurationError("stays_within", None, "low, high or both")
        if not (-math.inf if low is None else low) <= (math.inf if high is None else high):
            raise ConfigurationError("stays_within", (low, high), "numbers, low not above high")

    @override
    def on(self, trace: Trace) -> Self:
        return self._with(signal=signal_about(trace, self.signal, self.since, self.until))

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"{self.signal} within limits"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        low = "" if self.low is None else f">= {self.low:g}"
        high = "" if self.high is None else f"<= {self.high:g}"
        return f"{' and '.join(filter(None, (low, high)))} {words_of_span(self.since, self.until)}"

    @override
    def signals_named(self) -> tuple[str, ...]:
        return (self.signal,)

    @override
    def levels_named(self) -> tuple[str, ...]:
        return self.signals_named()

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace; the measurement is the value that comes nearest to,
        or goes farthest over, a limit.
        """
        since_s = instant(trace, self.since)
        part = trace[self.signal].between(since_s, end_of(trace, self.until))
        if len(part) == 0:
            return [self.unseen(trace, "no samples", since_s)]
        over = np.maximum(
            -np.inf if self.high is None else part.values - self.high,
            -np.inf if self.low is None else self.low - part.values,
        )
        over = np.where(np.isnan(part.values), np.inf, over)
        index = int(np.argmax(over))
        value, when = float(part.values[index]), float(part.time_s[index])
        return [
            self.outcome(
                passed=bool(over[index] <= 0),
                observed=f"extreme value {value:g} {part.unit}".rstrip(),
                time_s=when,
                value=value,
                unit=part.unit,
                low=self.low,
                high=self.high,
                signal=self.signal,
                sentence=f"{self.signal} reached {quantity(value, part.unit)} at {instant_words(when)}"
                f"{allowed(limit_words(self.low, self.high, part.unit))}",
            )
        ]


@dataclass(frozen=True)
class word_sequence(Expectation):
    """Expect a word to take these values one after the other, beginning with the one in effect at `since`.

    Args:
        signal: Name of the signal.
        words: The values.
        mask: Bits that count.
        since: Begin of the observation.
        until: End of the observation; None: the end of the trace.
        exact: No other values in between.

    Raises:
        ConfigurationError: No value is given.

    """

    signal: str
    words: Sequence[int]
    _: KW_ONLY
    mask: int = 0xFFFF
    since: Reference = 0.0
    until: Reference | None = None
    exact: bool = True

    def __post_init__(self) -> None:
        if not self.words:
            raise ConfigurationError("word_sequence.words", self.words, "at least one word")
        object.__setattr__(self, "words", tuple(word & self.mask for word in self.words))

    @override
    def on(self, trace: Trace) -> Self:
        return self._with(signal=signal_about(trace, self.signal, self.since, self.until))

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"sequence of {self.signal}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        extra = "" if self.exact else " (others in between allowed)"
        return f"{_chain(self.words)}{extra} from {words_of(self.since)}, mask 16#{self.mask:04X}"

    @override
    def signals_named(self) -> tuple[str, ...]:
        return (self.signal,)

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace: the value in effect at the reference is the first of the sequence."""
        since_s, until_s = instant(trace, self.since), end_of(trace, self.until)
        times, numbers = word_samples(trace[self.signal], since_s, until_s)
        if len(numbers) == 0:
            return [self.unseen(trace, "no value until then", since_s)]
        values = numbers & self.mask
        changes = np.flatnonzero(np.concatenate(([True], np.diff(values) != 0)))
        seen = [(float(times[i]), int(values[i])) for i in changes]
        words = [word for _, word in seen]
        if self.exact:
            matching = 0
            while matching < min(len(words), len(self.words)) and words[matching] == self.words[matching]:
                matching += 1
            good = words == list(self.words)
            when = seen[min(matching, len(seen) - 1)][0]
        else:
            rest = iter(words)
            good = all(word in rest for word in self.words)
            when = seen[-1][0]
        shown = words if len(words) <= 12 else words[:12]
        more = "" if len(words) <= 12 else f" ... ({len(words)} values)"
        instead = "" if good else f" instead of {_chain(self.words)}"
        sentence = f"{self.signal} went {_chain(shown)}{more}{instead} from {instant_words(self.since)} on"
        return [
            self.outcome(
                passed=good, observed=_chain(shown) + more, time_s=when, since_s=since_s, sentence=sentence
            )
        ]


def _chain(words: Sequence[int]) -> str:
    return " -> ".join(f"16#{word:04X}" for word in words)


def never(
    text: str,
    predicate: Predicate,
    *signals: str,
    since: Reference = 0.0,
    until: Reference | None = None,
    condition: Predicate | None = None,
) -> always:
    """Expect `predicate` at no sample; arguments as of `always`."""
    return always(text, predicate, *signals, since=since, until=until, condition=condition, never=True)


def stw1_sequence(
    words: Sequence[int],
    *,
    axis: str = "",
    since: Reference = 0.0,
    until: Reference | None = None,
    mask: int = STW1_MASK,
    exact: bool = True,
) -> word_sequence:
    """Expect control word 1 of an axis to run through `words`, such as 16#047F, 16#047B, 16#0478, 16#047E.

    Without a name it is the axis that `since` is an event of, or the only one.
    """
    return word_sequence(of_axis(axis, "stw1"), words, mask=mask, since=since, until=until, exact=exact)


@dataclass(frozen=True)
class status_word_bit(Expectation):
    """Expect bit `bit` (0..31) of a word of an axis to be `state` at an instant, or within a time after it.

    Args:
        bit: Number of the bit: 7 for X7.
        state: Expected value.
        at: Reference instant.
        within_s: Time for it to happen; 0 = at the instant itself.
        axis: Name of the axis; empty: the one that `at` is an event of, or the only one.
        word: Column: status_word, status_word2, error_word, warning_word, zsw1, ...

    Raises:
        ConfigurationError: There is no such bit, or `within_s` is negative.

    """

    bit: int
    state: bool
    _: KW_ONLY
    at: Reference
    within_s: float = 0.0
    axis: str = ""
    word: str = "status_word"

    def __post_init__(self) -> None:
        if not 0 <= self.bit <= 31:
            raise ConfigurationError("status_word_bit.bit", self.bit, "0..31")
        check_bound("status_word_bit.within_s", self.within_s)

    @override
    def on(self, trace: Trace) -> Self:
        return self if self.axis else self._with(axis=axis_about(trace, "", self.at))

    @property
    def signal(self) -> str:
        """Name of the signal."""
        return of_axis(self.axis, self.word)

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"{self.signal}.X{self.bit}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        bound = f" within {self.within_s:g} s of" if self.within_s else " at"
        return f"{'TRUE' if self.state else 'FALSE'}{bound} {words_of(self.at)}"

    @override
    def signals_named(self) -> tuple[str, ...]:
        return (self.signal,)

    @override
    def needed_until(self, trace: Trace) -> Reference:
        return self.at

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace."""
        since_s = instant(trace, self.at)
        signal = trace[self.signal]
        wanted = "TRUE" if self.state else "FALSE"
        if not self.within_s:
            value_in_force(trace, self.signal, since_s)
        times, values = word_samples(signal, since_s, since_s + self.within_s)
        good = np.flatnonzero(((values >> self.bit) & 1) == int(self.state))
        if len(good) == 0:
            observed = "no value" if len(values) == 0 else "FALSE" if self.state else "TRUE"
            bound_s = since_s + self.within_s
            moment = f"within {span(self.within_s)} after" if self.within_s else "at"
            sentence = f"{self.title} was not {wanted} {moment} {instant_words(self.at)}"
            return [self.missing(trace, observed, bound_s, bound_s, sentence=sentence)]
        when = float(times[good[0]])
        observed = f"{wanted} at {when:.6f} s"
        if not self.within_s:
            sentence = f"{self.title} was {wanted} at {instant_words(self.at)}"
            return [self.outcome(passed=True, observed=observed, time_s=when, sentence=sentence)]
        return [
            self.outcome(
                passed=True,
                observed=observed,
                time_s=when,
                value=when - since_s,
                unit="s",
                low=0.0,
                high=self.within_s,
                sentence=f"{self.title} was {wanted} {after(self.at, when - since_s)}"
                f"{allowed(span(self.within_s))}",
            )
        ]
