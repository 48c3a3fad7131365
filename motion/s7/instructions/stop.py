"""`MC_Halt` and `MC_Stop` (sections 2.4 and 2.12 of the instruction specification)."""

from __future__ import annotations

from typing import ClassVar

from motion.s7.axis.jobs import ERROR_MODE, Job, JobClass
from motion.s7.instructions.base import DEFAULT, ExecuteInstruction
from motion.s7.instructions.dynamics import resolve


class MC_Halt(ExecuteInstruction):
    """Brake to standstill; other motion jobs may take over at any time.

    Inputs: `Execute`; `Deceleration`, `Jerk` (negative: dynamic default); `AbortAcceleration`; `Mode` 0 basic
    and superimposed motion, 1 basic motion only.
    """

    instruction = "MC_Halt"
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False, "Deceleration": DEFAULT, "Jerk": DEFAULT, "AbortAcceleration": False, "Mode": 0,
    }  # fmt: skip
    Deceleration: float
    Jerk: float
    AbortAcceleration: bool
    Mode: int

    def _start(self) -> Job | int:
        if self.Mode not in (0, 1):
            return ERROR_MODE
        job = Job(
            JobClass.HALT if self.Mode == 0 else JobClass.HALT_BASIC,
            instruction=self.instruction,
            name=self.name,
        )
        error = resolve(self, job, velocity=False, acceleration=False)
        if error:
            return error
        job.abort_acceleration = bool(self.AbortAcceleration)
        return self.axis.motion.submit(job) or job


class MC_Stop(ExecuteInstruction):
    """Stop the axis and lock it against motion jobs while `Execute` is TRUE.

    Inputs: `Execute`; `Mode` 0 emergency stop, 2 maximum dynamic values, 3 `Deceleration`
    and `Jerk`; `AbortAcceleration`.
    """

    instruction = "MC_Stop"
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False, "Mode": 0, "Deceleration": DEFAULT, "Jerk": DEFAULT, "AbortAcceleration": False,
    }  # fmt: skip
    Mode: int
    Deceleration: float
    Jerk: float
    AbortAcceleration: bool

    def _start(self) -> Job | int:
        if self.Mode not in (0, 2, 3):
            return ERROR_MODE
        job = Job(JobClass.STOP, instruction=self.instruction, name=self.name)
        job.mode = self.Mode
        if self.Mode == 3:
            error = resolve(self, job, velocity=False, acceleration=False)
            if error:
                return error
        job.abort_acceleration = bool(self.AbortAcceleration)
        return self.axis.motion.submit_stop(job) or job

    def _released(self) -> None:
        if self._job is not None:
            self._job.released = True
            self.axis.motion.release(self._job)
