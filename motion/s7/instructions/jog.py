"""`MC_MoveJog` (section 2.8 of the instruction specification)."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from motion.s7.axis.jobs import (
    ERROR_DIRECTION,
    ERROR_VELOCITY,
    NO_ERROR,
    Job,
    JobClass,
    JobState,
)
from motion.s7.instructions.base import DEFAULT, Instruction
from motion.s7.instructions.dynamics import is_number, resolve

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis


class MC_MoveJog(Instruction):
    """Move while an input is TRUE; changed inputs act at the next call.

    Inputs: `JogForward`, `JogBackward`; `Velocity` (its absolute value),
        `Acceleration`, `Deceleration`, `Jerk`;
    `PositionControlled`. Outputs: `InVelocity`, `Busy`, `CommandAborted`, `Error`, `ErrorID`.
    """

    instruction = "MC_MoveJog"
    inputs: ClassVar[dict[str, float]] = {
        "JogForward": False, "JogBackward": False, "Velocity": 100.0, "Acceleration": DEFAULT,
        "Deceleration": DEFAULT, "Jerk": DEFAULT, "PositionControlled": True,
    }  # fmt: skip
    JogForward: bool
    JogBackward: bool
    Velocity: float
    Acceleration: float
    Deceleration: float
    Jerk: float
    PositionControlled: bool

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: float) -> None:
        self.InVelocity = False
        self.CommandAborted = False
        self._job: Job | None = None
        self._latched = False
        """An error or an abort is shown until both inputs are FALSE."""
        self._inputs_fell = False
        """Both inputs were FALSE when the job ended: the next TRUE is a new command."""
        self._given: tuple[float, ...] = ()
        super().__init__(axis, name=name, **inputs)

    def _inputs(self) -> tuple[float, ...]:
        return (
            self.JogForward,
            self.JogBackward,
            self.Velocity,
            self.Acceleration,
            self.Deceleration,
            self.Jerk,
            self.PositionControlled,
        )

    def _call(self) -> None:
        wanted = self.JogForward or self.JogBackward
        if self._latched:
            if wanted and not self._inputs_fell:
                return
            self._latched = False
            self.Error = self.CommandAborted = False
            self.ErrorID = NO_ERROR
            if not wanted:
                return
        if self.JogForward and self.JogBackward:
            self._fail(ERROR_DIRECTION)
            return
        job = self._job
        if job is None:
            if wanted:
                self._start()
            else:
                self.CommandAborted = False
            return
        if job.busy:
            self._steer(job, wanted=wanted)
        if self._job is job:
            self._show(job, wanted=wanted)

    def _fill(self, job: Job) -> int:
        if not is_number(self.Velocity):
            return ERROR_VELOCITY
        error = resolve(self, job, velocity=False)
        if error:
            return error
        speed = abs(float(self.Velocity)) * self.axis.variables.factors.velocity
        job.velocity = speed if self.JogForward else -speed
        return NO_ERROR

    def _start(self) -> None:
        refused = self._refused()
        if refused:
            self._fail(refused)
            return
        job = Job(JobClass.VELOCITY, instruction=self.instruction, name=self.name)
        job.position_controlled = bool(self.PositionControlled)
        error = self._fill(job) or self.axis.motion.submit(job)
        if error:
            self._fail(error)
            return
        self._given = self._inputs()
        self._job = job
        self._show(job, wanted=True)

    def _steer(self, job: Job, *, wanted: bool) -> None:
        if not wanted:
            if not job.released:
                job.released = True
                job.set_in_velocity(False)
                self.axis.motion.replan()
            return
        given = self._inputs()
        if given != self._given or job.released:
            self._given = given
            motion = self.axis.motion
            job.position_controlled = bool(self.PositionControlled)
            error = self._fill(job) or self.axis.motion.refuses(job)
            if error:
                self._fail(error)
                return
            job.released = False
            job.set_in_velocity(False)
            motion.control_position_of(job)
            motion.replan()

    def _fail(self, error_id: int) -> None:
        """Show the error; a running jog brakes with its own deceleration (MC-329)."""
        job = self._job
        self._job = None
        if job is not None and job.busy:
            job.released = True
            job.set_in_velocity(False)
            self.axis.motion.replan()
        self.Busy = self.InVelocity = False
        self.Error = True
        self.ErrorID = error_id
        self._latched = True
        self._inputs_fell = False
        self._log_rejection(error_id)

    def _show(self, job: Job, *, wanted: bool) -> None:
        state = job.state
        self.Busy = job.busy
        self.InVelocity = job.busy and job.in_velocity
        if job.busy:
            return
        self._job = None
        if state is JobState.ERROR:
            self.Error = True
            self.ErrorID = job.error_id
        elif state is JobState.ABORTED:
            self.CommandAborted = True
        # Shown for one call, or until the inputs are reset (MC-333).
        self._latched = wanted or state is not JobState.DONE
        self._inputs_fell = not wanted

    def in_velocity(self) -> bool:
        """Return `InVelocity`."""
        return self.InVelocity
