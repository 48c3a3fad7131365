"""The words that a recording of a bench may hold: components, states, jobs, alarms, kinds of faults."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from fieldbus.history import Scalar
from hil.record import Vocabulary

if TYPE_CHECKING:
    from hil.bench.bench import Bench


@cache
def _fixed_words() -> dict[str, tuple[Scalar, ...]]:
    """Return the words that are the same on every bench."""
    from hil.faults import CATALOGUE
    from motion.s7 import instructions
    from motion.s7.alarms import catalogue
    from motion.s7.controller import OperatingState

    states: tuple[Scalar, ...] = tuple(state.value for state in OperatingState)
    numbers: tuple[Scalar, ...] = tuple(catalogue())
    names: tuple[Scalar, ...] = tuple(name for name in instructions.__all__ if name.startswith("MC_"))
    faults: tuple[Scalar, ...] = tuple(entry.name for entry in CATALOGUE)
    return {
        "controller.state:from": states,
        "controller.state:to": states,
        "alarm.:number": numbers,
        "job.:instruction": names,
        "fault.:fault": faults,
    }


def bench_vocabulary(bench: Bench) -> Vocabulary:
    """Return the words of a bench as it is now; of jobs those of its instances and of its log."""
    jobs: dict[Scalar, None] = {instance.name: None for instance in bench.runtime.instances}
    for entry in bench.history.events:
        if entry.kind.startswith("job."):
            jobs[entry.data["job"]] = None
    return Vocabulary(
        (*bench.component_names, *bench.second_encoder_names),
        {**_fixed_words(), "job.:job": tuple(jobs)},
        declared=tuple(sorted(bench.history.declared)),
    )
