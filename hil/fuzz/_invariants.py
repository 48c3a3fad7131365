"""Invariants of a fuzz run: watched in every application cycle, from recorded signals and the event log
only.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from fieldbus.clock import seconds_to_ns
from fieldbus.history import Event
from hil.expect._motion_rules import REST_SPEED, REST_TRAVEL, WINDOW_S, commanded
from hil.expect._profidrive_rules import PULSES
from hil.expect._words import cia402_state
from hil.expect.golden import stop_time

_TORQUE: Final = frozenset({"operation_enabled", "quick_stop_active", "fault_reaction_active"})
_WINDOW_NS: Final = tuple(seconds_to_ns(seconds) for seconds in WINDOW_S)
_DRIVE_STOP_S: Final = 3.0
"""Longest stop that a drive makes by itself, coasting included, when the bench states none."""


@dataclass(frozen=True, slots=True)
class Violation:
    """A broken invariant."""

    invariant: str
    time_s: float
    text: str
    requirements: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.invariant} broken at {self.time_s:.6f} s: {self.text}"


class Invariant:
    """Base: `cycle` is called at the end of every application cycle and returns what is wrong, or an empty
    text.
    """

    name = ""
    requirements: tuple[str, ...] = ()

    def cycle(self) -> str:
        """Look at the present cycle."""
        raise NotImplementedError

    def event(self, entry: Event) -> None:
        """Take note of an event."""

    def horizon_ns(self) -> int:
        """Time up to which the bench must run for the invariant to be decided; 0 for none."""
        return 0


def _reader(bench: Any, signal: str) -> Callable[[], float | None] | None:
    return bench.recorder.reader(signal) if bench.recorder.has_signal(signal) else None


def _unit(bench: Any, signal: str) -> str:
    component, _, column = signal.partition(".")
    for group in bench.trace().groups:
        if group.name == component:
            return next((unit for name, unit in group.columns if name == column), "")
    return ""


def _torque_reader(bench: Any, drive: str) -> tuple[Callable[[], bool | None], Callable[[], str]]:
    """Return what tells whether a drive may give torque (None: unknown), and the words that say so, for the
    message.
    """
    statusword = _reader(bench, f"{drive}.statusword")
    zsw2 = _reader(bench, f"{drive}.drive_zsw2")
    read = statusword if statusword is not None else zsw2

    def torque() -> bool | None:
        word = None if read is None else read()
        if word is None:
            return None
        return cia402_state(int(word)) in _TORQUE if statusword is not None else bool(int(word) & PULSES)

    def text() -> str:
        word = None if read is None else read()
        name = "statusword" if statusword is not None else "ZSW2"
        return "" if word is None else f"{name} 16#{int(word):04X}"

    return torque, text


class _Faulted:
    """Tells whether faults of some kinds are active, or were a short time ago."""

    def __init__(self, bench: Any, kinds: tuple[str, ...], after_s: float) -> None:
        self._scheduler = bench.scheduler
        self._kinds = kinds
        self._after_ns = seconds_to_ns(after_s)
        self._active: set[Any] = set()
        self._last_ns = -self._after_ns - 1

    def event(self, entry: Event) -> bool:
        """Take note; returns whether the event concerned one of the kinds."""
        if not str(entry.data.get("fault", "")).startswith(self._kinds):
            return False
        if entry.kind == "fault.applied":
            self._active.add(entry.data.get("injection"))
        elif entry.kind == "fault.removed":
            self._active.discard(entry.data.get("injection"))
        self._last_ns = entry.time_ns
        return True

    def __bool__(self) -> bool:
        return bool(self._active) or bool(self._scheduler.now - self._last_ns <= self._after_ns)


class NoMotionWithoutTorque(Invariant):
    """A drive without torque coasts at most: its mechanics get no faster."""

    name = "no motion without torque"
    requirements = ("STP-331", "C402-010", "PD-104")

    def __init__(self, bench: Any, axis: str, drive: str) -> None:
        self._torque, self._text = _torque_reader(bench, drive)
        self._speed = _reader(bench, f"{drive}.motor_speed")
        self._output = _reader(bench, f"{axis}.speed_output")
        self._outputs: deque[float] = deque(maxlen=3)
        self._velocity = _reader(bench, f"{drive}.velocity")
        self._rest = REST_SPEED.get(_unit(bench, f"{drive}.velocity"), 0.0005)
        self._position = _reader(bench, f"{drive}.position")
        self._stops = _EndStops(bench, drive)
        self._pushed = _Faulted(bench, ("mechanics.",), 0.5)
        self._jolted = _Faulted(bench, ("encoder.",), 0.02)
        self._scheduler = bench.scheduler
        self._earlier: deque[tuple[int, float]] = deque()
        self._entry: float | None = None
        """Greatest speed at the begin of the time without torque; 0 once that is long ago, None when unknown.
        """
        self._last = 0.0

    def event(self, entry: Event) -> None:
        """Take note of forces from outside and of jolts of the encoder."""
        self._pushed.event(entry)
        self._jolted.event(entry)

    def _was_commanded(self) -> bool:
        """Whether in the very cycle in which the torque went a setpoint that jumped may still have driven the
        axis.
        """
        speed = None if self._speed is None else self._speed()
        return speed is not None and commanded(speed, self._outputs)

    def cycle(self) -> str:
        """Compare the speed with what it was a moment ago."""
        output = None if self._output is None else self._output()
        if output is not None:
            self._outputs.append(output)
        if self._velocity is None or self._position is None:
            return ""
        torque, velocity, position = self._torque(), self._velocity(), self._position()
        if torque is None or velocity is None or position is None:
            return ""
        now, speed = self._scheduler.now, abs(velocity)
        earlier = self._earlier
        if self._pushed or self._stops.touched(position):
            earlier.clear()
            self._entry = None
            return ""
        if torque:
            earlier.clear()
            # Next time the torque may be gone, and the speed may have changed once more until then.
            self._entry = None if self._jolted else speed + 1.5 * abs(speed - self._last)
            self._last = speed
            return ""
        while earlier and earlier[0][0] < now - _WINDOW_NS[1]:
            earlier.popleft()
            self._entry = 0.0
        if self._entry is None or self._jolted or (not earlier and self._was_commanded()):
            self._entry = max(speed, self._entry or 0.0)
        limit = now - _WINDOW_NS[0]
        before = self._entry
        for when, value in earlier:
            if when > limit:
                break
            before = max(before, value)
        earlier.append((now, speed))
        if speed > before * 1.02 + self._rest:
            return f"{velocity:.4g} after {before:.4g} with {self._text()}"
        return ""


class _EndStops:
    """Tells whether the axis is, or was a moment ago, at an end stop that the bench has stated the place
    of.
    """

    def __init__(self, bench: Any, drive: str) -> None:
        constants = bench.trace().constants
        slack = REST_TRAVEL.get(_unit(bench, f"{drive}.position"), 0.0001)
        self._low = constants.get(f"{drive}.negative_stop", float("-inf")) + slack
        self._high = constants.get(f"{drive}.positive_stop", float("inf")) - slack
        self._scheduler = bench.scheduler
        self._until_ns = -1

    def touched(self, position: float) -> bool:
        """Take note of the present position."""
        if not self._low < position < self._high:
            self._until_ns = self._scheduler.now + seconds_to_ns(0.5)
        return bool(self._scheduler.now <= self._until_ns)


class RestAfterAlarm(Invariant):
    """After an alarm with a stop reaction a drive with torque stands within the bound of that reaction."""

    name = "rest after an alarm"
    requirements = ("STP-348", "STP-386", "STP-387", "STP-388")

    def __init__(self, bench: Any, axis: str, drive: str) -> None:
        self._scheduler = bench.scheduler
        self._axis = axis
        self._velocity = _reader(bench, f"{drive}.velocity")
        self._torque, _ = _torque_reader(bench, drive)
        self._rest = 4 * REST_SPEED.get(_unit(bench, f"{drive}.velocity"), 0.0005)
        self._constants = bench.trace().constants
        self._pushed = _Faulted(bench, ("mechanics.",), 0.5)
        self._foreign = _Faulted(bench, ("frame.", "drive.", "encoder.", "telegram.", "safety."), 0.1)
        self._due_ns: dict[Any, int] = {}

    def _bound_s(self, reaction: int) -> float:
        constant: Callable[[str, float], float] = self._constants.get
        velocity = constant(f"{self._axis}.max_velocity", 500.0)
        by_drive = constant(f"{self._axis}.longest_drive_stop_s", _DRIVE_STOP_S)
        slowest = constant(f"{self._axis}.deceleration", 1000.0)
        ramps = {
            1: (slowest, constant(f"{self._axis}.jerk", 0.0)),
            2: (constant(f"{self._axis}.max_deceleration", slowest), constant(f"{self._axis}.max_jerk", 0.0)),
            3: (constant(f"{self._axis}.emergency_deceleration", slowest), 0.0),
        }
        if self._foreign:
            return max(by_drive, _DRIVE_STOP_S)
        if reaction not in ramps:
            return by_drive
        return stop_time(velocity, *ramps[reaction]) + 0.25

    def event(self, entry: Event) -> None:
        """Start or end a deadline."""
        if self._pushed.event(entry):
            # No bound can be calculated for an axis that somebody pushes.
            self._due_ns.clear()
        if self._foreign.event(entry) and self._due_ns:
            latest = self._scheduler.now + seconds_to_ns(_DRIVE_STOP_S)
            self._due_ns = dict.fromkeys(self._due_ns, latest)
        if entry.source != self._axis:
            return
        stops = 1 <= int(entry.data.get("reaction") or 0) <= 4
        if entry.kind == "alarm.raised" and stops and not self._pushed:
            bound = self._bound_s(int(entry.data.get("reaction") or 0))
            self._due_ns[entry.data.get("number")] = entry.time_ns + seconds_to_ns(bound)
        elif entry.kind == "alarm.cleared":
            self._due_ns.pop(entry.data.get("number"), None)

    def _has_torque(self) -> bool:
        """Whether the drive is on; an axis that coasts is the business of another invariant."""
        return self._torque() is not False

    def horizon_ns(self) -> int:
        """Return the last deadline while the axis still moves."""
        velocity = None if self._velocity is None else self._velocity()
        if velocity is None or abs(velocity) <= self._rest or not self._has_torque():
            return 0
        return max(self._due_ns.values(), default=0)

    def cycle(self) -> str:
        """Once a deadline has passed the axis must stand while its alarm is pending."""
        if not self._due_ns or self._velocity is None or self._pushed:
            return ""
        velocity = self._velocity()
        now = self._scheduler.now
        if velocity is None or abs(velocity) <= self._rest or not self._has_torque():
            return ""
        for number, due in self._due_ns.items():
            if now > due:
                return f"still {velocity:.4g} although alarm {number} is pending and its stop is over"
        return ""


class ComesUp(Invariant):
    """Enabled before anything else is asked of it, a sound axis comes into operation within a moment, without
    an alarm.
    """

    name = "comes up"
    requirements = ("STP-015", "STP-030")
    WITHIN_S: Final = 0.2
    """What a drive may need by itself; a program waits longer after `PREAMBLE` has enabled the axis."""
    CYCLES: Final = 25
    """What the handshake of control and status word may take besides."""

    def __init__(self, bench: Any, axis: str) -> None:
        self._axis = axis
        self._scheduler = bench.scheduler
        self._enable = _reader(bench, f"{axis}.power_enable")
        self._status = _reader(bench, f"{axis}.power_status")
        self._decided = self._enable is None or self._status is None
        cycle_s = bench.trace().constants.get(f"{axis}.cycle_s", 0.004)
        self._within_ns = seconds_to_ns(self.WITHIN_S + self.CYCLES * cycle_s)
        self._since_ns: int | None = None
        self._alarm = ""

    def event(self, entry: Event) -> None:
        """Take note of alarms, and of what makes an axis that stays disabled no wonder."""
        if self._decided:
            return
        if entry.kind == "alarm.raised" and entry.source == self._axis:
            self._alarm = f"alarm {entry.data.get('number')} ({entry.data.get('text')})"
        elif entry.kind in {"fault.armed", "axis.restart"} or (
            entry.kind == "job.started" and entry.data.get("instruction") != "MC_Power"
        ):
            self._decided = True

    def cycle(self) -> str:
        """Wait for the status of `MC_Power`."""
        if self._decided or self._enable is None or self._status is None or not self._enable():
            return ""
        now = self._scheduler.now
        if self._since_ns is None:
            self._since_ns = now
        if self._status():
            self._decided = True
        elif self._alarm or now - self._since_ns > self._within_ns:
            seconds = (now - self._since_ns) * 1e-9
            return f"not enabled {seconds:.3f} s after MC_Power, {self._alarm or 'no alarm'}"
        return ""


class OneJobOutput(Invariant):
    """No instance shows two of Done, Error, CommandAborted."""

    name = "one job output"
    requirements = ("MC-071",)

    def __init__(self) -> None:
        self.jobs: list[Any] = []

    def cycle(self) -> str:
        """Look at the outputs of all instances of the program."""
        for job in self.jobs:
            shown = [name for name in ("Done", "Error", "CommandAborted") if getattr(job, name, False)]
            if len(shown) > 1:
                return f"{job.name} shows {' and '.join(shown)}"
        return ""


class FeedbackEqualsMechanics(Invariant):
    """The actual position of the axis follows the true position of the mechanics."""

    name = "position feedback equals mechanics"
    requirements = ("STP-550",)

    def __init__(self, bench: Any, axis: str, drive: str) -> None:
        self._axis = axis
        self._actual = _reader(bench, f"{axis}.actual_position")
        self._true = _reader(bench, f"{drive}.position")
        self._velocity = _reader(bench, f"{drive}.velocity")
        self._link = _reader(bench, f"{axis}.communication_ok")
        units = (_unit(bench, f"{axis}.actual_position"), _unit(bench, f"{drive}.position"))
        self._scale = {("mm", "m"): 1000.0, ("mm", "mm"): 1.0, ("m", "m"): 1.0}.get(units)
        self._cycle_s = bench.trace().constants.get(f"{axis}.cycle_s", 0.004)
        self._disturbed = _Faulted(
            bench,
            ("encoder.", "frame.", "telegram.", "modbus.truncate", "drive.power_off", "drive.sto"),
            0.1,
        )
        # A controller that does not run leaves the actual values as they were.
        self._halted = _Faulted(bench, ("controller.",), 1.0)
        self._offset: float | None = None
        self._settle = 0

    def event(self, entry: Event) -> None:
        """Take a new offset after whatever may displace the coordinates."""
        if (
            self._disturbed.event(entry)
            or self._halted.event(entry)
            or entry.kind in {"axis.homed", "link.up", "link.down"}
        ):
            self._offset = None
            self._settle = 5

    def cycle(self) -> str:
        """Compare the displacement of both positions."""
        if self._actual is None or self._true is None or self._velocity is None or self._scale is None:
            return ""
        actual, true, velocity = self._actual(), self._true(), self._velocity()
        if actual is None or true is None or velocity is None:
            return ""
        linked = self._link is None or bool(self._link())
        if self._disturbed or self._halted or not linked or self._settle:
            self._settle = max(self._settle - 1, 0)
            self._offset = None
            return ""
        difference = actual - true * self._scale
        delay = abs(velocity) * self._scale * 4 * self._cycle_s + 0.05
        if self._offset is None:
            # Taken at rest only: in motion it would hold the delay of the bus.
            if abs(velocity) * self._scale < 0.5:
                self._offset = difference
            return ""
        if abs(difference - self._offset) > delay:
            return f"they have drifted apart by {difference - self._offset:.4g} mm"
        return ""


def default_invariants(bench: Any) -> list[Invariant]:
    """Return the invariants for the default axis of a bench and its drive."""
    axis = bench.axis().name
    drive_of = getattr(bench, "drive_of", None)
    drive = drive_of(axis) if callable(drive_of) else bench.drive().name
    return [
        NoMotionWithoutTorque(bench, axis, drive),
        RestAfterAlarm(bench, axis, drive),
        OneJobOutput(),
        ComesUp(bench, axis),
        FeedbackEqualsMechanics(bench, axis, drive),
    ]
