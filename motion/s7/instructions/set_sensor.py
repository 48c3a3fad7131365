"""`MC_SetSensor` (section 2.11 of the instruction specification)."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from motion.kernel.feedback import VALID
from motion.s7.axis.axis import SWITCH_BUMPLESS, TRANSFER_FROM
from motion.s7.axis.jobs import (
    ERROR_ACTUAL_VALUE,
    ERROR_HOMING,
    ERROR_MODE,
    ERROR_REFERENCE_SENSOR,
    ERROR_SENSOR,
    ERROR_STATE,
    Job,
    JobClass,
)
from motion.s7.axis.state import AxisState
from motion.s7.instructions.base import ExecuteInstruction

if TYPE_CHECKING:
    from motion.s7.axis.axis import PositioningAxis


class MC_SetSensor(ExecuteInstruction):
    """Switch the encoder in position control, or transfer a position to another one (S7-1500T).

    Inputs: `Execute`; `Sensor` 1 to 4; `Mode` 0 switch with the position of the axis, 1 switch as it is,
        2 transfer the
    position of the axis, 3 that of `ReferenceSensor`. Outputs: the common ones.

    Raises:
        ConfigurationError: The axis belongs to an S7-1500, which has no such instruction (CFG-062).

    """

    instruction = "MC_SetSensor"
    object_types = ("PositioningAxis",)
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "Sensor": 1, "Mode": 0, "ReferenceSensor": 1}
    Sensor: int
    Mode: int
    ReferenceSensor: int
    axis: PositioningAxis

    def _start(self) -> Job | int:
        axis = self.axis
        if axis.state is AxisState.RESTARTING:
            return ERROR_STATE
        numbers = range(1, len(axis.sensors) + 1)
        if self.Sensor not in numbers:
            return ERROR_SENSOR
        if self.Mode not in range(4):
            return ERROR_MODE
        if self.Mode == TRANSFER_FROM and self.ReferenceSensor not in numbers:
            return ERROR_REFERENCE_SENSOR
        if axis.homings:
            return ERROR_HOMING
        source = axis.sensors[self.ReferenceSensor - 1] if self.Mode == TRANSFER_FROM else axis.feedback
        target = axis.sensors[self.Sensor - 1]
        if target.state != VALID or (self.Mode != SWITCH_BUMPLESS + 1 and source.state != VALID):
            return ERROR_ACTUAL_VALUE
        job = Job(JobClass.POSITIONING, instruction=self.instruction, name=self.name)
        job.start(axis.name, axis.history)
        job.activate()
        axis.set_sensor(self.Sensor, self.Mode, self.ReferenceSensor)
        job.finish()
        return job
