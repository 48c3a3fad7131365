"""`MC_GearOut` and `MC_CamOut`: a following axis leaves its leading value (SYN section 7.6)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Final

from motion.kernel.synchronous import DistanceLeaving, TimeLeaving
from motion.s7.axis.jobs import (
    ERROR_DIRECTION,
    ERROR_LEADING_DISTANCE,
    ERROR_SLAVE_POSITION,
    ERROR_SYNC_PROFILE,
    NO_ERROR,
    Job,
    JobClass,
    JobState,
)
from motion.s7.instructions.base import DEFAULT, ExecuteInstruction
from motion.s7.instructions.dynamics import POSITION_LIMIT, is_number, is_whole, resolve
from motion.s7.instructions.gear import ABSOLUTE_GEARING, CAMMING, RELATIVE_GEARING, without_position_control

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

GEAR_OUT: Final = 4
CAM_OUT: Final = 5
"""`StatusSynchronizedMotion.FunctionState` (SYN-034)."""
_BY_TIME, _BY_DISTANCE, _CANCEL = 0, 1, 5


class _SyncOut(ExecuteInstruction):
    """What both instructions share; they differ in the jobs that they end (SYN-208)."""

    object_types = ("SynchronousAxis",)
    inputs: ClassVar[dict[str, Any]] = {
        "Execute": False, "SyncProfileReference": 1, "SlavePosition": 0.0, "MasterStopDistance": 0.0,
        "Deceleration": DEFAULT, "Jerk": DEFAULT, "SyncOutDirection": 3,
    }  # fmt: skip
    function: ClassVar[int]
    """`FunctionState` of the job."""
    ends: ClassVar[tuple[int, ...]]
    """`FunctionState` of the jobs that it ends."""
    SyncProfileReference: int
    SlavePosition: float
    MasterStopDistance: float
    Deceleration: float
    Jerk: float
    SyncOutDirection: int

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.StartSyncOut = False
        super().__init__(axis, name=name, **inputs)

    def _start(self) -> Job | int:
        axis, profile = self.axis, self.SyncProfileReference
        if not is_whole(profile) or profile not in (_BY_TIME, _BY_DISTANCE, _CANCEL):
            return ERROR_SYNC_PROFILE
        job = Job(JobClass.DESYNCHRONISE, instruction=self.instruction, name=self.name)
        job.function = self.function
        error = NO_ERROR if profile == _CANCEL else self._wrong_inputs(job)
        if error:
            return error
        active = axis.motion.synchronous_job
        if profile != _CANCEL and active is not None and active.function in self.ends and active.coupling:
            leader = axis.leader
            error = NO_ERROR if leader is None else without_position_control(axis, leader)
            if error:
                return error
            job.leader_number = active.leader_number
            job.positions = True
            job.target = position = float(self.SlavePosition)
            leading, modulo = active.coupling.leading, axis.servo.modulo
            if profile == _BY_DISTANCE:
                way: DistanceLeaving | TimeLeaving = DistanceLeaving(
                    leading, position, float(self.MasterStopDistance), self.SyncOutDirection, modulo
                )
            else:
                _, deceleration, jerk = axis.motion.limits_of(job)
                way = TimeLeaving(leading, position, deceleration, jerk, self.SyncOutDirection, modulo)
            job.coupling = job.leaving = way
        return axis.motion.submit_leaving(job, self.ends) or job

    def _wrong_inputs(self, job: Job) -> int:
        """Resolve the dynamic values into `job`; returns the ErrorID of an input that is not permitted, 0 for
        none.
        """
        if not is_number(self.SlavePosition, POSITION_LIMIT):
            return ERROR_SLAVE_POSITION
        if not is_whole(self.SyncOutDirection) or self.SyncOutDirection not in (1, 2, 3):
            return ERROR_DIRECTION
        if self.SyncProfileReference == _BY_TIME:
            return resolve(self, job, velocity=False, acceleration=False)
        distance = self.MasterStopDistance
        return NO_ERROR if is_number(distance, POSITION_LIMIT) and distance > 0.0 else ERROR_LEADING_DISTANCE

    def _clear(self) -> None:
        super()._clear()
        self.StartSyncOut = False

    def _show(self, job: Job) -> None:
        super()._show(job)
        self.StartSyncOut = job.state is JobState.ACTIVE

    def start_sync_out(self) -> bool:
        """Return `StartSyncOut`."""
        return self.StartSyncOut


class MC_GearOut(_SyncOut):
    """Let an axis leave the gear of `MC_GearIn` or `MC_GearInPos`, and stop at a position (S7-1500T; SYN-197
    to SYN-213).

    Inputs: `Execute`; `SyncProfileReference` (16#8036): 0 with the dynamic values, 1 over the leading value
    distance `MasterStopDistance`, leading axis unit, above 0 (16#8026), 5 only end a job that waits;
    `SlavePosition`, where the axis stops, axis unit (16#8037); `Deceleration`, `Jerk` of profile 0;
    `SyncOutDirection`, in which the axis may come to its stop position, 1 positive, 2 negative, 3 that of its
    motion (16#8007). Outputs: `StartSyncOut`, the axis leaves its leading value; `Done`, it stands at
    `SlavePosition`; and the common ones. Until `StartSyncOut` the job waits, and the gear goes on. A waiting
    `MC_GearInPos` ends with `CommandAborted`; without any gear 16#8077.
    """

    instruction = "MC_GearOut"
    function = GEAR_OUT
    ends = (RELATIVE_GEARING, ABSOLUTE_GEARING)


class MC_CamOut(_SyncOut):
    """Let an axis leave its cam and stop at a position (S7-1500T; CAM-144, CAM-145).

    Inputs and outputs are those of `MC_GearOut`; it ends jobs of `MC_CamIn`, and without one answers with
    16#8078.
    """

    instruction = "MC_CamOut"
    function = CAM_OUT
    ends = (CAMMING,)
