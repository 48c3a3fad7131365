"""How an encoder is coupled to what it measures: transmission, direction, place of its zero, play."""

from __future__ import annotations

import math
from collections.abc import Callable

from fieldbus.errors import ConfigurationError


class Mounting:
    """Turns the coordinate of a shaft or slide into that of the encoder.

    The encoder's coordinate is `ratio` times that of the machine, plus `offset`; with play, the coupling is
    moved only after the machine has gone through it, as through a worn key.

    Args:
        source: Returns the present coordinate of the machine, rad or m.
        ratio: Encoder coordinate per machine coordinate; negative = mounted the other way round; not 0.
        offset: Encoder coordinate where the machine is at zero, rad or m of the encoder.
        backlash: Play of the coupling, encoder coordinate, >= 0.

    Raises:
        ConfigurationError: A value is outside its range.

    """

    def __init__(
        self,
        source: Callable[[], float],
        *,
        ratio: float = 1.0,
        offset: float = 0.0,
        backlash: float = 0.0,
    ) -> None:
        if not math.isfinite(ratio) or ratio == 0.0:
            raise ConfigurationError("mounting ratio", ratio, "a finite number, not 0")
        if not math.isfinite(offset):
            raise ConfigurationError("mounting offset", offset, "a finite number")
        if not (math.isfinite(backlash) and backlash >= 0.0):
            raise ConfigurationError("mounting backlash", backlash, "a finite number >= 0")
        self._source = source
        self._ratio = ratio
        self._offset = offset
        self._backlash = 0.5 * backlash
        self._coupled = source() * ratio + offset

    def at(self, machine: float) -> float:
        """Return where the encoder is while the machine is at a coordinate, with the play as it is now."""
        there = machine * self._ratio + self._offset
        play = self._backlash
        return min(max(self._coupled, there - play), there + play) if play else there

    def coordinate(self) -> float:
        """Return where the encoder is now, rad or m; play is followed from call to call."""
        there = self._source() * self._ratio + self._offset
        play = self._backlash
        if play:
            if there - self._coupled > play:
                self._coupled = there - play
            elif self._coupled - there > play:
                self._coupled = there + play
            return self._coupled
        return there
