"""Position switches on the travel: limit switches, home switch, cams."""

from __future__ import annotations

import math
from collections.abc import Callable

from fieldbus.errors import ConfigurationError


class SwitchModel:
    """A switch that is actuated while the load stands inside a range of positions.

    Args:
        low: Lower end of the actuated range, load unit (m or rad); -inf: actuated for everything below `high`.
        high: Upper end of the actuated range, load unit; +inf: actuated for everything above `low`.
        hysteresis: The load has to leave the range by this much before the switch falls back, load unit, >= 0.
        inverted: Polarity of the signal: True reports the opposite of the actuation, as a switch wired the
            wrong way does.

    Raises:
        ConfigurationError: The range is empty or unbounded on both sides, or the hysteresis is negative.

    """

    __slots__ = ("_actuated", "_forced", "_inverted", "high", "hysteresis", "low", "on_change", "state")

    def __init__(
        self,
        *,
        low: float = -math.inf,
        high: float = math.inf,
        hysteresis: float = 0.0,
        inverted: bool = False,
    ) -> None:
        if not low < high:
            raise ConfigurationError("switch range", (low, high), "low < high")
        if math.isinf(low) and math.isinf(high):
            raise ConfigurationError("switch range", (low, high), "at least one finite end")
        if not (math.isfinite(hysteresis) and hysteresis >= 0.0):
            raise ConfigurationError("switch hysteresis", hysteresis, "a finite number >= 0")
        self.low = low
        self.high = high
        self.hysteresis = hysteresis
        self._inverted = inverted
        self._forced: bool | None = None
        self._actuated = False
        self.state = inverted
        """Signal of the switch as the drive's input sees it: True = active."""
        self.on_change: Callable[[], None] | None = None
        """Called after every change of `state`."""

    @classmethod
    def above(cls, position: float, *, hysteresis: float = 0.0, inverted: bool = False) -> SwitchModel:
        """Return a switch that is actuated at and above `position` (load unit)."""
        return cls(low=position, hysteresis=hysteresis, inverted=inverted)

    @classmethod
    def below(cls, position: float, *, hysteresis: float = 0.0, inverted: bool = False) -> SwitchModel:
        """Return a switch that is actuated at and below `position` (load unit)."""
        return cls(high=position, hysteresis=hysteresis, inverted=inverted)

    @property
    def actuated(self) -> bool:
        """Whether the load operates the switch, whatever signal comes out of it."""
        return self._actuated

    @property
    def forced(self) -> bool | None:
        """Signal imposed from outside (stuck switch, broken wire); None = the switch works."""
        return self._forced

    @forced.setter
    def forced(self, value: bool | None) -> None:
        self._forced = value
        self._settle()

    @property
    def inverted(self) -> bool:
        """Polarity: True reports the opposite of the actuation."""
        return self._inverted

    @inverted.setter
    def inverted(self, value: bool) -> None:
        self._inverted = value
        self._settle()

    def update(self, position: float) -> None:
        """Evaluate the switch at `position` (load unit)."""
        if self._actuated:
            hysteresis = self.hysteresis
            actuated = self.low - hysteresis <= position <= self.high + hysteresis
        else:
            actuated = self.low <= position <= self.high
        if actuated is not self._actuated:
            self._actuated = actuated
            self._settle()

    def quiet_range(self, position: float) -> tuple[float, float]:
        """Return the largest open interval around `position` in which the switch keeps its actuation."""
        if self._actuated:
            return self.low - self.hysteresis, self.high + self.hysteresis
        if position < self.low:
            return -math.inf, self.low
        return self.high, math.inf

    def _settle(self) -> None:
        state = self._actuated is not self._inverted if self._forced is None else self._forced
        if state is not self.state:
            self.state = state
            if self.on_change is not None:
                self.on_change()
