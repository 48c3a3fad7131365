"""Cases as CSV, for spreadsheets and whatever reads tables."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Final

from reports.model import CaseResult, RunResult
from reports.text import headline, reaction_name

COLUMNS: Final = (
    "identifier",
    "title",
    "group",
    "verdict",
    "headline",
    "tags",
    "requirements",
    "faults",
    "alarms",
    "reactions",
    "checks",
    "checks_failed",
    "seed",
    "simulated_s",
    "wall_s",
    "token",
    "trace_digest",
)
_FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")


def write_cases(run: RunResult, path: str | Path) -> Path:
    """Write a row per case in the order of the run, comma-separated UTF-8 with
    a heading, and return the path.

    Several values of a cell stand apart by semicolons. A text that a spreadsheet would take for a formula
    gets an apostrophe before it, as spreadsheets write it themselves.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    with target.open("w", encoding="utf-8", errors="replace", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(COLUMNS)
        for case in run.cases:
            writer.writerow(_row(case))
    return target


def _row(case: CaseResult) -> list[object]:
    named = [*case.requirements, *(name for check in case.checks for name in check.requirements)]
    return [
        _text(case.identifier),
        _text(case.title),
        _text(case.group),
        case.verdict.value,
        _text(headline(case)),
        _several(case.tags),
        _several(named),
        _several([f"{fault.kind} on {fault.target}" for fault in case.faults]),
        _several([str(alarm.number) for alarm in case.alarms]),
        _several([reaction_name(alarm.reaction) for alarm in case.alarms]),
        len(case.checks),
        sum(check.verdict.value in {"failed", "error"} for check in case.checks),
        case.seed,
        _number(case.simulated_s),
        _number(case.wall_s),
        _text(case.token),
        case.trace_digest,
    ]


def _several(values: list[str]) -> str:
    return _text(";".join(dict.fromkeys(values)))


def _text(value: str) -> str:
    return "'" + value if value.startswith(_FORMULA) else value


def _number(value: float) -> float | str:
    return round(value, 6) if math.isfinite(value) else ""
