"""Expectations about words and values at a time and from then on: bits of a telegram, settling, an axis that
is disabled.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from fieldbus.errors import ConfigurationError
from hil.errors import NotRecordedError
from hil.expect._axis import axis_about, axis_names, drive_of, signal_about
from hil.expect._base import (
    SLACK_S,
    Expectation,
    Reference,
    check_bound,
    end_of,
    instant,
    value_in_force,
    words_of,
    words_of_span,
)
from hil.expect._wording import after, allowed, instant_words, span
from hil.expect._words import has_torque, word_samples
from hil.record import Signal, Trace
from reports.model import Check, Verdict
from reports.text import limit_words, quantity


@dataclass(frozen=True)
class telegram_bits(Expectation):
    """Expect bits of a word of a telegram.

    Args:
        word: Signal: `axis1.stw1`, `axis1.zsw1`, `drive1.statusword`, `drive1.drive_zsw2`, ...
        at: Reference instant.
        ones: Mask of the bits that have to be 1.
        zeros: Mask of the bits that have to be 0.
        within_s: Time for it to happen, s; 0: at the instant itself.
        for_s: Time for which it has to stay so from then on, s.

    Raises:
        ConfigurationError: No bit is named, one in both masks, or a time is negative.

    """

    word: str
    _: KW_ONLY
    at: Reference
    ones: int = 0
    zeros: int = 0
    within_s: float = 0.0
    for_s: float = 0.0

    def __post_init__(self) -> None:
        ones, zeros = self.ones, self.zeros
        if not 0 < ones | zeros <= 0xFFFFFFFF or ones & zeros or ones < 0 or zeros < 0:
            raise ConfigurationError(
                "telegram_bits.ones/zeros", (ones, zeros), "masks of up to 32 bits without a bit in both"
            )
        check_bound("telegram_bits.within_s", self.within_s)
        check_bound("telegram_bits.for_s", self.for_s)

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"bits of {self.word}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        parts = []
        if self.ones:
            parts.append(f"{_bits(self.ones)} = 1")
        if self.zeros:
            parts.append(f"{_bits(self.zeros)} = 0")
        bound = f"within {self.within_s:g} s of" if self.within_s else "at"
        stay = f", and for {self.for_s:g} s" if self.for_s else ""
        return f"{', '.join(parts)} {bound} {words_of(self.at)}{stay}"

    @override
    def signals_named(self) -> tuple[str, ...]:
        return (self.word,)

    @override
    def needed_until(self, trace: Trace) -> Reference:
        return self.at

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace: the value in effect at the reference counts, then every change."""
        at_s = instant(trace, self.at)
        asked = self.wanted.partition(" within ")[0].partition(" at ")[0]
        if not self.within_s:
            value_in_force(trace, self.word, at_s)
        bound_s = at_s + self.within_s
        times, words = word_samples(trace[self.word], at_s, bound_s + self.for_s)
        good = (words & self.ones == self.ones) & (words & self.zeros == 0)
        hit = np.flatnonzero(good & (times <= bound_s + SLACK_S))
        if len(hit) == 0:
            observed = "no value at that time"
            if len(words):
                wrong = (words[0] & self.ones ^ self.ones) | (words[0] & self.zeros)
                observed = f"16#{int(words[0]):04X}: wrong are {_bits(int(wrong))}"
            moment = f"within {span(self.within_s)} after" if self.within_s else "at"
            sentence = f"{self.word} did not have {asked} {moment} {instant_words(self.at)}: {observed}"
            return [self.missing(trace, observed, bound_s, bound_s, sentence=sentence)]
        first = int(hit[0])
        begin_s = float(times[first])
        left = np.flatnonzero(~good[first:] & (times[first:] < begin_s + self.for_s - SLACK_S))
        if len(left):
            at = first + int(left[0])
            held_s = float(times[at]) - begin_s
            return [
                self.outcome(
                    passed=False,
                    observed=f"16#{int(words[at]):04X} after {held_s:.6f} s",
                    time_s=float(times[at]),
                    value=held_s,
                    unit="s",
                    low=self.for_s,
                    since_s=begin_s,
                    sentence=f"{self.word} had {asked} for {span(held_s)} only, then 16#{int(words[at]):04X}"
                    f"{allowed(f'at least {span(self.for_s)}')}",
                )
            ]
        if begin_s + self.for_s > trace.end_s + SLACK_S:
            held_s = trace.end_s - begin_s
            observed = (
                f"16#{int(words[first]):04X} from {begin_s:.6f} s to the end of the recording, {held_s:.6f} s"
            )
            return [self.unseen(trace, observed, trace.end_s)]
        return [
            self.outcome(
                passed=True,
                observed=f"16#{int(words[first]):04X} at {begin_s:.6f} s",
                time_s=begin_s,
                value=begin_s - at_s,
                unit="s",
                low=0.0,
                high=self.within_s,
                since_s=at_s,
                sentence=f"{self.word} had {asked} {after(self.at, begin_s - at_s)}"
                f"{allowed(span(self.within_s)) if self.within_s else ''}"
                f"{f', and for {span(self.for_s)}' if self.for_s else ''}",
            )
        ]


def _bits(mask: int) -> str:
    return ", ".join(f"X{number}" for number in range(32) if mask >> number & 1)


@dataclass(frozen=True)
class settles_within(Expectation):
    """Expect `signal` within `tolerance` of `target` (its unit) at most `within_s` after `since`, and from
    then on to `until`, or to the end of the trace.

    Raises:
        ConfigurationError: `tolerance` or `within_s` is negative.

    """

    signal: str
    target: float
    _: KW_ONLY
    tolerance: float
    within_s: float
    since: Reference = 0.0
    until: Reference | None = None

    def __post_init__(self) -> None:
        check_bound("settles_within.tolerance", self.tolerance)
        check_bound("settles_within.within_s", self.within_s)

    @override
    def on(self, trace: Trace) -> Self:
        return self._with(signal=signal_about(trace, self.signal, self.since, self.until))

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"settling of {self.signal}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        until = "" if self.until is None else f" until {words_of(self.until)}"
        return (
            f"{self.target:g} +- {self.tolerance:g} within {self.within_s:g} s of {words_of(self.since)}, "
            f"and from then on{until}"
        )

    @override
    def signals_named(self) -> tuple[str, ...]:
        return (self.signal,)

    @override
    def levels_named(self) -> tuple[str, ...]:
        return self.signals_named()

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace: the time of settling is that of the first sample from which on all are within
        the band.
        """
        since_s, until_s = instant(trace, self.since), end_of(trace, self.until)
        part = trace[self.signal].between(since_s, until_s)
        if len(part) == 0 or float(part.time_s[-1]) < since_s + self.within_s - SLACK_S:
            last_s = float(part.time_s[-1]) - since_s if len(part) else 0.0
            seen = f"recorded is only up to {last_s:.6f} s after" if len(part) else "no samples"
            return [self.unseen(trace, seen, since_s)]
        outside = np.flatnonzero(~(np.abs(part.values - self.target) <= self.tolerance))
        low, high = self.target - self.tolerance, self.target + self.tolerance
        if len(outside) and int(outside[-1]) == len(part) - 1:
            value = float(part.values[-1])
            return [
                self.outcome(
                    passed=False,
                    observed=f"{value:g} {part.unit} at the end",
                    time_s=float(part.time_s[-1]),
                    value=value,
                    unit=part.unit,
                    signal=self.signal,
                    low=low,
                    high=high,
                    sentence=f"{self.signal} did not settle: {quantity(value, part.unit)} at the end"
                    f"{allowed(limit_words(low, high, part.unit))}",
                )
            ]
        settled_s = float(part.time_s[int(outside[-1]) + 1 if len(outside) else 0])
        taken_s = settled_s - since_s
        return [
            self.outcome(
                passed=taken_s <= self.within_s + SLACK_S,
                observed=f"settled after {taken_s:.6f} s",
                time_s=settled_s,
                value=taken_s,
                unit="s",
                low=0.0,
                high=self.within_s,
                since_s=since_s,
                sentence=f"{self.signal} settled at {limit_words(low, high, part.unit)} "
                f"{after(self.since, taken_s)}{allowed(span(self.within_s))}",
            )
        ]


@dataclass(frozen=True)
class disabled(Expectation):
    """Expect no enable of the axis and no torque of its drive from `by` on.

    Args:
        by: Begin of the observation.
        axis: Name of the axis; empty: only the drive is judged; None: that of the drive, or the one that
            `by` is an event of, or the only one.
        drive: Name of the drive; empty: only the axis is judged; None: that of the axis.
        until: End of the observation; None: the end of the trace.

    Raises:
        ConfigurationError: Neither axis nor drive is named.

    """

    _: KW_ONLY
    by: Reference
    axis: str | None = None
    drive: str | None = None
    until: Reference | None = None

    def __post_init__(self) -> None:
        if self.axis == "" and self.drive == "":
            raise ConfigurationError("disabled", (self.axis, self.drive), "an axis, a drive, or both")

    @override
    def on(self, trace: Trace) -> Self:
        about = self.axis or ""
        if not about and (self.axis is None or axis_names(trace)):
            about = axis_about(trace, "", self.drive, self.by, self.until)
        return self._with(
            axis=about if self.axis is None else self.axis,
            drive=drive_of(trace, about) if self.drive is None else self.drive,
        )

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"{' and '.join(filter(None, (self.axis, self.drive))) or 'the axis'} disabled"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        return f"no enable, no torque {words_of_span(self.by, self.until)}"

    @override
    def signals_named(self) -> tuple[str, ...]:
        axis = (f"{self.axis}.power_status",) if self.axis else ()
        return (*axis, f"{self.drive}.state") if self.drive else axis

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace, a check for the axis and one for the drive."""
        by_s, until_s = instant(trace, self.by), end_of(trace, self.until)
        checks = []
        if self.axis:
            name = f"{self.axis}.power_status"
            try:
                word = trace[name]
            except NotRecordedError as error:
                # The drive may still tell that it gives torque, and that would be the answer.
                blocked = self.check(Verdict.BLOCKED, str(error), None)
                checks.append(replace(blocked, name=f"{blocked.name}: {self.axis}"))
            else:
                checks.append(self._check(word, word.values != 0, by_s, until_s, "MC_Power.Status is TRUE"))
        if self.drive:
            word, on = _torque_possible(trace, self.drive)
            checks.append(self._check(word, on, by_s, until_s, "it shows torque"))
        return checks

    def _check(self, word: Signal, on: NDArray[np.bool_], by_s: float, until_s: float, text: str) -> Check:
        inside = (word.time_s >= by_s - SLACK_S) & (word.time_s <= until_s + SLACK_S)
        name = word.name.partition(".")[0]
        if not inside.any():
            return self.outcome(
                passed=False, observed="nothing was recorded after that", time_s=by_s, name=name
            )
        broken = np.flatnonzero(inside & on)
        when = float(word.time_s[broken[0]]) if len(broken) else None
        last = float(word.time_s[broken[-1]]) if len(broken) else by_s
        observed = (
            f"{text}, the last time {last - by_s:.6f} s after"
            if len(broken)
            else f"so at all {int(inside.sum())} samples"
        )
        sentence = f"{name} was disabled from {instant_words(self.by)} on"
        if when is not None:
            sentence = f"{name} was not disabled after {instant_words(self.by)}: {observed}"
        return self.outcome(
            passed=when is None, observed=observed, time_s=when, name=name, since_s=by_s, sentence=sentence
        )


def _torque_possible(trace: Trace, drive: str) -> tuple[Signal, NDArray[np.bool_]]:
    """Return a word of a drive of either profile, and where it says that the drive
    may give torque, or says nothing.
    """
    if f"{drive}.drive_zsw2" in trace:
        word = trace[f"{drive}.drive_zsw2"]
        on = _integers(word) & 0x0400 != 0
    elif f"{drive}.drive_zsw1" in trace:
        # Without ZSW2 switched on (S3) and a stop with torque (S5) are the same bits; S5 comes from operation
        # alone.
        word = trace[f"{drive}.drive_zsw1"]
        on = _from_operation(_integers(word))
    else:
        if trace.from_log and f"{drive}.statusword" not in trace:
            raise NotRecordedError(f"the log does not tell whether {drive} may give torque")
        word = trace[f"{drive}.statusword"]
        on = has_torque(_integers(word))
    return word, on | np.isnan(word.values)


def _integers(word: Signal) -> NDArray[np.int64]:
    return np.nan_to_num(word.values).astype(np.int64)


def _from_operation(zsw1: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return where ZSW1 shows operation (S4), or a stop that has begun there (S5)."""
    bits = zsw1 & 0x47
    result = np.zeros(len(bits), dtype=bool)
    torque = False
    for index, one in enumerate(bits):
        torque = one == 0x07 or (torque and one == 0x03)
        result[index] = torque
    return result
