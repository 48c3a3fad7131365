"""Invariants of a generated program that need the live objects; all others are rules on its trace.

`hil.expect.ALWAYS_ON` and `hil.expect.SEARCH_RULES` judge the trace when the program has ended. An invariant
is asked in every application cycle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

from fieldbus.history import Event

_OUTPUTS: Final = ("Busy", "Done", "Error", "CommandAborted")
_ENDS: Final = _OUTPUTS[1:]


@dataclass(frozen=True)
class Violation:
    """A broken invariant or rule."""

    invariant: str
    time_s: float
    text: str
    requirements: tuple[str, ...] = ()

    def __str__(self) -> str:
        return f"{self.invariant} broken at {self.time_s:.6f} s: {self.text}"


class NamedJob(Protocol):
    """An instance of an instruction."""

    @property
    def name(self) -> str:
        """Its name in messages."""


class Invariant(Protocol):
    """What is asked at the end of every application cycle. A class of your own inherits the defaults."""

    name: str = ""
    requirements: tuple[str, ...] = ()

    def cycle(self) -> str:
        """Return what is wrong in the present cycle, or an empty text."""
        return ""

    def event(self, entry: Event) -> None:  # noqa: ARG002 - most have no use for events
        """Take note of an event."""
        return


class OneJobOutput(Invariant):
    """No instance shows two of Busy, Done, Error, CommandAborted."""

    name = "one job output"
    requirements = ("MC-071",)

    def __init__(self) -> None:
        self.jobs: list[NamedJob] = []
        """Handles of the instances of the program, of any instruction."""

    def cycle(self) -> str:
        """Look at the outputs of all instances of the program."""
        for job in self.jobs:
            # A block of an NC that is enabled stays busy with its error.
            outputs = _OUTPUTS if hasattr(job, "Execute") else _ENDS
            shown = [name for name in outputs if getattr(job, name, False)]
            if len(shown) > 1:
                return f"{job.name} shows {' and '.join(shown)}"
        return ""


class OutputsAgree(Invariant):
    """Outputs of an instance do not contradict each other.

    Args:
        jobs: Handles of the instances of the program.

    """

    name = "outputs of an instance"
    requirements = ("MC-072", "MC-073")

    def __init__(self, jobs: list[NamedJob]) -> None:
        self._jobs = jobs

    def cycle(self) -> str:
        """Look at the outputs of all instances of the program."""
        for job in self._jobs:
            if getattr(job, "Active", False) and not getattr(job, "Busy", True):
                return f"{job.name} shows Active without Busy"
            error = bool(getattr(job, "Error", False))
            if bool(getattr(job, "ErrorID", error)) is not error:
                return f"{job.name} shows Error = {error} with another ErrorID"
        return ""


class OutputsHeld(Invariant):
    """What an instance shows at its end stays until `Execute` falls.

    Args:
        jobs: Handles of the instances of the program.

    """

    name = "outputs held"
    requirements = ("MC-066",)

    def __init__(self, jobs: list[NamedJob]) -> None:
        self._jobs = jobs
        self._shown: dict[int, str] = {}

    def cycle(self) -> str:
        """Compare the outputs of all instances of the program with those of the last cycle."""
        for number, job in enumerate(self._jobs):
            now = next((name for name in _ENDS if getattr(job, name, False)), "")
            before = self._shown.get(number, "")
            self._shown[number] = now
            if (
                before
                and now != before
                and getattr(job, "Execute", False)
                and not getattr(job, "Busy", False)
            ):
                return f"{job.name} does not show {before} any more, and Execute is TRUE"
        return ""


def default_invariants(_bench: object) -> list[Invariant]:
    """Return the invariants that every search asks."""
    one = OneJobOutput()
    return [one, OutputsAgree(one.jobs), OutputsHeld(one.jobs)]
