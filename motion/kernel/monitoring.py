"""Monitoring of a positioning axis: following error, positioning, standstill (MON-016 to MON-052)."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING, Final, Protocol

from motion.kernel.cell import Cell

if TYPE_CHECKING:
    from motion.kernel.modulo import Modulo
    from motion.kernel.servo_axis import ServoAxis
    from motion.kernel.torque_limits import TorqueLimits

_OVERSHOOT: Final = 1.01
"""What the control of an axis at its highest velocity may make of the actual one."""

_RELEASE_FACTOR: Final = 1.1
"""Hysteresis of the standstill signal (MON-048)."""
_RANGE_END: Final = 2**53 / 9.0e15
"""Where the numbers end, as a multiple of the largest position: 2^53 steps of the resolution (CFG-093)."""


class MonitoringReport(Protocol):
    """Who gets the reports of monitoring."""

    def following_error(self) -> None:
        """The following error is larger than permitted; reported in every cycle in which it is."""

    def following_error_near(self) -> None:
        """The following error has reached its warning level; reported in every cycle."""

    def not_positioned(self, *, left: bool) -> None:
        """The axis has not reached its positioning window in time, or `left` it
        before the dwell time was over.
        """

    def end_of_range(self, *, positive: bool, exceeded: bool) -> None:
        """The actual position is at the end of the range of positions, or beyond it (LIM-103)."""

    def implausible_velocity(self) -> None:
        """The axis passes its modulo range in less than a cycle."""


@dataclass(frozen=True, kw_only=True)
class MonitoringLimits:
    """What the monitoring compares with: position unit, position unit per second, s, percent.

    Args:
        following_error: Whether the following error is monitored.
        min_error: Permitted following error up to `min_velocity`.
        max_error: Permitted following error at `max_velocity`.
        min_velocity: Velocity up to which `min_error` holds.
        max_velocity: Highest velocity of the axis.
        warning_level: Share of the permitted following error that is a warning, percent.
        tolerance_s: Time within which the axis has to reach the positioning window.
        dwell_s: Time for which it has to stay there.
        window: Half width of the positioning window.
        standstill_velocity: Velocity below which the axis may stand.
        standstill_dwell_s: Time below that velocity until it does.

    """

    following_error: Cell[bool]
    min_error: Cell[float]
    max_error: Cell[float]
    min_velocity: Cell[float]
    max_velocity: Cell[float]
    warning_level: Cell[float]
    tolerance_s: Cell[float]
    dwell_s: Cell[float]
    window: Cell[float]
    standstill_velocity: Cell[float]
    standstill_dwell_s: Cell[float]


class Monitoring:
    """Following error, positioning and standstill of an axis; `step` runs once per interpolator cycle.

    Args:
        servo: The axis.
        limits: What is compared with.
        torque: Torque limits, which may suspend the monitoring of positions.
        report: Who gets its findings.
        cycle_s: Interpolator cycle, s.

    """

    def __init__(
        self,
        servo: ServoAxis,
        limits: MonitoringLimits,
        torque: TorqueLimits,
        report: MonitoringReport,
        *,
        cycle_s: float,
    ) -> None:
        self._servo = servo
        self._torque = torque
        self._report = report
        self._cycle = cycle_s
        self._farthest = inf
        self._enable_fe = limits.following_error
        self._fe_min = limits.min_error
        self._fe_max = limits.max_error
        self._fe_min_velocity = limits.min_velocity
        self._fe_level = limits.warning_level
        self._max_velocity = limits.max_velocity
        self._tolerance = limits.tolerance_s
        self._min_dwell = limits.dwell_s
        self._window = limits.window
        self._threshold = limits.standstill_velocity
        self._standstill_dwell = limits.standstill_dwell_s
        self._fastest = inf
        self.standstill = False
        """The axis stands: slower than the threshold for the dwell time (`StatusWord.X7`)."""
        self._standstill_time = 0.0
        self._watching = False
        self._positioned = False
        self._entered = False
        self._waited = 0.0
        self._dwell = 0.0

    def begin(self, modulo: Modulo, farthest: float) -> None:
        """Begin as at the start of the axis.

        Args:
            modulo: Range of the axis: none passes it within a cycle.
            farthest: Largest position whose steps can all be distinguished, position unit.

        """
        self._farthest = farthest
        self._fastest = modulo.length / self._servo.cycle_s * _OVERSHOOT if modulo.enabled else inf
        self.standstill = self._watching = self._positioned = self._entered = False
        self._standstill_time = self._waited = self._dwell = 0.0

    # -- positioning
    # ------------------------------------------------------------------------------------------

    def start_positioning(self) -> None:
        """The setpoint has reached its end: tolerance time starts (MON-016)."""
        self._watching = True
        self._positioned = False
        self._entered = False
        self._waited = 0.0
        self._dwell = 0.0
        self._watch(first=True)

    def positioned(self) -> bool:
        """Return whether the actual position has stayed in the window for the dwell time."""
        return self._positioned

    def cancel(self) -> None:
        """End the supervision without a result (MON-027)."""
        self._watching = False

    def _watch(self, *, first: bool = False) -> None:
        if self._torque.relaxes_monitoring:
            # The setpoint may be far away for good: the motion has ended when the axis stands (STP-148,
            # MC-560).
            if self.standstill:
                self._watching = False
                self._positioned = True
            return
        servo = self._servo
        inside = abs(servo.feedback.position - servo.total.s) <= self._window.value
        if inside:
            if self._entered:
                self._dwell += self._cycle
            self._entered = True
            if self._dwell >= self._min_dwell.value - 1e-9:
                self._watching = False
                self._positioned = True
        elif self._entered:
            self._watching = False
            self._report.not_positioned(left=True)
        else:
            if not first:
                self._waited += self._cycle
            if self._waited >= self._tolerance.value - 1e-9:
                self._watching = False
                self._report.not_positioned(left=False)

    def _leave_range(self, *, controlled: bool) -> None:
        """Stop a motion that continues outwards; a value beyond the rounding of the last step
        switches the axis off (LIM-103).

        Motion back is possible after the acknowledgement.
        """
        servo = self._servo
        position = servo.feedback.position
        if abs(position) > self._farthest * _RANGE_END:
            self._report.end_of_range(positive=position > 0.0, exceeded=True)
        elif controlled and servo.total.v * position > 0.0:
            self._report.end_of_range(positive=position > 0.0, exceeded=False)

    # -- cycle
    # ------------------------------------------------------------------------------------------------

    def permitted_following_error(self, velocity: float) -> float:
        """Return the permitted following error at velocity setpoint `velocity` (MON-038)."""
        low = self._fe_min_velocity.value
        speed = abs(velocity)
        if speed <= low:
            return self._fe_min.value
        top = self._max_velocity.value
        if speed >= top:
            return self._fe_max.value
        return float(
            self._fe_min.value + (self._fe_max.value - self._fe_min.value) * (speed - low) / (top - low)
        )

    def step(self, *, controlled: bool) -> None:
        """Run the monitoring of one cycle; `controlled`: position control is closed."""
        servo = self._servo
        feedback = servo.feedback
        farthest = self._farthest
        if not -farthest <= feedback.position <= farthest:
            self._leave_range(controlled=controlled)
        speed = abs(feedback.velocity)
        if speed > self._fastest:
            self._report.implausible_velocity()
        threshold = self._threshold.value
        if self.standstill:
            if speed > threshold * _RELEASE_FACTOR:
                self.standstill = False
                self._standstill_time = 0.0
        elif (
            speed < threshold or speed == 0.0
        ):  # with a threshold of 0 an axis that does not move stands, too
            self._standstill_time += self._cycle
            if self._standstill_time >= self._standstill_dwell.value - 1e-9:
                self.standstill = True
        else:
            self._standstill_time = 0.0
        if not controlled:
            self._watching = False
            return
        if self._enable_fe.value and not self._torque.relaxes_monitoring:
            self._watch_following_error()
        if self._watching and servo.controlled:
            self._watch()

    def _watch_following_error(self) -> None:
        """Compare the following error with what is permitted at this velocity
        setpoint (MON-040 to MON-042).
        """
        servo = self._servo
        error = abs(servo.controller.following_error)
        low, high = self._fe_min.value, self._fe_max.value
        level = self._fe_level.value * 0.01
        if not error or error < min(low, high) * level:
            return
        permitted = self.permitted_following_error(servo.total.v)
        if error > permitted:
            self._report.following_error()
        elif error >= permitted * level:
            self._report.following_error_near()
