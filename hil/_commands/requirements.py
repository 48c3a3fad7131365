"""`hil requirements`: which requirements passing tests cover."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

from hil._commands.terminal import console, print_json
from hil._plugin_results import FOLDER, passed_requirements
from hil._requirements import requirements
from hil.errors import CannotRunError


def is_source_checkout(folder: Path) -> bool:
    """Whether `folder` is a checkout of this project, with its test-suite."""
    try:
        project = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8")).get("project", {})
    except (OSError, tomllib.TOMLDecodeError, UnicodeDecodeError):
        return False
    return project.get("name") == "motion-hil" and (folder / "testcases").is_dir()


def run_own_tests(folder: Path) -> None:
    """Run the project's test-suite; its output is progress and goes to standard error."""
    console().print("running the test-suite to see what it covers", style="dim", markup=False)
    # The interpreter that runs us, with fixed arguments.
    finished = subprocess.run(
        [sys.executable, "-m", "pytest", "testcases", "-q"], cwd=folder, stdout=sys.stderr, check=False
    )
    if finished.returncode not in (0, 1):
        raise CannotRunError(f"the test-suite could not be run: pytest ended with {finished.returncode}")


def coverage(covered: set[str]) -> dict[str, object]:
    """Return totals by prefix and the identifiers that are not covered."""
    prefixes: dict[str, dict[str, int]] = {}
    uncovered = []
    for entry in requirements():
        counts = prefixes.setdefault(entry.prefix, {"total": 0, "covered": 0})
        counts["total"] += 1
        if entry.identifier in covered:
            counts["covered"] += 1
        else:
            uncovered.append(entry.identifier)
    return {"prefixes": prefixes, "uncovered": uncovered}


def show_requirements(*, as_json: bool, rerun: bool) -> int:
    """Print the coverage; returns the exit code."""
    root = Path.cwd()
    covered, known = passed_requirements(root)
    if rerun or not known:
        if not is_source_checkout(root):
            raise CannotRunError(
                f"no test results in {root / FOLDER}: run pytest here first (the plugin records the results of tests that "
                "carry @pytest.mark.requirement)"
            )
        run_own_tests(root)
        covered, known = passed_requirements(root)
    unknown = sorted(covered - {entry.identifier for entry in requirements()})
    if unknown:
        console().print(f"marks without a requirement: {', '.join(unknown)}", style="yellow", markup=False)
    result = coverage(covered)
    if as_json:
        print_json(result)
        return 0
    prefixes = result["prefixes"]
    assert isinstance(prefixes, dict)
    for prefix, counts in sorted(prefixes.items()):
        share = 100 * counts["covered"] / counts["total"]
        print(f"{prefix:6} {counts['covered']:5} of {counts['total']:5}  {share:5.1f} %")  # noqa: T201 - the answer
    return 0
