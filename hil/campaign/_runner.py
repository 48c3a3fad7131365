"""Running many cases: one after the other or on several processes, with a journal that survives."""

from __future__ import annotations

import hashlib
import multiprocessing
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from hil._interrupt import held
from hil.campaign._discover import Selected
from hil.campaign._files import FOLDER, Keep
from hil.campaign._worker import Order, bench_of, prepare_worker, run_order
from hil.errors import CannotRunError
from reports.model import CaseResult, RunResult, Verdict
from reports.store import JOURNAL_FILE, RUN_FILE, SIGNAL_FOLDER, finish_run, load_run, start_run, write_case

OnResult = Callable[[CaseResult, int, int], None]
"""Called with a result, the number of finished cases and the number of all."""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """How a run is made."""

    bench: str = ""
    """Bench reference given by the user; empty: what the case wants, else the embedded default."""
    seed: int = 0
    jobs: int = 1
    """Worker processes; 1 = in this process."""
    twice: bool = False
    evidence: Keep = "failed"
    directory: Path | None = None
    """Folder of journal and evidence; None: nothing is written."""
    resume: bool = False
    """Go on with the run that is in `directory`."""
    title: str = ""


def case_seed(run_seed: int, identifier: str) -> int:
    """Return the seed of a case: it depends on the run's seed and the case alone, not on what else is run."""
    return int.from_bytes(hashlib.sha256(f"{run_seed}:{identifier}".encode()).digest()[:4], "big")


def environment_facts() -> dict[str, str]:
    """Return versions and machine facts for the report."""
    facts = {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "machine": platform.machine(),
    }
    for package in ("motion-hil", "numpy", "canopen", "python-can", "pytest", "hypothesis", "pydantic"):
        try:
            facts[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            facts[package] = "not installed"
    return facts


def clear_run(directory: Path) -> None:
    """Take away the journal and evidence of an earlier run; whatever else lies in the folder stays."""
    (directory / RUN_FILE).unlink()
    (directory / JOURNAL_FILE).unlink(missing_ok=True)
    for archive in (directory / SIGNAL_FOLDER).glob("*.npz"):
        archive.unlink()
    for name in ("trace.npz", "trace.json", "bus.log", "modbus.log"):
        for file in (directory / FOLDER).glob(f"*/{name}"):
            file.unlink()
    for folder in [*(directory / FOLDER).glob("*"), directory / FOLDER]:
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()


class Runner:
    """Runs the selected cases.

    Args:
        cases: What to run, in order.
        options: How.
        on_result: Called after every case.

    Raises:
        CannotRunError: A worker count below 1, `twice` on a live bench, or a folder that does not fit `resume`.

    """

    def __init__(
        self, cases: Sequence[Selected], options: RunOptions, *, on_result: OnResult | None = None
    ) -> None:
        if options.jobs < 1:
            raise CannotRunError(f"{options.jobs} worker processes are not possible; give 1 or more")
        self._cases = list(cases)
        self._options = options
        self._on_result = on_result
        self._results: dict[str, CaseResult] = {}
        self._run = RunResult(
            title=options.title or _title(self._cases),
            seed=options.seed,
            bench_name="",
            bench_text="",
            environment=environment_facts(),
            # The wall clock dates the run; nothing in it is controlled by it.
            started=datetime.now(UTC).isoformat(timespec="seconds"),
        )

    def run(self) -> RunResult:
        """Run everything that is left to run; Ctrl-C ends early, with the results so far and `interrupted` set."""
        benches = list(dict.fromkeys(self._bench_for(selected) for selected in self._cases))
        files = [bench_of(reference) for reference in benches]
        self._run.bench_name = ", ".join(file.name for file in files)
        self._run.bench_text = "\n\n".join(file.text for file in files)
        self._open_journal()
        orders = [self._order(item) for item in self._cases if item.case.identifier not in self._results]
        try:
            for result in self._execute(orders):
                self._keep(result)
        except KeyboardInterrupt:
            self._run.interrupted = True
        wanted = [item.case.identifier for item in self._cases]
        self._run.cases = [self._results[name] for name in wanted if name in self._results]
        if self._options.directory is not None:
            finish_run(self._options.directory, interrupted=self._run.interrupted)
        return self._run

    def _bench_for(self, selected: Selected) -> str:
        return self._options.bench or selected.case.bench

    def _order(self, selected: Selected) -> Order:
        options = self._options
        return Order(
            identifier=selected.case.identifier,
            campaign=selected.campaign,
            bench=self._bench_for(selected),
            seed=case_seed(options.seed, selected.case.identifier),
            twice=options.twice,
            evidence=options.evidence,
            directory="" if options.directory is None else str(options.directory),
        )

    def _open_journal(self) -> None:
        directory = self._options.directory
        if directory is None:
            return
        exists = (directory / RUN_FILE).exists()
        if exists and self._options.resume:
            old = load_run(directory)
            if old.seed != self._run.seed or old.bench_text != self._run.bench_text:
                raise CannotRunError(
                    f"{directory} holds a run with seed {old.seed} on {old.bench_name!r}; it can only be resumed with "
                    "the same seed and bench"
                )
            self._results = {result.identifier: result for result in old.cases}
            self._run.started = old.started
            return
        if exists:
            clear_run(directory)
        start_run(directory, self._run)

    def _keep(self, result: CaseResult) -> None:
        self._results[result.identifier] = result
        if self._options.directory is not None:
            write_case(self._options.directory, result)
        if self._on_result is not None:
            self._on_result(result, len(self._results), len(self._cases))

    def _execute(self, orders: list[Order]) -> Iterator[CaseResult]:
        if self._options.jobs == 1 or len(orders) < 2:
            cases = {selected.case.identifier: selected.case for selected in self._cases}
            for order in orders:
                yield run_order(order, cases[order.identifier])
        else:
            yield from _run_pool(orders, min(self._options.jobs, len(orders)), self._lost)

    def _lost(self, order: Order) -> CaseResult:
        """Return the result of a case whose process died."""
        case = next(item.case for item in self._cases if item.case.identifier == order.identifier)
        return CaseResult(
            identifier=case.identifier, title=case.title, verdict=Verdict.ERROR, group=case.group, tags=list(case.tags),
            message="the process that ran this case died", requirements=list(case.requirements), seed=order.seed,
        )  # fmt: skip


def _title(cases: Sequence[Selected]) -> str:
    groups = list(dict.fromkeys(selected.case.group for selected in cases))
    return ", ".join(groups[:3]) + (" and others" if len(groups) > 3 else "")


def _new_pool(jobs: int) -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(
        jobs, mp_context=context, initializer=prepare_worker, initargs=(list(sys.path),)
    )


def _run_pool(orders: list[Order], jobs: int, lost: Callable[[Order], CaseResult]) -> Iterator[CaseResult]:
    """Run orders on worker processes.

    A process that dies takes the pool with it. Those cases that were under way are then run again one by one, so that
    only the one that kills its process is lost.
    """
    waiting = list(reversed(orders))
    others = set(multiprocessing.active_children())
    pool = _new_pool(jobs)
    running: dict[Future[CaseResult], Order] = {}
    try:
        while waiting or running:
            suspects: list[Order] = []
            try:
                while waiting and len(running) < jobs:
                    order = waiting.pop()
                    suspects = [order]
                    with held():  # submitting may start a worker, for which Ctrl-C is not meant
                        running[pool.submit(run_order, order)] = order
                    suspects = []
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in sorted(done, key=lambda one: orders.index(running[one])):
                    order = running.pop(future)
                    suspects.append(order)
                    result = future.result()
                    suspects.pop()
                    yield result
            except BrokenProcessPool:
                suspects += running.values()
                running = {}
                pool.shutdown(wait=True)
                for order in sorted(suspects, key=orders.index):
                    yield _run_alone(order, lost)
                pool = _new_pool(jobs)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        if running:
            for process in multiprocessing.active_children():
                if process not in others:
                    process.terminate()


def _run_alone(order: Order, lost: Callable[[Order], CaseResult]) -> CaseResult:
    with _new_pool(1) as pool:
        try:
            with held():
                future = pool.submit(run_order, order)
            return future.result()
        except BrokenProcessPool:
            return lost(order)
