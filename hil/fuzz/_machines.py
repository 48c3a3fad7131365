"""Machines of a search: benches that differ in many ways at once, with one to three axes, each with what a
program can do on it.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Final

from hypothesis import strategies as st

from hil.fuzz._choices import whole
from hil.fuzz._configuration import MACHINE, Configuration
from hil.fuzz._device_strategies import device_preamble, device_steps
from hil.fuzz._devices import Devices
from hil.fuzz._phrases import phrases
from hil.fuzz._program import (
    Do,
    ObjectWithoutMotion,
    Participant,
    Program,
    Step,
    Variable,
    Wait,
    is_own,
    job_names,
    objects_of,
    participants,
    variables_of,
)
from hil.fuzz._strategies import (
    assignments,
    fault_kinds,
    identifiers_of,
    object_steps,
    preamble_of,
    programs,
    steps,
)

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

    from hil.bench.bench import Bench

MOST_AXES: Final = 3
NUMBER: Final = 12
"""Machines of a search: each of them is built once to see what can be done on it."""


@dataclass(frozen=True)
class Machine:
    """What a program can do on a bench; plain data."""

    kinds: tuple[str, ...]
    """Faults, as of `fault_kinds`."""
    jobs: tuple[str, ...]
    """Instructions of its only axis; none: it has no axis."""
    axes: tuple[Participant, ...]
    """Its axes, where there are several."""
    identifiers: dict[str, int]
    """Identifiers on CAN by message, as of `identifiers_of`."""
    objects: tuple[ObjectWithoutMotion, ...] = ()
    variables: tuple[Variable, ...] = ()
    devices: Devices = field(default_factory=Devices)

    @classmethod
    def of(cls, bench: Bench, axes: int = MOST_AXES) -> Machine:
        """Look at a bench; programs give instructions to so many of its axes at most.

        Raises:
            CannotRunError: The bench has fewer axes, and more than one was asked for.

        """
        several = participants(bench, axes) if axes != 1 else ()
        if not is_own(bench):
            return cls(tuple(fault_kinds(bench)), job_names(bench.axis()), several, identifiers_of(bench))
        names = (*bench.axis_names, *bench.nc_axis_names)
        if not names:
            return cls((), (), (), {}, devices=Devices.of(bench))
        return cls(
            tuple(fault_kinds(bench)),
            job_names(bench.axis()),
            several,
            identifiers_of(bench),
            objects_of(bench),
            variables_of(bench, names[:axes]),
            Devices.of(bench),
        )

    def steps(self) -> SearchStrategy[Step]:
        """Return a strategy of single steps."""
        return steps(self.kinds, self.identifiers, self.jobs, self.axes, others=self._others())

    def preamble(self) -> tuple[Step, ...]:
        """Return the steps that programs begin with."""
        own = preamble_of(self.axes, self.jobs) if self.jobs else ()
        powers = tuple(Do("power", axis=one.name) for one in self.objects if "power" in one.jobs)
        return (*device_preamble(self.devices), *own, *powers)

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
            preamble=self.preamble(),
            configurations=configurations,
            others=self._others(),
            phrases=self._phrases(calm=False),
            calm_phrases=self._phrases(calm=True),
        )

    def _phrases(self, *, calm: bool) -> SearchStrategy[tuple[Step, ...]] | None:
        own = phrases(self.jobs, self.axes, self.devices, calm=calm)
        others = self._others()
        if own is None or not calm or not others:
            return own
        one = st.tuples(st.one_of([whole(other) for other in others]), st.just(Wait(0.1)))
        return st.one_of(whole(own), whole(own), whole(one))

    def _others(self) -> list[SearchStrategy[Step]]:
        return [
            *([object_steps(self.objects)] if self.objects else []),
            *([assignments(self.variables)] if self.variables else []),
            *device_steps(self.devices),
        ]


def axes_of(bench: Bench) -> int:
    """Return how many axes of a bench the programs of a search give instructions to."""
    return min(MOST_AXES, max(1, len(bench.axis_names) + len(bench.nc_axis_names)))


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
        machine = Machine.of(bench, axes_of(bench))
    return machine.programs(longest, st.just(configuration))
