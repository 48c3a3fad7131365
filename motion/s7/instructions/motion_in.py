"""`MC_MotionInVelocity`, `MC_MotionInPosition`, `MC_MotionInSuperimposed` (section 2.16 of the instruction
specification, §5.14).

The user program gives the setpoints itself, one vector per application cycle; the axis forms no profile and
applies no dynamic limit. A vector that a call hands over acts in the next cycle of the axis, and continues to
act until another one comes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from motion.s7.axis.jobs import (
    ERROR_ACCELERATION,
    ERROR_DISTANCE,
    ERROR_POSITION,
    ERROR_VELOCITY,
    NO_ERROR,
    Job,
    JobClass,
    JobState,
)
from motion.s7.instructions.base import Instruction
from motion.s7.instructions.dynamics import POSITION_LIMIT, is_number

if TYPE_CHECKING:
    from motion.s7.axis.axis import TechnologyAxis

VELOCITY_MODE = 1
"""`StatusMotionIn.FunctionState` of `MC_MotionInVelocity` (MIN-011)."""
POSITION_MODE = 2
"""`StatusMotionIn.FunctionState` of `MC_MotionInPosition`."""


class _MotionIn(Instruction):
    """Started by a rising edge of `Enable`; takes a vector with every call while it is TRUE (MC-034, MC-082
    to MC-085).

    Raises:
        ConfigurationError: The axis belongs to an S7-1500, which has no such instruction (CFG-062).

    """

    job_class: ClassVar[JobClass] = JobClass.MOTION_IN
    numbers: ClassVar[dict[str, int]] = {}
    """Inputs of the vector, with the ErrorID of one that is not permitted."""
    Enable: bool

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: float) -> None:
        self.CommandAborted = False
        self._job: Job | None = None
        self._last_enable = False
        super().__init__(axis, name=name, **inputs)

    def _vector(self, job: Job) -> int:
        """Put the inputs into `job`; returns the ErrorID of one that is not
        permitted, and changes nothing then.
        """
        for name, error in self.numbers.items():
            if not is_number(getattr(self, name), POSITION_LIMIT):
                return error
        self._fill(job)
        return NO_ERROR

    def _fill(self, job: Job) -> None:
        """Put the inputs into `job`."""
        raise NotImplementedError

    def _submit(self, job: Job) -> int:
        return self.axis.motion.submit(job)

    def _call(self) -> None:
        enable = bool(self.Enable)
        rising = enable and not self._last_enable
        self._last_enable = enable
        if rising:
            self._start()
        job = self._job
        if job is not None:
            if job.busy and not enable:
                self.axis.motion.end_motion_in(job)
            elif job.busy and not rising:
                error = self._vector(job)
                if error:
                    self.axis.motion.end_motion_in(job, error)
            self._show(job)
        if not enable:
            self.CommandAborted = self.Error = False
            self.ErrorID = NO_ERROR
            self._job = None

    def _start(self) -> None:
        self.CommandAborted = self.Error = False
        self.ErrorID = NO_ERROR
        axis = self.axis
        job = Job(self.job_class, instruction=self.instruction, name=self.name)
        error = self._refused()
        if not error:
            # What the software limit switches and the alarm reaction with the dynamics of the job reckon
            # with.
            job.deceleration = axis.variables.bind("DynamicDefaults.Deceleration").value
            job.jerk = axis.variables.bind("DynamicDefaults.Jerk").value
            error = self._vector(job) or self._submit(job)
        if error == NO_ERROR:
            self._job = job
            return
        self._job = None
        self.Busy = False
        self.Error = True
        self.ErrorID = error
        self._log_rejection(error)

    def _show(self, job: Job) -> None:
        self.Busy = job.busy
        self.CommandAborted = job.state is JobState.ABORTED
        if job.state is JobState.ERROR:
            self.Error = True
            self.ErrorID = job.error_id

    def aborted(self) -> bool:
        """Return `CommandAborted`."""
        return self.CommandAborted


class MC_MotionInVelocity(_MotionIn):
    """Give velocity setpoints cycle by cycle (MC-481 to MC-490).

    Inputs: `Enable`; `Velocity`, velocity unit of the axis; `Acceleration`, axis unit per second squared,
    from which a job that takes over starts; `PositionControlled`. When `Enable` falls both setpoints are 0.0
    at once.
    """

    instruction = "MC_MotionInVelocity"
    inputs: ClassVar[dict[str, float]] = {
        "Enable": False, "Velocity": 0.0, "Acceleration": 0.0, "PositionControlled": True,
    }  # fmt: skip
    numbers: ClassVar[dict[str, int]] = {"Velocity": ERROR_VELOCITY, "Acceleration": ERROR_ACCELERATION}
    Velocity: float
    Acceleration: float
    PositionControlled: bool

    def _fill(self, job: Job) -> None:
        job.mode = VELOCITY_MODE
        factors = self.axis.variables.factors
        job.velocity = float(self.Velocity) * factors.velocity
        job.acceleration = float(self.Acceleration) * factors.acceleration
        job.position_controlled = bool(self.PositionControlled)


class MC_MotionInPosition(_MotionIn):
    """Give position setpoints cycle by cycle, with the velocity and acceleration that belong to them (MC-491
    to MC-500).

    Inputs: `Enable`; `Position`, axis unit, on a modulo axis a place in its range that is reached on the
    shortest way; `Velocity`, velocity unit of the axis, which is precontrolled as it is given;
    `Acceleration`, axis unit per second squared. When `Enable` falls, velocity and acceleration are 0.0 at
    once and the position stays.
    """

    instruction = "MC_MotionInPosition"
    object_types = ("PositioningAxis",)
    inputs: ClassVar[dict[str, float]] = {
        "Enable": False, "Position": 0.0, "Velocity": 0.0, "Acceleration": 0.0,
    }  # fmt: skip
    numbers: ClassVar[dict[str, int]] = {
        "Position": ERROR_POSITION, "Velocity": ERROR_VELOCITY, "Acceleration": ERROR_ACCELERATION,
    }  # fmt: skip
    Position: float
    Velocity: float
    Acceleration: float

    def _fill(self, job: Job) -> None:
        job.mode = POSITION_MODE
        job.target = float(self.Position)
        factors = self.axis.variables.factors
        job.velocity = float(self.Velocity) * factors.velocity
        job.acceleration = float(self.Acceleration) * factors.acceleration
        job.position_controlled = True


class MC_MotionInSuperimposed(_MotionIn):
    """Give a distance on top of the basic motion cycle by cycle (MC-501 to MC-511).

    Inputs: `Enable`; `Distance`, axis unit, signed, counted from where the instance has taken over;
    `VelocityDiff`, velocity unit of the axis; `AccelerationDiff`, axis unit per second squared, from which
    `MC_HaltSuperimposed` starts. When `Enable` falls the distance stays. The axis has to be
    position-controlled (16#8071).
    """

    instruction = "MC_MotionInSuperimposed"
    object_types = ("PositioningAxis",)
    job_class = JobClass.SUPERIMPOSED
    inputs: ClassVar[dict[str, float]] = {
        "Enable": False, "Distance": 0.0, "VelocityDiff": 0.0, "AccelerationDiff": 0.0,
    }  # fmt: skip
    numbers: ClassVar[dict[str, int]] = {
        "Distance": ERROR_DISTANCE, "VelocityDiff": ERROR_VELOCITY, "AccelerationDiff": ERROR_ACCELERATION,
    }  # fmt: skip
    Distance: float
    VelocityDiff: float
    AccelerationDiff: float

    def _fill(self, job: Job) -> None:
        job.distance = float(self.Distance)
        factors = self.axis.variables.factors
        job.velocity = float(self.VelocityDiff) * factors.velocity
        job.acceleration = float(self.AccelerationDiff) * factors.acceleration

    def _submit(self, job: Job) -> int:
        return self.axis.motion.submit_superimposed(job)
