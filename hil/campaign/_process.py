"""A worker process: it gets orders over a socket of its own, one at a time, and answers with results.

What one of them does to itself concerns its case alone: a process that dies or hangs is known by its socket,
and the others go on.
"""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
from multiprocessing.connection import Connection
from typing import Final, Self

from hil._interrupt import held
from hil.campaign._worker import Order, Parcel, run_parcel
from hil.errors import HilError

LONGEST_WAIT_S: Final = 3600.0
"""Waits are made of such pieces: the system has a limit for one."""
_END_S: Final = 5.0
"""Time that a process has to end by itself once nobody needs it any more."""


class WorkerLostError(HilError):
    """A worker has died, or had to be ended, while it ran a case."""


class WorkerProcess:
    """A Python process that runs orders.

    Args:
        path: Where it finds modules; default: where this process does.

    """

    def __init__(self, path: list[str] | None = None) -> None:
        ours, theirs = socket.socketpair()
        program = (
            f"import sys; sys.path[:] = {sys.path if path is None else path!r}; "
            f"from hil.campaign._process import serve; serve({theirs.fileno()})"
        )
        # A process started meanwhile never gets Ctrl-C, which is meant for the command.
        with theirs, held():
            self._process = subprocess.Popen(  # noqa: S603 - our own interpreter and program
                [sys.executable, "-c", program], pass_fds=(theirs.fileno(),), stdin=subprocess.DEVNULL
            )
        self.connection = Connection(ours.detach())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def send(self, order: Order) -> None:
        """Hand over an order.

        Raises:
            WorkerLostError: The process is not there any more.

        """
        try:
            self.connection.send(order)
        except OSError as error:
            raise WorkerLostError(self._death()) from error

    def receive(self) -> Parcel:
        """Wait for the answer to the order.

        Raises:
            WorkerLostError: The process has died instead, or the case could not even be found there.

        """
        try:
            answer = self.connection.recv()
        except (EOFError, OSError) as error:
            raise WorkerLostError(self._death()) from error
        if not isinstance(answer, Parcel):
            raise WorkerLostError(str(answer))
        return answer

    def run(self, order: Order) -> Parcel:
        """Run an order and wait for the answer, with the order's patience.

        Raises:
            WorkerLostError: The process has died, or was ended because it hung.

        """
        self.send(order)
        due_s = time.monotonic() + (
            order.patience_s or float("inf")
        )  # wall time of a process, not of a bench
        answered = False
        while not answered and (rest_s := due_s - time.monotonic()) > 0.0:
            answered = self.connection.poll(min(rest_s, LONGEST_WAIT_S))
        if not answered:
            self.kill()
            raise WorkerLostError(hung(order))
        return self.receive()

    def kill(self) -> None:
        """End the process at once."""
        self.connection.close()
        self._process.kill()
        self._process.wait()

    def close(self) -> None:
        """Let the process end; it is between two orders, or its case does not count any more."""
        self.connection.close()
        try:
            self._process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self.kill()

    def _death(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            code = self._process.wait(_END_S)
            how = f"signal {-code}" if code < 0 else f"exit code {code}"
            return f"the process that ran this case died: {how}"
        self.kill()
        return "the process that ran this case answers no more"


def hung(order: Order) -> str:
    """Return what is told of a case whose process had to be ended."""
    return f"the process that ran this case did not answer for {order.patience_s:g} s and was ended"


def serve(handle: int) -> None:
    """Run orders from the socket `handle` until its other end is closed; the body of a worker process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.dup2(2, 1)  # what cases print is for people: standard output belongs to the result of the command
    connection = Connection(handle)
    orders: queue.SimpleQueue[Order] = queue.SimpleQueue()

    def listen() -> None:
        while True:
            try:
                orders.put(connection.recv())
            except (EOFError, OSError):
                # The command is gone, killed perhaps: nobody waits for what is being done here.
                os._exit(0)

    threading.Thread(target=listen, name="orders", daemon=True).start()
    while True:
        order = orders.get()
        try:
            answer: Parcel | str = run_parcel(order)
        except HilError as error:
            answer = str(error)
        except BaseException:  # noqa: BLE001 - whatever it is, the command has to hear of it
            answer = traceback.format_exc()
        with contextlib.suppress(OSError):
            connection.send(answer)
