"""Absolute single-turn encoder whose turns are counted by its electronics."""

from __future__ import annotations

from typing import TYPE_CHECKING

from emulators.encoder._encoder import RotaryEncoder

if TYPE_CHECKING:
    import numpy as np


class TurnCountingEncoder(RotaryEncoder):
    """Knows its angle within the turn at once, and its turn as long as nobody turns the shaft without supply.

    The count survives without supply. What happens to the shaft meanwhile is seen only within half a turn: at
    power-on the angle is taken as the nearest one to the last value that was counted.

    Args:
        mounting_offset: Value of the encoder where the shaft is at zero, increments.
        counts_per_revolution: As `RotaryEncoder`.
        rng: As `RotaryEncoder`.

    """

    def __init__(
        self,
        *,
        mounting_offset: int = 0,
        counts_per_revolution: int = 8192,
        rng: np.random.Generator | None = None,
    ) -> None:
        super().__init__(counts_per_revolution=counts_per_revolution, rng=rng)
        self._mounting = int(mounting_offset)
        self._counted: int | None = None
        self._supplied = False
        self._set_offset(self._mounting)

    def power_on(self, shaft_angle: float) -> None:
        """Start up at the shaft angle (rad) with the turn that was counted last; a
        restart under supply loses nothing.
        """
        if self._supplied:
            self._counted = self.increments
        self._supplied = True
        super().power_on(shaft_angle)

    def power_off(self) -> None:
        """Keep the last count."""
        self._counted = self.increments
        self._supplied = False

    def _initial_offset(self, raw_increments: int) -> int:
        counts = self._counts
        within = (raw_increments + self._mounting) % counts
        if self._counted is None:
            return within - raw_increments
        half = counts // 2
        value = self._counted + (within - self._counted + half) % counts - half
        return value - raw_increments
