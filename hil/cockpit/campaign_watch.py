"""A running campaign as a page shows it: progress, results as they come, workers, the time that is left."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Final, Literal

from reports import Comparison, History, HistoryError, PastRun, compare_runs, headline
from reports.model import CaseResult, Verdict

if TYPE_CHECKING:
    from pathlib import Path

    from reports.json_types import JsonObject

Stage = Literal["running", "stopping", "stopped", "finished"]
_MOST_ROWS: Final = 500
"""Results in one answer."""
_RECENT: Final = 40
"""Cases from whose ends the pace is taken."""


class CampaignWatch:
    """What is known of a campaign that runs. Any thread may read and update it.

    Args:
        title: What runs.
        total: Number of cases.
        workers: Number of processes that run cases.
        history: File of the history; None: there is none.
        earlier: Results of a run that this one goes on with.
        clock: Wall clock, s; it controls nothing.

    """

    def __init__(
        self,
        title: str,
        total: int,
        *,
        workers: int,
        history: Path | None = None,
        earlier: Iterable[CaseResult] = (),
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._title = title
        self._total = total
        self._workers = workers
        self._history = history
        self._clock = clock
        self._lock = threading.Lock()
        self._asked = threading.Condition(self._lock)
        self._stage: Stage = "running"
        self._results: list[CaseResult] = list(earlier)
        self._ends_s: list[float] = []
        self._running: dict[str, float] = {}
        self._began_s = clock()
        self._spent_s = 0.0
        self._ended = False

    # -- from the run ---------------------------------------------------------------------------------------

    def case_began(self, identifier: str) -> None:
        """Note that a worker has got a case."""
        with self._lock:
            self._running[identifier] = self._clock()

    def case_done(self, result: CaseResult) -> None:
        """Note a result."""
        with self._lock:
            self._running.pop(result.identifier, None)
            self._results.append(result)
            self._ends_s.append(self._clock())

    def resumed(self) -> None:
        """Note that the run goes on."""
        with self._lock:
            self._stage = "running"
            self._began_s = self._clock()
            self._ends_s.clear()

    def paused(self, *, finished: bool) -> None:
        """Note that the run has ended, or was stopped before its end."""
        with self._lock:
            self._stage = "finished" if finished else "stopped"
            self._spent_s += self._clock() - self._began_s
            self._running.clear()

    @property
    def stopping(self) -> bool:
        """Whether no further case shall begin."""
        return self._stage == "stopping"

    def wait_for_orders(self) -> bool:
        """Wait until somebody asks to go on or to end; returns whether the run goes on."""
        with self._asked:
            while not self._ended and self._stage in ("stopped", "finished"):
                self._asked.wait(0.5)
            return not self._ended

    # -- from the page --------------------------------------------------------------------------------------

    def stop(self) -> None:
        """Let no further case begin; those under way end."""
        with self._lock:
            if self._stage == "running":
                self._stage = "stopping"

    def resume(self) -> None:
        """Let a stopped run go on."""
        with self._asked:
            if self._stage == "stopped":
                self._stage = "running"
                self._asked.notify_all()

    def end(self) -> None:
        """End the command once the run has ended."""
        with self._asked:
            if self._stage == "running":
                self._stage = "stopping"
            self._ended = True
            self._asked.notify_all()

    def state(self, since: int) -> JsonObject:
        """Return how the run stands, and the results from a number on.

        Args:
            since: Number of the first result that is wanted, from 0.

        """
        with self._lock:
            now_s = self._clock()
            done = len(self._results)
            counts = {one.value: sum(case.verdict is one for case in self._results) for one in Verdict}
            rows = self._results[max(since, done - _MOST_ROWS) :] if since <= done else []
            first = done - len(rows)
            running = self._stage in ("running", "stopping")
            return {
                "title": self._title,
                "stage": self._stage,
                "total": self._total,
                "done": done,
                "counts": dict(counts),
                "elapsed_s": self._spent_s + (now_s - self._began_s if running else 0.0),
                "left_s": self._left_s() if running else None,
                "per_minute": self._pace() * 60.0,
                "workers": self._workers,
                "running": [
                    {"case": name, "for_s": now_s - began_s} for name, began_s in self._running.items()
                ],
                "results": [_row(number, case) for number, case in enumerate(rows, first)],
            }

    def result(self, number: int) -> CaseResult | None:
        """Return a result by its number; None: there is none."""
        with self._lock:
            return self._results[number] if 0 <= number < len(self._results) else None

    def _pace(self) -> float:
        """Return cases per second, of the last ones."""
        recent = self._ends_s[-_RECENT:]
        if not recent:
            return 0.0
        begin_s = self._ends_s[-_RECENT - 1] if len(self._ends_s) > _RECENT else self._began_s
        return len(recent) / max(recent[-1] - begin_s, 1e-3)

    def _left_s(self) -> float | None:
        pace = self._pace()
        return (self._total - len(self._results)) / pace if pace else None

    # -- earlier runs ---------------------------------------------------------------------------------------

    def earlier_runs(self) -> list[JsonObject]:
        """Return the runs of the history, the newest first; empty where there is none."""
        if self._history is None or not self._history.is_file():
            return []
        try:
            with History(self._history) as history:
                return [_past(one) for one in history.runs()]
        except HistoryError:
            return []

    def compare(self, base: str, now: str) -> JsonObject:
        """Return what has changed between two runs, by number, `last`, or `last-1`.

        Raises:
            HistoryError: There is no history, or no such run.

        """
        if self._history is None:
            raise HistoryError("this run has no history")
        with History(self._history) as history:
            found: Comparison = compare_runs(history, history.find(now), history.find(base))
            return found.as_dict()


def _row(number: int, case: CaseResult) -> JsonObject:
    return {
        "number": number,
        "case": case.identifier,
        "title": case.title,
        "verdict": case.verdict.value,
        "headline": "" if case.verdict is Verdict.PASSED else headline(case),
        "wall_s": case.wall_s,
        "token": case.token,
    }


def _past(run: PastRun) -> JsonObject:
    names = (
        "number",
        "started",
        "title",
        "bench",
        "state",
        "passed",
        "failed",
        "blocked",
        "errors",
        "wall_s",
    )
    return {name: getattr(run, name) for name in names}
