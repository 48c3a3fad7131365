"""`hil requirements`: which requirements passing tests cover."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from collections.abc import Collection, Sequence
from pathlib import Path

from hil._commands.terminal import console, print_json
from hil._plugin_results import FOLDER, passed_requirements
from hil._requirements import Requirement, own_requirements, requirements
from hil.errors import CannotRunError
from reports import load_run, requirement_matrix
from reports.model import Verdict


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


def coverage(
    covered: set[str], prefixes: Collection[str] = (), own: Sequence[Requirement] = ()
) -> dict[str, object]:
    """Return totals by prefix and the identifiers that are not covered.

    Args:
        covered: Identifiers that are.
        prefixes: Only these; all of them if empty.
        own: Requirements of the user, which come first.

    Raises:
        CannotRunError: A prefix that no requirement has.

    """
    taken = {entry.identifier for entry in own}
    every = [*own, *(entry for entry in requirements() if entry.identifier not in taken)]
    first = {entry.prefix for entry in own}
    known = {entry.prefix for entry in every}
    if wrong := [prefix for prefix in prefixes if prefix not in known]:
        raise CannotRunError(
            f"--prefix {wrong[0]!r}: no requirement has it; allowed: {', '.join(sorted(known))}"
        )
    totals: dict[str, dict[str, int]] = {}
    uncovered = []
    for entry in every:
        if prefixes and entry.prefix not in prefixes:
            continue
        same = entry.identifier not in taken and entry.prefix in first
        # A family of the product may have the name of one of the user.
        family = f"{entry.prefix} (product)" if same else entry.prefix
        counts = totals.setdefault(family, {"total": 0, "covered": 0})
        counts["total"] += 1
        if entry.identifier in covered:
            counts["covered"] += 1
        else:
            uncovered.append(entry.identifier)
    return {"prefixes": totals, "uncovered": uncovered}


def _covered_by_run(folder: Path) -> set[str]:
    """Return the identifiers that the cases of a run name and none of them contradicts."""
    rows = requirement_matrix(load_run(folder, lazy=True))
    return {row.identifier for row in rows if row.verdict is Verdict.PASSED}


def _covered_by_tests(*, rerun: bool) -> set[str]:
    root = Path.cwd()
    covered, known = passed_requirements(root)
    if rerun or not known:
        if not is_source_checkout(root):
            raise CannotRunError(
                f"no test results in {root / FOLDER}: run pytest here first (the plugin records the results "
                f"of tests that "
                "carry @pytest.mark.requirement), or name the report folder of a run"
            )
        run_own_tests(root)
        covered, known = passed_requirements(root)
    return covered


def show_requirements(
    folder: Path | None,
    *,
    prefixes: Collection[str],
    missing: bool,
    as_json: bool,
    rerun: bool,
    catalogue: Path | None = None,
) -> int:
    """Print the coverage; returns the exit code.

    With a catalogue of the user its families come first, and families of the product that nothing covers are
    one line.
    """
    own = own_requirements(catalogue)
    first = {entry.prefix for entry in own}
    if folder is not None and rerun:
        raise CannotRunError("--rerun runs the test-suite, a folder holds a run: allowed is one of the two")
    coverage(set(), prefixes, own)  # what is wrong with the prefixes is said before anything runs
    covered = _covered_by_tests(rerun=rerun) if folder is None else _covered_by_run(folder)
    unknown = sorted(covered - {entry.identifier for entry in (*own, *requirements())})
    if unknown:
        console().print(f"marks without a requirement: {', '.join(unknown)}", style="yellow", markup=False)
    result = coverage(covered, prefixes, own)
    if as_json:
        print_json(result)
        return 0
    totals = result["prefixes"]
    assert isinstance(totals, dict)
    folded = [
        prefix for prefix, counts in totals.items() if own and prefix not in first and not counts["covered"]
    ]
    for prefix, counts in sorted(totals.items(), key=lambda item: (item[0] not in first, item[0])):
        if prefix in folded:
            continue
        share = 100 * counts["covered"] / counts["total"]
        print(f"{prefix:6} {counts['covered']:5} of {counts['total']:5}  {share:5.1f} %")  # noqa: T201 - the answer
    if folded:
        print(f"and {len(folded)} families of the product, of which nothing is covered")  # noqa: T201 - the answer
    total, sum_covered = (sum(counts[name] for counts in totals.values()) for name in ("total", "covered"))
    print(f"{'all':6} {sum_covered:5} of {total:5}  {100 * sum_covered / total:5.1f} %")  # noqa: T201 - the answer
    if missing:
        titles = {entry.identifier: entry.title for entry in (*requirements(), *own)}
        uncovered = result["uncovered"]
        assert isinstance(uncovered, list)
        families = {prefix.removesuffix(" (product)") for prefix in folded}
        hidden = {one.identifier for one in requirements() if one.prefix in families}
        hidden -= {one.identifier for one in own}
        for identifier in uncovered:
            if identifier in hidden:
                continue
            print(f"{identifier:10} {titles[identifier]}")  # noqa: T201 - the answer
    return 0
