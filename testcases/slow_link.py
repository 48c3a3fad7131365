"""A slow network on the loopback: a relay that limits what passes in a second and delays it."""

from __future__ import annotations

import time
from contextlib import suppress
from math import inf
from queue import Queue
from socket import AF_INET, SO_RCVBUF, SO_SNDBUF, SOCK_STREAM, SOL_SOCKET, create_server, socket
from threading import Thread
from typing import Self

_CHUNK = 2048
_BUFFER = 8192
"""Bytes that the sockets of the relay hold, so that the link is slow and not deep."""
_IN_FLIGHT = 32


class SlowLink:
    """A relay to a port of this machine.

    `down` (from there) and `up` are what passes in a second, bytes; `delay_s` is the delay each way.

    Args:
        port: Where it leads.

    """

    def __init__(self, port: int) -> None:
        self.down = self.up = inf
        self.delay_s = 0.0
        self._target = port
        self._listening = create_server(("127.0.0.1", 0))
        self._listening.setsockopt(SOL_SOCKET, SO_SNDBUF, _BUFFER)
        self.port = int(self._listening.getsockname()[1])
        self._open: list[socket] = [self._listening]
        Thread(target=self._accept, daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        for one in self._open:
            with suppress(OSError):
                one.close()

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                near, _ = self._listening.accept()
                far = socket(AF_INET, SOCK_STREAM)
                far.setsockopt(SOL_SOCKET, SO_RCVBUF, _BUFFER)
                far.connect(("127.0.0.1", self._target))
                self._open += [near, far]
                self._relay(far, near, "down")
                self._relay(near, far, "up")

    def _relay(self, source: socket, sink: socket, way: str) -> None:
        flying: Queue[tuple[float, bytes]] = Queue(_IN_FLIGHT)

        def take() -> None:
            data = b"-"
            while data:
                try:
                    data = source.recv(_CHUNK)
                except OSError:
                    data = b""
                flying.put((time.monotonic(), data))

        def give() -> None:
            while True:
                taken_s, data = flying.get()
                time.sleep(max(0.0, taken_s + self.delay_s - time.monotonic()))
                time.sleep(len(data) / getattr(self, way))
                with suppress(OSError):
                    if not data:
                        sink.close()
                        return
                    sink.sendall(data)

        Thread(target=take, daemon=True).start()
        Thread(target=give, daemon=True).start()
