"""`hil fuzz`: search, readable script, token, replay."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Final

from hil._commands.run import finish
from hil._commands.terminal import CaseProgress, console, print_json, quiet_stdout
from hil.campaign import environment_facts, load_bench_file, write_evidence
from hil.campaign._execute import Execution
from hil.campaign._runner import clear_run
from hil.fuzz import Corpus, FuzzOutcome, FuzzReport, by_family, search
from reports import replay_command
from reports.model import RunResult
from reports.store import RUN_FILE, save_run

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
    if (report / RUN_FILE).exists():
        clear_run(report)
    report.mkdir(parents=True, exist_ok=True)
    failed_on = failure.program.configuration.applied_to(bench_file)
    write_evidence(Execution(failure.result, failure.trace), report, "all")
    run = RunResult("Fuzz", seed, bench_file.name, failed_on.text, environment_facts(), "", [failure.result])
    save_run(report, run)
    paths = finish(run, report)
    script = report / "program.json"
    script.write_text(json.dumps(failure.program.to_json(), indent=1) + "\n", encoding="utf-8")
    result["report"] = str(paths.report)
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
    out.print(f"report: {paths.report}", markup=False)
    if not found.repeatable:
        out.print(
            "warning: running it again gave another trace; the bench is not repeatable",
            style="yellow",
            markup=False,
        )
    if as_json:
        print_json(result)
    return 1


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
