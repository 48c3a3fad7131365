"""What happens in the process of one mutant: switch it on, run cases, tell about each. The process serves
nobody else.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from typing import Final

from hil._processor_time import own_processor_time_s
from hil._workers import Answer, Pool
from hil.campaign import CaseSettings, case_seed, execute_case, load_campaign
from hil.campaign._limits import USED_UP, limit_processor
from hil.campaign._worker import bench_of
from hil.errors import CaseEndedError, CaseTimeoutError
from hil.mutants._marks import Marks, packed
from hil.mutants._mutant import Mutant
from hil.mutants._patch import Patch
from hil.mutants._plan import Judge
from hil.mutants._tests import is_test_file, run_test_file
from reports.model import CaseResult, Check, Verdict

START_LIMIT_S: Final = 120.0
"""Processor time within which a process has to be ready for its first case, s."""
RESERVE_S: Final = 5.0
"""Processor time that a case gets beyond its limit to end itself, before its process is killed, s."""
_NO_LIMIT_S: Final = 1e7
MEMORY_LIMIT: Final = 6 << 30
"""Address space of a worker, bytes: a defect that allocates without end shall not take the machine along."""


@dataclass(frozen=True)
class Outcome:
    """How a case ended in a worker."""

    judge: Judge
    verdict: str
    """`passed`, `failed`, `blocked`, `error`, `hung` or `crashed`."""
    message: str
    seconds: float
    """Processor time, s."""
    reached: frozenset[str]
    """Names of the mutants whose changed statement was reached."""
    marks: Mapping[str, bytes] = field(default_factory=dict)
    """Marks of the product that it passed, by module, eight to a byte; of a case without a defect."""
    requirements: tuple[str, ...] = ()
    """Identifiers that the failed checks name; none: it was noticed by accident."""
    check: str = ""
    """Name of the first check that failed; empty: none has, the case ended in another way."""
    rule: bool = False
    """Whether that is a rule that holds in every run."""
    trace: str = ""
    """Digest of its trace; empty: it has none."""

    @property
    def catches(self) -> bool:
        """Whether a case that is green without the defect is not green with it; blocked counts, as its bench
        came up before.
        """
        return self.verdict != "passed"

    @property
    def red(self) -> bool:
        """Whether it is red in the baseline; a case that its bench cannot have is
        blocked there, and judges nothing.
        """
        return self.verdict not in {"passed", "blocked"}


@dataclass(frozen=True)
class Task:
    """Cases of one defect; it travels to a process and needs a fresh one."""

    judges: tuple[Judge, ...]
    seed: int
    mutant: Mutant | None
    """The defect that is judged; None: the product as it is."""
    code: Patch | Marks
    """Its code; without a defect: that of the product with marks, or that tells where defects make a
    difference.
    """
    stop_at_first: bool = True
    limits_s: tuple[float, ...] = ()
    """Limit of processor time of each case, s; the case ends itself at it, and the parent ends the process a
    little later. A process that stands still is ended, too.
    """

    def run(self, send: Callable[[Outcome | None], None]) -> None:
        """Change the code, send None, run the cases and send an outcome for each."""
        _limit_memory()
        if isinstance(self.code, Marks):
            with self.code.applied() as arrays:
                self._run_marked(self.code, arrays, send)
            return
        reached: set[str] = set()
        with self.code.applied(reached):
            send(None)
            for judge, limit_s in zip(self.judges, self.limits_s, strict=True):
                reached.clear()
                outcome = replace(_judge(self, judge, limit_s), reached=frozenset(reached))
                send(outcome)
                if outcome.catches and self.stop_at_first:
                    return

    def _run_marked(
        self, marks: Marks, arrays: list[bytearray], send: Callable[[Outcome | None], None]
    ) -> None:
        send(None)
        for judge, limit_s in zip(self.judges, self.limits_s, strict=True):
            for array in arrays:
                array[:] = bytes(len(array))
            outcome = _judge(self, judge, limit_s)
            found = {
                one.name: packed(array)
                for one, array in zip(marks.modules, arrays, strict=True)
                if any(array)
            }
            send(replace(outcome, marks=found))

    def patience(self, answers: int) -> float:
        """Return the processor time for the start of the process, then for each case, s."""
        index = answers - 1
        limit_s = self.limits_s[index] if 0 <= index < len(self.limits_s) else START_LIMIT_S
        return limit_s + RESERVE_S


def _limit_memory() -> None:
    try:
        import resource
    except ImportError:  # not on this system
        return
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    if hard == resource.RLIM_INFINITY or hard > MEMORY_LIMIT:
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, hard))


def _judge(task: Task, judge: Judge, limit_s: float) -> Outcome:
    if is_test_file(judge):
        changed = None if task.mutant is None else task.mutant.requirements
        verdict, message, seconds, broken = run_test_file(judge, changed)
        return Outcome(judge, verdict, message, seconds, frozenset(), requirements=broken)
    started = own_processor_time_s()
    try:
        # A machine that is busy with other things makes no case slow: the limit is processor time.
        case = replace(load_campaign(judge.campaign)[judge.identifier], wall_limit_s=_NO_LIMIT_S)
        bench = bench_of(judge.bench)
    except Exception as error:  # without the defect both could be loaded
        if task.mutant is None:
            raise
        text = f"{type(error).__name__}: {error}"
        return Outcome(judge, "crashed", text, own_processor_time_s() - started, frozenset())
    settings = CaseSettings(seed=case_seed(task.seed, judge.identifier))
    try:
        with limit_processor(limit_s):
            result = execute_case(case, bench, settings).result
    except (CaseTimeoutError, CaseEndedError) as error:  # while the result was being written down
        return Outcome(judge, "hung", str(error), own_processor_time_s() - started, frozenset())
    hung = result.verdict is Verdict.ERROR and result.message.startswith(USED_UP)
    failed = [check for check in result.checks if check.verdict is Verdict.FAILED]
    return Outcome(
        judge=judge,
        verdict="hung" if hung else result.verdict.value,
        message=result.message,
        seconds=own_processor_time_s() - started,
        reached=frozenset(),
        requirements=_broken(result, failed),
        check=failed[0].name if failed else "",
        rule=bool(failed) and failed[0].rule,
        trace=result.trace_digest,
    )


def _broken(result: CaseResult, failed: Sequence[Check]) -> tuple[str, ...]:
    """Return the requirements of the checks that failed; those of the case where a check names none."""
    named = dict.fromkeys(one for check in failed for one in check.requirements)
    if failed and not named and not all(check.rule for check in failed):
        named = dict.fromkeys(result.requirements)
    return tuple(named)


@dataclass
class Finished:
    """A task that has ended."""

    task: Task
    outcomes: list[Outcome] = field(default_factory=list)
    error: str = ""
    """Why it could not be done; empty when it could."""

    def rest(self) -> Task | None:
        """Return the cases that are left after a process was lost; None: there are none."""
        task, done = self.task, len(self.outcomes)
        if done >= len(task.judges) or (self.outcomes[-1].catches and task.stop_at_first):
            return None
        return replace(task, judges=task.judges[done:], limits_s=task.limits_s[done:])

    def lose(self, how: str, reason: str) -> None:
        """Note the case whose process died or hung."""
        task, done = self.task, len(self.outcomes)
        if done < len(task.judges):
            verdict = "hung" if how == "hung" else "crashed"
            seconds = task.limits_s[done] if how == "hung" else 0.0
            names = frozenset() if task.mutant is None else frozenset({task.mutant.name})
            self.outcomes.append(Outcome(task.judges[done], verdict, reason, seconds, names))


def run_tasks(pool: Pool[Task, Outcome | None], tasks: Iterable[Task]) -> Generator[Finished, None, None]:
    """Run tasks and give each as it ends; the rest of one whose process was lost goes to another process."""
    found = [Finished(task) for task in tasks]
    by_part = {id(one.task): one for one in found}
    with closing(pool.run([one.task for one in found])) as events:
        for event in events:
            one = by_part[id(event.task)]
            if isinstance(event, Answer):
                if event.value is not None:
                    one.outcomes.append(event.value)
                continue
            if event.how == "failed":
                one.error = event.reason
            elif event.how != "done":
                one.lose(event.how, event.reason)
                if (rest := one.rest()) is not None:
                    by_part[id(rest)] = one
                    pool.add(rest)
                    continue
            yield one
