"""Drive data sets of a PROFIdrive axis: settings by number, chosen by STW2 bits 0 to 4 (PD-082, PD-083)."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

from emulators.drive.profidrive.config import DriveSettings

if TYPE_CHECKING:
    from emulators.drive.profidrive.drive import ProfidriveDrive


class DataSets:
    """The sets of settings; the active one is in the drive's `settings`, and what is written goes there.

    Args:
        drive: The drive.

    """

    __slots__ = ("_drive", "_rows", "active", "changing", "wanted")

    def __init__(self, drive: ProfidriveDrive) -> None:
        self._drive = drive
        self._rows = [_values(drive.settings), *map(_values, drive.config.data_sets)]
        self.active = 0
        """Number of the set in force."""
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
        """Take a set into force; what the active one has become is kept. A number that there is not changes
        nothing.
        """
        self.wanted = number
        if number == self.active or number >= len(self._rows):
            return
        settings = self._drive.settings
        self._rows[self.active] = _values(settings)
        for name, value in self._rows[number].items():
            setattr(settings, name, value)
        self.active = number
        self.changing = True
        self._drive.refresh()


def _values(settings: DriveSettings) -> dict[str, object]:
    return {field.name: getattr(settings, field.name) for field in fields(settings)}
