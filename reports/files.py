"""All files of a report in one folder."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from reports.codec import without_collector
from reports.compare import Background
from reports.junit import write_junit
from reports.model import Earlier, RunResult
from reports.naming import naming
from reports.seeding import Seeding, load_seeding
from reports.summary import write_summary
from reports.tables import write_cases


class ReportPaths(NamedTuple):
    """Where `write_report` put what."""

    report: Path
    junit: Path
    summary: Path
    cases: Path


def render_html(
    run: RunResult,
    path: str | Path,
    *,
    points: int = 2000,
    embedded: int | None = None,
    background: Background | None = None,
    seeding: Seeding | None = None,
    earlier: Mapping[str, Earlier] | None = None,
) -> Path:
    """Write the HTML report, which needs neither a network nor a server, and return its path.

    Args:
        run: The run.
        path: File to write; evidence links count from its folder.
        points: About how many samples of a signal stay in the plot (at least 100). Extremes and the
            surroundings of faults, alarms and failed checks always stay.
        embedded: Characters of packed case data up to which it is one file (12 million by default, about
            1,200 cases); beyond them the cases go into a folder next to it, `report-data` of `report.html`.
        background: Earlier runs, for trend and changes.
        seeding: Defects seeded on purpose, for their table.
        earlier: Runs of the cases to compare with, by identifier; default: the last passes of the
            background.

    Raises:
        ValueError: `points` is below 100.

    """
    from reports.html import EMBEDDED_LIMIT  # templates and their engine, on demand
    from reports.html import render_html as render

    limit = EMBEDDED_LIMIT if embedded is None else embedded
    return render(
        run, path, points=points, embedded=limit, background=background, seeding=seeding, earlier=earlier
    )


def write_report(
    run: RunResult,
    directory: str | Path,
    *,
    points: int = 2000,
    background: Background | None = None,
    earlier: Mapping[str, Earlier] | None = None,
) -> ReportPaths:
    """Write `report.html`, `junit.xml`, `summary.json` and `cases.csv` into a folder, which is created.

    The paths in `summary.json` are those given here. A `mutants.json` in the
    folder becomes a table of the page.

    Args:
        run: The run.
        directory: The folder.
        points: See `render_html`.
        background: Earlier runs, from `remember`; None: the report has neither trend nor changes.
        earlier: See `render_html`.

    """
    folder = Path(directory)
    paths = ReportPaths(
        *(folder / name for name in ("report.html", "junit.xml", "summary.json", "cases.csv"))
    )
    changes = background.comparison.as_dict() if background else None
    with without_collector():
        with naming(paths.report):
            seeding = load_seeding(folder)
            render_html(
                run, paths.report, points=points, background=background, seeding=seeding, earlier=earlier
            )
        with naming(paths.junit):
            write_junit(run, paths.junit)
        with naming(paths.summary):
            write_summary(
                run, paths.summary, report=str(paths.report), junit=str(paths.junit), changes=changes
            )
        with naming(paths.cases):
            write_cases(run, paths.cases)
    return paths
