"""Fuzzing the whole chain: programs of jobs and faults, invariants in every cycle, shrinking, replay."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hil.fuzz._configuration import Configuration
from hil.fuzz._corpus import Corpus
from hil.fuzz._invariants import Invariant, Violation, default_invariants
from hil.fuzz._program import JOBS, Break, Do, Program, Step, Wait, job_names, step_from_json
from hil.fuzz._regressions import keep_program, regressions
from hil.fuzz._run import FuzzOutcome, check_program, program_token, run_program
from hil.fuzz._situations import Situation, by_family, situations_of

if TYPE_CHECKING:
    from hil.fuzz._configuration_strategies import configurations
    from hil.fuzz._pairs import fault_pairs
    from hil.fuzz._search import FuzzReport, search
    from hil.fuzz._strategies import descendants, fault_kinds, programs

__all__ = [
    "JOBS",
    "Break",
    "Configuration",
    "Corpus",
    "Do",
    "FuzzOutcome",
    "FuzzReport",
    "Invariant",
    "Program",
    "Situation",
    "Step",
    "Violation",
    "Wait",
    "by_family",
    "check_program",
    "configurations",
    "default_invariants",
    "descendants",
    "fault_kinds",
    "fault_pairs",
    "job_names",
    "keep_program",
    "program_token",
    "programs",
    "regressions",
    "run_program",
    "search",
    "situations_of",
    "step_from_json",
]


def __getattr__(name: str) -> Any:
    # Hypothesis is loaded by a search only, not by a replay.
    if name in {"FuzzReport", "search"}:
        from hil.fuzz import _search

        return getattr(_search, name)
    if name == "fault_pairs":
        from hil.fuzz import _pairs

        return _pairs.fault_pairs
    if name == "configurations":
        from hil.fuzz import _configuration_strategies

        return _configuration_strategies.configurations
    if name in {"descendants", "fault_kinds", "programs"}:
        from hil.fuzz import _strategies

        return getattr(_strategies, name)
    raise AttributeError(f"module 'hil.fuzz' has no attribute {name!r}")
