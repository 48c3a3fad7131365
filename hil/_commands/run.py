"""`hil run` and `hil demo`: campaigns, report, exit code."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final, cast

from hil._commands.terminal import CaseProgress, console, print_json, quiet_stdout
from hil._requirements import complete
from hil.campaign import Runner, RunOptions, Selected, find_campaigns, load_bench_file, select_cases
from hil.campaign._files import Keep
from hil.errors import CannotRunError
from reports import ReportPaths, replay_command, summary, write_report
from reports.model import RunResult, Verdict

DEMO: Final = (
    "testcases.campaigns.stop_modes",
    "testcases.campaigns.fault_reactions",
    "testcases.campaigns.drive_faults",
    "testcases.campaigns.telegram_faults",
)
"""Campaigns of `hil demo`; they ship with the product."""

_KEEP: Final = ("failed", "all", "none")


@dataclass(frozen=True, slots=True, kw_only=True)
class RunRequest:
    """What the user asked for."""

    paths: tuple[str, ...] = ()
    bench: str = ""
    report: Path = Path("hil-report")
    seed: int = 0
    jobs: int = 1
    twice: bool = False
    select: str = ""
    tags: tuple[str, ...] = ()
    resume: bool = False
    evidence: str = "failed"
    as_json: bool = False
    demo: bool = False


def run_campaigns(request: RunRequest) -> int:
    """Run, report, and return the exit code."""
    if request.evidence not in _KEEP:
        raise CannotRunError(f"--evidence {request.evidence!r} is not allowed; allowed: {', '.join(_KEEP)}")
    with quiet_stdout(request.as_json):
        found = find_campaigns(DEMO if request.demo else request.paths)
        cases = select_cases(found, pattern=request.select, tags=request.tags)
    return run_selected(cases, request)


def run_selected(cases: list[Selected], request: RunRequest) -> int:
    """Run the given cases; the part that replay shares."""
    if request.twice:
        _refuse_live(cases, request.bench)
    options = RunOptions(
        bench=request.bench, seed=request.seed, jobs=request.jobs, twice=request.twice,
        evidence=cast("Keep", request.evidence), directory=request.report, resume=request.resume,
    )  # fmt: skip
    with quiet_stdout(request.as_json):
        with CaseProgress(len(cases)) as progress:
            run = Runner(cases, options, on_result=progress.case_done).run()
        paths = finish(run, request.report)
    if request.as_json:
        print_json(summary(run, report=str(paths.report), junit=str(paths.junit)))
    tell(run, paths)
    return exit_code(run)


def _refuse_live(cases: list[Selected], bench: str) -> None:
    for reference in dict.fromkeys(bench or item.case.bench for item in cases):
        file = load_bench_file(reference or None)
        if getattr(file, "kind", "virtual") != "virtual":
            raise CannotRunError(
                f"--twice needs a virtual bench: {file.name!r} runs in real time and is never twice the same"
            )


def finish(run: RunResult, directory: Path) -> ReportPaths:
    """Write the report of a run."""
    complete(run)
    return write_report(run, directory)


def exit_code(run: RunResult) -> int:
    """Return 0 when everything passed, 1 when cases failed or broke, 2 when nothing (or not all) could run.

    Blocked cases count as *could not run* only when nothing else ran.
    """
    if run.count(Verdict.FAILED) or run.count(Verdict.ERROR):
        return 1
    if run.interrupted or not run.count(Verdict.PASSED):
        return 2
    return 0


def tell(run: RunResult, paths: ReportPaths) -> None:
    """Print the outcome for people."""
    out = console()
    counts = (
        ", ".join(f"{run.count(verdict)} {verdict.value}" for verdict in Verdict if run.count(verdict))
        or "no case ran"
    )
    good = exit_code(run) == 0
    out.print(
        f"{counts}{'; interrupted' if run.interrupted else ''}",
        style="bold green" if good else "bold red",
        markup=False,
    )
    bad = [case for case in run.cases if case.verdict in {Verdict.FAILED, Verdict.ERROR}]
    for case in bad[:5]:
        out.print(f"repeat {case.identifier} with: {replay_command(case.token)}", markup=False)
    out.print(f"report: {paths.report}", markup=False)
