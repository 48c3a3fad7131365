"""Output of the commands: JSON alone on standard output, everything for people on standard error."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Iterator, Mapping
from types import TracebackType
from typing import TYPE_CHECKING, Final, Self, TextIO

from reports.model import CaseResult, Verdict

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

_STYLE = {Verdict.PASSED: "green", Verdict.FAILED: "red", Verdict.BLOCKED: "yellow", Verdict.ERROR: "magenta"}


def console() -> Console:
    """Return a console on standard error."""
    from rich.console import Console

    return Console(stderr=True, highlight=False, soft_wrap=True)


def print_json(value: object) -> None:
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


_QUIET_S: Final = 30.0
"""After so long without a line a run that is not watched says how far it is."""


class CaseProgress:
    """Progress of long work: a bar on a terminal; elsewhere a line for each group of cases, and for each case
    that did not pass.

    Args:
        total: Number of cases or steps.
        title: What they are.
        groups: Number of cases of each group; a group gets its line when so many have ended.
        verbose: A line for each case, wherever the output goes.

    """

    def __init__(
        self,
        total: int,
        title: str = "cases",
        *,
        groups: Mapping[str, int] | None = None,
        verbose: bool = False,
    ) -> None:
        self._total = total
        self._title = title
        self._groups = dict(groups or {})
        self._verbose = verbose
        self._console = console()
        self._bar: tuple[Progress, TaskID] | None = None
        self._counts = dict.fromkeys(Verdict, 0)
        self._open: dict[str, list[CaseResult]] = {}
        """Cases of the groups that have not got their line yet."""
        # Wall time, for the person who waits; it controls nothing.
        self._began = self._spoke = time.monotonic()
        self._finished = 0

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

            bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TextColumn("{task.fields[last]}"),
                console=self._console,
                transient=True,
            )
            bar.start()
            self._bar = bar, bar.add_task(self._title, total=self._total, last="")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar[0].stop()
        for group in list(self._open):
            self._tell_group(group)

    def case_done(self, result: CaseResult, done: int, total: int) -> None:
        """Show a finished case."""
        self._counts[result.verdict] += 1
        self._finished += 1
        left = time_left(time.monotonic() - self._began, self._finished, total - done)
        bad = result.verdict is not Verdict.PASSED
        if self._verbose or bad:
            width = len(str(total))
            line = f"{result.verdict.value:7} {result.identifier} ({result.wall_s:.2f} s)"
            line = f"[{done:{width}}/{total}] {line}"
            self._say(line if self._bar is not None or not left else f"{line} {left}", _STYLE[result.verdict])
        if bad and result.message:
            self._say(f"    {result.message}", "dim")
        if self._bar is not None:
            counts = ", ".join(f"{count} {verdict.value}" for verdict, count in self._counts.items() if count)
            bar, task = self._bar
            bar.update(task, completed=done, last=f"{left}  {counts}")
        elif not self._verbose:
            self._open.setdefault(result.group, []).append(result)
            if len(self._open[result.group]) == self._groups.get(result.group):
                self._tell_group(result.group)
            elif time.monotonic() - self._spoke > _QUIET_S:
                self._say(f"{done} of {total} {self._title} {left}".rstrip())

    def step(self, done: int, text: str = "") -> None:
        """Show progress of work that has no cases."""
        if self._bar is not None:
            bar, task = self._bar
            bar.update(task, completed=done, last=text)

    def _tell_group(self, group: str) -> None:
        cases = self._open.pop(group)
        counts = ", ".join(
            f"{count} {verdict.value}"
            for verdict in Verdict
            if (count := sum(case.verdict is verdict for case in cases))
        )
        good = all(case.verdict is Verdict.PASSED for case in cases)
        took = sum(case.wall_s for case in cases)
        self._say(f"{group or self._title}: {counts} ({took:.1f} s)", "green" if good else "")

    def _say(self, line: str, style: str = "") -> None:
        self._spoke = time.monotonic()
        self._console.print(line, style=style, markup=False)
