"""A cam with its instructions as methods, for straight-line test code."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from fieldbus.errors import ConfigurationError, UnknownAttributeError
from motion.kernel.cams import Curve, Point, Segment
from motion.s7.cams import SEGMENT_FIELDS, Cam, PointArray, SegmentArray, segment_values
from motion.s7.instructions import (
    Instruction,
    MC_CopyCamData,
    MC_GetCamFollowingValue,
    MC_GetCamFollowingValueCyclic,
    MC_GetCamLeadingValue,
    MC_InterpolateCam,
    MC_Reset,
)

if TYPE_CHECKING:
    from motion.s7.alarms import AlarmEngine
    from motion.s7.runtime import Runtime

_T = TypeVar("_T", bound=Instruction)


class CamHandle:
    """A cam technology object with the instructions that it knows as methods: `bench.cam("profile")`.

    Every method that starts an instruction hands an instance to the runtime, which calls it from the next
    application cycle on, and returns it: `job = cam.interpolate(); bench.run_until(job.done, timeout=1.0)`.
    """

    def __init__(self, runtime: Runtime, cam: Cam) -> None:
        self._runtime = runtime
        self.object = cam

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        raise UnknownAttributeError(self, self.object, attribute=name, what=self.name)

    def __repr__(self) -> str:
        return f"<{self.summary()} ({self._runtime.scheduler.now * 1e-9:.3f} s)>"

    def summary(self) -> str:
        """Return the cam and how it stands: `profile: 5 points, 2 segments, interpolated from 0 to 360`."""
        cam = self.object
        counts = f"{cam.data.valid_points} points, {cam.data.valid_segments} segments"
        curve = cam.curve
        state = "not interpolated" if curve is None else f"interpolated from {curve.start:g} to {curve.end:g}"
        words = [f"{cam.name}: {counts}", state]
        words += ["changed since"] if curve is not None and cam.data.changed else []
        words += ["in use"] if cam.in_use else []
        return ", ".join(words + [f"alarm {alarm.number}" for alarm in cam.engine.pending])

    @property
    def name(self) -> str:
        """Name of the technology object."""
        return self.object.name

    @property
    def alarms(self) -> AlarmEngine:
        """Technology alarms of the cam."""
        return self.object.engine

    @property
    def curve(self) -> Curve | None:
        """The function of the last interpolation: `curve.evaluate(x)` is following value and derivatives;
        None: the cam has not been interpolated.
        """
        return self.object.curve

    def var(self, path: str) -> float:
        """Return a variable of the technology data block by its original path: `StatusWord.X5`, `Point[3].x`.

        Raises:
            UnknownVariableError: There is no such variable.

        """
        return self.object.var(path)

    def write(self, path: str, value: float) -> None:
        """Assign a point, a segment or a setting as the user program does; it acts with the next
        interpolation.

        Raises:
            UnknownVariableError: There is no such variable.
            VariableAccessError: It is read only.
            VariableError: The value has the wrong type.

        """
        self.object.write(path, value)

    def write_point(self, index: int, x: float, y: float, *, valid: bool = True) -> None:
        """Assign a point and its validity.

        Args:
            index: From 1 on.
            x: Leading value.
            y: Following value.
            valid: `ValidPoint`.

        Raises:
            UnknownVariableError: The cam has no such point.

        """
        self.write(f"Point[{index}].x", x)
        self.write(f"Point[{index}].y", y)
        self.write(f"ValidPoint[{index}]", valid)

    def write_segment(self, index: int, segment: Segment, *, valid: bool = True) -> None:
        """Assign a segment and its validity.

        Args:
            index: From 1 on.
            segment: The segment.
            valid: `ValidSegment`.

        Raises:
            UnknownVariableError: The cam has no such segment.

        """
        for field, value in zip(SEGMENT_FIELDS, segment_values(segment), strict=True):
            self.write(f"Segment[{index}].{field}", value)
        self.write(f"ValidSegment[{index}]", valid)

    def shift_following_values(self, shift: float) -> None:
        """Add to the following values of all points and segments; it acts with the next interpolation."""
        kind = self.object.data.kind
        for element, value, count in (("Point", "y", kind.points), ("Segment", "a0", kind.segments)):
            for number in range(1, count + 1):
                if self.var(f"Valid{element}[{number}]"):
                    path = f"{element}[{number}].{value}"
                    self.write(path, self.var(path) + shift)

    def run(self, instance: _T) -> _T:
        """Hand an instance of your own to the runtime."""
        self._runtime.call(instance)
        return instance

    def interpolate(self) -> MC_InterpolateCam:
        """Start `MC_InterpolateCam`."""
        return self.run(MC_InterpolateCam(self.object, Execute=True))

    def leading_value(self, following: float, approach: float = 0.0, **inputs: Any) -> MC_GetCamLeadingValue:
        """Start `MC_GetCamLeadingValue` for a following value, from an approximate leading value."""
        return self.run(
            MC_GetCamLeadingValue(
                self.object, Execute=True, FollowingValue=following, ApproachLeadingValue=approach, **inputs
            )
        )

    def following_value(self, leading: float, **inputs: Any) -> MC_GetCamFollowingValue:
        """Start `MC_GetCamFollowingValue` for a leading value."""
        return self.run(MC_GetCamFollowingValue(self.object, Execute=True, LeadingValue=leading, **inputs))

    def following_value_cyclic(self, leading: float = 0.0, **inputs: Any) -> MC_GetCamFollowingValueCyclic:
        """Start `MC_GetCamFollowingValueCyclic`; continue with `instance.set(LeadingValue=...)`."""
        return self.run(
            MC_GetCamFollowingValueCyclic(self.object, Enable=True, LeadingValue=leading, **inputs)
        )

    def copy(
        self,
        points: Iterable[Point | tuple[float, float]] = (),
        segments: Iterable[Segment] = (),
        **inputs: Any,
    ) -> MC_CopyCamData:
        """Start `MC_CopyCamData` with all of these points and segments.

        Args:
            points: Points, or pairs of leading and following value.
            segments: Segments.
            **inputs: Other inputs of the instruction: `Mode=1`, `StartPointCam=20`.

        """
        given: dict[str, Any] = {}
        point_array, segment_array = PointArray(points), SegmentArray(segments)
        if point_array.elements:
            given |= {"ArrayOfPoints": point_array, "NumberOfPoints": len(point_array.elements)}
        if segment_array.elements:
            given |= {"ArrayOfSegments": segment_array, "NumberOfSegments": len(segment_array.elements)}
        return self.run(MC_CopyCamData(self.object, Execute=True, **(given | inputs)))

    def export(self, path: str | Path, *, number: int = 361, derivatives: bool = False) -> Path:
        """Write the function as a list of points at equal distances of the leading value (CAM-224).

        Args:
            path: CSV file; without derivatives it can be a `points_file` of a bench file.
            number: Points, both ends included; 2 or more.
            derivatives: Also the first, second and third derivative.

        Returns:
            The path.

        Raises:
            ConfigurationError: The cam is not interpolated, or there are less than two points.

        """
        curve = self.curve
        if curve is None:
            raise ConfigurationError(self.name, "not interpolated", "a cam that is interpolated")
        if number < 2:
            raise ConfigurationError("number", number, "2 or more points")
        names = ["leading value", "following value"]
        names += ["velocity", "acceleration", "jerk"] if derivatives else []
        lines = [",".join(names)]
        for index in range(number):
            x = curve.end if index == number - 1 else curve.start + index * curve.period / (number - 1)
            values = (x, *curve.evaluate(x), curve.third(x))
            lines.append(",".join(map(repr, values if derivatives else values[:2])))
        file = Path(path)
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return file

    def reset(self, *, restart: bool = False) -> MC_Reset:
        """Start `MC_Reset`."""
        return self.run(MC_Reset(self.object, Execute=True, Restart=restart))
