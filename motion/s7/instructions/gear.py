"""`MC_GearIn` and `MC_GearInVelocity`: relative and velocity gearing (sections 7.1 and 7.3 of the
specification of synchronous operation).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Final

from motion.kernel.synchronous import GearCoupling, LeadingMotion
from motion.s7.axis.jobs import (
    ERROR_ALARM,
    ERROR_CIRCLE,
    ERROR_DENOMINATOR,
    ERROR_NUMERATOR,
    ERROR_REFERENCE,
    NO_ERROR,
    Job,
    JobClass,
)
from motion.s7.axis.motion import ALARM_LEADING_VALUE
from motion.s7.axis.state import ACCEPTS_MOTION
from motion.s7.axis.technology_object import ACTUAL, TechnologyObject
from motion.s7.instructions.base import DEFAULT, ExecuteInstruction
from motion.s7.instructions.dynamics import is_whole, resolve

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

ALARM_NOT_CONTROLLED: Final = 603
"""The leading axis is not position-controlled (SYN-025)."""
_LARGEST: Final = (1 << 31) - 1
_LEADING: Final = frozenset(("PositioningAxis", "ExternalEncoder"))


_DYNAMICS: Final = {"Acceleration": DEFAULT, "Deceleration": DEFAULT, "Jerk": DEFAULT}


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

    def _prepare(self, job_class: JobClass, *, by_velocity: bool) -> Job | int:
        """Return the job with its coupling, not yet handed over; or the ErrorID of what is not permitted."""
        leader = self.Master
        if not isinstance(leader, TechnologyObject) or _LEADING.isdisjoint(leader.kinds):
            return ERROR_REFERENCE
        job = Job(job_class, instruction=self.instruction, name=self.name)
        error = self._wrong_ratio() or resolve(self, job, velocity=False) or self._unfit(leader, by_velocity)
        if error:
            return error
        job.coupling = GearCoupling(
            LeadingMotion(leader.leading_by(self.axis.coupling_with(leader)), leader.gives_value),
            self.RatioNumerator,
            self.RatioDenominator,
            by_velocity=by_velocity,
        )
        job.leader_number = leader.db_number
        return job

    def _unfit(self, leader: TechnologyObject, by_velocity: bool) -> int:
        """Return why the leading object cannot lead this axis; 0 if it can."""
        axis = self.axis
        above: TechnologyObject | None = leader
        while above is not None:
            if above is axis:
                return ERROR_CIRCLE
            above = above.leader
        if axis.alarms.blocking or axis.state not in ACCEPTS_MOTION:
            return NO_ERROR  # `submit` says why nothing can start
        if leader not in axis.leading_objects or not leader.gives_value():
            axis.alarms.raise_alarm(ALARM_LEADING_VALUE)
            return ERROR_ALARM
        by_position = axis.coupling_with(leader) != ACTUAL and not by_velocity
        if by_position and leader.leads_without_position_control:
            axis.alarms.raise_alarm(ALARM_NOT_CONTROLLED)
            return ERROR_ALARM
        return NO_ERROR


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
        if updates and job.coupling is not None:
            job.coupling.change_ratio(self.RatioNumerator, self.RatioDenominator)

    def in_sync(self) -> bool:
        """Return `InSync`."""
        return self.InSync
