"""Test files as judges of defects: pytest in the process that has the defect in its code."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Final

from hil._processor_time import own_processor_time_s
from hil.errors import CannotRunError
from hil.mutants._plan import Judge

if TYPE_CHECKING:
    import pytest

TESTS: Final = "pytest:"
"""In front of the path of a test file, in place of the reference of a campaign."""
CLAIMS: Final = "pytest-marks:"
"""The same, and only the tests count that claim a requirement of the changed code."""
FOLDERS: Final = ("testcases/unit", "testcases/contract")
"""Where the tests of the product are, from its checkout."""
_ELSEWHERE: Final = "not browser and not peers and not realtime and not vcan"
_NONE_SELECTED: Final = 5
"""Exit code of pytest."""


def find_test_files(paths: Sequence[str], *, claims: bool) -> list[Judge]:
    """Return test files as judges.

    Args:
        paths: Files and folders; none: the tests of the product.
        claims: Whether a test counts only for a requirement that it claims.

    Raises:
        CannotRunError: A path does not exist, or has no tests; the tests of the product are in its checkout
            only.

    """
    prefix = CLAIMS if claims else TESTS
    files = [file for path in paths or FOLDERS for file in _files(Path(path), given=bool(paths))]
    return [Judge(str(file), f"{prefix}{file}", "") for file in dict.fromkeys(files)]


def _files(path: Path, *, given: bool) -> Iterator[Path]:
    if path.is_file():
        yield path
        return
    found = sorted(path.rglob("test_*.py"))
    if not found:
        where = "" if given else "; run it in a checkout of the product, or name test files with --campaign"
        raise CannotRunError(f"there are no test files in {path}{where}")
    yield from found


def is_test_file(judge: Judge) -> bool:
    """Return whether a judge is a test file."""
    return judge.campaign.startswith((TESTS, CLAIMS))


class _Watcher:
    """Selects tests by what they claim, and keeps the first failure."""

    def __init__(self, claimed: frozenset[str] | None) -> None:
        self._claimed = claimed
        self._marks: dict[str, tuple[str, ...]] = {}
        self.message = ""
        self.requirements: tuple[str, ...] = ()

    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Leave out tests that claim nothing of the changed code."""
        for item in items:
            marks = item.iter_markers("requirement")
            self._marks[item.nodeid] = tuple(dict.fromkeys(one for mark in marks for one in mark.args))
        claimed = self._claimed
        if claimed is None:
            return
        left_out = [item for item in items if claimed.isdisjoint(self._marks[item.nodeid])]
        if left_out:
            config.hook.pytest_deselected(items=left_out)
            items[:] = [item for item in items if item not in left_out]

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep the first failure, and what its test claims."""
        if report.failed and not self.message:
            lines = [line for line in report.longreprtext.splitlines() if line.startswith("E ")]
            self.message = f"{report.nodeid}: {lines[0][1:].strip() if lines else report.when}"
            self.requirements = self._marks.get(report.nodeid, ())


def run_test_file(
    judge: Judge, requirements: Sequence[str] | None
) -> tuple[str, str, float, tuple[str, ...]]:
    """Run a test file in this process up to the first failure.

    Args:
        judge: The file.
        requirements: What the changed code says that it is for; None: there is no change.

    Returns:
        Verdict, message, processor time in s, and what the failed test claims. Without a change a file that
        is not green is blocked: it judges nothing.

    """
    import pytest

    claims = judge.campaign.startswith(CLAIMS) and requirements is not None
    watcher = _Watcher(frozenset(requirements or ()) if claims else None)
    arguments = [judge.identifier, "-x", "-q", "-m", _ELSEWHERE, "-p", "no:cacheprovider", "-p", "no:xdist"]
    started = own_processor_time_s()
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        code = pytest.main([*arguments, "--override-ini=addopts=", "--tb=short"], plugins=[watcher])
    seconds = own_processor_time_s() - started
    if code in {0, _NONE_SELECTED}:
        return "passed", "", seconds, ()
    verdict = "blocked" if requirements is None else "failed" if code == 1 else "error"
    return verdict, watcher.message or f"pytest ended with {code}", seconds, watcher.requirements
