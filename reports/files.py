"""All files of a report in one folder."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from reports.junit import write_junit
from reports.model import RunResult
from reports.summary import write_summary


class ReportPaths(NamedTuple):
    """Where `write_report` put what."""

    report: Path
    junit: Path
    summary: Path


def render_html(run: RunResult, path: str | Path, *, points: int = 2000, embedded: int | None = None) -> Path:
    """Write the HTML report, which needs neither a network nor a server, and return its path.

    Args:
        run: The run.
        path: File to write; evidence links count from its folder.
        points: About how many samples of a signal stay in the plot (at least 100). Extremes and the surroundings of
            faults, alarms and failed checks always stay.
        embedded: Characters of case data up to which it is one file (24 million by default, about 500 cases); beyond
            them the cases go into a folder beside it, `report-data` of `report.html`.

    Raises:
        ValueError: `points` is below 100.

    """
    from reports.html import EMBEDDED_LIMIT  # templates and their engine, on demand
    from reports.html import render_html as render

    return render(run, path, points=points, embedded=EMBEDDED_LIMIT if embedded is None else embedded)


def write_report(run: RunResult, directory: str | Path, *, points: int = 2000) -> ReportPaths:
    """Write `report.html`, `junit.xml` and `summary.json` into a folder, which is created.

    The paths in `summary.json` are those given here.
    """
    folder = Path(directory)
    paths = ReportPaths(folder / "report.html", folder / "junit.xml", folder / "summary.json")
    render_html(run, paths.report, points=points)
    write_junit(run, paths.junit)
    write_summary(run, paths.summary, report=str(paths.report), junit=str(paths.junit))
    return paths
