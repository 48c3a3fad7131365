"""Cam technology object: data block, interpolated function, jobs that take several cycles, restart."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import count
from typing import TYPE_CHECKING, ClassVar, Final

from fieldbus.errors import ConfigurationError
from motion.kernel.cams import Curve, EmptyCamError, InvalidCamError, Inverse, Point, Segment, interpolate
from motion.s7.alarms import AlarmEngine
from motion.s7.axis.jobs import ERROR_ALARM, ERROR_STATE, NO_ERROR, Job, JobClass
from motion.s7.axis.state import AxisState
from motion.s7.axis.technology_object import Reset
from motion.s7.cams.arrays import PointArray, SegmentArray
from motion.s7.cams.data import CAM_TYPES, CamData
from motion.s7.compatibility import DEFAULT, level_of
from motion.s7.data._variables import UnknownVariableError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from fieldbus.history import History

ERROR_EMPTY: Final = 0x80AA
ERROR_IN_USE: Final = 0x80AB
ERROR_INVALID: Final = 0x80AC
ERROR_COPYING: Final = 0x80E7
ERROR_INTERPOLATING: Final = 0x80E8
ALARM_CONFIGURATION: Final = 101
ALARM_RESTART_REFUSED: Final = 322

_LOGGED_PIECES: Final = 200
"""Pieces up to which a function stands in the event log."""
INTERPOLATED_PER_CYCLE: Final = 500
"""Points and segments that an interpolation gets done in one application cycle (CAM-054)."""
COPIED_PER_CYCLE: Final = 1000
"""Elements that a copy gets done in one application cycle."""
SEARCHED_PER_CYCLE: Final = 1000
"""Pieces in which the search for a leading value gets done in one application cycle (CAM-062)."""

CONTROL: Final = 1 << 0
ERROR: Final = 1 << 1
RESTART_ACTIVE: Final = 1 << 2
ONLINE_START_VALUES_CHANGED: Final = 1 << 3
CAM_DATA_CHANGED: Final = 1 << 4
INTERPOLATED: Final = 1 << 5
IN_INTERPOLATION: Final = 1 << 6
COPY_ACTIVE: Final = 1 << 7


class _Work:
    """A job that takes several cycles."""

    def __init__(self, job: Job, cycles: int) -> None:
        self.job = job
        self.cycles = cycles
        """Cycles that are left."""

    def step(self) -> None:
        """Get done what fits into one cycle; the last step ends the job."""
        self.cycles -= 1


class _Interpolation(_Work):
    """The elements are those of the start of the job."""

    def __init__(self, job: Job, cam: Cam, curve: Curve, elements: int) -> None:
        super().__init__(job, 1 + elements // INTERPOLATED_PER_CYCLE)
        self._cam = cam
        self._curve = curve
        self._revision = cam.data.revision

    def step(self) -> None:
        super().step()
        if self.cycles <= 0:
            self._cam.take(self._curve)
            # What was changed meanwhile waits for the next interpolation.
            self._cam.data.changed = self._cam.data.revision != self._revision


class _Copy(_Work):
    """Elements are copied in their order, as the arrays are when their turn comes (CAM-091)."""

    def __init__(self, job: Job, data: CamData, points: _Range, segments: _Range) -> None:
        elements = points.number + segments.number
        super().__init__(job, max(1, -(-elements // COPIED_PER_CYCLE)))
        self._data = data
        self._points = points
        self._segments = segments
        self._done = 0

    def step(self) -> None:
        super().step()
        points, segments, data = self._points, self._segments, self._data
        last = min(self._done + COPIED_PER_CYCLE, points.number + segments.number)
        for number in range(self._done, last):
            if number < points.number:
                assert points.points is not None  # refused before
                data.copy_point(points.target + number, points.points[points.source + number])
            else:
                assert segments.segments is not None  # refused before
                at = number - points.number
                data.copy_segment(segments.target + at, segments.segments[segments.source + at])
        self._done = last
        if self.cycles <= 0:
            data.validate(points.targets, segments.targets)


class _Range:
    """Elements of an array and where in the cam they are copied to."""

    def __init__(
        self,
        target: int,
        number: int,
        *,
        points: tuple[PointArray, int] | None = None,
        segments: tuple[SegmentArray, int] | None = None,
    ) -> None:
        self.target = target
        self.number = number
        self.targets = range(target, target + number)
        self.points: list[Point] | None = None
        self.segments: list[Segment] | None = None
        self.source = 0
        if points is not None:
            self.points, self.source = points[0].elements, points[1] - points[0].bounds.lower
        if segments is not None:
            self.segments, self.source = segments[0].elements, segments[1] - segments[0].bounds.lower


def _text_of(curve: Curve) -> str:
    """Return the pieces of a curve for the event log, as JSON; empty: it has too many, or others than
    polynomials.
    """
    pieces = curve.coefficients() if len(curve.pieces) <= _LOGGED_PIECES else None
    return "" if pieces is None else json.dumps(pieces)


class Cam:
    """`TO_Cam` or `TO_Cam_10k`: a function that following axes follow.

    Args:
        name: Name in history and bench.
        kind: One of `CAM_TYPES`.
        points: Valid points of load memory.
        segments: Valid segments of load memory.
        variables: Start values by their original path, for example
            `{"InterpolationSettings.InterpolationMode": 2}`.
        cpu: Controller that it belongs to, one of `motion.s7.compatibility.LEVELS`.
        history: Event log, or None.

    Raises:
        ConfigurationError: The controller has no cams, there is no such type, there are too many points or
            segments, a variable does not exist, or a value is out of range.

    """

    object_type: ClassVar[str] = "Cam"
    kinds: ClassVar[tuple[str, ...]] = ("Cam",)
    """Types of technology objects as which instructions take it."""
    master: object | None = None
    """No control panel can have a cam."""

    def __init__(
        self,
        name: str,
        *,
        kind: str = "TO_Cam",
        points: Sequence[Point] = (),
        segments: Sequence[Segment] = (),
        variables: Mapping[str, object] | None = None,
        cpu: str = DEFAULT,
        history: History | None = None,
    ) -> None:
        if not level_of(cpu).technology:
            raise ConfigurationError(f"cam {name}", cpu, f"cpu {DEFAULT}: only a technology CPU has cams")
        if kind not in CAM_TYPES:
            raise ConfigurationError(f"cam {name}: kind", kind, ", ".join(CAM_TYPES))
        self.name = name
        self.cpu = cpu
        self.history = history
        self.db_number = 0
        """Number of the data block; 0 before a runtime has the cam."""
        self.data = CamData(CAM_TYPES[kind], name=name, history=history)
        """Points, segments and settings."""
        self.engine = AlarmEngine(name, object_type=self.object_type, history=history)
        """Pending alarms."""
        self.curve: Curve | None = None
        """The function of the last interpolation; None: it has not been interpolated (`StatusWord.X5`)."""
        self._inverse: Inverse | None = None
        self._users: list[object] = []
        self._works: list[_Work] = []
        self._resets: list[Reset] = []
        self._restarting = False
        self._instances: dict[str, Iterator[int]] = {}
        self.data.load(list(points), list(segments))
        self.data.configure(variables or {})
        self.data.restart()

    def instance_name(self, instruction: str) -> str:
        """Return the name of one more instance of an instruction: `profile.MC_InterpolateCam_1`."""
        numbers = self._instances.setdefault(instruction, count(1))
        return f"{self.name}.{instruction}_{next(numbers)}"

    # -- use by following axes

    def use(self, user: object) -> None:
        """Take note that a following axis uses the cam (`StatusWord.X0`), from the start of its job on."""
        if user not in self._users:
            self._users.append(user)

    def release_use(self, user: object) -> None:
        """Take note that a following axis uses the cam no longer."""
        if user in self._users:
            self._users.remove(user)

    @property
    def in_use(self) -> bool:
        """Whether a following axis uses it."""
        return bool(self._users)

    @property
    def inverse(self) -> Inverse | None:
        """The leading values of following values; None: it has not been interpolated."""
        if self._inverse is None and self.curve is not None:
            self._inverse = Inverse(self.curve)
        return self._inverse

    def take(self, curve: Curve) -> None:
        """Let a curve be the function from now on; who uses the former one keeps it."""
        self.curve = curve
        self._inverse = None
        if self.history is not None:
            self.history.emit(
                self.name, "cam.interpolated", start=curve.start, end=curve.end, function=_text_of(curve)
            )

    # -- jobs

    def refuses(self) -> int:
        """Return why the cam takes no job at all: being initialised, or an alarm; 0: it takes them."""
        if self._restarting:
            return ERROR_STATE
        return ERROR_ALARM if self.engine.reaction else NO_ERROR

    def start_job(self, instruction: str, name: str) -> Job:
        """Return a job that runs."""
        job = Job(JobClass.NONE, instruction=instruction, name=name)
        job.start(self.name, self.history)
        job.activate()
        return job

    def interpolate(self, instruction: str, name: str) -> Job | int:
        """Start an interpolation; returns the job, or an ErrorID."""
        if self.in_use:
            return ERROR_IN_USE
        running = self._running()
        if running:
            return running
        points, segments = self.data.points, self.data.segments
        try:
            curve = interpolate(points, segments, self.data.mode, self.data.boundary)
        except EmptyCamError:
            return ERROR_EMPTY
        except InvalidCamError:
            return ERROR_INVALID
        job = self.start_job(instruction, name)
        self._works.append(_Interpolation(job, self, curve, len(points) + len(segments)))
        return job

    def copy(
        self,
        instruction: str,
        name: str,
        *,
        keep: bool,
        points: tuple[PointArray, int] | None,
        segments: tuple[SegmentArray, int] | None,
        targets: tuple[int, int],
        numbers: tuple[int, int],
    ) -> Job | int:
        """Start to copy elements of arrays; returns the job, or an ErrorID.

        Args:
            instruction: Name of the instruction.
            name: Name of its instance.
            keep: Elements that are valid stay valid.
            points: Array of points and index of the first one in it.
            segments: Array of segments and index of the first one in it.
            targets: Indexes in the cam of the first point and the first segment.
            numbers: How many points and segments.

        """
        running = self._running()
        if running:
            return running
        if not keep:
            self.data.invalidate()
        job = self.start_job(instruction, name)
        self._works.append(
            _Copy(
                job,
                self.data,
                _Range(targets[0], numbers[0], points=points),
                _Range(targets[1], numbers[1], segments=segments),
            )
        )
        return job

    def calculate(self, instruction: str, name: str, pieces: int) -> Job:
        """Start a calculation that takes the time of a search in some pieces, one cycle or more."""
        job = self.start_job(instruction, name)
        self._works.append(_Work(job, 1 + pieces // SEARCHED_PER_CYCLE))
        return job

    def _running(self) -> int:
        """Return the ErrorID of a job that excludes another interpolation or copy."""
        if self.copying:
            return ERROR_COPYING
        return ERROR_INTERPOLATING if self.interpolating else NO_ERROR

    @property
    def interpolating(self) -> bool:
        """Whether an interpolation runs (`StatusWord.X6`)."""
        return any(isinstance(work, _Interpolation) for work in self._works)

    @property
    def copying(self) -> bool:
        """Whether a copy runs (`StatusWord.X7`)."""
        return any(isinstance(work, _Copy) for work in self._works)

    def cycle(self) -> None:
        """Run one application cycle."""
        if self._works:
            for work in self._works:
                work.step()
            ended = [work for work in self._works if work.cycles <= 0]
            self._works = [work for work in self._works if work.cycles > 0]
            for work in ended:
                work.job.finish()
        if self._resets:
            for reset in self._resets:
                reset.step()
            self._resets = [reset for reset in self._resets if not reset.done]

    # -- variables under their original paths

    @property
    def status_word(self) -> int:
        """`StatusWord` (CAM-014)."""
        word = CONTROL if self.in_use else 0
        if self.engine.error_word:
            word |= ERROR
        if self._restarting:
            word |= RESTART_ACTIVE
        if self.data.online_start_values_changed:
            word |= ONLINE_START_VALUES_CHANGED
        if self.data.changed:
            word |= CAM_DATA_CHANGED
        if self.curve is not None:
            word |= INTERPOLATED
        if self.interpolating:
            word |= IN_INTERPOLATION
        if self.copying:
            word |= COPY_ACTIVE
        return word

    def var(self, path: str) -> float:
        """Return a variable of the technology data block by its original path; bits as `StatusWord.X5`.

        Raises:
            UnknownVariableError: There is no such variable.

        """
        word, _, bit = path.rpartition(".")
        bit = bit.lstrip("%")
        if word in ("StatusWord", "ErrorWord", "WarningWord") and bit[:1] == "X" and bit[1:].isdigit():
            number = int(bit[1:])
            if number > 31:
                raise UnknownVariableError(f"{path}: {word} has no bit {number}")
            return bool(int(self.var(word)) >> number & 1)
        status = self._status(path)
        return self.data.read(path) if status is None else status

    def _status(self, path: str) -> float | None:
        curve, engine = self.curve, self.engine
        return {
            "StatusCam.StartLeadingValue": lambda: 0.0 if curve is None else curve.start,
            "StatusCam.EndLeadingValue": lambda: 0.0 if curve is None else curve.end,
            "StatusCam.NumberOfValidPoints": lambda: self.data.valid_points,
            "StatusCam.NumberOfValidSegments": lambda: self.data.valid_segments,
            "StatusWord": lambda: self.status_word,
            "ErrorWord": lambda: engine.error_word,
            "WarningWord": lambda: engine.warning_word,
            "ErrorDetail.Number": lambda: engine.number,
            "ErrorDetail.Reaction": lambda: engine.reaction,
        }.get(path, lambda: None)()

    def write(self, path: str, value: float) -> None:
        """Assign a point, a segment or a setting as the user program does; it acts with the next
        interpolation.

        Raises:
            UnknownVariableError: There is no such variable.
            VariableAccessError: It is read only.
            VariableError: The value has the wrong type.

        """
        self.data.write(path, value)

    # -- acknowledging, restart, operating states of the controller

    @property
    def state(self) -> AxisState:
        """`RESTARTING` while it is being initialised, otherwise `DISABLED`: a cam is not enabled."""
        return AxisState.RESTARTING if self._restarting else AxisState.DISABLED

    @property
    def restart_refused(self) -> bool:
        """Whether a restart is not possible now, because the cam is in use (SYN-464)."""
        return self.in_use

    def refuse_restart(self) -> None:
        """Warn that a restart was asked for that is not possible now."""
        self.engine.raise_alarm(ALARM_RESTART_REFUSED)

    def make_reset(self, *, restart: bool) -> Reset:
        """Return an execution of `MC_Reset`; the cycle carries it out."""
        reset = Reset(self, restart=restart)
        self._resets.append(reset)
        return reset

    def begin_restart(self) -> None:
        """Begin to be initialised: jobs end with 16#800D."""
        self._end_jobs()
        self._restarting = True

    def finish_restart(self) -> None:
        """Put the start values into force, or raise alarm 101."""
        self._initialise()
        self._restarting = False

    def acknowledge(self, age: int) -> bool:
        """Acknowledge the alarms, in the first cycle of the instruction."""
        del age
        self.engine.acknowledge()
        return True

    def _initialise(self) -> None:
        problems = self.data.violations()
        self.engine.restart()
        self.curve = self._inverse = None
        if problems:
            more = f"; and {len(problems) - 3} more" if len(problems) > 3 else ""
            self.engine.raise_alarm(ALARM_CONFIGURATION, text="; ".join(problems[:3]) + more)
        else:
            self.data.restart()

    def _end_jobs(self) -> None:
        works, self._works = self._works, []
        for work in works:
            work.job.fail(ERROR_STATE)

    @property
    def variables(self) -> CamData:
        """Points, segments and settings."""
        return self.data

    @property
    def resting(self) -> bool:
        """Whether nothing is under way that the controller has to wait for."""
        return not self._resets

    def disable(self) -> None:
        """End all jobs, since the controller goes to STOP; data and function stay."""
        self._end_jobs()

    def hold_back(self) -> None:
        """Refuse jobs with 16#800D until `release`."""
        self._restarting = True

    def release(self) -> None:
        """End an initialisation: from now on the cam takes jobs."""
        self._restarting = False

    def power_down(self) -> None:
        """Lose everything that is not retentive; it is not interpolated any longer (CAM-026)."""
        self._end_jobs()
        self._resets = []
        self._users = []
        self._restarting = False
        self.engine.power_down()
        self._initialise()

    def download(self, values: Mapping[str, object]) -> None:
        """Load start values and initialise the cam with them; it is not interpolated any longer (CAM-026).

        Raises:
            ConfigurationError: A variable does not exist, or its value is out of range; then nothing has
                changed.

        """
        self.data.configure(values)
        self._end_jobs()
        self._initialise()

    def switch_outputs(self, on: bool) -> None:
        """Do nothing: it has no outputs."""

    def forget_adjustment(self, *, only_incremental: bool = False) -> None:
        """Do nothing: it has no encoders."""

    def forget_encoders(self) -> None:
        """Do nothing: it has no encoders."""
