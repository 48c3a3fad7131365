"""Measuring a stop on recorded signals: begin, end, ramp time, travel, peak values,
and who made the ramp (STP-553).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hil.record import Signal, Trace


@dataclass(frozen=True)
class StopMeasurement:
    """What a stop looked like. Units are those of the measured signals."""

    since_s: float
    """Reference instant."""
    begin_s: float
    """Where time and travel begin to count: the reference, or the begin of the straight ramp."""
    end_s: float | None
    """First sample from which on the signal stays at rest, or the end of the straight ramp; None when it
    never rests.
    """
    start_velocity: float
    """Signed velocity at the reference instant."""
    distance: float | None
    """Travel from begin to end, magnitude."""
    mean_deceleration: float | None
    """Slope of a straight line through the middle of the ramp (80 % to 20 % of
    the start velocity), magnitude.
    """
    peak_deceleration: float
    """Greatest decrease of speed per second between two samples."""
    peak_jerk: float
    """Greatest change of that per second."""
    made_by: str
    """`controller` (the setpoint ramps), `drive` (the setpoint is zero while the axis still brakes), or empty
    when no setpoint was recorded."""

    @property
    def duration_s(self) -> float | None:
        """Time from begin to end, s."""
        return None if self.end_s is None else self.end_s - self.begin_s

    @property
    def delay_s(self) -> float:
        """Time from the reference instant to the begin, s."""
        return self.begin_s - self.since_s


def measure_stop(
    trace: Trace,
    since_s: float,
    *,
    velocity: str,
    position: str | None = None,
    setpoint: str | None = None,
    threshold: float | None = None,
    until_s: float | None = None,
    straight: bool = False,
) -> StopMeasurement:
    """Measure the stop that begins at `since_s`.

    Args:
        trace: The recording.
        since_s: Reference instant: where time and travel begin to count, s.
        velocity: Signal that brakes.
        position: Signal for the travel; default: the integral of `velocity`.
        setpoint: Speed or velocity setpoint, to tell who made the ramp.
        threshold: Magnitude up to which `velocity` counts as rest; default 0.5 % of the start velocity.
        until_s: End of the observation (a later motion is another story); default the end of the trace.
        straight: Begin and end are those of a straight line through the middle of the ramp, which leaves
            delays of bus and control out of the ramp time: right for the ramp of a drive, wrong for a
            jerk-limited one.

    Raises:
        RecordingError: A signal was not recorded.

    """
    last_s = trace.end_s if until_s is None else until_s
    signal = trace[velocity]
    start_velocity = signal.at(since_s)
    part = signal.between(since_s, last_s)
    limit = abs(start_velocity) * 0.005 if threshold is None else threshold
    end_s = part.settles(limit, after_s=since_s)
    sign = -1.0 if start_velocity < 0 else 1.0
    ramp = part.between(since_s, last_s if end_s is None else end_s)
    slopes = ramp.derivative()
    falling = -sign * slopes.values
    jerks = np.abs(np.diff(slopes.values) / np.diff(slopes.time_s)) if len(slopes) > 1 else np.zeros(0)
    line = _middle_line(ramp, abs(start_velocity), sign)
    begin_s = since_s
    if straight and end_s is not None and line is not None:
        middle_s, speed, slope = line
        begin_s = middle_s - (abs(start_velocity) - speed) / slope
        end_s = middle_s + speed / slope
    return StopMeasurement(
        since_s=since_s,
        begin_s=begin_s,
        end_s=end_s,
        start_velocity=start_velocity,
        distance=None if end_s is None else _travel(trace, signal, position, begin_s, end_s),
        mean_deceleration=None if line is None else line[2],
        peak_deceleration=float(max(falling.max(initial=0.0), 0.0)),
        peak_jerk=float(jerks.max(initial=0.0)),
        made_by="" if setpoint is None else _maker(trace[setpoint], part, since_s, last_s, start_velocity),
    )


def _travel(trace: Trace, velocity: Signal, position: str | None, begin_s: float, end_s: float) -> float:
    if position is not None:
        signal = trace[position]
        places = np.interp([begin_s, end_s], signal.time_s, signal.values)
        return abs(float(places[1] - places[0]))
    part = velocity.between(begin_s, end_s)
    return abs(float(np.trapezoid(part.values, part.time_s)))


def _middle_line(ramp: Signal, start: float, sign: float) -> tuple[float, float, float] | None:
    """Fit a straight line between 80 % and 20 % of the start velocity; returns a
    point (time, speed) and the slope.
    """
    speed = sign * ramp.values
    middle = (speed <= 0.8 * start) & (speed >= 0.2 * start)
    if start <= 0 or int(middle.sum()) < 2:
        return None
    times, speeds = ramp.time_s[middle], speed[middle]
    centred = times - times.mean()
    slope = float(-(centred @ (speeds - speeds.mean())) / (centred @ centred))
    return (float(times.mean()), float(speeds.mean()), slope) if slope > 0 else None


def _maker(setpoint: Signal, velocity: Signal, begin_s: float, end_s: float, start_velocity: float) -> str:
    """Tell a setpoint that ramps down from one that is gone while the axis still brakes.

    Each signal is measured against its own start, so that the speed setpoint to the drive (rpm) may stand
    together with an actual velocity in mm/s. The sample before the reference counts as start too: at the
    reference itself the setpoint may already be zero.
    """
    if len(setpoint) == 0:
        return ""
    commanded = setpoint.between(begin_s, end_s)
    index = max(int(np.searchsorted(setpoint.time_s, begin_s)) - 1, 0)
    own_start = max(abs(setpoint.at(begin_s)), abs(float(setpoint.values[index])))
    ramping = int(_between(commanded, own_start).sum())
    braking = int(_between(velocity, abs(start_velocity)).sum())
    return "controller" if own_start > 0 and 2 * ramping >= braking else "drive"


def _between(signal: Signal, start: float) -> NDArray[np.bool_]:
    """Return which samples lie between 10 % and 90 % of `start`."""
    speed = np.abs(signal.values)
    inside: NDArray[np.bool_] = (speed > 0.1 * start) & (speed < 0.9 * start)
    return inside
