"""Fuzzing the whole chain: programs of jobs and faults, invariants in every cycle, shrinking, replay."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.fuzz._invariants import Invariant, Violation, default_invariants
from hil.fuzz._program import JOBS, Break, Do, Program, Step, Wait, step_from_json
from hil.fuzz._run import FuzzOutcome, program_token, run_program

if TYPE_CHECKING:
    from hil.fuzz._search import FuzzReport, search
    from hil.fuzz._strategies import fault_kinds, programs

__all__ = [
    "JOBS",
    "Break",
    "Do",
    "FuzzOutcome",
    "FuzzReport",
    "Invariant",
    "Program",
    "Step",
    "Violation",
    "Wait",
    "default_invariants",
    "fault_kinds",
    "program_token",
    "programs",
    "run_program",
    "search",
    "step_from_json",
]


def __getattr__(name: str) -> Any:
    # Hypothesis is loaded by a search only, not by a replay.
    if name in {"FuzzReport", "search"}:
        from hil.fuzz import _search

        return getattr(_search, name)
    if name in {"fault_kinds", "programs"}:
        from hil.fuzz import _strategies

        return getattr(_strategies, name)
    raise AttributeError(f"module 'hil.fuzz' has no attribute {name!r}")
