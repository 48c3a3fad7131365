"""Ctrl-C, SIGTERM and the end of the terminal: the first one ends a command in order, and those that follow
at once do not disturb that.
"""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Final

ORDERLY_S: Final = 10.0
"""How long further signals are ignored after the first: drives are disabled,
processes end, the report is written.
"""

_SIGNALS: Final = (
    signal.SIGINT,
    signal.SIGTERM,
    *((signal.SIGHUP,) if hasattr(signal, "SIGHUP") else ()),
)
_STANDARD_ERROR: Final = 2
_asked_s: float | None = None


def note() -> None:
    """Remember that the end has been asked for; from now on further signals are ignored for `ORDERLY_S`."""
    global _asked_s  # noqa: PLW0603 - signals belong to the process
    if _asked_s is None:
        _asked_s = time.monotonic()


def asked() -> bool:
    """Return whether the end of the present command has been asked for."""
    return _asked_s is not None


def _interrupt(number: int, frame: FrameType | None) -> None:
    if _asked_s is not None and time.monotonic() - _asked_s < ORDERLY_S:
        # Not through sys.stderr: a handler that interrupts a write of the same stream is refused with
        # RuntimeError, and that would end the command.
        with suppress(OSError):  # the terminal may be gone
            os.write(_STANDARD_ERROR, b"ending\n")
        return
    note()
    signal.default_int_handler(number, frame)


@contextmanager
def interruptible(*, last: bool = False) -> Iterator[None]:
    """Turn the first Ctrl-C, SIGTERM or SIGHUP into `KeyboardInterrupt`, once.

    Args:
        last: Nothing comes after the command but the end of the process: signals stay ignored when one
            has come.

    """
    global _asked_s  # noqa: PLW0603 - signals belong to the process
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    _asked_s = None
    # A process that was started with a signal ignored, by nohup for example, continues ignoring it.
    wanted = [number for number in _SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, _interrupt) for number in wanted}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if last and asked() else handler)


@contextmanager
def held() -> Iterator[None]:
    """Hold Ctrl-C back; a process that is started meanwhile never gets it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_parent() -> None:
    """Let this worker process end when its parent has ended or was killed.

    A pool's own queues do not tell: every process holds both of their ends.
    """
    import multiprocessing  # not in the start of the command

    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=wait, name="parent's death", daemon=True).start()
