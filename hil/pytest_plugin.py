"""The pytest plugin: fixtures `bench`, `axis`, `drive`, `faults`, `trace`, the marker `requirement`, a
report.

It is loaded in every pytest run where the package is installed; everything heavy is imported when a fixture
asks for it. Its parts: `_plugin_settings` (options and markers), `_plugin_cases` (cases of a matrix file as
tests), `_plugin_results` (results of requirement marks), `_plugin_report` (the report).
"""

from __future__ import annotations

import shutil
import sys
import warnings
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

import pytest

from hil._plugin_settings import (
    BENCH,
    REQUIREMENT,
    add_markers,
    add_options,
    bench_reference,
    report_folder,
    requirements_of,
    run_seed,
    worker_name,
    workers_folder,
)

if TYPE_CHECKING:
    from hil._plugin_report import PluginReport
    from hil._plugin_results import RequirementLog
    from hil.bench import BenchFile
    from hil.bench.bench import Bench
    from hil.faults import Injector
    from hil.protocols import Drive
    from hil.testing import CurrentTrace
    from motion.s7.handles import AxisHandle

pytest_plugins = ("hil._plugin_names",)

_CRASHED: Final = "???"
"""Phase that xdist gives for a test whose worker has died."""


class Session:
    """What one pytest process collects: requirement results and, where asked for, cases of the report."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._worker = worker_name(config)
        self._log: RequirementLog | None = None
        self._report: PluginReport | None = None
        self._crashed: dict[str, str] = {}
        """Tests that have taken their xdist worker along, with what xdist says of it."""

    @property
    def report(self) -> PluginReport | None:
        """The report, made when the first test asks for a bench; None when none is wanted."""
        folder = report_folder(self._config)
        if folder is not None and self._report is None:
            from hil._plugin_report import PluginReport

            own = workers_folder(folder) / self._worker if self._worker else folder
            self._report = PluginReport(own, run_seed(self._config))
        return self._report

    @pytest.hookimpl(tryfirst=True)  # before xdist starts its workers
    def pytest_sessionstart(self) -> None:
        """Take away what workers of a killed session have left: it belongs to no run of now."""
        folder = report_folder(self._config)
        if folder is not None and not self._worker:
            shutil.rmtree(workers_folder(folder), ignore_errors=True)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note the outcome of a test that carries requirement marks; workers leave that to the main
        process.
        """
        if str(report.when) == _CRASHED:
            self._crashed[report.nodeid] = report.longreprtext
        identifiers = [str(value) for name, value in report.user_properties if name == REQUIREMENT]
        if not identifiers or self._worker:
            return
        if self._log is None:
            from hil._plugin_results import RequirementLog

            self._log = RequirementLog()
        outcome: str = report.outcome
        if hasattr(report, "wasxfail"):
            outcome = "xpassed" if outcome == "passed" else "xfailed"
        self._log.note(report.nodeid, identifiers, str(report.when), outcome)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(
        self, item: pytest.Item, call: pytest.CallInfo[None]
    ) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        """Show a test whose bench does not meet its requirements as skipped (*blocked*); collect the case."""
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
        if self._log is not None:
            from hil._plugin_results import write_results

            try:
                write_results(self._config.rootpath, self._log)
            except OSError as error:
                warnings.warn(
                    f"requirement results were not written: {error}", pytest.PytestWarning, stacklevel=1
                )
        folder = report_folder(self._config)
        if folder is None:
            return
        from hil._plugin_report import finish_report

        if self._report is not None:
            self._report.finish()
        if not self._worker:
            history = str(self._config.getoption("--hil-history"))
            finish_report(self._config, folder, crashed=self._crashed, history=history)


_SESSION: Final = pytest.StashKey[Session]()


# -- hooks ---------------------------------------------------------------------------------------------------


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the bench."""
    add_options(parser)


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers and what collects results."""
    add_markers(config)
    config.stash[_SESSION] = session = Session(config)
    config.pluginmanager.register(session, "hil-session")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """Collect a matrix file that is named on the command line: each of its cases is a test."""
    if file_path.suffix != ".toml" or not parent.session.isinitpath(file_path):
        return None
    from hil.campaign._discover import is_matrix

    if not is_matrix(file_path):
        return None
    from hil._plugin_cases import MatrixTests

    collector: pytest.Collector = MatrixTests.from_parent(parent, path=file_path)
    return collector


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Attach the requirement identifiers as properties, so that they reach JUnit and, from xdist workers,
    the log.
    """
    for item in items:
        item.user_properties.extend((REQUIREMENT, identifier) for identifier in requirements_of(item))


# -- fixtures ------------------------------------------------------------------------------------------------


@pytest.fixture
def hil_bench_file(request: pytest.FixtureRequest) -> BenchFile:
    """Return the bench file that this test builds its bench from."""
    from hil.campaign._worker import bench_of

    marker = request.node.get_closest_marker(BENCH)
    wanted = str(marker.args[0]) if marker is not None and marker.args else ""
    bench_file: BenchFile = bench_of(bench_reference(request.config, wanted))
    return bench_file


@pytest.fixture
def bench(request: pytest.FixtureRequest, hil_bench_file: BenchFile) -> Iterator[Bench]:
    """Return a fresh bench with a seed made from the run's seed and the test's name."""
    from hil.campaign import case_seed

    seed = case_seed(run_seed(request.config), request.node.nodeid)
    report = request.config.stash[_SESSION].report
    with hil_bench_file.build(seed=seed) as built:
        if report is not None:
            report.begin(request.node, built, hil_bench_file, seed)
        yield built
        if report is not None:
            report.collect(request.node)


@pytest.fixture
def axis(bench: Bench) -> AxisHandle:
    """Return the default axis of the bench."""
    return bench.axis()


@pytest.fixture
def drive(bench: Bench) -> Drive:
    """Return the default drive of the bench."""
    return bench.drive()


@pytest.fixture
def faults(request: pytest.FixtureRequest, bench: Bench) -> Iterator[Injector]:
    """Return the injector of the bench; faults that are still active are removed after the test."""
    from hil.faults import Injector

    injector = Injector(bench)
    report = request.config.stash[_SESSION].report
    if report is not None:
        report.add_injector(request.node, injector)
    yield injector
    injector.remove_all()


@pytest.fixture
def trace(request: pytest.FixtureRequest, bench: Bench) -> CurrentTrace:
    """Return the recording so far: `trace["axis1.actual_velocity"]`, `trace.check(alarm(421))`."""
    from hil.testing import CurrentTrace

    current = CurrentTrace(bench)
    report = request.config.stash[_SESSION].report
    if report is not None:
        report.add_trace(request.node, current)
    return current
