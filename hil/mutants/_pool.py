"""Processes for tasks: each task has a fresh one, each case a limit; a process that hangs or dies is told
from one that works.
"""

from __future__ import annotations

import multiprocessing
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import BaseContext
from multiprocessing.process import BaseProcess
from typing import Any, Final

from hil._interrupt import held
from hil.errors import CannotRunError
from hil.mutants._worker import Outcome, Task, run_task
from reports.processors import processors

START_LIMIT_S: Final = 120.0
"""Wall time within which a process has to be ready for its first case."""
RESERVE_S: Final = 5.0
"""What a case gets beyond its limit to end itself, before its process is killed."""


def _context(preload: Iterable[str]) -> Any:
    """Return how processes are started: as copies of one that has imported everything and run nothing, where
    there is that.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["hil.mutants._preload", *preload])
    return context


@dataclass(slots=True)
class Finished:
    """A task that has ended."""

    task: Task
    outcomes: list[Outcome] = field(default_factory=list)
    trouble: str = ""
    """Why the harness could not do it; empty when it could."""


@dataclass(slots=True)
class _Running:
    finished: Finished
    process: BaseProcess
    pipe: Connection
    deadline_s: float

    @property
    def judge_index(self) -> int:
        return len(self.finished.outcomes)


class Pool:
    """Runs tasks on up to `jobs` processes at the same time.

    Args:
        jobs: How many; 0 = one for every processor.
        preload: Modules that each process has from its start; what cannot be imported is left out.

    Raises:
        CannotRunError: Fewer than none.

    """

    def __init__(self, jobs: int, preload: Iterable[str] = ()) -> None:
        if jobs < 0:
            raise CannotRunError(
                f"{jobs} worker processes are not possible; give 1 or more, or 0 for all processors"
            )
        self._jobs = jobs or processors()
        self._context: BaseContext = _context(preload)
        self._running: list[_Running] = []

    def run(self, tasks: Iterable[Task]) -> Iterator[Finished]:
        """Run tasks and return each as it ends; what is under way when the caller leaves is killed."""
        waiting = list(reversed(list(tasks)))
        try:
            while waiting or self._running:
                while waiting and len(self._running) < self._jobs:
                    task = waiting.pop()
                    self._start(Finished(task), task)
                now = time.monotonic()
                soonest = min(one.deadline_s for one in self._running)
                ready = wait([one.pipe for one in self._running], max(soonest - now, 0.0))
                for one in list(self._running):
                    over = self._hear(one) if one.pipe in ready else self._late(one)
                    if over:
                        self._running.remove(one)
                        again = self._rest(one.finished)
                        if again is None:
                            yield one.finished
                        else:
                            self._start(one.finished, again)
        finally:
            for one in self._running:
                one.process.kill()
                one.process.join()
            self._running.clear()

    def _start(self, finished: Finished, task: Task) -> None:
        near, far = self._context.Pipe(duplex=False)
        process = self._context.Process(target=run_task, args=(task, far, list(sys.path)), daemon=True)  # type: ignore[attr-defined]
        with held():  # Ctrl-C is not meant for the process that starts now
            process.start()
        far.close()
        self._running.append(_Running(finished, process, near, time.monotonic() + START_LIMIT_S))

    def _hear(self, one: _Running) -> bool:
        """Take a message; returns whether the process is through."""
        try:
            message: object = one.pipe.recv()
        except (EOFError, OSError):
            one.process.join()
            code = one.process.exitcode
            if code or self._open(one):
                self._ended(one, "crashed", f"the process ended with {_end_in_words(code)}")
            return True
        if isinstance(message, Outcome):
            one.finished.outcomes.append(message)
        elif message != "ready":
            one.finished.trouble = str(message)
        index = one.judge_index
        limits = one.finished.task.limits_s
        limit_s = limits[index] if index < len(limits) else START_LIMIT_S
        one.deadline_s = time.monotonic() + limit_s + RESERVE_S
        return False

    def _late(self, one: _Running) -> bool:
        if time.monotonic() < one.deadline_s:
            return False
        one.process.kill()
        one.process.join()
        self._ended(one, "hung", "the process did not answer within the limit of the case")
        return True

    def _open(self, one: _Running) -> bool:
        """Return whether a process that went without a word still had cases to run."""
        outcomes, task = one.finished.outcomes, one.finished.task
        stopped = task.stop_at_first and bool(outcomes) and outcomes[-1].catches
        return not one.finished.trouble and not stopped and len(outcomes) < len(task.judges)

    def _ended(self, one: _Running, verdict: str, message: str) -> None:
        task = one.finished.task
        if one.judge_index < len(task.judges):
            judge = task.judges[one.judge_index]
            limit_s = task.limits_s[one.judge_index] if verdict == "hung" else 0.0
            names = frozenset() if task.mutant is None else frozenset({task.mutant.name})
            one.finished.outcomes.append(Outcome(judge, verdict, message, limit_s, names))

    def _rest(self, finished: Finished) -> Task | None:
        """Return the cases that are left after a process has gone, to be run in another one; None when it is
        the end.
        """
        task, done = finished.task, len(finished.outcomes)
        last = finished.outcomes[-1] if finished.outcomes else None
        if finished.trouble or last is None or done >= len(task.judges):
            return None
        if last.catches and task.stop_at_first:
            return None
        from dataclasses import replace

        return replace(task, judges=task.judges[done:], limits_s=task.limits_s[done:])


def _end_in_words(code: int | None) -> str:
    return f"signal {-code}" if code is not None and code < 0 else f"exit code {code}"
