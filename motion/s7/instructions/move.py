"""`MC_MoveAbsolute`, `MC_MoveRelative`, `MC_MoveVelocity` (sections 2.5 to 2.7 of
the instruction specification).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Final

from motion.s7.axis.jobs import (
    ERROR_ALARM,
    ERROR_DIRECTION,
    ERROR_DISTANCE,
    ERROR_MODE,
    ERROR_POSITION,
    ERROR_VELOCITY,
    Job,
    JobClass,
    JobState,
)
from motion.s7.axis.state import ACCEPTS_MOTION
from motion.s7.compatibility import level_of
from motion.s7.instructions.base import DEFAULT, ExecuteInstruction
from motion.s7.instructions.dynamics import POSITION_LIMIT, is_number, resolve
from motion.s7.units import NANOMETRE

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

_DYNAMICS: Final = {"Acceleration": DEFAULT, "Deceleration": DEFAULT, "Jerk": DEFAULT}

_ACTIVE: Final = JobState.ACTIVE
ALARM_NOT_HOMED: Final = 321
_LEAST_NANOMETRES: Final = 1000.0
"""Shortest way of `MC_MoveRelative` on an axis with the unit nm."""


class _Positioning(ExecuteInstruction):
    """What both positioning instructions share: dynamic inputs, `BufferMode` and output `Active` (both from
    V9.0 on).
    """

    object_types = ("PositioningAxis",)
    follows_state = True
    Velocity: float
    Acceleration: float
    Deceleration: float
    Jerk: float
    BufferMode: int

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: float) -> None:
        self._shows_active = level_of(axis.cpu).has_output(self.instruction, "Active")
        if self._shows_active:
            self.Active = False
        super().__init__(axis, name=name, **inputs)

    def _prepare(self) -> Job | int:
        """Return the job with its inputs resolved, not yet handed over."""
        if self.BufferMode not in (0, 1):
            return ERROR_MODE
        job = Job(JobClass.POSITIONING, instruction=self.instruction, name=self.name)
        error = resolve(self, job, velocity=True)
        if error:
            return error
        job.append = self.BufferMode == 1
        job.position_controlled = True
        return job

    def _clear(self) -> None:
        super()._clear()
        if self._shows_active:
            self.Active = False

    def _show(self, job: Job) -> None:
        super()._show(job)
        if self._shows_active:
            self.Active = job.state is _ACTIVE


class MC_MoveAbsolute(_Positioning):
    """Move to an absolute position.

    Inputs: `Execute`; `Position`, axis unit; `Velocity`, `Acceleration`, `Deceleration`, `Jerk`
    (negative: dynamic default); `BufferMode` 0 abort, 1 append; `Direction` on modulo axes 1 positive,
    2 negative, 3 shortest way. Outputs: `Active` and the common ones. An axis that is not homed
    answers with alarm 321 (MC-246).
    """

    instruction = "MC_MoveAbsolute"
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False, "Position": 0.0, "Velocity": DEFAULT, **_DYNAMICS, "BufferMode": 0, "Direction": 1,
    }  # fmt: skip
    Position: float
    Direction: int

    def _start(self) -> Job | int:
        axis = self.axis
        if not is_number(self.Position, POSITION_LIMIT):
            return ERROR_POSITION
        direction = self.Direction if axis.modulo.enabled else 0
        if axis.modulo.enabled and direction not in (1, 2, 3):
            return ERROR_DIRECTION
        job = self._prepare()
        if isinstance(job, int):
            return job
        job.target = float(self.Position)
        job.direction = direction
        if not axis.homed and not axis.alarms.blocking and axis.state in ACCEPTS_MOTION:
            axis.alarms.raise_alarm(ALARM_NOT_HOMED)
            return ERROR_ALARM
        return axis.motion.submit(job) or job


class MC_MoveRelative(_Positioning):
    """Move by a distance from the setpoint at which the job takes control (MC-284).

    Inputs as `MC_MoveAbsolute`, with `Distance` in the axis unit instead of `Position`. An axis with the unit
    nm does not move for a distance of less than 1000.0 (MC-277).
    """

    instruction = "MC_MoveRelative"
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False, "Distance": 0.0, "Velocity": DEFAULT, **_DYNAMICS, "BufferMode": 0,
    }  # fmt: skip
    Distance: float

    def _start(self) -> Job | int:
        if not is_number(self.Distance, POSITION_LIMIT):
            return ERROR_DISTANCE
        distance = float(self.Distance)
        if abs(distance) < _LEAST_NANOMETRES and self.axis.variables.read("Units.LengthUnit") == NANOMETRE:
            distance = 0.0
        job = self._prepare()
        if isinstance(job, int):
            return job
        job.relative = True
        job.distance = distance
        return self.axis.motion.submit(job) or job


class MC_MoveVelocity(ExecuteInstruction):
    """Move with a velocity until another job takes over.

    Inputs: `Execute`; `Velocity`, velocity unit of the axis, signed; `Acceleration`, `Deceleration`, `Jerk`;
    `Direction` 0 sign of `Velocity`, 1 positive, 2 negative; `Current` keeps the present velocity;
    `PositionControlled`. Outputs: `InVelocity` and the common ones except `Done`.
    """

    instruction = "MC_MoveVelocity"
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False, "Velocity": 100.0, **_DYNAMICS, "Direction": 0, "Current": False,
        "PositionControlled": True,
    }  # fmt: skip
    Velocity: float
    Direction: int
    Current: bool
    PositionControlled: bool

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: float) -> None:
        self.InVelocity = False
        super().__init__(axis, name=name, **inputs)

    def _start(self) -> Job | int:
        if not is_number(self.Velocity):
            return ERROR_VELOCITY
        if self.Direction not in (0, 1, 2):
            return ERROR_DIRECTION
        job = Job(JobClass.VELOCITY, instruction=self.instruction, name=self.name)
        error = resolve(self, job, velocity=False)
        if error:
            return error
        velocity = float(self.Velocity) * self.axis.variables.factors.velocity
        job.velocity = (
            velocity if self.Direction == 0 else abs(velocity) if self.Direction == 1 else -abs(velocity)
        )
        job.current = bool(self.Current)
        job.position_controlled = bool(self.PositionControlled)
        return self.axis.motion.submit(job) or job

    def _clear(self) -> None:
        super()._clear()
        self.InVelocity = False

    def _show(self, job: Job) -> None:
        super()._show(job)
        self.InVelocity = job.in_velocity and job.busy

    def in_velocity(self) -> bool:
        """Return `InVelocity`."""
        return self.InVelocity
