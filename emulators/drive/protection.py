"""What a drive watches in itself: motor temperature by i2t, DC link, blocked shaft, and windows with a time.

All monitors are advanced by the slow control cycle of the drive, not by the servo step.
"""

from __future__ import annotations

from fieldbus.errors import ConfigurationError


class WindowTimer:
    """A condition that counts only after it has held for a time.

    Args:
        time_s: How long the condition has to hold, s; 0 = at once.

    """

    __slots__ = ("_elapsed", "expired", "time_s")

    def __init__(self, time_s: float = 0.0) -> None:
        self.time_s = time_s
        self._elapsed = 0.0
        self.expired = False
        """Whether the condition has held long enough at the last update."""

    def update(self, condition: bool, dt_s: float) -> bool:
        """Advance by `dt_s` and return whether the condition has held for the time."""
        if not condition:
            self._elapsed = 0.0
            self.expired = False
        elif not self.expired:
            # The time starts with the first update that sees the condition; half a step absorbs rounding.
            self.expired = self._elapsed + 0.5 * dt_s >= self.time_s
            self._elapsed += dt_s
        return self.expired

    def reset(self) -> None:
        """Start again."""
        self._elapsed = 0.0
        self.expired = False


class ThermalModel:
    """First-order i2t model of the motor: utilisation 1 is what rated torque leads to in the long run.

    Args:
        rated_torque_Nm: Torque that the motor bears for ever, Nm, > 0.
        time_constant_s: Thermal time constant, s, > 0.
        trip: Utilisation at which the protection trips, > 1 lets rated torque run for ever.

    """

    __slots__ = ("_inverse_rated", "_rate", "trip", "utilisation")

    def __init__(self, *, rated_torque_Nm: float, time_constant_s: float = 40.0, trip: float = 1.05) -> None:
        if not rated_torque_Nm > 0.0:
            raise ConfigurationError("rated_torque_Nm", rated_torque_Nm, "> 0")
        if not time_constant_s > 0.0:
            raise ConfigurationError("time_constant_s", time_constant_s, "> 0")
        self._inverse_rated = 1.0 / rated_torque_Nm
        self._rate = 1.0 / time_constant_s
        self.trip = trip
        self.utilisation = 0.0
        """Present utilisation, 1 = rated."""

    def update(self, torque_Nm: float, dt_s: float) -> bool:
        """Advance by `dt_s` (much smaller than the time constant); returns whether the protection trips."""
        ratio = torque_Nm * self._inverse_rated
        self.utilisation += (ratio * ratio - self.utilisation) * dt_s * self._rate
        return self.utilisation > self.trip


class DcLink:
    """Voltage of the DC link with its two thresholds; the voltage is an input of the test.

    Args:
        nominal_V: Voltage while all is well, V.
        undervoltage_V: Below this the power stage cannot run, V.
        overvoltage_V: Above this the power stage has to be switched off, V.

    """

    __slots__ = ("nominal_V", "overvoltage_V", "undervoltage_V", "voltage_V")

    def __init__(
        self, *, nominal_V: float = 560.0, undervoltage_V: float = 400.0, overvoltage_V: float = 780.0
    ) -> None:
        if not 0.0 < undervoltage_V < nominal_V < overvoltage_V:
            raise ConfigurationError(
                "DC link",
                (undervoltage_V, nominal_V, overvoltage_V),
                "0 < undervoltage < nominal < overvoltage",
            )
        self.nominal_V = nominal_V
        self.undervoltage_V = undervoltage_V
        self.overvoltage_V = overvoltage_V
        self.voltage_V = nominal_V

    @property
    def low(self) -> bool:
        """Whether there is too little voltage."""
        return self.voltage_V < self.undervoltage_V

    @property
    def high(self) -> bool:
        """Whether there is too much voltage."""
        return self.voltage_V > self.overvoltage_V
