"""The processes of a sweep: copies of the bench that run a branch each, and judges of what they recorded.

A copy shares its memory with the process that it was made from; the system copies every page that is written
to, and in Python reading an object writes to it. Judging touches some hundred pages, which takes as long as
judging itself. So a copy only runs the bench and sends its recording; a judge is a process that stays, and
has touched its pages once.
"""

from __future__ import annotations

import contextlib
import fcntl
import gc
import json
import os
import pickle
import selectors
import signal
import struct
import sys
import warnings
from collections.abc import Callable
from multiprocessing import Pipe
from typing import TYPE_CHECKING, Final, NoReturn, TypedDict, cast

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from hil.record import CarriedRecording

Job = tuple[int, int]
"""Cycle of the motion and number of the stimulus."""


class Row(TypedDict):
    """What a copy found."""

    cycle: int
    stimulus: int
    """Its number."""
    reaction: str
    error: str
    broken: list[str]
    measures: dict[str, dict[str, float]]
    rest: dict[str, float]
    digest: str


WALL_LIMIT_S: Final = 60
"""Time that a copy, or judging it, may take by the wall clock, s."""
_PIPE_BYTES: Final = 1024 * 1024
"""A copy that can write all of its recording at once does not wait for its reader."""
_JOB: Final = struct.Struct("<qq")
"""In front of a recording on its way to a judge."""

Ending = Callable[[str], tuple[str, "CarriedRecording"]]
"""Takes why a copy came to no end (empty: it did); returns it again with the recording."""
Judge = Callable[[Job, str, "CarriedRecording"], Row]


class Child:
    """This process, if it is a copy."""

    def __init__(self, pipe: int) -> None:
        self._pipe = pipe
        self.recording: Callable[[], CarriedRecording] | None = None

    def end(self, problem: str) -> NoReturn:
        """Hand the recording over and end the process."""
        try:
            assert self.recording is not None
            answer: object = (problem, self.recording())
        except Exception as error:  # noqa: BLE001 - a row of the result, too
            answer = f"{type(error).__name__}: {error}"
        left = memoryview(pickle.dumps(answer, protocol=pickle.HIGHEST_PROTOCOL))
        while left:
            left = left[os.write(self._pipe, left) :]
        os._exit(0)


class Copies:
    """The copies that run, and the judges.

    Args:
        most: Copies and judges that are at work at the same time.
        judge: Makes a row of a job, its problem and its recording; called in other processes.
        on_row: Told the row of every job.

    """

    def __init__(self, most: int, judge: Judge, on_row: Callable[[Row], object]) -> None:
        self._most = most
        self._judge = judge
        self._on_row = on_row
        self._running: dict[int, tuple[int, Job, bytearray]] = {}
        """Process, job, and the job with what has come so far, by the pipe."""
        self._judging: dict[int, tuple[_JudgeProcess, Job]] = {}
        """By the connection."""
        self._idle: list[_JudgeProcess] = []
        self._selector = selectors.DefaultSelector()
        self._buffer = bytearray(_PIPE_BYTES)
        self.child: Child | None = None
        """This process as a copy; None in the first process."""

    def fork(self, job: Job) -> bool:
        """Make a copy as soon as there is room; returns whether this is the copy."""
        while len(self._running) + len(self._judging) >= self._most:
            self._collect()
        ours, theirs = os.pipe()
        with contextlib.suppress(OSError, AttributeError):  # a matter of speed, and of Linux
            fcntl.fcntl(theirs, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
        process = _forked()
        if process == 0:
            signal.alarm(WALL_LIMIT_S)
            gc.disable()  # nearly all that it makes is in use until it ends
            os.close(ours)
            self._close()
            self.child = Child(theirs)
            return True
        os.close(theirs)
        self._running[ours] = (process, job, bytearray(_JOB.pack(*job)))
        self._selector.register(ours, selectors.EVENT_READ)
        return False

    def wait(self) -> None:
        """Wait for all copies."""
        while self._running or self._judging:
            self._collect()

    def stop(self) -> None:
        """End the processes that are left, the judges among them."""
        judges = [*self._idle, *(judge for judge, _ in self._judging.values())]
        processes = [process for process, _, _ in self._running.values()]
        self._close()
        for process in [*processes, *(judge.process for judge in judges)]:
            with contextlib.suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)

    def _close(self) -> None:
        """Close what leads to other processes."""
        self._selector.close()
        for pipe in self._running:
            os.close(pipe)
        for judge in [*self._idle, *(judge for judge, _ in self._judging.values())]:
            judge.connection.close()
        self._running, self._judging, self._idle = {}, {}, []

    def _collect(self) -> None:
        """Take what copies and judges have sent."""
        for key, _ in self._selector.select():
            if key.fd in self._running:
                self._hear(int(key.fd))
            else:
                self._take(int(key.fd))

    def _hear(self, pipe: int) -> None:
        process, job, content = self._running[pipe]
        size = os.readv(pipe, [self._buffer])
        if size:
            content += memoryview(self._buffer)[:size]
            return
        self._selector.unregister(pipe)
        os.close(pipe)
        del self._running[pipe]
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        if code != 0 or len(content) == _JOB.size:
            self._on_row(failed(job, _how_it_ended("the copy", code)))
            return
        judge = self._idle.pop() if self._idle else self._start_judge()
        self._judging[judge.connection.fileno()] = (judge, job)
        self._selector.register(judge.connection, selectors.EVENT_READ)
        with contextlib.suppress(OSError):  # a judge that has died is noticed when its answer is read
            judge.connection.send_bytes(content)

    def _take(self, file: int) -> None:
        judge, job = self._judging.pop(file)
        self._selector.unregister(judge.connection)
        try:
            row = cast("Row", json.loads(judge.connection.recv_bytes()))
        except (EOFError, OSError):
            judge.connection.close()
            code = os.waitstatus_to_exitcode(os.waitpid(judge.process, 0)[1])
            row = failed(job, _how_it_ended("the process that judges the copy", code))
        else:
            self._idle.append(judge)
        self._on_row(row)

    def _start_judge(self) -> _JudgeProcess:
        ours, theirs = Pipe()
        process = _forked()
        if process:
            theirs.close()
            return _JudgeProcess(process, ours)
        ours.close()
        self._close()
        code = 1
        try:
            _serve(theirs, self._judge)
            code = 0
        finally:
            os._exit(code)


class _JudgeProcess:
    """A judge, as the first process sees it."""

    def __init__(self, process: int, connection: Connection) -> None:
        self.process = process
        self.connection = connection


def _serve(connection: Connection, judge: Judge) -> None:
    """Judge recordings until there are no more."""
    while True:
        try:
            content = connection.recv_bytes()
        except (EOFError, OSError):
            return
        signal.alarm(WALL_LIMIT_S)
        job: Job = _JOB.unpack_from(content)
        try:
            answer = pickle.loads(memoryview(content)[_JOB.size :])  # noqa: S301 - of a copy of this process
            row = failed(job, answer) if isinstance(answer, str) else judge(job, *answer)
        except Exception as error:  # noqa: BLE001 - a row of the result, too
            row = failed(job, f"{type(error).__name__}: {error}")
        signal.alarm(0)
        connection.send_bytes(json.dumps(row, sort_keys=True, separators=(",", ":")).encode())


def _forked() -> int:
    """Fork; returns 0 in the new process, which says nothing, ends with Ctrl-C, and knows no alarm."""
    if sys.version_info >= (3, 12):
        with warnings.catch_warnings():
            # Python warns of threads, which a virtual bench does not have; those of a test runner sleep.
            warnings.simplefilter("ignore", DeprecationWarning)
            process = os.fork()
    else:
        process = os.fork()
    if process == 0:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        silent = os.open(os.devnull, os.O_RDWR)
        for stream in (0, 1, 2):
            os.dup2(silent, stream)
    return process


def _how_it_ended(who: str, code: int) -> str:
    if code == -signal.SIGALRM:
        return f"{who} took more than {WALL_LIMIT_S} s"
    return f"{who} ended with exit code {code}"


def failed(job: Job, problem: str) -> Row:
    """Return the row of a copy of which nothing is known."""
    return {
        "cycle": job[0], "stimulus": job[1], "reaction": problem, "error": problem, "broken": [],
        "measures": {}, "rest": {}, "digest": "",
    }  # fmt: skip
