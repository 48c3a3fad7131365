"""`hil replay`: one case again, from its token."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from hil._commands._test_run import arguments_of_test
from hil._commands.run import exit_code, finish, tell
from hil._commands.terminal import CaseProgress, console, print_json, quiet_stdout
from hil.campaign import CaseSettings, Token, execute_case, load_bench_file, load_campaign, write_evidence
from hil.campaign._runner import clear_run, environment_facts
from hil.errors import TokenError
from reports import summary
from reports.model import CaseResult, RunResult
from reports.store import RUN_FILE, load_run, save_run

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.protocols import BenchFile


def replay_token(text: str, *, report: Path, force: bool, as_json: bool) -> int:
    """Repeat the case of a token, write its report, return the exit code."""
    token = Token.decode(text)
    if token.test_file:
        return _replay_test(token, report=report, as_json=as_json)
    with quiet_stdout(as_json):
        bench_file = load_bench_file(token.bench or None)
        if token.bench_digest and token.bench_digest != bench_file.digest:
            message = (
                f"the bench {bench_file.name!r} has changed since the token was made; "
                "the case may run differently"
            )
            if not force:
                raise TokenError(f"{message} (repeat it all the same with --force)")
            console().print(f"warning: {message}", style="yellow", markup=False)
        with CaseProgress(1, "replay", verbose=True) as progress:
            result = _execute(token, text, bench_file, report)
            progress.case_done(result, 1, 1)
        run = RunResult(
            f"Replay of {token.case}",
            token.seed,
            bench_file.name,
            bench_file.text,
            environment_facts(),
            "",
            [result],
        )
        if (report / RUN_FILE).exists():
            clear_run(report)
        save_run(report, run)
        paths = finish(run, report)
    if as_json:
        content = summary(run, report=str(paths.report), junit=str(paths.junit))
        print_json(
            {**content, "case": result.identifier, "verdict": result.verdict.value, "message": result.message}
        )
    else:
        print(f"{result.verdict.value}  {result.identifier}")  # noqa: T201 - this is the answer
        if result.message:
            print(result.message)  # noqa: T201 - this is the answer
    tell(run, paths)
    return exit_code(run)


def _execute(token: Token, text: str, bench_file: BenchFile[Bench], report: Path) -> CaseResult:
    if token.program is not None:
        from hil.fuzz import Program, run_program

        outcome = run_program(Program.from_json(token.program), bench_file, seed=token.seed)
        result = outcome.as_case(token.case)
        result.token = text
        return result
    if token.branch is not None:
        from hil.envelope import replay_branch

        execution = replay_branch(token, text, bench_file)
        write_evidence(execution, report, "all")
        return execution.result
    campaign = load_campaign(token.campaign)
    if token.case not in campaign:
        raise TokenError(f"{token.campaign} has no case {token.case!r} any more")
    execution = execute_case(campaign[token.case], bench_file, CaseSettings(seed=token.seed, token=text))
    write_evidence(execution, report, "all")
    return execution.result


def _replay_test(token: Token, *, report: Path, as_json: bool) -> int:
    """Repeat a test of pytest, in a process of its own, and return the exit code."""
    arguments = arguments_of_test(token, report=report)
    if not as_json:
        console().print(f"pytest {shlex.join(arguments)}", markup=False)
    if (report / RUN_FILE).exists():
        clear_run(report)
    # What pytest writes goes to the terminal; JSON on standard output has to stand alone.
    subprocess.run(  # noqa: S603 - pytest, with the arguments of the token
        [sys.executable, "-m", "pytest", *arguments], check=False, stdout=sys.stderr if as_json else None
    )
    run = load_run(report, lazy=True) if (report / RUN_FILE).exists() else None
    result = next((case for case in run.cases if case.identifier == token.case), None) if run else None
    if run is None or result is None:
        raise TokenError(f"pytest did not run {token.case}; what it says is above")
    if result.token and Token.decode(result.token).bench_digest != token.bench_digest:
        console().print(
            "warning: the bench has changed since the token was made; the test may have run differently",
            style="yellow",
            markup=False,
        )
    if as_json:
        content = summary(run, report=str(report / "report.html"), junit=str(report / "junit.xml"))
        print_json(
            {**content, "case": result.identifier, "verdict": result.verdict.value, "message": result.message}
        )
    return exit_code(run)
