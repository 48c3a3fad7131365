"""Running a case in a worker process: everything is found again by reference, nothing but plain data travels."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hil.campaign._benches import load_bench_file
from hil.campaign._case import Case
from hil.campaign._discover import load_campaign
from hil.campaign._execute import CaseSettings, execute_case, make_token
from hil.campaign._files import Keep, write_evidence
from reports.model import CaseResult


@dataclass(frozen=True, slots=True)
class Order:
    """One case to be run, as it travels to a worker."""

    identifier: str
    campaign: str
    """Reference of the campaign."""
    bench: str
    """Reference of the bench."""
    seed: int
    """Seed of the case."""
    twice: bool
    evidence: Keep
    directory: str
    """Folder of the report; empty: no evidence files."""


_benches: dict[str, Any] = {}


def bench_of(reference: str) -> Any:
    """Return a bench file, loaded once per process."""
    if reference not in _benches:
        _benches[reference] = load_bench_file(reference or None)
    return _benches[reference]


def prepare_worker(path: list[str]) -> None:
    """Set up a fresh worker process: it leaves Ctrl-C to the parent, ends with it, and finds modules where it does."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, name="parent's death", daemon=True).start()
    sys.path[:] = path


def _end_with_parent() -> None:
    """End this process when its parent is gone, killed perhaps.

    The pool's own queues do not tell: every worker holds both of their ends.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def run_order(order: Order, case: Case | None = None) -> CaseResult:
    """Run a case and return its result; evidence files are written on the way.

    Args:
        order: What to run.
        case: The case, where it is at hand already.

    """
    if case is None:
        case = load_campaign(order.campaign)[order.identifier]
    bench_file = bench_of(order.bench)
    token = make_token(
        case, seed=order.seed, campaign=order.campaign, bench=order.bench, bench_digest=bench_file.digest
    )
    execution = execute_case(case, bench_file, CaseSettings(seed=order.seed, token=token, twice=order.twice))
    if order.directory:
        write_evidence(execution, Path(order.directory), order.evidence)
    return execution.result
