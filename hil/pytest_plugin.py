"""The pytest plugin: fixtures `bench`, `axis`, `drive`, `faults`, `trace`, the marker `requirement`, a
report.

It is loaded in every pytest run where the package is installed; everything heavy is imported when a fixture
asks for it.
"""

from __future__ import annotations

import shutil
import sys
import warnings
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import pytest

if TYPE_CHECKING:
    from hil._plugin_report import PluginReport
    from hil._plugin_results import RequirementLog

pytest_plugins = ("hil._plugin_names",)

_PROPERTY = "requirement"
_CRASHED = "???"
"""Phase that xdist gives for a test whose worker has died."""
WORKERS = "workers"
"""Folder, in that of the report, in which xdist workers leave their runs for the main process."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the bench."""
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


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers and what collects results."""
    config.addinivalue_line(
        "markers",
        "requirement(*identifiers): identifiers of the specification that this test would catch if broken",
    )
    config.addinivalue_line(
        "markers", "hil_bench(reference): bench file for this test in place of the default one"
    )
    config.pluginmanager.register(_Session(config), "hil-session")


def _requirements_of(item: pytest.Item) -> list[str]:
    identifiers: list[str] = []
    for marker in item.iter_markers("requirement"):
        for identifier in marker.args:
            if not isinstance(identifier, str) or not identifier:
                raise pytest.UsageError(f"{item.nodeid}: requirement({identifier!r}) is no identifier")
            identifiers.append(identifier)
    return list(dict.fromkeys(identifiers))


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect a matrix file that is named on the command line: each of its cases is a test."""
    if file_path.suffix != ".toml" or not parent.session.isinitpath(file_path):
        return None
    from hil.campaign._discover import is_matrix

    if not is_matrix(file_path):
        return None
    from hil._plugin_cases import MatrixTests

    return cast("pytest.Collector", MatrixTests.from_parent(parent, path=file_path))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Attach the requirement identifiers as properties, so that they reach JUnit and, from xdist workers, the
    log.
    """
    for item in items:
        item.user_properties.extend((_PROPERTY, identifier) for identifier in _requirements_of(item))


class _Session:
    """What one pytest process collects: requirement results and, where asked for, cases of the report."""

    def __init__(self, config: pytest.Config) -> None:
        self.config = config
        self.worker = (
            str(cast("Any", config).workerinput["workerid"]) if hasattr(config, "workerinput") else ""
        )
        self.log: RequirementLog | None = None
        self._report: PluginReport | None = None
        self.crashed: dict[str, str] = {}
        """Tests that have taken their xdist worker along, with what xdist says of it."""

    @property
    def report(self) -> PluginReport | None:
        """The report, made when the first test asks for a bench; None when none is wanted."""
        directory = self.config.getoption("--hil-report")
        if directory and self._report is None:
            from hil._plugin_report import PluginReport

            self._report = PluginReport(Path(directory), run_seed(self.config), self.worker)
        return self._report

    @pytest.hookimpl(tryfirst=True)  # before xdist starts its workers
    def pytest_sessionstart(self) -> None:
        """Take away what workers of a killed session have left: it belongs to no run of now."""
        directory = self.config.getoption("--hil-report")
        if directory and not self.worker and not self.config.getoption("collectonly", default=False):
            shutil.rmtree(Path(directory) / WORKERS, ignore_errors=True)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note the outcome of a test that carries requirement marks; workers leave that to the main
        process.
        """
        if cast("str", report.when) == _CRASHED:
            self.crashed[report.nodeid] = report.longreprtext
        identifiers = [str(value) for name, value in report.user_properties if name == _PROPERTY]
        if not identifiers or self.worker:
            return
        if self.log is None:
            from hil._plugin_results import RequirementLog

            self.log = RequirementLog()
        outcome: str = report.outcome
        if hasattr(report, "wasxfail"):
            outcome = "xpassed" if outcome == "passed" else "xfailed"
        self.log.note(report.nodeid, identifiers, str(report.when), outcome)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Show a bench that is not as the test needs it as skipped (*blocked*), and collect the case for the
        report.
        """
        report = yield
        # A test that needs no bench may fail in a project whose packages hide those of ours.
        if call.excinfo is not None and "hil.errors" in sys.modules:
            from hil.errors import BlockedError, UnsupportedFaultError

            if call.excinfo.errisinstance((BlockedError, UnsupportedFaultError)):
                report.outcome = "skipped"
                report.longrepr = (str(item.path), item.location[1] or 0, f"blocked: {call.excinfo.value}")
        if self.report is not None:
            self.report.note(item, report)
        return report

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self) -> None:
        """Write the requirement results and the report."""
        if self.log is not None:
            from hil._plugin_results import write_results

            try:
                write_results(self.config.rootpath, self.log)
            except OSError as error:
                warnings.warn(
                    f"requirement results were not written: {error}", pytest.PytestWarning, stacklevel=1
                )
        if self.config.getoption("--hil-report") and not self.config.getoption("collectonly", default=False):
            from hil._plugin_report import finish_report

            finish_report(self.config, self._report, worker=bool(self.worker), crashed=self.crashed)


def _session(config: pytest.Config) -> _Session:
    return cast("_Session", config.pluginmanager.get_plugin("hil-session"))


# -- fixtures
# --------------------------------------------------------------------------------------------------------


def run_seed(config: pytest.Config) -> int:
    """Return the seed of the run."""
    given = config.getoption("--hil-seed")
    text = config.getini("hil_seed") if given is None else given
    try:
        return int(text)
    except ValueError:
        raise pytest.UsageError(f"hil_seed: {text!r} is no whole number") from None


@pytest.fixture
def hil_bench_file(request: pytest.FixtureRequest) -> Any:
    """Return the bench file that this test builds its bench from."""
    from hil.campaign._worker import bench_of

    marker = request.node.get_closest_marker("hil_bench")
    given = request.config.getoption("--hil-bench")
    wanted = marker.args[0] if marker is not None and marker.args else ""
    return bench_of(str(wanted or given or request.config.getini("hil_bench") or ""))


@pytest.fixture
def bench(request: pytest.FixtureRequest, hil_bench_file: Any) -> Iterator[Any]:
    """Return a fresh bench (`hil.protocols.Bench`) with a seed made from the run's seed and the test's
    name.
    """
    from hil.campaign import case_seed

    seed = case_seed(run_seed(request.config), request.node.nodeid)
    report = _session(request.config).report
    with hil_bench_file.build(seed=seed) as built:
        if report is not None:
            report.begin(request.node, built, hil_bench_file, seed)
        yield built
        if report is not None:
            report.collect(request.node)


@pytest.fixture
def axis(bench: Any) -> Any:
    """Return the default axis of the bench."""
    return bench.axis()


@pytest.fixture
def drive(bench: Any) -> Any:
    """Return the default drive of the bench."""
    return bench.drive()


@pytest.fixture
def faults(request: pytest.FixtureRequest, bench: Any) -> Iterator[Any]:
    """Return the injector of the bench; faults that are still active are removed after the test."""
    from hil.faults import Injector

    injector = Injector(bench)
    report = _session(request.config).report
    if report is not None:
        report.add_injector(request.node, injector)
    yield injector
    injector.remove_all()


@pytest.fixture
def trace(request: pytest.FixtureRequest, bench: Any) -> Any:
    """Return the recording so far: `trace["axis1.actual_velocity"]`, `trace.check(alarm(421))`."""
    from hil.testing import CurrentTrace

    current = CurrentTrace(bench)
    report = _session(request.config).report
    if report is not None:
        report.add_trace(request.node, current)
    return current
