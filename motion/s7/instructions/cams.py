"""Instructions of cams: `MC_InterpolateCam`, `MC_GetCamLeadingValue`, `MC_GetCamFollowingValue`,
`MC_GetCamFollowingValueCyclic`, `MC_CopyCamData` (CAM sections 13.2 to 13.5).

No other job aborts their jobs, and they abort none.
"""

from __future__ import annotations

from typing import Any, ClassVar, Final

from typing_extensions import override

from motion.kernel.cams import NEAREST, NEGATIVE, POSITIVE, ScaledCurve
from motion.s7.axis.jobs import (
    ERROR_MASTER_OFFSET,
    ERROR_MASTER_SCALING,
    ERROR_MODE,
    ERROR_SLAVE_OFFSET,
    ERROR_SLAVE_SCALING,
    NO_ERROR,
    Job,
    JobState,
)
from motion.s7.cams import Cam, PointArray, SegmentArray
from motion.s7.instructions.base import ExecuteInstruction, Instruction
from motion.s7.instructions.dynamics import is_number, is_whole

ERROR_APPROACH_VALUE: Final = 0x8062
ERROR_NO_LEADING_VALUE: Final = 0x8063
ERROR_NO_FOLLOWING_VALUE: Final = 0x8064
ERROR_APPROACH_DIRECTION: Final = 0x8065
ERROR_END_REACHED: Final = 0x8066
ERROR_START_POINT_CAM: Final = 0x80E1
ERROR_START_SEGMENT_CAM: Final = 0x80E2
ERROR_START_POINT_ARRAY: Final = 0x80E3
ERROR_START_SEGMENT_ARRAY: Final = 0x80E4
ERROR_NUMBER_OF_POINTS: Final = 0x80E5
ERROR_NUMBER_OF_SEGMENTS: Final = 0x80E6
ERROR_ARRAY_OF_POINTS: Final = 0x80E9
ERROR_ARRAY_OF_SEGMENTS: Final = 0x80EA

_SCALING: Final = {"MasterOffset": 0.0, "SlaveOffset": 0.0, "MasterScaling": 1.0, "SlaveScaling": 1.0}
"""Inputs that came with technology version V8.0 (CAM-226 to CAM-229)."""


class MC_InterpolateCam(ExecuteInstruction):
    """Close the gaps of a cam (S7-1500T).

    Inputs: `Execute`. Outputs: the common ones; `CommandAborted` never becomes TRUE. A cam in use is
    refused (16#80AB), as is one that is being copied or interpolated (16#80E7, 16#80E8).

    Args:
        cam: Technology object at the input `Cam`.
        name: Instance name in the history.
        **inputs: Start values of inputs.

    """

    instruction = "MC_InterpolateCam"
    object_types = ("Cam",)
    inputs: ClassVar[dict[str, float]] = {"Execute": False}

    def __init__(self, cam: Any, *, name: str | None = None, **inputs: Any) -> None:
        super().__init__(cam, name=name, **inputs)

    @override
    def _start(self) -> Job | int:
        cam: Any = self.axis
        outcome: Job | int = cam.refuses() or cam.interpolate(self.instruction, self.name)
        return outcome


class _Scaled:
    """Checks the inputs for scaling and shift, and makes the scaled cam."""

    def __init__(self, cam: Cam, inputs: Any) -> None:
        self.error_id = NO_ERROR
        self.curve: ScaledCurve | None = None
        for key, error_id in (
            ("MasterOffset", ERROR_MASTER_OFFSET),
            ("SlaveOffset", ERROR_SLAVE_OFFSET),
            ("MasterScaling", ERROR_MASTER_SCALING),
            ("SlaveScaling", ERROR_SLAVE_SCALING),
        ):
            value = getattr(inputs, key)
            if not is_number(value) or (key == "MasterScaling" and value == 0.0):
                self.error_id = error_id
                return
        if cam.curve is not None:
            self.curve = ScaledCurve(
                cam.curve,
                master_scaling=float(inputs.MasterScaling),
                slave_scaling=float(inputs.SlaveScaling),
                master_offset=float(inputs.MasterOffset),
                slave_offset=float(inputs.SlaveOffset),
            )


class MC_GetCamLeadingValue(ExecuteInstruction):
    """Read the leading value that belongs to a following value (S7-1500T).

    Inputs: `Execute`; `FollowingValue`; `ApproachLeadingValue`, from which it is searched;
    `ApproachDirection` 1 positive, 2 negative, 3 nearest; `MasterOffset`, `SlaveOffset`, `MasterScaling`,
    `SlaveScaling`. All values are scaled and shifted ones. Outputs: `Value`, valid with `Done`, and the
    common ones.
    """

    instruction = "MC_GetCamLeadingValue"
    object_types = ("Cam",)
    inputs: ClassVar[dict[str, float]] = {
        "Execute": False,
        "FollowingValue": 0.0,
        "ApproachLeadingValue": 0.0,
        "ApproachDirection": NEAREST,
        **_SCALING,
    }
    FollowingValue: float
    ApproachLeadingValue: float
    ApproachDirection: int

    def __init__(self, cam: Any, *, name: str | None = None, **inputs: Any) -> None:
        self.Value = 0.0
        self._found = 0.0
        super().__init__(cam, name=name, **inputs)

    @override
    def _start(self) -> Job | int:
        cam: Any = self.axis
        refused = cam.refuses()
        if refused:
            return int(refused)
        scaled = _Scaled(cam, self)
        if scaled.error_id:
            return scaled.error_id
        if not is_number(self.ApproachLeadingValue):
            return ERROR_APPROACH_VALUE
        direction = self.ApproachDirection
        if not is_whole(direction) or direction not in (POSITIVE, NEGATIVE, NEAREST):
            return ERROR_APPROACH_DIRECTION
        curve = scaled.curve
        if curve is None or not is_number(self.FollowingValue):
            return ERROR_NO_LEADING_VALUE
        wanted = float(self.FollowingValue)
        if not curve.reaches(cam.inverse, wanted):
            return ERROR_NO_LEADING_VALUE
        found = curve.leading_value(cam.inverse, wanted, float(self.ApproachLeadingValue), direction)
        if found is None:
            return ERROR_END_REACHED
        self._found = found
        job: Job = cam.calculate(self.instruction, self.name, len(cam.curve.pieces))
        return job

    @override
    def _show(self, job: Job) -> None:
        super()._show(job)
        if job.state is JobState.DONE:
            self.Value = self._found


class MC_GetCamFollowingValue(ExecuteInstruction):
    """Read following value and derivatives that belong to a leading value (S7-1500T).

    Inputs: `Execute`; `LeadingValue`; `MasterOffset`, `SlaveOffset`, `MasterScaling`, `SlaveScaling`.
    Outputs: `Value`, `FirstDerivative`, `SecondDerivative`, valid with `Done`, and the common ones.
    """

    instruction = "MC_GetCamFollowingValue"
    object_types = ("Cam",)
    inputs: ClassVar[dict[str, float]] = {"Execute": False, "LeadingValue": 0.0, **_SCALING}
    LeadingValue: float

    def __init__(self, cam: Any, *, name: str | None = None, **inputs: Any) -> None:
        self.Value = self.FirstDerivative = self.SecondDerivative = 0.0
        self._found = (0.0, 0.0, 0.0)
        super().__init__(cam, name=name, **inputs)

    @override
    def _start(self) -> Job | int:
        cam: Any = self.axis
        refused = cam.refuses()
        if refused:
            return int(refused)
        found = _following(cam, self)
        if isinstance(found, int):
            return found
        self._found = found
        job: Job = cam.calculate(self.instruction, self.name, 0)
        return job

    @override
    def _show(self, job: Job) -> None:
        super()._show(job)
        if job.state is JobState.DONE:
            self.Value, self.FirstDerivative, self.SecondDerivative = self._found


def _following(cam: Cam, inputs: Any) -> tuple[float, float, float] | int:
    """Return following value and derivatives, or an ErrorID."""
    scaled = _Scaled(cam, inputs)
    if scaled.error_id:
        return scaled.error_id
    curve, leading = scaled.curve, inputs.LeadingValue
    if curve is None or not is_number(leading) or not curve.contains(float(leading)):
        return ERROR_NO_FOLLOWING_VALUE
    return curve.evaluate(float(leading))


class MC_GetCamFollowingValueCyclic(Instruction):
    """Read following value and derivatives with every call (S7-1500T).

    Inputs: `Enable`; `LeadingValue`; `MasterOffset`, `SlaveOffset`, `MasterScaling`, `SlaveScaling`.
    Outputs: `Valid`; `Value`, `FirstDerivative`, `SecondDerivative`, which belong to the leading value of
    the same call; `Busy`, `Error`, `ErrorID`. After an error a new rising edge of `Enable` is needed
    (CAM-235).
    """

    instruction = "MC_GetCamFollowingValueCyclic"
    object_types = ("Cam",)
    inputs: ClassVar[dict[str, float]] = {"Enable": False, "LeadingValue": 0.0, **_SCALING}
    Enable: bool
    LeadingValue: float

    def __init__(self, cam: Any, *, name: str | None = None, **inputs: Any) -> None:
        self.Valid = False
        self.Value = self.FirstDerivative = self.SecondDerivative = 0.0
        self._job: Job | None = None
        self._last_enable = False
        super().__init__(cam, name=name, **inputs)

    @override
    def _call(self) -> None:
        enable = bool(self.Enable)
        rising = enable and not self._last_enable
        self._last_enable = enable
        if not enable:
            self.Valid = self.Busy = self.Error = False
            self.ErrorID = NO_ERROR
            if self._job is not None:
                self._job.finish()
                self._job = None
            return
        if rising:
            self.Error = False
            self.ErrorID = NO_ERROR
        if self.Error:
            return
        cam: Any = self.axis
        found = self._refused() or cam.refuses() or _following(cam, self)
        if isinstance(found, int):
            self._fail(found)
            return
        if self._job is None:
            self._job = cam.start_job(self.instruction, self.name)
        self.Busy = self.Valid = True
        self.Value, self.FirstDerivative, self.SecondDerivative = found

    def _fail(self, error_id: int) -> None:
        self.Valid = self.Busy = False
        self.Error = True
        self.ErrorID = error_id
        if self._job is None:
            self._log_rejection(error_id)
        else:
            self._job.fail(error_id)
            self._job = None

    def valid(self) -> bool:
        """Return `Valid`."""
        return self.Valid


class MC_CopyCamData(ExecuteInstruction):
    """Copy points and segments from arrays of the user program to a cam (S7-1500T).

    Inputs: `Execute`; `Mode` 0 only what is copied is valid afterwards, 1 what was valid stays valid;
    `StartPointCam`, `StartSegmentCam` first index in the cam; `StartPointArray`, `StartSegmentArray` first
    index in the array; `NumberOfPoints`, `NumberOfSegments`; `ArrayOfPoints`, a `PointArray`;
    `ArrayOfSegments`, a `SegmentArray`. An array of which nothing is copied may be missing. Outputs: the
    common ones.
    """

    instruction = "MC_CopyCamData"
    object_types = ("Cam",)
    inputs: ClassVar[dict[str, Any]] = {
        "Execute": False,
        "Mode": 0,
        "StartPointCam": 1,
        "StartSegmentCam": 1,
        "StartPointArray": 1,
        "StartSegmentArray": 1,
        "NumberOfPoints": 0,
        "NumberOfSegments": 0,
        "ArrayOfPoints": None,
        "ArrayOfSegments": None,
    }
    Mode: int
    StartPointCam: int
    StartSegmentCam: int
    StartPointArray: int
    StartSegmentArray: int
    NumberOfPoints: int
    NumberOfSegments: int
    ArrayOfPoints: PointArray | None
    ArrayOfSegments: SegmentArray | None

    def __init__(self, cam: Any, *, name: str | None = None, **inputs: Any) -> None:
        super().__init__(cam, name=name, **inputs)

    @override
    def _start(self) -> Job | int:
        cam: Any = self.axis
        refused = cam.refuses()
        if refused:
            return int(refused)
        if not is_whole(self.Mode) or self.Mode not in (0, 1):
            return ERROR_MODE
        kind = cam.data.kind
        points, segments = self.ArrayOfPoints, self.ArrayOfSegments
        return (
            _check_range(
                (self.StartPointCam, kind.points, ERROR_START_POINT_CAM),
                (self.StartPointArray, ERROR_START_POINT_ARRAY),
                (self.NumberOfPoints, ERROR_NUMBER_OF_POINTS),
                points if isinstance(points, PointArray) else None,
                usable=points is None or isinstance(points, PointArray),
                array_error=ERROR_ARRAY_OF_POINTS,
            )
            or _check_range(
                (self.StartSegmentCam, kind.segments, ERROR_START_SEGMENT_CAM),
                (self.StartSegmentArray, ERROR_START_SEGMENT_ARRAY),
                (self.NumberOfSegments, ERROR_NUMBER_OF_SEGMENTS),
                segments if isinstance(segments, SegmentArray) else None,
                usable=segments is None or isinstance(segments, SegmentArray),
                array_error=ERROR_ARRAY_OF_SEGMENTS,
            )
            or cam.copy(
                self.instruction,
                self.name,
                keep=self.Mode == 1,
                points=None if points is None else (points, self.StartPointArray),
                segments=None if segments is None else (segments, self.StartSegmentArray),
                targets=(self.StartPointCam, self.StartSegmentCam),
                numbers=(self.NumberOfPoints, self.NumberOfSegments),
            )
        )


def _check_range(
    start_cam: tuple[int, int, int],
    start_array: tuple[int, int],
    number: tuple[int, int],
    array: PointArray | SegmentArray | None,
    *,
    usable: bool,
    array_error: int,
) -> int:
    """Return the ErrorID of what cannot be copied, 0 without.

    Args:
        start_cam: First index in the cam, the greatest one, ErrorID.
        start_array: First index in the array, ErrorID.
        number: How many elements, ErrorID.
        array: The array; None: there is none.
        usable: Whether what is given is such an array, or nothing.
        array_error: ErrorID of an array that is not usable.

    """
    first, most, start_error = start_cam
    if not is_whole(first) or not 1 <= first <= most:
        return start_error
    if not usable or (array is not None and not array.bounds.optimised):
        return array_error
    count, count_error = number
    if not is_whole(count) or count < 0:
        return count_error
    if array is None:
        return array_error if count > 0 else NO_ERROR
    index, index_error = start_array
    bounds = array.bounds
    if not is_whole(index) or not bounds.lower <= index <= bounds.upper:
        return index_error
    if count > most + 1 - first or count > bounds.upper + 1 - index:
        return count_error
    return NO_ERROR
