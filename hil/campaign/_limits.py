"""Time limits of a case, in bench time, wall time and processor time."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import TYPE_CHECKING, Final

from fieldbus.clock import MS, seconds_to_ns
from hil.errors import CaseEndedError, CaseTimeoutError

if TYPE_CHECKING:
    from hil.protocols import Bench

AGAIN_S: Final = 5.0
"""Time that a case has to end, and its bench to be closed, once it has been asked to."""
USED_UP: Final = "the case has used up its limit"
"""How the message of a case begins that ran into one of its limits."""


def limit_simulated(bench: Bench, seconds: float) -> None:
    """Let the bench raise `CaseTimeoutError` once `seconds` of its time have passed from now.

    It is raised again every millisecond after that, for a case that swallows it and continues.
    """
    scheduler = bench.scheduler
    due_ns = scheduler.now + seconds_to_ns(seconds)

    def expire() -> None:
        scheduler.after(MS, expire)
        raise CaseTimeoutError(f"{USED_UP} of {seconds:g} s of bench time")

    scheduler.at(due_ns, expire)


@contextmanager
def limit_wall(seconds: float) -> Iterator[None]:
    """Raise `CaseTimeoutError` in this thread once `seconds` of wall time have passed.

    A case that swallows it and continues gets `CaseEndedError` some seconds later, and again, which
    no `except Exception` takes. Works in the main thread of a POSIX system, which is where cases
    run; elsewhere there is no limit.
    """
    with _limit(seconds, "wall time", "SIGALRM", "ITIMER_REAL"):
        yield


@contextmanager
def limit_processor(seconds: float) -> Iterator[None]:
    """Do the same once this process has used `seconds` of processor time, however long that takes on a loaded
    machine. Time that it waits does not count.
    """
    with _limit(seconds, "processor time", "SIGPROF", "ITIMER_PROF"):
        yield


@contextmanager
def _limit(seconds: float, what: str, signal_name: str, timer_name: str) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "setitimer"):
        yield
        return

    reported = False

    def expire(number: int, frame: FrameType | None) -> None:  # noqa: ARG001 - signature of a signal handler
        nonlocal reported
        text = f"{USED_UP} of {seconds:g} s of {what}"
        if reported:
            raise CaseEndedError(f"{text}, and did not end when it was asked to")
        reported = True
        raise CaseTimeoutError(text)

    # These names exist only where the system has such timers.
    number, timer = getattr(signal, signal_name), getattr(signal, timer_name)
    old_handler = signal.signal(number, expire)
    signal.setitimer(timer, seconds, AGAIN_S)
    try:
        yield
    finally:
        signal.setitimer(timer, 0.0)
        signal.signal(number, old_handler)
