"""The names and values that a recording of a bench can hold: components, states,
jobs, alarms, kinds of faults.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from hil.record import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

    from fieldbus.history import Event, Scalar


@cache
def _fixed_values() -> dict[str, tuple[Scalar, ...]]:
    """Return the values that are the same on every bench."""
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


def bench_vocabulary(
    components: Iterable[str],
    jobs: Iterable[str],
    events: Iterable[Event],
    declared: Iterable[str],
    drives: Mapping[str, str],
) -> Vocabulary:
    """Return the names and values of a bench as it is now.

    Args:
        components: Names of everything that can be the source of an event.
        jobs: Names of the existing instances of instructions.
        events: Log so far; it has the names of jobs that are over.
        declared: Kinds of events of user-defined parts.
        drives: Axes and the drives that move them.

    """
    names: dict[Scalar, None] = dict.fromkeys(jobs)
    for entry in events:
        if entry.kind.startswith("job."):
            names[entry.data["job"]] = None
    return Vocabulary(
        tuple(components),
        {**_fixed_values(), "job.:job": tuple(names)},
        declared=tuple(sorted(declared)),
        drives=dict(drives),
    )
