"""Running the case of an entry: without the defect it has to be green, with it red."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Final

from hil.campaign import Case, CaseSettings, case_seed, execute_case, find_campaigns, load_bench_file
from hil.errors import CannotRunError
from hil.museum._field_error import FieldError
from hil.mutants import seeded
from reports.model import CaseResult, Verdict

LIMIT_S: Final = 60.0
"""Wall time of a case; a defect that lets it hang is caught at it, s."""
MOST: Final = 3
"""So many broken expectations are told of."""


@dataclass(frozen=True)
class Judgement:
    """What came of an entry."""

    entry: FieldError
    clean: str
    """Verdict of the case without the defect."""
    defective: str
    """Verdict with it."""
    noticed: tuple[str, ...]
    """The first expectations and rules that the defect breaks, as sentences."""
    rules: tuple[str, ...]
    """Names of the always-on rules that it breaks."""
    reached: bool
    """Whether the defect was reached."""
    seconds: float

    @property
    def caught(self) -> bool:
        """Whether the case is green without the defect, and the defect is reached and makes it red."""
        return self.clean == Verdict.PASSED.value and self.reached and self.defective in _RED

    def as_dict(self) -> dict[str, object]:
        """Return it as plain data."""
        return {
            "name": self.entry.name,
            "case": self.entry.judged_by,
            "campaign": self.entry.campaign,
            "caught": self.caught,
            "clean": self.clean,
            "defective": self.defective,
            "noticed": list(self.noticed),
            "rules": list(self.rules),
            "seconds": self.seconds,
        }


_RED: Final = (Verdict.FAILED.value, Verdict.ERROR.value)


def judge_entry(entry: FieldError) -> Judgement:
    """Run the case of an entry without and with its defect.

    Raises:
        CannotRunError: The campaign has no such case.
        hil.mutants.TargetChangedError: The defect does not fit the product any more.

    """
    began = time.perf_counter()
    case = _case(entry)
    clean = _run(case, entry.bench)
    reached: set[str] = set()
    with ExitStack() as stack:
        if entry.defect is not None:
            stack.enter_context(seeded(entry.defect, reached))
        defective = _run(case, entry.defective_bench or entry.bench)
    broken = [check for check in defective.checks if check.verdict is not Verdict.PASSED]
    noticed = tuple(check.sentence or check.name for check in broken[:MOST])
    return Judgement(
        entry,
        clean.verdict.value,
        defective.verdict.value,
        noticed or ((defective.message,) if defective.message else ()),
        tuple(check.name for check in broken if check.rule),
        bool(reached) or entry.defect is None,
        time.perf_counter() - began,
    )


def _case(entry: FieldError) -> Case:
    for found in find_campaigns([entry.campaign]):
        if entry.case in found.campaign:
            return found.campaign[entry.case]
    raise CannotRunError(f"entry {entry.name}: the campaign {entry.campaign!r} has no case {entry.case!r}")


def _run(case: Case, bench: str) -> CaseResult:
    limited = replace(case, wall_limit_s=LIMIT_S)
    settings = CaseSettings(seed=case_seed(0, case.identifier))
    return execute_case(limited, load_bench_file(bench or case.bench or None), settings).result
