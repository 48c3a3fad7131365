"""Tasks for a pool of processes; the module imports little, because every new process imports it."""

import os
import signal
import time
from dataclasses import dataclass

from hil.errors import HilError


@dataclass(frozen=True)
class Sleeper:
    """A task with several answers, which may hang, die, or fail before the last."""

    answers: tuple[str, ...]

    def run(self, send):
        for answer in self.answers:
            if answer == "hang":
                signal.pause()
            elif answer == "die":
                os._exit(7)
            elif answer == "fail":
                raise HilError("it cannot be done")
            send(answer)

    def patience(self, answers):
        return 60.0 if answers < self.answers.index("hang") else 0.2


@dataclass(frozen=True)
class Patient(Sleeper):
    """A task that has all the time."""

    def patience(self, answers):
        return 60.0


@dataclass(frozen=True)
class Worked:
    """A task of less processor time than wall time, or the other way round."""

    wait_s: float
    """How long it waits before it begins, s."""
    work_s: float
    """Processor time that it then uses, s."""
    patience_s: float

    def run(self, send):
        time.sleep(self.wait_s)
        until_s = time.process_time() + self.work_s
        while time.process_time() < until_s:
            pass
        send("worked")

    def patience(self, answers):
        return self.patience_s


@dataclass(frozen=True)
class Number:
    """A task that answers with the number of its process."""

    def run(self, send):
        send(os.getpid())

    def patience(self, answers):
        return 60.0
