"""Time: run, pause, step, speed, run until a condition holds; and who has control."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field

from fieldbus.history import Event, History
from hil.cockpit.messages import Message, MessageError
from hil.cockpit.pane import Handler, Pane

if TYPE_CHECKING:
    from hil.cockpit.client import Client
    from hil.cockpit.machine import Machine
    from hil.cockpit.operator import Control

_COMPARED: Final[dict[str, Callable[[float, float], bool]]] = {
    ">": lambda value, limit: value > limit,
    ">=": lambda value, limit: value >= limit,
    "<": lambda value, limit: value < limit,
    "<=": lambda value, limit: value <= limit,
    "==": lambda value, limit: value == limit,
    "!=": lambda value, limit: value != limit,
}


class TakeControl(Message):
    """Operate from now on, if nobody does."""

    operates = False
    kind: Literal["control.take"]


class ReleaseControl(Message):
    """Operate no more: axes of the panel are stopped and given back."""

    kind: Literal["control.release"]


class Run(Message):
    """Let time pass."""

    kind: Literal["time.run"]
    speed: Annotated[float, Field(ge=0.001, le=1000.0)] | Literal["max"] | None = None
    """Bench time per time on the clock; `max`: as fast as the machine can; none: as before."""


class Pause(Message):
    """Let time stand still."""

    kind: Literal["time.pause"]


class Step(Message):
    """Let bus cycles pass, then stand still."""

    kind: Literal["time.step"]
    cycles: Annotated[int, Field(ge=1, le=1000)] = 1


class RunToTime(Message):
    """Run until a bench time."""

    kind: Literal["time.until_time"]
    time_s: Annotated[float, Field(ge=0.0, le=1e6)]


class RunToSignal(Message):
    """Run until a recorded signal compares with a value."""

    kind: Literal["time.until_signal"]
    signal: Annotated[str, Field(min_length=3, max_length=200)]
    compare: Literal[">", ">=", "<", "<=", "==", "!="]
    value: float


class RunToEvent(Message):
    """Run until an event of a kind comes, of one source or of any."""

    kind: Literal["time.until_event"]
    event: Annotated[str, Field(min_length=1, max_length=80)]
    source: Annotated[str, Field(max_length=80)] = ""


class TimePane(Pane):
    """Time control of the bench, and who operates.

    Args:
        machine: Has the bench and its pace.
        control: Who operates.

    """

    name = "time"

    def __init__(self, machine: Machine, control: Control) -> None:
        self._machine = machine
        self._control = control

    @property
    def handlers(self) -> Mapping[type[Message], Handler]:
        """What it takes."""
        return {
            TakeControl: lambda _, client: self._control.take(client),
            ReleaseControl: lambda _, client: self._machine.release_control(client),
            Run: self._run,
            Pause: lambda _, __: self._machine.the_pace().pause(),
            Step: lambda message, _: self._machine.the_pace().step(message.cycles),
            RunToTime: self._to_time,
            RunToSignal: self._to_signal,
            RunToEvent: self._to_event,
        }

    def _run(self, message: Run, _: Client) -> None:
        self._machine.the_pace().run(inf if message.speed == "max" else message.speed)

    def _to_time(self, message: RunToTime, _: Client) -> None:
        bench = self._machine.the_bench()
        if message.time_s <= bench.now_s:
            raise MessageError(f"time_s: it is {bench.now_s:.3f} s already; a later time is allowed")
        end_ns = round(message.time_s * 1e9)
        bench.scheduler.at(end_ns, lambda: None)  # the condition is looked at after events only
        scheduler = bench.scheduler
        self._machine.the_pace().run_to(
            lambda: scheduler.now >= end_ns, f"bench time is {message.time_s:g} s"
        )

    def _to_signal(self, message: RunToSignal, _: Client) -> None:
        bench = self._machine.the_bench()
        read = bench.recorder.reader(message.signal)
        compare, limit = _COMPARED[message.compare], message.value

        def holds() -> bool:
            value = read()
            return value is not None and compare(value, limit)

        self._machine.the_pace().run_to(holds, f"{message.signal} {message.compare} {limit:g}")

    def _to_event(self, message: RunToEvent, _: Client) -> None:
        bench = self._machine.the_bench()
        found = _Watch(bench.history, message.event, message.source)
        text = f"event {message.event}" + (f" of {message.source}" if message.source else "")
        self._machine.the_pace().run_to(found, text)

    def state(self) -> object:
        """Return how time passes."""
        pace = self._machine.pace
        if pace is None:
            return None
        return {
            "running": pace.running,
            "factor": "max" if pace.factor == inf else pace.factor,
            "speed": pace.speed,
            "until": pace.condition_text,
            "met": pace.met,
            "held": pace.held,
        }


class _Watch:
    """Whether an event has come since this was made."""

    def __init__(self, history: History, kind: str, source: str) -> None:
        self._kind = kind
        self._source = source
        self._came = False
        self._end = history.listen(self._listen)

    def _listen(self, event: Event) -> None:
        if event.kind == self._kind and self._source in {"", event.source}:
            self._came = True
            self._end()

    def __call__(self) -> bool:
        return self._came
