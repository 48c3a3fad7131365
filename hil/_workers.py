"""Worker processes for cases and seeded defects.

A task travels to a process over a socket of its own, and each answer comes back at once. A process that dies,
or does not answer in time, costs only its own task. No process outlives the command, because it ends when the
other end of its socket is closed, also when the command was killed.

No library does this. A task has many answers, each with a time limit of its own. The workers of dask are
daemonic, and from those `multiprocessing`, which pebble, loky and `concurrent.futures` build on, starts no
process. A defect needs a fresh process, and pebble polls every 0.1 s for its end: 60 tasks of 20 ms, each in
a fresh process, took 12.6 s on two workers of it.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkServerContext, SpawnContext
from typing import Final, Generic, Literal, Protocol, Self, TypeVar

from hil._interrupt import held
from hil._processor_time import processor_time_s
from hil.errors import CannotRunError, HilError
from reports.processors import processors

_LONGEST_WAIT_S: Final = 3600.0
"""Waits are made of such pieces: the system limits the length of one."""
_END_S: Final = 5.0
"""Time that a process has to end by itself once it is not needed any more."""
_PROCESS: Final = "the process that ran this case"
_MOVES_S: Final = 0.05
"""Processor time that a process has to use to be seen to move, s."""
_LOOK_AGAIN_S: Final = 0.2
"""Least time after which the processor time of a process is looked at again, s."""


class Task(Protocol):
    """What a process does; it travels by pickle."""

    def run(self, send: Callable[[object], None]) -> None:
        """Do it, in the process, and send each answer as soon as it is known.

        Raises:
            HilError: It cannot be done; the text goes to the command.

        """

    def patience(self, answers: int) -> float:
        """Return the time for the next answer, or for the end, after so many answers, s.

        It is wall time, unless the pool counts processor time.
        """


TaskT = TypeVar("TaskT", bound=Task)
AnswerT = TypeVar("AnswerT")


@dataclass(frozen=True)
class Answer(Generic[TaskT, AnswerT]):
    """An answer of a task."""

    task: TaskT
    value: AnswerT


@dataclass(frozen=True)
class Ended(Generic[TaskT]):
    """The end of a task."""

    task: TaskT
    how: Literal["done", "failed", "died", "hung"]
    """`failed`: the task raised an exception; `died`: its process ended; `hung`: its process was killed."""
    reason: str = ""
    """Empty when it is done."""


@dataclass(frozen=True)
class _Over:
    """Last message of a process about a task."""

    error: str = ""


def number_of_processes(jobs: int) -> int:
    """Return how many worker processes `jobs` asks for; 0: one for every processor.

    Raises:
        CannotRunError: It is negative.

    """
    if jobs < 0:
        raise CannotRunError(
            f"{jobs} worker processes are not possible; give 1 or more, or 0 for all processors"
        )
    return jobs or processors()


class Worker:
    """A process that runs tasks.

    Args:
        connection: To `serve` in the process.
        pid: Number of the process.
        kill: Ends the process at once.
        wait: Waits for its end, at most so long, s; returns the exit code, None: it has not ended.

    """

    def __init__(
        self,
        connection: Connection,
        pid: int,
        kill: Callable[[], None],
        wait: Callable[[float], int | None],
    ) -> None:
        self.connection = connection
        self.pid = pid
        self._kill = kill
        self._wait = wait

    def kill(self) -> None:
        """End the process at once."""
        self.connection.close()
        self._kill()
        self._wait(_END_S)

    def close(self) -> None:
        """Let the process end; it has no task."""
        self.connection.close()
        if self._wait(_END_S) is None:
            self._kill()

    def cause_of_death(self) -> str:
        """Return how the process ended; one that only closed its socket is killed."""
        code = self._wait(_END_S)
        self.kill()
        if code is None:
            return f"{_PROCESS} answers no more"
        how = f"signal {-code}" if code < 0 else f"exit code {code}"
        return f"{_PROCESS} died: {how}"


def start_interpreter() -> Worker:
    """Start a process with a new interpreter, which finds modules where this one does."""
    ours, theirs = socket.socketpair()
    program = (
        f"import sys; sys.path[:] = {sys.path!r}; "
        f"from hil._workers import serve_handle; serve_handle({theirs.fileno()})"
    )
    with theirs, held():  # Ctrl-C is meant for the command
        process = subprocess.Popen(  # noqa: S603 - our own interpreter and program
            [sys.executable, "-c", program], pass_fds=(theirs.fileno(),), stdin=subprocess.DEVNULL
        )

    def end(timeout_s: float) -> int | None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            return process.wait(timeout_s)
        return None

    return Worker(Connection(ours.detach()), process.pid, process.kill, end)


class CopyStarter:
    """Starts processes as copies of one that has imported modules and run nothing.

    Where the system cannot do that, they are new interpreters.

    Args:
        modules: What it imports; modules that cannot be imported are left out.

    """

    def __init__(self, modules: Iterable[str]) -> None:
        self._context: ForkServerContext | SpawnContext = multiprocessing.get_context("spawn")
        if "forkserver" in multiprocessing.get_all_start_methods():
            self._context = multiprocessing.get_context("forkserver")
            self._context.set_forkserver_preload(list(modules))

    def __call__(self) -> Worker:
        """Start a process."""
        ours, theirs = self._context.Pipe()
        process = self._context.Process(target=_serve_copy, args=(theirs, list(sys.path)), daemon=True)
        with held():
            process.start()
        theirs.close()

        def end(timeout_s: float) -> int | None:
            process.join(timeout_s)
            code: int | None = process.exitcode
            return code

        assert process.pid is not None  # it has been started
        return Worker(ours, process.pid, process.kill, end)


@dataclass
class _Running(Generic[TaskT]):
    worker: Worker
    task: TaskT
    answers: int = 0
    due_s: float = 0.0
    used_s: float | None = None
    """Processor time when the answer before was given, s; None: wall time counts."""
    seen_s: float = 0.0
    """Processor time when the process was last seen to move, s."""
    moved_s: float = 0.0
    """When that was."""

    def wait_for_next(self, *, processor_time: bool) -> None:
        # Times of a process of the machine; nothing in a bench is controlled by them.
        now_s = time.monotonic()
        self.due_s, self.moved_s = now_s + self.task.patience(self.answers), now_s
        if processor_time:
            self.used_s = processor_time_s(self.worker.pid)
            self.seen_s = self.used_s or 0.0

    def too_late(self, standstill_s: float) -> str:
        """Return why the process has to be ended, now that it is due; empty: it gets more time."""
        patience_s = self.task.patience(self.answers)
        used_s = None if self.used_s is None else processor_time_s(self.worker.pid)
        if self.used_s is None or used_s is None:
            return f"{_PROCESS} did not answer for {patience_s:g} s and was ended"
        now_s = time.monotonic()
        if used_s - self.seen_s >= _MOVES_S:
            self.seen_s, self.moved_s = used_s, now_s
        rest_s, still_s = patience_s - (used_s - self.used_s), standstill_s - (now_s - self.moved_s)
        if rest_s <= 0.0:
            return f"{_PROCESS} did not answer for {patience_s:g} s of processor time and was ended"
        if still_s <= 0.0:
            return f"{_PROCESS} stood still for {standstill_s:g} s and was ended"
        self.due_s = now_s + max(min(rest_s, still_s), _LOOK_AGAIN_S)
        return ""


class Pool(Generic[TaskT, AnswerT]):
    """Runs tasks on up to `jobs` processes at the same time.

    Args:
        jobs: How many.
        start: Starts a process.
        reuse: Whether a process gets further tasks after its first.
        standstill_s: 0: the patience of a task is wall time. Else it is processor time, which a busy machine
            does not use up, and a process that uses none for so much wall time is ended, too. Where the
            system does not tell the processor time of a process, it is wall time.
        on_give: Told of every task that a process gets.

    """

    def __init__(
        self,
        jobs: int,
        start: Callable[[], Worker] = start_interpreter,
        *,
        reuse: bool = True,
        standstill_s: float = 0.0,
        on_give: Callable[[TaskT], object] | None = None,
    ) -> None:
        self._jobs = jobs
        self._start = start
        self._reuse = reuse
        self._standstill_s = standstill_s
        self._on_give = on_give
        self._waiting: deque[TaskT] = deque()
        self._idle: list[Worker] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        while self._idle:
            self._idle.pop().close()

    def add(self, task: TaskT) -> None:
        """Add a task to those of `run`; it is the next to be started."""
        self._waiting.appendleft(task)

    def run(self, tasks: Iterable[TaskT]) -> Generator[Answer[TaskT, AnswerT] | Ended[TaskT], None, None]:
        """Run tasks; give each answer and each end at once.

        Closing the iterator kills the processes that run tasks.
        """
        self._waiting = deque(tasks)
        running: dict[object, _Running[TaskT]] = {}
        try:
            while self._waiting or running:
                while self._waiting and len(running) < self._jobs:
                    one = self._give(self._waiting.popleft())
                    running[one.worker.connection] = one
                yield from self._next(running)
        finally:
            for one in running.values():
                one.worker.kill()

    def _give(self, task: TaskT) -> _Running[TaskT]:
        """Return a process that has got the task; idle ones that an earlier task has damaged are replaced."""
        while self._idle:
            worker = self._idle.pop()
            try:
                worker.connection.send(task)
            except OSError:
                worker.kill()
            else:
                break
        else:
            worker = self._start()
            with contextlib.suppress(OSError):  # it has died already, as the next message will say
                worker.connection.send(task)
        one = _Running(worker, task)
        one.wait_for_next(processor_time=self._standstill_s > 0.0)
        if self._on_give is not None:
            self._on_give(task)
        return one

    def _next(
        self, running: dict[object, _Running[TaskT]]
    ) -> Iterator[Answer[TaskT, AnswerT] | Ended[TaskT]]:
        """Wait for messages, deaths and the end of patience."""
        rest = min(one.due_s for one in running.values()) - time.monotonic()
        connections = [one.worker.connection for one in running.values()]
        for connection in wait(connections, min(max(rest, 0.0), _LONGEST_WAIT_S)):
            one = running[connection]
            try:
                message = one.worker.connection.recv()
            except (EOFError, OSError):
                del running[connection]
                yield Ended(one.task, "died", one.worker.cause_of_death())
                continue
            if not isinstance(message, _Over):
                one.answers += 1
                one.wait_for_next(processor_time=self._standstill_s > 0.0)
                yield Answer(one.task, message)
                continue
            del running[connection]
            if self._reuse:
                self._idle.append(one.worker)
            else:
                one.worker.kill()
            yield Ended(one.task, "failed" if message.error else "done", message.error)
        now = time.monotonic()
        for late, one in list(running.items()):
            if one.due_s <= now and (reason := one.too_late(self._standstill_s)):
                del running[late]
                one.worker.kill()
                yield Ended(one.task, "hung", reason)


# -- in the process


def serve_handle(handle: int) -> None:
    """Run tasks from the socket `handle`; the body of a new interpreter."""
    serve(Connection(handle))


def _serve_copy(connection: Connection, path: list[str]) -> None:
    sys.path[:] = path
    serve(connection)


def serve(connection: Connection) -> None:
    """Run tasks until the other end of the connection is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(2, 1)  # what cases print is for people: standard output belongs to the result of the command
    tasks: queue.SimpleQueue[Task] = queue.SimpleQueue()

    def listen() -> None:
        while True:
            try:
                tasks.put(connection.recv())
            except (EOFError, OSError):
                os._exit(0)  # the command has ended or was killed
            except BaseException:  # noqa: BLE001 - a task that cannot be read here
                traceback.print_exc()
                os._exit(1)

    threading.Thread(target=listen, name="tasks", daemon=True).start()
    while True:
        task = tasks.get()
        try:
            task.run(connection.send)
            over = _Over()
        except HilError as error:
            over = _Over(str(error) or type(error).__name__)
        except BaseException:  # noqa: BLE001 - whatever it is, the command has to know
            over = _Over(traceback.format_exc())
        with contextlib.suppress(OSError):
            connection.send(over)
