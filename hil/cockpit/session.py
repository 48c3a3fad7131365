"""The record of a session: every step with its time, from the start of the bench on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.cockpit.steps import Performer, Step, TimedStep

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.faults import Injector
    from reports.json_types import JsonObject


class Session:
    """Does what an operator wants on a bench, and records it.

    Args:
        bench: The bench; a session begins with it, and ends when it is started anew.
        injector: Arms its faults; None: one of its own.

    """

    def __init__(self, bench: Bench, injector: Injector | None = None) -> None:
        self.bench = bench
        self.performer = Performer(bench, injector)
        self.steps: list[TimedStep] = []

    def do(self, step: Step) -> Any:
        """Do a step now, record it and return what it made.

        Raises:
            HilError: The bench refuses it; nothing is recorded.

        """
        now = self.bench.scheduler.now
        made = self.performer.perform(step)
        self.steps.append(TimedStep(now, step))
        return made

    def note(self, step: Step, made: object = None) -> int:
        """Record a step that somebody else has done just now; returns its number, from 0.

        Args:
            step: The step.
            made: The instance, armed fault or SDO job that it has made, for later steps.

        """
        self.performer.follow(made)
        self.steps.append(TimedStep(self.bench.scheduler.now, step))
        return len(self.steps) - 1

    def to_dicts(self) -> list[JsonObject]:
        """Return the steps for a list."""
        return [one.to_dict(number) for number, one in enumerate(self.steps, 1)]
