"""Position switches on the travel: limit switches, home switch, cams."""

from __future__ import annotations

import math
from collections.abc import Callable

from fieldbus.errors import ConfigurationError


class SwitchModel:
    """A switch that is actuated while the load stands inside a range of positions.

    A load that passes the whole range within one step operates the switch all the same: both edges come, one
    after the other. While `on_change` is called, `edge` says where the load has made the edge.

    Args:
        low: Lower end of the actuated range, load unit (m or rad); -inf:
            actuated for everything below `high`.
        high: Upper end of the actuated range, load unit; +inf: actuated for everything above `low`.
        hysteresis: The load has to leave the range by this much before the switch falls back, load unit,
            >= 0.
        inverted: Polarity of the signal: True reports the opposite of the actuation, as a switch wired the
            wrong way does.

    Raises:
        ConfigurationError: The range is empty or unbounded on both sides, or the hysteresis is negative.

    """

    def __init__(
        self,
        *,
        low: float = -math.inf,
        high: float = math.inf,
        hysteresis: float = 0.0,
        inverted: bool = False,
    ) -> None:
        if not low < high and not (low == high == math.inf):
            raise ConfigurationError("switch range", (low, high), "low < high")
        if low == -math.inf and high == math.inf:
            raise ConfigurationError("switch range", (low, high), "at least one finite end")
        if not (math.isfinite(hysteresis) and hysteresis >= 0.0):
            raise ConfigurationError("switch hysteresis", hysteresis, "a finite number >= 0")
        self.low = low
        self.high = high
        self.hysteresis = hysteresis
        self.normally_closed = inverted
        """How the contact is made, whatever is done to its polarity later."""
        self._inverted = inverted
        self._forced: bool | None = None
        self._actuated = False
        self._above = False
        self.edge: float | None = None
        """Place of the edge that `on_change` reports, load unit; None: the load had no part in it."""
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

    @classmethod
    def unreached(cls) -> SwitchModel:
        """Return a switch that the load never operates, only `forced` does: a probe, a hand."""
        return cls(low=math.inf, high=math.inf)

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

    def update(self, position: float, *, moving: bool = False) -> None:
        """Evaluate the switch at `position` (load unit); `moving`: the load has come there by itself."""
        low, high = self.low, self.high
        above = position > high
        if not self._actuated:
            passed = moving and above is not self._above
            if not (passed or low <= position <= high):
                self._above = above
                return
            came_from_above = self._above
            self._set_actuated(True, (high if came_from_above else low) if moving else None)
        hysteresis = self.hysteresis
        if not low - hysteresis <= position <= high + hysteresis:
            self._above = above
            self._set_actuated(False, (high + hysteresis if above else low - hysteresis) if moving else None)

    def quiet_range(self, position: float) -> tuple[float, float]:
        """Return the largest open interval around `position` in which the switch keeps its actuation."""
        if self._actuated:
            return self.low - self.hysteresis, self.high + self.hysteresis
        if position < self.low:
            return -math.inf, self.low
        return self.high, math.inf

    def _set_actuated(self, actuated: bool, edge: float | None) -> None:
        self._actuated = actuated
        self.edge = edge
        self._settle()
        self.edge = None

    def _settle(self) -> None:
        state = self._actuated is not self._inverted if self._forced is None else self._forced
        if state is not self.state:
            self.state = state
            if self.on_change is not None:
                self.on_change()
