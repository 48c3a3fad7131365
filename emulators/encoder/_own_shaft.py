"""The shaft of an encoder that sits on no drive's machine."""

from __future__ import annotations

from emulators.mechanics import DrivenShaft
from fieldbus.errors import UnsupportedFaultError


class OwnShaft:
    """The encoder's own shaft or slide, if it has one.

    Args:
        name: Name of the encoder in messages.
        shaft: The shaft; None: the encoder sits on the machine of a drive.

    """

    def __init__(self, name: str, shaft: DrivenShaft | None) -> None:
        self._name = name
        self.shaft = shaft

    @property
    def position(self) -> float:
        """Place of the shaft, rad (m of a slide).

        Raises:
            UnsupportedFaultError: The encoder sits on the machine of a drive.

        """
        return self._fitted().position

    @property
    def velocity(self) -> float:
        """Speed of the shaft, rad/s (m/s of a slide).

        Raises:
            UnsupportedFaultError: The encoder sits on the machine of a drive.

        """
        return self._fitted().velocity

    def turn(self, speed: float, ramp_s: float = 0.0) -> None:
        """Turn it with a speed, rad/s (m/s linear), reached linearly within `ramp_s`.

        Raises:
            UnsupportedFaultError: The encoder sits on the machine of a drive.

        """
        self._fitted().turn(speed, ramp_s=ramp_s)

    def place(self, position: float) -> None:
        """Put it at rest at a position, rad or m.

        Raises:
            UnsupportedFaultError: The encoder sits on the machine of a drive.

        """
        self._fitted().place(position)

    def _fitted(self) -> DrivenShaft:
        if self.shaft is None:
            raise UnsupportedFaultError(f"{self._name} has no shaft of its own")
        return self.shaft
