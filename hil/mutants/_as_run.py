"""A run of seeded defects in the form of a run of cases, so that report and JUnit file show it like any
other.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Final

from hil.campaign import environment_facts
from hil.mutants._seeding import MutantResult, Seeding
from reports.model import CaseResult, Check, RunResult, Step, Verdict

_VERDICT: Final = {
    "caught": Verdict.PASSED,
    "explained": Verdict.BLOCKED,
    "survived": Verdict.FAILED,
    "never ran": Verdict.FAILED,
}


def as_run(seeding: Seeding) -> RunResult:
    """Return a run with a case for every defect: passed is caught, failed has survived, blocked has an
    explanation.

    No case claims a requirement: that a defect is caught shows that cases judge, not that the product does
    what it should.
    """
    return RunResult(
        title="Defect seeding",
        seed=seeding.seed,
        bench_name="",
        bench_text="",
        environment=environment_facts(),
        # The wall clock dates the report; nothing is controlled by it.
        started=datetime.now(UTC).isoformat(timespec="seconds"),
        cases=[_case(result, seeding.seed) for result in seeding.results],
        interrupted=seeding.interrupted,
    )


def _case(result: MutantResult, seed: int) -> CaseResult:
    mutant, plain = result.mutant, result.as_dict()
    story = [
        Step(0.0, "inject", f"{edit.target}: {edit.old!r} becomes {edit.new!r}") for edit in mutant.edits
    ]
    story += [Step(0.0, "observe", f"offends against {one}") for one in mutant.requirements]
    checks = []
    for outcome in result.caught_by:
        story.append(Step(0.0, "expect", f"{outcome.judge.name}: {outcome.verdict}"))
        checks.append(
            Check(outcome.judge.name, Verdict.PASSED, "not passed", f"{outcome.verdict}: {outcome.message}")
        )
    return CaseResult(
        identifier=f"defects/{mutant.area}/{mutant.name}",
        title=mutant.title,
        verdict=_VERDICT.get(result.status, Verdict.ERROR),
        message=_message(result, int(str(plain["cases_run"]))),
        group=f"defects/{mutant.area}",
        tags=[mutant.area, result.status],
        seed=seed,
        wall_s=result.seconds,
        story=story,
        checks=checks,
    )


def _message(result: MutantResult, cases: int) -> str:
    return {
        "caught": "",
        "explained": result.mutant.explained,
        "survived": f"none of {cases} cases that reach it notices it: an expectation is missing",
        "never ran": "no case comes to the changed statement",
    }.get(result.status, result.error)
