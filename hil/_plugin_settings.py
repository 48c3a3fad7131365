"""Options, settings and markers of the pytest plugin."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import pytest

REQUIREMENT: Final = "requirement"
"""Marker with identifiers of the specification, and the name of the property that carries them."""
BENCH: Final = "hil_bench"
"""Marker with a bench file, and the setting of the same name."""
_WORKERS: Final = "workers"


def add_options(parser: pytest.Parser) -> None:
    """Add the options and settings of the bench."""
    group = parser.getgroup("hil", "motion-hil benches")
    group.addoption(
        "--hil-bench", metavar="FILE", default=None, help="bench file, embedded name or module:NAME"
    )
    group.addoption(
        "--hil-report", metavar="DIR", default=None, help="write an HTML report of the tests that use a bench"
    )
    group.addoption(
        "--hil-history",
        metavar="FILE",
        default="",
        help="history of runs (default history.sqlite in the report folder; or none)",
    )
    group.addoption("--hil-seed", metavar="N", type=int, default=None, help="seed of the run (default 0)")
    parser.addini("hil_bench", "bench file used when --hil-bench is not given", default="")
    parser.addini("hil_seed", "seed used when --hil-seed is not given", default="0")


def add_markers(config: pytest.Config) -> None:
    """Register the markers."""
    config.addinivalue_line(
        "markers",
        "requirement(*identifiers): identifiers of the specification that this test would catch if broken",
    )
    config.addinivalue_line(
        "markers", "hil_bench(reference): bench file for this test in place of the default one"
    )


def run_seed(config: pytest.Config) -> int:
    """Return the seed of the run.

    Raises:
        pytest.UsageError: The setting is no whole number.

    """
    given = config.getoption("--hil-seed")
    text = config.getini("hil_seed") if given is None else given
    try:
        return int(text)
    except ValueError:
        raise pytest.UsageError(f"hil_seed: {text!r} is no whole number") from None


def bench_reference(config: pytest.Config, wanted: str = "", *, default: str = "") -> str:
    """Return the reference of a bench file.

    Args:
        config: Of pytest.
        wanted: Reference of the test itself; it takes precedence over option and setting.
        default: Used without any of these.

    """
    return str(wanted or config.getoption("--hil-bench") or config.getini("hil_bench") or default)


def requirements_of(item: pytest.Item) -> list[str]:
    """Return the identifiers that a test is marked with.

    Raises:
        pytest.UsageError: One is no text.

    """
    identifiers: list[str] = []
    for marker in item.iter_markers(REQUIREMENT):
        for identifier in marker.args:
            if not isinstance(identifier, str) or not identifier:
                raise pytest.UsageError(f"{item.nodeid}: requirement({identifier!r}) is no identifier")
            identifiers.append(identifier)
    return list(dict.fromkeys(identifiers))


def worker_name(config: pytest.Config) -> str:
    """Return the name of this xdist worker; empty in the main process."""
    worker_input = getattr(config, "workerinput", None)
    return "" if worker_input is None else str(worker_input["workerid"])


def report_folder(config: pytest.Config) -> Path | None:
    """Return the folder of the report; None: no report is wanted."""
    directory = config.getoption("--hil-report")
    return Path(str(directory)) if directory and not config.getoption("collectonly", default=False) else None


def workers_folder(report: Path) -> Path:
    """Return the folder in which xdist workers leave their runs for the main process."""
    return report / _WORKERS
