"""`MC_Reset` (section 2.2 of the instruction specification)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from typing_extensions import override

from motion.s7.axis.jobs import ERROR_RESTART_ENABLED, ERROR_STATE, NO_ERROR
from motion.s7.axis.state import AxisState
from motion.s7.instructions.base import Instruction

if TYPE_CHECKING:
    from motion.s7.axis.technology_object import Reset


class MC_Reset(Instruction):
    """Acknowledge alarms, or restart the technology object with `Restart`.

    Inputs: `Execute`, `Restart`. Outputs: `Done`, `Busy`, `CommandAborted` (never TRUE), `Error`, `ErrorID`.
    """

    instruction = "MC_Reset"
    object_types = (
        "SpeedAxis",
        "PositioningAxis",
        "ExternalEncoder",
        "Cam",
        "LeadingAxisProxy",
        "MeasuringInput",
    )
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "Restart": False}
    Restart: bool

    def __init__(self, axis: Any, *, name: str | None = None, **inputs: float) -> None:
        self.Done = False
        self.CommandAborted = False
        self._last_execute = False
        self._reset: Reset | None = None
        super().__init__(axis, name=name, **inputs)

    def _call(self) -> None:
        rising = self.execute_level and not self._last_execute
        self._last_execute = bool(self.execute_level)
        if rising:
            self._begin()
        elif self._reset is not None:
            if self._reset.done:
                error_id = self._reset.error_id
                self._reset = None
                if error_id:
                    self._fail(error_id)
                    return
                self.Busy = False
                self.Done = True
                self._log("job.done")
        elif not self.execute_level:
            self.Done = self.Error = False
            self.ErrorID = NO_ERROR

    def _begin(self) -> None:
        axis = self.axis
        self.Done = self.Error = False
        self.ErrorID = NO_ERROR
        if axis.state is AxisState.RESTARTING:
            self._fail(ERROR_STATE)
            return
        refused = self._refused()
        if refused:
            self._fail(refused)
            return
        if self.Restart and axis.restart_refused:
            axis.refuse_restart()
            self._fail(ERROR_RESTART_ENABLED)
            return
        self._reset = axis.make_reset(restart=bool(self.Restart))
        self.Busy = True
        self._log("job.started")

    def _fail(self, error_id: int) -> None:
        self.Busy = False
        self.Error = True
        self.ErrorID = error_id
        self._log("job.error")

    def _log(self, kind: str) -> None:
        if self.axis.history is not None:
            self.axis.history.emit(
                self.axis.name, kind, job=self.name, instruction=self.instruction, error_id=self.ErrorID
            )

    @property
    @override
    def dormant(self) -> bool:
        return (self.Done or self.Error) and self.Execute and self._last_execute

    def done(self) -> bool:
        """Return `Done`."""
        return self.Done

    def ended(self) -> bool:
        """Return whether it has ended, one way or another."""
        return self.Done or self.Error
