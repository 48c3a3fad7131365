"""The pytest plugin: fixtures `bench`, `axis`, `drive`, `faults`, `trace`, `new_bench`, the marker
`requirement`, a report.

It is loaded in every pytest run where the package is installed; everything heavy is imported when a fixture
asks for it. Its parts: `_plugin_settings` (options and markers), `_plugin_cases` (cases of a matrix file as
tests), `_plugin_results` (results of requirement marks), `_plugin_tests` (the benches of a test),
`_plugin_words` (why it failed), `_plugin_report` (the report).
"""

from __future__ import annotations

import shutil
import sys
import warnings
from collections.abc import Generator, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol, cast

import pytest

from hil._built import listen
from hil._plugin_settings import (
    BLOCKED,
    REQUIREMENT,
    add_markers,
    add_options,
    bench_of_mark,
    bench_reference,
    blocked_fails,
    check_options,
    own_requirements_of,
    report_folder,
    requirements_of,
    run_seed,
    worker_name,
    workers_folder,
)
from hil._plugin_tests import TestRecord

if TYPE_CHECKING:
    from hil._plugin_report import PluginReport
    from hil._plugin_results import RequirementLog
    from hil._requirements import Requirement
    from hil.bench import BenchFile
    from hil.bench.bench import Bench
    from hil.faults import Injector
    from hil.protocols import Bench as ProtocolBench
    from hil.protocols import BenchFile as ProtocolBenchFile
    from hil.protocols import Drive
    from hil.testing import CurrentTrace, NewBench
    from motion.s7.handles import AxisHandle

pytest_plugins = ("hil._plugin_names",)

_CRASHED: Final = "???"
"""Phase that xdist gives for a test whose worker has died."""
_BROKEN: Final = "hil_report_broken"
"""Key under which an xdist worker tells the main process that its report is not complete."""


class WorkerNode(Protocol):
    """What xdist knows of a worker that has ended."""

    workeroutput: dict[str, object]


class Session:
    """What one pytest process collects: requirement results and, where asked for, cases of the report."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._worker = worker_name(config)
        self._log: RequirementLog | None = None
        self._report: PluginReport | None = None
        self._crashed: dict[str, str] = {}
        """Tests that have taken their xdist worker along, with what xdist says of it."""
        self._broken: list[str] = []
        """Why the reports of xdist workers are not complete."""
        self._blocked: dict[str, str] = {}
        """Tests that their bench cannot answer, with the reason."""
        self._answered = False
        """Whether a test has passed or failed."""
        self._own: list[Requirement] = []
        """Requirements of the user, which lead the report."""
        if report_folder(config) is not None and not self._worker:
            self._own = own_requirements_of(config)
        self._written: Path | None = None
        """The report, once it is written."""
        self.record: TestRecord | None = None
        """The test that is set up, runs, or is torn down."""
        self._stop = listen(self.note_bench)

    @property
    def report(self) -> PluginReport | None:
        """The report, made when the first test ends; None when none is wanted."""
        folder = report_folder(self._config)
        if folder is not None and self._report is None:
            from hil._plugin_report import PluginReport

            own = workers_folder(folder) / self._worker if self._worker else folder
            self._report = PluginReport(own, self._config)
        return self._report

    def note_bench(self, bench: ProtocolBench, bench_file: ProtocolBenchFile[ProtocolBench]) -> None:
        """Note a bench that has been built, for the test that runs."""
        if self.record is not None:
            self.record.add(bench, bench_file, keep=report_folder(self._config) is not None)

    @pytest.hookimpl(tryfirst=True)  # before xdist starts its workers
    def pytest_sessionstart(self) -> None:
        """Take away what workers of a killed session have left: it belongs to no run of now."""
        folder = report_folder(self._config)
        if folder is not None and not self._worker:
            shutil.rmtree(workers_folder(folder), ignore_errors=True)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> None:
        """Begin the record of a test."""
        self.record = TestRecord(item)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Generator[None]:
        """Watch the examples of Hypothesis."""
        if self.record is None:
            return (yield)
        with self.record.running():
            return (yield)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_teardown(self) -> Generator[None]:
        """Close the benches that the test has made by `new_bench`, after its fixtures."""
        try:
            return (yield)
        finally:
            if self.record is not None:
                self.record.close()

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note the outcome of a test that carries requirement marks; workers
        leave that to the main process.
        """
        if str(report.when) == _CRASHED:
            self._crashed[report.nodeid] = report.longreprtext
        blocked = str(getattr(report, BLOCKED, ""))
        if blocked:
            self._blocked[report.nodeid] = blocked
        elif report.outcome == "failed" or (report.when == "call" and report.outcome == "passed"):
            self._answered = True
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
        """Say why a test has failed, show one whose bench does not meet its requirements as skipped
        (*blocked*), and collect the case.
        """
        record = self.record if self.record is not None and self.record.item is item else TestRecord(item)
        if call.when == "call":
            record.finish()
            record.look_at_fixtures()
        failed = call.excinfo is not None and record.uses_bench and "hil.errors" in sys.modules
        raised = call.excinfo.value if call.excinfo is not None else None
        if failed and call.excinfo is not None:
            call.excinfo = self._explain(record, call.excinfo)
        report = yield
        # A test that needs no bench may fail in a project whose packages hide those of ours.
        if raised is not None and "hil.errors" in sys.modules:
            from hil.errors import BlockedError, UnsupportedFaultError

            if isinstance(raised, (BlockedError, UnsupportedFaultError)):
                failed = False
                setattr(report, BLOCKED, str(raised))
                if blocked_fails(self._config):
                    report.longrepr = f"blocked: {raised}"
                else:
                    report.outcome = "skipped"
                    report.longrepr = (str(item.path), item.location[1] or 0, f"blocked: {raised}")
        if failed and report.failed:
            self._add_section(record, report)
        if self.report is not None:
            self.report.note(record, report, raised if report.failed else None)
        if report.when == "teardown":
            self.record = None
        return report

    def _explain(
        self, record: TestRecord, excinfo: pytest.ExceptionInfo[BaseException]
    ) -> pytest.ExceptionInfo[BaseException]:
        """Put the reason into the message of a failed test, and return it without frames of the library."""
        from hil._plugin_words import (
            explain,
            explain_health_check,
            last_statement,
            note_waiting,
            without_internals,
            without_own_frames,
        )

        use = record.last
        option = self._config.getoption
        if not option("fulltrace", default=False) and not option("usepdb", default=False):
            excinfo = without_internals(without_own_frames(excinfo))
        waiting = [] if use is None else use.waiting()
        explain(
            excinfo.value,
            wait="" if use is None else use.unmet_wait(),
            statement=last_statement(excinfo),
            waiting=waiting,
        )
        explain_health_check(excinfo.value)
        if use is not None:
            note_waiting(use.bench, waiting)
        return excinfo

    def _add_section(self, record: TestRecord, report: pytest.TestReport) -> None:
        """Show how the bench stands, and how to repeat the test, below the traceback."""
        use = record.last
        if use is None:
            return
        lines = [*filter(None, (use.summary(),)), *use.waiting()]
        if self.report is not None and not hasattr(report, "wasxfail"):
            from reports import replay_command

            lines.append(f"repeat with: {replay_command(self.report.token(record.item, use.bench_file))}")
        now_s = use.bench.scheduler.now * 1e-9
        report.sections.append((f"bench at {now_s:.3f} s", "\n".join(lines)))

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: WorkerNode) -> None:
        """Take over why the report of an xdist worker is not complete."""
        reported = node.workeroutput.get(_BROKEN) if hasattr(node, "workeroutput") else None
        if reported:
            self._broken.append(str(reported))

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session, exitstatus: int) -> None:
        """Write the requirement results and the report; a file that cannot be written is no success."""
        self._stop()
        if self._blocked and not self._answered and exitstatus == pytest.ExitCode.OK and not self._worker:
            session.exitstatus = pytest.ExitCode.NO_TESTS_COLLECTED  # nothing was tested
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
        try:
            self._finish_report(folder, interrupted=exitstatus == pytest.ExitCode.INTERRUPTED)
        except OSError as error:
            self._broken.append(f"{error.filename or folder}: {error.strerror or error}")
        if self._broken and self._worker:
            session.config.workeroutput[_BROKEN] = self._broken[0]  # type: ignore[attr-defined]  # of xdist
        elif self._broken and exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.USAGE_ERROR

    def _finish_report(self, folder: Path, *, interrupted: bool) -> None:
        report = self._report
        if report is not None:
            report.finish(interrupted=interrupted)
            if report.broken:
                self._broken.append(report.broken)
        if self._worker or self._broken:
            return
        from hil._plugin_report import finish_report

        self._written = finish_report(
            folder,
            alone=report is not None and report.started,
            crashed=self._crashed,
            history=str(self._config.getoption("--hil-history")),
            own=self._own,
        )

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """Say which tests the bench could not answer, and where the report is, or why it is not complete."""
        if self._blocked:
            self._tell_blocked(terminalreporter)
        if self._broken:
            terminalreporter.write_line(
                f"the bench report is not complete, because a file could not be written: {self._broken[0]}",
                red=True,
            )
        elif self._written is not None:
            terminalreporter.write_line(f"bench report: {self._written}")

    def _tell_blocked(self, terminalreporter: pytest.TerminalReporter) -> None:
        by_reason: dict[str, list[str]] = {}
        for test, reason in self._blocked.items():
            by_reason.setdefault(reason.partition("\n")[0], []).append(test)
        terminalreporter.section("blocked: not passed, the bench cannot answer")
        for reason, tests in by_reason.items():
            more = f" and {len(tests) - 1} more" if len(tests) > 1 else ""
            terminalreporter.write_line(f"{tests[0]}{more}: {reason}")
        if not self._answered:
            terminalreporter.write_line("every test is blocked: nothing was tested", red=True)


_SESSION: Final = pytest.StashKey[Session]()


# -- hooks ---------------------------------------------------------------------------------------------------


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of the bench."""
    add_options(parser)


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers and what collects results."""
    add_markers(config)
    check_options(config)
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
    the log; refuse a mark `hil_bench` that names no bench.
    """
    for item in items:
        bench_of_mark(item)
        item.user_properties.extend((REQUIREMENT, identifier) for identifier in requirements_of(item))


# -- fixtures ------------------------------------------------------------------------------------------------


@pytest.fixture
def hil_bench_file(request: pytest.FixtureRequest) -> BenchFile:
    """Return the bench file that this test builds its bench from."""
    return _bench_file(request.config, request.node)


def _bench_file(config: pytest.Config, item: pytest.Item | None, wanted: str = "") -> BenchFile:
    from hil.campaign._worker import bench_of

    near = None if item is None else item.path.parent
    wanted = wanted or ("" if item is None else bench_of_mark(item))
    # A Python object in its place has what `hil.protocols.BenchFile` demands, which is less.
    return cast("BenchFile", bench_of(bench_reference(config, wanted, near=near)))


def _seed(config: pytest.Config, nodeid: str) -> int:
    from hil.campaign import case_seed

    return case_seed(run_seed(config), nodeid)


@pytest.fixture
def bench(request: pytest.FixtureRequest, hil_bench_file: BenchFile) -> Iterator[Bench]:
    """Return a fresh bench with a seed made from the run's seed and the test's name."""
    with hil_bench_file.build(seed=_seed(request.config, request.node.nodeid)) as built:
        request.config.stash[_SESSION].note_bench(built, hil_bench_file)
        yield built


@pytest.fixture(scope="session")
def new_bench(request: pytest.FixtureRequest) -> Iterator[NewBench]:
    """Return a factory of benches; in a test of Hypothesis every example calls it."""
    session = request.config.stash[_SESSION]
    others: list[Bench] = []

    def make(
        bench: str | Path = "",
        /,
        *,
        seed: int | None = None,
        tables: Mapping[str, Any] | None = None,
    ) -> Bench:
        record = session.record
        item = None if record is None else record.item
        bench_file = _bench_file(request.config, item, str(bench))
        if tables:
            bench_file = bench_file.configured(tables)
        in_test = record is not None and record.calls
        if seed is None:
            # A fixture of a module must not depend on which of its tests comes first.
            seed = _seed(request.config, item.nodeid if item is not None and in_test else "")
        built = bench_file.build(seed=seed)
        session.note_bench(built, bench_file)
        if record is not None and in_test:
            record.close_later(built)
        else:
            others.append(built)
        return built

    yield make
    for one in reversed(others):
        one.close()


@pytest.fixture
def axis(bench: Bench) -> AxisHandle:
    """Return the default axis of the bench."""
    return bench.axis()


@pytest.fixture
def drive(bench: Bench) -> Drive:
    """Return the default drive of the bench."""
    return bench.drive()


@pytest.fixture
def faults(bench: Bench) -> Iterator[Injector]:
    """Return the injector of the bench; faults that are still active are removed after the test."""
    from hil.faults import Injector

    injector = Injector(bench)
    yield injector
    injector.note_waiting()
    injector.remove_all()


@pytest.fixture
def trace(bench: Bench) -> CurrentTrace:
    """Return the recording so far: `trace["axis1.actual_velocity"]`, `trace.check(alarm(421))`."""
    from hil.testing import CurrentTrace

    return CurrentTrace(bench)
