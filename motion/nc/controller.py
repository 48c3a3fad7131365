"""The controller component: position control laws with feedforward (section 16 of the specification)."""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motion.nc.parameters import ParameterSet

P: Final = 0
TWO_P: Final = 1
PID: Final = 2
TORQUE_PID: Final = 3
TORQUE_OBSERVER: Final = 4
TWO_SPEED: Final = 5
STEPPER: Final = 6
IN_DRIVE: Final = 7
_PLAIN: Final = frozenset((P, TWO_SPEED, STEPPER, IN_DRIVE))
"""Without acceleration feedforward and dead band."""
_PROPORTIONAL: Final = frozenset((P, TORQUE_PID, TORQUE_OBSERVER))
"""Index of the texts of `ctrl.type`."""
_OFFSET_FEEDFORWARD: Final = 0.01
"""Share of full scale above which the automatic offset stands still (NC-560)."""


class OffsetMode(Enum):
    """What the automatic offset does when Auto Offset is switched off, or has to rest (NC-562)."""

    OFF = "off"
    """It is 0 at once; the output may step."""
    FADE_OUT = "fade-out"
    """It goes to zero on its own curve, which leaves no step in the output."""
    HOLD = "hold"
    """It stays as it is, for example while the power stage is off."""


class Controller:
    """Position controller of an axis whose loop is closed in the NC.

    Args:
        parameters: Parameters of the axis.
        cycle_s: Cycle of the axis, s.
        analog: The drive has an analog interface, which the automatic offset serves (NC-564).

    """

    def __init__(self, parameters: ParameterSet, *, cycle_s: float, analog: bool = False) -> None:
        cell = parameters.cell
        self._parameters = parameters
        self._cycle_s = cycle_s
        self._analog = analog
        self._type = cell("ctrl.type")
        self._kv = cell("ctrl.pos_kv")
        self._kv_standstill = cell("ctrl.pos_kv_standstill")
        self._kv_moving = cell("ctrl.pos_kv_moving")
        self._threshold = cell("ctrl.pos_vdyn")
        self._dead_band = cell("ctrl.pos_dead_band")
        self._tn = cell("ctrl.pos_ti_tn")
        self._tv = cell("ctrl.pos_tv")
        self._td = cell("ctrl.pos_td")
        self._i_limit = cell("ctrl.pos_i_limit")
        self._d_limit = cell("ctrl.pos_d_limit")
        self._i_rests = cell("ctrl.pos_i_disable_moving")
        self._ka = cell("ctrl.ka")
        self._weight = cell("ctrl.velocity_precontrol_weight")
        self._output_limit = cell("ctrl.output_limit")
        self._reference = cell("axis.reference_velocity")
        self._ratio = cell("drv.output_ratio")
        self._auto_offset = cell("ctrl.auto_offset")
        self._offset_time = cell("ctrl.offset_timer")
        self._offset_limit = cell("ctrl.offset_limit")
        self._integral = 0.0
        self._derivative = 0.0
        self._last_error = 0.0
        self.offset = 0.0
        """Automatic offset, position unit/s (NC-558)."""
        self.offset_mode = OffsetMode.FADE_OUT
        """What the automatic offset does while it is not adjusted."""
        self.feedforward = 0.0
        """Velocity and acceleration feedforward of the last step, position unit/s."""
        # What `step` needs of the parameters, as of their last change.
        self._taken = -1
        self._simple = False
        """A gain and the velocity feedforward are all."""
        self._gain = self._share = 0.0

    def _take_parameters(self) -> None:
        """Take over what has changed of the parameters."""
        self._taken = self._parameters.changes
        self._gain, self._share = self._kv.value, self._weight.value
        self._simple = int(self._type.value) == P and not self._auto_offset.value

    def reset(self) -> None:
        """Forget what has been integrated."""
        self._integral = self._derivative = self._last_error = 0.0

    def step(self, velocity: float, acceleration: float, error: float, *, has_job: bool) -> float:
        """Control the position.

        Args:
            velocity: Set velocity, position unit/s.
            acceleration: Set acceleration, position unit/s2.
            error: Following error, set minus actual position, position unit.
            has_job: A command is active (NC-532).

        Returns:
            Controller output without feedforward, position unit/s.

        """
        if self._taken != self._parameters.changes:
            self._take_parameters()
        if self._simple and not self.offset:
            self.feedforward = self._share * velocity
            return self._gain * error
        kind = int(self._type.value)
        feedforward = self._weight.value * velocity
        full = self._reference.value / self._ratio.value
        if kind not in _PLAIN:
            feedforward += self._ka.value * acceleration
            band = self._dead_band.value
            if -band <= error <= band:
                error = 0.0
        if kind == TWO_P:
            output = self._two_gains(velocity) * error
        elif kind == PID:
            output = self._pid(error, full, has_job=has_job)
        elif kind in _PROPORTIONAL:
            output = self._kv.value * error
        else:
            output = 0.0
        if kind <= TWO_P and (self._auto_offset.value or self.offset):
            feedforward += self._offset(output, velocity, full)
        self.feedforward = feedforward
        return output

    def _two_gains(self, velocity: float) -> float:
        share, threshold = abs(velocity / self._reference.value), self._threshold.value
        moving = self._kv_moving.value
        if share >= threshold:
            return moving
        standstill = self._kv_standstill.value
        return standstill + (moving - standstill) * share / threshold

    def _pid(self, error: float, full: float, *, has_job: bool) -> float:
        kv, dt = self._kv.value, self._cycle_s
        limit = self._d_limit.value * full
        tv, td = self._tv.value, self._td.value
        derivative = 0.0
        if tv > 0.0:
            # D-T1 by the backward difference: without damping it is the quotient of differences (NC-531).
            step = error - self._last_error
            derivative = (td * self._derivative + kv * tv * step) / (td + dt)
        self._derivative = derivative
        self._last_error = error
        shown = limit if derivative > limit else max(derivative, -limit)
        proportional = kv * error
        tn = self._tn.value
        if tn <= 0.0:
            self._integral = 0.0
        elif not (has_job and self._i_rests.value):
            most = self._i_limit.value * full
            bound = self._output_limit.value * full
            total = proportional + self._integral + shown
            # The integral part stands still while the output is at its limit and it would drive it further.
            if not (abs(total) >= bound and total * error > 0.0):
                integral = self._integral + kv * error * dt / tn
                self._integral = most if integral > most else max(integral, -most)
        return proportional + self._integral + shown

    def _offset(self, output: float, velocity: float, full: float) -> float:
        if not self._analog:
            return 0.0
        if self.offset_mode is OffsetMode.HOLD:
            return self.offset
        if not self._auto_offset.value:
            if self.offset_mode is OffsetMode.OFF:
                self.offset = 0.0
            self.offset -= self.offset * self._cycle_s / (self._cycle_s + self._offset_time.value)
        elif abs(self._weight.value * velocity) <= _OFFSET_FEEDFORWARD * full:
            limit = self._offset_limit.value * full
            offset = self.offset + output * self._cycle_s / self._offset_time.value
            self.offset = limit if offset > limit else max(offset, -limit)
        return self.offset
