"""What a test can do to an encoder with a node of its own: to its clock, and to its shaft if it sits on none
of a drive.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from fieldbus.errors import UnsupportedFaultError
from fieldbus.node_clock import OwnClock

if TYPE_CHECKING:
    from emulators.mechanics import DrivenShaft
    from fieldbus.clock import Scheduler


class OwnShaft(OwnClock):
    """Doors to the encoder's own shaft or slide. The owner has the attributes named here."""

    __slots__ = ()

    if TYPE_CHECKING:
        name: str
        shaft: DrivenShaft | None
        _scheduler: Scheduler

    @property
    def scheduler(self) -> Scheduler:  # type: ignore[override]  # the base reads it only
        """Time of the encoder."""
        return self._scheduler

    def turn_shaft(self, speed: float, ramp_s: float = 0.0) -> None:
        """Turn the encoder's own shaft, rad/s (m/s linear), reached linearly within `ramp_s`.

        Raises:
            UnsupportedFaultError: The encoder sits on the machine of a drive.

        """
        self._own_shaft().turn(speed, ramp_s=ramp_s)

    def place_shaft(self, position: float) -> None:
        """Put the encoder's own shaft at rest at `position`, rad or m.

        Raises:
            UnsupportedFaultError: The encoder sits on the machine of a drive.

        """
        self._own_shaft().place(position)

    def _own_shaft(self) -> DrivenShaft:
        if self.shaft is None:
            raise UnsupportedFaultError(f"{self.name} has no shaft of its own")
        return self.shaft
