"""Parts of a sweep that run on the workers of a dask scheduler."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from typing import Final

from hil._workers import Answer
from hil.campaign._cluster import on_cluster, process_of_thread
from hil.campaign._worker import bench_of
from hil.envelope._branching import Branching, Course
from hil.envelope._copies import WALL_LIMIT_S, Job, Row
from hil.envelope._motion import Reference, motion_from
from hil.envelope._stimulus import Stimulus
from hil.errors import CannotRunError

_PART: Final = 64
"""Branches of a part: each part runs the motion from its start to its last cycle."""


@dataclass(frozen=True)
class Part:
    """Branches that one worker runs, with all that it needs to know."""

    bench: str
    bench_digest: str
    motion: Reference
    stimuli: Sequence[Stimulus]
    seed: int
    watch_s: float
    rest_s: float | None
    rules: bool
    course: Course
    jobs: Sequence[Job]

    def run(self, send: Callable[[object], None]) -> None:
        """Run the branches, and send the row of each as soon as it has ended.

        Raises:
            CannotRunError: The bench file or the motion here is another one, or is missing.

        """
        file = bench_of(self.bench)
        if file.digest != self.bench_digest:
            raise CannotRunError(f"the bench {self.bench!r} is another one here: its text differs")
        branching = Branching(
            file,
            motion_from(self.motion),
            list(self.stimuli),
            seed=self.seed,
            watch_s=self.watch_s,
            rest_s=self.rest_s,
            rules=self.rules,
        )
        branching.run(self.jobs, self.course, 1, send)

    def patience(self, answers: int) -> float:
        """Return the wall time for the next row, s: the first comes after the motion has run so far."""
        return 2.0 * WALL_LIMIT_S if answers else 10.0 * WALL_LIMIT_S


def run_part(part: Part) -> list[Row] | str:
    """Run a part on the process of this thread of a worker; returns the reason if it was lost."""
    rows: list[Row] = []
    for event in process_of_thread().run([part]):
        if isinstance(event, Answer):
            rows.append(event.value)
        elif event.how != "done":
            return event.reason
    return rows


def run_on_cluster(
    address: str, part: Callable[[Sequence[Job]], Part], jobs: Iterable[Job], on_row: Callable[[Row], object]
) -> None:
    """Run branches on a cluster.

    Args:
        address: Of the dask scheduler.
        part: Makes a part of branches.
        jobs: Cycle and stimulus, by cycle.
        on_row: Told the row of every branch.

    Raises:
        CannotRunError: There is no cluster, or a part was lost.

    """
    every = list(jobs)
    parts = [part(every[first : first + _PART]) for first in range(0, len(every), _PART)]
    with closing(on_cluster(address, run_part, parts)) as outcomes:
        for _, outcome in outcomes:
            if isinstance(outcome, str):
                raise CannotRunError(f"a part of the envelope was lost: {outcome}")
            for row in outcome:
                on_row(row)
