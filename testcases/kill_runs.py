"""Kill a campaign again and again at random moments, and check what is left: `python -m testcases.kill_runs
--times 50`.

After every kill (signal 9) the journal has to be readable and to hold every case that the run had reported to
have ended. A run that was killed is resumed, killed, resumed, until it completes; then it has to be, bit for
bit, what an undisturbed run is.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Container
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn, Protocol

from hil import cli
from hil._commands import run as _run  # noqa: F401 - a copy is to have imported it
from reports.store import JOURNAL_FILE, RUN_FILE, load_run
from testcases.processes import hil_command

REPORTED = re.compile(r"\[ *\d+/\d+\] \w+ +(\S+) \(")
"""Line of a case that has ended."""
WITHIN_S = 0.2
"""Kills after a case come at any time within so many seconds: while the next ones run, or are written to the
journal.
"""


class Process(Protocol):
    """A run, as a moment sees it."""

    def poll(self) -> int | None:
        """Return how it ended; None: it runs."""


Moment = Callable[[Process, set[str]], None]
"""Waits for the moment of the kill, with the process and the cases that it has reported so far."""


@dataclass(slots=True)
class Session:
    """What came of a campaign that was killed until it was through."""

    kills: int = 0
    in_time: int = 0
    """Kills that met the run before its first case had ended."""
    cases: int = 0
    digest: str = ""
    reported: set[str] = field(default_factory=set)


def after_seconds(seconds: float) -> Moment:
    """Return a moment by the clock: start of Python, campaign and report are met as well."""

    def moment(process: Process, reported: set[str]) -> None:
        del reported
        end = time.monotonic() + seconds
        _wait(process, lambda: time.monotonic() >= end)

    return moment


def after_cases(number: int, seconds: float = 0.0) -> Moment:
    """Return the moment so long after so many further cases have been reported."""
    later = after_seconds(seconds)

    def moment(process: Process, reported: set[str]) -> None:
        _wait(process, lambda: len(reported) >= number)
        later(process, reported)

    return moment


def _wait(process: Process, condition: Callable[[], bool]) -> None:
    while process.poll() is None and not condition():
        time.sleep(0.002)


def command(directory: Path, arguments: list[str]) -> list[str]:
    """Return the arguments of `hil`."""
    return ["run", *arguments, "--report", str(directory), "--resume", "--json", "--verbose"]


def start(directory: Path, arguments: list[str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*hil_command(), *command(directory, arguments)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


class Copy:
    """A run in a copy of this process, with what a `Popen` has.

    Args:
        arguments: Of `hil`.

    """

    def __init__(self, arguments: list[str]) -> None:
        pipes = [os.pipe(), os.pipe()]
        self.pid = os.fork()
        if self.pid == 0:
            self._run(arguments, [write for _, write in pipes])
        for _, write in pipes:
            os.close(write)
        self.stdout, self.stderr = (os.fdopen(read, encoding="utf-8") for read, _ in pipes)
        self._code: int | None = None

    def _run(self, arguments: list[str], outputs: list[int]) -> NoReturn:
        code = 1
        try:
            os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
            for stream, output in enumerate(outputs, 1):
                os.dup2(output, stream)
            code = cli.main(arguments)
        finally:
            os._exit(code)

    def poll(self) -> int | None:
        """Return how it ended; None: it runs."""
        return self._code if self._code is not None else self._ended(os.WNOHANG)

    def wait(self) -> int:
        """Wait for its end; returns how it ended."""
        if self._code is None:
            self._ended(0)
        assert self._code is not None
        return self._code

    def _ended(self, options: int) -> int | None:
        process, status = os.waitpid(self.pid, options)
        if process:
            self._code = os.waitstatus_to_exitcode(status)
        return self._code

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)


def killed(
    directory: Path, arguments: list[str], moment: Moment, session: Session, *, copied: bool = False
) -> bool:
    """Run on from what is in the folder and kill the run; returns False when it was through before.

    Args:
        directory: Folder of the run.
        arguments: Of `hil run`.
        moment: When it is killed.
        session: Gets the kill.
        copied: The run is a copy of this process.

    Raises:
        AssertionError: The journal cannot be read, or lacks a case that had ended.

    """
    process = Copy(command(directory, arguments)) if copied else start(directory, arguments)
    reported: set[str] = set()

    def read() -> None:
        assert process.stderr is not None
        for line in process.stderr:
            if found := REPORTED.match(line):
                reported.add(found[1])

    reader = threading.Thread(target=read)
    reader.start()
    moment(process, reported)
    process.send_signal(signal.SIGKILL)
    code = process.wait()
    reader.join()  # the workers have its pipe too: they have ended now
    assert process.stdout is not None
    process.stdout.close()
    if code != -signal.SIGKILL:
        assert code == 0, f"the run ended with {code}"
        return False
    session.kills += 1
    session.in_time += not reported
    session.reported |= reported
    left = (
        {case.identifier for case in load_run(directory).cases} if (directory / RUN_FILE).exists() else set()
    )
    assert left >= session.reported, f"lost: {session.reported - left}"
    assert (directory / RUN_FILE).exists() or not (directory / JOURNAL_FILE).exists()
    return True


def completed(directory: Path, arguments: list[str], session: Session) -> None:
    """Resume the run to its end and note what it is.

    Raises:
        AssertionError: It does not end well, or a case that had ended is missing.

    """
    process = start(directory, arguments)
    answer, error = process.communicate()
    assert process.returncode == 0, error
    run = load_run(directory)
    assert not run.interrupted
    assert {case.identifier for case in run.cases} >= session.reported
    session.cases = len(run.cases)
    session.digest = json.loads(answer)["trace_digest"]


def kill_until_through(
    arguments: list[str], moments: Callable[[int], Moment | None], *, copied: Container[Moment] = ()
) -> Session:
    """Run a campaign in a folder of its own, killed at every moment that `moments(number)` gives, then to its
    end.

    Args:
        arguments: Of `hil run`.
        moments: Takes the number of kills so far; None: no more.
        copied: Moments at which the run is a copy of this process.

    """
    with tempfile.TemporaryDirectory(prefix="hil-kill-") as folder:
        directory, session = Path(folder) / "report", Session()
        while (moment := moments(session.kills)) is not None:
            if not killed(directory, arguments, moment, session, copied=moment in copied):
                break
        completed(directory, arguments, session)
    return session


def main() -> int:
    """Kill as often as asked for, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=50, help="number of kills")
    parser.add_argument("--seed", type=int, default=0, help="seed of the moments")
    parser.add_argument(
        "--early", type=float, default=0.2, help="share of kills by the clock, mostly while programs start"
    )
    parser.add_argument(
        "--longest", type=float, default=4.0, help="latest moment of those, s after the start"
    )
    parser.add_argument(
        "--cases", type=int, default=10, help="the others come after up to so many further cases"
    )
    parser.add_argument(
        "--jobs", type=int, nargs="+", default=[1, 2], help="worker processes of the runs, in turn"
    )
    parser.add_argument("arguments", nargs="*", default=["testcases.campaigns.stop_modes"])
    given = parser.parse_args()
    draw = random.Random(given.seed)
    undisturbed = kill_until_through(given.arguments, lambda _kills: None).digest
    kills = in_time = sessions = 0
    while kills < given.times:
        most = given.times - kills
        behind: list[Moment] = []

        def moments(number: int, most: int = most, behind: list[Moment] = behind) -> Moment | None:
            if number >= most:
                return None
            if draw.random() < given.early:
                return after_seconds(draw.uniform(0.0, given.longest))
            behind.append(after_cases(draw.randint(1, given.cases), draw.uniform(0.0, WITHIN_S)))
            return behind[-1]

        jobs = given.jobs[sessions % len(given.jobs)]
        session = kill_until_through([*given.arguments, "-j", str(jobs)], moments, copied=behind)
        assert session.digest == undisturbed, "the resumed run differs from the undisturbed one"
        kills, in_time, sessions = kills + session.kills, in_time + session.in_time, sessions + 1
        print(
            f"{kills} kills, {in_time} of them before a further case had ended; {sessions} runs of "
            f"{session.cases} cases whole",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
