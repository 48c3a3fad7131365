"""Travel of the basic positioner to a fixed stop (PD-082, PD-091)."""

from __future__ import annotations

from emulators.drive.profidrive.positioner.task import Task
from emulators.drive.profidrive.positioner.terms import Mode


class FixedStop:
    """Lets a task end where the axis is held up.

    Args:
        task: Task of the positioner.

    """

    def __init__(self, task: Task) -> None:
        self._task = task
        self.clear()

    def clear(self) -> None:
        """Begin as after power-on."""
        self.active = False
        """The axis travels to a fixed stop: what holds it up is no fault."""
        self._task.stop_reached = False
        self.released = False
        """It has been given up in this cycle: the servo has not seen it yet."""

    def take(self, wanted: bool) -> None:
        """Take the request of a bus cycle; when it goes, what the demand was ahead is not made good."""
        task = self._task
        self.released = self.active and not wanted and task.core.enabled
        if self.released:
            task.motion.stand(where_it_is=True)
            task.finish()
        self.active = wanted
        task.stop_reached = task.stop_reached and wanted

    def look(self) -> None:
        """Let the demand stand when the axis has stayed behind at its torque limit: the task is done."""
        task = self._task
        if task.wanted is None or task.stop_reached or not task.core.torque_limited:
            return
        if abs(task.motion.following_error) > task.settings.fixed_stop_tolerance:
            task.stop_reached = True
            task.wanted = None
            task.motion.stand(where_it_is=False)
            task.target_reached = task.mode in {Mode.MDI, Mode.BLOCK}
