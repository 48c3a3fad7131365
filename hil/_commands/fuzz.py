"""`hil fuzz`: search, pairs of faults, readable script, token, replay."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from hil._commands.run import finish
from hil._commands.terminal import CaseProgress, console, print_json, quiet_stdout
from hil.campaign import environment_facts, load_bench_file, write_evidence
from hil.campaign._execute import Execution
from hil.campaign._runner import clear_run
from hil.fuzz import (
    Corpus,
    FuzzOutcome,
    FuzzReport,
    by_family,
    fault_pairs,
    program_token,
    run_program,
    search,
)
from reports import replay_command
from reports.model import RunResult
from reports.store import RUN_FILE, save_run

MOST_FAILURES: Final = 20
"""Pairs of faults are run until so many programs have failed."""
SEVERAL_AXES: Final = "synchronous"
"""Bench of programs for several axes, where none is given."""


def fuzz_bench(
    *,
    cases: int,
    seed: int,
    bench: str,
    steps: int,
    configurations: bool | None,
    axes: int,
    jobs: int,
    corpus: Path | None,
    report: Path,
    as_json: bool,
) -> int:
    """Search, tell, return the exit code: 1 when an invariant was broken."""
    machines: tuple[str, ...] = ()
    if configurations is None:
        configurations = not bench and axes == 1
    if configurations and not bench and axes == 1:
        from hil.fuzz._machines import machine_names

        machines = machine_names(seed)
    if axes > 1 and not bench:
        bench = SEVERAL_AXES
    with quiet_stdout(as_json):
        bench_file = load_bench_file(bench or None)
        kept = None if corpus is None else Corpus(corpus)
        with CaseProgress(cases, "fuzz programs") as progress:

            def on_run(count: int, outcome: FuzzOutcome | None) -> None:
                broken = None if outcome is None else outcome.violation
                progress.step(min(count, cases), "" if broken is None else f"shrinking: {broken.invariant}")

            found = search(
                bench_file,
                cases=cases,
                seed=seed,
                longest=steps,
                configurations=configurations,
                axes=axes,
                machines=machines,
                bench=bench,
                jobs=jobs,
                on_run=on_run,
                parents=() if kept is None else kept.programs,
                on_new=None if kept is None else kept.keep,
            )
    out = console()
    failure = found.failure
    result: dict[str, object] = {
        "cases": found.cases,
        "seed": seed,
        "refused": found.refused,
        "failures": [],
        "report": "",
        "reached": by_family(found.reached),
        "new": len(found.reached) - found.known,
        "never": list(found.never),
    }
    _tell_reached(found)
    if failure is None or failure.violation is None:
        out.print(f"{found.cases} programs, no invariant broken", style="bold green", markup=False)
        if as_json:
            print_json(result)
        return 0
    violation = failure.violation
    failed_on = failure.program.configuration.applied_to(bench_file)
    page = _report([failure], report, seed=seed, bench_name=bench_file.name, bench_text=failed_on.text)
    script = report / "program.json"
    script.write_text(json.dumps(failure.program.to_json(), indent=1) + "\n", encoding="utf-8")
    result["report"] = str(page)
    result["failures"] = [
        {
            "invariant": violation.invariant,
            "text": violation.text,
            "time_s": violation.time_s,
            "requirements": list(violation.requirements),
            "script": str(failure.program).splitlines(),
            "program": failure.program.to_json(),
            "token": found.token,
            "repeatable": found.repeatable,
            "others": found.others,
        }
    ]
    out.print(f"{violation}", style="bold red", markup=False)
    out.print(f"after {found.cases} programs; smallest program found:", markup=False)
    out.print(str(failure.program), markup=False)
    out.print(f"keep it as a case with: hil keep {found.token}", markup=False)
    out.print(f"repeat it with: {replay_command(found.token)}", markup=False)
    out.print(f"report: {page}", markup=False)
    if not found.repeatable:
        out.print(
            "warning: running it again gave another trace; the bench is not repeatable",
            style="yellow",
            markup=False,
        )
    if as_json:
        print_json(result)
    return 1


def _report(
    failures: Sequence[FuzzOutcome], report: Path, *, seed: int, bench_name: str, bench_text: str
) -> Path:
    """Write evidence and report of programs that have failed, in place of an earlier run in the folder."""
    if (report / RUN_FILE).exists():
        clear_run(report)
    report.mkdir(parents=True, exist_ok=True)
    for failure in failures:
        write_evidence(Execution(failure.result, failure.trace), report, "all")
    results = [failure.result for failure in failures]
    run = RunResult("Fuzz", seed, bench_name, bench_text, environment_facts(), "", results)
    save_run(report, run)
    return finish(run, report).report


def fuzz_pairs(
    *, bench: str, seed: int, kinds: Sequence[str], part: tuple[int, int] | None, report: Path, as_json: bool
) -> int:
    """Run every pair of fault kinds on a bench, tell, return the exit code: 1 when an invariant was broken.

    Args:
        bench: Reference of the bench; empty: the embedded one.
        seed: Of the parameters of the faults, and of the bench.
        kinds: Only pairs of these; none: of all that a search draws.
        part: Number, from 1, and count: only the programs of this part.
        report: Folder for what has failed.
        as_json: Result as JSON on standard output.

    """
    failures: list[FuzzOutcome] = []
    tokens: list[str] = []
    skipped = 0
    out = console()
    with quiet_stdout(as_json):
        bench_file = load_bench_file(bench or None)
        programs = fault_pairs(bench_file, seed=seed, kinds=kinds)
        if part is not None:
            programs = programs[part[0] - 1 :: part[1]]
        with CaseProgress(len(programs), "pairs of faults") as progress:
            for count, program in enumerate(programs, 1):
                outcome = run_program(program, bench_file, seed=seed, evidence=False)
                skipped += bool(outcome.skipped)
                if outcome.violation is not None and len(failures) < MOST_FAILURES:
                    outcome.as_case()
                    failures.append(outcome)
                    tokens.append(
                        program_token(program, seed=seed, bench=bench, bench_digest=bench_file.digest)
                    )
                progress.step(count, f"{len(failures)} broken" if failures else "")
                if len(failures) == MOST_FAILURES:
                    break
    for outcome, token in zip(failures, tokens, strict=True):
        out.print(f"{outcome.violation}", style="bold red", markup=False)
        out.print(str(outcome.program), markup=False)
        out.print(f"repeat it with: {replay_command(token)}", markup=False)
    page = ""
    if failures:
        page = str(
            _report(failures, report, seed=seed, bench_name=bench_file.name, bench_text=bench_file.text)
        )
        out.print(f"report: {page}", markup=False)
    style = "bold red" if failures else "bold green"
    out.print(f"{count} programs, {len(failures)} of them break an invariant", style=style, markup=False)
    if skipped:
        out.print(f"in {skipped} of them a fault could not be injected", style="yellow", markup=False)
    if as_json:
        found = [
            {"invariant": str(one.violation), "program": one.program.to_json(), "token": token}
            for one, token in zip(failures, tokens, strict=True)
        ]
        print_json({"programs": count, "skipped": skipped, "failures": found, "report": page})
    return 1 if failures else 0


def _tell_reached(found: FuzzReport) -> None:
    """Say what the programs went through, and which faults never acted."""
    out = console()
    counts = ", ".join(f"{family} {count}" for family, count in by_family(found.reached).items())
    text = (
        f"reached {len(found.reached)} situations ({counts}); {len(found.reached) - found.known} of them new"
    )
    out.print(text, markup=False, soft_wrap=True)
    if found.refused:
        out.print(
            f"{found.refused} programs had a configuration that does not hold together",
            markup=False,
            soft_wrap=True,
        )
    if found.never:
        out.print(f"faults that never acted: {', '.join(found.never)}", markup=False, soft_wrap=True)
