"""`MC_MoveSuperimposed` and `MC_HaltSuperimposed` (sections 2.9 and 2.10 of
the instruction specification).
"""

from __future__ import annotations

from typing import ClassVar

from motion.s7.axis.jobs import ERROR_DISTANCE, Job, JobClass
from motion.s7.instructions.base import DEFAULT, ExecuteInstruction
from motion.s7.instructions.dynamics import POSITION_LIMIT, is_number, resolve


class MC_MoveSuperimposed(ExecuteInstruction):
    """Move by a distance on top of the motion that runs, or of none (MC-341 to MC-358).

    Inputs: `Execute`; `Distance`, axis unit; `VelocityDiff`, velocity unit of the axis, the highest velocity
    on top of the basic one; `Acceleration`, `Deceleration`, `Jerk` (negative: dynamic default).
    """

    instruction = "MC_MoveSuperimposed"
    object_types = ("PositioningAxis",)
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False, "Distance": 0.0, "VelocityDiff": DEFAULT, "Acceleration": DEFAULT,
        "Deceleration": DEFAULT, "Jerk": DEFAULT,
    }  # fmt: skip
    Distance: float
    VelocityDiff: float

    def _start(self) -> Job | int:
        if not is_number(self.Distance, POSITION_LIMIT):
            return ERROR_DISTANCE
        job = Job(JobClass.SUPERIMPOSED, instruction=self.instruction, name=self.name)
        error = resolve(self, job, velocity=True, velocity_input="VelocityDiff")
        if error:
            return error
        job.distance = float(self.Distance)
        return self.axis.motion.submit_superimposed(job) or job


class MC_HaltSuperimposed(ExecuteInstruction):
    """Brake the superimposed motion to zero; the basic motion continues (MC-361 to MC-370).

    Inputs: `Execute`; `Deceleration`, `Jerk` (negative: dynamic default); `AbortAcceleration`.
    """

    instruction = "MC_HaltSuperimposed"
    object_types = ("PositioningAxis",)
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False, "Deceleration": DEFAULT, "Jerk": DEFAULT, "AbortAcceleration": False,
    }  # fmt: skip
    AbortAcceleration: bool

    def _start(self) -> Job | int:
        job = Job(JobClass.SUPERIMPOSED, instruction=self.instruction, name=self.name)
        error = resolve(self, job, velocity=False, acceleration=False)
        if error:
            return error
        job.abort_acceleration = bool(self.AbortAcceleration)
        return self.axis.motion.submit_superimposed(job) or job
