"""Machines of a search: benches that differ in many ways at once, with one to three axes, each with what a
program can do on it.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Final

from hypothesis import strategies as st

from hil.fuzz._configuration import MACHINE, Configuration
from hil.fuzz._program import Participant, Program, job_names, participants
from hil.fuzz._strategies import fault_kinds, identifiers_of, programs

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from hil.bench.bench import Bench

MOST_AXES: Final = 3
NUMBER: Final = 12
"""Machines of a search: each of them is built once to see what can be done on it."""


@dataclass(frozen=True)
class Machine:
    """What a program can do on a bench."""

    kinds: tuple[str, ...]
    """Faults, as of `fault_kinds`."""
    jobs: tuple[str, ...]
    """Instructions of its only axis."""
    axes: tuple[Participant, ...]
    """Its axes, where there are several."""
    identifiers: dict[str, int]
    """Identifiers on CAN by message, as of `identifiers_of`."""

    @classmethod
    def of(cls, bench: Bench, axes: int = MOST_AXES) -> Machine:
        """Look at a bench; programs give instructions to so many of its axes at most."""
        count = min(axes, len(bench.axis_names))
        several = participants(bench, count) if count > 1 else ()
        return cls(tuple(fault_kinds(bench)), job_names(bench.axis()), several, identifiers_of(bench))

    def programs(
        self, longest: int, configurations: SearchStrategy[Configuration]
    ) -> SearchStrategy[Program]:
        """Return a strategy of programs."""
        return programs(
            self.kinds,
            self.identifiers,
            jobs=self.jobs,
            axes=self.axes,
            longest=longest,
            configurations=configurations,
        )


def machine_names(seed: int, number: int = NUMBER) -> tuple[str, ...]:
    """Return names of configurations, of which every two differ; the same seed gives the same ones."""
    from hil.configurations import ANY, name_of, plan

    rows = plan([ANY], seed=seed).rows
    dice = random.Random(f"machines {seed}")  # noqa: S311 - repeatable, not secret
    return tuple(name_of(row, seed) for row in dice.sample(rows, min(number, len(rows))))


def on_machines(names: Sequence[str], longest: int) -> SearchStrategy[Program]:
    """Return a strategy of programs, each on one of the machines."""
    return st.sampled_from(list(names)).flatmap(lambda name: _programs_on(name, longest))


@cache
def _programs_on(name: str, longest: int) -> SearchStrategy[Program]:
    configuration = Configuration({MACHINE: {"name": name}})
    with configuration.machine().build(seed=0) as bench:
        machine = Machine.of(bench)
    return machine.programs(longest, st.just(configuration))
