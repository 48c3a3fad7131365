"""What happens in the process of one mutant: switch it on, run cases, tell about each. The process serves
nobody else.
"""

from __future__ import annotations

import signal
import sys
import time
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from typing import Final

from hil._interrupt import end_with_parent
from hil.campaign import CaseSettings, case_seed, execute_case, load_campaign
from hil.campaign._limits import USED_UP
from hil.campaign._worker import bench_of
from hil.mutants._mutant import Mutant
from hil.mutants._patch import Patch
from hil.mutants._plan import Judge
from reports.model import Verdict

MEMORY_LIMIT: Final = 6 << 30
"""Address space of a worker, bytes: a defect that allocates without end shall not take the machine along."""


@dataclass(frozen=True, slots=True)
class Task:
    """What a process is to do, as it travels to it."""

    judges: tuple[Judge, ...]
    seed: int
    mutant: Mutant | None
    """The defect that is judged; None: the product as it is."""
    patch: Patch
    """Its code; without a defect: code that notes the places of all of them."""
    stop_at_first: bool = True
    limits_s: tuple[float, ...] = ()
    """Limit of wall time of each case, s; the case ends itself at it, and the parent ends the process a
    little later.
    """


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a case ended in a worker."""

    judge: Judge
    verdict: str
    """`passed`, `failed`, `blocked`, `error`, `hung` or `crashed`."""
    message: str
    seconds: float
    reached: frozenset[str]
    """Names of the mutants whose changed statement was reached."""

    @property
    def catches(self) -> bool:
        """Whether a case that is green without the defect is not green with it; blocked counts, as its bench
        came up before.
        """
        return self.verdict != "passed"

    @property
    def red(self) -> bool:
        """Whether it is red in the baseline; a case that its bench cannot have is blocked there, and judges
        nothing.
        """
        return self.verdict not in {"passed", "blocked"}


def run_task(task: Task, pipe: Connection, path: list[str]) -> None:
    """Run the cases of a task and send an `Outcome` for each; an exception of the harness is sent as text."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is meant for the command
    end_with_parent()
    sys.path[:] = path
    _limit_memory()
    try:
        with redirect_stdout(sys.stderr):
            _run(task, pipe)
    except Exception as error:  # noqa: BLE001 - it ends in the report of the parent
        pipe.send(f"{type(error).__name__}: {error}")
    pipe.close()


def _limit_memory() -> None:
    try:
        import resource
    except ImportError:  # not on this system
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    if hard == resource.RLIM_INFINITY or hard > MEMORY_LIMIT:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, hard))


def _run(task: Task, pipe: Connection) -> None:
    reached: set[str] = set()
    with task.patch.applied(reached):
        pipe.send("ready")
        for judge, limit_s in zip(task.judges, task.limits_s, strict=True):
            reached.clear()
            outcome = _judge(task, judge, limit_s, reached)
            pipe.send(outcome)
            if outcome.catches and task.stop_at_first:
                return


def _judge(task: Task, judge: Judge, limit_s: float, reached: set[str]) -> Outcome:
    case = replace(load_campaign(judge.campaign)[judge.identifier], wall_limit_s=limit_s)
    started = time.perf_counter()
    settings = CaseSettings(seed=case_seed(task.seed, judge.identifier))
    result = execute_case(case, bench_of(judge.bench), settings).result
    hung = result.verdict is Verdict.ERROR and result.message.startswith(USED_UP)
    return Outcome(
        judge=judge,
        verdict="hung" if hung else result.verdict.value,
        message=result.message,
        seconds=time.perf_counter() - started,
        reached=frozenset(reached),
    )
