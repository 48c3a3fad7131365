"""What rules look at: an axis, a drive, the frames of a drive; columns, events and numbers of the bench."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from hil.expect.rules._component import ComponentView, kept
from hil.expect.rules._definition import Excuses, Flags, Numbers
from hil.expect.rules._frames import BusFrames, ProcessData

if TYPE_CHECKING:
    from fieldbus.history import Event
    from hil.record import Trace

_ENDLESS: Final = float("inf")
CONTROLLED: Final = (
    "enable_ramp",
    "standstill",
    "motion",
    "halting",
    "stopping",
    "stop_hold",
    "alarm_ramp",
    "alarm_standstill",
    "disabling_ramp",
)
"""States in which the axis makes its setpoints."""
_LASTING: Final = ("mechanics.coupling_break",)
"""Faults of a moment that nothing takes back."""
OWN_CLOCK: Final = ("drive.clock_drift", "drive.clock_jitter")
"""Faults by which a drive makes more or fewer steps in a cycle of the bench."""
RESTARTS: Final = ("drive.reset", "drive.power_off")
BOOT: Final = "drive.boot"
"""What a start of a drive is called among the excuses."""


class EventIndex:
    """The events of a trace by source and kind."""

    def __init__(self, events: Iterable[Event]) -> None:
        self._by_both: dict[tuple[str, str], list[tuple[int, Event]]] = {}
        self._by_kind: dict[str, list[tuple[int, Event]]] = {}
        self._asked: dict[tuple[str, ...], list[Event]] = {}
        for numbered in enumerate(events):
            entry = numbered[1]
            self._by_both.setdefault((entry.source, entry.kind), []).append(numbered)
            self._by_kind.setdefault(entry.kind, []).append(numbered)

    def of(self, source: str, *kinds: str) -> list[Event]:
        """Return the events of a source, of some kinds, in the order in which they came."""
        found = self._asked.get((source, *kinds))
        if found is None:
            some = [self._by_both.get((source, kind), []) for kind in kinds]
            found = self._asked[source, *kinds] = _in_order(some)
        return found.copy()

    def all(self, *kinds: str) -> list[Event]:
        """Return the events of some kinds from any source, in the order in which they came."""
        return _in_order([self._by_kind.get(kind, []) for kind in kinds])


def _in_order(found: list[list[tuple[int, Event]]]) -> list[Event]:
    filled = [one for one in found if one]
    if len(filled) == 1:
        return [entry for _, entry in filled[0]]
    return [entry for _, entry in sorted((pair for one in filled for pair in one), key=_place)]


def _place(pair: tuple[int, Event]) -> int:
    return pair[0]


class TraceView:
    """A trace with everything that several rules need."""

    def __init__(self, trace: Trace) -> None:
        self.trace = trace
        self.events = EventIndex(trace.events)
        self.numbers = trace.constants
        pairs = {} if trace.vocabulary is None else dict(trace.vocabulary.drives)
        axes = [
            name
            for name in trace.components_with("actual_position", "actual_velocity", "state")
            if f"{name}.unit_per_rpm" in self.numbers
        ]
        drives = [
            group.name
            for group in trace.groups
            if f"{group.name}.emulated" in self.numbers or f"{group.name}.max_speed_rpm" in self.numbers
        ]
        self.axes = {name: AxisView(self, name, pairs.get(name, "")) for name in axes}
        self.drives = {name: DriveView(self, name) for name in drives}
        self._faults = self._fault_spans()

    def drive(self, name: str) -> DriveView | None:
        """Return a drive that is recorded."""
        return self.drives.get(name)

    @cached_property
    def frames(self) -> BusFrames:
        """The frames of the CAN buses."""
        return BusFrames(self.trace)

    @cached_property
    def cycle_s(self) -> float:
        """Cycle of the bench, s; 4 ms where no axis tells."""
        axes = [axis.cycle_s for axis in self.axes.values()]
        # Axes of an NC say it as a number of the trace alone.
        return min(
            axes or [value for key, value in self.numbers.items() if key.endswith(".cycle_s")], default=0.004
        )

    def _fault_spans(self) -> list[tuple[str, float, float, str]]:
        """Return target, begin, end and kind of every fault that was applied."""
        found: list[tuple[str, float, float, str]] = []
        active: dict[object, tuple[str, float, str]] = {}
        # A frame that is delayed, or an event of the moment, may hit after the fault has been removed.
        for entry in self.events.all("fault.applied", "fault.hit", "fault.removed"):
            now_s, number = entry.time_ns * 1e-9, (entry.source, entry.data.get("injection"))
            kind = str(entry.data.get("fault", ""))
            if entry.kind == "fault.removed":
                begun = active.pop(number, None)
                if begun is not None:
                    found.append((begun[0], begun[1], now_s, begun[2]))
            elif entry.kind == "fault.hit" or entry.data.get("momentary"):
                found.append((entry.source, now_s, _ENDLESS if kind in _LASTING else now_s, kind))
            else:
                active[number] = (entry.source, now_s, kind)
        found += [(source, begin_s, _ENDLESS, kind) for source, begin_s, kind in active.values()]
        return found + self._stopped() + self._boots()

    def _stopped(self) -> list[tuple[str, float, float, str]]:
        """Return when the controller does not run: its objects stand as they were."""
        found, begin = [], None
        for entry in self.events.all("controller.state"):
            now_s = entry.time_ns * 1e-9
            if entry.data.get("to") != "RUN":
                begin = now_s if begin is None else begin
            elif begin is not None:
                found.append((entry.source, begin, now_s, "controller.state"))
                begin = None
        return found if begin is None else [*found, ("controller", begin, _ENDLESS, "controller.state")]

    def _boots(self) -> list[tuple[str, float, float, str]]:
        """Return when drives start anew: what they send until then is nothing of theirs."""
        found = []
        begun: dict[str, float] = {}
        for entry in self.events.all("nmt.state", "fault.applied", "link.up"):
            now_s, source = entry.time_ns * 1e-9, entry.source
            if entry.data.get("to") == "INITIALISING" or entry.data.get("fault") in RESTARTS:
                begun.setdefault(source, now_s)
            elif (entry.data.get("to") == "OPERATIONAL" or entry.kind == "link.up") and source in begun:
                found.append((source, begun.pop(source), now_s, BOOT))
        return found + [(source, begin_s, _ENDLESS, BOOT) for source, begin_s in begun.items()]

    def boots(self, drive: str) -> list[float]:
        """Return when a drive has begun to start anew, s; its first start is before the trace."""
        return [begin_s for source, begin_s, _, kind in self._faults if source == drive and kind == BOOT]

    def excuses(self, own: Iterable[str]) -> Excuses:
        """Return the faults that hit one of these parts, or what all parts share: a bus, the controller."""
        parts = set(own)
        others = {*self.axes, *self.drives} - parts
        return Excuses(
            [(begin, end, kind) for source, begin, end, kind in self._faults if source not in others]
        )


class AxisView(ComponentView):
    """An axis of the controller, on the grid of its cycle."""

    def __init__(self, whole: TraceView, name: str, drive: str) -> None:
        super().__init__(whole.trace, name)
        self.whole = whole
        self.drive_name = drive
        self.cycle_s = float(whole.numbers.get(f"{name}.cycle_s", 0.0)) or self._usual_step()
        self._numbers: dict[str, Numbers | None] = {}

    def _usual_step(self) -> float:
        times = self.time_s
        return float(np.median(np.diff(times))) if len(times) > 1 else 0.004

    @property
    def has_position(self) -> bool:
        """Whether it is more than a speed axis."""
        return bool(self.unit("actual_position"))

    @cached_property
    def ratio(self) -> int:
        """Cycles of the servo to one of the interpolator."""
        return max(
            1, round((self.whole.numbers.get(f"{self.name}.interpolator_s") or self.cycle_s) / self.cycle_s)
        )

    @property
    def drive(self) -> DriveView | None:
        """Its drive, where that is recorded."""
        return self.whole.drives.get(self.drive_name)

    @cached_property
    def excuses(self) -> Excuses:
        """The faults that hit it."""
        return self.whole.excuses((self.name, self.drive_name))

    @cached_property
    def simulated(self) -> Flags:
        """The samples in which it uses no drive (StatusWord.X25)."""
        return self.bit(25) if self.has("status_word") else kept(np.zeros(len(self.time_s), dtype=bool))

    def number(self, path: str) -> float | None:
        """Return a number of the bench, or the value of a variable that nobody has assigned."""
        if path in self._assigned:
            return None
        return self.whole.numbers.get(f"{self.name}.{path}")

    def off(self, path: str) -> bool:
        """Return whether a function is switched off for good, or the object does not have it."""
        return path not in self._assigned and not self.whole.numbers.get(f"{self.name}.{path}")

    def number_over_time(self, path: str) -> Numbers | None:
        """Return the value of a variable in every cycle, with assignments of the program and restarts."""
        if path not in self._numbers:
            found = self._number_over_time(path)
            self._numbers[path] = None if found is None else kept(found)
        return self._numbers[path]

    def _number_over_time(self, path: str) -> Numbers | None:
        start = self.whole.numbers.get(f"{self.name}.{path}")
        if start is None:
            return None
        values = np.full(len(self.time_s), start)
        changes = self._assigned.get(path)
        if not changes:
            return values
        if self.whole.events.all("controller.initialised", "controller.state"):
            return None
        for time_ns, value, is_start in sorted([*self._restarts, *changes], key=lambda one: one[0]):
            if is_start and value is not None:
                start = value
            else:
                values[self.index_of(time_ns) :] = start if value is None else value
        return values

    @cached_property
    def _restarts(self) -> list[tuple[int, float | None, bool]]:
        """The ends of restarts, which put the start values into force."""
        return [
            (entry.time_ns, None, False)
            for entry in self.whole.events.of(self.name, "axis.state")
            if entry.data.get("from") == "RESTARTING"
        ]

    @cached_property
    def _assigned(self) -> dict[str, list[tuple[int, float | None, bool]]]:
        """Time, value and whether it is a start value, of the assignments of each variable."""
        found: dict[str, list[tuple[int, float | None, bool]]] = {}
        for entry in self.whole.events.of(self.name, "program.write"):
            value = entry.data.get("in_runtime_unit", entry.data.get("value"))
            if isinstance(value, int | float):
                found.setdefault(str(entry.data.get("variable")), []).append(
                    (entry.time_ns, float(value), bool(entry.data.get("start")))
                )
        return found

    @cached_property
    def restarted(self) -> bool:
        """Whether the object was initialised again in the trace, by which variables change."""
        return bool(self._restarts) or bool(
            self.whole.events.all("controller.initialised", "controller.state")
        )

    @cached_property
    def gaps(self) -> Flags:
        """The samples that do not follow the one before by one cycle; the first is one."""
        gaps = np.ones(len(self.time_s), dtype=bool)
        gaps[1:] = np.abs(np.diff(self.time_s) - self.cycle_s) > 0.01 * self.cycle_s
        return kept(gaps)


class DriveView(ComponentView):
    """A drive, on the grid of the bench cycle: its columns, its telegrams, its numbers."""

    def __init__(self, whole: TraceView, name: str) -> None:
        super().__init__(whole.trace, name)
        self.whole = whole

    @cached_property
    def axis(self) -> AxisView | None:
        """The axis that it moves."""
        return next((one for one in self.whole.axes.values() if one.drive_name == self.name), None)

    @cached_property
    def excuses(self) -> Excuses:
        """The faults that hit it."""
        return self.whole.excuses((self.name, self.axis.name if self.axis is not None else ""))

    def number(self, name: str) -> float | None:
        """Return a number of the bench file."""
        return self.whole.numbers.get(f"{self.name}.{name}")

    @cached_property
    def data(self) -> ProcessData | None:
        """Its cyclic data on CAN; None where it has none, or objects, units or PDOs of its own."""
        if self.node is None:
            return None
        words = None
        if self.number("cia402") is not None:
            if self.number("standard_mapping") == 0.0:
                return None
        else:
            prefix = f"{self.name}."
            words = {
                key.removeprefix(prefix): int(value)
                for key, value in self.whole.numbers.items()
                if key.startswith((f"{prefix}setpoint.", f"{prefix}actual."))
            }
        return ProcessData(self.whole.frames, *self.node, words)

    @cached_property
    def node(self) -> tuple[str, int] | None:
        """Bus and node-ID on CAN."""
        for bus in self._trace.can_buses:
            number = self.whole.numbers.get(f"{self.name}.node.{bus}")
            if number is not None:
                return bus, int(number)
        return None
