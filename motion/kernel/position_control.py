"""Position controller of the axis, in the application cycle (CTL-037 to CTL-044), and
the following error (MON-030).
"""

from __future__ import annotations

from abc import abstractmethod
from collections import deque
from math import copysign, exp
from typing import TYPE_CHECKING, Final

from typing_extensions import override

if TYPE_CHECKING:
    from motion.kernel.cell import Cell
    from motion.kernel.setpoint_filter import DynamicFilter

_WHOLE: Final = 1e-9
"""Share of a quantum by which a difference may fall short of a whole multiple."""


_FADED: Final = 1e-9
"""Rest of a step, axis unit, below which nothing is left."""

LONGEST_DELAY: Final = 16384
"""Servo cycles that a setpoint is kept; an additional delay beyond that acts with these."""
LEAST_GAIN: Final = 1e-12
"""Kv, 1/s, that a gain of 0 counts as where a time is made of it: a program may write 0 (CTL-008)."""


def _cycles(delay: float) -> tuple[int, float]:
    """Return a delay in cycles as whole ones and the rest."""
    whole = int(delay + 1e-9)
    return whole, max(0.0, delay - whole)


class PositionControl:
    """The place of position control in the pipeline: it gets the setpoint of a
    servo cycle and returns a velocity.

    Args:
        dynamic_filter: What the setpoints pass before; None = nothing.

    """

    def __init__(self, dynamic_filter: DynamicFilter | None) -> None:
        self.filter = dynamic_filter
        """The place of the filter in the pipeline."""
        self.balanced_position = 0.0
        """Position setpoint behind filter and balancing filter, position unit."""
        self.control_difference = 0.0
        """Difference that is controlled, position unit."""
        self.following_error = 0.0
        """Following error, position unit."""
        self.gain = 0.0
        """Kv at the last step, 1/s."""
        self.precontrol = 0.0
        """Precontrol velocity of the last step, position unit per second."""
        self.quantum = 0.0
        """Step to whose whole multiples the control difference is rounded towards zero, position
        unit; 0 = it is not (`PositionControl.ControlDifferenceQuantization`, CFG-383). Another
        encoder may have another one (CFG-384).
        """
        self.given = False
        """For the next step: the velocity is not the derivative of the position,
        both come from outside (MIN-022).
        """

    @property
    @abstractmethod
    def precontrolled_lag_s(self) -> float:
        """Share of the drive's time constant that the setpoints take into account, s."""

    @abstractmethod
    def reset(self, position: float, velocity: float = 0.0) -> None:
        """Start from a setpoint that has been moving with `velocity` up to `position`, without a step."""

    @abstractmethod
    def shift(self, offset: float) -> None:
        """Follow a shift of the coordinate system."""

    @abstractmethod
    def absorb(self, step: float) -> None:
        """Let a step of the actual value, from a switch of encoders, reach the output
        with a time constant (CFG-329).
        """

    def tracked(self, actual: float) -> float:
        """Return where the setpoint is while the axis does not form it: at the actual position (CTL-003)."""
        return actual

    @abstractmethod
    def follow(self, position: float) -> None:
        """Track the actual value without control (follow-up mode)."""

    @abstractmethod
    def step(self, position: float, velocity: float, actual: float) -> float:
        """Return the velocity to output for the setpoint (`position`, `velocity`) of this cycle."""


class PositionController(PositionControl):
    """Proportional controller with velocity pre-control and balancing filter.

    `e = delay(x_b, T) - s_act`, `v_out = Kv * e + Kpc / 100 * v_set`; x_b is the position setpoint behind the
    balancing filter, T the transport delay `T_i + T_o + T_DC + T_servo`, a whole number of cycles with a
    linearly interpolated rest (MON-032). A controller in the drive closes the loop around what it has
    measured since, so that for it `e = x_b - s_act` (CTL-030).

    The following error is `delay(s_set, T + T_additional) - s_act`, wherever the
    controller is (MON-030, MON-033).

    Args:
        kv: Cell of `PositionControl.Kv`, 1/s.
        kpc: Cell of `PositionControl.Kpc`, percent.
        time_constant: Cell of `DynamicAxisModel.VelocityTimeConstant`, s.
        additional_delay: Cell of `FollowingError.AdditionalSetpointDelayTime`, s.
        cycle_s: Application cycle, s.
        delay_s: Transport delay from setpoint to actual value, s.
        smoothing: Cell of `PositionControl.SmoothingTimeByChangeDifference`, s; None = a step acts at once.
        dynamic_filter: What the setpoints pass before, None = nothing.
        in_drive: The drive closes the loop (DSC): the control difference is what it gets as XERR.

    """

    def __init__(
        self,
        *,
        kv: Cell[float],
        kpc: Cell[float],
        time_constant: Cell[float],
        additional_delay: Cell[float],
        cycle_s: float,
        delay_s: float,
        smoothing: Cell[float] | None = None,
        dynamic_filter: DynamicFilter | None = None,
        in_drive: bool = False,
    ) -> None:
        super().__init__(dynamic_filter)
        self._kv = kv
        self._kpc = kpc
        self._time_constant = time_constant
        self._additional_delay = additional_delay
        self._smoothing = smoothing
        self._step = self._step_decay = 0.0
        self._cycle = cycle_s
        self._delay_s = delay_s
        self._loop_cycles, self._loop_rest = _cycles(delay_s / cycle_s)
        self._in_drive = in_drive
        self._balanced = 0.0
        self._last_constant = -1.0
        self._decay = 0.0
        depth = self._loop_cycles + 2
        self._balanced_history: deque[float] = deque([0.0] * depth, maxlen=depth)
        self._setpoint_history: deque[float] = deque([0.0] * 2, maxlen=2)
        self._error_additional, self._error_cycles, self._error_rest = -1.0, 0, 0.0
        self._take_delay()

    @override
    def reset(self, position: float, velocity: float = 0.0) -> None:
        lag = velocity * self.precontrolled_lag_s
        behind = 0.0
        if self.filter is not None:
            self.filter.reset(position, velocity)
            behind = velocity * self.filter.delay_s
        self._balanced = position - behind - velocity * self._time_constant.value
        step = velocity * self._cycle
        setpoints, balanced = self._setpoint_history, self._balanced_history
        setpoints.extend([position - step * at for at in range(len(setpoints) - 1, -1, -1)])
        latest = position - behind - lag
        balanced.extend([latest - step * at for at in range(len(balanced) - 1, -1, -1)])
        self.balanced_position = position - behind - lag
        self.control_difference = 0.0
        self.following_error = 0.0

    @property
    @override
    def precontrolled_lag_s(self) -> float:
        lag: float = self._time_constant.value * min(self._kpc.value, 100.0) / 100.0
        return lag

    def _take_delay(self) -> None:
        """Take the additional delay of the following error over; setpoints that are not known any more go
        back in a straight line.
        """
        additional: float = self._additional_delay.value
        self._error_additional = additional
        cycles = min((self._delay_s + additional) / self._cycle, float(LONGEST_DELAY))
        self._error_cycles, self._error_rest = _cycles(cycles)
        known = self._setpoint_history
        missing = self._error_cycles + 2 - len(known)
        if missing > 0:
            step = known[1] - known[0]
            before = [known[0] - step * at for at in range(missing, 0, -1)]
            self._setpoint_history = deque([*before, *known], maxlen=missing + len(known))

    @override
    def absorb(self, step: float) -> None:
        constant = 0.0 if self._smoothing is None else self._smoothing.value
        self._step = step if constant > 0.0 else 0.0
        self._step_decay = exp(-self._cycle / constant) if constant > 0.0 else 0.0

    @override
    def shift(self, offset: float) -> None:
        for history in (self._setpoint_history, self._balanced_history):
            for index in range(len(history)):
                history[index] += offset
        if self.filter is not None:
            self.filter.shift(offset)
        self._balanced += offset
        self.balanced_position += offset

    @override
    def follow(self, position: float) -> None:
        if self.filter is not None:
            self.filter.reset(position)
        self._setpoint_history.append(position)
        self._balanced_history.append(position)
        self._balanced = self.balanced_position = position
        self.control_difference = 0.0
        self.following_error = 0.0

    @override
    def step(self, position: float, velocity: float, actual: float) -> float:
        commanded = position
        if self._additional_delay.value != self._error_additional:
            self._take_delay()
        setpoints = self._setpoint_history
        before = setpoints[-1]
        if self.filter is not None:
            before = self.filter.position
            position, velocity = self.filter.step(position, velocity)
        constant = self._time_constant.value
        kpc: float = self._kpc.value
        if constant != self._last_constant:
            self._last_constant = constant
            self._decay = exp(-self._cycle / constant) if constant > 0.0 else 0.0
        if constant > 0.0:
            # First-order lag with the exact response to a ramp of this cycle, so that constant travel gives
            # no error.
            if self.given:
                self.given = False
                step = position - before
                target = position - step / self._cycle * constant
            else:
                step = velocity * self._cycle
                target = position - velocity * constant
            self._balanced = target + (self._balanced + step - target) * self._decay
            weight = kpc * 0.01 if kpc < 100.0 else 1.0
            balanced = position - weight * (position - self._balanced)
        else:
            self._balanced = balanced = position
        self.balanced_position = balanced
        balanced_history = self._balanced_history
        setpoints.append(commanded)
        balanced_history.append(balanced)
        rest = self._loop_rest
        newest = -1 - self._loop_cycles
        delayed = balanced_history[newest]
        if rest:
            delayed += (balanced_history[newest - 1] - delayed) * rest
        difference = (balanced if self._in_drive else delayed) - actual
        kv: float = self._kv.value
        if kv != self.gain and self._smoothing is not None and self.gain > 0.0 < kv:
            # The output continues as with the former gain, and then over to the new one (CTL-007). What the
            # drive has to correct is without the way of the transport, too.
            self.absorb((self.gain / kv - 1.0) * (delayed - actual) + self._step * self.gain / kv)
        elif self._step:
            self._step *= self._step_decay
            if abs(self._step) < _FADED:
                self._step = 0.0
        if self._step:
            difference += self._step
        quantum = self.quantum
        if quantum:
            # What rounding may have taken from a whole multiple is no step.
            difference = quantum * int(difference / quantum + copysign(_WHOLE, difference))
        self.control_difference = difference
        newest = -1 - self._error_cycles
        rest = self._error_rest
        delayed_setpoint = setpoints[newest]
        if rest:
            delayed_setpoint += (setpoints[newest - 1] - delayed_setpoint) * rest
        # Of the filter's delay only what the user has set counts (MON-037).
        self.following_error = delayed_setpoint - actual
        precontrol = kpc * 0.01 * velocity
        self.gain = kv
        self.precontrol = precontrol
        return kv * difference + precontrol
