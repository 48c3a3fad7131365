"""From the record of a session to a script: the steps, and the waits between them that matter."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from fieldbus.clock import MS, S
from hil.cockpit.steps import Command, Inject, Performer, SetInputs, Step, TimedStep
from hil.errors import ExpectationFailedError

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.bench.bench import Bench
    from hil.record import Trace

QUIET_S: Final = 0.5
"""A pause in which nothing happens is cut to this: an operator thinks longer than a test."""
_AFTERMATH_S: Final = 0.2
"""What still happens so shortly behind the end of a job is no reason to wait."""
_HAPPENS: Final = ("alarm.", "axis.", "controller.", "drive.", "fault.", "homing.", "job.", "link.", "power.")
"""Events that say that something is still going on."""
_REST: Final = 0.005
"""Share of its greatest velocity at which an axis counts as resting."""
WAITED_FOR: Final = {
    "power": ("status", "power.status"),
    "power_when_ready": ("status", "power.status"),
    "home": ("done", "job.done"),
    "set_position": ("done", "job.done"),
    "reset": ("done", "job.done"),
    "move_absolute": ("done", "job.done"),
    "move_relative": ("done", "job.done"),
    "move_velocity": ("in_velocity", "job.in_velocity"),
    "move_superimposed": ("done", "job.done"),
    "jog": ("in_velocity", "job.in_velocity"),
    "gear_out": ("done", "job.done"),
    "cam_out": ("done", "job.done"),
    "halt": ("done", "job.done"),
    "stop": ("done", "job.done"),
}
"""Output of each command that a test waits for, and the event that shows it."""


def awaited(step: Step) -> str:
    """Return the output that a test waits for behind a step; empty: it waits for none."""
    if not isinstance(step, Command) or step.inputs.get("enable") is False:
        return ""
    return WAITED_FOR.get(step.name, ("", ""))[0]


@dataclass(frozen=True)
class Do:
    """A step of the session."""

    number: int
    """Of the step, from 0."""
    step: Step


@dataclass(frozen=True)
class Until:
    """Waiting for an output of the instance that a step has made."""

    number: int
    output: str
    timeout_s: float


@dataclass(frozen=True)
class Pause:
    """Bench time that passes."""

    seconds: float


@dataclass(frozen=True)
class Look:
    """Here a test judges what has come of the steps since the last look."""

    steps: tuple[int, ...]
    """Their numbers."""


Action = Do | Until | Pause | Look


@dataclass(frozen=True)
class Outputs:
    """Outputs of the instance that a step has made; all false where it has made none."""

    name: str = ""
    done: bool = False
    error: bool = False
    aborted: bool = False
    error_id: int = 0

    @property
    def failed(self) -> bool:
        """Whether it ended otherwise than it should."""
        return self.error or self.aborted

    @classmethod
    def of(cls, made: Any) -> Outputs:
        """Return the outputs of an instance as they are now, or those that were kept of it."""
        if isinstance(made, Outputs):
            return made
        if not hasattr(made, "ErrorID"):
            return cls()
        return cls(
            made.name,
            bool(getattr(made, "Done", False)),
            bool(made.Error),
            bool(getattr(made, "CommandAborted", False)),
            int(made.ErrorID),
        )


@dataclass(frozen=True)
class Moment:
    """The bench at a look: the recording so far, and the outputs of what the steps have made."""

    trace: Trace
    made: tuple[Outputs, ...]
    begun_s: tuple[float, ...]
    """Times at which the steps were done, s."""


class Script:
    """A session as a list of actions.

    Args:
        steps: What was done, in order.
        trace: Recording of the session.
        made: What each step has made.
        end_ns: Time at which the session is saved.
        reached: Step on an NC axis -> when what is waited for behind it came, ns.
        exact: Whether all pauses stay as they were, and nothing else is waited for.

    """

    def __init__(
        self,
        steps: Sequence[TimedStep],
        trace: Trace,
        made: Sequence[Any],
        end_ns: int,
        *,
        reached: Mapping[int, int],
        exact: bool = False,
    ) -> None:
        self._trace = trace
        self._reached_ns = reached
        self._exact = exact
        self._powers: dict[str, int] = {}
        """The last step that enables each axis, by its name."""
        self._busy_ns = _busy(trace)
        self.actions: list[Action] = []
        looked: list[int] = []
        for number, timed in enumerate(steps):
            self.actions.append(Do(number, timed.step))
            looked.append(number)
            last = number + 1 == len(steps)
            next_ns = end_ns if last else steps[number + 1].time_ns
            passed = self._pass(number, timed, made[number], next_ns)
            self.actions += passed
            unlocked = not last and _unlocks(steps[number + 1].step, number)
            if passed and (last or _worth(timed.step)) and not unlocked:
                self.actions.append(Look(tuple(looked)))
                looked = []

    def _pass(self, number: int, timed: TimedStep, made: Any, next_ns: int) -> list[Action]:
        """Return how time passes behind a step."""
        begin_ns, found, step = timed.time_ns, list[Action](), timed.step
        if self._exact:
            return [Pause(round((next_ns - begin_ns) / MS) / 1000)] if next_ns - begin_ns >= MS else []
        if isinstance(step, Command):
            if step.name.startswith("power"):
                self._powers[step.axis] = number
            reached_ns = self._reached(number, step, made, begin_ns, next_ns)
            if reached_ns is not None:
                found.append(_until(number, WAITED_FOR[step.name][0], begin_ns, reached_ns))
                begin_ns = reached_ns
                power = self._powers.get(step.axis)
                if step.name == "reset" and power is not None:
                    enabled_ns = self._enabled(step.axis, begin_ns, next_ns)
                    if enabled_ns is not None:
                        found.append(_until(power, "status", begin_ns, enabled_ns))
                        begin_ns = enabled_ns
        pause_ns = self._pause(begin_ns, next_ns, waited=bool(found))
        if pause_ns >= MS:
            found.append(Pause(pause_ns / S))
        return found

    def _reached(self, number: int, step: Command, made: Any, since_ns: int, until_ns: int) -> int | None:
        """Return when the output came that a test waits for; None: not before the next step."""
        if not awaited(step):
            return None
        reached_ns = self._reached_ns.get(number)
        if reached_ns is not None:
            return reached_ns if reached_ns <= until_ns else None
        kind = WAITED_FOR[step.name][1]
        if kind == "power.status":
            return self._enabled(step.axis, since_ns, until_ns)
        name, instruction = getattr(made, "name", None), _instruction(step.name)
        for entry in self._trace.select(source=step.axis, kind=kind):
            mine = entry.data.get("instruction") == instruction
            if since_ns <= entry.time_ns < until_ns and mine and name in {None, entry.data.get("job")}:
                return entry.time_ns
        return None

    def _enabled(self, axis: str, since_ns: int, until_ns: int) -> int | None:
        """Return when `MC_Power` showed that an axis is enabled."""
        for entry in self._trace.select(source=axis, kind="power.status"):
            if since_ns <= entry.time_ns < until_ns and entry.data.get("value") is True:
                return entry.time_ns
        return None

    def _pause(self, begin_ns: int, end_ns: int, *, waited: bool) -> int:
        """Return how long to wait, to the millisecond: a pause in which nothing happens gets short."""
        active = self._busy_ns[np.searchsorted(self._busy_ns, begin_ns, "right") :]
        active = active[active < end_ns]
        last_ns = int(active[-1]) if len(active) else begin_ns
        quiet_ns = round(QUIET_S * S)
        aftermath_ns = round(_AFTERMATH_S * S)
        if waited and last_ns - begin_ns <= aftermath_ns < end_ns - last_ns:
            return 0
        if end_ns - last_ns > quiet_ns:
            end_ns = last_ns + quiet_ns
            return math.ceil((end_ns - begin_ns) / (100 * MS)) * 100 * MS
        return round((end_ns - begin_ns) / MS) * MS

    def play(self, bench: Bench) -> list[Moment]:
        """Do everything on a fresh bench, and return what was there at each look.

        Raises:
            HilError: The bench refuses a step, or what is waited for does not come.

        """
        performer = Performer(bench)
        moments = []
        begun_s: list[float] = []
        for action in self.actions:
            match action:
                case Do():
                    begun_s.append(bench.now_s)
                    performer.perform(action.step)
                case Until():
                    wanted: Callable[[], object] = getattr(performer.made[action.number], action.output)
                    if not bench.run_until(wanted, action.timeout_s):
                        raise ExpectationFailedError(bench.unmet_wait())
                case Pause():
                    bench.run_for(action.seconds)
                case Look():
                    outputs = tuple(map(Outputs.of, performer.made))
                    moments.append(Moment(bench.trace(), outputs, tuple(begun_s)))
        return moments

    def recorded(self, steps: Sequence[TimedStep], made: Sequence[Any], end_ns: int) -> list[Moment]:
        """Return what was there at each look of the session itself, for a bench that cannot do it again."""
        moments = []
        outputs, begun_s = tuple(map(Outputs.of, made)), tuple(one.time_ns / S for one in steps)
        for action in self.actions:
            if isinstance(action, Look):
                last = action.steps[-1]
                until_ns = end_ns if last + 1 == len(steps) else steps[last + 1].time_ns
                moments.append(Moment(self._trace.window(0.0, until_ns / S), outputs, begun_s))
        return moments


def _instruction(command: str) -> str:
    """Return the name of the instruction that a command starts: `MC_MoveAbsolute` of `move_absolute`."""
    words = ["move", "jog"] if command == "jog" else command.split("_")
    return f"MC_{''.join(word.capitalize() for word in words)}"


def _until(number: int, output: str, begin_ns: int, reached_ns: int) -> Until:
    return Until(number, output, max(1.0, float(math.ceil(2.0 * (reached_ns - begin_ns) / S))))


def _worth(step: Step) -> bool:
    """Whether a test judges what comes of a step, and not of the next one only."""
    if isinstance(step, SetInputs):  # the end of jogging, and of a stop
        return step.inputs.get("JogForward") is False or step.inputs.get("Execute") is False
    return isinstance(step, Inject) or (
        isinstance(step, Command) and step.name not in {"power_when_ready", "reset", "jog", "move_velocity"}
    )


def _unlocks(step: Step, number: int) -> bool:
    """Return whether a step lets an axis go that the stop of another step holds, which is judged then."""
    return isinstance(step, SetInputs) and step.step == number and "Execute" in step.inputs


def _busy(trace: Trace) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return the times at which something happened, in order, ns."""
    times = [entry.time_ns for entry in trace.events if entry.kind.startswith(_HAPPENS)]
    parts = [np.array(times, dtype=np.int64)]
    for name in trace.names():
        if name.endswith((".velocity_setpoint", ".set_velocity", ".actual_velocity")) and len(trace[name]):
            signal = trace[name]
            speeds = np.abs(np.nan_to_num(signal.values))
            moves = speeds > _REST * max(float(speeds.max()), 1e-9)
            parts.append(np.round(signal.time_s[moves] * S).astype(np.int64))
    return np.sort(np.concatenate(parts))
