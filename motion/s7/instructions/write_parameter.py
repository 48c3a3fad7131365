"""`MC_WriteParameter` (section 2.14 of the instruction specification)."""

from __future__ import annotations

from typing import ClassVar, Final

from motion.s7.axis.axis import TechnologyAxis
from motion.s7.axis.jobs import ERROR_DIRECT_CONNECTION, ERROR_LIMIT_SWITCH, ERROR_STATE, Job, JobClass
from motion.s7.axis.state import AxisState
from motion.s7.instructions.base import ExecuteInstruction
from motion.s7.instructions.dynamics import is_whole
from motion.s7.variables import ERROR_PARAMETER_NUMBER, ParameterError

LIMIT_SWITCHES: Final = 1000
"""`PositionLimits_HW.Active`."""
TIMES: Final = (1010, 1011, 1012)
"""T_i, T_o, T_DC."""


class MC_WriteParameter(ExecuteInstruction):
    """Write a parameter of a technology object while the program runs.

    Inputs: `Execute`; `ParameterNumber` 1000 `PositionLimits_HW.Active` and 1020
    `Actor.RemoveEnableReaction`, which act at once; 1010, 1011, 1012 T_i, T_o, T_DC in s, which act after a
    restart and only where the connection goes through a data block (CFG-272); `Value`. Outputs: the common
    ones. 1000 cannot become TRUE while a limit switch is a variable that does not exist (16#805B, LIM-072).
    """

    instruction = "MC_WriteParameter"
    object_types = ("SpeedAxis", "PositioningAxis", "ExternalEncoder")
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "ParameterNumber": 0, "Value": 0}
    ParameterNumber: int
    Value: float

    def _start(self) -> Job | int:
        axis = self.axis
        if axis.state is AxisState.RESTARTING:
            return ERROR_STATE
        if not is_whole(self.ParameterNumber):
            return ERROR_PARAMETER_NUMBER
        if self.ParameterNumber in self.level.without_parameters:
            return ERROR_PARAMETER_NUMBER
        if self.ParameterNumber in TIMES and (axis.connection == "direct" or axis.simulated):
            return ERROR_DIRECT_CONNECTION
        position = axis.position if isinstance(axis, TechnologyAxis) else None
        switches = self.ParameterNumber == LIMIT_SWITCHES and self.Value is True
        if switches and position is not None and position.hardware.address_problem():
            return ERROR_LIMIT_SWITCH
        try:
            axis.variables.write_parameter(self.ParameterNumber, self.Value)
        except ParameterError as error:
            return error.error_id
        job = Job(JobClass.POSITIONING, instruction=self.instruction, name=self.name)
        job.start(axis.name, axis.history)
        job.activate()
        job.finish()
        return job
