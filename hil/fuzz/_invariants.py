"""Invariants of a generated program that need the live objects; all others are rules on its trace.

`hil.expect.ALWAYS_ON` and `hil.expect.SEARCH_RULES` judge the trace when the program has ended. An invariant
is asked in every application cycle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Protocol

from fieldbus.history import Event

_OUTPUTS: Final = ("Done", "Error", "CommandAborted")


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
    """No instance shows two of Done, Error, CommandAborted."""

    name = "one job output"
    requirements = ("MC-071",)

    def __init__(self) -> None:
        self.jobs: list[NamedJob] = []
        """Handles of the instances of the program, of any instruction."""

    def cycle(self) -> str:
        """Look at the outputs of all instances of the program."""
        for job in self.jobs:
            shown = [name for name in _OUTPUTS if getattr(job, name, False)]
            if len(shown) > 1:
                return f"{job.name} shows {' and '.join(shown)}"
        return ""


def default_invariants(_bench: object) -> list[Invariant]:
    """Return the invariants that every search asks."""
    return [OneJobOutput()]
