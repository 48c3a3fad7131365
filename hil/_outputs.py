"""`--history` and `--summary`: where a run is recorded, and its summary in markdown."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

from hil._commands.terminal import console
from hil.errors import CannotRunError
from reports import HISTORY_FILE, Background, HistoryError, ReportPaths, markdown_summary, remember
from reports.model import RunResult
from reports.naming import naming
from reports.passes import remember_passes

NO_HISTORY = "none"


def history_file(choice: str, report: Path) -> Path | None:
    """Return the file that a user chose: by default one in the report folder, with `none` no file at all."""
    if choice == NO_HISTORY:
        return None
    return Path(choice) if choice else report / HISTORY_FILE


def kept(run: RunResult, report: Path, choice: str) -> Background | None:
    """Record a run and return what came before; a history that fails is said and
    costs the report nothing else.
    """
    path = history_file(choice, report)
    if path is None or not run.cases:
        return None
    try:
        return replace(remember(run, path), passes=remember_passes(run, path))
    except HistoryError as error:
        console().print(f"warning: the run is not in the history: {error}", style="yellow", markup=False)
        return None


VARIABLE = "GITHUB_STEP_SUMMARY"
AUTO = "auto"
STANDARD_OUTPUT = "-"


def check_summary(choice: str, *, as_json: bool) -> None:
    """Refuse, before anything runs, what cannot go together.

    Raises:
        CannotRunError: Markdown and JSON would both go to standard output.

    """
    if choice == STANDARD_OUTPUT and as_json:
        raise CannotRunError(
            "--summary - and --json both write to standard output; allowed: --summary FILE, or one of the two"
        )


def give_summary(choice: str, run: RunResult, background: Background | None, paths: ReportPaths) -> None:
    """Write the summary to a file, to standard output (`-`), or append it to what
    `GITHUB_STEP_SUMMARY` names (`auto`).
    """
    if not choice:
        return
    text = markdown_summary(run, background.comparison if background else None, report=str(paths.report))
    if choice == STANDARD_OUTPUT:
        sys.stdout.write(text)
        return
    if choice == AUTO:
        target = os.environ.get(VARIABLE, "")
        if not target:
            console().print(f"no summary: {VARIABLE} is not set", style="dim", markup=False)
            return
        with naming(Path(target)), Path(target).open("a", encoding="utf-8", errors="replace") as stream:
            stream.write(text)
        return
    file = Path(choice)
    file.parent.mkdir(parents=True, exist_ok=True)
    with naming(file):
        file.write_text(text, encoding="utf-8", errors="replace")
