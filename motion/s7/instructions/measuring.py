"""Instructions of measuring inputs: `MC_MeasuringInput`, `MC_MeasuringInputCyclic`, `MC_AbortMeasuringInput`
(OVR section 3.3).
"""

from __future__ import annotations

from typing import Any, ClassVar

from typing_extensions import override

from motion.s7.axis.jobs import ERROR_MODE, ERROR_POSITION, Job, JobClass
from motion.s7.instructions.base import ExecuteInstruction
from motion.s7.instructions.dynamics import is_number, is_whole
from motion.s7.measuring_input import BOTH, FALLING_FIRST, Measurement


class _Measuring(ExecuteInstruction):
    """What both kinds of measuring share.

    Args:
        measuring_input: Technology object at the input `MeasuringInput`.
        name: Instance name in the history.
        **inputs: Start values of inputs.

    """

    object_types = ("MeasuringInput",)
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False,
        "MeasuringRange": False,
        "StartPosition": 0.0,
        "EndPosition": 0.0,
        "Mode": 0,
    }
    highest_mode: ClassVar[int]
    cyclic: ClassVar[bool]
    MeasuringRange: bool
    StartPosition: float
    EndPosition: float
    Mode: int

    def __init__(self, measuring_input: Any, *, name: str | None = None, **inputs: Any) -> None:
        self.MeasuredValue1 = self.MeasuredValue2 = 0.0
        self._measurement: Measurement | None = None
        super().__init__(measuring_input, name=name, **inputs)

    @override
    def _start(self) -> Job | int:
        measuring: Any = self.axis
        if not is_whole(self.Mode) or not 0 <= self.Mode <= self.highest_mode:
            return ERROR_MODE
        window = None
        if self.MeasuringRange:
            if not (is_number(self.StartPosition) and is_number(self.EndPosition)):
                return ERROR_POSITION
            window = float(self.StartPosition), float(self.EndPosition)
        measurement = Measurement(int(self.Mode), window, cyclic=self.cyclic)
        self._measurement = measurement
        self._show_values(measurement)
        outcome: Job | int = measuring.start(self.instruction, self.name, measurement)
        return outcome

    @override
    def _show(self, job: Job) -> None:
        if self._measurement is not None:
            self._show_values(self._measurement)
        super()._show(job)

    def _show_values(self, measurement: Measurement) -> None:
        self.MeasuredValue1, self.MeasuredValue2 = measurement.last


class MC_MeasuringInput(_Measuring):
    """Measure the position at the next edge of a measuring input, or at the next two.

    Inputs: `Execute`; `MeasuringRange`, with which only edges from `StartPosition` to `EndPosition` count,
    position unit; `Mode` 0 next rising edge, 1 next falling edge, 2 next two edges, 3 two edges from a rising
    one on, 4 from a falling one on. Outputs: `MeasuredValue1`, `MeasuredValue2`, and the common ones. An axis
    that leaves the range without an edge ends the job with 16#8001 and alarm 752; homing of the same encoder
    with 16#80A3.
    """

    instruction = "MC_MeasuringInput"
    highest_mode = FALLING_FIRST
    cyclic = False


class MC_MeasuringInputCyclic(_Measuring):
    """Measure the position at every edge of a measuring input, until the job is aborted.

    Inputs as those of `MC_MeasuringInput`; `Mode` 0 rising edges, 1 falling edges, 2 both: then
    `MeasuredValue1` is that of the last rising and `MeasuredValue2` that of the last falling edge. Outputs:
    `MeasuredValue1Counter` and `MeasuredValue2Counter` count them since the start; `LostEdgeCounter1`,
    `LostEdgeCounter2` stay 0. A measuring input in the telegram of an axis cannot do it (alarm 755).
    """

    instruction = "MC_MeasuringInputCyclic"
    highest_mode = BOTH
    cyclic = True

    def __init__(self, measuring_input: Any, *, name: str | None = None, **inputs: Any) -> None:
        self.MeasuredValue1Counter = self.MeasuredValue2Counter = 0
        self.LostEdgeCounter1 = self.LostEdgeCounter2 = 0
        super().__init__(measuring_input, name=name, **inputs)

    @override
    def _show_values(self, measurement: Measurement) -> None:
        super()._show_values(measurement)
        self.MeasuredValue1Counter, self.MeasuredValue2Counter = measurement.counts


class MC_AbortMeasuringInput(ExecuteInstruction):
    """End the running measuring job of a measuring input with `CommandAborted`.

    Inputs: `Execute`. Outputs: the common ones; without a running job it is `Done`, too.
    """

    instruction = "MC_AbortMeasuringInput"
    object_types = ("MeasuringInput",)
    inputs: ClassVar[dict[str, float]] = {"Execute": False}

    def __init__(self, measuring_input: Any, *, name: str | None = None, **inputs: Any) -> None:
        super().__init__(measuring_input, name=name, **inputs)

    @override
    def _start(self) -> Job | int:
        measuring: Any = self.axis
        refused = measuring.refuses()
        if refused:
            return int(refused)
        job = Job(JobClass.NONE, instruction=self.instruction, name=self.name)
        job.start(measuring.name, measuring.history)
        job.activate()
        measuring.abort()
        job.finish()
        return job
