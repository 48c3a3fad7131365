"""Expectations about stopping: ramp, time, distance, who made the ramp, standstill, no motion afterwards."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Literal, Self

import numpy as np
from typing_extensions import override

from fieldbus.errors import ConfigurationError
from hil.expect._axis import axis_about
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
)
from hil.expect._measure import measure_stop
from hil.expect._wording import allowed, instant_words, size, span, spans
from hil.expect.golden import StopRamp
from hil.record import Signal, Trace
from reports.model import Check
from reports.text import limit_words, quantity

Maker = Literal["controller", "drive"]


@dataclass(frozen=True)
class ramp(Expectation):
    """Expect a stop: its ramp time, travel, slope, and which side makes the ramp.

    A ramp of the controller is measured on its setpoints, from the reference to setpoint zero. A ramp of the
    drive is measured on the actual values, as the straight line through its middle, which begins at most
    `delay_s` after the reference; so the delays of bus and measurement do not count as ramp time. Without
    `made_by` the actual values are measured from the reference to rest.

    Args:
        since: The falling edge of the enable, the alarm, the job.
        expected: Ramp time and travel from `hil.expect.golden`; `time_s` and `distance` override it.
        axis: Axis whose standard signals are measured; empty: the one that `since` is an event of, or the
            only one.
        made_by: `controller` or `drive`; distinguished by the speed output of the axis.
        velocity: Another signal that brakes.
        position: Another signal for the travel.
        setpoint: Another setpoint to the drive.
        until: End of the observation.
        time_s: Ramp time, s.
        time_tolerance_s: Default two cycles of 4 ms.
        distance: Travel, in the unit of the position.
        distance_tolerance: Default two cycles of 4 ms at 300 mm/s; add the following error for actual values.
        slope: Deceleration in the middle of the ramp, magnitude.
        slope_tolerance: Default 2 % of `slope`.
        delay_s: Latest begin of a ramp of the drive after the reference; default five cycles of 4 ms.
        threshold: Magnitude that counts as rest; default 0.5 % of the start
            velocity, for setpoints a millionth.

    Raises:
        ConfigurationError: A tolerance is negative, or there is no such maker.

    """

    since: Reference
    expected: StopRamp | None = None
    _: KW_ONLY
    axis: str = ""
    made_by: Maker | None = None
    velocity: str | None = None
    position: str | None = None
    setpoint: str | None = None
    until: Reference | None = None
    time_s: float | None = None
    time_tolerance_s: float = 0.008
    distance: float | None = None
    distance_tolerance: float = 2.4
    slope: float | None = None
    slope_tolerance: float | None = None
    delay_s: float = 0.02
    threshold: float | None = None

    def __post_init__(self) -> None:
        check_bound("ramp.time_tolerance_s", self.time_tolerance_s)
        check_bound("ramp.distance_tolerance", self.distance_tolerance)
        check_bound("ramp.delay_s", self.delay_s)
        if self.made_by not in {None, "controller", "drive"}:
            raise ConfigurationError("ramp.made_by", self.made_by, "controller, drive")

    @override
    def on(self, trace: Trace) -> Self:
        named = (self.velocity, self.position, self.setpoint)
        if self.velocity and self.position and (self.setpoint or not self.made_by):
            return self
        return self._with(axis=axis_about(trace, self.axis, *named, self.since, self.until))

    @property
    def _on_setpoints(self) -> bool:
        return self.made_by == "controller" and self.velocity is None

    @property
    def braking(self) -> str:
        """Name of the velocity signal that is measured."""
        if self.velocity:
            return self.velocity
        return of_axis(self.axis, "velocity_setpoint" if self._on_setpoints else "actual_velocity")

    @property
    def travelling(self) -> str:
        """Name of the position signal that is measured."""
        if self.position:
            return self.position
        return of_axis(self.axis, "position_setpoint" if self._on_setpoints else "actual_position")

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"stop of {self.braking}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        return f"standstill after {words_of(self.since)}"

    @override
    def signals_named(self) -> tuple[str, ...]:
        return (self.braking, self.travelling)

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace: one check for every quantity that is expected."""
        since_s, until_s = instant(trace, self.since), end_of(trace, self.until)
        velocity, position, expected = self.braking, self.travelling, self.expected
        time_s = expected.time_s if self.time_s is None and expected is not None else self.time_s
        distance = expected.distance if self.distance is None and expected is not None else self.distance
        threshold = 1e-6 if self._on_setpoints and self.threshold is None else self.threshold
        setpoints = (
            [self.setpoint]
            if self.setpoint
            else [f"{self.axis}.speed_output", f"{self.axis}.velocity_setpoint"]
        )
        setpoint = next((name for name in setpoints if name in trace), setpoints[-1])
        stop = measure_stop(
            trace,
            since_s,
            velocity=velocity,
            position=position,
            setpoint=setpoint if self.made_by else None,
            threshold=threshold,
            until_s=until_s,
            straight=self.made_by == "drive",
        )
        speed_unit = trace[velocity].unit
        if stop.end_s is None:
            last = trace[velocity].at(until_s)
            observed = f"still {last:g} {speed_unit} at the end of the observation"
            sentence = f"{velocity} did not come to rest after {instant_words(self.since)}: {observed}"
            return [self.outcome(passed=False, observed=observed, time_s=until_s, sentence=sentence)]
        checks: list[Check] = []

        def limit(
            name: str, value: float | None, low: float, high: float, *, unit: str, text: str = ""
        ) -> None:
            good = value is not None and low - SLACK_S <= value <= high + SLACK_S
            observed = "could not be measured" if value is None else f"{value:.6g} {unit}"
            half = (high - low) / 2
            subject = f"{self._subject(name)} after {instant_words(self.since)}"
            sentence = f"{subject} could not be measured"
            if value is not None and unit == "s":
                limit = span(high) if name == "delay" else spans(low, high)
                sentence = f"{subject} took {span(value)}{allowed(limit)}"
            elif value is not None:
                sentence = f"{subject} was {quantity(value, unit, 5)}{allowed(limit_words(low, high, unit))}"
            checks.append(
                self.outcome(
                    passed=good,
                    observed=observed,
                    time_s=stop.end_s,
                    name=name,
                    expected=text or f"{(low + high) / 2:.6g} {unit} +- {half:.3g}",
                    value=value,
                    unit=unit,
                    low=low,
                    high=high,
                    since_s=since_s,
                    sentence=sentence,
                )
            )

        if self.made_by == "drive":
            limit(
                "delay",
                stop.delay_s,
                -self.delay_s,
                self.delay_s,
                unit="s",
                text=f"at most {self.delay_s:g} s",
            )
        if time_s is not None:
            low, high = time_s - self.time_tolerance_s, time_s + self.time_tolerance_s
            limit("ramp time", stop.duration_s, low, high, unit="s")
        if distance is not None:
            low, high = distance - self.distance_tolerance, distance + self.distance_tolerance
            limit("travel", stop.distance, low, high, unit=trace[position].unit)
        if self.slope is not None:
            margin = abs(self.slope) * 0.02 if self.slope_tolerance is None else self.slope_tolerance
            low, high = self.slope - margin, self.slope + margin
            limit("slope", stop.mean_deceleration, low, high, unit=f"{speed_unit}/s")
        if self.made_by is not None:
            checks.append(
                self.outcome(
                    passed=stop.made_by == self.made_by,
                    observed=stop.made_by,
                    expected=self.made_by,
                    name="ramp made by",
                    time_s=since_s,
                    sentence=f"the {stop.made_by or 'neither side'} made the ramp of the stop after "
                    f"{instant_words(self.since)}"
                    f"{'' if stop.made_by == self.made_by else f', instead of the {self.made_by}'}",
                )
            )
        if not checks:
            checks.append(
                self.outcome(
                    passed=True,
                    observed=f"at rest at {stop.end_s:.6f} s",
                    time_s=stop.end_s,
                    sentence=f"{velocity} was at rest {span(stop.end_s - since_s)} after "
                    f"{instant_words(self.since)}",
                )
            )
        return checks

    def _subject(self, quantity: str) -> str:
        """Return what a measurement of this stop is called: the ramp of axis1, the travel of drive1."""
        owner = self.braking.partition(".")[0]
        return {
            "delay": f"the begin of the ramp of {owner}",
            "ramp time": f"the ramp of {owner}",
            "travel": f"the travel of {owner}",
            "slope": f"the deceleration of {owner}",
        }[quantity]


@dataclass(frozen=True)
class standstill(Expectation):
    """Expect `|velocity|` <= `tolerance` (in the unit of the signal) from `by` to `until` (default: the end).

    Args:
        by: Begin of the observation.
        axis: Axis whose actual velocity is judged; empty: the one that `by` is an event of, or the only one.
        velocity: Another signal.
        tolerance: Magnitude that counts as rest.
        until: End of the observation; None: the end of the trace.

    Raises:
        ConfigurationError: The tolerance is negative.

    """

    _: KW_ONLY
    by: Reference
    axis: str = ""
    velocity: str | None = None
    tolerance: float = 1.0
    until: Reference | None = None

    def __post_init__(self) -> None:
        check_bound("standstill.tolerance", self.tolerance)

    @override
    def on(self, trace: Trace) -> Self:
        if self.velocity:
            return self
        return self._with(axis=axis_about(trace, self.axis, self.by, self.until))

    @property
    def signal(self) -> str:
        """Name of the signal that is judged."""
        return self.velocity or of_axis(self.axis, "actual_velocity")

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"standstill of {self.signal}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        return f"at most {self.tolerance:g} from {words_of(self.by)} on"

    @override
    def signals_named(self) -> tuple[str, ...]:
        return (self.signal,)

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace."""
        by_s = instant(trace, self.by)
        part = trace[self.signal].between(by_s, end_of(trace, self.until))
        if len(part) == 0:
            return [self.unseen(trace, "nothing was recorded after that", by_s)]
        # A value that is not a number is no standstill.
        speeds = np.where(np.isnan(part.values), np.inf, np.abs(part.values))
        moving = np.flatnonzero(speeds > self.tolerance)
        index = int(moving[0]) if len(moving) else int(np.argmax(speeds))
        return [
            self.outcome(
                passed=len(moving) == 0,
                observed=f"{float(part.values[index]):.6g} {part.unit}",
                time_s=float(part.time_s[index]),
                value=float(part.values[index]),
                unit=part.unit,
                low=-self.tolerance,
                high=self.tolerance,
                signal=self.signal,
                since_s=by_s,
                sentence=self._sentence(part, index, rests=len(moving) == 0),
            )
        ]

    def _sentence(self, part: Signal, index: int, *, rests: bool) -> str:
        """Return what came of it, with the sample nearest to the limit, or the first one beyond it."""
        value, when = float(part.values[index]), float(part.time_s[index])
        limit = allowed(size(self.tolerance, part.unit))
        if rests:
            return (
                f"{self.signal} was at rest from {instant_words(self.by)} on: at most "
                f"{size(abs(value), part.unit)}{limit}"
            )
        return f"{self.signal} was {size(value, part.unit)} at {instant_words(when)}{limit}"


@dataclass(frozen=True)
class no_motion_after(Expectation):
    """Expect that the position stays within `tolerance` (its unit) of where it is at `after`.

    Judge the true position of the mechanics (`position="drive1.position"`) where
    the encoder is faulty (STP-550).

    Args:
        after: Reference instant.
        axis: Axis whose actual position is judged; empty: the one that `after`
            is an event of, or the only one.
        position: Another signal.
        tolerance: Greatest displacement.
        until: End of the observation; None: the end of the trace.

    Raises:
        ConfigurationError: The tolerance is negative.

    """

    after: Reference
    _: KW_ONLY
    axis: str = ""
    position: str | None = None
    tolerance: float = 0.05
    until: Reference | None = None

    def __post_init__(self) -> None:
        check_bound("no_motion_after.tolerance", self.tolerance)

    @override
    def on(self, trace: Trace) -> Self:
        if self.position:
            return self
        return self._with(axis=axis_about(trace, self.axis, self.after, self.until))

    @property
    def signal(self) -> str:
        """Name of the signal that is judged."""
        return self.position or of_axis(self.axis, "actual_position")

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"no motion of {self.signal}"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        return f"at most {self.tolerance:g} of displacement after {words_of(self.after)}"

    @override
    def signals_named(self) -> tuple[str, ...]:
        return (self.signal,)

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace."""
        after_s = instant(trace, self.after)
        signal = trace[self.signal]
        part = signal.between(after_s, end_of(trace, self.until))
        if len(part) == 0:
            return [self.unseen(trace, "nothing was recorded after that", after_s)]
        displacement = part.values - value_in_force(trace, self.signal, after_s)
        distances = np.where(np.isnan(displacement), np.inf, np.abs(displacement))
        index = int(np.argmax(distances))
        value = float(displacement[index])
        return [
            self.outcome(
                passed=bool(distances[index] <= self.tolerance),
                observed=f"{value:.6g} {part.unit}",
                time_s=float(part.time_s[index]),
                value=value,
                unit=part.unit,
                low=-self.tolerance,
                high=self.tolerance,
                since_s=after_s,
                sentence=f"{self.signal} moved by {size(abs(value), part.unit)} after "
                f"{instant_words(self.after)}{allowed(size(self.tolerance, part.unit))}",
            )
        ]
