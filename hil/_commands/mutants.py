"""`hil mutants`: defects switched on one at a time, and which campaign notices each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from hil._commands.terminal import console, print_json, quiet_stdout
from hil.configurations import CONFIGURATION
from hil.errors import CannotRunError
from hil.mutants import (
    Coverage,
    Judge,
    Mutant,
    MutantResult,
    Outcome,
    Seeder,
    Seeding,
    SeedingOptions,
    Stored,
    as_run,
    credits_of,
    draw,
    find_judges,
    find_test_files,
    line_ranges,
    load_catalogue,
    load_stored,
    reach,
    select_mutants,
    shares,
    store,
)
from hil.mutants._results import TABLE_FILE, seen_by
from reports import render_html, write_junit

JUDGES: Final = ("campaigns", "fuzz", "tests", "marks")
"""Who judges defects."""
PAGE_FILE: Final = "mutants.html"
JUNIT_FILE: Final = "mutants.xml"

_STYLE: Final = {"caught": "green", "explained": "yellow"}


@dataclass(frozen=True, kw_only=True)
class MutantsRequest:
    """What the user asked for."""

    names: tuple[str, ...] = ()
    areas: tuple[str, ...] = ()
    campaigns: tuple[str, ...] = ()
    catalogue: str = ""
    report: Path | None = None
    seed: int = 0
    jobs: int = 1
    limit_s: float = 0.0
    every_case: bool = False
    resume: bool = False
    last_failed: bool = False
    only_list: bool = False
    as_json: bool = False
    judge: str = "campaigns"
    """One of `JUDGES`."""
    programs: int = 200
    """Programs that judge, if the judge is `fuzz`."""
    mechanical: int = 0
    """So many defects are drawn from the source; 0: those of the catalogue."""
    most_cases: int = 0
    budget_s: float = 0.0
    """Wall time after which nothing further begins, s; 0: no limit."""
    coverage: Path | None = None
    """File that keeps what cases come to; None: all cases are measured."""


class _Progress:
    """Lines about baseline and defects."""

    def __init__(self) -> None:
        self._console = console()

    def baseline(self, outcome: Outcome, done: int, total: int) -> None:
        if outcome.red:
            self._console.print(
                f"red without any defect: {outcome.judge.name}", style="bold red", markup=False
            )
            self._console.print(f"    {outcome.verdict}: {outcome.message}", style="dim", markup=False)
        elif done == total or done % 50 == 0:
            self._console.print(f"baseline: {done}/{total} cases", style="dim", markup=False)

    def look(self, done: int, total: int) -> None:
        if done == total or done % 50 == 0:
            self._console.print(f"looked for a difference in {done}/{total} cases", style="dim", markup=False)

    def mutant(self, result: MutantResult, done: int, total: int) -> None:
        first = result.caught_by[0] if result.caught_by else None
        text = f"[{done:{len(str(total))}}/{total}] {result.status:9} {result.mutant.name}"
        if first is not None:
            text += f": {first.judge.name} {first.verdict} ({result.seconds:.2f} s)"
        elif result.status == "survived":
            plain = result.as_dict()
            text += f": none of {plain['cases_run']} cases notices it; {seen_by(plain)}"
        self._console.print(text, style=_STYLE.get(result.status, "bold red"), markup=False)
        if result.error:
            self._console.print(f"    {result.error}", style="dim", markup=False)


def seed_defects(request: MutantsRequest) -> int:
    """Run, report, and return the exit code."""
    mutants = _mutants(request)
    if request.only_list:
        return _show(mutants, as_json=request.as_json)
    with quiet_stdout(request.as_json):
        judges = _judges(request)
        progress = _Progress()
        stored = _stored(request)
        if request.last_failed and not request.resume:
            mutants = stored.missed(mutants)
        earlier = (
            stored.kept(mutants, judges, request.seed, again=request.last_failed) if request.resume else []
        )
        options = SeedingOptions(
            jobs=request.jobs,
            seed=request.seed,
            case_seed=0 if request.mechanical else request.seed,
            every_case=request.every_case,
            limit_s=request.limit_s,
            most_cases=request.most_cases,
            budget_s=request.budget_s,
            drops_red=request.judge == "fuzz",
        )

        def on_result(result: MutantResult, done: int, total: int) -> None:
            progress.mutant(result, done, total)
            if request.report is not None:
                store(seeder.so_far(), request.report)  # so that nothing is lost, whatever ends this

        seeder = Seeder(
            mutants,
            judges,
            options,
            on_baseline=progress.baseline,
            on_result=on_result,
            on_look=progress.look,
            earlier=earlier,
            earlier_seconds=stored.seconds if request.resume else 0.0,
            coverage=Coverage.of(request.coverage),
        )
        seeding = seeder.run()
    if request.report is not None:
        store(seeding, request.report)
        write_report(seeding, request.report)
    if request.as_json:
        print_json([result.as_dict() for result in seeding.results])
    _tell(seeding, request.report)
    return seeding.exit_code


def show_unreached(request: MutantsRequest) -> int:
    """Print the statements that no case comes to, by module; return the exit code.

    0: there are none; 1: there are some; 2: a case is red, or the budget has ended before all cases had run.
    """
    with quiet_stdout(request.as_json):
        seeder = Seeder(
            (),
            find_judges(_references(request)),
            SeedingOptions(jobs=request.jobs, limit_s=request.limit_s, budget_s=request.budget_s),
            on_baseline=_Progress().baseline,
            coverage=Coverage.of(request.coverage),
        )
        found = reach(seeder, request.areas)
        seeding = seeder.so_far()
    if request.as_json:
        print_json([one.as_dict() for one in found])
    out = console()
    for one in found:
        if one.unreached:
            out.print(
                f"{one.module}: {len(one.unreached)} of {one.statements}: lines {line_ranges(one)}",
                markup=False,
                soft_wrap=True,
            )
    total, unreached = sum(one.statements for one in found), sum(len(one.unreached) for one in found)
    text = f"{unreached} of {total} statements reached by none of {len(seeding.baseline)} cases"
    if seeding.unknown:
        text += f"; {seeding.unknown} cases did not run: the budget is used up"
    out.print(text, style="bold", markup=False)
    if seeding.red or seeding.unknown:
        return 2
    return 1 if unreached else 0


def _mutants(request: MutantsRequest) -> list[Mutant]:
    """Return the defects that the user asked for."""
    if request.mechanical < 0 or request.most_cases < 0:
        raise CannotRunError("--mechanical and --cases take a whole number from 0")
    if not request.mechanical:
        return select_mutants(load_catalogue(request.catalogue), names=request.names, areas=request.areas)
    if request.catalogue:
        raise CannotRunError(
            "--mechanical draws defects from the source, --catalogue names them: allowed is one"
        )
    drawn = draw(request.mechanical, request.seed, request.areas)
    if not request.names:
        return drawn
    return select_mutants({mutant.name: mutant for mutant in drawn}, names=request.names)


def _judges(request: MutantsRequest) -> list[Judge]:
    """Return who judges."""
    if request.judge not in JUDGES:
        raise CannotRunError(f"--judge {request.judge!r} is not allowed; allowed: {', '.join(JUDGES)}")
    if request.judge in {"tests", "marks"}:
        return find_test_files(request.campaigns, claims=request.judge == "marks")
    return find_judges(_references(request))


def _references(request: MutantsRequest) -> tuple[str, ...]:
    """Return the campaigns that judge; none: those that ship."""
    if request.judge == "campaigns":
        return request.campaigns
    if request.campaigns:
        raise CannotRunError("--judge fuzz takes programs in place of campaigns: without --campaign")
    from hil.fuzz.judging import write_programs

    folder = (
        request.coverage or Path(".hil/coverage.jsonl")
    ).parent / f"fuzz-{request.programs}-{request.seed}"
    # The benches that the campaigns judge on; machines of configurations have their own half.
    benches = dict.fromkeys(judge.bench for judge in find_judges())
    others = [one for one in benches if CONFIGURATION not in one]
    return (str(write_programs(folder, request.programs, request.seed, others)),)


def write_report(seeding: Seeding, directory: Path) -> None:
    """Write `mutants.html` and `mutants.xml` (JUnit), where every defect is a case."""
    run = as_run(seeding)
    render_html(run, directory / PAGE_FILE)
    write_junit(run, directory / JUNIT_FILE)


def _stored(request: MutantsRequest) -> Stored:
    """Return what the report folder holds, if it is asked for."""
    if not (request.resume or request.last_failed):
        return Stored()
    if request.report is None:
        raise CannotRunError("--resume and --last-failed need the folder of the earlier run: --report DIR")
    return load_stored(request.report)


def _show(mutants: Sequence[Mutant], *, as_json: bool) -> int:
    if as_json:
        print_json([MutantResult(mutant).as_dict() for mutant in mutants])
        return 0
    for mutant in mutants:
        print(f"{mutant.name}  [{mutant.area}; {', '.join(mutant.requirements)}]")  # noqa: T201 - the answer
        print(f"    {mutant.title}")  # noqa: T201 - the answer
        for edit in mutant.edits:
            print(f"      in {edit.target}")  # noqa: T201 - the answer
        if mutant.explained:
            print(f"      not caught: {mutant.explained}")  # noqa: T201 - the answer
    return 0


def _tell(seeding: Seeding, report: Path | None) -> None:
    out = console()
    if seeding.red and seeding.results:
        out.print(
            f"{len(seeding.red)} of {len(seeding.baseline)} programs are red without any defect: they judge "
            "nothing",
            style="bold yellow",
            markup=False,
        )
    elif seeding.red:
        out.print(
            f"{len(seeding.red)} of {len(seeding.baseline)} cases are red without any defect; repair them "
            f"first, a defect cannot be "
            "judged by them",
            style="bold red",
            markup=False,
        )
        return
    total = len(seeding.results)
    parts = [f"{seeding.count('caught')} of {total} caught in {seeding.seconds:.0f} s"]
    others = {status: seeding.count(status) for status in ("explained", "survived", "never ran", "error")}
    parts += [f"{count} {status}" for status, count in others.items() if count]
    if seeding.interrupted:
        parts.append("interrupted" + ("" if report is None else "; --resume goes on"))
    good = seeding.exit_code == 0
    out.print("; ".join(parts), style="bold green" if good else "bold red", markup=False)
    out.print(
        f"baseline: {len(seeding.baseline)} cases green, {seeding.measured} of them run in "
        f"{seeding.baseline_seconds:.0f} s",
        style="dim",
        markup=False,
    )
    if seeding.unknown:
        out.print(
            f"the budget is used up: {seeding.unknown} cases did not run without a defect and judge nothing",
            style="bold yellow",
            markup=False,
        )
    for line in (*(row.line for row in shares(seeding)), *(one.line for one in credits_of(seeding))):
        out.print(line, markup=False, soft_wrap=True)
    if report is not None:
        out.print(f"report: {report / PAGE_FILE}, table: {report / TABLE_FILE}", markup=False)
