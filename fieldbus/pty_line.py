"""A pseudo-terminal: one end for us, the other a device file that any program opens as a serial port."""

from __future__ import annotations

import os
import select
import tty
from collections.abc import Callable
from contextlib import suppress
from threading import Event, Lock, Thread
from typing import Final

from fieldbus.clock import Scheduler

_BUFFER: Final = 4096
_POLL_S: Final = 0.1
_PIECE: Final = 4096


class PtyLine:
    """Our end of the line, and a thread that waits for it.

    Args:
        scheduler: A realtime scheduler, on which `receive` is called.
        receive: Called with what the program has written, in pieces of any size.

    Raises:
        OSError: The system has no pseudo-terminal left.

    """

    def __init__(self, scheduler: Scheduler, receive: Callable[[bytes], object]) -> None:
        self._scheduler = scheduler
        self._receive = receive
        # Our own handle on the program's end keeps the line alive while no program is there.
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        """The device file."""
        self._wake_read, self._wake_write = os.pipe()
        os.set_blocking(self._wake_write, False)
        self._output = bytearray()
        self._lock = Lock()
        self._closed = Event()
        self._thread = Thread(target=self._run, name=f"serial line {self.path}", daemon=True)
        self._thread.start()

    @property
    def free(self) -> int:
        """Bytes that `write` would take now."""
        return _BUFFER - len(self._output)

    def write(self, data: bytes) -> bool:
        """Send `data` to the program, all of it or nothing; returns whether it fitted."""
        if not data:
            return True
        with self._lock:
            if len(data) > self.free or self._closed.is_set():
                return False
            self._output += data
        with suppress(BlockingIOError):  # full: it will wake all the same
            os.write(self._wake_write, b"\0")
        return True

    def discard(self) -> None:
        """Forget what has not reached the program yet."""
        with self._lock:
            self._output.clear()

    def _run(self) -> None:
        while not self._closed.is_set():
            wanted = [self._master] if self._output else []
            readable, writable, _ = select.select([self._master, self._wake_read], wanted, [], _POLL_S)
            if self._wake_read in readable:
                os.read(self._wake_read, _PIECE)
            if self._master in readable:
                with suppress(OSError):
                    data = os.read(self._master, _PIECE)
                    self._scheduler.post(lambda data=data: self._receive(data))  # type: ignore[misc]
            if writable:
                with self._lock, suppress(OSError):
                    del self._output[: os.write(self._master, self._output)]

    def close(self) -> None:
        """End the thread and take the device file away; harmless to repeat."""
        if self._closed.is_set():
            return
        self._closed.set()
        with suppress(BlockingIOError):
            os.write(self._wake_write, b"\0")
        self._thread.join(10 * _POLL_S)
        for descriptor in (self._master, self._slave, self._wake_read, self._wake_write):
            os.close(descriptor)
