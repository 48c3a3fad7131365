"""The record of a session: every step with its time, from the start of the bench on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.cockpit.steps import Performer, Step, TimedStep
from hil.cockpit.written_test import Recorded

if TYPE_CHECKING:
    from hil.bench import BenchFile
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

    def note(self, step: Step, made: object = None, *, time_ns: int | None = None) -> int:
        """Record a step that somebody else has done; returns its number, from 0.

        Args:
            step: The step.
            made: The instance, armed fault or SDO job that it has made, for later steps.
            time_ns: When it was done; None: now.

        """
        self.performer.follow(made)
        self.steps.append(TimedStep(self.bench.scheduler.now if time_ns is None else time_ns, step))
        return len(self.steps) - 1

    def recorded(self, bench_file: BenchFile) -> Recorded:
        """Return what is needed to save the session, as it is now.

        Args:
            bench_file: What the bench was built of.

        """
        bench = self.bench
        return Recorded(
            tuple(self.steps),
            tuple(self.performer.made),
            bench.trace(),
            bench.scheduler.now,
            (*bench.axis_names, *bench.nc_axis_names),
            bench_file,
        )

    def to_dicts(self, since: int = 0) -> list[JsonObject]:
        """Return the steps for a list, from a number on, from 0."""
        return [one.to_dict(number) for number, one in enumerate(self.steps[since:], since + 1)]
