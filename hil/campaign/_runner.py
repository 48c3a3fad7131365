"""Running many cases: one after the other, on several processes or machines, with a journal that survives."""

from __future__ import annotations

import hashlib
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib import metadata
from itertools import zip_longest
from pathlib import Path
from typing import Final

from fieldbus import core_build
from hil._digests import product_digest
from hil._workers import number_of_processes
from hil.bench.makes import NC_BENCH
from hil.campaign._case import Case
from hil.campaign._discover import Selected
from hil.campaign._execute import LIVE_REPETITIONS, make_token
from hil.campaign._executor import Executor, Finished, InProcess, LocalProcesses, OnBegin
from hil.campaign._files import FOLDER, Keep
from hil.campaign._worker import Order, bench_of
from hil.errors import CannotRunError
from hil.protocols import kind_of
from reports.model import PRODUCT_DIGEST, CaseResult, RunResult, Verdict
from reports.packed import pack_case
from reports.store import JOURNAL_FILE, RUN_FILE, SIGNAL_FOLDER, finish_run, load_run, start_run, write_case

OnResult = Callable[[CaseResult, int, int], None]
"""Called with a result, the number of finished cases and the number of all."""

PATIENCE_S: Final = 60.0
"""What a worker process has on top of all limits of wall time of its case before it is taken for hanging."""


@dataclass(frozen=True)
class RunOptions:
    """How a run is made."""

    bench: str = ""
    """Bench reference given by the user; empty: what the case wants, else the embedded default."""
    seed: int = 0
    jobs: int = 1
    """Worker processes; 1 = in this process, 0 = as many as there are processors for this process."""
    twice: bool = False
    evidence: Keep = "failed"
    directory: Path | None = None
    """Folder of journal and evidence; None: nothing is written."""
    resume: bool = False
    """Go on with the run that is in `directory`."""
    repeat_failed: bool = False
    """With `resume`: run those cases again that failed or broke."""
    title: str = ""
    wall_limit_s: float = 0.0
    """Limit of wall time of every case, s; 0: that of the case itself."""
    cluster: str = ""
    """Address of a dask scheduler whose workers run the cases; empty: this machine."""
    shard: tuple[int, int] | None = None
    """`(2, 4)`: run the second of four parts of the cases; None: all of them."""
    budget_s: float = 0.0
    """Wall time after which no further case begins, s; 0: no limit. With one the first case of every family
    comes before the second of any.
    """
    executor: Executor | None = None
    """Another executor in place of those that `jobs` and `cluster` choose."""


def case_seed(run_seed: int, identifier: str) -> int:
    """Return the seed of a case: it depends on the run's seed and the case alone, not on what else is run."""
    return int.from_bytes(hashlib.sha256(f"{run_seed}:{identifier}".encode()).digest()[:4], "big")


def _seed(case: Case, run_seed: int) -> int:
    return case_seed(run_seed, case.identifier) if case.seed is None else case.seed


def environment_facts() -> dict[str, str]:
    """Return versions and machine facts for the report."""
    facts = {
        "python": platform.python_version(),
        "platform": platform.platform(),
        "machine": platform.machine(),
        "core": core_build.kind(),
    }
    for package in ("motion-hil", "numpy", "canopen", "python-can", "pytest", "hypothesis", "pydantic"):
        try:
            facts[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            facts[package] = "not installed"
    facts[PRODUCT_DIGEST] = product_digest()
    return facts


def clear_run(directory: Path) -> None:
    """Delete the journal and evidence of an earlier run; other files in the folder stay."""
    (directory / JOURNAL_FILE).unlink(missing_ok=True)
    for archive in (directory / SIGNAL_FOLDER).glob("*.npz"):
        archive.unlink()
    for name in ("trace.npz", "trace.json", "found.npz", "found.json", "bus.log", "modbus.log"):
        for file in (directory / FOLDER).glob(f"*/{name}"):
            file.unlink()
    for folder in [*(directory / FOLDER).glob("*"), directory / FOLDER]:
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
    # Last: while this file is there, the folder is known to hold a run, if a broken one.
    (directory / RUN_FILE).unlink(missing_ok=True)


def shard(cases: Sequence[Selected], part: tuple[int, int] | None) -> Sequence[Selected]:
    """Return a part of the cases, `(number, count)` with numbers from 1; the parts have no case in common and
    are all together.

    Neighbours, which often take about the same time, go to different parts.

    Raises:
        CannotRunError: There is no such part, or no case is left for it.

    """
    if part is None:
        return cases
    number, count = part
    if not 1 <= number <= count:
        raise CannotRunError(
            f"there is no shard {number}/{count}; allowed: 1/{max(count, 1)} to "
            f"{max(count, 1)}/{max(count, 1)}"
        )
    found = cases[number - 1 :: count]
    if not found:
        raise CannotRunError(f"no case is left for shard {number}/{count}: there are {len(cases)}")
    return found


class Runner:
    """Runs the selected cases.

    Args:
        cases: What to run, in order.
        options: How.
        on_result: Called after every case.
        on_begin: Called with the identifier of every case that begins on this machine.
        stop: Asked after every case whether the run shall end here, as if interrupted.

    Raises:
        CannotRunError: A negative worker count, `twice` on a live bench, or a
            folder that does not fit `resume`.

    """

    def __init__(
        self,
        cases: Sequence[Selected],
        options: RunOptions,
        *,
        on_result: OnResult | None = None,
        on_begin: Callable[[str], object] | None = None,
        stop: Callable[[], bool] | None = None,
    ) -> None:
        self._jobs = number_of_processes(options.jobs)
        if options.wall_limit_s < 0:
            raise CannotRunError(f"{options.wall_limit_s:g} s are no limit; give more than 0 s")
        planned = [selected.case.identifier for selected in cases]
        self._cases = {selected.case.identifier: selected for selected in shard(cases, options.shard)}
        self._options = options
        self._on_result = on_result
        self._on_begin: OnBegin | None = (
            None if on_begin is None else lambda order: on_begin(order.identifier)
        )
        self._stop = stop
        self._results: dict[str, CaseResult] = {}
        self._run = RunResult(
            title=options.title or _title(cases),
            seed=options.seed,
            bench_name="",
            bench_text="",
            environment=environment_facts(),
            # The wall clock dates the run; nothing in it is controlled by it.
            started=datetime.now(UTC).isoformat(timespec="seconds"),
            planned=planned,
            shard="/".join(map(str, options.shard)) if options.shard else "",
        )

    def run(self) -> RunResult:
        """Run everything that is left to run; Ctrl-C ends early, with the
        results so far and `interrupted` set.
        """
        benches = list(dict.fromkeys(self._bench_for(selected) for selected in self._cases.values()))
        files = [bench_of(reference) for reference in benches]
        self._run.bench_name = ", ".join(file.name for file in files)
        self._run.bench_text = "\n\n".join(file.text for file in files)
        self._open_journal()
        orders = [self._order(item) for name, item in self._cases.items() if name not in self._results]
        budget_s, started = self._options.budget_s, time.monotonic()
        if budget_s:
            orders = _in_turn(orders)
        try:
            for result in self._execute(orders):
                self._keep(result)
                used_up = budget_s and time.monotonic() - started > budget_s
                if used_up or (self._stop is not None and self._stop()):
                    self._run.interrupted = len(self._results) < len(self._cases)
                    break
        except KeyboardInterrupt:
            self._run.interrupted = True
        self._run.cases = [self._results[name] for name in self._cases if name in self._results]
        if self._options.directory is not None:
            finish_run(self._options.directory, interrupted=self._run.interrupted)
        return self._run

    def _bench_for(self, selected: Selected) -> str:
        bench = self._options.bench or selected.case.bench
        return f"{NC_BENCH}{bench}" if selected.case.controller == "nc" else bench

    def _order(self, selected: Selected) -> Order:
        options = self._options
        bench = self._bench_for(selected)
        file = bench_of(bench)
        limit_s = options.wall_limit_s or selected.case.wall_limit_s
        runs = 1 + LIVE_REPETITIONS if (kind_of(file) != "virtual") else 1 + options.twice
        return Order(
            identifier=selected.case.identifier,
            campaign=selected.campaign,
            bench=bench,
            seed=_seed(selected.case, options.seed),
            twice=options.twice,
            evidence=options.evidence,
            directory="" if options.directory is None else str(options.directory),
            bench_digest=file.digest,
            wall_limit_s=options.wall_limit_s,
            patience_s=runs * limit_s + PATIENCE_S,
        )

    def _open_journal(self) -> None:
        directory = self._options.directory
        if directory is None:
            return
        exists = (directory / RUN_FILE).exists()
        if exists and self._options.resume:
            old = load_run(directory, lazy=True)
            if old.seed != self._run.seed or old.bench_text != self._run.bench_text:
                raise CannotRunError(
                    f"{directory} holds a run with seed {old.seed} on {old.bench_name!r}; it can only be "
                    f"resumed with "
                    "the same seed and bench"
                )
            again = {Verdict.FAILED, Verdict.ERROR} if self._options.repeat_failed else set()
            self._results = {result.identifier: result for result in old.cases if result.verdict not in again}
            self._run.started = old.started
            self._check_shard(old)
            return
        if exists or (directory / JOURNAL_FILE).exists():
            clear_run(directory)
        start_run(directory, self._run)

    def _check_shard(self, old: RunResult) -> None:
        if old.shard != self._run.shard:
            raise CannotRunError(
                f"{self._options.directory} holds {_part(old.shard)}; it cannot be resumed with "
                f"{_part(self._run.shard)}"
            )

    def _keep(self, result: CaseResult) -> None:
        result.configuration = dict(self._cases[result.identifier].configuration)
        if self._options.directory is not None:
            result = write_case(self._options.directory, result)
            pack_case(result)
        self._results[result.identifier] = result
        if self._on_result is not None:
            self._on_result(result, len(self._results), len(self._cases))

    def _execute(self, orders: list[Order]) -> Iterator[CaseResult]:
        if not orders:
            return
        with closing(self._executor(len(orders)).execute(orders)) as finished:
            for one in finished:
                yield self._result_of(one)

    def _executor(self, number: int) -> Executor:
        options = self._options
        if options.executor is not None:
            return options.executor
        if options.cluster:
            from hil.campaign._cluster import Cluster

            return Cluster(options.cluster)
        jobs = min(self._jobs, number)
        if jobs == 1:
            cases = {name: selected.case for name, selected in self._cases.items()}
            return InProcess(cases, self._on_begin)
        # Two cases on the same bus would disturb each other.
        alone = any(
            kind_of(bench_of(self._bench_for(selected))) != "virtual" for selected in self._cases.values()
        )
        return LocalProcesses(1 if alone else jobs, self._on_begin)

    def _result_of(self, finished: Finished) -> CaseResult:
        order, parcel = finished.order, finished.parcel
        if parcel is not None:
            if self._options.directory is not None:
                parcel.unpack(self._options.directory)
            return parcel.result
        case = self._cases[order.identifier].case
        return CaseResult(
            identifier=case.identifier,
            title=case.title,
            verdict=Verdict.ERROR,
            group=case.group,
            tags=list(case.tags),
            message=finished.reason,
            requirements=list(case.requirements),
            seed=order.seed,
            token=make_token(
                case,
                seed=order.seed,
                campaign=order.campaign,
                bench=order.bench,
                bench_digest=order.bench_digest,
            ),
        )


def _in_turn(orders: Sequence[Order]) -> list[Order]:
    """Return orders with the first of every family of cases before the second of any."""
    families: dict[str, list[Order]] = {}
    for order in orders:
        families.setdefault(order.identifier.rpartition("/")[0], []).append(order)
    return [order for turn in zip_longest(*families.values()) for order in turn if order is not None]


def _title(cases: Sequence[Selected]) -> str:
    groups = list(dict.fromkeys(selected.case.group for selected in cases))
    return ", ".join(groups[:3]) + (" and others" if len(groups) > 3 else "")


def _part(shard_text: str) -> str:
    return f"shard {shard_text}" if shard_text else "a whole run"
