"""Ramps that are configured as times: the times stay when a velocity of the configuration changes (STP-098,
STP-109, STP-127).
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import TYPE_CHECKING, Final

from fieldbus.errors import ConfigurationError

if TYPE_CHECKING:
    from motion.s7.variables import VariableStore

_MAXIMUM: Final = "DynamicLimits.MaxVelocity"
_DEFAULT: Final = "DynamicDefaults.Velocity"
RAMPS: Final = {
    "maximum_up_s": (_MAXIMUM, "DynamicLimits.MaxAcceleration"),
    "maximum_down_s": (_MAXIMUM, "DynamicLimits.MaxDeceleration"),
    "default_up_s": (_DEFAULT, "DynamicDefaults.Acceleration"),
    "default_down_s": (_DEFAULT, "DynamicDefaults.Deceleration"),
    "emergency_s": (_MAXIMUM, "DynamicDefaults.EmergencyDeceleration"),
}
"""Velocity that is reached in the time, and the variable that follows from both."""


class RampTimes:
    """Keeps start values of accelerations in step with those of velocities.

    Args:
        store: Variables of the axis.
        times: Times in s by the names of `RAMPS`.
        given: Paths that have start values of their own.

    Raises:
        ConfigurationError: A time does not exist or is not above 0, its variable has a value of its own,
            or that which follows is out of range.

    """

    def __init__(self, store: VariableStore, times: Mapping[str, float], given: Mapping[str, object]) -> None:
        self._store = store
        self._times = dict(times)
        for name, time in self._times.items():
            if name not in RAMPS:
                raise ConfigurationError(f"ramp_times.{name}", time, f"one of {', '.join(RAMPS)}")
            if isinstance(time, bool) or not (isfinite(time) and time > 0.0):
                raise ConfigurationError(f"ramp_times.{name}", time, "a time above 0 s")
            _, path = RAMPS[name]
            if path in given:
                raise ConfigurationError(
                    path, given[path], f"no value together with ramp_times.{name}, from which it follows"
                )
            value = self._value(name)
            if not store.describe(path).permits(value, 0):
                raise ConfigurationError(
                    f"ramp_times.{name}",
                    time,
                    f"a time that gives a {path} of {store.describe(path).allowed(0)}",
                )
            store.preset(path, value)

    def _value(self, name: str) -> float:
        store = self._store
        velocity, path = RAMPS[name]
        reached = store.start_value(velocity) * store.factors.of(store.describe(velocity).unit)
        return float(reached / self._times[name] / store.factors.of(store.describe(path).unit))

    def follow(self, velocity: str) -> None:
        """Take a new start value of the variable `velocity` into the start values that follow from it."""
        for name in self._times:
            source, path = RAMPS[name]
            if source == velocity:
                self._store.write_start(path, self._value(name))
