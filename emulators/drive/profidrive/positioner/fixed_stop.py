"""Travel of the basic positioner to a fixed stop (PD-082, PD-091)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from emulators.drive.profidrive.positioner.terms import Mode

if TYPE_CHECKING:
    from emulators.drive.profidrive.positioner.positioner import Positioner


class FixedStop:
    """Lets a task end where the axis is held up.

    Args:
        positioner: The positioner.

    """

    __slots__ = ("_positioner", "active", "reached", "released")

    def __init__(self, positioner: Positioner) -> None:
        self._positioner = positioner
        self.clear()

    def clear(self) -> None:
        """Begin as after power-on."""
        self.active = False
        """The axis travels to a fixed stop: what holds it up is no fault."""
        self.reached = False
        """It has reached it."""
        self.released = False
        """It has been given up in this cycle: the servo has not seen it yet."""

    def take(self, wanted: bool) -> None:
        """Take the request of a bus cycle; when it goes, what the demand was ahead is not made good."""
        axis = self._positioner
        self.released = self.active and not wanted and axis.core.enabled
        if self.released:
            axis.motion.stand(where_it_is=True)
            axis.finish()
        self.active = wanted
        self.reached = self.reached and wanted

    def look(self) -> None:
        """Let the demand stand when the axis has stayed behind at its torque limit: the task is done."""
        axis = self._positioner
        if axis.wanted is None or self.reached or not axis.core.torque_limited:
            return
        if abs(axis.motion.following_error) > axis.settings.fixed_stop_tolerance:
            self.reached = True
            axis.wanted = None
            axis.motion.stand(where_it_is=False)
            axis.target_reached = axis.mode in {Mode.MDI, Mode.BLOCK}
