"""The report of a pytest run: a case for every test that used a bench."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from hil._outputs import kept
from hil._plugin_cases import CaseTest
from hil._plugin_settings import REQUIREMENT, workers_folder
from hil._requirements import complete
from hil.campaign import environment_facts
from hil.campaign._evidence import build_alarms, build_faults, build_messages, build_signals, build_story
from hil.campaign._runner import clear_run
from hil.record import homing_drawings
from reports import write_report
from reports.model import CaseResult, RunResult, Verdict
from reports.store import RUN_FILE, finish_run, load_run, start_run, write_case

if TYPE_CHECKING:
    import pytest

    from hil.faults import Injector
    from hil.protocols import Bench, BenchFile
    from hil.testing import CurrentTrace


class _Entry:
    """A test that uses a bench."""

    def __init__(self, bench: Bench, result: CaseResult) -> None:
        self.bench = bench
        self.result = result
        self.injectors: list[Injector] = []
        self.traces: list[CurrentTrace] = []
        self.outcome = Verdict.PASSED
        self.message = ""


class PluginReport:
    """Collects the cases of one pytest process.

    Args:
        directory: Folder for the run of this process.
        seed: Seed of the run.

    """

    def __init__(self, directory: Path, seed: int) -> None:
        self.directory = directory
        self._seed = seed
        self._entries: dict[str, _Entry] = {}
        self._started = False

    def begin(self, item: pytest.Item, bench: Bench, bench_file: BenchFile, seed: int) -> None:
        """Note that a test has got its bench."""
        self._start(bench_file)
        title = str(getattr(getattr(item, "obj", None), "__doc__", "") or item.name).strip().splitlines()[0]
        result = CaseResult(
            identifier=item.nodeid,
            title=title,
            verdict=Verdict.PASSED,
            group=item.nodeid.partition("::")[0],
            seed=seed,
            tags=sorted({marker.name for marker in item.iter_markers()}),
            requirements=[str(value) for name, value in item.user_properties if name == REQUIREMENT],
        )
        self._entries[item.nodeid] = _Entry(bench, result)

    def _start(self, bench_file: BenchFile) -> None:
        if not self._started:
            if (self.directory / RUN_FILE).exists():
                clear_run(self.directory)
            start_run(self.directory, new_run(self._seed, bench_file.name, bench_file.text))
            self._started = True

    def add_injector(self, item: pytest.Item, injector: Injector) -> None:
        """Note the faults of a test."""
        if item.nodeid in self._entries:
            self._entries[item.nodeid].injectors.append(injector)

    def add_trace(self, item: pytest.Item, trace: CurrentTrace) -> None:
        """Note the checks of a test."""
        if item.nodeid in self._entries:
            self._entries[item.nodeid].traces.append(trace)

    def collect(self, item: pytest.Item) -> None:
        """Take the evidence from the bench before it is closed."""
        entry = self._entries.get(item.nodeid)
        if entry is None:
            return
        trace, result = entry.bench.trace(), entry.result
        result.checks = [check for current in entry.traces for check in current.checks]
        result.simulated_s = trace.end_s
        result.trace_digest = trace.digest()
        result.story = build_story(trace, [], result.checks)
        result.alarms = build_alarms(trace)
        result.faults = build_faults(trace, [armed for one in entry.injectors for armed in one.armed])
        result.messages = build_messages(trace, entry.bench.decode)
        result.signals = build_signals(trace)
        result.homings = homing_drawings(trace)

    def note(self, item: pytest.Item, report: pytest.TestReport) -> None:
        """Take over the outcome of a phase; after the last one the case is written."""
        if isinstance(item, CaseTest) and item.outcome is not None and report.when == "teardown":
            # A case of a campaign brings its whole result.
            self._start(item.outcome.bench_file)
            write_case(self.directory, item.outcome.result)
        entry = self._entries.get(item.nodeid)
        if entry is None:
            return
        entry.result.wall_s += report.duration
        if report.outcome == "failed":
            verdict = Verdict.FAILED if report.when == "call" else Verdict.ERROR
            if entry.outcome is not Verdict.FAILED:
                entry.outcome, entry.message = verdict, report.longreprtext
        elif (
            report.outcome == "skipped"
            and not hasattr(report, "wasxfail")
            and entry.outcome is Verdict.PASSED
        ):
            entry.outcome = Verdict.BLOCKED
            reason = report.longrepr
            entry.message = str(reason[2]) if isinstance(reason, tuple) else str(reason)
        if report.when == "teardown":
            del self._entries[item.nodeid]
            entry.result.verdict, entry.result.message = entry.outcome, entry.message
            write_case(self.directory, entry.result)

    def finish(self) -> None:
        """End the run of this process, if any test has used a bench."""
        if self._started:
            finish_run(self.directory)


def new_run(seed: int, bench_name: str, bench_text: str) -> RunResult:
    """Return the head of a run made by pytest."""
    started = datetime.now(UTC).isoformat(timespec="seconds")  # the wall clock dates the run
    return RunResult("pytest", seed, bench_name, bench_text, environment_facts(), started)


def finish_report(
    config: pytest.Config, directory: Path, *, crashed: Mapping[str, str], history: str
) -> None:
    """Gather the runs of the xdist workers and write the report; for the main process.

    Args:
        config: Of pytest.
        directory: Folder of the report.
        crashed: What is said of tests that have taken their worker along.
        history: File of the history of runs; empty: that of the folder; `none`: none.

    """
    _gather(directory, crashed)
    if not (directory / RUN_FILE).exists():
        return
    run = load_run(directory, lazy=True)
    complete(run)
    background = kept(run, directory, history)
    written = write_report(run, directory, background=background)
    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if reporter is not None:
        reporter.write_line(f"bench report: {written.report}")


def _gather(directory: Path, crashed: Mapping[str, str]) -> None:
    """Merge the runs of xdist workers into the main one, in the order of test names; a test that crashed is
    an error.
    """
    folder = workers_folder(directory)
    if not folder.is_dir():
        return
    runs = [load_run(part, lazy=True) for part in sorted(folder.iterdir()) if (part / RUN_FILE).exists()]
    if runs:
        if (directory / RUN_FILE).exists():
            clear_run(directory)
        lost = [
            CaseResult(
                name,
                name.partition("::")[2] or name,
                Verdict.ERROR,
                message,
                name.partition("::")[0],
                seed=runs[0].seed,
            )
            for name, message in crashed.items()
        ]
        cases = sorted(
            [*lost, *(case for run in runs for case in run.cases)], key=lambda case: case.identifier
        )
        start_run(directory, runs[0])
        for case in cases:
            write_case(directory, case)
        finish_run(directory)
    shutil.rmtree(folder)
