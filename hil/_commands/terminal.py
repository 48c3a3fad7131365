"""Output of the commands: JSON alone on standard output, everything for people on standard error."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TextIO

from reports.model import CaseResult, Verdict

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

_STYLE = {Verdict.PASSED: "green", Verdict.FAILED: "red", Verdict.BLOCKED: "yellow", Verdict.ERROR: "magenta"}


def console() -> Console:
    """Return a console on standard error."""
    from rich.console import Console

    return Console(stderr=True, highlight=False, soft_wrap=True)


def print_json(value: Any) -> None:
    """Write `value` as the only thing on standard output."""
    sys.stdout.write(json.dumps(value, indent=2, allow_nan=False) + "\n")
    sys.stdout.flush()


@contextlib.contextmanager
def quiet_stdout(active: bool) -> Iterator[None]:
    """Send what cases print to standard error while the result on standard output must stand alone."""
    if not active:
        yield
        return
    old: TextIO = sys.stdout
    sys.stdout = sys.stderr
    try:
        yield
    finally:
        sys.stdout = old


def time_left(elapsed_s: float, finished: int, remaining: int) -> str:
    """Return how long the rest takes at the pace so far, in words; empty while nothing can be said.

    Args:
        elapsed_s: Time since the beginning, s.
        finished: Cases that have ended in it.
        remaining: Cases that are left.

    """
    if not finished or not remaining:
        return ""
    seconds = round(elapsed_s / finished * remaining)
    hours, rest = divmod(seconds, 3600)
    clock = f"{hours}:{rest // 60:02}:{rest % 60:02}" if hours else f"{rest // 60}:{rest % 60:02}"
    return f"about {clock} left"


class CaseProgress:
    """Progress of long work: a bar on a terminal, a line per case elsewhere."""

    def __init__(self, total: int, title: str = "cases") -> None:
        self._total = total
        self._title = title
        self._console = console()
        self._bar: Progress | None = None
        self._task: Any = None
        self._counts = dict.fromkeys(Verdict, 0)
        # Wall time, for the person who waits; it controls nothing.
        self._began = time.monotonic()
        self._finished = 0

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TextColumn("{task.fields[last]}"),
                console=self._console,
                transient=True,
            )
            self._bar.start()
            self._task = self._bar.add_task(self._title, total=self._total, last="")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def case_done(self, result: CaseResult, done: int, total: int) -> None:
        """Show a finished case."""
        self._counts[result.verdict] += 1
        self._finished += 1
        width = len(str(total))
        left = time_left(time.monotonic() - self._began, self._finished, total - done)
        line = (
            f"[{done:{width}}/{total}] {result.verdict.value:7} {result.identifier} ({result.wall_s:.2f} s)"
        )
        if self._bar is None and left:
            line += f" {left}"
        if self._bar is None or result.verdict is not Verdict.PASSED:
            self._console.print(line, style=_STYLE[result.verdict], markup=False)
        if result.verdict is not Verdict.PASSED and result.message:
            self._console.print(f"    {result.message}", style="dim", markup=False)
        if self._bar is not None:
            counts = ", ".join(f"{count} {verdict.value}" for verdict, count in self._counts.items() if count)
            self._bar.update(self._task, completed=done, last=f"{left}  {counts}")

    def step(self, done: int, text: str = "") -> None:
        """Show progress of work that has no cases."""
        if self._bar is not None:
            self._bar.update(self._task, completed=done, last=text)
