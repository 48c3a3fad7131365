"""`MC_CamIn`: a following axis keeps to a cam (CAM section 15.1)."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Final

from motion.kernel.cams import ScaledCurve
from motion.kernel.cams.scaled import APPENDING, CYCLIC, ONCE
from motion.kernel.synchronous import Entry, FunctionCoupling
from motion.s7.axis.jobs import (
    ERROR_ALARM,
    ERROR_APPLICATION_MODE,
    ERROR_MASTER_OFFSET,
    ERROR_MASTER_SCALING,
    ERROR_MASTER_SYNC_POSITION,
    ERROR_NO_CAMMING,
    ERROR_REFERENCE,
    ERROR_SLAVE_OFFSET,
    ERROR_SLAVE_SCALING,
    ERROR_SYNC_POSITION_OUTSIDE,
    ERROR_SYNC_PROFILE,
    Job,
    JobClass,
    JobState,
)
from motion.s7.axis.state import ACCEPTS_MOTION
from motion.s7.axis.technology_object import TechnologyObject
from motion.s7.cams import Cam
from motion.s7.instructions.base import DEFAULT, ExecuteInstruction
from motion.s7.instructions.dynamics import POSITION_LIMIT, is_number, is_whole, resolve
from motion.s7.instructions.gear import (
    CAMMING,
    can_lead,
    leader_facts,
    leading_motion,
    not_homed,
    unfit_leader,
    wrong_way,
)

if TYPE_CHECKING:
    from motion.kernel.cams import Curve
    from motion.s7.axis.axis import TechnologyAxis

ALARM_NOT_INTERPOLATED: Final = 612
"""The cam of the job has not been interpolated (SYN-313)."""
_PROFILES: Final = {
    0: Entry.DYNAMIC,
    1: Entry.ADVANCE,
    2: Entry.DIRECT,
    3: Entry.SUBSEQUENT,
    4: Entry.FROM_HERE,
    5: Entry.AT_END,
    6: Entry.AHEAD,
    7: Entry.IN_PLACE,
}
_OVER_DISTANCE: Final = (Entry.ADVANCE, Entry.SUBSEQUENT, Entry.FROM_HERE, Entry.AHEAD)
_FROM_PRESENT: Final = (Entry.FROM_HERE, Entry.IN_PLACE)
_SHIFTS_LEADING: Final = (Entry.DYNAMIC, Entry.ADVANCE, Entry.SUBSEQUENT, *_FROM_PRESENT)
_SHIFTS_FOLLOWING: Final = (*_SHIFTS_LEADING, Entry.AHEAD)
"""Profiles that use `MasterOffset`, and those that use `SlaveOffset` (CAM-115)."""


class MC_CamIn(ExecuteInstruction):
    """Let a synchronous axis follow a leading axis by a cam (S7-1500T; CAM-114 to CAM-143).

    Inputs: `Master`; `Cam`, an interpolated cam (alarm 612); `Execute`; `MasterOffset`, `SlaveOffset`,
    `MasterScaling`, not 0, `SlaveScaling`, shift and scaling of the cam (16#8021 to 16#8024);
    `MasterSyncPosition`, counted from the start of the scaled cam, leading axis unit (16#8034, 16#80AD);
    `SyncProfileReference` (16#8036): 0 in advance with the dynamic values, 1 in advance over
    `MasterStartDistance`, 2 at once, 3 over the distance from the synchronous position on, 4 over it from the
    present leading value on, 5 at once at the end of the active cam (16#808B), 6 over it from the present
    leading value to the synchronous position, 7 (from V9.0) as soon as the axis stands where the cam wants it
    for the present leading value, which nothing moves it to; `MasterStartDistance`, leading axis unit, above
    0 (16#8026);
    `Velocity`, `Acceleration`, `Deceleration`, `Jerk` of profile 0; `ApplicationMode` 0 once, 1 cyclic,
    2 cyclic appending (16#8027); `SyncDirection` as of `MC_GearInPos`. Outputs: `StartSync`, `InSync`,
    `EndOfProfile`, the end of the cam has been passed, and the common ones.

    A cam that is run once ends the job at its end, with `EndOfProfile`; the axis stays where it is.
    """

    instruction = "MC_CamIn"
    object_types = ("SynchronousAxis",)
    inputs: ClassVar[dict[str, Any]] = {
        "Execute": False, "Master": None, "Cam": None, "MasterOffset": 0.0, "SlaveOffset": 0.0,
        "MasterScaling": 1.0, "SlaveScaling": 1.0, "MasterSyncPosition": 0.0, "SyncProfileReference": 1,
        "MasterStartDistance": 0.0, "Velocity": DEFAULT, "Acceleration": DEFAULT, "Deceleration": DEFAULT,
        "Jerk": DEFAULT, "ApplicationMode": 0, "SyncDirection": 3,
    }  # fmt: skip
    Master: TechnologyObject | None
    Cam: Cam | None
    MasterOffset: float
    SlaveOffset: float
    MasterScaling: float
    SlaveScaling: float
    MasterSyncPosition: float
    SyncProfileReference: int
    MasterStartDistance: float
    Velocity: float
    Acceleration: float
    Deceleration: float
    Jerk: float
    ApplicationMode: int
    SyncDirection: int

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.StartSync = False
        self.InSync = False
        self.EndOfProfile = False
        self._coupling: FunctionCoupling | None = None
        self._passes = 0
        super().__init__(axis, name=name, **inputs)

    def _start(self) -> Job | int:
        axis, leader, cam = self.axis, self.Master, self.Cam
        if not can_lead(leader, self.level):
            return ERROR_REFERENCE
        if not isinstance(cam, Cam):
            return ERROR_REFERENCE  # CAM-252
        error = self._wrong_inputs()
        if error:
            return error
        entry = _PROFILES[self.SyncProfileReference]
        job = Job(JobClass.SYNCHRONISE, instruction=self.instruction, name=self.name)
        if entry is Entry.DYNAMIC:
            error = resolve(self, job, velocity=True)
        former = self._former() if entry is Entry.AT_END else None
        if not error and entry is Entry.AT_END and former is None:
            error = ERROR_NO_CAMMING
        error = error or unfit_leader(axis, leader, by_velocity=False) or not_homed(axis)
        if error:
            return error
        curve = cam.curve
        if curve is None:
            if not axis.alarms.blocking and axis.state in ACCEPTS_MOTION:
                axis.alarms.raise_alarm(ALARM_NOT_INTERPOLATED)
            return axis.motion.submit_entry(job) or ERROR_ALARM
        coupling = self._couple(curve, leader, entry, former)
        if isinstance(coupling, int):
            return coupling
        job.function, job.cam_number, job.leader_number = CAMMING, cam.db_number, leader.db_number
        job.follows = {
            **leader_facts(axis, leader),
            "cam": cam.name,
            "mode": self.ApplicationMode,
            "master_scaling": float(self.MasterScaling),
            "slave_scaling": float(self.SlaveScaling),
            "master": float(self.MasterOffset) if entry in _SHIFTS_LEADING else 0.0,
            "slave": float(self.SlaveOffset) if entry in _SHIFTS_FOLLOWING else 0.0,
        }
        job.position_controlled = True
        job.keeps_superimposed = entry is Entry.AT_END
        job.coupling = job.entry = coupling
        error = axis.motion.submit_entry(job)
        if error:
            return error
        cam.use(job)
        job.on_end = partial(cam.release_use, job)
        self._coupling, self._passes = coupling, 0
        return job

    def _former(self) -> FunctionCoupling | None:
        """Return the camming at whose end this job begins; None: there is none that is synchronous
        (CAM-135).
        """
        job = self.axis.motion.synchronous_job
        if job is None or job.function != CAMMING or not job.synchronous:
            return None
        return job.coupling if isinstance(job.coupling, FunctionCoupling) else None

    def _wrong_inputs(self) -> int:
        """Return the ErrorID of an input that is not permitted, 0 for none."""
        profile = self.SyncProfileReference
        if not is_whole(profile) or profile not in self.level.cam_profiles:
            return ERROR_SYNC_PROFILE
        entry = _PROFILES[profile]
        if entry in _SHIFTS_LEADING and not is_number(self.MasterOffset, POSITION_LIMIT):
            return ERROR_MASTER_OFFSET
        if entry in _SHIFTS_FOLLOWING and not is_number(self.SlaveOffset, POSITION_LIMIT):
            return ERROR_SLAVE_OFFSET
        if not is_number(self.MasterScaling, POSITION_LIMIT) or self.MasterScaling == 0.0:
            return ERROR_MASTER_SCALING
        if not is_number(self.SlaveScaling, POSITION_LIMIT):
            return ERROR_SLAVE_SCALING
        if entry not in _FROM_PRESENT and not is_number(self.MasterSyncPosition, POSITION_LIMIT):
            return ERROR_MASTER_SYNC_POSITION
        if not is_whole(self.ApplicationMode) or self.ApplicationMode not in (ONCE, CYCLIC, APPENDING):
            return ERROR_APPLICATION_MODE
        direct = entry in (Entry.DIRECT, Entry.AT_END, Entry.IN_PLACE)
        return wrong_way(
            entry in _OVER_DISTANCE, self.MasterStartDistance, 3 if direct else self.SyncDirection
        )

    def _couple(
        self, curve: Curve, leader: TechnologyObject, entry: Entry, former: FunctionCoupling | None
    ) -> FunctionCoupling | int:
        """Return the scaled cam as a coupling, or the ErrorID of a synchronous position outside of it."""
        scaling = float(self.MasterScaling)
        function = ScaledCurve(
            curve,
            master_scaling=scaling,
            slave_scaling=float(self.SlaveScaling),
            master_offset=float(self.MasterOffset) if entry in _SHIFTS_LEADING else 0.0,
            slave_offset=float(self.SlaveOffset) if entry in _SHIFTS_FOLLOWING else 0.0,
            mode=self.ApplicationMode,
        )
        position = 0.0 if entry in _FROM_PRESENT else float(self.MasterSyncPosition)
        x = function.first + position
        leading = leading_motion(self.axis, leader)
        place = leader.leading_modulo.wrap(leading.position) if entry in _FROM_PRESENT else x
        if not function.contains(place):
            return ERROR_SYNC_POSITION_OUTSIDE
        return FunctionCoupling(
            leading,
            function,
            entry,
            x=x,
            distance=float(self.MasterStartDistance) if entry in _OVER_DISTANCE else 0.0,
            ends=(function.low, function.high) if self.ApplicationMode == ONCE else None,
            leading_modulo=leader.leading_modulo,
            modulo=self.axis.servo.modulo,
            direction=self.SyncDirection,
            former=former,
        )

    def _clear(self) -> None:
        super()._clear()
        self.StartSync = self.InSync = self.EndOfProfile = False
        self._coupling = None

    def _show(self, job: Job) -> None:
        super()._show(job)
        self.Done = False  # the end of the cam is shown by EndOfProfile (CAM-106)
        self.InSync = synchronous = job.synchronous
        self.StartSync = not synchronous and job.state is JobState.ACTIVE
        coupling = self._coupling
        passes = self._passes if coupling is None else coupling.passes
        self.EndOfProfile = passes != self._passes
        self._passes = passes

    def in_sync(self) -> bool:
        """Return `InSync`."""
        return self.InSync

    def start_sync(self) -> bool:
        """Return `StartSync`."""
        return self.StartSync

    def end_of_profile(self) -> bool:
        """Return `EndOfProfile`."""
        return self.EndOfProfile
