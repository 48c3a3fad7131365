"""The start interlock that a user program puts before `MC_Power.Enable` (§5.5, STP-024)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from motion.s7.axis import TechnologyAxis
    from motion.s7.instructions import MC_Power

_VALID: Final = 2
_TRANSFERRED: Final = (2, 3)
"""`AdaptionState` ADAPTED, and NOT_APPLICABLE where no transfer is selected (STP-023)."""


class StartInterlock:
    """Keeps `Enable` FALSE while the drive or the operative encoder is not ready; called once per cycle.

    `Enable := request AND StatusDrive.CommunicationOK AND
    StatusSensor[n].CommunicationOK AND StatusSensor[n].State = 2`, and, where a transfer
    of parameters is selected, `AND AdaptionState = 2` of both.

    Args:
        axis: The axis.
        power: Its `MC_Power` instance.

    """

    def __init__(self, axis: TechnologyAxis, power: MC_Power) -> None:
        self._axis = axis
        self._power = power
        self.request = False
        """The wish to enable; the interlock does nothing while it is FALSE."""

    def __call__(self) -> None:
        """Evaluate the interlock."""
        if self.request:
            self._power.Enable = self.ready

    @property
    def ready(self) -> bool:
        """Whether the axis can be enabled without alarm 106 or 108."""
        axis = self._axis
        read = axis.var
        if not read("StatusDrive.CommunicationOK") or read("StatusDrive.AdaptionState") not in _TRANSFERRED:
            return False
        if not axis.has_position:
            return True
        sensor = f"StatusSensor[{axis.operative_sensor}]"
        return bool(
            read(f"{sensor}.CommunicationOK")
            and read(f"{sensor}.State") == _VALID
            and read(f"{sensor}.AdaptionState") in _TRANSFERRED
        )
