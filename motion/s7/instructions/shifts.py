"""`MC_PhasingAbsolute`, `MC_PhasingRelative`, `MC_OffsetAbsolute`, `MC_OffsetRelative`: shifts of the leading
and of the following value of a synchronous job (sections 7.4 and 7.5 of the specification of synchronous
operation).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Final

from motion.kernel.synchronous import FunctionCoupling, Shift, ShiftOverDistance, ShiftWithDynamics
from motion.s7.axis.jobs import (
    ERROR_CAMMING,
    ERROR_DIRECTION,
    ERROR_NO_SYNCHRONOUS,
    ERROR_NOT_SYNCHRONOUS,
    ERROR_OFFSET,
    ERROR_OFFSET_DISTANCE,
    ERROR_OTHER_SHIFT,
    ERROR_PHASE_SHIFT,
    ERROR_PHASING_DISTANCE,
    ERROR_PROFILE,
    ERROR_REFERENCE,
    ERROR_SIMULATED,
    ERROR_START_POSITION,
    ERROR_STATE,
    ERROR_VELOCITY_GEARING,
    NO_ERROR,
    Job,
    JobClass,
    JobState,
)
from motion.s7.axis.state import AxisState
from motion.s7.instructions.base import DEFAULT, ExecuteInstruction
from motion.s7.instructions.dynamics import is_number, is_whole, resolve

if TYPE_CHECKING:
    from motion.kernel.synchronous import Shifting
    from motion.s7.axis.axis import TechnologyAxis
    from motion.s7.axis.technology_object import TechnologyObject

_DYNAMICS: Final = 0
_AT_POSITION: Final = 2
_CANCEL: Final = 5
_DIRECTIONS: Final = (1, 2, 3)


def _slave_offset(sync: Job) -> float:
    """Return what `MC_CamIn` has given as `SlaveOffset`: absolute offsets contain it (SYN-195, SYN-429)."""
    coupling = sync.coupling
    return coupling.shown_offsets[1] if sync.cam_number and isinstance(coupling, FunctionCoupling) else 0.0


class _ShiftInstruction(ExecuteInstruction):
    """What the four share: the synchronous job that they need, the way of the leading value, the outputs."""

    object_types = ("SynchronousAxis",)
    profiles: ClassVar[tuple[int, ...]] = ()
    """Values of `ProfileReference` that there are."""
    phasing: ClassVar[bool]
    relative: ClassVar[bool]
    ProfileReference: int
    StartPosition: float
    Direction: int

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self._shift: Shift | None = None
        self._begin_value = 0.0
        self._base = 0.0
        super().__init__(axis, name=name, **inputs)

    def _amount(self) -> float:
        """Return the input that says how far it is shifted."""
        raise NotImplementedError

    def _distance(self) -> float:
        """Return the input with the way of the leading value."""
        raise NotImplementedError

    def _unfit(self) -> int:
        """Return why no value of the axis can be shifted now; 0 if one can."""
        motion = self.axis.motion
        if self.axis.state is AxisState.RESTARTING:
            return ERROR_STATE
        if motion.simulated is not None:
            return ERROR_SIMULATED
        sync = motion.synchronous_job
        if sync is None:
            return ERROR_NO_SYNCHRONOUS
        if sync.job_class is JobClass.GEAR_IN_VELOCITY:
            return ERROR_VELOCITY_GEARING
        if not sync.synchronous:
            return ERROR_NOT_SYNCHRONOUS
        shifts = motion.shifts
        return ERROR_OTHER_SHIFT if shifts.job is not None and shifts.phases is not self.phasing else NO_ERROR

    def _wrong_value(self) -> int:
        """Return the ErrorID of an input that is not permitted; those that the profile does not use are not
        looked at (SYN-133).
        """
        profile = self.ProfileReference
        if not is_whole(profile) or profile not in self.profiles:
            return ERROR_PROFILE
        if profile == _CANCEL:
            return NO_ERROR
        if not is_number(self._amount()):
            return ERROR_PHASE_SHIFT if self.phasing else ERROR_OFFSET
        if profile == _DYNAMICS:
            return NO_ERROR
        if not is_number(self._distance()) or self._distance() <= 0.0:
            return ERROR_PHASING_DISTANCE if self.phasing else ERROR_OFFSET_DISTANCE
        if profile == _AT_POSITION and not is_number(self.StartPosition):
            return ERROR_START_POSITION
        return NO_ERROR if is_whole(self.Direction) and self.Direction in _DIRECTIONS else ERROR_DIRECTION

    def _start(self) -> Job | int:
        error = self._unfit() or self._wrong_value()
        if error:
            return error
        motion = self.axis.motion
        job = Job(JobClass.NONE, instruction=self.instruction, name=self.name)
        if self.ProfileReference == _CANCEL:
            motion.shifts.cancel(job, phasing=self.phasing)
            return job
        sync = motion.synchronous_job
        assert sync is not None  # `_unfit` has looked
        shift = self._shift_of(sync)
        begin, amount = shift.value, float(self._amount())
        self._base = 0.0 if self.phasing or self.relative else _slave_offset(sync)
        target = begin + amount if self.relative else amount - self._base
        way: Shifting | None = None
        if self.ProfileReference == _DYNAMICS:
            planned = self._with_dynamics(job, sync, shift, target)
            if isinstance(planned, int):
                return planned
            way = planned
        elif target != begin:
            leader = self.axis.leader
            assert leader is not None  # every synchronous job has one
            modulo = leader.leading_modulo
            way = ShiftOverDistance(
                begin,
                target,
                distance=float(self._distance()),
                direction=self.Direction,
                start=float(self.StartPosition) if self.ProfileReference == _AT_POSITION else None,
                modulo=modulo.length if modulo.enabled else 0.0,
            )
        self._shift, self._begin_value = shift, begin
        motion.shifts.submit(job, shift, None if target == begin else way)
        return job

    def _shift_of(self, sync: Job) -> Shift:
        """Return the shift of the synchronous job that this instruction moves; makes it at its first use."""
        coupling = sync.coupling
        assert coupling is not None  # every synchronous job has one
        if self.phasing:
            if coupling.leading.phase is None:
                coupling.leading.phase = Shift()
            return coupling.leading.phase
        if sync.offset is None:
            sync.offset = Shift()
        return sync.offset

    def _with_dynamics(self, job: Job, sync: Job, shift: Shift, target: float) -> ShiftWithDynamics | int:
        raise NotImplementedError

    def _clear(self) -> None:
        super()._clear()
        self._shift = None

    def _covered(self) -> float:
        """Return how far the value is shifted: in total, or since the start of this job."""
        shift = self._shift
        if shift is None:
            return 0.0
        return shift.value - self._begin_value if self.relative else shift.value + self._base

    def _show(self, job: Job) -> None:
        super()._show(job)
        self._show_shift(job.state is JobState.ACTIVE)
        if not job.busy:
            self._shift = None  # what comes later is the work of others

    def _show_shift(self, started: bool) -> None:
        raise NotImplementedError


_SHARED: Final[dict[str, Any]] = {"StartPosition": 0.0, "Direction": 3}


class _Phasing(_ShiftInstruction):
    phasing = True
    profiles = (0, 1, 2, 5)
    inputs: ClassVar[dict[str, Any]] = {
        "Execute": False, "Master": None, "PhaseShift": 0.0, "Velocity": DEFAULT, "Acceleration": DEFAULT,
        "Deceleration": DEFAULT, "Jerk": DEFAULT, "ProfileReference": 0, "PhasingDistance": 0.0, **_SHARED,
    }  # fmt: skip
    Master: TechnologyObject | None
    PhaseShift: float
    PhasingDistance: float
    Velocity: float
    Acceleration: float
    Deceleration: float
    Jerk: float

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.StartPhasing = False
        super().__init__(axis, name=name, **inputs)

    def _amount(self) -> float:
        return self.PhaseShift

    def _distance(self) -> float:
        return self.PhasingDistance

    def _unfit(self) -> int:
        error = super()._unfit()
        return error or (NO_ERROR if self.Master is self.axis.leader else ERROR_REFERENCE)

    def _with_dynamics(self, job: Job, sync: Job, shift: Shift, target: float) -> ShiftWithDynamics | int:
        coupling = sync.coupling
        assert coupling is not None  # every synchronous job has one
        if sync.cam_number:
            return ERROR_CAMMING
        error = resolve(self, job, velocity=True)
        if error:
            return error
        acceleration, deceleration, jerk = self.axis.motion.limits_of(job)
        return ShiftWithDynamics(
            shift.value,
            target,
            ratio=coupling.slope,
            present=(shift.velocity, shift.acceleration),
            velocity=job.velocity,
            acceleration=acceleration,
            deceleration=deceleration,
            jerk=jerk,
            cycle_s=self.axis.servo.interpolator_s,
        )

    def _clear(self) -> None:
        super()._clear()
        self.StartPhasing = False

    def start_phasing(self) -> bool:
        """Return `StartPhasing`."""
        return self.StartPhasing


class MC_PhasingAbsolute(_Phasing):
    """Shift the leading value that a synchronous axis sees to `PhaseShift` (S7-1500T; SYN-175 to SYN-189,
    SYN-424 to SYN-428).

    Inputs: `Execute`; `Master`, the leading object of the synchronous job; `PhaseShift`, unit of the leading
    object (16#8070); `ProfileReference` 0 with `Velocity`, `Acceleration`, `Deceleration`, `Jerk` of the
    following axis, which are added to its motion, gearing only; 1 over `PhasingDistance` of the leading
    value, above 0 (16#8082); 2 the same from `StartPosition` on; 5 cancels what waits (16#8083 otherwise);
    `Direction` 1 positive, 2 negative, 3 any. Outputs: `StartPhasing`, `AbsolutePhaseShift`, and the common
    ones.

    It needs gearing or camming in state synchronous: 16#8075 without a synchronous job, 16#80A9 before it is
    synchronous, 16#8079 with `MC_GearInVelocity`, 16#808A while an offset is moved. A leading value that
    turns round on the way is 16#808C; the shift stays where it is.
    """

    instruction = "MC_PhasingAbsolute"
    relative = False

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.AbsolutePhaseShift = 0.0
        super().__init__(axis, name=name, **inputs)

    def _show_shift(self, started: bool) -> None:
        self.StartPhasing = started
        if self._shift is not None:
            self.AbsolutePhaseShift = self._covered()


class MC_PhasingRelative(_Phasing):
    """Shift the leading value that a synchronous axis sees by `PhaseShift` (S7-1500T); inputs, outputs and
    rejections as of `MC_PhasingAbsolute`, with `CoveredPhaseShift` of this job.
    """

    instruction = "MC_PhasingRelative"
    relative = True

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.CoveredPhaseShift = 0.0
        super().__init__(axis, name=name, **inputs)

    def _show_shift(self, started: bool) -> None:
        self.StartPhasing = started
        if self._shift is not None:
            self.CoveredPhaseShift = self._covered()


class _Offset(_ShiftInstruction):
    phasing = False
    profiles = (1, 2, 5)
    inputs: ClassVar[dict[str, Any]] = {
        "Execute": False, "Offset": 0.0, "ProfileReference": 1, "OffsetDistance": 0.0, **_SHARED,
    }  # fmt: skip
    Offset: float
    OffsetDistance: float

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.StartOffset = False
        super().__init__(axis, name=name, **inputs)

    def _amount(self) -> float:
        return self.Offset

    def _distance(self) -> float:
        return self.OffsetDistance

    def _clear(self) -> None:
        super()._clear()
        self.StartOffset = False

    def start_offset(self) -> bool:
        """Return `StartOffset`."""
        return self.StartOffset


class MC_OffsetAbsolute(_Offset):
    """Shift the following value of a synchronous axis to `Offset` (S7-1500T; SYN-190 to SYN-196, SYN-429 to
    SYN-433).

    Inputs: `Execute`; `Offset`, axis unit (16#8080); `ProfileReference` 1 over `OffsetDistance` of the
    effective leading value, above 0 (16#8081); 2 the same from `StartPosition` on; 5 cancels what waits
    (16#8083 otherwise); `Direction` 1 positive, 2 negative, 3 any. Outputs: `StartOffset`, `AbsoluteOffset`,
    and the common ones. Rejections as of `MC_PhasingAbsolute`; 16#808A while a phase is shifted.
    """

    instruction = "MC_OffsetAbsolute"
    relative = False

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.AbsoluteOffset = 0.0
        super().__init__(axis, name=name, **inputs)

    def _show_shift(self, started: bool) -> None:
        self.StartOffset = started
        if self._shift is not None:
            self.AbsoluteOffset = self._covered()


class MC_OffsetRelative(_Offset):
    """Shift the following value of a synchronous axis by `Offset` (S7-1500T); inputs, outputs and rejections
    as of `MC_OffsetAbsolute`, with `CoveredOffset` of this job.
    """

    instruction = "MC_OffsetRelative"
    relative = True

    def __init__(self, axis: TechnologyAxis, *, name: str | None = None, **inputs: Any) -> None:
        self.CoveredOffset = 0.0
        super().__init__(axis, name=name, **inputs)

    def _show_shift(self, started: bool) -> None:
        self.StartOffset = started
        if self._shift is not None:
            self.CoveredOffset = self._covered()
