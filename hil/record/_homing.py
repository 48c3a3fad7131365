"""From the trace of a homing to its drawing: path, switches, and place of the mark.

Everything here comes from the recording: positions and velocities of the axis, inputs of the drive, events.
The expectations of a case have no influence on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fieldbus.history import Event
from hil.errors import RecordingError
from hil.record._trace import Trace
from reports.homing import HomingDrawing, HomingStep, SwitchEdge, SwitchLane

_KINDS: Final = ("zero mark", "zero mark behind the cam", "digital input")
"""By `ActiveHoming.Mode` and `PassiveHoming.Mode`."""
_BITS: Final = {"negative_limit": 0, "positive_limit": 1, "home": 2}
"""Bits of the inputs of a drive (60FDh)."""
_OUTCOMES: Final = {"job.done": "Done", "job.aborted": "CommandAborted", "job.error": "Error 16#{:04X}"}
_CAUSE_CYCLES: Final = 3.0
"""A switch is the cause of another part of the motion when it changed at most so many cycles before."""
_TAIL_S: Final = 1.0
"""What follows the end of the job, until the axis stands, at most."""
_PASSING_S: Final = 0.25
"""What follows the mark of a passive homing."""
_MOST_MARKS: Final = 300.0
"""Number of zero marks along a travel above which only the used one is drawn."""
_FINE: Final = 1200
"""Points of a path lie at least this part of its extent apart."""


def homing_drawings(trace: Trace) -> list[HomingDrawing]:
    """Return a drawing of every active and passive homing in the trace, in the order of their beginnings."""
    return [one for one in map(_Homing(trace).drawing, trace.select(kind="homing.started")) if one]


@dataclass
class _Path:
    """Motion of an axis, every cycle."""

    time: NDArray[np.float64]
    position: NDArray[np.float64]
    velocity: NDArray[np.float64]

    def at(self, time_s: float) -> float:
        return float(np.interp(time_s, self.time, self.position))

    def speed(self, time_s: float) -> float:
        return float(np.interp(time_s, self.time, self.velocity))

    def between(self, begin_s: float, end_s: float) -> slice:
        first, last = np.searchsorted(self.time, [begin_s - 1e-9, end_s + 1e-9])
        return slice(int(first), max(int(last), int(first) + 1))

    def way(self, begin_s: float, end_s: float) -> NDArray[np.float64]:
        """Return the positions of an interval, its ends among them."""
        inside = self.position[self.between(begin_s, end_s)]
        return np.concatenate(([self.at(begin_s)], inside, [self.at(end_s)]))


class _Homing:
    """Makes the drawings of one trace."""

    def __init__(self, trace: Trace) -> None:
        self._trace = trace

    def drawing(self, started: Event) -> HomingDrawing | None:
        """Return the drawing of the homing that an event begins; None where its axis was not recorded."""
        trace, axis = self._trace, started.source
        columns = next(
            (
                pair
                for pair in (("actual_position", "actual_velocity"), ("position", "velocity"))
                if f"{axis}.{pair[0]}" in trace
            ),
            None,
        )
        if columns is None:
            return None
        begin_s = started.time_ns * 1e-9
        ended = next(
            (
                entry
                for entry in trace.select(source=axis, kind="job.")
                if entry.data.get("job") == started.data["job"]
                and entry.kind in _OUTCOMES
                and entry.time_ns >= started.time_ns
            ),
            None,
        )
        job_end_s = trace.end_s if ended is None else ended.time_ns * 1e-9
        homed = next(
            (
                entry
                for entry in trace.select(source=axis, kind="axis.homed")
                if "mark" in entry.data and begin_s <= entry.time_ns * 1e-9 <= job_end_s + 1e-9
            ),
            None,
        )
        parts = [
            entry
            for entry in trace.select(source=axis, kind="homing.phase")
            if started.time_ns <= entry.time_ns <= round(job_end_s * 1e9)
        ]
        path = self._path(axis, columns)
        end_s = self._end(
            path, job_end_s, homed if not parts else None, done=ended is not None and ended.kind == "job.done"
        )
        offsets = [
            (entry.time_ns * 1e-9, _number(entry, "offset"))
            for entry in trace.select(source=axis, kind="axis.homed")
            if "offset" in entry.data and entry.time_ns * 1e-9 <= end_s
        ]
        for time_s, offset in offsets:
            path.position[self._trace[f"{axis}.{columns[0]}"].time_s < time_s - 1e-9] += offset
        whole = path.between(begin_s, end_s)
        path = _Path(path.time[whole], path.position[whole], path.velocity[whole])
        if not len(path.time):
            return None
        outcome = (
            "still active" if ended is None else _OUTCOMES[ended.kind].format(ended.data.get("error_id", 0))
        )
        drawing = HomingDrawing(
            axis,
            trace[f"{axis}.{columns[0]}"].unit,
            _text(started, "job"),
            int(_number(started, "mode")),
            bool(parts),
            _KINDS[int(_number(started, "mark"))],
            int(_number(started, "direction")),
            outcome,
            begin_s,
            end_s,
            _number(started, "approach"),
            _number(started, "homing"),
            mark=None if homed is None else _number(homed, "mark"),
        )
        if drawing.active and outcome == "Done":
            drawing.home = path.at(job_end_s)
        drawing.lanes = self._lanes(axis, started, path, drawing)
        mark_s = None if homed is None else homed.time_ns * 1e-9
        drawing.steps = list(
            self._active_steps(drawing, path, parts, mark_s, job_end_s)
            if drawing.active
            else _passive_steps(drawing, path, mark_s, job_end_s)
        )
        drawing.path = _thinned(path, [step.begin_s for step in drawing.steps])
        return drawing

    def _path(self, axis: str, columns: tuple[str, str]) -> _Path:
        """Return the motion of an axis; its actual values are those of half a cycle
        before the row that shows them.
        """
        position, velocity = (self._trace[f"{axis}.{column}"] for column in columns)
        late = 0.5 * self._trace.constants.get(f"{axis}.cycle_s", 0.0)
        return _Path(position.time_s - late, position.values.copy(), velocity.values)

    @staticmethod
    def _end(path: _Path, job_end_s: float, homed: Event | None, *, done: bool) -> float:
        """Return where the drawing ends: with the job, at the standstill after it, or behind the mark of a
        passive homing.
        """
        if homed is not None:
            return homed.time_ns * 1e-9 + _PASSING_S
        if done:
            return job_end_s
        after = path.between(job_end_s, job_end_s + _TAIL_S)
        standing = np.flatnonzero(
            np.abs(path.velocity[after]) < 1e-3 * np.abs(path.velocity).max(initial=1e-9)
        )
        return float(path.time[after][standing[0]]) if len(standing) else job_end_s + _TAIL_S

    # -- switches
    # ---------------------------------------------------------------------------------------------

    def _lanes(self, axis: str, started: Event, path: _Path, drawing: HomingDrawing) -> list[SwitchLane]:
        mark = int(_number(started, "mark"))
        wired = next(self._trace.select(source=axis, kind="axis.wired"), None)
        found: list[SwitchLane] = []
        drive = "" if wired is None else _text(wired, "drive")
        homing_input = "" if wired is None else _text(wired, "homing_input")
        names = {"negative_limit": "negative limit", "positive_limit": "positive limit"}
        if mark and f"{drive}.inputs" in self._trace:
            lane = self._lane(
                drive, homing_input, path, "cam" if mark == 1 else "input", level=bool(started.data["level"])
            )
            names.pop(homing_input, None)
            found.append(lane)
        if mark != 2:
            found.append(self._zero_marks(wired, path, drawing))
        if f"{drive}.inputs" in self._trace:
            limits = (self._lane(drive, bit, path, name) for bit, name in names.items())
            found += [lane for lane in limits if lane.bars]
        return found

    def _lane(self, drive: str, switch: str, path: _Path, name: str, *, level: bool = True) -> SwitchLane:
        mask = 1 << _BITS[switch]
        begin_s, end_s = float(path.time[0]), float(path.time[-1])
        inputs = self._trace[f"{drive}.inputs"]
        first = int(np.searchsorted(inputs.time_s, begin_s + 1e-9)) - 1
        active = (int(inputs.values[max(first, 0)]) & mask != 0) is level
        lane = SwitchLane(name)
        since = begin_s
        for entry in self._trace.select(source=drive, kind="drive.inputs"):
            time_s = entry.time_ns * 1e-9
            state = (int(_number(entry, "inputs")) & mask != 0) is level
            if state is active or not begin_s < time_s <= end_s:
                continue
            lane.edges.append(SwitchEdge(time_s, path.at(time_s), state, int(np.sign(path.speed(time_s)))))
            if active:
                _widen(lane, path, since, time_s)
            active, since = state, time_s
        if active:
            _widen(lane, path, since, end_s)
        return lane

    def _zero_marks(self, wired: Event | None, path: _Path, drawing: HomingDrawing) -> SwitchLane:
        """Return the zero mark that was used, and the encoder's other ones, one per
        revolution of a motor encoder.
        """
        lane = SwitchLane("zero mark")
        if drawing.mark is None:
            return lane
        lane.bars.append([drawing.mark, drawing.mark])
        pitch = 0.0 if wired is None else _number(wired, "zero_mark_pitch")
        drive = "" if wired is None else _text(wired, "drive")
        switched = [
            entry.data["external"] for entry in self._trace.select(source=drive, kind="drive.zero_mark")
        ]
        low, high = float(path.position.min()), float(path.position.max())
        if pitch <= 0.0 or (switched and switched[-1]) or (high - low) / pitch > _MOST_MARKS:
            return lane
        turns = range(
            int(np.ceil((low - drawing.mark) / pitch)), int(np.floor((high - drawing.mark) / pitch)) + 1
        )
        lane.bars += [[drawing.mark + turn * pitch] * 2 for turn in turns if turn]
        return lane

    # -- steps
    # ------------------------------------------------------------------------------------------------

    def _active_steps(
        self, drawing: HomingDrawing, path: _Path, parts: list[Event], mark_s: float | None, end_s: float
    ) -> Iterator[HomingStep]:
        """Yield moments and travels in turn, as the manual numbers them."""
        cycle = self._trace.constants.get(f"{drawing.axis}.cycle_s", 0.004)
        times = [entry.time_ns * 1e-9 for entry in parts] + [end_s]
        for index, (entry, begin_s, until_s) in enumerate(zip(parts, times, times[1:], strict=False)):
            name = _text(entry, "phase")
            if index == 0:
                yield _moment("start", begin_s, path)
            elif name == "home":
                at = _moment("mark", float(mark_s or begin_s), path)
                at.begin = at.end = at.begin if drawing.mark is None else drawing.mark
                yield at
            else:
                moment_s, cause = _cause(drawing.lanes, begin_s - _CAUSE_CYCLES * cycle, begin_s)
                yield _moment(cause, moment_s, path)
            yield _travel(name, int(_number(entry, "direction")), begin_s, until_s, path)
        if drawing.home is None:
            yield _moment("end", end_s, path)
            if path.time[-1] - end_s > 2.0 * cycle:
                yield _travel("stop", int(np.sign(path.speed(end_s))), end_s, float(path.time[-1]), path)
        else:
            yield _moment("home position", end_s, path)


def _passive_steps(
    drawing: HomingDrawing, path: _Path, mark_s: float | None, end_s: float
) -> Iterator[HomingStep]:
    """Yield what happened while the job waited: the switches that were passed, and the mark."""
    yield _moment("start", float(path.time[0]), path)
    until_s = end_s if mark_s is None else mark_s
    edges = [
        (edge, lane.name)
        for lane in drawing.lanes
        for edge in lane.edges
        if lane.name in {"cam", "input"} and edge.time_s <= until_s
    ]
    last_s = float(path.time[0])
    for edge, name in sorted(edges, key=lambda pair: pair[0].time_s):
        if mark_s is not None and drawing.mark_kind == "digital input" and edge is edges[-1][0]:
            break  # the mark itself
        yield _travel("motion", edge.direction, last_s, edge.time_s, path)
        yield _moment(f"{name} {'reached' if edge.active else 'left'}", edge.time_s, path)
        last_s = edge.time_s
    if mark_s is None:
        yield _travel("motion", int(np.sign(path.speed(end_s))), last_s, end_s, path)
        yield _moment("end", end_s, path)
        return
    yield _travel("motion", int(np.sign(path.speed(mark_s))), last_s, mark_s, path)
    at = _moment("mark", mark_s, path)
    at.begin = at.end = at.begin if drawing.mark is None else drawing.mark
    yield at
    yield _travel("motion", int(np.sign(path.speed(mark_s))), mark_s, float(path.time[-1]), path)


def _number(entry: Event, key: str) -> float:
    value = entry.data[key]
    if isinstance(value, int | float):
        return float(value)
    raise RecordingError(f"event {entry.kind}: {key} is {value!r}, which is no number")


def _text(entry: Event, key: str) -> str:
    return str(entry.data[key])


def _moment(name: str, time_s: float, path: _Path) -> HomingStep:
    place, velocity = path.at(time_s), path.speed(time_s)
    return HomingStep(name, 0, time_s, time_s, place, place, velocity)


def _travel(name: str, direction: int, begin_s: float, end_s: float, path: _Path) -> HomingStep:
    speeds = path.velocity[path.between(begin_s, end_s)]
    ahead = speeds * (direction or 1.0)
    # Of a phase that begins with the rest of the opposite motion, its own direction counts.
    top = float(speeds[int(np.argmax(ahead if direction else np.abs(speeds)))])
    return HomingStep(name, direction, begin_s, end_s, path.at(begin_s), path.at(end_s), top, travel=True)


def _cause(lanes: Iterable[SwitchLane], since_s: float, until_s: float) -> tuple[float, str]:
    """Return the moment and the name of the switch that changed last before a phase; without one the phase
    begins by itself.
    """
    found = [
        (edge.time_s, f"{lane.name} {'reached' if edge.active else 'left'}")
        for lane in lanes
        for edge in lane.edges
        if since_s <= edge.time_s <= until_s
    ]
    return max(found, default=(until_s, "turn"))


def _widen(lane: SwitchLane, path: _Path, begin_s: float, end_s: float) -> None:
    """Add where a switch was active, joined with what overlaps."""
    way = path.way(begin_s, end_s)
    low, high = float(way.min()), float(way.max())
    apart = [bar for bar in lane.bars if bar[1] < low or bar[0] > high]
    joined = [bar for bar in lane.bars if bar not in apart]
    low = min([low, *(bar[0] for bar in joined)])
    high = max([high, *(bar[1] for bar in joined)])
    lane.bars = sorted([*apart, [low, high]])


def _thinned(path: _Path, moments: Iterable[float]) -> list[list[float]]:
    """Return the points that a picture needs: as soon as position or velocity have moved visibly, and at
    every moment of a step.
    """
    extent = max(float(np.ptp(path.position)), 1e-9) / _FINE
    speed = max(float(np.ptp(path.velocity)), 1e-9) / _FINE
    always = {int(np.searchsorted(path.time, moment)) for moment in moments}
    kept: list[list[float]] = []
    last = len(path.time) - 1
    for index, (time, place, velocity) in enumerate(
        zip(path.time, path.position, path.velocity, strict=True)
    ):
        moved = (
            not kept or abs(place - kept[-1][1]) > 4.0 * extent or abs(velocity - kept[-1][2]) > 4.0 * speed
        )
        if moved or index in always or index == last:
            kept.append([round(float(time), 6), round(float(place), 5), round(float(velocity), 4)])
    return kept
