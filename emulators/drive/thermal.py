"""Heat of a drive: overload by i2t, and temperatures of motor and power stage.

Loads are given as the mean of (torque / rated torque)^2 over the step, because copper losses go with the
square of the current.
"""

from __future__ import annotations

import math

from fieldbus.errors import ConfigurationError


class ThermalModel:
    """First-order i2t model of the motor: utilisation 1 is what rated torque leads to in the long run.

    Args:
        rated_torque_Nm: Torque that the motor can supply continuously, Nm, > 0.
        time_constant_s: Thermal time constant, s, > 0.
        trip: Utilisation at which the protection trips, > 1 permits rated torque continuously.

    """

    def __init__(self, *, rated_torque_Nm: float, time_constant_s: float = 40.0, trip: float = 1.05) -> None:
        if not rated_torque_Nm > 0.0:
            raise ConfigurationError("rated_torque_Nm", rated_torque_Nm, "> 0")
        if not time_constant_s > 0.0:
            raise ConfigurationError("time_constant_s", time_constant_s, "> 0")
        self._inverse_rated = 1.0 / rated_torque_Nm
        self._rate = 1.0 / time_constant_s
        self._dt_s = 0.0
        self._decay = 1.0
        self.trip = trip
        self.utilisation = 0.0
        """Present utilisation, 1 = rated."""

    def update(self, torque_Nm: float, dt_s: float) -> bool:
        """Advance by `dt_s` under a constant torque; returns whether the protection trips."""
        return self.advance(torque_Nm * torque_Nm, dt_s)

    def advance(self, mean_square: float, dt_s: float) -> bool:
        """Advance by `dt_s` with the mean of the squared torque, Nm^2;
        returns whether the protection trips.
        """
        load = mean_square * self._inverse_rated * self._inverse_rated
        if dt_s != self._dt_s:
            self._dt_s = dt_s
            self._decay = math.exp(-dt_s * self._rate)
        self.utilisation = load + (self.utilisation - load) * self._decay
        return self.utilisation > self.trip

    @property
    def tripped(self) -> bool:
        """Whether the last update tripped."""
        return self.utilisation > self.trip

    @property
    def near(self) -> bool:
        """Whether the utilisation is within 5 % of the trip."""
        return self.utilisation > 0.95 * self.trip

    @property
    def recovered(self) -> bool:
        """Whether the utilisation is back at the continuous level."""
        return self.utilisation <= 1.0


class ThermalNode:
    """Temperature of a part: first order above ambient.

    Args:
        rise_K: Steady rise at load 1.
        time_constant_s: s.
        ambient_C: Start temperature and surroundings.
        warning_C: Warning from here on; the fault is over below it.
        fault_C: Fault from here on.

    """

    def __init__(
        self, *, rise_K: float, time_constant_s: float, ambient_C: float, warning_C: float, fault_C: float
    ) -> None:
        self.rise_K = rise_K
        self._rate = 1.0 / time_constant_s
        self._dt_s = 0.0
        self._decay = 1.0
        self.ambient_C = ambient_C
        self.warning_C = warning_C
        self.fault_C = fault_C
        self.rise_now_K = 0.0
        """Present rise above ambient, K."""
        self.forced_C: float | None = None
        """What the sensor shows instead of the model; None: the model counts."""

    def advance(self, load: float, dt_s: float) -> None:
        """Advance by `dt_s` with a mean load, 1 = rated."""
        target = load * self.rise_K
        if dt_s != self._dt_s:
            self._dt_s = dt_s
            self._decay = math.exp(-dt_s * self._rate)
        self.rise_now_K = target + (self.rise_now_K - target) * self._decay

    @property
    def temperature_C(self) -> float:
        """Present temperature as the sensor shows it."""
        return self.ambient_C + self.rise_now_K if self.forced_C is None else self.forced_C

    @property
    def warm(self) -> bool:
        """Whether the warning threshold is reached."""
        return self.temperature_C >= self.warning_C

    @property
    def hot(self) -> bool:
        """Whether the fault threshold is reached."""
        return self.temperature_C >= self.fault_C
