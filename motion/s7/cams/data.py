"""The data block of a cam: points, segments, settings, their start values and values in effect.

Points, segments, validity and settings are written by the user program and act with the next
`MC_InterpolateCam` (CAL); the rest is read only.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from math import isnan
from typing import TYPE_CHECKING, Final, NamedTuple

from fieldbus.errors import ConfigurationError, UnknownNameError, similar_names
from motion.kernel.cams import Boundary, Interpolation, Point, Segment
from motion.s7.cams.elements import SEGMENT_FIELDS, segment_of, segment_values
from motion.s7.data._variables import UnknownVariableError, Variable, VariableAccessError, VariableError

if TYPE_CHECKING:
    from fieldbus.history import History

LARGEST: Final = 1e12
"""Magnitude that a value of a cam has at most (CAM-004)."""


class CamType(NamedTuple):
    """What one type of cam holds."""

    name: str
    points: int
    segments: int


CAM_TYPES: Final = {
    one.name: one
    for one in (
        CamType("TO_Cam", 1000, 50),
        CamType("TO_Cam_10k", 10_000, 50),
        CamType("TO_Cam_600Seg", 1000, 600),
        CamType("TO_Cam_6kSeg", 10_000, 6000),
    )
}
"""Types of cams with their most points and segments (CAM-001 to CAM-003).

The numbers of points of the last two are a choice of this product, those of segments follow from the names.
"""

_POINT_FIELDS: Final = ("x", "y")
_ELEMENT: Final = re.compile(r"(Point|ValidPoint|Segment|ValidSegment)\[(\d+)\](?:\.(\w+))?$")
_SETTINGS: Final = "InterpolationSettings."


def _variable(
    path: str, data_type: str, access: str, limits: tuple[float | None, float | None], **more: dict[int, str]
) -> Variable:
    return Variable(
        path=path,
        data_type=data_type,
        access=access,
        unit="",
        initial=0,
        minimum=limits[0],
        maximum=limits[1],
        enum=more.get("enum", {}),
        bits=more.get("bits", {}),
        variants={},
        vendor_default=False,
    )


_NUMBER: Final = (-LARGEST, LARGEST)
STATUS_BITS: Final = {
    0: "Control", 1: "Error", 2: "RestartActive", 3: "OnlineStartValuesChanged", 4: "CamDataChanged",
    5: "Interpolated", 6: "InInterpolation", 7: "CopyCamDataActive",
}  # fmt: skip
"""Bits of `StatusWord` (CAM-014)."""
ERROR_BITS: Final = {0: "SystemFault", 1: "ConfigFault", 2: "UserFault", 3: "CommandNotAccepted"}
WARNING_BITS: Final = {0: "SystemWarning", 1: "ConfigWarning", 2: "UserWarning", 3: "CommandNotAccepted"}

SETTINGS: Final = {
    one.path: one
    for one in (
        _variable(f"{_SETTINGS}InterpolationMode", "DINT", "CAL", (0, 2), enum={
            0: "LINEAR", 1: "CUBIC_SPLINE", 2: "BEZIER_SPLINE",
        }),
        _variable(f"{_SETTINGS}BoundaryConditions", "DINT", "CAL", (0, 1), enum={
            0: "NO_CONDITION", 1: "FIRST_DERIVATIVE_EQUAL",
        }),
    )
}  # fmt: skip
"""Settings of the interpolation (CAM-010, CAM-011)."""


def status_variables(kind: CamType) -> dict[str, Variable]:
    """Return the variables that are read only (CAM-012 to CAM-015, CAM-218)."""
    return {
        one.path: one
        for one in (
            _variable("StatusCam.StartLeadingValue", "LREAL", "RON", _NUMBER),
            _variable("StatusCam.EndLeadingValue", "LREAL", "RON", _NUMBER),
            _variable("StatusCam.NumberOfValidPoints", "DINT", "RON", (0, kind.points)),
            _variable("StatusCam.NumberOfValidSegments", "DINT", "RON", (0, kind.segments)),
            _variable("StatusWord", "DWORD", "RON", (None, None), bits=STATUS_BITS),
            _variable("ErrorWord", "DWORD", "RON", (None, None), bits=ERROR_BITS),
            _variable("WarningWord", "DWORD", "RON", (None, None), bits=WARNING_BITS),
            _variable("ErrorDetail.Number", "UDINT", "RON", (None, None)),
            _variable("ErrorDetail.Reaction", "DINT", "RON", (0, 9), enum={
                0: "NO_REACTION", 9: "PROCESSING_TERMINATED",
            }),
        )
    }  # fmt: skip


class _Place(NamedTuple):
    """A variable of an element: its column, and its index from 0."""

    column: str
    number: int


class CamData:
    """Points, segments and settings of one cam.

    Args:
        kind: Its type.
        name: Source of history events.
        history: Log for refused assignments.

    """

    def __init__(self, kind: CamType, *, name: str = "", history: History | None = None) -> None:
        self.kind = kind
        self.online_start_values_changed = False
        """Never: no start value of a cam waits for a restart (`StatusWord.X3`)."""
        self.changed = False
        """Whether points or segments have changed since the last interpolation (`StatusWord.X4`)."""
        self.revision = 0
        """Number of changes."""
        self._name = name
        self._history = history
        self._elements = {
            **{f"Point.{field}": _variable(f"Point[1..{kind.points}].{field}", "LREAL", "CAL", _NUMBER)
               for field in _POINT_FIELDS},
            "ValidPoint": _variable(f"ValidPoint[1..{kind.points}]", "BOOL", "CAL", (0, 1)),
            **{f"Segment.{field}": _variable(f"Segment[1..{kind.segments}].{field}", "LREAL", "CAL", _NUMBER)
               for field in SEGMENT_FIELDS},
            "ValidSegment": _variable(f"ValidSegment[1..{kind.segments}]", "BOOL", "CAL", (0, 1)),
        }  # fmt: skip
        self._columns: dict[str, list[float]] = {
            name: [0.0 if one.data_type == "LREAL" else False] * self._size(name)
            for name, one in self._elements.items()
        }
        self._settings: dict[str, float] = dict.fromkeys(SETTINGS, 0)
        self._start_columns = {name: list(column) for name, column in self._columns.items()}
        self._start_settings = dict(self._settings)
        self._status = status_variables(kind)

    def _size(self, column: str) -> int:
        return self.kind.points if "Point" in column else self.kind.segments

    # -- what the interpolation takes

    @property
    def points(self) -> list[Point]:
        """The valid points in the order of their indexes."""
        x, y = self._columns["Point.x"], self._columns["Point.y"]
        return [Point(x[i], y[i]) for i, valid in enumerate(self._columns["ValidPoint"]) if valid]

    @property
    def segments(self) -> list[Segment]:
        """The valid segments in the order of their indexes."""
        columns = [self._columns[f"Segment.{field}"] for field in SEGMENT_FIELDS]
        return [
            segment_of([column[i] for column in columns])
            for i, valid in enumerate(self._columns["ValidSegment"])
            if valid
        ]

    @property
    def mode(self) -> Interpolation:
        """`InterpolationSettings.InterpolationMode`."""
        return Interpolation(int(self._settings[f"{_SETTINGS}InterpolationMode"]))

    @property
    def boundary(self) -> Boundary:
        """`InterpolationSettings.BoundaryConditions`."""
        return Boundary(int(self._settings[f"{_SETTINGS}BoundaryConditions"]))

    @property
    def valid_points(self) -> int:
        """Number of valid points (CAM-013)."""
        return self._columns["ValidPoint"].count(True)

    @property
    def valid_segments(self) -> int:
        """Number of valid segments."""
        return self._columns["ValidSegment"].count(True)

    # -- by path

    def paths(self) -> Iterator[str]:
        """Return all paths; elements with the range of their index: `Point[1..1000].x`."""
        for variable in (*self._elements.values(), *SETTINGS.values(), *self._status.values()):
            yield variable.path

    def describe(self, path: str) -> Variable:
        """Return the definition of a variable.

        Raises:
            UnknownVariableError: There is no such variable.

        """
        fixed = SETTINGS.get(path) or self._status.get(path)
        return fixed if fixed is not None else self._elements[self._place(path).column]

    def read(self, path: str) -> float:
        """Return the value in effect of a point, a segment, or a setting.

        Raises:
            UnknownVariableError: There is no such variable.

        """
        if path in SETTINGS:
            return self._settings[path]
        place = self._place(path)
        return self._columns[place.column][place.number]

    def start_value(self, path: str) -> float:
        """Return the start value in load memory of what `read` reads."""
        if path in SETTINGS:
            return self._start_settings[path]
        place = self._place(path)
        return self._start_columns[place.column][place.number]

    def write(self, path: str, value: object) -> None:
        """Assign a variable as a user program does; it acts with the next interpolation.

        An LREAL outside its range becomes the nearest bound; any other value outside its range is dropped and
        starts OB 121 (VAR-015).

        Raises:
            UnknownVariableError: There is no such variable.
            VariableAccessError: It is read only.
            VariableError: The value has the wrong type.

        """
        variable = self._writable(path)
        converted = variable.convert(path, value)
        if not variable.permits(converted, 0):
            if variable.data_type != "LREAL" or isnan(converted):
                if self._history is not None:
                    self._history.emit(self._name, "program.error", ob=121, path=path, value=repr(value))
                return
            converted = min(max(converted, -LARGEST), LARGEST)
        self._put(path, converted)

    def write_start(self, path: str, value: object) -> None:
        """Write a start value in load memory; it takes effect with a restart, which reports one out of range.

        Raises:
            UnknownVariableError: There is no such variable.
            VariableAccessError: It is read only.
            VariableError: The value has the wrong type.

        """
        converted = self._writable(path).convert(path, value)
        if path in SETTINGS:
            self._start_settings[path] = converted
            return
        place = self._place(path)
        self._start_columns[place.column][place.number] = converted

    def configure(self, values: Mapping[str, object]) -> None:
        """Load start values and put them into force, as a download does.

        Raises:
            ConfigurationError: A variable does not exist or is read only, or a value is out of its type or
                range; then nothing has changed.

        """
        found = []
        for path, value in values.items():
            try:
                variable = self._writable(path)
                converted = variable.convert(path, value)
            except UnknownVariableError:
                raise UnknownNameError("", path, f"a variable of {self.kind.name}", [*self.paths()]) from None
            except VariableAccessError as error:
                raise ConfigurationError(path, value, "a variable that is not read only") from error
            except VariableError:
                raise ConfigurationError(
                    path, value, f"{variable.data_type}, {variable.allowed(0)}"
                ) from None
            if not variable.permits(converted, 0):
                raise ConfigurationError(path, value, f"{variable.data_type}, {variable.allowed(0)}")
            found.append((path, converted))
        for path, converted in found:
            self.write_start(path, converted)

    def load(self, points: list[Point], segments: list[Segment]) -> None:
        """Make points and segments the valid ones of load memory, from index 1 on.

        Raises:
            ConfigurationError: There are too many, or a value is out of range.

        """
        for what, given, most in (
            ("points", points, self.kind.points),
            ("segments", segments, self.kind.segments),
        ):
            if len(given) > most:
                raise ConfigurationError(
                    what, f"{len(given)} {what}", f"at most {most} of a {self.kind.name}"
                )
        starts = self._start_columns
        for name, column in starts.items():
            starts[name] = [False if name.startswith("Valid") else 0.0] * len(column)
        for index, point in enumerate(points):
            for field, value in zip(_POINT_FIELDS, (point.x, point.y), strict=True):
                self._check(f"points, number {index + 1}, {field}", value)
                starts[f"Point.{field}"][index] = value
            starts["ValidPoint"][index] = True
        for index, segment in enumerate(segments):
            for field, value in zip(SEGMENT_FIELDS, segment_values(segment), strict=True):
                self._check(f"segments, number {index + 1}, {field}", value)
                starts[f"Segment.{field}"][index] = value
            starts["ValidSegment"][index] = True

    @staticmethod
    def _check(place: str, value: float) -> None:
        if not -LARGEST <= value <= LARGEST:
            raise ConfigurationError(place, value, f"{-LARGEST:g} to {LARGEST:g}")

    # -- restart

    def violations(self) -> list[str]:
        """Return the start values that are not permitted, so that a restart ends with alarm 101."""
        found = [
            f"{path} = {value}; allowed: {SETTINGS[path].allowed(0)}"
            for path, value in self._start_settings.items()
            if not SETTINGS[path].permits(value, 0)
        ]
        for name, column in self._start_columns.items():
            variable = self._elements[name]
            head, _, field = name.partition(".")
            suffix = f".{field}" if field else ""
            found += [
                f"{head}[{index}]{suffix} = {value}; allowed: {variable.allowed(0)}"
                for index, value in enumerate(column, start=1)
                if not variable.permits(value, 0)
            ]
        return found

    def restart(self) -> None:
        """Put all start values into force (CAM-221)."""
        self._columns = {name: list(column) for name, column in self._start_columns.items()}
        self._settings = dict(self._start_settings)
        self.revision += 1
        self.changed = False

    # -- copying

    def invalidate(self) -> None:
        """Let no element take part in the interpolation any longer."""
        for name in ("ValidPoint", "ValidSegment"):
            self._columns[name] = [False] * len(self._columns[name])
        self._note()

    def copy_point(self, index: int, point: Point) -> None:
        """Copy a point to an index from 1 on; it stays as valid as it is."""
        self._columns["Point.x"][index - 1] = point.x
        self._columns["Point.y"][index - 1] = point.y

    def copy_segment(self, index: int, segment: Segment) -> None:
        """Copy a segment to an index from 1 on; it stays as valid as it is."""
        for field, value in zip(SEGMENT_FIELDS, segment_values(segment), strict=True):
            self._columns[f"Segment.{field}"][index - 1] = value

    def validate(self, points: range, segments: range) -> None:
        """Set elements valid, by their indexes from 1 on."""
        for index in points:
            self._columns["ValidPoint"][index - 1] = True
        for index in segments:
            self._columns["ValidSegment"][index - 1] = True
        self._note()

    # -- inside

    def _note(self) -> None:
        self.revision += 1
        self.changed = True

    def _put(self, path: str, value: float) -> None:
        if path in SETTINGS:
            self._settings[path] = value
            return
        place = self._place(path)
        column = self._columns[place.column]
        if column[place.number] != value:
            column[place.number] = value
            self._note()

    def _writable(self, path: str) -> Variable:
        variable = self.describe(path)
        if variable.access == "RON":
            raise VariableAccessError(f"{path} is read only (RON)")
        return variable

    def _place(self, path: str) -> _Place:
        found = _ELEMENT.match(path)
        if found is not None:
            column = found[1] if found[3] is None else f"{found[1]}.{found[3]}"
            if column in self._elements:
                index, size = int(found[2]), self._size(column)
                if 1 <= index <= size:
                    return _Place(column, index - 1)
                raise UnknownVariableError(
                    f"{path}: a {self.kind.name} has {found[1]}[1] to {found[1]}[{size}]"
                )
        near = similar_names(path, list(self.paths()))
        raise UnknownVariableError(
            f"{self.kind.name} has no variable {path!r}" + (f"; {near}" if near else "")
        )
