"""Runs that belong together, brought into one: the shards of a campaign, or
what several machines have run.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from reports.errors import StoreError
from reports.model import CaseResult, RunResult
from reports.store import load_run, save_run


def merge_runs(sources: Sequence[str | Path], directory: str | Path) -> RunResult:
    """Bring the runs in `sources` into one in `directory`, with its evidence;
    nothing is taken from the sources.

    The cases come into the order in which they were planned. A case in several runs
    counts as in the last of them.

    Args:
        sources: Folders of runs.
        directory: Folder of the new run.

    Returns:
        The new run; `interrupted` while a planned case is missing.

    Raises:
        StoreError: A source holds no run or a damaged one, their seeds differ, or `directory` is one of
            the sources or holds a run.

    """
    folders = [Path(source) for source in sources]
    if not folders:
        raise StoreError("nothing to merge: give folders of runs")
    target = Path(directory)
    if target.resolve() in {folder.resolve() for folder in folders}:
        raise StoreError(f"{target}: a run cannot be merged into itself; choose another folder")
    runs = [load_run(folder, lazy=True) for folder in folders]
    for folder, run in zip(folders, runs, strict=True):
        if run.seed != runs[0].seed:
            raise StoreError(
                f"{folder}: seed {run.seed}, but {folders[0]} has seed {runs[0].seed}; runs of different "
                f"seeds do not "
                "belong together"
            )
    planned = list(dict.fromkeys(name for run in runs for name in run.planned))
    cases: dict[str, CaseResult] = {case.identifier: case for run in runs for case in run.cases}
    where = {case.identifier: folder for folder, run in zip(folders, runs, strict=True) for case in run.cases}
    merged = replace(
        runs[0],
        title=_joined((run.title for run in runs), ", "),
        bench_name=_joined((name for run in runs for name in run.bench_name.split(", ")), ", "),
        bench_text=_joined((run.bench_text for run in runs), "\n\n"),
        started=min(run.started for run in runs),
        planned=planned,
        shard="",
        interrupted=not cases.keys() >= set(planned),
        cases=in_order(cases.values(), planned),
    )
    for case in merged.cases:
        for name in case.files.values():
            _copy(where[case.identifier] / name, target / name)
    save_run(target, merged)
    return merged


def in_order(cases: Iterable[CaseResult], planned: Sequence[str]) -> list[CaseResult]:
    """Return the cases in their planned order; those that were not planned come behind, as they are."""
    place = {name: number for number, name in enumerate(planned)}
    return sorted(cases, key=lambda case: place.get(case.identifier, len(place)))


def _joined(texts: Iterable[str], separator: str) -> str:
    return separator.join(dict.fromkeys(text for text in texts if text))


def _copy(source: Path, target: Path) -> None:
    if source.is_file():
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)
