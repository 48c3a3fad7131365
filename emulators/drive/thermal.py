"""Heat of a drive: overload by i2t, and temperatures of motor and power stage.

Loads are given as the mean of (torque / rated torque)^2 over the step, because copper losses go with the
square of the current.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from fieldbus.errors import ConfigurationError


@dataclass(frozen=True, slots=True, kw_only=True)
class ThermalConfig:
    """Thermal behaviour of motor and power stage.

    Args:
        ambient_C: Temperature around the drive, degrees Celsius.
        motor_rise_K: Steady rise of the motor above ambient at rated torque, K.
        motor_time_constant_s: s.
        motor_warning_C: Warning from here on.
        motor_fault_C: Fault 4310h from here on.
        motor_loss_W: Copper losses at rated torque, W; they come out of the DC link.
        stage_rise_K: Steady rise of the power stage above ambient at rated torque, K.
        stage_time_constant_s: s.
        stage_warning_C: Warning from here on.
        stage_fault_C: Fault 4210h from here on.
        stage_overload: Torque that the power stage bears for ever, as a multiple of the motor's rated torque.
        stage_overload_time_s: Time constant of the i2t of the power stage, s.
        overload: What i2t does at its end: `fault` (motor 2310h, power stage 2350h), or `limit` the
            torque to what is borne for ever.

    Raises:
        ConfigurationError: A value is not positive, or a fault threshold is not above its warning.

    """

    ambient_C: float = 25.0
    motor_rise_K: float = 80.0
    motor_time_constant_s: float = 600.0
    motor_warning_C: float = 120.0
    motor_fault_C: float = 140.0
    motor_loss_W: float = 60.0
    stage_rise_K: float = 35.0
    stage_time_constant_s: float = 120.0
    stage_warning_C: float = 85.0
    stage_fault_C: float = 95.0
    stage_overload: float = 2.0
    stage_overload_time_s: float = 20.0
    overload: Literal["fault", "limit"] = "fault"

    def __post_init__(self) -> None:
        for name in (
            "motor_rise_K",
            "motor_time_constant_s",
            "stage_rise_K",
            "stage_time_constant_s",
            "stage_overload",
            "stage_overload_time_s",
        ):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ConfigurationError(name, getattr(self, name), "a finite number > 0")
        if not 0.0 <= self.motor_loss_W < math.inf:
            raise ConfigurationError("motor_loss_W", self.motor_loss_W, "a finite number >= 0")
        for part in ("motor", "stage"):
            warning, fault = getattr(self, f"{part}_warning_C"), getattr(self, f"{part}_fault_C")
            if not self.ambient_C < warning < fault < math.inf:
                raise ConfigurationError(
                    f"{part} temperatures", (self.ambient_C, warning, fault), "ambient < warning < fault"
                )
        if self.overload not in ("fault", "limit"):
            raise ConfigurationError("overload", self.overload, "fault, limit")


class ThermalModel:
    """First-order i2t model of the motor: utilisation 1 is what rated torque leads to in the long run.

    Args:
        rated_torque_Nm: Torque that the motor bears for ever, Nm, > 0.
        time_constant_s: Thermal time constant, s, > 0.
        trip: Utilisation at which the protection trips, > 1 lets rated torque run for ever.

    """

    __slots__ = ("_decay", "_dt_s", "_inverse_rated", "_rate", "trip", "utilisation")

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
        """Advance by `dt_s` with the mean of the squared torque, Nm^2; returns whether the protection
        trips.
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
        """Whether the utilisation is back at what is borne for ever."""
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

    __slots__ = (
        "_decay", "_dt_s", "_rate", "ambient_C", "fault_C", "forced_C", "rise_K", "rise_now_K", "warning_C",
    )  # fmt: skip

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
