"""One connected page, as the server sees it."""

from __future__ import annotations

import asyncio
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Final

from hil.cockpit.messages import encoded

_MOST_BYTES: Final = 8 * 1024 * 1024
"""Replies and samples that wait for a page before its connection is given up, bytes."""
BUSY_BYTES: Final = 128 * 1024
"""Bytes that wait for a page above which it gets no new samples and states."""


class Client:
    """A page: what waits to be sent to it, and its last sign of life.

    `send` and `show` may be called from any thread.

    Args:
        number: Tells pages apart.
        loop: The loop of the server.

    """

    def __init__(self, number: int, loop: asyncio.AbstractEventLoop) -> None:
        self.number = number
        self.name = f"page {number}"
        self.life_s = time.monotonic()
        """Time of the last sign of life of the operator."""
        self.shown_s = self.life_s
        """Time of the state that the page showed then."""
        self.closed = False
        self._loop = loop
        self._waiting: deque[str | bytes] = deque()
        self._state: str | None = None
        self._wake = asyncio.Event()
        self._bytes = 0
        self._leaving = 0
        self._counting = threading.Lock()

    @property
    def busy(self) -> bool:
        """Whether so much waits for it already that new samples have to wait."""
        return self._bytes > BUSY_BYTES

    def alive(self, shown_s: float | None = None) -> None:
        """Note a sign of life.

        Args:
            shown_s: Monotonic time of the newest state that the page shows, s; None: it is fresh.

        """
        self.life_s = time.monotonic()
        self.shown_s = self.life_s if shown_s is None else min(shown_s, self.life_s)

    def send(self, content: object) -> None:
        """Send a document, or bytes as they are; what was sent before comes before it."""
        self._post(content if isinstance(content, bytes) else encoded(content))

    def show(self, state: str) -> None:
        """Send a state; one that has not left yet is replaced by it."""
        if not self.closed:
            self._call(self._replace, state)

    def _post(self, content: str | bytes) -> None:
        if not self.closed:
            self._count(len(content))
            self._call(self._append, content)

    def _count(self, size: int) -> None:
        with self._counting:
            self._bytes += size

    def _call(self, function: Callable[..., None], content: str | bytes) -> None:
        try:
            self._loop.call_soon_threadsafe(function, content)
        except RuntimeError:  # the server has ended
            self.closed = True

    def _append(self, content: str | bytes) -> None:
        self._waiting.append(content)
        self._wake.set()

    def _replace(self, state: str) -> None:
        self._state = state
        self._wake.set()

    async def next(self) -> str | bytes | None:
        """Return what is to be sent next, waiting for it; None: the page reads too slowly to go on with."""
        while not self._waiting and self._state is None:
            self._wake.clear()
            await self._wake.wait()
        if self._bytes > _MOST_BYTES:
            return None
        if self._waiting:
            content = self._waiting.popleft()
            self._leaving = len(content)
            return content
        state, self._state = self._state, None
        return state

    def sent(self) -> None:
        """Note that what `next` returned has gone."""
        self._count(-self._leaving)
        self._leaving = 0
