"""The record of a session: every step with its time, from the start of the bench on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.cockpit.rehearsal import Outputs, awaited
from hil.cockpit.steps import Performer, Step, TimedStep
from hil.cockpit.written_test import Recorded
from motion.nc.blocks import ExecuteBlock, MC_Power

if TYPE_CHECKING:
    from collections.abc import Callable

    from hil.bench import BenchFile
    from hil.bench.bench import Bench
    from hil.faults import Injector
    from reports.json_types import JsonObject


class Session:
    """Does what an operator wants on a bench, and records it.

    Args:
        bench: The bench; a session begins with it, and ends when it is restarted.
        injector: Arms its faults; None: one of its own.

    """

    def __init__(self, bench: Bench, injector: Injector | None = None) -> None:
        self.bench = bench
        self.performer = Performer(bench, injector)
        self.steps: list[TimedStep] = []

        self._ends: dict[int, tuple[int, Outputs]] = {}
        """Step on an NC axis -> when its block ended, ns, and its outputs; an S7 axis has events for that."""
        self._running: dict[int, tuple[ExecuteBlock | MC_Power, Callable[[], bool]]] = {}
        if bench.nc_axis_names:
            bench.on_cycle(self._watch)

    def do(self, step: Step) -> Any:
        """Do a step now, record it and return what it made.

        Raises:
            HilError: The bench refuses it; nothing is recorded.

        """
        now = self.now_ns
        made = self.performer.perform(step)
        self._append(now, step, made)
        return made

    def note(self, step: Step, made: object = None, *, time_ns: int | None = None) -> int:
        """Record a step that somebody else has done; returns its number, from 0.

        Args:
            step: The step.
            made: The instance, armed fault or SDO job that it has made, for later steps.
            time_ns: When it was done; None: now.

        """
        self.performer.follow(made)
        return self._append(self.now_ns if time_ns is None else time_ns, step, made)

    @property
    def now_ns(self) -> int:
        """Bench time, ns."""
        return self.bench.scheduler.now

    def ended_ns(self, number: int) -> int | None:
        """Return when a step on an NC axis came to its end, ns; None: it has not."""
        return self._ends[number][0] if number in self._ends else None

    def _append(self, time_ns: int, step: Step, made: object) -> int:
        self.steps.append(TimedStep(time_ns, step))
        number = len(self.steps) - 1
        output = awaited(step)
        if output and isinstance(made, ExecuteBlock | MC_Power):
            # A block that is started again belongs to the new step.
            self._running = {key: one for key, one in self._running.items() if one[0] is not made}
            self._running[number] = made, getattr(made, output)
        return number

    def _watch(self) -> None:
        """Look, at the end of a cycle, what has come to its end."""
        for number, (block, reached) in list(self._running.items()):
            if reached() or (isinstance(block, ExecuteBlock) and block.ended()):
                self._ends[number] = self.now_ns, Outputs.of(block)
                del self._running[number]

    def recorded(self, bench_file: BenchFile) -> Recorded:
        """Return what is needed to save the session, as it is now.

        Args:
            bench_file: What the bench was built of.

        """
        bench, made = self.bench, self.performer.made
        return Recorded(
            tuple(self.steps),
            tuple(self._ends[number][1] if number in self._ends else one for number, one in enumerate(made)),
            bench.trace(),
            bench.scheduler.now,
            (*bench.axis_names, *bench.nc_axis_names),
            bench_file,
            {number: time_ns for number, (time_ns, outputs) in self._ends.items() if not outputs.failed},
            bench.nc_axis_names,
        )

    def to_dicts(self, since: int = 0) -> list[JsonObject]:
        """Return the steps for a list, from a number on, from 0."""
        return [one.to_dict(number) for number, one in enumerate(self.steps[since:], since + 1)]
