"""Every pair of fault kinds that can overlap, in either order: the second comes while the first acts.

A search meets a certain pair by chance. Here all of them have their turn, from a motion and at rest, with
parameters drawn from those that a search uses, so combined that any two of order, motion and both sets of
parameters meet (all-pairs).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import combinations_with_replacement, islice
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import hypothesis
from allpairspy import AllPairs

from hil.errors import CannotRunError
from hil.faults import Fault
from hil.fuzz._program import REMOVE_FAULTS, Break, Do, Program, Step, Wait, job_names
from hil.fuzz._run import injectable
from hil.fuzz._strategies import fault_kinds, fault_steps, identifiers_of, preamble_of

if TYPE_CHECKING:
    from hil.protocols import BenchFile

VARIANTS: Final = 2
"""Sets of parameters of a kind."""
_DRAWN: Final = 12
"""So many are drawn, until there are `VARIANTS` different ones."""
_ACTS_S: Final = 0.3
"""A fault that lasts acts for so long."""
_LATER_S: Final = 0.1
"""The second comes so long after the first."""
_VELOCITY: Final = 100.0


def fault_pairs(bench_file: BenchFile[Any], *, seed: int = 0, kinds: Sequence[str] = ()) -> list[Program]:
    """Return a program for every pair of fault kinds that a bench can inject, order, motion and parameters.

    Args:
        bench_file: The bench.
        seed: Of the parameters.
        kinds: Only pairs of these kinds; none: of all that the bench can inject and a search draws.

    Raises:
        CannotRunError: A kind is none of them.

    """
    with bench_file.build(seed=seed) as bench:
        frame = _frame(job_names(bench.axis()))
        possible, ids = fault_kinds(bench), identifiers_of(bench)
    if wrong := [kind for kind in kinds if kind not in possible]:
        raise CannotRunError(f"{wrong[0]!r} is no kind of fault that {bench_file.name} takes from a search")
    kinds = kinds or possible
    known = {kind: _variants(bench_file, kind, ids, seed) for kind in kinds}
    return [
        program
        for one, other in combinations_with_replacement(kinds, 2)
        for program in _programs(known[one], known[other], frame)
    ]


def _variants(bench_file: BenchFile[Any], kind: str, ids: dict[str, int], seed: int) -> list[Fault]:
    """Return faults of a kind with different parameters, made to overlap; none that the bench refuses."""
    tried: dict[str, Fault] = {}

    def keep(step: Step) -> None:
        if isinstance(step, Break):
            fault = step.fault
            lasting = fault.duration_s is not None
            tried.setdefault(str(fault.parameters), replace(fault, duration_s=_ACTS_S if lasting else None))

    settings = hypothesis.settings(
        max_examples=_DRAWN,
        deadline=None,
        database=None,
        phases=(hypothesis.Phase.generate,),
        verbosity=hypothesis.Verbosity.quiet,
        suppress_health_check=list(hypothesis.HealthCheck),
    )
    run: Any = settings(hypothesis.given(fault_steps(kind, ids))(keep))
    hypothesis.seed(seed)(run)()
    with bench_file.build(seed=seed) as bench:
        possible = (fault for fault in tried.values() if injectable(fault, bench))
        return list(islice(possible, VARIANTS))


class _Frame(NamedTuple):
    """What is around a pair of faults in a program."""

    begin: tuple[Step, ...]
    motion: Step
    end: tuple[Step, ...]


def _frame(jobs: Sequence[str]) -> _Frame:
    """Return the steps for an axis with these instructions: of an NC or a technology object."""
    begin = preamble_of((), jobs)
    if "MC_MoveVelocity" in jobs:
        # MC_Power has stayed enabled.
        return _Frame(begin, Do("MC_MoveVelocity", {"Velocity": _VELOCITY}), (Do("MC_Reset"),))
    return _Frame(begin, Do("move_velocity", {"velocity": _VELOCITY}), (Do("reset"), Do("power_on")))


def _programs(first: Sequence[Fault], second: Sequence[Fault], frame: _Frame) -> Iterator[Program]:
    if not first or not second:
        return
    for one, other, turned, moving in _rows(len(first), len(second)):
        pair = first[one], second[other]
        yield _program(frame, *(reversed(pair) if turned else pair), moving=moving)


@cache
def _rows(first: int, second: int) -> tuple[tuple[int, int, bool, bool], ...]:
    """Return parameters of the first and of the second, order and motion, so that any two of them meet."""
    factors: list[list[Any]] = [list(range(first)), list(range(second)), [False, True], [True, False]]
    # A factor with one value has nothing to be combined.
    varied = [index for index, values in enumerate(factors) if len(values) > 1]
    rows = []
    for found in AllPairs([factors[index] for index in varied]):
        row = [values[0] for values in factors]
        for index, value in zip(varied, found, strict=True):
            row[index] = value
        rows.append((row[0], row[1], row[2], row[3]))
    return tuple(rows)


def _program(frame: _Frame, one: Fault, other: Fault, *, moving: bool) -> Program:
    motion: tuple[Step, ...] = (frame.motion, Wait(0.2)) if moving else ()
    return Program(
        (
            *frame.begin,
            *motion,
            Break(one),
            Wait(_LATER_S),
            Break(other),
            Wait(_ACTS_S + _LATER_S),
            Do(REMOVE_FAULTS),
            Wait(_LATER_S),
            *frame.end,
            Wait(0.3),
        )
    )
