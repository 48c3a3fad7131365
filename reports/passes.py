"""The curves of the last pass of each case, in the file of the history: a case that fails is laid over them.

The history itself keeps no signals. Of each case there is one row here, that of its last pass, with the
curves that the page shows at first; on a virtual bench, whose traces repeat, it is seldom written again.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final

from reports.history import WAIT_S, HistoryError, storable_text
from reports.model import CaseResult, Earlier, RunResult, Verdict

POINTS: Final = 600
"""Samples of a signal that are kept: as many as a plot has pixels."""
_SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS last_pass (
  name TEXT NOT NULL, bench TEXT NOT NULL, started TEXT NOT NULL, trace_digest TEXT NOT NULL,
  curves TEXT NOT NULL, PRIMARY KEY (name, bench)) WITHOUT ROWID
"""


def remember_passes(run: RunResult, path: str | Path) -> dict[str, Earlier]:
    """Keep the curves of the cases that passed, and return those of the last pass of the others.

    Args:
        run: The run.
        path: File of the history, which is there.

    Returns:
        By identifier, for cases that did not pass now and once did.

    Raises:
        HistoryError: The file cannot be read or written.

    """
    earlier: dict[str, Earlier] = {}
    with _opened(Path(path)) as base:
        known = dict(
            base.execute("SELECT name, trace_digest FROM last_pass WHERE bench = ?", (run.bench_name,))
        )
        for case in run.cases:
            name = storable_text(case.identifier)
            if case.verdict is Verdict.PASSED:
                if case.signals and (not case.trace_digest or known.get(name) != case.trace_digest):
                    row = (name, run.bench_name, run.started, case.trace_digest, _curves(case))
                    base.execute("INSERT OR REPLACE INTO last_pass VALUES (?, ?, ?, ?, ?)", row)
            elif name in known:
                query = "SELECT started, curves FROM last_pass WHERE name = ? AND bench = ?"
                started, curves = base.execute(query, (name, run.bench_name)).fetchone()
                label = f"last pass, {started[:16].replace('T', ' ')}" if started else "last pass"
                earlier[case.identifier] = Earlier(label, curves)
    return earlier


def curves_of(run: RunResult, label: str) -> dict[str, Earlier]:
    """Return the curves of all cases of a run, to lay those of another one over them.

    Args:
        run: The run.
        label: What the page calls it.

    """
    return {case.identifier: Earlier(label, _curves(case)) for case in run.cases if case.signals}


def _curves(case: CaseResult) -> str:
    from reports.html.packing import packed  # on demand, as everything of the page
    from reports.html.payload import case_curves

    return packed(case_curves(case, points=POINTS))


@contextmanager
def _opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Open the file and write what was done when all of it went well."""
    try:
        with closing(sqlite3.connect(path, timeout=WAIT_S)) as base, base:
            base.execute(_SCHEMA)
            yield base
    except sqlite3.Error as error:
        raise HistoryError(f"{path}: the curves of the last passes cannot be kept: {error}") from error
