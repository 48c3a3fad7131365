"""`MC_Home`, the modes that cause no motion (section 2.3 of the instruction specification)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Final

from motion.axis.jobs import ERROR_ACTUAL_VALUE, ERROR_MODE, ERROR_POSITION, ERROR_STATE, Job, JobClass
from motion.axis.mechanics import INCREMENTAL
from motion.axis.state import AxisState
from motion.instructions.base import ExecuteInstruction
from motion.instructions.dynamics import POSITION_LIMIT, is_number

if TYPE_CHECKING:
    from motion.axis.axis import PositioningAxis
    from motion.axis.external_encoder import ExternalEncoder

_DIRECT: Final = frozenset((0, 1, 6, 7, 11, 12, 13))
_WITHOUT_SETPOINT: Final = _DIRECT - {11, 12}
_ERROR_INCREMENTAL: Final = 0x8010
_ERROR_ABSOLUTE: Final = 0x8011


class MC_Home(ExecuteInstruction):
    """Relate the position of the axis to the machine without moving it.

    Inputs: `Execute`; `Position`, axis unit; `Mode` 0 and 1 (direct absolute, relative), 6 and 7 (absolute encoder),
    11 and 12 (position setpoint), 13 (incremental encoder). Active and passive homing are refused with 16#800A.
    Outputs: `ReferenceMarkPosition` and the common ones.
    """

    instruction = "MC_Home"
    object_types = ("PositioningAxis", "ExternalEncoder")
    inputs: ClassVar[dict[str, Any]] = {"Execute": False, "Position": 0.0, "Mode": 0}
    Position: float
    Mode: int
    axis: PositioningAxis | ExternalEncoder  # type: ignore[assignment]

    def __init__(self, axis: Any, *, name: str | None = None, **inputs: Any) -> None:
        self.ReferenceMarkPosition = 0.0
        super().__init__(axis, name=name, **inputs)

    def _start(self) -> Job | int:
        axis = self.axis
        if axis.state is AxisState.RESTARTING:
            return ERROR_STATE
        if self.Mode not in (_DIRECT if axis.object_type == "PositioningAxis" else _WITHOUT_SETPOINT):
            return ERROR_MODE
        if not is_number(self.Position, POSITION_LIMIT):
            return ERROR_POSITION
        if not axis.sensor_valid:
            return ERROR_ACTUAL_VALUE
        absolute = axis.feedback.scale.kind != INCREMENTAL
        if self.Mode in (6, 7) and not absolute:
            return _ERROR_INCREMENTAL
        if self.Mode == 13 and absolute:
            return _ERROR_ABSOLUTE
        job = Job(JobClass.POSITIONING, instruction=self.instruction, name=self.name)
        job.start(axis.name, axis.history)
        job.activate()
        axis.home(self.Mode, self.Position)
        self.ReferenceMarkPosition = axis.feedback.position
        job.finish()
        return job
