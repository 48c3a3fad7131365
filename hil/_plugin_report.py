"""The report of a pytest run: a case for every test that used a bench."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from hil._outputs import kept
from hil._plugin_cases import CaseTest
from hil._plugin_settings import BLOCKED, REQUIREMENT, evidence_wanted, run_seed, shortest, workers_folder
from hil._plugin_source import function_of, source_digest
from hil._plugin_words import crash_text, example_of
from hil._requirements import Requirement, complete
from hil.campaign import environment_facts
from hil.campaign._evidence import build_alarms, build_faults, build_messages, build_signals, build_story
from hil.campaign._execute import Execution
from hil.campaign._files import FOLDER, folder_name, write_evidence
from hil.campaign._runner import clear_run
from hil.campaign._token import PYTEST, Token
from hil.protocols import BenchFile
from hil.record import homing_drawings
from reports import write_report
from reports.model import CaseResult, RunResult, Step, Verdict
from reports.store import RUN_FILE, finish_run, load_run, start_run, write_case

if TYPE_CHECKING:
    from hil._plugin_tests import Example, TestRecord, Use
    from hil.protocols import Bench
    from hil.record import Trace


class _Outcome:
    """How the phases of a test have ended so far."""

    def __init__(self) -> None:
        self.verdict = Verdict.PASSED
        self.message = ""
        self.traceback = ""
        self.example = ""
        self.wall_s = 0.0

    def note(self, report: pytest.TestReport, crash: str) -> None:
        """Take over a phase."""
        self.wall_s += report.duration
        blocked = str(getattr(report, BLOCKED, ""))
        if blocked:
            if self.verdict is Verdict.PASSED:
                self.verdict, self.message = Verdict.BLOCKED, blocked
        elif report.outcome == "failed":
            if self.verdict is not Verdict.FAILED:
                self.verdict = Verdict.FAILED if report.when == "call" else Verdict.ERROR
                self.message = crash or _last_line(report.longreprtext)
                self.traceback = report.longreprtext
        elif (
            report.outcome == "skipped" and not hasattr(report, "wasxfail") and self.verdict is Verdict.PASSED
        ):
            self.verdict = Verdict.BLOCKED
            reason = report.longrepr
            text = str(reason[2]) if isinstance(reason, tuple) else str(reason)
            self.message = text.removeprefix("Skipped: ")


def _last_line(text: str) -> str:
    """Return the last line that pytest marks as an error, else the last line."""
    lines = [line for line in text.splitlines() if line.strip()]
    marked = [line[1:].strip() for line in lines if line.startswith("E ")]
    return next(reversed(marked or lines), "")


class PluginReport:
    """Collects the cases of one pytest process.

    Args:
        directory: Folder for the run of this process.
        config: Of pytest.

    """

    def __init__(self, directory: Path, config: pytest.Config) -> None:
        self.directory = directory
        self._config = config
        self._seed = run_seed(config)
        self._keep = evidence_wanted(config)
        self._outcomes: dict[str, _Outcome] = {}
        self.started = False
        """Whether a test has used a bench."""
        self.broken = ""
        """Why the report cannot be written any more; empty: it can."""

    def note(self, record: TestRecord, report: pytest.TestReport, error: BaseException | None) -> None:
        """Take over the outcome of a phase; after the last one the case is written."""
        item = record.item
        outcome = self._outcomes.setdefault(item.nodeid, _Outcome())
        outcome.note(report, "" if error is None else crash_text(error))
        if error is not None:
            outcome.example = example_of(error) or outcome.example
        if report.when != "teardown":
            return
        del self._outcomes[item.nodeid]
        if isinstance(item, CaseTest):
            # A case of a campaign brings its whole result.
            if item.outcome is not None:
                execution, bench_file = item.outcome
                self._write(bench_file, execution)
            return
        record.look_at_fixtures()
        if record.uses_bench:
            self._note_test(record, outcome)

    def _note_test(self, record: TestRecord, outcome: _Outcome) -> None:
        use = record.last
        bench_file = self._bench_file(record)
        result = CaseResult(
            identifier=record.item.nodeid,
            title=_title(record.item),
            verdict=outcome.verdict,
            message=outcome.message,
            traceback=outcome.traceback,
            group=record.item.nodeid.partition("::")[0],
            seed=0 if use is None else use.bench.seed,
            token="" if bench_file is None else self.token(record.item, bench_file, outcome.example),
            tags=sorted({marker.name for marker in record.item.iter_markers()}),
            requirements=[str(value) for name, value in record.item.user_properties if name == REQUIREMENT],
            wall_s=outcome.wall_s,
            source=source_digest(record.item),
        )
        trace = None
        if use is not None:
            trace = use.trace()
            _collect(record, use, trace, result)
        self._write(bench_file, Execution(result, trace), record.first_failed)

    def token(self, item: pytest.Item, bench_file: BenchFile[Bench], example: str = "") -> str:
        """Return the token by which `hil replay` and `hil diag` repeat a test."""
        return Token(
            item.nodeid,
            self._seed,
            campaign=f"{PYTEST}:{shortest(item.path)}",
            bench=str(self._config.getoption("--hil-bench") or ""),
            bench_digest=bench_file.digest,
            example=example,
        ).encode()

    def _bench_file(self, record: TestRecord) -> BenchFile[Bench] | None:
        """Return what the test took its bench from, if its setup came that far."""
        if record.last is not None:
            return record.last.bench_file
        item = record.item
        found = item.funcargs.get("hil_bench_file") if isinstance(item, pytest.Function) else None
        return found if isinstance(found, BenchFile) else None

    def _write(
        self, bench_file: BenchFile[Bench] | None, execution: Execution, found: Example | None = None
    ) -> None:
        """Write a case with its evidence; a disk that is full ends the report, not the tests."""
        if self.broken:
            return
        try:
            self._start(bench_file)
            write_evidence(execution, self.directory, self._keep)
            if found is not None and found.use is not None and self._keep != "none":
                _write_found(execution.result, found.use, self.directory)
            write_case(self.directory, execution.result)
        except OSError as error:
            self.broken = f"{error.filename or self.directory}: {error.strerror or error}"

    def _start(self, bench_file: BenchFile[Bench] | None) -> None:
        if not self.started:
            if (self.directory / RUN_FILE).exists():
                clear_run(self.directory)
            name, text = ("", "") if bench_file is None else (bench_file.name, bench_file.text)
            start_run(self.directory, new_run(self._seed, name, text))
            self.started = True

    def finish(self, *, interrupted: bool) -> None:
        """End the run of this process, if any test has used a bench."""
        if self.started and not self.broken:
            finish_run(self.directory, interrupted=interrupted)


def _title(item: pytest.Item) -> str:
    """Return the first line of the docstring; without one the report shows the identifier."""
    function = function_of(item)
    text = "" if function is None else (function.__doc__ or "").strip()
    return text.splitlines()[0] if text else item.nodeid


def _collect(record: TestRecord, use: Use, trace: Trace, result: CaseResult) -> None:
    """Fill a result with what its bench has recorded."""
    from hil.bench.cam_drawings import cam_drawings
    from hil.testing import CurrentTrace

    result.checks = [check for current in CurrentTrace.all_of(use.bench) for check in current.checks]
    result.simulated_s = trace.end_s
    result.trace_digest = trace.digest()
    result.story = build_story(trace, list(_steps_of(record)), result.checks)
    result.alarms = build_alarms(trace)
    result.faults = build_faults(trace, [armed for one in use.injectors() for armed in one.armed])
    bad = [check for check in result.checks if check.verdict is not Verdict.PASSED]
    result.messages = build_messages(
        trace, use.bench.decode, times_s=[check.time_s for check in bad if check.time_s is not None]
    )
    result.signals = build_signals(trace, judged=[check.signal for check in bad if check.signal])
    result.homings = homing_drawings(trace)
    result.cams = cam_drawings(use.bench)


def _steps_of(record: TestRecord) -> Iterator[Step]:
    """Return lines of the story on examples of Hypothesis, and on benches that it does not show."""
    if record.examples:
        first, last = record.first_failed, record.last_failed
        yield Step(0.0, "do", f"Hypothesis ran {record.examples} examples, each on a fresh bench")
        if first is not None and last is not None:
            yield Step(0.0, "do", f"Example {first.number} failed first: {first.arguments}")
            yield Step(0.0, "do", f"Shown is the last one that failed, the shrunk one: {last.arguments}")
    elif record.built > 1:
        yield Step(0.0, "do", f"The test built {record.built} benches; this is the last one")


def _write_found(result: CaseResult, use: Use, directory: Path) -> None:
    """Write the trace of the example of Hypothesis that failed first, next to that of the shrunk one."""
    folder = directory / FOLDER / folder_name(result.identifier)
    folder.mkdir(parents=True, exist_ok=True)
    archive, _ = use.trace().save(folder / "found")
    result.files["trace of the example that failed first"] = archive.relative_to(directory).as_posix()


def new_run(seed: int, bench_name: str, bench_text: str) -> RunResult:
    """Return the head of a run made by pytest."""
    started = datetime.now(UTC).isoformat(timespec="seconds")  # the wall clock dates the run
    return RunResult("pytest", seed, bench_name, bench_text, environment_facts(), started)


def finish_report(
    directory: Path,
    *,
    alone: bool,
    crashed: Mapping[str, str],
    history: str,
    own: Sequence[Requirement] = (),
) -> Path | None:
    """Gather the runs of the xdist workers and write the report; for the main process.

    Returns the page; None where no test has used a bench.

    Args:
        directory: Folder of the report.
        alone: Whether tests of this process have used a bench; otherwise those of workers may have.
        crashed: What is said of tests that have taken their worker along.
        history: File of the history of runs; empty: that of the folder; `none`: none.
        own: Requirements of the user, which lead the report.

    """
    if not _gather(directory, crashed) and not alone:
        return None
    run = load_run(directory, lazy=True)
    complete(run, own)
    background = kept(run, directory, history)
    return write_report(run, directory, background=background).report


def _gather(directory: Path, crashed: Mapping[str, str]) -> bool:
    """Merge the runs of xdist workers into the main one, in the order of test names; a test that crashed is
    an error. Returns whether there were any.
    """
    folder = workers_folder(directory)
    if not folder.is_dir():
        return False
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
        for evidence in folder.glob(f"*/{FOLDER}/*"):
            target = directory / FOLDER / evidence.name
            target.parent.mkdir(exist_ok=True)
            shutil.rmtree(target, ignore_errors=True)
            shutil.move(evidence, target)
        finish_run(directory, interrupted=any(run.interrupted for run in runs))
    shutil.rmtree(folder)
    return bool(runs)
