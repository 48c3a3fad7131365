"""`MC_GearIn`, `MC_GearInPos`, `MC_GearInVelocity`: relative, absolute and velocity gearing (sections 7.1 to
7.3 of the specification of synchronous operation).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Final, TypeGuard

from motion.kernel.synchronous import Entry, FunctionCoupling, GearCoupling, LeadingMotion, Line
from motion.s7.axis.jobs import (
    ERROR_ALARM,
    ERROR_CIRCLE,
    ERROR_DENOMINATOR,
    ERROR_DIRECTION,
    ERROR_LEADING_DISTANCE,
    ERROR_MASTER_SYNC_POSITION,
    ERROR_NUMERATOR,
    ERROR_REFERENCE,
    ERROR_SLAVE_SYNC_POSITION,
    ERROR_SYNC_PROFILE,
    NO_ERROR,
    Job,
    JobClass,
    JobState,
)
from motion.s7.axis.motion import ALARM_LEADING_VALUE, ALARM_NOT_CONTROLLED
from motion.s7.axis.state import ACCEPTS_MOTION
from motion.s7.axis.technology_object import ACTUAL, TechnologyObject
from motion.s7.instructions.base import DEFAULT, ExecuteInstruction
from motion.s7.instructions.dynamics import POSITION_LIMIT, is_number, is_whole, resolve

if TYPE_CHECKING:
    from fieldbus.history import Scalar
    from motion.s7.axis.axis import TechnologyAxis
    from motion.s7.compatibility import CompatibilityLevel

"""The leading axis is not position-controlled (SYN-025)."""
ALARM_NOT_HOMED: Final = 321
_PROFILES: Final = {0: Entry.DYNAMIC, 1: Entry.ADVANCE, 3: Entry.SUBSEQUENT, 4: Entry.FROM_HERE}
"""`SyncProfileReference` of `MC_GearInPos` (SYN-151, SYN-350)."""
_LARGEST: Final = (1 << 31) - 1
LEADING_TYPES: Final = frozenset(("PositioningAxis", "ExternalEncoder", "LeadingAxisProxy"))
"""Types of the objects at the input `Master`."""


RELATIVE_GEARING: Final = 1
ABSOLUTE_GEARING: Final = 2
CAMMING: Final = 3
VELOCITY_GEARING: Final = 6
"""`StatusSynchronizedMotion.FunctionState` (SYN-034)."""

_DYNAMICS: Final = {"Acceleration": DEFAULT, "Deceleration": DEFAULT, "Jerk": DEFAULT}


def can_lead(leader: object, level: CompatibilityLevel) -> TypeGuard[TechnologyObject]:
    """Return whether a controller takes an object as `Master` (SYN-016, SYN-135)."""
    if not isinstance(leader, TechnologyObject) or LEADING_TYPES.isdisjoint(leader.kinds):
        return False
    return level.technology or "PositioningAxis" in leader.kinds


def leading_motion(axis: TechnologyAxis, leader: TechnologyObject) -> LeadingMotion:
    """Return the value of `leader` as `axis` takes it."""
    coupling = axis.coupling_with(leader)
    return LeadingMotion(
        leader.leading_by(coupling),
        leader.gives_value,
        positions=None if coupling == ACTUAL else leader.leads_positions,
        additive=axis.motion.additive,
        tolerance=axis.hold_tolerance,
    )


def leader_facts(axis: TechnologyAxis, leader: TechnologyObject) -> dict[str, Scalar]:
    """Return the leading object of `axis` and its coupling, for the event log."""
    return {"leader": leader.name, "coupling": axis.coupling_with(leader)}


def unfit_leader(axis: TechnologyAxis, leader: TechnologyObject, *, by_velocity: bool) -> int:
    """Return why `leader` cannot lead `axis`, 0 if it can; alarms 601 and 603 are raised here."""
    if axis.leads(leader):
        return ERROR_CIRCLE
    if axis.alarms.blocking or axis.state not in ACCEPTS_MOTION:
        return NO_ERROR  # the axis says why nothing can start when it gets the job
    if leader not in axis.leading_objects or not leader.gives_value():
        axis.alarms.raise_alarm(ALARM_LEADING_VALUE)
        return ERROR_ALARM
    return NO_ERROR if by_velocity else without_position_control(axis, leader)


def without_position_control(axis: TechnologyAxis, leader: TechnologyObject) -> int:
    """Return 16#8001 with alarm 603 where the setpoint of `leader` is followed and has no positions."""
    if axis.coupling_with(leader) == ACTUAL or leader.leads_positions():
        return NO_ERROR
    axis.alarms.raise_alarm(ALARM_NOT_CONTROLLED)
    return ERROR_ALARM


def not_homed(axis: TechnologyAxis) -> int:
    """Return 16#8001 with alarm 321 where positions of `axis` have to be those of the machine and are not
    (SYN-381).
    """
    if axis.homed or axis.alarms.blocking or axis.state not in ACCEPTS_MOTION:
        return NO_ERROR
    axis.alarms.raise_alarm(ALARM_NOT_HOMED)
    return ERROR_ALARM


def wrong_way(has_distance: bool, distance: float, direction: int) -> int:
    """Return the ErrorID of a leading value distance or a direction that is not permitted, 0 for none."""
    if has_distance and not (is_number(distance, POSITION_LIMIT) and distance > 0.0):
        return ERROR_LEADING_DISTANCE
    return NO_ERROR if is_whole(direction) and direction in (1, 2, 3) else ERROR_DIRECTION


class _Gearing(ExecuteInstruction):
    """What both instructions share: leading axis, ratio, dynamics of synchronising."""

    object_types = ("SynchronousAxis",)
    Master: TechnologyObject | None
    RatioNumerator: int
    RatioDenominator: int
    Acceleration: float
    Deceleration: float
    Jerk: float

    def _wrong_ratio(self) -> int:
        """Return the ErrorID of a ratio that is not permitted, 0 for one that is."""
        numerator, denominator = self.RatioNumerator, self.RatioDenominator
        if not is_whole(numerator) or numerator == 0 or not -_LARGEST - 1 <= numerator <= _LARGEST:
            return ERROR_NUMERATOR
        if not is_whole(denominator) or not 1 <= denominator <= _LARGEST:
            return ERROR_DENOMINATOR
        return NO_ERROR

    def _ratio_facts(self) -> dict[str, Scalar]:
        """Return the gear for the event log."""
        return {"numerator": self.RatioNumerator, "denominator": self.RatioDenominator}

    def _prepare(self, job_class: JobClass, *, by_velocity: bool) -> Job | int:
        """Return the job with its coupling, not yet handed over; or the ErrorID of what is not permitted."""
        leader = self.Master
        if not can_lead(leader, self.level):
            return ERROR_REFERENCE
        job = Job(job_class, instruction=self.instruction, name=self.name)
        error = (
            self._wrong_ratio()
            or resolve(self, job, velocity=False)
            or unfit_leader(self.axis, leader, by_velocity=by_velocity)
        )
        if error:
            return error
        job.coupling = GearCoupling(
            leading_motion(self.axis, leader),
            self.RatioNumerator,
            self.RatioDenominator,
            by_velocity=by_velocity,
        )
        job.leader_number = leader.db_number
        job.function = VELOCITY_GEARING if by_velocity else RELATIVE_GEARING
        job.follows = {**leader_facts(self.axis, leader), **self._ratio_facts()}
        return job


class MC_GearIn(_Gearing):
    """Let a synchronous axis follow a leading axis with a gear ratio, without a fixed relation of positions
    (SYN-135 to SYN-147).

    Inputs: `Master`, the leading object: a positioning axis, synchronous axis or external encoder (S7-1500T)
    that is interconnected with this one; `Execute`; `RatioNumerator`, not 0, below 0 for the opposite
    direction (16#8017); `RatioDenominator`, 1 or more (16#8018); `Acceleration`, `Deceleration`, `Jerk` of
    synchronising, axis unit per second squared and cubed (negative: dynamic default). Outputs: `InGear`, the
    axis has reached its leading value and follows it, and the common ones. `Done` does not exist: the job
    goes on until another one takes over.

    A leading object that is not interconnected or gives no valid value is alarm 601, one without position
    control, whose setpoint is to be followed, alarm 603; one that follows this axis itself is rejected with
    16#8019.
    """

    instruction = "MC_GearIn"
    inputs: ClassVar[dict[str, Any]] = {
        "Execute": False, "Master": None, "RatioNumerator": 1, "RatioDenominator": 1, **_DYNAMICS,
    }  # fmt: skip

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.InGear = False
        super().__init__(axis, name=name, **inputs)

    def _start(self) -> Job | int:
        job = self._prepare(JobClass.GEAR_IN, by_velocity=False)
        if isinstance(job, int):
            return job
        job.position_controlled = True
        return self.axis.motion.submit(job) or job

    def _clear(self) -> None:
        super()._clear()
        self.InGear = False

    def _show(self, job: Job) -> None:
        super()._show(job)
        self.InGear = job.synchronous

    def in_gear(self) -> bool:
        """Return `InGear`."""
        return self.InGear


class MC_GearInPos(_Gearing):
    """Let a synchronous axis follow a leading axis with a gear ratio and a fixed relation of positions
    (S7-1500T; SYN-148 to SYN-164).

    Inputs: those of `MC_GearIn`; `MasterSyncPosition` and `SlaveSyncPosition`, the positions that belong
    together, axis units (16#8034, 16#8035); `SyncProfileReference` (16#8036): 0 in advance with the dynamic
    values, 1 in advance over `MasterStartDistance`, 3 over that distance from `MasterSyncPosition` on, 4
    (from V9.0) over it from the present leading value on; `MasterStartDistance`, leading axis unit, above 0
    (16#8026);
    `Velocity`, `Acceleration`, `Deceleration`, `Jerk` of profile 0; `SyncDirection` of a following axis with
    a modulo range, 1 positive, 2 negative, 3 either (16#8007). Outputs: `StartSync`, the axis synchronises;
    `InSync`, it is synchronous; and the common ones. Until `StartSync` the job waits and aborts nothing.

    The axis has to be homed (alarm 321). A leading value that turns round while the axis synchronises, or a
    way against `SyncDirection`, is alarm 608.
    """

    instruction = "MC_GearInPos"
    inputs: ClassVar[dict[str, Any]] = {
        "Execute": False, "Master": None, "RatioNumerator": 1, "RatioDenominator": 1,
        "MasterSyncPosition": 0.0, "SlaveSyncPosition": 0.0, "SyncProfileReference": 1,
        "MasterStartDistance": 1.0, "Velocity": DEFAULT, **_DYNAMICS, "SyncDirection": 3,
    }  # fmt: skip
    MasterSyncPosition: float
    SlaveSyncPosition: float
    SyncProfileReference: int
    MasterStartDistance: float
    Velocity: float
    SyncDirection: int

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.StartSync = False
        self.InSync = False
        super().__init__(axis, name=name, **inputs)

    def _start(self) -> Job | int:
        axis, leader = self.axis, self.Master
        if not can_lead(leader, self.level):
            return ERROR_REFERENCE
        error = self._wrong_ratio() or self._wrong_positions()
        if error:
            return error
        entry = _PROFILES[self.SyncProfileReference]
        job = Job(JobClass.SYNCHRONISE, instruction=self.instruction, name=self.name)
        if entry is Entry.DYNAMIC:
            error = resolve(self, job, velocity=True)
        error = error or unfit_leader(axis, leader, by_velocity=False) or not_homed(axis)
        if error:
            return error
        x = float(self.MasterSyncPosition)
        job.function, job.leader_number = ABSOLUTE_GEARING, leader.db_number
        job.follows = {
            **leader_facts(axis, leader),
            **self._ratio_facts(),
            "master": x,
            "slave": float(self.SlaveSyncPosition),
        }
        job.position_controlled = True
        job.coupling = job.entry = FunctionCoupling(
            leading_motion(axis, leader),
            Line(self.RatioNumerator, self.RatioDenominator, x, float(self.SlaveSyncPosition)),
            entry,
            x=x,
            distance=float(self.MasterStartDistance) if entry is not Entry.DYNAMIC else 0.0,
            leading_modulo=leader.leading_modulo,
            modulo=axis.servo.modulo,
            direction=self.SyncDirection,
        )
        return axis.motion.submit_entry(job) or job

    def _wrong_positions(self) -> int:
        """Return the ErrorID of a position, profile, distance or direction that is not permitted, 0 for
        none.
        """
        if not is_number(self.MasterSyncPosition, POSITION_LIMIT):
            return ERROR_MASTER_SYNC_POSITION
        if not is_number(self.SlaveSyncPosition, POSITION_LIMIT):
            return ERROR_SLAVE_SYNC_POSITION
        if not is_whole(self.SyncProfileReference) or (
            self.SyncProfileReference not in self.level.gear_profiles
        ):
            return ERROR_SYNC_PROFILE
        return wrong_way(self.SyncProfileReference != 0, self.MasterStartDistance, self.SyncDirection)

    def _clear(self) -> None:
        super()._clear()
        self.StartSync = self.InSync = False

    def _show(self, job: Job) -> None:
        super()._show(job)
        self.InSync = job.synchronous
        self.StartSync = job.state is JobState.ACTIVE and not job.synchronous

    def in_sync(self) -> bool:
        """Return `InSync`."""
        return self.InSync

    def start_sync(self) -> bool:
        """Return `StartSync`."""
        return self.StartSync


class MC_GearInVelocity(_Gearing):
    """Let a synchronous axis have the velocity of a leading axis times a ratio (S7-1500T; SYN-165 to SYN-174,
    SYN-420 to SYN-423).

    Inputs: those of `MC_GearIn`; `ContinuousUpdate`, take the ratio over with every call, once the axis is
    synchronous; `PositionControlled`, of this axis, whatever the leading axis has. Outputs: `StartSync`, the
    axis synchronises; `InSync`, it has the velocity of the leading axis times the ratio;
    `ContinuousUpdateActive`, and the common ones. Changes of the ratio of a synchronous axis act at once,
    without a limit. `ContinuousUpdate` that falls keeps the last ratio; it does not come back without another
    start.

    A leading object that is not interconnected or gives no valid value is alarm 601; its mode and a reversal
    do not matter.
    """

    instruction = "MC_GearInVelocity"
    inputs: ClassVar[dict[str, Any]] = {
        "Execute": False, "Master": None, "RatioNumerator": 1, "RatioDenominator": 1, **_DYNAMICS,
        "ContinuousUpdate": False, "PositionControlled": False,
    }  # fmt: skip
    ContinuousUpdate: bool
    PositionControlled: bool

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.StartSync = False
        self.InSync = False
        self.ContinuousUpdateActive = False
        super().__init__(axis, name=name, **inputs)

    def _start(self) -> Job | int:
        job = self._prepare(JobClass.GEAR_IN_VELOCITY, by_velocity=True)
        if isinstance(job, int):
            return job
        job.position_controlled = bool(self.PositionControlled)
        job.follows = {**(job.follows or {}), "updated": bool(self.ContinuousUpdate)}
        error = self.axis.motion.submit(job)
        if error:
            return error
        self.ContinuousUpdateActive = bool(self.ContinuousUpdate)
        return job

    def _clear(self) -> None:
        super()._clear()
        self.StartSync = self.InSync = self.ContinuousUpdateActive = False

    def _show(self, job: Job) -> None:
        super()._show(job)
        self.InSync = job.synchronous
        self.StartSync = job.busy and not job.synchronous
        if not (self.ContinuousUpdate and job.busy):
            self.ContinuousUpdateActive = False
        updates = self.ContinuousUpdateActive and job.synchronous and not self._wrong_ratio()
        if updates and isinstance(job.coupling, GearCoupling):
            job.coupling.change_ratio(self.RatioNumerator, self.RatioDenominator)

    def in_sync(self) -> bool:
        """Return `InSync`."""
        return self.InSync
