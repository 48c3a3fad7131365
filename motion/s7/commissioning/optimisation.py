"""Optimisation of the position controller, step by step as an operator does it (§6.7, COM-052 to COM-069)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import copysign, inf
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from fieldbus.errors import ConfigurationError
from motion.s7.axis.state import AxisState
from motion.s7.commissioning.panel import CommissioningError, ControlPanel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from motion.s7.runtime import Runtime

KV: Final = "PositionControl.Kv"
KPC: Final = "PositionControl.Kpc"
TIME_CONSTANT: Final = "DynamicAxisModel.VelocityTimeConstant"

_FIRST_GAIN: Final = 10.0
"""1/s (COM-057)."""
_FINE: Final = 1.05
"""Steps of the gain (COM-060)."""
_COARSE: Final = 1.25
"""Steps as long as nothing overshoots yet."""
_SHARE: Final = 0.9
"""Of the gain found, with precontrol (COM-062)."""
_TIME_STEP: Final = 0.001
"""Steps of the time constant, s (COM-063)."""
_MOST_STEPS: Final = 100
_LEAST_GAIN: Final = 0.5
"""1/s; with less nobody controls a position."""
_GREATEST_GAIN: Final = 1000.0
"""1/s; no drive follows more than that."""
_LOOSE: Final = 4.0
"""Following error that is permitted during the optimisation, as a multiple of v/Kv at the first gain or a
smaller one (COM-017).
"""
_RUNAWAY: Final = 0.05
"""Overshoot at which a step is broken off, as a share of its distance: the axis oscillates."""
_SMALLEST: Final = 1e-4
"""Share of the distance that counts as no overshoot, where no tolerance is given."""
_INCREMENTS: Final = 1.5
"""The same in increments of the encoder: its last digit may tremble."""
_CALM_S: Final = 5.0
"""Time that the axis has to come to rest with a gain that is known to be good, s."""
_PATIENCE: Final = 10.0
"""Time that the axis has to settle in after the end of a test step, as a multiple of 1/Kv."""
_AFTERWARDS: Final = 0.2
"""Time that is recorded after the end of a test step at least, s."""


@dataclass(frozen=True)
class TestStep:
    """The motion with which a setting is tried: a trapezoid, forward and backward.

    Args:
        distance: Axis unit, above 0.
        velocity: Axis unit per second.
        acceleration: Axis unit per second squared, for braking too; high enough that the axis has
            something to overshoot with.
        tolerance: Deviation that is none, axis unit; 0 = a ten-thousandth of the distance, at least 1.5
            increments of the encoder.

    Raises:
        ConfigurationError: One of them is not as described.

    """

    __test__ = False  # no test of pytest, whatever its name says

    distance: float
    velocity: float
    acceleration: float
    tolerance: float = 0.0

    def __post_init__(self) -> None:
        for name in ("distance", "velocity", "acceleration"):
            if not 0.0 < getattr(self, name) < inf:
                raise ConfigurationError(f"test step: {name}", getattr(self, name), "a number above 0")
        if not 0.0 <= self.tolerance < self.distance:
            raise ConfigurationError(
                "test step: tolerance", self.tolerance, "0 or more, and less than the distance"
            )


@dataclass(frozen=True)
class Attempt:
    """One setting, tried with a test step."""

    kv: float
    """1/s."""
    kpc: float
    """Percent."""
    time_constant: float
    """Seconds."""
    overshoot: float
    """How far the actual position has gone beyond the target, axis unit; forward and backward the greater."""
    reversal: float
    """How far it has gone back on the way, axis unit."""
    settling_s: float
    """From the end of the setpoint until the axis stays within the tolerance, s."""
    time_s: NDArray[np.float64] = field(repr=False)
    setpoint: NDArray[np.float64] = field(repr=False)
    actual: NDArray[np.float64] = field(repr=False)
    tolerance: float = field(repr=False)

    @property
    def good(self) -> bool:
        """No overshoot and no reversal beyond the tolerance (COM-067)."""
        return self.overshoot <= self.tolerance and self.reversal <= self.tolerance

    def as_dict(self) -> dict[str, float | bool]:
        """Return the numbers, for JSON."""
        return {
            "kv": self.kv,
            "kpc": self.kpc,
            "time_constant_s": self.time_constant,
            "overshoot": self.overshoot,
            "reversal": self.reversal,
            "settling_s": self.settling_s,
            "good": self.good,
        }


@dataclass(frozen=True)
class Recommendation:
    """What the optimisation ends with."""

    kv: float
    kpc: float
    time_constant: float
    attempts: tuple[Attempt, ...] = field(repr=False)

    @property
    def start_values(self) -> dict[str, float]:
        """The values for the project: `bench.controller.download(axis, recommendation.start_values)`
        (COM-064, COM-069).
        """
        return {KV: self.kv, KPC: self.kpc, TIME_CONSTANT: self.time_constant}


def tuned_by_drive(gain: float, time_constant_ms: float) -> dict[str, float]:
    """Return start values from what the one-button tuning of a SINAMICS drive has
    found (COM-053, COM-054, CTL-035).

    Args:
        gain: r5276, 1000/min.
        time_constant_ms: r5277, ms.

    """
    return {KV: 0.5 * 16.66666 * gain, TIME_CONSTANT: 0.001 * time_constant_ms}


class Optimisation:
    """Finds gain, precontrol and time constant of a positioning axis that a control panel has enabled.

    Args:
        panel: A panel with master control and the axis enabled.
        runtime: The cycle of the controller.
        wait: Lets time pass until a condition holds: `wait(condition, seconds)` returns whether it came
            to hold in time.
        step: The test step.

    Raises:
        CommissioningError: The axis has no position control, or the panel has not enabled it.

    """

    def __init__(
        self,
        panel: ControlPanel,
        runtime: Runtime,
        wait: Callable[[Callable[[], bool], float], bool],
        step: TestStep,
    ) -> None:
        axis: Any = panel.axis
        if not axis.has_position:
            raise CommissioningError(f"{axis.name}: a speed axis has no position control (CFG-065)")
        if not panel.active or not panel.enabled:
            raise CommissioningError(f"{axis.name}: the panel needs master control, and the axis enabled")
        self._panel = panel
        self._axis = axis
        self._runtime = runtime
        self._wait = wait
        self._step = self._resolved(step)
        self._calm = _FIRST_GAIN
        """A gain with which the axis is known to stand still, 1/s."""
        self.attempts: list[Attempt] = []
        """What has been tried so far."""

    def _resolved(self, step: TestStep) -> TestStep:
        """Return the step with a tolerance, and within what the axis can do (COM-056)."""
        axis = self._axis
        read = axis.variables.read
        for name, most in (
            ("velocity", min(read("DynamicLimits.MaxVelocity"), read("DynamicLimits.Velocity"))),
            (
                "acceleration",
                min(read("DynamicLimits.MaxAcceleration"), read("DynamicLimits.MaxDeceleration")),
            ),
        ):
            if getattr(step, name) > most:
                raise ConfigurationError(
                    f"test step: {name}",
                    getattr(step, name),
                    f"at most {most:g}, the dynamic limit of {axis.name}",
                )
        if step.tolerance:
            return step
        increment = abs(axis.feedback.scale.increment)
        return replace(step, tolerance=max(_SMALLEST * step.distance, _INCREMENTS * increment))

    def run(self) -> Recommendation:
        """Try settings until the best is known; the axis moves forward and backward by the test step.

        Raises:
            CommissioningError: A torque limit has acted, an alarm has come, or no setting is without
                overshoot; the text says what to change.

        """
        gain = self._gain_without_precontrol()
        kv = _SHARE * gain
        time_constant = self._time_constant(kv)
        return Recommendation(kv, 100.0, time_constant, tuple(self.attempts))

    def _prepare(self) -> None:
        """Set the dynamics of the test step, and loosen what watches: this routine judges for itself how the
        axis settles.
        """
        if self.attempts:
            return
        panel, step = self._panel, self._step
        panel.velocity = step.velocity
        panel.acceleration = panel.deceleration = step.acceleration
        panel.jerk = 0.0
        panel.adjust = 100.0
        panel.try_value(
            "PositioningMonitoring.Window",
            max(2.0 * step.distance, self._axis.variables.read("PositioningMonitoring.Window")),
        )
        panel.try_value("PositioningMonitoring.MinDwellTime", 0.0)

    def _gain_without_precontrol(self) -> float:
        """Raise the gain until the first overshoot, and return the last one without (COM-060, COM-065).

        A bus or a speed loop that is too slow for the first gain gets a smaller one to begin with.
        """
        factor, good = _COARSE, _FIRST_GAIN
        while not (attempt := self.attempt(good, 0.0, 0.0)).good:
            factor = _FINE
            good /= _COARSE
            if good < _LEAST_GAIN:
                raise CommissioningError(
                    f"{self._axis.name}: it overshoots by {attempt.overshoot:.4g} with a gain of "
                    f"{attempt.kv:.3g} 1/s still; "
                    "the speed controller of the drive has to be set first"
                )
            self._calm = good
        gain = good * factor
        while gain <= _GREATEST_GAIN:
            if self.attempt(gain, 0.0, 0.0).good:
                good = self._calm = gain
            elif factor == _FINE:
                return good
            else:
                factor = _FINE
            gain = good * factor
        raise CommissioningError(
            f"{self._axis.name}: no overshoot up to a gain of {good:.4g} 1/s; the test step needs more "
            f"acceleration "
            "or a smaller tolerance"
        )

    def _time_constant(self, kv: float) -> float:
        """Raise the time constant until nothing overshoots with precontrol (COM-062, COM-063)."""
        for count in range(_MOST_STEPS):
            time_constant = count * _TIME_STEP
            # Friction may have held back once what overshoots otherwise, so that a good one has to be good
            # twice.
            if self.attempt(kv, 100.0, time_constant).good and self.attempt(kv, 100.0, time_constant).good:
                return time_constant
        raise CommissioningError(
            f"{self._axis.name}: with precontrol it overshoots up to a time constant of "
            f"{_MOST_STEPS - 1} ms; "
            "the drive does not follow its speed setpoint"
        )

    def attempt(self, kv: float, kpc: float, time_constant: float) -> Attempt:
        """Try one setting with a step forward and one backward.

        Args:
            kv: Gain, 1/s.
            kpc: Velocity precontrol, percent.
            time_constant: Substitute time of the speed control loop, s.

        Raises:
            CommissioningError: As `run`.

        """
        self._prepare()
        loose = _LOOSE * self._step.velocity / min(kv, _FIRST_GAIN)
        for path in ("FollowingError.MinValue", "FollowingError.MaxValue"):
            self._panel.try_value(path, max(loose, self._axis.variables.read(path)))
        for path, value in ((KV, kv), (KPC, kpc), (TIME_CONSTANT, time_constant)):
            self._panel.try_value(path, value)
        self._rest(2 * self._runtime.cycle_ns * 1e-9)
        forward, broken = self._move(self._step.distance)
        backward, also_broken = self._move(-self._step.distance)
        broken = broken or also_broken
        values = [self._judge(rows, way) for rows, way in ((forward, 1.0), (backward, -1.0))]
        overshoot, reversal, settling = (max(one) for one in zip(*values, strict=True))
        if broken:
            overshoot = max(overshoot, _RUNAWAY * self._step.distance)
            self._come_to_rest()
        rows = np.vstack((forward, backward))
        attempt = Attempt(
            kv,
            kpc,
            time_constant,
            overshoot,
            reversal,
            settling,
            rows[:, 0] - rows[0, 0],
            rows[:, 1],
            rows[:, 2],
            self._step.tolerance,
        )
        self.attempts.append(attempt)
        return attempt

    def _rest(self, seconds: float) -> None:
        end = self._runtime.scheduler.now + round(seconds * 1e9)
        self._wait(lambda: self._runtime.scheduler.now >= end, seconds + 1.0)

    def _come_to_rest(self) -> None:
        """Let the axis end its oscillation with a gain that is known to be good."""
        self._calm_down()
        axis = self._axis
        since, low, high = self._runtime.scheduler.now, inf, -inf

        def rests() -> bool:
            nonlocal since, low, high
            now, place = self._runtime.scheduler.now, axis.feedback.position
            low, high = min(low, place), max(high, place)
            if high - low > self._step.tolerance:
                since, low, high = now, place, place
            return now - since >= round(_AFTERWARDS * 1e9)

        if not self._wait(rests, _CALM_S):
            raise CommissioningError(
                f"{axis.name}: it does not come to rest with a gain of {self._calm:.4g} 1/s; "
                "the speed controller of the drive has to be set first"
            )

    def _calm_down(self) -> None:
        for path, value in ((KV, self._calm), (KPC, 0.0)):
            self._panel.try_value(path, value)

    def _move(self, distance: float) -> tuple[NDArray[np.float64], bool]:
        """Make one step.

        Returns:
            Rows of time in s, position setpoint and actual position during the step and shortly after it, and
            whether the axis began to oscillate, so that the gain was taken back at once.

        """
        axis, panel = self._axis, self._panel
        rows: list[tuple[float, float, float]] = []
        limited: list[float] = []
        way = copysign(1.0, distance)
        target = axis.servo.total.s + distance
        broken = False

        def sample() -> None:
            nonlocal broken
            rows.append((self._runtime.scheduler.now * 1e-9, axis.servo.total.s, axis.feedback.position))
            if not broken and (rows[-1][2] - target) * way > _RUNAWAY * abs(distance) + self._step.tolerance:
                broken = True
                self._calm_down()
            if axis.port.torque_limit_reached and not broken:
                limited.append(rows[-1][0])

        self._runtime.after_cycle.append(sample)
        try:
            job = panel.move_relative(distance)
            ended = self._wait(lambda: job.Done or job.Error or job.CommandAborted, self._longest())
            self._rest(max(_AFTERWARDS, _PATIENCE / axis.servo.controller.gain))
        finally:
            self._runtime.after_cycle.remove(sample)
        if not ended or not job.Done or axis.state is not AxisState.STANDSTILL:
            number = axis.alarms.engine.number
            why = f"alarm {number}" if number else panel.message or "the step did not end in time"
            raise CommissioningError(f"{axis.name}: a test step failed: {why}")
        if limited and not broken:
            raise CommissioningError(
                f"{axis.name}: the torque limit of the drive acted during a test step; it needs less "
                f"acceleration (COM-059)"
            )
        return np.array(rows), broken

    def _longest(self) -> float:
        step = self._step
        return step.distance / step.velocity + step.velocity / step.acceleration + 2.0

    def _judge(self, rows: NDArray[np.float64], way: float) -> tuple[float, float, float]:
        time, setpoint, actual = rows.T
        target = setpoint[-1]
        beyond = (actual - target) * way
        progress = np.maximum.accumulate(actual * way)
        on_the_way = beyond < -self._step.tolerance
        reversal = float((progress - actual * way)[on_the_way].max(initial=0.0))
        arrived = time[int(np.argmax(setpoint == target))]
        outside = np.flatnonzero(np.abs(beyond) > self._step.tolerance)
        last = time[outside[-1]] if len(outside) else arrived
        return float(max(0.0, beyond.max())), reversal, float(max(0.0, last - arrived))
