"""`MC_GearIn`: relative gearing (section 7.1 of the specification of synchronous operation)."""

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
from motion.s7.axis.state import ACCEPTS_MOTION
from motion.s7.axis.technology_object import TechnologyObject
from motion.s7.instructions.base import DEFAULT, ExecuteInstruction
from motion.s7.instructions.dynamics import is_whole, resolve

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

ALARM_NOT_ASSIGNED: Final = 601
"""The leading object is not configured as a possible one of the axis (SYN-017)."""
ALARM_NOT_CONTROLLED: Final = 603
"""The leading axis is not position-controlled (SYN-025)."""
_LARGEST: Final = (1 << 31) - 1
_LEADING: Final = "PositioningAxis"


class MC_GearIn(ExecuteInstruction):
    """Let a synchronous axis follow a leading axis with a gear ratio, without a fixed relation of positions
    (SYN-135 to SYN-147).

    Inputs: `Master`, the leading axis, a positioning or synchronous axis that is interconnected with this
    one; `Execute`; `RatioNumerator`, not 0, below 0 for the opposite direction (16#8017);
    `RatioDenominator`, 1 or more (16#8018); `Acceleration`, `Deceleration`, `Jerk` of synchronising, axis
    unit per second squared and cubed (negative: dynamic default). Outputs: `InGear`, the axis has reached its
    leading value and follows it, and the common ones. `Done` does not exist: the job goes on until another
    one takes over.

    A leading object that is not interconnected is alarm 601, one without position control alarm 603, one that
    follows this axis itself is rejected with 16#8019.
    """

    instruction = "MC_GearIn"
    object_types = ("SynchronousAxis",)
    inputs: ClassVar[dict[str, Any]] = {
        "Execute": False, "Master": None, "RatioNumerator": 1, "RatioDenominator": 1,
        "Acceleration": DEFAULT, "Deceleration": DEFAULT, "Jerk": DEFAULT,
    }  # fmt: skip
    Master: TechnologyAxis | None
    RatioNumerator: int
    RatioDenominator: int
    Acceleration: float
    Deceleration: float
    Jerk: float

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.InGear = False
        super().__init__(axis, name=name, **inputs)

    def _start(self) -> Job | int:
        axis, leader = self.axis, self.Master
        if not isinstance(leader, TechnologyObject) or _LEADING not in leader.kinds:
            return ERROR_REFERENCE
        numerator, denominator = self.RatioNumerator, self.RatioDenominator
        if not is_whole(numerator) or numerator == 0 or not -_LARGEST - 1 <= numerator <= _LARGEST:
            return ERROR_NUMERATOR
        if not is_whole(denominator) or not 1 <= denominator <= _LARGEST:
            return ERROR_DENOMINATOR
        job = Job(JobClass.GEAR_IN, instruction=self.instruction, name=self.name)
        error = resolve(self, job, velocity=False) or self._unfit(leader)
        if error:
            return error
        job.position_controlled = True
        job.coupling = GearCoupling(LeadingMotion(leader.servo), numerator, denominator)
        return axis.motion.submit(job) or job

    def _unfit(self, leader: TechnologyAxis) -> int:
        """Return why the leading axis cannot lead this one; 0 if it can."""
        axis = self.axis
        above: TechnologyAxis | None = leader
        while above is not None:
            if above is axis:
                return ERROR_CIRCLE
            above = above.leader
        if axis.alarms.blocking or axis.state not in ACCEPTS_MOTION:
            return NO_ERROR  # `submit` says why nothing can start
        if leader not in axis.leading_objects:
            axis.alarms.raise_alarm(ALARM_NOT_ASSIGNED)
            return ERROR_ALARM
        if leader.servo.controlled and not leader.servo.position_controlled:
            axis.alarms.raise_alarm(ALARM_NOT_CONTROLLED)
            return ERROR_ALARM
        return NO_ERROR

    def _clear(self) -> None:
        super()._clear()
        self.InGear = False

    def _show(self, job: Job) -> None:
        super()._show(job)
        self.InGear = job.synchronous

    def in_gear(self) -> bool:
        """Return `InGear`."""
        return self.InGear
