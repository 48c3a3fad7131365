"""Results of tests that carry requirement marks: written by the pytest plugin, read by `hil requirements`."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final, NotRequired, TypedDict

FOLDER: Final = Path(".hil") / "requirements"
_FORMAT: Final = 1
_KEPT_FILES: Final = 20


class RequirementResult(TypedDict):
    """What became of a test."""

    requirements: list[str]
    """Identifiers that it is marked with."""
    outcome: str
    """`passed`, `failed`, `skipped`, `xfailed` or `xpassed`; empty before its call."""
    time_ns: NotRequired[int]
    """Time of its session; without one that of the file counts."""


class RequirementLog:
    """Outcomes of one session, by test."""

    def __init__(self) -> None:
        self.results: dict[str, RequirementResult] = {}

    def note(self, node: str, requirements: Iterable[str], phase: str, outcome: str) -> None:
        """Note the outcome of a phase; a test has passed when its call passed and no other phase failed."""
        entry = self.results.setdefault(node, RequirementResult(requirements=list(requirements), outcome=""))
        if (phase == "call" or outcome != "passed") and entry["outcome"] != "failed":
            entry["outcome"] = outcome


def write_results(root: Path, log: RequirementLog) -> Path:
    """Write the outcomes of a session below `root` and merge old files when there are many."""
    folder = root / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    # The wall clock orders sessions among each other; nothing else has a common order.
    stamp = time.time_ns()
    path = folder / f"{stamp:020d}-{os.getpid()}.json"
    _write(path, stamp, log.results)
    files = sorted(folder.glob("*.json"))
    if len(files) > _KEPT_FILES:
        old = files[:-1]
        merged = read_results(old)
        newest = max((entry["time_ns"] for entry in merged.values()), default=0)
        _write(folder / f"{newest:020d}-merged.json", newest, merged)
        for file in old:
            if file.name != f"{newest:020d}-merged.json":
                file.unlink(missing_ok=True)
    return path


def _write(path: Path, stamp: int, results: Mapping[str, RequirementResult]) -> None:
    draft = path.with_suffix(".part")
    draft.write_text(
        json.dumps({"format": _FORMAT, "time_ns": stamp, "results": results}, separators=(",", ":")),
        encoding="utf-8",
    )
    draft.replace(path)


def read_results(files: Iterable[Path]) -> dict[str, RequirementResult]:
    """Return the latest outcome of every test in the given files; unreadable files are passed over."""
    latest: dict[str, RequirementResult] = {}
    for file in files:
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
            stamp, results = int(content["time_ns"]), content["results"]
            for node, entry in results.items():
                when = int(entry.get("time_ns", stamp))
                if node not in latest or when >= latest[node]["time_ns"]:
                    latest[node] = {
                        "requirements": [str(one) for one in entry["requirements"]],
                        "outcome": str(entry["outcome"]),
                        "time_ns": when,
                    }
        except (OSError, ValueError, KeyError, TypeError, AttributeError):
            continue
    return latest


def passed_requirements(root: Path) -> tuple[set[str], int]:
    """Return the identifiers that passing tests carry, and the number of tests known.

    Tests whose file is gone do not count any more.
    """
    latest = read_results(sorted((root / FOLDER).glob("*.json")))
    covered: set[str] = set()
    known = 0
    for node, entry in latest.items():
        if not (root / node.partition("::")[0]).exists():
            continue
        known += 1
        if entry["outcome"] == "passed":
            covered.update(entry["requirements"])
    return covered, known
