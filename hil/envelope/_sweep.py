"""The sweep: passes over a motion until every wanted branch is there."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, Self

from fieldbus.errors import ConfigurationError, UnknownNameError
from hil._workers import number_of_processes
from hil.campaign import load_bench_file
from hil.envelope._adaptive import Grid
from hil.envelope._branching import Branching, Course, Witness
from hil.envelope._copies import Job, Row
from hil.envelope._motion import Body, Motion, motion_of
from hil.envelope._parts import Part, run_on_cluster
from hil.envelope._result import Branch, Envelope
from hil.envelope._stimulus import Stimulus, stimulus_from_text
from hil.errors import CannotRunError

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.protocols import BenchFile

JOURNAL_FILE: Final = "branches.jsonl"
RunJobs = Callable[[Sequence[Job], Callable[[Row], object]], None]
"""Runs branches; tells the row of each."""
OnBranch = Callable[[int, int], object]
"""Called after every branch: how many are done, how many are planned so far."""


def sweep(
    bench: str | Path | BenchFile[Bench],
    motion: Body | Motion,
    stimuli: Sequence[str | Stimulus],
    *,
    before: Body | None = None,
    every: int = 1,
    seed: int = 1,
    watch_s: float = 1.0,
    rest_s: float | None = None,
    rules: bool = True,
    jobs: int = 0,
    cluster: str = "",
    budget_s: float | None = None,
    guards: Mapping[str, Sequence[float]] | None = None,
    folder: str | Path | None = None,
    resume: bool = False,
    name: str = "",
    on_branch: OnBranch | None = None,
) -> Envelope:
    """Run a motion, and break it at its cycles.

    Args:
        bench: Bench file, embedded name or `module:NAME`; in virtual time.
        motion: Test code that moves: it is copied at the end of its application cycles. Or a `Motion`, which
            has its `before` and its name.
        stimuli: What copies are broken with: `drive.fault:code=0x2310`, `operator.disable`, or `Stimulus`.
        before: Test code that brings the bench to the start of the motion.
        every: A copy at every so many cycles; 0: coarse first, then between neighbours that differ.
        seed: Seed of the bench.
        watch_s: Time that a copy is watched after its stimulus, s.
        rest_s: End a copy as soon as its machines have been at rest for so long, s, without an enabled axis
            and without an event: faster, and blind for what comes later. None: watch it to the end.
        rules: Judge every copy by the rules that hold in every run.
        jobs: Copies at the same time; 0: one for every processor. The result does not depend on it.
        cluster: Address of a dask scheduler, on whose workers the branches run; bench and motion are found
            there by the same names as here. Empty: on this machine.
        budget_s: Wall time after which no further branch is begun, on a cluster no further part of 256;
            None: no limit.
        guards: Positions that the machine of an axis must not reach, by axis (empty: the first one), mm or
            deg: a fence, a fixture. `Envelope.margins` has what is left to them and to the end stops.
        folder: Keep what is done here as it is done, and the result; None: in memory only.
        resume: Go on with the branches in the folder.
        name: Name of the motion in the result; empty: that of the function.
        on_branch: Told after every branch.

    Returns:
        The envelope; the same for the same arguments, but for `jobs`, `cluster`, `folder` and `resume`.

    Raises:
        ConfigurationError: A stimulus cannot be read, there is none, or a time is no time.
        NotBranchableError: The bench is not in virtual time, or the system cannot fork.
        CannotRunError: The motion does not work undisturbed, the bench can take none of the stimuli, the
            folder has another envelope, or there is no such cluster.

    """
    if not watch_s > 0.0:
        raise ConfigurationError("watch_s", watch_s, "a time above 0 s")
    if rest_s is not None and not rest_s > 0.0:
        raise ConfigurationError("rest_s", rest_s, "a time above 0 s")
    given = [one if isinstance(one, Stimulus) else stimulus_from_text(one) for one in stimuli]
    given = list(dict.fromkeys(given))
    if not given:
        raise ConfigurationError("stimuli", "", "at least one fault or operator action")
    chosen = motion if isinstance(motion, Motion) else motion_of(motion, before, name)
    reference = str(bench) if isinstance(bench, str | Path) else ""
    if cluster and not (reference and chosen.reference):
        raise CannotRunError(
            "workers of a cluster find bench and motion by name: give the bench as a name or path, and "
            "functions at the top level of a file"
        )
    file = load_bench_file(reference) if isinstance(bench, str | Path) else bench
    branching = Branching(file, chosen, given, seed=seed, watch_s=watch_s, rest_s=rest_s, rules=rules)
    course = branching.course()
    if course.problem:
        raise CannotRunError(f"{chosen.name} does not work undisturbed: {course.problem}")
    if not course.cycles:
        raise CannotRunError(f"{chosen.name} takes no time: there is nothing to branch off")
    places: dict[str, tuple[float, ...]] = {}
    for axis, some in (guards or {}).items():
        name_of_axis = axis or next(iter(course.ranges), "")
        if name_of_axis not in course.ranges:
            raise UnknownNameError("guards", axis, "an axis with an emulated machine", list(course.ranges))
        places[name_of_axis] = (*places.get(name_of_axis, ()), *map(float, some))
    refused = branching.refusals()
    texts = [str(one) for one in given]
    facts = {
        "bench": file.name,
        "bench_digest": file.digest,
        "motion": chosen.name,
        "seed": seed,
        "watch_s": watch_s,
        "rest_s": rest_s,
        "rules": rules,
        "stimuli": texts,
        "cycles": course.cycles,
    }

    if len(refused) == len(given):
        reasons = "; ".join(f"{texts[number]}: {reason}" for number, reason in refused.items())
        raise CannotRunError(f"the bench can take none of the stimuli: {reasons}")
    until = None if budget_s is None else time.monotonic() + budget_s

    def here(wanted: Sequence[Job], on_row: Callable[[Row], object]) -> None:
        branching.run(wanted, course, number_of_processes(jobs), on_row, until=until)

    def there(wanted: Sequence[Job], on_row: Callable[[Row], object]) -> None:
        run_on_cluster(cluster, part, wanted, on_row)

    def part(some: Sequence[Job]) -> Part:
        return Part(
            reference, file.digest, chosen.reference, given, seed, watch_s, rest_s, rules, course, some
        )

    with _Journal(None if folder is None else Path(folder), facts, resume=resume) as journal:
        skipped = _passes(
            there if cluster else here,
            course,
            journal,
            grid=Grid(every),
            numbers=[number for number in range(len(given)) if number not in refused],
            until=until,
            in_parts=bool(cluster) and until is not None,
            on_branch=on_branch,
            texts=texts,
        )
        rows = journal.rows
    envelope = Envelope(
        bench=file.name,
        bench_digest=file.digest,
        motion=chosen.name,
        source={"bench": reference, "motion": chosen.reference} if reference and chosen.reference else {},
        seed=seed,
        watch_s=watch_s,
        rest_s=rest_s,
        start_s=course.start_s,
        cycle_s=course.cycle_s,
        cycles=course.cycles,
        stimuli=tuple(text for number, text in enumerate(texts) if number not in refused),
        refused={texts[number]: reason for number, reason in refused.items()},
        skipped=skipped,
        axes=tuple(course.ranges),
        units=course.units,
        positions=course.positions,
        stops=course.stops,
        guards=places,
        branches=tuple(
            _branch(rows[job], texts, course) for job in sorted(rows, key=lambda job: (job[1], job[0]))
        ),
    )
    if folder is not None:
        envelope.save(folder)
    return envelope


def witness(
    bench: str | Path | BenchFile[Bench],
    motion: Body | Motion,
    stimulus: str | Stimulus,
    cycle: int,
    *,
    before: Body | None = None,
    seed: int = 1,
    watch_s: float = 1.0,
    rest_s: float | None = None,
    rules: bool = True,
) -> Witness:
    """Run one branch alone, without a copy; its trace has the digest of the branch.

    Raises:
        ConfigurationError: The stimulus cannot be read, or the motion has no such cycle.

    """
    given = stimulus if isinstance(stimulus, Stimulus) else stimulus_from_text(stimulus)
    file = load_bench_file(str(bench)) if isinstance(bench, str | Path) else bench
    chosen = motion if isinstance(motion, Motion) else motion_of(motion, before)
    branching = Branching(file, chosen, [given], seed=seed, watch_s=watch_s, rest_s=rest_s, rules=rules)
    course = branching.course()
    if not 0 <= cycle < course.cycles:
        raise ConfigurationError("cycle", cycle, f"0 to {course.cycles - 1}, the cycles of the motion")
    return branching.witness((cycle, 0), course)


def _passes(
    run_jobs: RunJobs,
    course: Course,
    journal: _Journal,
    *,
    grid: Grid,
    numbers: Sequence[int],
    until: float | None,
    in_parts: bool,
    on_branch: OnBranch | None,
    texts: Sequence[str],
) -> int:
    """Run passes until nothing is left; returns how many planned branches were left out."""
    planned: set[Job] = {(cycle, number) for cycle in grid.first(course.cycles) for number in numbers}
    while True:
        open_jobs = sorted(planned - journal.rows.keys())
        if open_jobs and until is not None and time.monotonic() >= until:
            return len(open_jobs)
        for part in _parts(open_jobs, whole=not in_parts):
            if until is not None and time.monotonic() >= until:
                break

            def take(row: Row, most: int = len(planned)) -> None:
                journal.add(row)
                if on_branch is not None:
                    on_branch(len(journal.rows), most)

            run_jobs(part, take)
        if planned - journal.rows.keys():
            return len(planned - journal.rows.keys())
        by_stimulus: dict[int, list[Branch]] = {number: [] for number in numbers}
        for (_, number), row in sorted(journal.rows.items()):
            if number in by_stimulus:
                by_stimulus[number].append(_branch(row, texts, course))
        further = set(grid.next(by_stimulus)) - planned
        if not further:
            return 0
        planned |= further


def _parts(jobs: Sequence[Job], *, whole: bool) -> Iterable[Sequence[Job]]:
    """Yield jobs in parts between which the time is looked at; each part runs the motion from its start."""
    size = len(jobs) if whole else 256
    for first in range(0, len(jobs), max(size, 1)):
        yield jobs[first : first + size]


def _branch(row: Row, texts: Sequence[str], course: Course) -> Branch:
    cycle, number = _job_of(row)
    return Branch(
        cycle=cycle,
        time_s=round(course.time_s(cycle) - course.start_s, 9),
        stimulus=texts[number],
        reaction=row["reaction"],
        measures=row["measures"],
        rest=row["rest"],
        broken=tuple(row["broken"]),
        error=row["error"],
        digest=row["digest"],
    )


def _job_of(row: Row) -> Job:
    return row["cycle"], row["stimulus"]


class _Journal:
    """The branches that are done; in a folder they outlive the process."""

    def __init__(self, folder: Path | None, facts: dict[str, object], *, resume: bool) -> None:
        self.rows: dict[Job, Row] = {}
        self._file = None
        if folder is None:
            return
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / JOURNAL_FILE
        head = json.dumps(facts, sort_keys=True)
        if resume and path.exists():
            self._load(path, head)
        else:
            path.write_text(head + "\n", encoding="utf-8")
        self._file = path.open("ab")

    def _load(self, path: Path, head: str) -> None:
        content = path.read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        first, *lines = whole.decode("utf-8").splitlines() or [""]
        if first != head:
            raise CannotRunError(
                f"{path}: these are the branches of another envelope: bench, motion, stimuli or times differ"
            )
        for line in lines:
            row = json.loads(line)
            self.rows[_job_of(row)] = row
        if whole != content:
            # The last line was cut off when the process was killed.
            os.truncate(path, len(whole))

    def add(self, row: Row) -> None:
        """Keep a branch."""
        self.rows[_job_of(row)] = row
        if self._file is not None:
            self._file.write(json.dumps(row, sort_keys=True).encode() + b"\n")
            self._file.flush()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._file is not None:
            self._file.close()
