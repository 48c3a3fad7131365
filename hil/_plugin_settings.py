"""Options, settings and markers of the pytest plugin."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import pytest

if TYPE_CHECKING:
    from hil._requirements import Requirement

REQUIREMENT: Final = "requirement"
"""Marker with identifiers of the specification, and the name of the property that carries them."""
BENCH: Final = "hil_bench"
"""Marker with a bench file, and the setting of the same name."""
BLOCKED: Final = "hil_blocked"
"""Attribute of the report of a test whose bench cannot answer it: why; and the setting of the same name."""
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
        "--hil-evidence",
        choices=("all", "failed", "none"),
        default=None,
        help="traces and bus logs of which tests are kept in the report folder (default failed)",
    )
    group.addoption(
        "--hil-example",
        metavar="TEXT",
        default="",
        help="example of Hypothesis that a replayed test begins with, as hil replay gives it",
    )
    group.addoption(
        "--hil-history",
        metavar="FILE",
        default="",
        help="history of runs (default history.sqlite in the report folder; or none)",
    )
    group.addoption("--hil-seed", metavar="N", type=int, default=None, help="seed of the run (default 0)")
    group.addoption(
        "--hil-catalogue",
        metavar="FILE",
        default="",
        help="requirements of your own, CSV or ReqIF, which lead the report",
    )
    group.addoption(
        "--hil-blocked",
        choices=("skip", "fail"),
        default=None,
        help="what becomes of a test whose bench cannot answer it (default skip)",
    )
    parser.addini("hil_blocked", "used when --hil-blocked is not given: skip or fail", default="skip")
    parser.addini("hil_catalogue", "catalogue used when --hil-catalogue is not given", default="")
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


def own_requirements_of(config: pytest.Config) -> list[Requirement]:
    """Return the requirements of the user's catalogue; none where there is no catalogue.

    Raises:
        pytest.UsageError: It cannot be read.

    """
    name = str(config.getoption("--hil-catalogue") or config.getini("hil_catalogue"))
    if not name:
        return []
    from hil._requirements import own_requirements
    from hil.errors import CannotRunError

    try:
        return own_requirements(config.rootpath / name)
    except CannotRunError as error:
        raise pytest.UsageError(str(error)) from None


def blocked_fails(config: pytest.Config) -> bool:
    """Return whether a test whose bench cannot answer it is a failure.

    Raises:
        pytest.UsageError: The setting is neither `skip` nor `fail`.

    """
    wanted = str(config.getoption("--hil-blocked") or config.getini("hil_blocked"))
    if wanted not in ("skip", "fail"):
        raise pytest.UsageError(f"hil_blocked: {wanted!r} is not allowed; allowed: skip, fail")
    return wanted == "fail"


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


def bench_reference(
    config: pytest.Config, wanted: str = "", *, near: Path | None = None, default: str = ""
) -> str:
    """Return the reference of a bench file.

    A path counts from the current folder; where there is no such file, that of a test from the folder of
    its file, and that of the ini file from that of the ini file.

    Args:
        config: Of pytest.
        wanted: Reference of the test itself; it takes precedence over option and setting.
        near: Folder of the file of the test.
        default: Used without any of these.

    """
    given = str(wanted or config.getoption("--hil-bench") or "")
    if given:
        return _path(given, near, config.rootpath)
    folder = config.inipath.parent if config.inipath is not None else config.rootpath
    return _path(str(config.getini("hil_bench") or default), folder)


def _path(reference: str, *folders: Path | None) -> str:
    """Return a reference that leads from the current folder to the file in one of the folders."""
    if not reference.endswith(".toml") or Path(reference).exists():
        return reference
    for folder in folders:
        if folder is not None and (folder / reference).exists():
            return shortest(folder / reference)
    return reference


def shortest(path: Path) -> str:
    """Return a path as the user would write it here."""
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


def bench_of_mark(item: pytest.Item) -> str:
    """Return the bench file that a test is marked with; empty: it is not.

    Raises:
        pytest.UsageError: The mark names none, or something else.

    """
    marker = item.get_closest_marker(BENCH)
    if marker is None:
        return ""
    if len(marker.args) != 1 or marker.kwargs or not isinstance(marker.args[0], str) or not marker.args[0]:
        given = ", ".join([*map(repr, marker.args), *(f"{k}={v!r}" for k, v in marker.kwargs.items())])
        raise pytest.UsageError(
            f"{item.nodeid}: hil_bench({given}) is not allowed; allowed: one bench file, embedded name or "
            'module:NAME, such as @pytest.mark.hil_bench("fast")'
        )
    return marker.args[0]


def evidence_wanted(config: pytest.Config) -> Literal["all", "failed", "none"]:
    """Return of which tests traces and bus logs are kept."""
    chosen: Literal["all", "failed", "none"] | None = config.getoption("--hil-evidence")
    return chosen or "failed"


def check_options(config: pytest.Config) -> None:
    """Refuse options that lead nowhere.

    Raises:
        pytest.UsageError: Evidence is asked for, and there is no folder for it; or `hil_blocked` is wrong.

    """
    if config.getoption("--hil-evidence") not in (None, "none") and not config.getoption("--hil-report"):
        raise pytest.UsageError("--hil-evidence needs a folder for it: --hil-report DIR")
    blocked_fails(config)


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
