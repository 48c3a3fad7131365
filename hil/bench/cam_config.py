"""`[cam.NAME]` of a bench file: cam technology objects of the controller."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import BeforeValidator, Field, model_validator

from fieldbus.errors import ConfigurationError
from fieldbus.toml_text import number_hint
from hil.bench._table import Table
from hil.bench.axis_config import StartValues
from motion.kernel.cams import CamError, Elements, End, LawError, Point, Segment, interpolate, transition
from motion.kernel.cams.interpolation import Boundary, Interpolation
from motion.s7.cams import CAM_TYPES, CamData

if TYPE_CHECKING:
    from collections.abc import Iterator

Number = Annotated[float, Field(ge=-1e12, le=1e12)]


def _pair(value: object) -> object:
    if not isinstance(value, list | tuple) or len(value) != 2:
        text = "allowed: a pair, leading and following value: [90.0, 20.0]"
        raise ValueError(text)
    for one in value:
        if isinstance(one, bool) or not isinstance(one, int | float):
            text = f"allowed: a pair of numbers{number_hint(one)}"
            raise ValueError(text)  # noqa: TRY004 - it becomes a message about the file
    return value


def _pairs(value: object) -> object:
    if not isinstance(value, list | tuple):
        text = "allowed: pairs of leading and following value: [[0.0, 0.0], [90.0, 20.0]]"
        raise ValueError(text)  # noqa: TRY004 - it becomes a message about the file
    return value


_Pair = Annotated[tuple[Number, Number], BeforeValidator(_pair)]
_MODES: Final = {"linear": Interpolation.LINEAR, "cubic": Interpolation.CUBIC, "bezier": Interpolation.BEZIER}
_BOUNDARIES: Final = {"none": Boundary.NONE, "equal_velocity": Boundary.EQUAL_VELOCITY}


class CamSegmentTable(Table, frozen=True):
    """`[[cam.NAME.segments]]`: a polynomial with a sine, `s` being the distance from `start`."""

    start: Number
    """First leading value (`xmin`)."""
    end: Number
    """Last leading value (`xmax`)."""
    a: Annotated[tuple[Number, ...], Field(max_length=7)] = ()
    """Coefficients of s^0, s^1, .. s^6; those that are missing are 0."""
    sine_amplitude: Number = 0.0
    """Factor of the sine."""
    sine_period: Number = 0.0
    """Factor of s in the sine, rad."""
    sine_phase: Number = 0.0
    """Offset in the sine, rad."""

    @model_validator(mode="after")
    def _has_length(self) -> CamSegmentTable:
        if self.end <= self.start:
            raise ValueError(f"end must be above start = {self.start:g}")
        return self

    def build(self) -> Segment:
        """Return the segment."""
        a = (*self.a, *[0.0] * (7 - len(self.a)))
        return Segment(
            self.start,
            self.end,
            (a[0], a[1], a[2], a[3], a[4], a[5], a[6]),
            self.sine_amplitude,
            self.sine_period,
            self.sine_phase,
        )


class CamTransitionTable(Table, frozen=True):
    """`[[cam.NAME.transitions]]`: a law of motion between two points; it becomes segments of the cam."""

    law: Literal[
        "straight_line",
        "quadratic_parabola",
        "simple_sine",
        "polynomial",
        "polynomial_3",
        "polynomial_4567",
        "inclined_sine",
        "modified_sine",
        "modified_trapezoid",
        "harmonic_combination",
        "double_harmonic",
        "sine_straight_line",
    ]
    """Law of VDI 2143 ([Cams](cams.md))."""
    start: _Pair
    """Leading and following value at the start."""
    end: _Pair
    """Leading and following value at the end."""
    start_velocity: Number = 0.0
    """First derivative of the following value at the start."""
    end_velocity: Number = 0.0
    """First derivative at the end."""
    start_acceleration: Number | None = None
    """Second derivative at the start; none: 0, or that of the law at a turning point."""
    end_acceleration: Number | None = None
    """Second derivative at the end, likewise."""
    start_reversal: bool = False
    """The start is a turning point of the following value."""
    end_reversal: bool = False
    """The end is a turning point of the following value."""
    turning_point: Annotated[float, Field(gt=0.0, lt=1.0)] | None = None
    """Where acceleration turns into deceleration (lambda), as a part of the transition; none: where the law
    has it.
    """
    ca: Annotated[float, Field(gt=0.0)] | None = None
    """Greatest normalised acceleration, in place of `turning_point`."""
    ca_star: Annotated[float, Field(gt=0.0)] | None = None
    """Greatest normalised deceleration, in place of `turning_point`."""
    sine_share: Annotated[float, Field(gt=0.0, le=1.0)] = 0.5
    """Of the sines in `sine_straight_line`."""
    approximation: Annotated[int, Field(ge=2, le=1000)] = 32
    """Points of a law that cannot be segments."""

    @model_validator(mode="after")
    def _is_possible(self) -> CamTransitionTable:
        self.build()
        return self

    def build(self) -> Elements:
        """Return points and segments.

        Raises:
            ValueError: The law does not fit.

        """
        try:
            return transition(
                self.law,
                End(*self.start, self.start_velocity, self.start_acceleration, self.start_reversal),
                End(*self.end, self.end_velocity, self.end_acceleration, self.end_reversal),
                lam=self.turning_point,
                ca=self.ca,
                ca_star=self.ca_star,
                share=self.sine_share,
                approximation=self.approximation,
            )
        except LawError as error:
            raise ValueError(str(error)) from None


class CamTable(Table, frozen=True):
    """`[cam.NAME]`: a cam technology object, a following value for every leading value."""

    kind: Literal["TO_Cam", "TO_Cam_10k", "TO_Cam_600Seg", "TO_Cam_6kSeg"] = "TO_Cam"
    """Type: 1000 points and 50 segments, or up to 10 000 points or 6000 segments, as its name says."""
    interpolation: Literal["linear", "cubic", "bezier"] = "cubic"
    """How `MC_InterpolateCam` closes gaps (`InterpolationSettings.InterpolationMode` 0, 1, 2)."""
    boundary: Literal["none", "equal_velocity"] = "none"
    """`equal_velocity`: the same first derivative at both ends of the cam
    (`InterpolationSettings.BoundaryConditions` 1).
    """
    points: Annotated[tuple[_Pair, ...], BeforeValidator(_pairs)] = ()
    """Pairs of leading and following value, in any order."""
    points_file: str | None = None
    """CSV file with two columns, leading and following value, relative to the bench file; a first line
    with names and lines that begin with `#` are no points; the name of a file.
    """
    segments: tuple[CamSegmentTable, ...] = ()
    """Polynomials with a sine."""
    transitions: tuple[CamTransitionTable, ...] = ()
    """Laws of motion."""
    variables: StartValues = {}
    """Other start values of the technology object, by original path: `"ValidPoint[4]" = false`."""

    @model_validator(mode="after")
    def _makes_a_cam(self) -> CamTable:
        elements = self.elements()
        try:
            data = CamData(CAM_TYPES[self.kind])
            data.load(*elements)
            data.configure(self.start_values())
        except ConfigurationError as error:
            raise ValueError(str(error)) from None
        data.restart()
        if data.points or data.segments:
            try:
                interpolate(data.points, data.segments, data.mode, data.boundary)
            except CamError as error:
                raise ValueError(str(error)) from None
        return self

    def elements(self) -> Elements:
        """Return all points and segments.

        Raises:
            ValueError: The file cannot be read, or holds something else.

        """
        points = [Point(*pair) for pair in self.points]
        if self.points_file is not None:
            points += read_points(self.points_file)
        segments = [one.build() for one in self.segments]
        for one in self.transitions:
            found = one.build()
            points += found.points
            segments += found.segments
        return Elements(points, segments)

    def start_values(self) -> dict[str, object]:
        """Return the start values of variables, the settings included."""
        settings = "InterpolationSettings."
        return {
            f"{settings}InterpolationMode": int(_MODES[self.interpolation]),
            f"{settings}BoundaryConditions": int(_BOUNDARIES[self.boundary]),
            **self.variables,
        }


def read_points(file: str | Path) -> list[Point]:
    """Return the points of a CSV file.

    Raises:
        ValueError: The file cannot be read, or a line is no pair of numbers.

    """
    path = Path(file)
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no text"
        raise ValueError(f"points_file: {path}: {reason}") from None
    return list(_points_in(lines, path.name))


def _points_in(lines: list[str], name: str) -> Iterator[Point]:
    rows = list(csv.reader(lines, delimiter=_delimiter(lines), skipinitialspace=True))
    for number, row in enumerate(rows, start=1):
        cells = [cell.strip() for cell in row]
        if not any(cells) or cells[0].startswith("#"):
            continue
        try:
            x, y = (float(cell) for cell in cells)
        except ValueError:
            if number == 1:
                continue  # names of the columns
            wanted = "two numbers, leading and following value, with a decimal point"
            raise ValueError(
                f"points_file: {name}, line {number}: {' '.join(row)!r}; allowed: {wanted}"
            ) from None
        yield Point(x, y)


def _delimiter(lines: list[str]) -> str:
    """Return what separates the columns: semicolon, tabulator or comma."""
    text = "\n".join(lines)
    return next((one for one in (";", "\t") if one in text), ",")
