"""Where the data of the cases is: inside the page up to a size, else in a folder
next to it, a file for each case.

A page opened from a file system may fetch nothing, but it may add script elements. So a case next to the page
is a script of one call, `hilData(key, place, data)`. The key is that of the run: a folder that belongs to
another page is noticed.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final, NamedTuple

from reports.html.packing import Order, case_text, pack_files, write_text
from reports.model import Earlier, RunResult
from reports.summary import run_digest

EMBEDDED_LIMIT: Final = 12_000_000
"""Characters of packed case data up to which a report is one file: about 1,200 cases."""
_OURS: Final = re.compile(r"(\d+|plotly)\.js")  # reports of former versions had their plot library there


class Bundle(NamedTuple):
    """The packed cases of a run."""

    texts: list[str]
    """Packed data of every case in order; empty where they are next to the page."""
    folder: str
    """Name of the folder next to the page; empty where there is none."""
    key: str
    """What page and folder have in common."""


def data_folder(page: Path) -> Path:
    """Return the folder that holds the cases of a page: `report-data` of `report.html`."""
    return page.with_name(f"{page.stem}-data")


def pack(
    run: RunResult, page: Path, *, points: int, passes: Mapping[str, Earlier], limit: int = EMBEDDED_LIMIT
) -> Bundle:
    """Pack the cases for a page; write the folder next to it when there are too many.

    Args:
        run: The run.
        page: Path of the page.
        points: See `reports.html.render_html`.
        passes: Earlier runs of cases by identifier.
        limit: Characters of packed case data that may be in the page.

    """
    folder = data_folder(page)
    _clear(folder)
    key = hashlib.sha256(
        f"{run.title}:{run.started}:{run_digest(run)}".encode("utf-8", "replace")
    ).hexdigest()[:16]
    held: list[str] = []
    size = 0
    for case in run.cases:
        held.append(case_text(case, points, passes))
        size += len(held[-1])
        if size > limit:
            break
    else:
        return Bundle(held, "", key)
    folder.mkdir(parents=True, exist_ok=True)
    for place, text in enumerate(held):
        write_text(folder, key, place, text)
    pack_files(Order(folder, key, points, len(held), run.cases[len(held) :], dict(passes)))
    return Bundle([], folder.name, key)


def _clear(folder: Path) -> None:
    """Take away what an earlier page of the same name has left; other files stay."""
    if not folder.is_dir():
        return
    for file in folder.iterdir():
        if _OURS.fullmatch(file.name):
            file.unlink()
    if not any(folder.iterdir()):
        folder.rmdir()
