"""Expectations chosen from what was observed: alarms with time, stops, states, positions, ends of jobs."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

from hil import expect
from hil.cockpit.code_text import Call, Code, event_call
from hil.cockpit.rehearsal import Look, Moment, Outputs
from hil.cockpit.steps import Command, Inject, SetInputs, Step
from hil.expect import Expectation, evaluate, measure_stop
from reports.model import Verdict

if TYPE_CHECKING:
    from fieldbus.history import Event
    from hil.record import EventSelector, Trace

_SETTLED_S: Final = 0.05
"""How long a state has to have been there to be expected."""
_MOVES: Final = 0.02
"""Share of the velocity limit from which on an axis counts as moving when something happens."""
_STOPPING: Final = {"halt": "MC_Halt", "stop": "MC_Stop"}
_PLACES: Final = ("home", "move_absolute", "move_relative")


@dataclass(frozen=True)
class Begun:
    """The time of a step as a reference: a command to an NC axis leaves no event."""

    number: int
    """Of the step, from 0."""
    offset_s: float = 0.0


Reference = Call | Begun


@dataclass(frozen=True)
class Stopped:
    """A stop that was measured: from a reference to rest."""

    axis: str
    since: Reference
    distance: float
    tolerance: float
    unit: str

    def measured(self, moment: Moment) -> float | None:
        """Return the travel of the same stop in another run; None: it was none."""
        when = _instant(moment, self.since)
        if when is None:
            return None
        return measure_stop(
            moment.trace,
            when,
            velocity=f"{self.axis}.actual_velocity",
            position=f"{self.axis}.actual_position",
        ).distance

    def holds(self, moment: Moment) -> bool:
        """Return whether another run has the same travel."""
        found = self.measured(moment)
        return found is not None and abs(found - self.distance) <= self.tolerance


@dataclass(frozen=True)
class JobEnd:
    """How the instance of a step ended."""

    number: int
    """Of the step, from 0."""
    output: str
    """`Error` or `CommandAborted`."""
    error_id: int

    def holds(self, made: Sequence[Outputs]) -> bool:
        """Return whether another run ended it the same way."""
        job = made[self.number] if self.number < len(made) else Outputs()
        return (job.error if self.output == "Error" else job.aborted) and job.error_id == self.error_id


@dataclass(frozen=True)
class Judgement:
    """What a test says at a look."""

    reference: Reference | None
    """What it counts from; None: there is nothing."""
    expectations: tuple[Call, ...]
    stops: tuple[Stopped, ...]
    ends: tuple[JobEnd, ...]


class Chooser:
    """Chooses expectations that hold in every rehearsal.

    Args:
        steps: All steps of the session.
        axes: Names of the axes.
        nc: Those of an NC.
        cycle_s: Bus cycle, s.

    """

    def __init__(
        self, steps: Sequence[Step], axes: Sequence[str], nc: Collection[str], cycle_s: float
    ) -> None:
        self._steps = steps
        self._axes = tuple(axes)
        self._nc = nc
        self._cycle_s = cycle_s
        self._looked_s = 0.0
        """Time of the last look."""
        self._stated: set[int] = set()
        """Steps whose end has been stated."""

    def judge(self, look: Look, moments: Sequence[Moment]) -> Judgement:
        """Return what holds at a look in all rehearsals.

        Args:
            look: Where.
            moments: The same moment in each rehearsal, the first of which is observed.

        """
        first = moments[0]
        reference = self._reference(look, first)
        candidates = list(self._candidates(look, first, reference))
        kept = [one for one in candidates if all(_holds(one, moment) for moment in moments)]
        judged = {(one.options or {}).get("axis", self._axes[0]) for one in kept if one.function == "stop"}
        stops = [
            one
            for one in self._stops(first, reference)
            if one.axis not in judged and all(one.holds(moment) for moment in moments)
        ]
        ends = [one for one in self._ends(look, first) if all(one.holds(moment.made) for moment in moments)]
        self._stated.update(one.number for one in ends)
        self._looked_s = first.trace.end_s
        return Judgement(reference, tuple(_best(kept)), tuple(stops), tuple(ends))

    # -- from when on -------------------------------------------------------------------------------------

    def _reference(self, look: Look, moment: Moment) -> Reference | None:
        """Return the last thing since the last look that broke or stopped something; None: there is none."""
        found: Reference | None = None
        latest_s = self._looked_s
        for number in range(look.steps[-1] + 1):
            event = self._event_of(number)
            when = None if event is None else _instant(moment, event)
            if when is not None and when >= latest_s - 1e-9:
                found, latest_s = event, when
        return found

    def _event_of(self, number: int) -> Reference | None:
        step, before = self._steps[number], self._steps[:number]
        if isinstance(step, Inject):
            kinds = [one.fault.kind for one in self._steps if isinstance(one, Inject)]
            if len(kinds) == 1:
                return event_call("fault.applied")
            nth = 1 + sum(isinstance(one, Inject) and one.fault.kind == step.fault.kind for one in before)
            return event_call("fault.applied", fault=step.fault.kind, nth=nth)
        if not isinstance(step, Command):
            return None
        if step.axis in self._nc:
            stops = step.name in _STOPPING or step.inputs.get("enable") is False
            return Begun(number) if stops else None
        if step.name == "power" and step.inputs.get("enable") is False:
            nth = 1 + sum(
                isinstance(one, Command)
                and (one.axis, one.name, one.inputs.get("enable")) == (step.axis, "power", False)
                for one in before
            )
            return event_call("power.disable", step.axis, nth=nth)
        if step.name in _STOPPING:
            nth = 1 + sum(
                isinstance(one, Command) and (one.axis, one.name) == (step.axis, step.name) for one in before
            )
            return event_call("job.started", step.axis, instruction=_STOPPING[step.name], nth=nth)
        return None

    # -- what may be expected -----------------------------------------------------------------------------

    def _candidates(self, look: Look, moment: Moment, reference: Reference | None) -> Iterator[Call]:
        trace = moment.trace
        since_s = self._begin(look, moment) if reference is None else _known(moment, reference)
        yield from self._alarms(trace, reference, since_s)
        if reference is not None:
            moved = self._moved_at(trace, since_s)
            for axis in moved:
                if axis not in self._nc:
                    for mode in ("emergency", "maximum", "default"):
                        yield self._call("stop", reference, mode, **self._axis(axis))
            touched = self._touched(trace, since_s)
            for axis in self._axes:
                if axis in touched or (axis in self._nc and axis in moved):
                    yield from self._rest(trace, axis, reference, since_s)
        for axis in self._touched(trace, since_s):
            yield from self._state(trace, axis)
        yield from self._places(look, moment)

    def _axis_of(self, number: int) -> str:
        step = self._steps[number]
        return step.axis if isinstance(step, Command) else ""

    def _axis(self, axis: str) -> dict[str, str]:
        return {"axis": axis} if len(self._axes) > 1 else {}

    @staticmethod
    def _call(function: str, *positional: Any, **options: Any) -> Call:
        return Call(function, positional, options, "hil.expect")

    def _begin(self, look: Look, moment: Moment) -> float:
        """Return when the first job of a look began; where there was none, the end."""
        nc = [number for number in look.steps if self._axis_of(number) in self._nc]
        if nc:
            return moment.begun_s[nc[0]]
        names = {moment.made[number].name for number in look.steps}
        times = [
            entry.time_ns
            for entry in moment.trace.select(kind="job.started")
            if entry.data.get("job") in names
        ]
        return min(times) * 1e-9 if times else moment.trace.end_s

    def _alarms(self, trace: Trace, since: Reference | None, since_s: float) -> Iterator[Call]:
        seen: set[tuple[str, object]] = set()
        for entry in trace.select(kind="alarm.raised"):
            key = (entry.source, entry.data.get("number"))
            if entry.time_ns * 1e-9 < since_s - 1e-9 or key in seen or entry.source not in self._axes:
                continue
            seen.add(key)
            options = {"reaction": int(entry.data.get("reaction") or 0)} | self._since(since, since_s, entry)
            yield self._call("alarm", int(entry.data["number"] or 0), **options, **self._axis(entry.source))
        for kind, name in (("axis.error", "axis_error"), ("command.refused", "command_refused")):
            for entry in trace.select(kind=kind):
                if entry.time_ns * 1e-9 >= since_s - 1e-9:
                    code = int(entry.data.get("error_id") or 0)
                    shown = Code(f"0x{code:04X}", code)
                    options = self._since(since, since_s, entry)
                    yield self._call(name, shown, **options, **self._axis(entry.source))
        if since is not None:
            if not seen and len(self._nc) < len(self._axes):
                yield self._call("no_alarm", since=since)
            if self._nc:
                yield self._call("no_axis_error", since=since)

    def _since(self, since: Reference | None, since_s: float, entry: Event) -> dict[str, Any]:
        if since is None:
            return {}
        delay_s = entry.time_ns * 1e-9 - since_s
        bound_s = math.ceil(1000.0 * (1.02 * delay_s + 2.0 * self._cycle_s) - 1e-6) / 1000.0
        return {"since": since, "within_s": bound_s}

    def _moved_at(self, trace: Trace, at_s: float) -> list[str]:
        """Return the axes that moved at an instant."""
        found = []
        for axis in self._axes:
            name = f"{axis}.actual_velocity"
            limit = trace.constants.get(f"{axis}.max_velocity", 0.0)
            if name in trace and len(trace[name]) and abs(trace[name].at(at_s)) > max(_MOVES * limit, 1e-6):
                found.append(axis)
        return found

    def _touched(self, trace: Trace, since_s: float) -> list[str]:
        """Return the axes that reported something since an instant."""
        sources = {entry.source for entry in trace.events if entry.time_ns * 1e-9 >= since_s - 1e-9}
        return [axis for axis in self._axes if axis in sources]

    def _rest(self, trace: Trace, axis: str, reference: Reference, since_s: float) -> Iterator[Call]:
        """Yield that an axis comes to rest and stays there."""
        name = f"{axis}.actual_velocity"
        if name not in trace:
            return
        signal = trace[name].between(since_s, trace.end_s)
        limit = 0.01 * trace.constants.get(f"{axis}.max_velocity", 100.0)
        rests_s = signal.settles(limit, after_s=since_s)
        if rests_s is None or trace.end_s - rests_s < 2 * _SETTLED_S:
            return
        bound_s = math.ceil(10.0 * (rests_s - since_s + _SETTLED_S)) / 10.0
        if since_s + bound_s >= trace.end_s:
            return
        by = _plus(reference, bound_s)
        yield self._call("standstill", by=by, tolerance=_readable(limit), **self._axis(axis))
        if f"{axis}.actual_position" in trace:
            moved = trace[f"{axis}.actual_position"].between(since_s + bound_s, trace.end_s)
            span = float(moved.values.max() - moved.values.min()) if len(moved) else 0.0
            yield self._call(
                "no_motion_after", by, tolerance=_above(max(3.0 * span, 0.05)), **self._axis(axis)
            )

    def _state(self, trace: Trace, axis: str) -> Iterator[Call]:
        last = [*trace.select(source=axis, kind="axis.state")][-1:]
        if last and trace.end_s - last[0].time_ns * 1e-9 >= _SETTLED_S:
            now = Code("bench.now_s", trace.end_s)
            yield self._call("state_at", axis, now, str(last[0].data.get("to")))

    def _places(self, look: Look, moment: Moment) -> Iterator[Call]:
        """Yield where axes are whose last job has brought them to a place, or was a jog that is over."""
        trace = moment.trace
        for axis in self._axes:
            mine = [
                number
                for number in look.steps
                if isinstance(step := self._steps[number], Command) and step.axis == axis
            ]
            name = f"{axis}.actual_position"
            if not mine or name not in trace:
                continue
            step = self._steps[mine[-1]]
            assert isinstance(step, Command)  # chosen above
            jogged = step.name == "jog" and self._let_go(mine[-1], look)
            if not jogged and (step.name not in _PLACES or not moment.made[mine[-1]].done):
                continue
            place = trace[name].at(trace.end_s)
            target = _readable(place, 6)
            if step.name == "move_absolute":
                target = float(step.inputs["position"] or 0.0)
            tolerance = _above(max(3.0 * abs(place - target), 1e-3 * abs(target), 1e-2))
            now = Code("bench.now_s", trace.end_s)
            yield self._call("value_at", name, now, target, tolerance=tolerance)

    def _let_go(self, number: int, look: Look) -> bool:
        """Return whether a jog has been ended when a look is taken."""
        ends = (self._steps[one] for one in look.steps if one > number)
        return any(isinstance(one, SetInputs) and one.step == number for one in ends)

    # -- numbers and jobs ---------------------------------------------------------------------------------

    def _stops(self, moment: Moment, reference: Reference | None) -> Iterator[Stopped]:
        if reference is None:
            return
        trace, since_s = moment.trace, _known(moment, reference)
        for axis in self._moved_at(trace, since_s):
            if f"{axis}.actual_position" not in trace:
                continue
            speed = abs(trace[f"{axis}.actual_velocity"].at(since_s))
            name = f"{axis}.actual_position"
            blank = Stopped(axis, reference, 0.0, 0.0, trace[name].unit)
            distance = blank.measured(moment)
            if distance is not None:
                tolerance = _above(max(2.0 * self._cycle_s * speed, 1e-3 * distance))
                shown = round(distance, max(0, 2 - math.floor(math.log10(tolerance))))
                yield Stopped(axis, reference, shown, tolerance, trace[name].unit)

    def _ends(self, look: Look, moment: Moment) -> Iterator[JobEnd]:
        for number, step in enumerate(self._steps[: look.steps[-1] + 1]):
            job = moment.made[number]
            if number in self._stated or not isinstance(step, Command) or step.name.startswith("power"):
                continue
            if job.error or job.aborted:
                yield JobEnd(number, "Error" if job.error else "CommandAborted", job.error_id)


def _plus(reference: Reference, seconds: float) -> Reference:
    """Return the instant some time after a reference."""
    if isinstance(reference, Begun):
        return Begun(reference.number, reference.offset_s + seconds)
    return Call(
        reference.function,
        reference.positional,
        reference.options,
        reference.module,
        made=reference.made.plus(seconds),
        suffix=f".plus({seconds!r})",
    )


def expectation(call: Call) -> Expectation:
    """Return the expectation that a call makes."""

    def value(one: Any) -> Any:
        return one.made if isinstance(one, Call) else one.value if isinstance(one, Code) else one

    made = getattr(expect, call.function)(
        *map(value, call.positional), **{name: value(one) for name, one in (call.options or {}).items()}
    )
    assert isinstance(made, Expectation)  # by the names used here
    return made


def _holds(call: Call, moment: Moment) -> bool:
    now = Call(
        call.function,
        tuple(_timed(one, moment) for one in call.positional),
        {name: _timed(one, moment) for name, one in (call.options or {}).items()},
        call.module,
    )
    return all(check.verdict is Verdict.PASSED for check in evaluate(moment.trace, [expectation(now)]))


def _timed(value: Any, moment: Moment) -> Any:
    """Return a time that a run has of its own: `bench.now_s` as its end, and that of a step."""
    if isinstance(value, Begun):
        return _instant(moment, value)
    return (
        Code(value.text, moment.trace.end_s)
        if isinstance(value, Code) and value.text == "bench.now_s"
        else value
    )


def _best(calls: Sequence[Call]) -> list[Call]:
    """Return expectations with only the first mode of a stop that fits."""
    found: list[Call] = []
    stops: set[object] = set()
    for call in calls:
        if call.function == "stop":
            axis = (call.options or {}).get("axis")
            if axis in stops:
                continue
            stops.add(axis)
        found.append(call)
    return found


def _instant(moment: Moment, reference: Reference) -> float | None:
    if isinstance(reference, Begun):
        number = reference.number
        return moment.begun_s[number] + reference.offset_s if number < len(moment.begun_s) else None
    selector: EventSelector = reference.made
    return moment.trace.instant(selector)


def _known(moment: Moment, reference: Reference) -> float:
    when = _instant(moment, reference)
    assert when is not None  # chosen because it is there
    return when


def _readable(value: float, digits: int = 3) -> float:
    return float(f"{value:.{digits}g}") + 0.0


def _above(value: float) -> float:
    """Return a number with one digit that is not below a value."""
    size = 10.0 ** math.floor(math.log10(value)) if value > 0.0 else 1.0
    return float(f"{math.ceil(value / size - 1e-9) * size:.3g}")
