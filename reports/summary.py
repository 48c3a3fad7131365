"""The run in one dictionary, for the terminal and for machines."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from reports.coverage import not_looked_at, prefix_totals, requirement_matrix, value_pairs
from reports.json_types import JsonObject
from reports.model import RunResult, Verdict
from reports.text import check_sentence, headline, run_state


def run_digest(run: RunResult) -> str:
    """Return SHA-256 (hexadecimal) over the trace digests of all cases in order.

    Two runs with equal digests saw the same traces, bit for bit.
    """
    return hashlib.sha256(
        "".join(case.trace_digest for case in run.cases).encode("utf-8", "replace")
    ).hexdigest()


def summary(run: RunResult, *, report: str = "", junit: str = "") -> JsonObject:
    """Return the summary that `hil` prints.

    Args:
        run: The run.
        report: Path of the HTML report.
        junit: Path of the JUnit file.

    Returns:
        Exactly the keys `passed`, `failed`, `blocked`, `errors`, `report`, `junit`, `seed` and
        `trace_digest`.

    """
    return {
        "passed": run.count(Verdict.PASSED),
        "failed": run.count(Verdict.FAILED),
        "blocked": run.count(Verdict.BLOCKED),
        "errors": run.count(Verdict.ERROR),
        "report": report,
        "junit": junit,
        "seed": run.seed,
        "trace_digest": run_digest(run),
    }


def full_summary(
    run: RunResult, *, report: str = "", junit: str = "", changes: Mapping[str, Any] | None = None
) -> JsonObject:
    """Return `summary` with the state of the run, its environment and a line per case.

    Args:
        run: The run.
        report: Path of the HTML report.
        junit: Path of the JUnit file.
        changes: What has changed since earlier runs, as plain data; left out where nothing is known of them.

    """
    totals = prefix_totals(requirement_matrix(run))
    return {
        **summary(run, report=report, junit=junit),
        "state": run_state(run),
        "title": run.title,
        "bench": run.bench_name,
        "started": run.started,
        "interrupted": run.interrupted,
        "environment": run.environment,
        **({} if changes is None else {"changes": dict(changes)}),
        "simulated_s": _finite(math.fsum(case.simulated_s for case in run.cases)),
        "wall_s": _finite(math.fsum(case.wall_s for case in run.cases)),
        "not_looked_at": not_looked_at(run),
        "value_pairs": value_pairs(run)[0],
        "requirements": {
            total.prefix: {
                "known": total.known,
                "passed": total.passed,
                "failed": total.failed,
                "untested": total.untested,
            }
            for total in totals
        },
        "cases": [
            {
                "identifier": case.identifier,
                "title": case.title,
                "group": case.group,
                "verdict": case.verdict.value,
                "headline": headline(case),
                "checks": [
                    {"verdict": check.verdict.value, "sentence": check_sentence(check)}
                    for check in case.checks
                    if not (check.rule and check.verdict is Verdict.PASSED)
                ],
                "seed": case.seed,
                "token": case.token,
                "simulated_s": _finite(case.simulated_s),
                "wall_s": _finite(case.wall_s),
                "trace_digest": case.trace_digest,
            }
            for case in run.cases
        ],
    }


def write_summary(
    run: RunResult,
    path: str | Path,
    *,
    report: str = "",
    junit: str = "",
    changes: Mapping[str, Any] | None = None,
) -> Path:
    """Write `full_summary` as strict JSON and return the path."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    plain = full_summary(run, report=report, junit=junit, changes=changes)
    target.write_text(json.dumps(plain, indent=1, allow_nan=False) + "\n", encoding="ascii")
    return target


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
