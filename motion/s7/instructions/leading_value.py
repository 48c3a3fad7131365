"""`MC_LeadingValueAdditive` (section 7.7 of the specification of synchronous operation)."""

from __future__ import annotations

from typing import ClassVar

from motion.s7.axis.jobs import (
    ERROR_ACCELERATION,
    ERROR_LOCKED,
    ERROR_POSITION,
    ERROR_STATE,
    ERROR_VELOCITY,
    NO_ERROR,
)
from motion.s7.axis.state import AxisState
from motion.s7.instructions.dynamics import is_number
from motion.s7.instructions.enable import EnableInstruction


class MC_LeadingValueAdditive(EnableInstruction):
    """Add a value to every leading value that a synchronous axis follows (S7-1500T; SYN-214 to SYN-229,
    SYN-439).

    Inputs: `Enable`; `Position`, `Velocity` and `Acceleration`, in the units of the leading object, taken
    over with every call and neither limited nor compared with each other (SYN-222, SYN-032). Output: `Busy`,
    it is added.

    It needs an enabled axis, or one whose synchronous operation is simulated (16#800F), and acts on all
    synchronous jobs from then on. A second instance ends the first; disabling and restart end it, no other
    job does. Its end is a step of the leading value.
    """

    instruction = "MC_LeadingValueAdditive"
    object_types = ("SynchronousAxis",)
    inputs: ClassVar[dict[str, float]] = {
        "Enable": False, "Position": 0.0, "Velocity": 0.0, "Acceleration": 0.0,
    }  # fmt: skip
    Position: float
    Velocity: float
    Acceleration: float

    @property
    def _permitted(self) -> bool:
        axis = self.axis
        return axis.states.facts.enabled or axis.motion.simulated is not None

    def _begin(self) -> int:
        if self.axis.state is AxisState.RESTARTING:
            return ERROR_STATE
        if not self._permitted:
            return ERROR_LOCKED
        error = self._wrong_value()
        if error == NO_ERROR:
            self._give()
        return error

    def _wrong_value(self) -> int:
        if not is_number(self.Position):
            return ERROR_POSITION
        if not is_number(self.Velocity):
            return ERROR_VELOCITY
        return NO_ERROR if is_number(self.Acceleration) else ERROR_ACCELERATION

    def _give(self) -> None:
        factors = self.axis.variables.factors
        self.axis.motion.additive.give(
            self,
            float(self.Position),
            float(self.Velocity) * factors.velocity,
            float(self.Acceleration) * factors.acceleration,
        )

    def _update(self) -> int:
        additive = self.axis.motion.additive
        if additive.owner is not self or not self._permitted:
            additive.end(self)
            self._active = False  # another instance or the disabling has ended it (SYN-226, SYN-229)
            return NO_ERROR
        error = self._wrong_value()
        if error == NO_ERROR:
            self._give()
        return error

    def _end(self) -> int:
        self.axis.motion.additive.end(self)
        return NO_ERROR
