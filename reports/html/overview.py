"""The overview: groups, the trend over earlier runs, what has changed since, seeded defects."""

from __future__ import annotations

from typing import Any, Final
from urllib.parse import quote, urlencode

from reports.compare import Background, Comparison
from reports.history import PastRun
from reports.json_types import JsonObject
from reports.model import RunResult, Verdict
from reports.seeding import Seeding
from reports.text import VERDICTS, duration, quantity

_SHOWN: Final = 50
"""Rows of a table of changes; the list of cases has the others."""
_SLOWEST: Final = 10
_BAR: Final = 16
_HEIGHT: Final = 120


def overview(run: RunResult, background: Background | None, seeding: Seeding | None) -> JsonObject:
    """Return what the template of the overview shows."""
    return {
        "groups": _groups(run),
        "slowest": [
            {"identifier": case.identifier, "link": _case(case.identifier), "time": duration(case.wall_s)}
            for case in sorted(run.cases, key=lambda case: -case.wall_s)[:_SLOWEST]
        ],
        "trend": _trend(background.trend) if background else None,
        "changes": _changes(background.comparison) if background else None,
        "seeding": _seeding(run, seeding) if seeding else None,
    }


def _case(identifier: str) -> str:
    return "#/case/" + quote(identifier, safe="/", errors="replace")


def _groups(run: RunResult) -> list[JsonObject]:
    groups: dict[str, list[Any]] = {}
    for case in run.cases:
        groups.setdefault(case.group, []).append(case)
    return [
        {
            "name": name or "without a group",
            "link": "#/cases?" + urlencode({"g": name}, errors="replace") if name else "#/cases",
            "total": len(cases),
            "parts": [
                (verdict.value, sum(case.verdict is verdict for case in cases)) for verdict in VERDICTS
            ],
            "time": duration(sum(case.wall_s for case in cases)),
        }
        for name, cases in groups.items()
    ]


def _trend(runs: list[PastRun]) -> JsonObject:
    """Return bars as high as the runs have cases, the bad ones at the foot, where
    they are seen against the line.
    """
    most = max((run.cases for run in runs), default=0) or 1
    bars: list[JsonObject] = []
    for index, run in enumerate(runs):
        top = float(_HEIGHT)
        parts = []
        counts = (
            ("failed", run.failed),
            ("error", run.errors),
            ("blocked", run.blocked),
            ("passed", run.passed),
        )
        for name, count in counts:
            size = max(count / most * _HEIGHT, 2.0) if count else 0.0
            top -= size
            if count:
                parts.append((name, round(top, 2), round(size, 2)))
        words = ", ".join(f"{count} {name}" for name, count in counts if count) or "no case"
        bars.append(
            {
                "number": run.number,
                "x": index * _BAR,
                "parts": parts,
                "words": f"Run {run.number}: {words}" + (", interrupted" if run.interrupted else ""),
                "started": run.started,
                "title": run.title,
                "bench": run.bench,
                "seed": run.seed,
                "counts": [run.failed, run.errors, run.blocked, run.passed],
                "time": duration(run.wall_s),
                "state": run.state,
            }
        )
    return {
        "bars": bars,
        "width": max(len(bars) * _BAR, _BAR),
        "height": _HEIGHT,
        "bar": _BAR - 4,
        "most": most,
    }


def _changes(found: Comparison) -> JsonObject:
    base = f"run {found.base.number}" if found.base else "the last result of each case"
    return {
        "base": base,
        "first": found.common == 0,
        "kinds": [
            {
                "name": name,
                "total": len(cases),
                "link": "#/cases?" + urlencode({"c": name}),
                "cases": [
                    {"identifier": one, "link": _case(one), "reason": found.reasons.get(one, "")}
                    for one in cases[:_SHOWN]
                ],
            }
            for name, cases in found.changes().items()
        ],
        "appeared": len(found.appeared),
        "same": found.same_traces,
        "common": found.common,
        "slower": [
            {
                "identifier": one.identifier,
                "link": _case(one.identifier),
                "before": duration(one.before_s),
                "now": duration(one.now_s),
                "factor": f"{one.now_s / one.before_s:.1f}" if one.before_s else "",
            }
            for one in found.slower[:_SHOWN]
        ],
        "slower_total": len(found.slower),
        "drift": [
            {
                "identifier": one.identifier,
                "link": _case(one.identifier),
                "name": one.name,
                "before": quantity(one.before, one.unit),
                "now": quantity(one.now, one.unit),
                "change": quantity(one.now - one.before, one.unit, 3),
            }
            for one in found.drift[:_SHOWN]
        ],
        "drift_total": len(found.drift),
    }


def _seeding(run: RunResult, seeding: Seeding) -> JsonObject:
    known = {case.identifier for case in run.cases}
    return {
        "error": seeding.error,
        "total": len(seeding.defects),
        "caught": seeding.count("caught"),
        "rows": [
            {
                "name": one.name,
                "title": one.title,
                "area": one.area,
                "status": one.status,
                "verdict": {
                    "caught": Verdict.PASSED,
                    "explained": Verdict.BLOCKED,
                    "survived": Verdict.FAILED,
                }.get(one.status, Verdict.ERROR).value,
                "cases": [
                    (name, _case(identifier) if (identifier := name.partition("@")[0]) in known else "")
                    for name in one.caught_by[:3]
                ],
                "more": max(0, len(one.caught_by) - 3),
                "remark": one.remark,
                "time": "" if one.seconds is None else duration(one.seconds),
            }
            for one in sorted(seeding.defects, key=lambda one: one.status == "caught")
        ],
    }
