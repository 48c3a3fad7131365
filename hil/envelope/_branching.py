"""Copies of a running bench: the process is forked at the end of an application cycle.

A virtual bench is one thread in one process, so a fork is a copy of all of it. The copy goes on in the middle
of the test code, with the stimulus applied; it ends when its time is over, whatever the test code does
meanwhile.
"""

from __future__ import annotations

import contextlib
import gc
import os
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NoReturn

from fieldbus.clock import seconds_to_ns
from fieldbus.errors import HilError
from hil.envelope._copies import Copies, Job, Row
from hil.envelope._measures import (
    Range,
    display_factor,
    measure,
    motion_range,
    reaction_class,
    unit_of,
)
from hil.envelope._rest import RestWatch
from hil.errors import CannotRunError
from hil.expect import run_checkers
from hil.record import Carrier
from reports.model import Verdict

if TYPE_CHECKING:
    from hil.bench.bench import Bench
    from hil.envelope._motion import Motion
    from hil.envelope._stimulus import Stimulus
    from hil.protocols import BenchFile
    from hil.record import CarriedRecording, Trace


class _TimeIsOver(BaseException):
    """The copy has run as long as it is watched."""


class NotBranchableError(CannotRunError):
    """Only a bench in virtual time, on a system that can fork, can be copied."""


@dataclass(frozen=True)
class Course:
    """The undisturbed motion."""

    start_s: float
    cycle_s: float
    cycles: int
    """Application cycles of the motion: a copy can be made at the end of each."""
    ranges: Mapping[str, Range] = field(default_factory=dict)
    """By axis."""
    positions: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    """Position of the machine at every cycle, by axis, mm or deg."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Of the positions, by axis."""
    stops: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Mechanical end stops, by axis, mm or deg."""
    problem: str = ""
    """Why the motion does not work even undisturbed; empty: it does."""

    def time_s(self, cycle: int) -> float:
        """Return the time of the bench at which a cycle of the motion ends."""
        return self.start_s + cycle * self.cycle_s


@dataclass(frozen=True)
class Witness:
    """One branch, run alone: the same trace as in the copy."""

    trace: Trace
    row: Row


class Branching:
    """Runs a motion and branches off it.

    Args:
        bench_file: Bench in virtual time.
        motion: What is disturbed.
        stimuli: What copies are broken with.
        seed: Seed of the bench.
        watch_s: Time that a copy is watched after its stimulus, s.
        rest_s: End a copy as soon as its machines have been at rest for so long, s, without an enabled axis
            and without an event; None: watch it to the end.
        rules: Judge every copy by the rules that hold in every run.

    Raises:
        NotBranchableError: The system cannot fork.

    """

    def __init__(
        self,
        bench_file: BenchFile[Bench],
        motion: Motion,
        stimuli: list[Stimulus],
        *,
        seed: int,
        watch_s: float,
        rest_s: float | None,
        rules: bool,
    ) -> None:
        if not hasattr(os, "fork"):
            raise NotBranchableError("a stop envelope copies the process: this system cannot fork")
        self._bench_file = bench_file
        self._motion = motion
        self._stimuli = stimuli
        self._seed = seed
        self._watch_ns = seconds_to_ns(watch_s)
        self._rest_s = rest_s
        self._rules = rules

    # -- the undisturbed motion

    def course(self) -> Course:
        """Run the motion undisturbed.

        Raises:
            HilError: What goes before the motion fails.
            NotBranchableError: The bench is not in virtual time.

        """
        problem = ""
        with self._bench_file.build(seed=self._seed) as bench:
            if bench.kind != "virtual":
                raise NotBranchableError(
                    f"{self._bench_file.name}: a stop envelope needs a bench in virtual time; this one is "
                    f"{bench.kind!r}"
                )
            self._before(bench)
            start = bench.scheduler.now
            cycles: list[int] = []
            bench.on_cycle(lambda: cycles.append(bench.scheduler.now))
            try:
                self._motion.body(bench)
            except (HilError, AssertionError) as error:
                problem = str(error)
            trace = bench.trace()
            first_s = (cycles[0] if cycles else start) * 1e-9
            drives = drives_of(bench)
            instants = [time_ns * 1e-9 for time_ns in cycles]
            ranges = {
                axis: motion_range(trace, drive, start * 1e-9, trace.end_s) for axis, drive in drives.items()
            }
            factor = {axis: display_factor(trace[f"{drive}.position"].unit) for axis, drive in drives.items()}
            return Course(
                start_s=first_s,
                cycle_s=(cycles[1] - cycles[0]) * 1e-9 if len(cycles) > 1 else bench.cycle_ns * 1e-9,
                cycles=len(cycles),
                ranges=ranges,
                positions={
                    axis: tuple(trace[f"{drive}.position"].at(one) * factor[axis] for one in instants)
                    for axis, drive in drives.items()
                },
                units={axis: unit_of(trace[f"{drive}.position"].unit) for axis, drive in drives.items()},
                stops={
                    axis: (
                        trace.constants[f"{drive}.negative_stop"] * factor[axis],
                        trace.constants[f"{drive}.positive_stop"] * factor[axis],
                    )
                    for axis, drive in drives.items()
                    if f"{drive}.negative_stop" in trace.constants
                },
                problem=problem,
            )

    def refusals(self) -> dict[int, str]:
        """Return why the bench cannot take a stimulus, by its number."""
        refused: dict[int, str] = {}
        with self._bench_file.build(seed=self._seed) as bench:
            for number, stimulus in enumerate(self._stimuli):
                try:
                    stimulus.check(bench)
                except HilError as error:
                    refused[number] = str(error)
        return refused

    def _before(self, bench: Bench) -> None:
        if self._motion.before is not None:
            self._motion.before(bench)

    # -- copies

    def run(
        self,
        jobs: Iterable[Job],
        course: Course,
        processes: int,
        on_row: Callable[[Row], object],
        *,
        until: float | None = None,
    ) -> None:
        """Branch off.

        Args:
            jobs: Cycle and stimulus.
            course: The undisturbed motion.
            processes: Copies that run at the same time.
            on_row: Told the row of every job, as the copies end.
            until: Value of `time.monotonic` after which no further copy is made; None: all are made.

        """
        wanted: dict[int, list[int]] = {}
        for cycle, number in sorted(jobs):
            wanted.setdefault(cycle, []).append(number)
        if not wanted:
            return
        last = max(wanted)
        with self._bench_file.build(seed=self._seed) as bench:
            self._before(bench)
            drives = drives_of(bench)
            carrier = Carrier(bench.recorder, bench.vocabulary)

            def judge(job: Job, problem: str, recording: CarriedRecording) -> Row:
                return self._row(carrier.trace(recording), drives, job, course, problem)

            copies = Copies(processes, judge, on_row)
            at = 0

            def branch() -> None:
                nonlocal at
                if copies.child is not None:
                    return
                if at in wanted:
                    carrier.pack()
                for number in wanted.get(at, ()):
                    if until is not None and time.monotonic() >= until:
                        raise _TimeIsOver
                    if copies.fork((at, number)):
                        self._go_on(bench, copies, (at, number), carrier)
                        return
                at += 1
                if at > last:
                    raise _TimeIsOver

            # Fewer pages are copied when the collector leaves what is there alone.
            gc.collect()
            gc.freeze()
            bench.on_cycle(branch)
            try:
                self._run_motion(bench, copies)
                copies.wait()
            finally:
                gc.unfreeze()
                copies.stop()

    def _run_motion(self, bench: Bench, copies: Copies) -> None:
        """Run the motion; in a copy it ends the process."""
        problem = ""
        try:
            # It fails because it was disturbed.
            with contextlib.suppress(HilError, AssertionError):
                self._motion.body(bench)
            if copies.child is not None:
                bench.run_for((self._watch_ns + seconds_to_ns(1.0)) * 1e-9)
        except _TimeIsOver:
            pass
        except BaseException as error:
            if copies.child is None:
                raise
            problem = f"{type(error).__name__}: {error}"
        if copies.child is not None:
            copies.child.end(problem)

    def _go_on(self, bench: Bench, copies: Copies, job: Job, carrier: Carrier) -> None:
        """Apply the stimulus in the copy, and let the copy end after its time."""
        assert copies.child is not None
        bench.recorder.hold()
        copies.child.recording = lambda: carrier.recording(bench.scheduler.now)
        try:
            self._disturb(bench, job)
        except HilError as error:
            copies.child.end(str(error))

    def _disturb(self, bench: Bench, job: Job) -> None:
        def over() -> NoReturn:
            raise _TimeIsOver

        begin_ns = bench.scheduler.now
        bench.scheduler.at(begin_ns + self._watch_ns, over, priority=1_000)
        stimulus = self._stimuli[job[1]]
        stimulus.apply(bench)
        if self._rest_s is None:
            return
        drives = drives_of(bench)
        units = {group.name: dict(group.columns).get("position", "") for group in bench.recorder.groups}
        rest = RestWatch(
            bench.recorder,
            bench.history,
            drives=drives,
            units=units,
            axes=tuple(bench.config.axis),
            rest_s=self._rest_s,
            begin_ns=begin_ns + seconds_to_ns(stimulus.duration_s or 0.0),
        )

        def watch() -> None:
            if rest.is_over(bench.scheduler.now):
                raise _TimeIsOver

        bench.on_cycle(watch)

    def _row(self, trace: Trace, drives: Mapping[str, str], job: Job, course: Course, problem: str) -> Row:
        """Return what a trace tells of its branch; `drives`: of every axis whose machine is emulated."""
        cycle, number = job
        at_s = course.time_s(cycle)
        broken = []
        if self._rules:
            broken = [check for check in run_checkers(trace) if check.verdict is Verdict.FAILED]
        watched_s = trace.end_s - at_s if problem else self._watch_ns * 1e-9
        found = {
            axis: measure(trace, drive, at_s, course.ranges[axis], watched_s)
            for axis, drive in drives.items()
        }
        return {
            "cycle": cycle,
            "stimulus": number,
            "reaction": problem or reaction_class(trace, list(drives), at_s, broken),
            "error": problem,
            "broken": [f"{check.name}: {check.observed}" for check in broken],
            "measures": {axis: measures for axis, (measures, _) in found.items()},
            "rest": {axis: place for axis, (_, place) in found.items()},
            "digest": trace.digest(),
        }

    # -- one branch alone

    def witness(self, job: Job, course: Course) -> Witness:
        """Run one branch in this process, without a copy."""
        problem = ""
        with self._bench_file.build(seed=self._seed) as bench:
            try:
                self.disturbed(bench, job)
            except Exception as error:  # noqa: BLE001 - as in a copy
                problem = f"{type(error).__name__}: {error}"
            trace = bench.trace()
            return Witness(trace, self._row(trace, drives_of(bench), job, course, problem))

    def disturbed(self, bench: Bench, job: Job) -> None:
        """Run one branch on a bench that was just built: what a copy does from the start of the motion on.

        Raises:
            Exception: Of the test code, but for refusals and failed assertions, which the stimulus may cause.

        """
        cycle, _ = job
        self._before(bench)
        at = 0

        def disturb() -> None:
            nonlocal at
            if at == cycle:
                self._disturb(bench, job)
            at += 1

        bench.on_cycle(disturb)
        with contextlib.suppress(_TimeIsOver):
            with contextlib.suppress(HilError, AssertionError):
                self._motion.body(bench)
            bench.run_for((self._watch_ns + seconds_to_ns(1.0)) * 1e-9)


def drives_of(bench: Bench) -> dict[str, str]:
    """Return the drive of every axis whose machine is emulated."""
    return {
        name: section.drive
        for name, section in bench.config.axis.items()
        if section.drive and bench.recorder.has_signal(f"{section.drive}.position")
    }
