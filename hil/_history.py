"""Where the history of a run is, and what comes of it when it cannot be kept."""

from __future__ import annotations

from pathlib import Path

from hil._commands.terminal import console
from reports import HISTORY_FILE, Background, HistoryError, remember
from reports.model import RunResult

NO_HISTORY = "none"


def history_file(choice: str, report: Path) -> Path | None:
    """Return the file that a user chose: by default one in the report folder, with `none` no file at all."""
    if choice == NO_HISTORY:
        return None
    return Path(choice) if choice else report / HISTORY_FILE


def kept(run: RunResult, report: Path, choice: str) -> Background | None:
    """Record a run and return what came before; a history that fails is said and costs the report nothing
    else.
    """
    path = history_file(choice, report)
    if path is None or not run.cases:
        return None
    try:
        return remember(run, path)
    except HistoryError as error:
        console().print(f"warning: the run is not in the history: {error}", style="yellow", markup=False)
        return None
