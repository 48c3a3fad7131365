"""Results of seeded defects: tables, a run for the report, and files that a later run continues from."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from hil.campaign import environment_facts
from hil.errors import CannotRunError
from hil.mutants._mutant import Mutant
from hil.mutants._plan import Judge
from hil.mutants._seeding import MutantResult, Seeding, changes_of, digest_of
from reports.archive import write_whole
from reports.model import CaseResult, Check, RunResult, Step, Verdict


def _cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ")


def markdown(seeding: Seeding) -> str:
    """Return the defect-seeding table of a run."""
    caught, total = seeding.count("caught"), len(seeding.results)
    lines = [
        "# Defect seeding",
        "",
        (
            f"{caught} of {total} caught in {seeding.seconds:.0f} s, baseline ({len(seeding.baseline)} cases) "  # noqa: E501
            f"included."
        ),
        *(f"* {row.line}" for row in shares(seeding)),
        *(f"* {row.line}" for row in credits_of(seeding)),
        "",
        "| defect | area | what is wrong | status | noticed by | how | s |",
        "|---|---|---|---|---|---|---|",
    ]
    for result in seeding.results:
        mutant = result.mutant
        red = result.caught_by
        by = ", ".join(f"`{outcome.judge.name}`" for outcome in red) or _cell(
            mutant.explained
            or result.error
            or ("" if result.status != "survived" else seen_by(result.as_dict()))
        )
        how = red[0].verdict if red else ""
        lines.append(
            f"| `{mutant.name}` | {mutant.area} | {_cell(mutant.title)} | {result.status} | {by} | {how} "
            f"| {result.seconds:.2f} |"
        )
    return "\n".join(lines) + "\n"


def catalogue_table(mutants: Iterable[Mutant], area: str) -> list[str]:
    """Return the rows of the documentation for the defects of an area, heading included."""
    lines = ["| defect | what is wrong | where | requirements |", "|---|---|---|---|"]
    for mutant in mutants:
        if mutant.area == area:
            where = ", ".join(f"`{edit.target.partition(':')[2]}`" for edit in mutant.edits)
            lines.append(
                f"| `{mutant.name}` | {_cell(mutant.title)} | {where} | {', '.join(mutant.requirements)} |"
            )
    return lines


def seen_by(plain: Mapping[str, object]) -> str:
    """Return whether a survivor, as plain data, changes a trace, and that of which cases; or else whether it
    makes a difference at all where it is, and the nearest cases.
    """
    cases, nearest = plain["changed_trace_of"], plain["nearest"]
    assert isinstance(cases, list)
    assert isinstance(nearest, list)
    if cases:
        more = f" and {len(cases) - 3} more" if len(cases) > 3 else ""
        return f"it changes the trace of {', '.join(cases[:3])}{more}: an expectation is missing"
    looked_at, different = plain["cases_looked_at"], plain["cases_with_a_difference"]
    if looked_at and not different:
        text = (
            f"in none of {looked_at} cases does it make a difference where it is: a stimulus is missing, or "
            f"there is none"
        )
    else:
        text = "all traces stay as they are"
        if looked_at:
            text += f", though in {different} of {looked_at} cases it makes a difference where it is"
        text += ": no case brings a difference out, or there is none"
    return f"{text}; nearest: {', '.join(nearest)}" if nearest else text


@dataclass(frozen=True)
class Share:
    """How many of some drawn defects were noticed."""

    what: str
    """`all`, `area motion`, `operator border`."""
    noticed: int
    judged: int
    """Without those that no case can notice."""
    named: int
    """Noticed ones where the failed check names a requirement."""
    seen: int
    """Survivors that change the trace of a case: the stimulus is there, an expectation is missing."""

    @property
    def line(self) -> str:
        """The share as a line of text."""
        percent = 100.0 * self.noticed / self.judged if self.judged else 100.0
        text = f"{self.what:22} {self.noticed:4} of {self.judged:4} noticed  {percent:5.1f} %"
        if self.noticed:
            text += f"; {self.named} by a check that names a requirement"
        return text + (f"; {self.seen} survivors change a trace" if self.seen else "")


def shares(seeding: Seeding) -> list[Share]:
    """Return the shares of drawn defects that were noticed, all in all and by area and operator; a catalogue
    made by people has none.
    """
    drawn = [result for result in seeding.results if result.mutant.operator]
    if not drawn:
        return []
    groups: dict[str, list[MutantResult]] = {"all": drawn}
    for result in sorted(drawn, key=lambda one: one.mutant.area):
        groups.setdefault(f"area {result.mutant.area}", []).append(result)
    for result in sorted(drawn, key=lambda one: one.mutant.operator):
        groups.setdefault(f"operator {result.mutant.operator}", []).append(result)
    return [_share(what, results) for what, results in groups.items()]


def _share(what: str, results: Sequence[MutantResult]) -> Share:
    entries = [result.as_dict() for result in results]
    judged = [entry for entry in entries if entry["status"] not in {"explained", "error"}]
    noticed = [entry for entry in judged if entry["status"] == "caught"]
    seen = sum(bool(entry["changed_trace_of"]) for entry in judged if entry["status"] == "survived")
    return Share(what, len(noticed), len(judged), sum(bool(entry["broken"]) for entry in noticed), seen)


_ENDS: Final = {
    "error": "an exception",
    "failed": "a failed case",
    "blocked": "a bench that does not start",
    "hung": "a hang",
    "crashed": "a crash",
}


@dataclass(frozen=True)
class Credit:
    """What noticed drawn defects, and how many."""

    title: str
    """`by campaign`, `by rule`, `otherwise by` (an expectation of a case, or the end of a case)."""
    counts: Mapping[str, int]
    """By name, the most first."""

    @property
    def line(self) -> str:
        """All of it as a line of text."""
        return f"{self.title}: {', '.join(f'{name} {count}' for name, count in self.counts.items())}"


def credits_of(seeding: Seeding) -> list[Credit]:
    """Return how many drawn defects each campaign and each rule noticed, by the first case that did.

    What no rule noticed was an expectation of the case, an exception, a bench that does not start, a hang, or
    a crash.
    """
    campaigns: Counter[str] = Counter()
    rules: Counter[str] = Counter()
    others: Counter[str] = Counter()
    for result in seeding.results:
        if not (result.mutant.operator and result.caught_by):
            continue
        first = result.caught_by[0]
        campaigns[first.judge.identifier.partition("/")[0]] += 1
        if first.rule:
            rules[first.check] += 1
        else:
            others["an expectation of a case" if first.check else _ENDS[first.verdict]] += 1
    found = {"by campaign": campaigns, "by rule": rules, "otherwise by": others}
    return [Credit(title, dict(counts.most_common())) for title, counts in found.items() if counts]


_VERDICT: Final = {
    "caught": Verdict.PASSED,
    "explained": Verdict.BLOCKED,
    "survived": Verdict.FAILED,
    "never ran": Verdict.FAILED,
}


def as_run(seeding: Seeding) -> RunResult:
    """Return a run with a case for every defect: passed is caught, failed has
    survived, blocked has an explanation.

    No case is marked with a requirement: that a defect is caught shows that cases judge, not that
    the product does what it should.
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
        message=_message(result, plain),
        group=f"defects/{mutant.area}",
        tags=[mutant.area, result.status],
        seed=seed,
        wall_s=result.seconds,
        story=story,
        checks=checks,
    )


def _message(result: MutantResult, plain: Mapping[str, object]) -> str:
    return {
        "caught": "",
        "explained": result.mutant.explained,
        "survived": f"none of {plain['cases_run']} cases that reach it notices it; {seen_by(plain)}",
        "never ran": "no case comes to the changed statement",
    }.get(result.status, result.error)


JSON_FILE: Final = "mutants.json"
TABLE_FILE: Final = "mutants.md"
_GOOD: Final = frozenset({"caught", "explained"})
_NEEDED: Final = frozenset(
    {
        "broken",
        "cases_looked_at",
        "cases_with_a_difference",
        "caught_by",
        "changed_trace_of",
        "changes",
        "check",
        "how",
        "message",
        "nearest",
        "rule",
        "seconds",
        "status",
    }
)


def store(seeding: Seeding, directory: Path) -> None:
    """Write `mutants.json` and `mutants.md` into a report folder; other files there stay."""
    directory.mkdir(parents=True, exist_ok=True)
    write_whole(directory / JSON_FILE, (json.dumps(seeding.as_dict(), indent=2) + "\n").encode())
    write_whole(directory / TABLE_FILE, markdown(seeding).encode())


@dataclass(frozen=True)
class Stored:
    """An earlier run, as its file has it."""

    entries: Mapping[str, Mapping[str, object]] = field(default_factory=dict)
    """What is known of each defect, by name."""
    seconds: float = 0.0
    seed: int = 0
    judged_by: str = ""
    where: str = ""

    def kept(
        self, mutants: Iterable[Mutant], judges: Sequence[Judge], seed: int, *, again: bool
    ) -> list[MutantResult]:
        """Return the results that need not be found again: of defects that are still
        the same, and could be judged.

        Args:
            mutants: The defects that are asked for.
            judges: The cases that judge.
            seed: Seed of the run.
            again: Judge those again that were not caught.

        Raises:
            CannotRunError: The earlier run had another seed or other cases.

        """
        if self.seed != seed:
            raise CannotRunError(
                f"{self.where} holds a run with seed {self.seed}; it can only be resumed with the same"
            )
        if self.judged_by != digest_of(judges):
            raise CannotRunError(
                f"{self.where} holds a run that other cases have judged; it can only be resumed with the "
                f"same campaigns"
            )
        kept = []
        for mutant in mutants:
            entry = self.entries.get(mutant.name)
            if entry is None or entry["changes"] != changes_of(mutant) or entry["status"] == "error":
                continue
            if entry["status"] in _GOOD or not again:
                kept.append(MutantResult(mutant, over=True, earlier=entry))
        return kept

    def missed(self, mutants: Sequence[Mutant]) -> list[Mutant]:
        """Return the defects that were not caught.

        Raises:
            CannotRunError: There is none.

        """
        bad = {name for name, entry in self.entries.items() if entry["status"] not in _GOOD}
        found = [mutant for mutant in mutants if mutant.name in bad]
        if not found:
            raise CannotRunError(
                f"none of the {len(bad)} defects that were not caught in {self.where} is among the "
                f"{len(mutants)} selected ones"
                if bad
                else f"every defect was caught in {self.where}: there is nothing to repeat"
            )
        return found


def _check(entry: Mapping[str, object]) -> None:
    if missing := _NEEDED - entry.keys():
        raise ValueError(f"{entry['name']} has no {', '.join(sorted(missing))}")


def load_stored(directory: Path) -> Stored:
    """Return the earlier run in a report folder.

    Raises:
        CannotRunError: There is none, or it cannot be read.

    """
    path = directory / JSON_FILE
    try:
        plain = json.loads(path.read_text(encoding="utf-8"))
        entries = {entry["name"]: entry for entry in plain["mutants"]}
        for entry in entries.values():
            _check(entry)
        return Stored(entries, float(plain["seconds"]), int(plain["seed"]), plain["judged_by"], str(path))
    except FileNotFoundError as error:
        raise CannotRunError(f"there is no run to go on with: {path} does not exist") from error
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise CannotRunError(f"{path} is no result of hil mutants: {error}") from error
