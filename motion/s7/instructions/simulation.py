"""`MC_SynchronizedMotionSimulation` (section 7.8 of the specification of synchronous operation)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

from motion.s7.axis.jobs import ERROR_SECOND_INSTANCE, ERROR_STATE, NO_ERROR
from motion.s7.axis.state import AxisState
from motion.s7.instructions.enable import EnableInstruction

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis


class MC_SynchronizedMotionSimulation(EnableInstruction):
    """Let a synchronous job go on without moving its axis (S7-1500T; SYN-230 to SYN-238, SYN-440 to SYN-443).

    Input: `Enable`. Outputs: `InSimulation`, the axis does not follow the synchronous job; and the common
    ones.

    The axis has to be synchronous: 16#8075 without a synchronous job, 16#80A9 while one waits or
    synchronises; its leading object has to stand (16#800D). From then on the axis takes other motion jobs,
    and may be stopped and disabled, without an end of the synchronous job; new synchronous jobs are refused
    with 16#8076. With `Enable` FALSE the axis follows again at once: where it is elsewhere, its setpoint
    steps, by what has been superimposed, too. An axis that is not enabled then, an alarm, and a restart end
    the synchronous job. A second instance is refused with 16#800C.
    """

    instruction = "MC_SynchronizedMotionSimulation"
    object_types = ("SynchronousAxis",)
    inputs: ClassVar[dict[str, float]] = {"Enable": False}

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.InSimulation = False
        super().__init__(axis, name=name, **inputs)

    def _call(self) -> None:
        super()._call()
        self.InSimulation = self.axis.motion.simulation_owner is self

    def _begin(self) -> int:
        axis = self.axis
        if axis.state is AxisState.RESTARTING:
            return ERROR_STATE
        motion = axis.motion
        if motion.simulation_owner is not None:
            return ERROR_SECOND_INSTANCE
        leader = axis.leader
        sync = motion.synchronous_job
        if sync is not None and sync.synchronous and leader is not None and not leader.stands:
            return ERROR_STATE
        return motion.simulate(self)

    def _update(self) -> int:
        if self.axis.motion.simulation_owner is not self:
            self._active = False  # its synchronous job has ended
        return NO_ERROR

    def _end(self) -> int:
        motion = self.axis.motion
        if motion.simulation_owner is self:
            motion.end_simulation()
        return NO_ERROR

    def in_simulation(self) -> bool:
        """Return `InSimulation`."""
        return self.InSimulation
