"""The run on one page of GitHub-flavoured markdown, for the summary of a CI
job or a comment under a change.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final

from reports.compare import Comparison
from reports.model import RunResult, Verdict
from reports.text import VERDICTS, duration, headline, replay_command, run_state

_BAD_CASES: Final = 50
"""Bad cases that are listed; GitHub takes a megabyte at most."""
_NAMES: Final = 20
_SIGNS: Final = {"failed": "❌", "passed": "✅", "interrupted": "⚠️", "empty": "⚠️"}


def markdown_summary(run: RunResult, comparison: Comparison | None = None, *, report: str = "") -> str:
    """Return totals, changes against earlier runs, and the bad cases with their reasons and replay commands.

    Args:
        run: The run.
        comparison: What has changed; None leaves it out.
        report: Where the report is, as text or as a link.

    """
    state = run_state(run)
    lines = [f"## {_SIGNS[state]} {_plain(run.title or 'Run')}: {_verdict(run, state)}", ""]
    lines += ["| " + " | ".join([*(verdict.value for verdict in VERDICTS), "simulated", "took"]) + " |"]
    lines += ["|" + "---:|" * (len(VERDICTS) + 2)]
    totals = [str(run.count(verdict)) for verdict in VERDICTS]
    totals += [
        duration(sum(case.simulated_s for case in run.cases)),
        duration(sum(case.wall_s for case in run.cases)),
    ]
    lines += ["| " + " | ".join(totals) + " |", ""]
    if comparison is not None:
        lines += _changes(comparison)
    bad = [case for case in run.cases if case.verdict in {Verdict.FAILED, Verdict.ERROR}]
    if bad:
        lines += ["### Failed cases", ""]
        for case in bad[:_BAD_CASES]:
            lines.append(f"* {_code(case.identifier)} **{case.verdict.value}**: {_plain(headline(case))}")
            if case.token:
                lines += ["", *_block(replay_command(case.token)), ""]
        if len(bad) > _BAD_CASES:
            lines.append(f"* and {len(bad) - _BAD_CASES} more")
        lines.append("")
    facts = [f"bench {_plain(run.bench_name)}", f"seed {run.seed}"]
    facts += [f"started {_plain(run.started)}"] if run.started else []
    facts += [f"report: {_plain(report)}"] if report else []
    lines += [" · ".join(facts), ""]
    return "\n".join(lines)


def _verdict(run: RunResult, state: str) -> str:
    counts = ", ".join(f"{run.count(verdict)} {verdict.value}" for verdict in VERDICTS if run.count(verdict))
    return (counts or "no case ran") + (", interrupted" if run.interrupted else "") * (state != "empty")


def _changes(found: Comparison) -> list[str]:
    against = f"run {found.base.number}" if found.base else "the last result of each case"
    if not found.common:
        return ["No earlier result to compare with.", ""]
    lines = [f"Against {against}, {found.common} cases in common:", ""]
    rows: list[tuple[str, Iterable[str], int]] = [
        (name, cases[:_NAMES], len(cases)) for name, cases in found.changes().items()
    ]
    drifted = list(dict.fromkeys(one.identifier for one in found.drift))
    rows += [("slower", [one.identifier for one in found.slower[:_NAMES]], len(found.slower))]
    rows += [("drifted", drifted[:_NAMES], len(drifted))]
    said = [
        f"* **{total} {name}**: {', '.join(map(_code, cases))}" + (" and others" if total > _NAMES else "")
        for name, cases, total in rows
        if total
    ]
    return lines + (said or ["* nothing has changed"]) + [""]


def _plain(text: str) -> str:
    """Return text in one line in which nothing is markup, a link or a mention."""
    line = " ".join(text.split())
    return re.sub(r"([\\`*_{}\[\]()#+!|~<>&@])", r"\\\1", line)


def _code(text: str) -> str:
    """Return text as a code span, whatever backquotes it holds."""
    line = " ".join(text.split()) or " "
    fence = "`" * (max(map(len, re.findall("`+", line)), default=0) + 1)
    pad = " " if line[0] == "`" or line[-1] == "`" else ""
    return f"{fence}{pad}{line}{pad}{fence}"


def _block(text: str) -> list[str]:
    fence = "`" * max(3, max(map(len, re.findall("`+", text)), default=0) + 1)
    return [f"  {fence}sh", f"  {' '.join(text.split())}", f"  {fence}"]
