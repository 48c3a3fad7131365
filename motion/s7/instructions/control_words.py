"""`MC_SetAxisSTW` (section 2.13 of the instruction specification)."""

from __future__ import annotations

from typing import ClassVar

from motion.s7.axis.control_words import STW1_MASK, STW2_MASK
from motion.s7.axis.jobs import ERROR_ALARM, ERROR_STW_MASK, ERROR_UNSPECIFIED, Job, JobClass
from motion.s7.axis.technology_object import ALARM_CONFIGURATION
from motion.s7.instructions.base import ExecuteInstruction


def _is_word(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= 0xFFFF


class MC_SetAxisSTW(ExecuteInstruction):
    """Set bits of control words 1 and 2 that the technology object does not use itself.

    Inputs: `Execute`; `STW1`, `STW2`, values; `STW1BitMask` (of 16#FB00), `STW2BitMask` (of 16#0FFF), which
    bits are meant. The bits stay until another instance changes them or the object restarts.
    """

    instruction = "MC_SetAxisSTW"
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False, "STW1": 0, "STW1BitMask": 0, "STW2": 0, "STW2BitMask": 0,
    }  # fmt: skip
    STW1: int
    STW1BitMask: int
    STW2: int
    STW2BitMask: int

    def _start(self) -> Job | int:
        masks = ((self.STW1BitMask, STW1_MASK), (self.STW2BitMask, STW2_MASK))
        if any(not _is_word(mask) or mask & ~permitted for mask, permitted in masks):
            return ERROR_STW_MASK
        if not _is_word(self.STW1) or not _is_word(self.STW2):
            return ERROR_UNSPECIFIED
        axis = self.axis
        if axis.alarms.engine.is_pending(ALARM_CONFIGURATION):
            return ERROR_ALARM
        if not axis.port.speaks_telegram:
            return ERROR_UNSPECIFIED  # no drive telegram, or simulated (MC-431, MC-432)
        job = Job(JobClass.NONE, instruction=self.instruction, name=self.name)
        axis.control_words.submit(job, self.STW1, self.STW1BitMask, self.STW2, self.STW2BitMask)
        return job
