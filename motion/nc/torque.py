"""Velocity control in the NC for drives that take a torque: velocity PID, and PI with an observer (section
16.4).

`SetTorque` is in percent of the rated torque; full output is 100.
"""

from __future__ import annotations

from math import pi
from typing import TYPE_CHECKING, Final

from motion.nc.controller import TORQUE_OBSERVER
from motion.nc.drive import FULL_TORQUE

if TYPE_CHECKING:
    from motion.nc.parameters import ParameterSet

_KG_CM2: Final = 1e-4
_LUENBERGER: Final = 1


class Observer:
    """Luenberger observer of position and velocity, second order with a double pole (NC-548).

    It works in the units of the axis: the angle of the motor is its position times `motor_rad`.

    Args:
        parameters: Parameters of the axis.
        cycle_s: Cycle of the axis, s.

    """

    def __init__(self, parameters: ParameterSet, *, cycle_s: float) -> None:
        cell = parameters.cell
        self._cycle_s = cycle_s
        self._kt = cell("ctrl.obs_kt")
        self._jm = cell("ctrl.obs_jm")
        self._f0 = cell("ctrl.obs_f0")
        self._kc = cell("ctrl.obs_kc")
        self._filter_time = cell("ctrl.obs_filter_t")
        self.motor_rad = 2.0 * pi
        """Angle of the motor for one position unit, rad; default: one revolution."""
        self.position = 0.0
        """Estimated position, position unit."""
        self.estimate = 0.0
        """Estimated velocity before the filter, position unit/s."""
        self.velocity = 0.0
        """Estimated velocity, filtered, position unit/s."""

    def reset(self, position: float, velocity: float) -> None:
        """Begin at a state."""
        self.position = position
        self.estimate = self.velocity = velocity

    @property
    def gain(self) -> float:
        """Acceleration of the model for one ampere, position unit/s2."""
        return self._kt.value / (self._jm.value * _KG_CM2) / self.motor_rad

    def step(self, measured: float, current: float) -> float:
        """Go on by a cycle; returns the estimated velocity.

        Args:
            measured: Actual position, position unit.
            current: Actual current, A.

        """
        dt = self._cycle_s
        # The predicted state is corrected with what the measurement says; the poles of the discrete error
        # are both exp(-2 pi f0 T).
        pole = 1.0 / (1.0 + 2.0 * pi * self._f0.value * dt)
        position = self.position + self.estimate * dt
        estimate = self.estimate + self.gain * current * dt
        error = self._kc.value * (measured - position)
        self.position = position + (1.0 - pole * pole) * error
        self.estimate = estimate + (1.0 - pole) * (1.0 - pole) / dt * error
        share = dt / (dt + self._filter_time.value)
        self.velocity += share * (self.estimate - self.velocity)
        return self.velocity


class VelocityController:
    """Velocity controller of the torque types; its output is `SetTorque`.

    Args:
        parameters: Parameters of the axis.
        cycle_s: Cycle of the axis, s.

    """

    def __init__(self, parameters: ParameterSet, *, cycle_s: float) -> None:
        cell = parameters.cell
        self._cycle_s = cycle_s
        self._type = cell("ctrl.type")
        self._kv = cell("ctrl.velo_kv")
        self._tn = cell("ctrl.velo_tn")
        self._tv = cell("ctrl.velo_tv")
        self._td = cell("ctrl.velo_td")
        self._i_limit = cell("ctrl.velo_i_limit")
        self._d_limit = cell("ctrl.velo_d_limit")
        self._mode = cell("ctrl.obs_mode")
        self.observer = Observer(parameters, cycle_s=cycle_s)
        self._integral = 0.0
        self._derivative = 0.0
        self._last = 0.0
        self.velocity = 0.0
        """Velocity that the loop uses: observed or differentiated, position unit/s."""

    @property
    def observing(self) -> bool:
        """Whether the velocity comes from the observer (NC-541, NC-547)."""
        return int(self._type.value) == TORQUE_OBSERVER and int(self._mode.value) == _LUENBERGER

    def reset(self, position: float, velocity: float) -> None:
        """Forget what has been integrated, and begin at a state."""
        self._integral = self._derivative = self._last = 0.0
        self.observer.reset(position, velocity)

    def step(self, wanted: float, velocity: float, position: float, current: float) -> float:
        """Control the velocity.

        Args:
            wanted: Velocity that position control and feedforward want, position unit/s.
            velocity: Derivative of the actual position, position unit/s.
            position: Actual position, position unit.
            current: Actual current, A.

        Returns:
            `SetTorque`, percent of the rated torque, not limited.

        """
        self.velocity = velocity = self.observer.step(position, current) if self.observing else velocity
        error = wanted - velocity
        kv, dt = self._kv.value, self._cycle_s
        tn = self._tn.value
        if tn <= 0.0:
            self._integral = 0.0
        else:
            limit = self._i_limit.value * FULL_TORQUE
            integral = self._integral + kv * error * dt / tn
            self._integral = limit if integral > limit else max(integral, -limit)
        derivative = 0.0
        if int(self._type.value) != TORQUE_OBSERVER and self._tv.value > 0.0:
            td = self._td.value
            derivative = (td * self._derivative + kv * self._tv.value * (error - self._last)) / (td + dt)
        self._derivative, self._last = derivative, error
        limit = self._d_limit.value * FULL_TORQUE
        derivative = limit if derivative > limit else max(derivative, -limit)
        return kv * error + self._integral + derivative
