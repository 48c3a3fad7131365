"""Drive data sets of a PROFIdrive axis: settings by number, chosen by STW2 bits 0 to 4 (PD-082, PD-083)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import fields

from emulators.drive.profidrive.config import DriveSettings


class DataSets:
    """The sets of settings; the active one is in `settings`, and what is written goes there.

    Args:
        settings: Settings in effect, at first those of set 0.
        others: Sets 1 and following.
        on_change: Called when another set has come into force.

    """

    def __init__(
        self,
        settings: DriveSettings,
        others: Iterable[DriveSettings],
        *,
        on_change: Callable[[], None],
    ) -> None:
        self._settings = settings
        self._on_change = on_change
        self._rows = [_values(settings), *map(_values, others)]
        self.active = 0
        """Number of the set in effect."""
        self.wanted = 0
        """Number in STW2."""
        self.changing = False
        """It has changed in this bus cycle."""

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self._rows)

    def restart(self) -> None:
        """Begin as after power-on: with set 0."""
        self.select(0)
        self.changing = False

    def select(self, number: int) -> None:
        """Take a set into force; what the active one has become is kept. A number
        that there is not changes nothing.
        """
        self.wanted = number
        if number == self.active or number >= len(self._rows):
            return
        settings = self._settings
        self._rows[self.active] = _values(settings)
        for name, value in self._rows[number].items():
            setattr(settings, name, value)
        self.active = number
        self.changing = True
        self._on_change()


def _values(settings: DriveSettings) -> dict[str, object]:
    return {field.name: getattr(settings, field.name) for field in fields(settings)}
