"""Expectation of a stop by its mode: the ramp is calculated from the limits of the
axis and its motion in the trace.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Final, Self

from typing_extensions import override

from fieldbus.errors import ConfigurationError
from hil.expect._axis import axis_about
from hil.expect._base import Expectation, Reference, check_bound, instant, of_axis, value_in_force, words_of
from hil.expect._stops import ramp
from hil.expect.golden import StopRamp, stop_ramp
from hil.record import Trace
from reports.model import Check, Verdict

MODES: Final = {
    "emergency": ("emergency_deceleration", ""),
    "maximum": ("max_deceleration", "max_jerk"),
    "default": ("deceleration", "jerk"),
}
"""Name of a ramp, and the constants of the axis that make it: deceleration and jerk."""

_REST: Final = 1e-6


@dataclass(frozen=True)
class stop(Expectation):
    """Expect a stop of the axis whose time and travel are those of its mode, from the velocity that the axis
    has in the trace.

    Args:
        since: The falling edge of the enable, the alarm, the job.
        mode: `emergency` (StopMode 0, reaction 3, `MC_Stop` 0), `maximum` (StopMode 2, reaction 2,
            `MC_Stop` 2) or `default` (`MC_Halt`, reaction 1 with the default dynamics). For ramps of the
            drive see `ramp` with `made_by="drive"`.
        axis: The axis; empty: the one that `since` is an event of, or the only one.
        until: End of the observation.
        time_tolerance_s: Default two cycles.
        distance_tolerance: Default two cycles at the start velocity.

    Raises:
        ConfigurationError: There is no such mode, or a tolerance is negative.

    """

    since: Reference
    mode: str
    _: KW_ONLY
    axis: str = ""
    until: Reference | None = None
    time_tolerance_s: float | None = None
    distance_tolerance: float | None = None

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ConfigurationError("stop.mode", self.mode, ", ".join(MODES))
        check_bound("stop.time_tolerance_s", self.time_tolerance_s)
        check_bound("stop.distance_tolerance", self.distance_tolerance)

    @override
    def on(self, trace: Trace) -> Self:
        return self._with(axis=axis_about(trace, self.axis, self.since, self.until))

    @property
    def title(self) -> str:
        """Name made from the content."""
        return f"stop of {self.axis or 'the axis'} with the {self.mode} ramp"

    @property
    def wanted(self) -> str:
        """What is expected, in words."""
        return f"the {self.mode} ramp of {self.axis or 'the axis'} after {words_of(self.since)}"

    @override
    def signals_named(self) -> tuple[str, ...]:
        return tuple(of_axis(self.axis, name) for name in ("velocity_setpoint", "position_setpoint"))

    def judge(self, trace: Trace) -> list[Check]:
        """Evaluate on a trace: time and travel by formula, from velocity and
        acceleration at the reference.
        """
        constants = [f"{self.axis}.{name}" for name in (*MODES[self.mode], "cycle_s") if name]
        missing = [name for name in constants if name not in trace.constants]
        if missing:
            return [self.check(Verdict.ERROR, f"the trace does not hold {', '.join(missing)}", None)]
        since_s = instant(trace, self.since)
        expected, speed = self._ramp(trace, since_s)
        if speed <= _REST:
            observed = f"the axis does not move at {since_s:.6f} s: there is nothing to stop"
            return [self.outcome(passed=False, observed=observed, time_s=since_s, sentence=observed)]
        cycles_s = 2 * trace.constants[f"{self.axis}.cycle_s"]
        judged = ramp(
            self.since,
            expected,
            axis=self.axis,
            made_by="controller",
            until=self.until,
            time_tolerance_s=cycles_s if self.time_tolerance_s is None else self.time_tolerance_s,
            distance_tolerance=speed * cycles_s
            if self.distance_tolerance is None
            else self.distance_tolerance,
        )
        return judged.named(self.label or self.title).covers(*self.requirements).judge(trace)

    def _ramp(self, trace: Trace, since_s: float) -> tuple[StopRamp, float]:
        """Return the ramp by formula and the speed with which it begins."""
        deceleration, jerk = MODES[self.mode]
        of = trace.constants
        limit = of[f"{self.axis}.{deceleration}"]
        if not jerk:
            # The emergency ramp begins with the actual velocity.
            speed = abs(value_in_force(trace, f"{self.axis}.actual_velocity", since_s))
            return stop_ramp(speed, limit), speed
        velocity = value_in_force(trace, f"{self.axis}.velocity_setpoint", since_s)
        # A setpoint that has gone at the reference itself was no ramp: the cycle before tells what there was
        # to stop.
        before = trace[f"{self.axis}.velocity_setpoint"].at(since_s - of[f"{self.axis}.cycle_s"])
        velocity = max(velocity, before, key=abs)
        acceleration = trace[f"{self.axis}.acceleration_setpoint"].at(since_s) * (
            -1.0 if velocity < 0 else 1.0
        )
        present = max(acceleration, -limit)
        return stop_ramp(abs(velocity), limit, of[f"{self.axis}.{jerk}"], acceleration=present), abs(velocity)
