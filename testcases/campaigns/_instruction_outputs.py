"""Outputs of instruction instances, call by call, and the state machines of the specification that they have
to follow (MC-052 to MC-085).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

from fieldbus.history import Event
from hil.campaign import CaseContext

ENDS: Final = ("Done", "CommandAborted", "Error")
_EVENTS: Final = {
    "busy": ("job.started", "MC-058"),
    "done": ("job.done", "MC-055"),
    "aborted": ("job.aborted", "MC-056"),
    "error": ("job.error", "MC-057"),
}
"""Output and the event of its edge, with the state that it is the way into."""
_SUCCESSES: Final = ("InVelocity", "InGear", "InSync")


class Call(NamedTuple):
    """One call of an instance: what it got and what it showed."""

    level: bool
    """Input that starts it: `Execute`, `Enable`, one of the jog inputs."""
    busy: bool
    active: bool | None
    """None: the instruction has no such output."""
    done: bool
    aborted: bool
    error: bool
    error_id: int
    success: bool
    """`InVelocity`, `InGear` or `InSync`."""

    @property
    def ended(self) -> bool:
        """Whether the job has ended, one way or another."""
        return self.done or self.aborted or self.error

    @property
    def text(self) -> str:
        """Outputs that are TRUE, in words."""
        names = [("Busy", self.busy), ("Active", self.active), ("Done", self.done)]
        names += [("CommandAborted", self.aborted), ("In...", self.success)]
        shown = [name for name, value in names if value]
        if self.error or self.error_id:
            shown.append(f"{'Error ' if self.error else ''}16#{self.error_id:04X}")
        return " ".join(shown) or "nothing"


class Watched:
    """An instance and its calls since it was handed over.

    Args:
        instance: The instance.

    """

    def __init__(self, instance: Any) -> None:
        self.instance = instance
        self.calls: list[Call] = []
        self.events: Counter[str] = Counter()
        """Events of the instance since then, by their kind."""

    @property
    def last(self) -> Call:
        """The latest call; before the first one: nothing is shown."""
        return self.calls[-1] if self.calls else Call(False, False, None, False, False, False, 0, False)

    def lower(self) -> None:
        """Take back the level that has started it."""
        names = ("Execute", "Enable", "JogForward", "JogBackward")
        self.instance.set(**{name: False for name in names if name in self.instance.inputs})

    def raise_again(self) -> None:
        """Give the starting edge or level again."""
        self.instance.set(**{name: True for name in ("Execute", "Enable") if name in self.instance.inputs})

    def sample(self) -> None:
        """Record what the call of this cycle has shown."""
        one = self.instance
        shown = vars(one)
        self.calls.append(
            Call(
                bool(one.Execute or any(shown.get(key) for key in ("Enable", "JogForward", "JogBackward"))),
                one.Busy is True,
                shown.get("Active"),
                shown.get("Done") is True,
                shown.get("CommandAborted") is True,
                one.Error is True,
                int(one.ErrorID),
                any(shown.get(name) is True for name in _SUCCESSES),
            )
        )


class Outputs:
    """Samples instances of a case in every call of the program, and judges them.

    Args:
        ctx: The case.

    """

    def __init__(self, ctx: CaseContext) -> None:
        self._ctx = ctx
        self._runtime = ctx.bench.runtime
        self._watched: list[Watched] = []
        self._feeds: list[Callable[[], None]] = []
        self._seen = self._runtime.program_calls
        self._runtime.after_cycle.append(self._sample)
        ctx.bench.history.listen(self._hear)

    def watch(self, instance: Any) -> Watched:
        """Follow an instance that is called from the next cycle on."""
        watched = Watched(instance)
        self._watched.append(watched)
        return watched

    def feed(self, function: Callable[[], None]) -> None:
        """Call a function after every call of the program until `release`: it gives the next inputs."""
        self._feeds.append(function)

    def calls(self, number: int) -> None:
        """Let the program be called so often."""
        wanted = self._runtime.program_calls + number
        # Far longer than it takes: a program that is called no more ends the case.
        self._ctx.wait_until(lambda: self._runtime.program_calls >= wanted, 5.0, "the program is called")

    def until(self, watched: Watched, output: str, timeout: float, text: str) -> None:
        """Run until an output of an instance is TRUE."""
        self._ctx.wait_until(lambda: getattr(watched.last, output), timeout, text)

    def release(self) -> None:
        """Take back every level, wait until nothing is shown any more, judge all calls, and forget them."""
        self._feeds.clear()
        for one in self._watched:
            one.lower()
        self.calls(3)
        for one in self._watched:
            wrong = violation(one.instance, one.calls) or _untold(one)
            if wrong:
                identifier, text = wrong
                self._ctx.measure(f"{one.instance.name}: {text}", 0.0, low=1.0, requirements=(identifier,))
            self._runtime.uncall(one.instance)
        self._watched.clear()

    def _hear(self, entry: Event) -> None:
        if entry.kind.startswith("job."):
            for one in self._watched:
                if entry.data.get("job") == one.instance.name:
                    one.events[entry.kind] += 1

    def _sample(self) -> None:
        calls = self._runtime.program_calls
        if calls != self._seen:
            self._seen = calls
            for one in self._watched:
                one.sample()
            for feed in self._feeds:
                feed()


def _untold(watched: Watched) -> tuple[str, str] | None:
    """Return the requirement and what an instance has shown more often than the log tells; None: nothing."""
    if "Execute" not in watched.instance.inputs:
        return None
    for output, (kind, identifier) in _EVENTS.items():
        shown = [getattr(call, output) for call in watched.calls]
        edges = sum(now and not before for before, now in zip([False, *shown], shown, strict=False))
        if edges > watched.events[kind]:
            return identifier, f"{output} has come {edges} times, {kind} {watched.events[kind]} times"
    return None


def violation(instance: Any, calls: Sequence[Call]) -> tuple[str, str] | None:
    """Return the requirement that an instance breaks in its calls, and how; None: none."""
    before = Call(False, False, None, False, False, False, 0, False)
    for number, call in enumerate(calls, 1):
        wrong = _alone(call) or (
            _of_an_edge(before, call)
            if "Execute" in instance.inputs
            else _of_a_level(before, call, told=hasattr(instance, "CommandAborted"))
        )
        if wrong:
            identifier, text = wrong
            return identifier, f"{text}, call {number}: {before.text}, then {call.text}"
        before = call
    return None


def _alone(call: Call) -> tuple[str, str] | None:
    """Judge one call by itself."""
    if (
        call.busy + call.ended + (call.done and call.aborted) + (call.error and (call.done or call.aborted))
        > 1
    ):
        return "MC-071", "more than one of Busy, Done, CommandAborted, Error"
    if call.active and not call.busy:
        return "MC-072", "Active without Busy"
    if call.error != bool(call.error_id):
        return "MC-073", "ErrorID does not go with Error"
    if call.success and not call.busy:
        return "MC-303", "in velocity without Busy"
    return None


def _of_an_edge(before: Call, call: Call) -> tuple[str, str] | None:
    """Judge a call of an instruction with `Execute` by the one before."""
    shows = call.busy or call.ended
    if call.level and not before.level:
        return None if shows else ("MC-058", "an edge without Busy or an end")
    if before.ended:
        if call.level:
            same = call[1:] == before[1:]
            return None if same else ("MC-066", "outputs are not held while Execute is TRUE")
        return ("MC-067", "outputs stay after Execute has fallen") if shows else None
    if before.busy:
        if not shows:
            return "MC-064", "the job is lost without an end"
        lost = before.active and call.busy and not call.active
        return ("MC-054", "Active falls while the job goes on") if lost else None
    return ("MC-052", "outputs without an edge") if shows else None


def _of_a_level(before: Call, call: Call, *, told: bool) -> tuple[str, str] | None:
    """Judge a call of an instruction with `Enable` or jog inputs by the one before; `told`: it has an output
    that tells when another job has ended it, else `Busy` just falls.
    """
    shows = call.busy or call.ended
    if call.level and not before.level:
        return None if shows else ("MC-082", "a level without Busy or an end")
    if before.ended and call.level:
        same = call[4:7] == before[4:7]
        return None if same else ("MC-085", "an error or abort is not held while the input is TRUE")
    if before.ended or not (before.busy or before.level):
        return ("MC-083", "outputs stay without the input") if shows and not call.level else None
    if call.level and not shows and told:
        return "MC-082", "nothing is shown while the input is TRUE"
    return None
