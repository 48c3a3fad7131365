"""`hil run` and `hil demo`: campaigns, report, exit code."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Final, cast

from hil._commands.cockpit import LOOPBACK, check_installed, listen
from hil._commands.terminal import CaseProgress, console, print_json, quiet_stdout
from hil._outputs import check_summary, give_summary, history_file, kept
from hil._requirements import Requirement, complete, own_requirements
from hil._workers import number_of_processes
from hil.bench.makes import make_of
from hil.campaign import (
    SHIPPED,
    Runner,
    RunOptions,
    Selected,
    find_campaigns,
    load_bench_file,
    load_campaign,
    select_cases,
)
from hil.campaign._configurations import draw_configurations
from hil.campaign._controllers import parse_controllers
from hil.campaign._files import Keep
from hil.campaign._lock import only_run_in
from hil.campaign._runner import shard
from hil.campaign._shipped import references
from hil.configurations import differing
from hil.errors import CannotRunError
from hil.protocols import kind_of
from reports import Background, ReportPaths, replay_command, summary, write_report
from reports.coverage import not_looked_at
from reports.model import CaseResult, Earlier, RunResult, Verdict
from reports.store import RUN_FILE, load_run

if TYPE_CHECKING:
    from hil.cockpit.campaign_watch import CampaignWatch

_KEEP: Final = ("failed", "all", "none")
MOST_EACH: Final = 100
"""Most configurations of a case."""


@dataclass(frozen=True, kw_only=True)
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
    last_failed: bool = False
    shard: str = ""
    """`2/4`: the second of four parts; empty: all."""
    wall_limit_s: float = 0.0
    budget_s: float = 0.0
    """Wall time after which no further case begins, s; 0: no limit."""
    cluster: str = ""
    evidence: str = "failed"
    as_json: bool = False
    demo: bool = False
    history: str = ""
    """File of the history; empty: in the report folder; `none`: no history."""
    summary: str = ""
    """Where the markdown summary goes; empty: nowhere."""
    verbose: bool = False
    """A line for each case."""
    unread: bool = False
    """List the recorded signals that nothing has looked at."""
    catalogue: Path | None = None
    """Requirements of the user, which lead the report."""
    configurations: str = ""
    """`pairwise` or `pairwise:3`: every case on configurations in place of its own bench."""
    watch_port: int | None = None
    """Port of the page that shows the run; 0: any that is free; None: no page."""
    controllers: str = ""
    """`nc` or `s7,nc`: every case on axes of these makes; empty: on those of the bench."""


def run_campaigns(request: RunRequest) -> int:
    """Run, report, and return the exit code."""
    own = own_requirements(request.catalogue)  # what is wrong with it is said before anything runs
    check_summary(request.summary, as_json=request.as_json)
    if request.evidence not in _KEEP:
        raise CannotRunError(f"--evidence {request.evidence!r} is not allowed; allowed: {', '.join(_KEEP)}")
    return run_selected(selected(request), request, own)


def selected(request: RunRequest) -> list[Selected]:
    """Return the cases that the user asked for."""
    with quiet_stdout(request.as_json):
        found = find_campaigns(
            references(one for one in SHIPPED if one.demo) if request.demo else request.paths
        )
        cases = select_cases(found, pattern=request.select, tags=request.tags)
        cases = on_controllers(cases, request)
        if request.configurations:
            cases = on_configurations(cases, request)
    if not request.last_failed or request.resume:
        return cases
    wanted = failed_before(request.report)
    again = [item for item in cases if item.case.identifier in wanted]
    if not again:
        raise CannotRunError(
            f"none of the {len(wanted)} cases that failed in {request.report} is among the {len(cases)} "
            f"selected ones"
            if wanted
            else f"no case failed in {request.report}: there is nothing to repeat"
        )
    return again


def on_configurations(cases: list[Selected], request: RunRequest) -> list[Selected]:
    """Return every case on its configurations, and tell which cases none of them serves."""
    if request.bench:
        raise CannotRunError(
            "--configurations makes the benches: leave --bench out, or give a configuration as --bench alone"
        )
    drawn = draw_configurations(cases, seed=request.seed, each=parse_configurations(request.configurations))
    console().print(drawn.summary, markup=False)
    return drawn.cases


def on_controllers(cases: list[Selected], request: RunRequest) -> list[Selected]:
    """Return every case once for each make of controller that the user asked for, next to each other.

    A bench file whose first axis is one of an NC asks for `nc` by itself.
    """
    controllers = parse_controllers(request.controllers)
    if not controllers:
        if not request.bench or make_of(load_bench_file(request.bench)) != "nc":
            return cases
        controllers = ("nc",)
    if request.configurations and len(controllers) > 1:
        raise CannotRunError(
            "--configurations with --controllers takes one make at a time: each draws machines that it can "
            "have"
        )
    if "s7" in controllers and request.bench and make_of(load_bench_file(request.bench)) == "nc":
        raise CannotRunError(
            f"--controllers s7: the axes of {request.bench} are those of an NC; give the bench with "
            "technology "
            f"objects, from which the NC axes are made"
        )
    return [
        Selected(load_campaign(item.campaign).on_controller(item.case, controller), item.campaign)
        for item in cases
        for controller in controllers
    ]


def parse_configurations(text: str) -> int | None:
    """Read `pairwise`, which is None, or `pairwise:3`.

    Raises:
        CannotRunError: It is neither.

    """
    kind, colon, number = text.partition(":")
    if kind != "pairwise" or (colon and not (number.isdecimal() and 1 <= int(number) <= MOST_EACH)):
        raise CannotRunError(
            f"--configurations {text!r} is not allowed; allowed: pairwise, or pairwise:N with N from 1 to "
            f"{MOST_EACH} configurations for each case"
        )
    return int(number) if colon else None


def failed_before(directory: Path) -> set[str]:
    """Return the cases that failed or broke in the run in a folder."""
    return {
        case.identifier
        for case in load_run(directory, lazy=True).cases
        if case.verdict in {Verdict.FAILED, Verdict.ERROR}
    }


def list_cases(request: RunRequest) -> int:
    """Print the cases that would run, and run nothing; returns the exit code."""
    part = parse_shard(request.shard)
    cases = shard(selected(request), part)
    if request.as_json:
        print_json(
            [
                {
                    "identifier": item.case.identifier,
                    "title": item.case.title,
                    "tags": list(item.case.tags),
                    "bench": request.bench or item.case.bench,
                    "configuration": dict(item.configuration),
                    "campaign": item.campaign,
                    "requirements": list(item.case.requirements),
                }
                for item in cases
            ]
        )
        return 0
    for item in cases:
        print(f"{item.case.identifier}  {item.case.title}")  # noqa: T201 - the answer
        if item.configuration:
            print(f"    {item.case.bench}: {differing(item.configuration)}")  # noqa: T201 - the answer
    console().print(f"{len(cases)} cases", markup=False)
    return 0


def list_campaigns(*, as_json: bool, asked: bool) -> int:
    """Print the shipped campaigns with the number of their cases; returns the exit code.

    Args:
        as_json: As JSON.
        asked: The list is what the user asked for; otherwise nothing was named to run, which is exit code 2.

    """
    rows = []
    with quiet_stdout(as_json):
        for shipped in SHIPPED:
            cases = sum(len(found.campaign) for found in find_campaigns([shipped.reference]))
            rows.append((shipped, cases, shipped.summary))
    if as_json:
        print_json(
            [
                {"name": shipped.name, "title": title, "cases": cases, "reference": shipped.reference}
                for shipped, cases, title in rows
            ]
        )
    else:
        for shipped, cases, title in rows:
            print(f"{shipped.name:20} {cases:4}  {title}")  # noqa: T201 - the answer
    if asked:
        return 0
    console().print(
        "nothing to run: name campaigns of this list, files or modules: hil run stop_modes", markup=False
    )
    return 2


def parse_shard(text: str) -> tuple[int, int] | None:
    """Read `2/4`.

    Raises:
        CannotRunError: It is not of this form, or there is no such part.

    """
    if not text:
        return None
    number, slash, count = text.partition("/")
    if not (slash and number.isdecimal() and count.isdecimal()) or not 1 <= int(number) <= int(count):
        raise CannotRunError(
            f"--shard {text!r} is not allowed; allowed: I/N with I from 1 to N, for example 2/4"
        )
    return int(number), int(count)


def parse_jobs(text: str) -> int:
    """Read a number of worker processes; `auto` is 0, one for every processor.

    Raises:
        CannotRunError: It is neither.

    """
    if text == "auto":
        return 0
    if not text.isdecimal():
        raise CannotRunError(
            f"--jobs {text!r} is not allowed; allowed: a whole number from 1, or 0 or auto for all processors"
        )
    return int(text)


def run_selected(cases: list[Selected], request: RunRequest, own: Sequence[Requirement]) -> int:
    """Run the given cases and return the exit code; `own`: requirements of the user."""
    if request.twice:
        _refuse_live(cases, request.bench)
    options = RunOptions(
        bench=request.bench,
        seed=request.seed,
        jobs=request.jobs,
        twice=request.twice,
        evidence=cast("Keep", request.evidence),
        directory=request.report,
        resume=request.resume,
        repeat_failed=request.last_failed,
        shard=parse_shard(request.shard),
        wall_limit_s=request.wall_limit_s,
        budget_s=request.budget_s,
        cluster=request.cluster,
    )
    with quiet_stdout(request.as_json), only_run_in(request.report), ExitStack() as stack:
        mine = shard(cases, options.shard)
        watch = None if request.watch_port is None else stack.enter_context(_page(mine, options, request))
        run, background, paths = _run_once(cases, options, request, own, watch)
        while watch is not None and (not run.interrupted or watch.stopping):
            watch.paused(finished=not run.interrupted)
            if not _goes_on(watch):
                break
            watch.resumed()
            again = replace(options, resume=True)
            run, background, paths = _run_once(cases, again, request, own, watch)
    give_summary(request.summary, run, background, paths)
    if request.as_json:
        print_json(summary(run, report=str(paths.report), junit=str(paths.junit)))
    tell(run, paths, background)
    if request.unread:
        names = not_looked_at(run)
        console().print(
            f"{len(names)} signals, bits and variables that nothing looked at: {', '.join(names)}"
            if names
            else "every signal, bit and variable was looked at",
            markup=False,
        )
    if request.budget_s and run.interrupted:
        console().print(skipped(run, mine), style="bold yellow", markup=False)
    return exit_code(run)


def _run_once(
    cases: list[Selected],
    options: RunOptions,
    request: RunRequest,
    own: Sequence[Requirement],
    watch: CampaignWatch | None,
) -> tuple[RunResult, Background | None, ReportPaths]:
    """Run what is left of the cases, and write the report."""
    mine = shard(cases, options.shard)
    groups = Counter(item.case.group for item in mine)
    with CaseProgress(len(mine), groups=groups, verbose=request.verbose) as progress:

        def done(result: CaseResult, number: int, total: int) -> None:
            progress.case_done(result, number, total)
            if watch is not None:
                watch.case_done(result)

        run = Runner(
            cases,
            options,
            on_result=done,
            on_begin=None if watch is None else watch.case_began,
            stop=None if watch is None else lambda: watch.stopping,
        ).run()
    background = kept(run, request.report, request.history)
    return run, background, finish(run, request.report, background, own=own)


@contextmanager
def _page(mine: Sequence[Selected], options: RunOptions, request: RunRequest) -> Iterator[CampaignWatch]:
    """Serve the page of a run.

    Raises:
        CannotRunError: The extra `cockpit` is not installed, or the port is taken.

    """
    check_installed()
    from hil.cockpit.campaign_watch import CampaignWatch
    from hil.cockpit.watch_server import served_watch

    goes_on = request.resume and (request.report / RUN_FILE).exists()
    groups = dict.fromkeys(item.case.group for item in mine)
    watch = CampaignWatch(
        ", ".join(groups),
        len(mine),
        workers=min(number_of_processes(options.jobs), max(len(mine), 1)),
        history=history_file(request.history, request.report),
        earlier=load_run(request.report, lazy=True).cases if goes_on else (),
    )
    with served_watch(watch, listen(LOOPBACK, request.watch_port or 0)) as address:
        console().print(f"watch this run: {address}", markup=False, soft_wrap=True)
        yield watch


def _goes_on(watch: CampaignWatch) -> bool:
    """Wait until somebody lets a stopped run go on, or ends the command."""
    console().print("the page stays until End is pressed there, or Ctrl-C", markup=False)
    try:
        return watch.wait_for_orders()
    except KeyboardInterrupt:
        return False


def _refuse_live(cases: list[Selected], bench: str) -> None:
    for reference in dict.fromkeys(bench or item.case.bench for item in cases):
        file = load_bench_file(reference or None)
        if kind_of(file) != "virtual":
            raise CannotRunError(
                f"--twice needs a virtual bench: {file.name!r} runs in real time and is never twice the same"
            )


def finish(
    run: RunResult,
    directory: Path,
    background: Background | None = None,
    earlier: Mapping[str, Earlier] | None = None,
    own: Sequence[Requirement] = (),
) -> ReportPaths:
    """Write the report of a run; `earlier`: runs of its cases to compare with, instead of last passes;
    `own`: requirements of the user.
    """
    complete(run, own)
    return write_report(run, directory, background=background, earlier=earlier)


def skipped(run: RunResult, cases: Sequence[Selected]) -> str:
    """Return what a budget of time has left out, by campaign."""
    ran = {case.identifier for case in run.cases}
    left = Counter(item.case.group for item in cases if item.case.identifier not in ran)
    parts = ", ".join(f"{group} {count}" for group, count in left.items())
    return (
        f"the budget is used up: {left.total()} of {len(cases)} cases did not run ({parts}); --resume goes on"
    )


def exit_code(run: RunResult) -> int:
    """Return 0 when everything passed, 1 when cases failed or broke, 2 when nothing (or not all) could run.

    Blocked cases count as *could not run* only when nothing else ran.
    """
    if run.count(Verdict.FAILED) or run.count(Verdict.ERROR):
        return 1
    if run.interrupted or not run.count(Verdict.PASSED):
        return 2
    return 0


def tell(run: RunResult, paths: ReportPaths, background: Background | None = None) -> None:
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
    for case in [case for case in bad if case.token][:5]:
        out.print(f"repeat {case.identifier} with: {replay_command(case.token)}", markup=False)
    if background is not None and background.comparison.common:
        changed = [f"{len(cases)} {name}" for name, cases in background.comparison.changes().items() if cases]
        out.print(f"since the last results: {', '.join(changed) or 'no verdict has changed'}", markup=False)
    out.print(f"report: {paths.report}", markup=False)
